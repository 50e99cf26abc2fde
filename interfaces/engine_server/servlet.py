"""The server submodule: what resides near the engine and serves one client of it.

Source: Doulgeri, Zikos, Delopoulos, section III.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

from interfaces.engine_server.broadcast import DUE, MOST_VIEWERS, Broadcaster, CompactSlot, FrameSlot
from interfaces.engine_server.forecasts import Forecasts
from interfaces.engine_server.journal import MOST_CHANGED, Journal
from interfaces.link.delivery import REMEMBERED, OrderBook
from interfaces.messages import (
    Answer,
    Ask,
    Follow,
    Frame,
    FrameStatus,
    FrameVerdict,
    Order,
    Outcome,
    Pulse,
    Refusal,
    Reply,
    Request,
    Scene,
    ViewForm,
    Want,
)
from interfaces.messages.fields import MOST_NAMES
from interfaces.messages.requests import portable
from vrs.engine import Engine
from vrs.errors import InvalidValueError
from vrs.model import frozen_array
from vrs.timeline import Timeline

WATCHED = 64
"""Newest outcomes that are sent again when later commands change them."""

OUTBOX = 1024
"""Replies that wait to be sent; the oldest is dropped first, and asked for again by the client."""

PULSE = 0.1
"""Period at which a follower of segments is told how far the timeline is complete [s]."""


class Commander(Protocol):
    """Who carries out what clients order: an engine's journal, or a mobile robot that is driven live."""

    @property
    def engine(self) -> Engine:
        """What the commands are given to."""

    def carry_out(self, order: Order, *, now: float) -> Outcome:
        """Carry out an order whose turn it is.

        Args:
            order: What is ordered.
            now: The engine's time [s].
        """


class Servlet:
    """Carries out a client's orders once each, in their order, and answers what it asks.

    See `OrderBook` for the order of the orders.
    """

    def __init__(
        self,
        source: Engine | Commander,
        *,
        lead: float = 0.0,
        broadcasters: Sequence[Broadcaster] = (),
        admit: Callable[[Order], Refusal | None] | None = None,
    ) -> None:
        """Serve one client.

        Args:
            source: The engine, or its journal where others serve it too; or who else carries out orders, of whom
                there's nothing to ask.
            lead: How far ahead of the engine's time answers to `Ask(None)` are [s].
            broadcasters: Where followers of frames find them.
            admit: Says why an order isn't carried out when its turn comes; None where it is.
        """
        self._admit = admit
        self._commander = Journal(source) if isinstance(source, Engine) else source
        self.outbox: deque[Reply] = deque(maxlen=OUTBOX)
        """What is sent next."""
        self.orders = OrderBook(self._carry_out, self.outbox.append)
        self.timeline = (
            ServedTimeline(self._commander, self.outbox, self.orders.outcomes, lead, broadcasters)
            if isinstance(self._commander, Journal)
            else None
        )
        """What the client sees of the timeline; None where none is to be followed."""

    def receive(self, message: Request, *, now: float) -> None:
        """Take a message of the client.

        Args:
            message: What has arrived.
            now: The engine's time [s].

        Raises:
            InvalidValueError: If it's no request, or asks for a timeline where there's none.
        """
        timeline = self.timeline
        if timeline is not None:
            timeline.look(now=now)
        if isinstance(message, Order):
            self.orders.take(message, now)
        elif timeline is None:
            raise InvalidValueError("message", message, "an Order: there's no timeline to follow")
        else:
            timeline.receive(message, now=now)
        if timeline is not None:
            timeline.look(now=now)

    def advance(self, *, now: float) -> tuple[Reply, ...]:
        """What is to be sent to the client.

        A transport that can't send doesn't call: the newest frame takes the place of the one that waits.

        Args:
            now: The engine's time [s].
        """
        if self.timeline is not None:
            self.timeline.advance(now=now)
        replies = tuple(self.outbox)
        self.outbox.clear()
        return replies

    def next_deadline(self) -> float | None:
        """When `advance` has something to send [s], in the engine's time; −∞ for at once."""
        if self.outbox:
            return float("-inf")
        return None if self.timeline is None else self.timeline.next_deadline()

    def close(self) -> None:
        """Leave the broadcaster."""
        if self.timeline is not None:
            self.timeline.close()

    def _carry_out(self, order: Order, now: float) -> Outcome:
        refused = None if self._admit is None else self._admit(order)
        if refused is not None:
            return Outcome(order.number, now, None, refused.text, code=refused.code)
        return self._commander.carry_out(order, now=now)


class ServedTimeline:
    """What one client sees of an engine's timeline: what it follows and asks, and what becomes of its orders."""

    def __init__(
        self,
        journal: Journal,
        outbox: deque[Reply],
        outcomes: OrderedDict[int, Outcome],
        lead: float,
        broadcasters: Sequence[Broadcaster],
    ) -> None:
        """Show nothing until it's asked for.

        Args:
            journal: Of the engine.
            outbox: Takes what is to be sent.
            outcomes: Of the client's orders, by number; those that a later command changes are sent again.
            lead: See `Servlet`.
            broadcasters: See there.
        """
        self.journal, self.outbox = journal, outbox
        self._outcomes, self._lead, self._broadcasters = outcomes, lead, tuple(broadcasters)
        self.answers: OrderedDict[int, Frame] = OrderedDict()
        """Frames that were sent lately, by number."""
        self._forecasts = Forecasts(REMEMBERED)
        self._edit = self.journal.look()
        self._follow: Follow | None = None
        self._snapshot: tuple[int, Timeline] = (0, self.journal.engine.timeline)
        self._slot: FrameSlot | CompactSlot | None = None
        self._source: Broadcaster | None = None
        self._beat: float | None = None

    def receive(self, message: Request, *, now: float) -> None:
        """Take what the client asks or wants to follow [s]; see `Servlet`."""
        if isinstance(message, Ask):
            self._answer(message, now)
        elif isinstance(message, Follow):
            self._begin(message, now)
        elif isinstance(message, Want):
            self._fetch(message, now)
        else:
            raise InvalidValueError("message", message, "an Order, Ask, Follow or Want")

    def advance(self, *, now: float) -> None:
        """Put into the outbox what is due by now [s]."""
        self.look(now=now)
        if self._beat is not None and now >= self._beat - DUE:
            self._beat = now + PULSE
            if self.journal.is_current:
                self.outbox.append(Pulse(self._edit, now, self.journal.past))
        message = self._slot.take() if self._slot is not None else None
        if message is not None:
            self.outbox.append(message)

    def next_deadline(self) -> float | None:
        """When `advance` has something for the outbox [s]; −∞ for at once."""
        return float("-inf") if self._slot else self._beat

    def close(self) -> None:
        """Leave the broadcaster."""
        if self._source is not None and self._slot is not None:
            self._source.leave(self._slot)
        self._slot = self._source = self._beat = self._follow = None

    def _answer(self, ask: Ask, now: float) -> None:
        frame = self.answers.get(ask.number)
        if frame is None:
            engine = self.journal.engine
            t = engine.now() + self._lead if ask.t is None else ask.t
            q = frozen_array(engine.timeline.sample(t))
            status = self._forecasts.add(ask.number, t, q, now=self.journal.past)
            frame = Frame(ask.number, t, now, q, status)
            self.answers[ask.number] = frame
            if len(self.answers) > REMEMBERED:
                self.answers.popitem(last=False)
        self.outbox.append(Answer.showing(frame, now))

    def _begin(self, follow: Follow, now: float) -> None:
        if self._follow is None or self._follow.number != follow.number:
            self.close()
            self._follow = follow
            self._snapshot = self._edit, self.journal.engine.timeline
            if follow.form is ViewForm.SEGMENTS:
                self._beat = now
            elif free := [source for source in self._broadcasters if source.viewers < MOST_VIEWERS]:
                wished = follow.rate or max(source.rate for source in free)
                self._source = min(free, key=lambda source: abs(source.rate - wished))
                compact = follow.form is ViewForm.COMPACT
                self._slot = self._source.join_compact(follow.delay) if compact else self._source.join()
        elif self._slot is not None:
            self._slot.begin_again()
        self._show_scene(now)

    def _show_scene(self, now: float) -> None:
        if self._follow is None:
            return
        edit, timeline = self._snapshot
        robot = self.journal.engine.model.name
        rate = None if self._source is None else self._source.rate
        initial = frozen_array(timeline.initial)
        span = timeline.start, timeline.end, len(timeline)
        names = tuple(self.journal.names) if rate is None else ()
        self.outbox.append(Scene(self._follow.number, robot, initial, *span, edit, now, rate, names))

    def _fetch(self, want: Want, now: float) -> None:
        if want.index is not None and want.edit == self._snapshot[0]:
            self.outbox.extend(self.journal.parts(*self._snapshot, want.index))
        elif want.index is None and self._send_changes(want.edit):
            return
        else:
            self._snapshot = self._edit, self.journal.engine.timeline
            self._show_scene(now)

    def _send_changes(self, since: int) -> bool:
        """Send every edit after one; whether they are all still there."""
        edits = self.journal.since(since)
        if edits and edits[0].number != since + 1:
            return False
        changes = [edit.change for edit in edits]
        known = [change for change in changes if change is not None and len(change.segments) <= MOST_CHANGED]
        if len(known) < len(changes):
            return False
        self.outbox.extend(known)
        return True

    def look(self, *, now: float) -> None:
        """Look what has been done to the timeline, and tell the client."""
        newest = self.journal.look()
        if newest != self._edit:
            found: list[FrameVerdict] = []
            for edit in self.journal.since(self._edit):
                found += self._forecasts.settle(edit.at)
                found += self._forecasts.edited(edit.timeline, edit.culprit)
            if self._beat is not None and not self._send_changes(self._edit):
                self._snapshot = newest, self.journal.engine.timeline
                self._show_scene(now)
            self._edit = newest
            self._tell(found, now)
            self._revise(now)
        self._tell(self._forecasts.settle(self.journal.past), now)

    def _tell(self, verdicts: Sequence[FrameVerdict], now: float) -> None:
        for verdict in verdicts:
            frame = self.answers.get(verdict.number)
            if frame is None:
                continue
            frame = replace(frame, status=verdict.status, falsified_by=verdict.falsified_by)
            self.answers[verdict.number] = frame
            if verdict.status is FrameStatus.FALSIFIED:
                self.outbox.append(Answer.showing(frame, now))

    def _revise(self, now: float) -> None:
        """Send the receipts again that a later command changed."""
        for number in list(self._outcomes)[-WATCHED:]:
            outcome = self._outcomes[number]
            old = outcome.receipt
            if old is None or old.end is None:
                continue
            new = self.journal.engine.receipt(old.command_id)
            if new.version != old.version:
                revised = Outcome(number, now, portable(new, MOST_NAMES), "", outcome.revision + 1)
                self._outcomes[number] = revised
                self.outbox.append(revised)
