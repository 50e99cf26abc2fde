"""Where a viewer's frames come from: a copy of the timeline, or frames that a servlet sends."""

from __future__ import annotations

import math
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import replace
from itertools import takewhile
from typing import TypeAlias, TypeVar

from interfaces.clients.observer import Observer
from interfaces.clients.playhead import LiveEdge
from interfaces.clients.ports import RemotePort
from interfaces.engine_server.broadcast import status_of
from interfaces.engine_server.forecasts import WINDOW, Forecasts
from interfaces.engine_server.journal import AHEAD, PART, changed
from interfaces.engine_server.site import earliest
from interfaces.link.delivery import interval_of
from interfaces.messages import (
    Broadcast,
    Change,
    Compact,
    Follow,
    Frame,
    FrameStatus,
    FrameVerdict,
    History,
    Pulse,
    Reply,
    Scene,
    Verdicts,
    ViewForm,
    Want,
)
from interfaces.messages.compact import MOST_FRAMES, CompactDecoder
from vrs.errors import InvalidValueError
from vrs.model import frozen_array
from vrs.segment import PolynomialSegment
from vrs.timeline import Timeline

HELD = 64
"""Edits that came before the one that they build on, and parts of a history before those in front, at most."""

BUFFERED = 256
"""Frames at hand, at most."""

NEAR = 0.6
"""A frame is shown for a time of the play head this many of the viewer's periods away, or less."""

LEAD = 0.02
"""How much sooner than the slowest round trip demands a frame is asked for [s]."""

SAME = 1e-9
"""Times that differ by less [s] are the same."""


Ahead: TypeAlias = Callable[[float], float | None]
"""Where a play head will be in so many seconds [s], if nobody moves it."""


class SegmentSource:
    """A copy of the timeline: fetched so far, then its edits followed; what is lost, is asked for again.

    It's evaluated at any time, at any rate, without asking.
    """

    delay = 0.0
    """Nothing need be asked for [s]."""

    def __init__(
        self,
        port: RemotePort,
        *,
        resend: float,
        lead: float = 0.0,
        applied: Callable[[Timeline, int, Change | None], None] = lambda *_: None,
    ) -> None:
        """Begin without a timeline.

        Args:
            port: By which it's followed.
            resend: After how long without an answer it's asked again [s].
            lead: How far ahead of what is heard of the engine's time this shows [s].
            applied: Is called with the copy whenever it's another one: the timeline, its edit's number, and the
                change that made it of the one before; None where it was fetched as a whole.
        """
        self._port, self._lead, self._applied = port, lead, applied
        self._resend = interval_of(resend)
        self._follow = Follow(port.number(), ViewForm.SEGMENTS)
        self._fetching: list[PolynomialSegment] | None = None
        self._early: dict[int, History] = {}
        self._held: dict[int, Change] = {}
        self._due = -math.inf
        self._behind = False
        self._forecasts = Forecasts()
        self._settled: list[FrameVerdict] = []
        self.live = LiveEdge()
        self.scene: Scene | None = None
        """What it began with."""
        self.edit = 0
        """Number of the newest edit in it."""
        self.timeline: Timeline | None = None
        """The copy; None until the whole timeline so far has come."""
        self.past = -math.inf
        """Up to this time [s] the copy is what happened."""
        self.gaps = 0
        """How often edits were missing, and asked for."""

    @property
    def span(self) -> tuple[float, float] | None:
        """Start and end of the timeline as far as it's known [s]."""
        return None if self.timeline is None else (self.timeline.start, self.timeline.end)

    def receive(self, message: Reply, *, now: float) -> None:
        """Take what concerns the timeline."""
        if isinstance(message, Scene) and message.number == self._follow.number:
            self._begin(message, now)
        elif isinstance(message, History):
            self._add(message, now)
        elif isinstance(message, Change):
            self._hold(message, now)
        elif isinstance(message, Pulse) and self.timeline is not None:
            if message.edit <= self.edit:
                self.past = max(self.past, message.past)
            else:
                self._lack(now)
        if isinstance(message, Pulse):
            self.live.heard(message.now + self._lead, now=now)
            self._settled += self._forecasts.settle(self.past)

    def _begin(self, scene: Scene, now: float) -> None:
        known = self.scene
        if known is not None and scene.edit <= (known.edit if self.timeline is None else self.edit):
            return
        self.scene, self._fetching = scene, []
        self._early.clear()
        self._ask(now) if scene.segments else self._complete(now)

    def _add(self, part: History, now: float) -> None:
        scene, fetching = self.scene, self._fetching
        if scene is None or fetching is None or part.edit != scene.edit or part.index < len(fetching):
            return
        self._early[part.index] = part
        if len(self._early) > HELD:
            del self._early[max(self._early)]
        before = len(fetching)
        while (following := self._early.pop(len(fetching), None)) is not None:
            fetching.extend(following.segments)
        if len(fetching) == before:
            return
        self._due = now + self._resend
        if len(fetching) >= scene.segments:
            self._complete(now)
        elif len(fetching) // (AHEAD * PART) > before // (AHEAD * PART):
            self._ask(now)

    def _complete(self, now: float) -> None:
        scene, fetching = self.scene, self._fetching
        assert scene is not None
        assert fetching is not None
        self._fetching = None
        self._advance_to(Timeline(scene.initial, scene.start, fetching), scene.edit, None)
        self._ask(now)

    def _hold(self, message: Change, now: float) -> None:
        if message.edit <= self.edit and self.timeline is not None:
            return
        self._held[message.base] = message
        if len(self._held) > HELD:
            del self._held[min(self._held)]
        self._apply(now)
        if self._held and self.timeline is not None:
            self._lack(now)

    def _apply(self, now: float) -> None:
        while self.timeline is not None and (message := self._held.pop(self.edit, None)) is not None:
            try:
                timeline = changed(self.timeline, message)
            except InvalidValueError:
                self._follow = Follow(self._port.number(), ViewForm.SEGMENTS)
                self.scene = self.timeline = None
                self._due = now
                return
            self._advance_to(timeline, message.edit, message)

    def _advance_to(self, timeline: Timeline, edit: int, change: Change | None) -> None:
        self.timeline, self.edit = timeline, edit
        command_id = None if change is None else change.command_id
        self._settled += self._forecasts.edited(timeline, lambda _: command_id)
        self._applied(timeline, edit, change)
        self._behind = False
        self._held = {base: change for base, change in self._held.items() if base >= edit}

    def _lack(self, now: float) -> None:
        """Some edit is missing: ask for it, if that hasn't just been done."""
        if not self._behind:
            self._behind = True
            self.gaps += 1
            self._ask(now)

    def _ask(self, now: float) -> None:
        scene = self.scene
        self._due = now + self._resend
        if scene is None:
            self._port.send(self._follow, now=now)
        elif self._fetching is not None:
            self._port.send(Want(scene.edit, len(self._fetching)), now=now)
        else:
            self._port.send(Want(self.edit, None), now=now)

    def advance(self, *, now: float) -> None:
        """Ask for what is missing."""
        if self._waits() and now >= self._due:
            self._ask(now)

    def frame(self, number: int, t: float, *, now: float, live: bool, ahead: Ahead, floor: float) -> Frame | None:  # noqa: ARG002
        """The frame for a time under the viewer's number; None before the timeline has come."""
        if self.timeline is None:
            return None
        q = frozen_array(self.timeline.sample(t))
        status = self._forecasts.add(number, t, q, now=self.past)
        return Frame(number, t, max(self.past, self.timeline.start), q, status)

    def settled(self) -> tuple[FrameVerdict, ...]:
        """What became of frames since the last call."""
        settled, self._settled = tuple(self._settled), []
        return settled

    def next_deadline(self) -> float | None:
        """When something is asked for again [s]; None when nothing is missing."""
        return self._due if self._waits() else None

    def _waits(self) -> bool:
        return self.timeline is None or self._fetching is not None or self._behind

    def close(self) -> None:
        """Nothing else listens."""


class FrameSource:
    """Shows a broadcaster's frames while live, and asks for others, early enough that they come in time."""

    def __init__(
        self,
        port: RemotePort,
        *,
        rate: float,
        resend: float,
        form: ViewForm = ViewForm.FRAMES,
        delay: float = 0.0,
    ) -> None:
        self._port, self._resend, self._period = port, resend, 1.0 / rate
        self._follow = Follow(port.number(), form, rate, delay)
        self._decoder = CompactDecoder()
        self._recent: deque[Frame] = deque(maxlen=MOST_FRAMES)
        self._observer = Observer(port, resend=resend)
        self._due = -math.inf
        self._asked: OrderedDict[int, float] = OrderedDict()
        self._round_trip = 0.0
        self._buffer: OrderedDict[int, Frame] = OrderedDict()
        self._newest: Frame | None = None
        self._broadcast: OrderedDict[int, int] = OrderedDict()
        self._answered: OrderedDict[int, int] = OrderedDict()
        self._falsified: tuple[tuple[int, int, int | None], ...] = ()
        self._last: Frame | None = None
        self._settled: list[FrameVerdict] = []
        self.scene: Scene | None = None
        """What there is to see."""
        self.live = LiveEdge()

    @property
    def delay(self) -> float:
        """The slowest round trip of late, and a little more [s]; 0 before the first."""
        return self._round_trip + LEAD if self._round_trip else 0.0

    @property
    def span(self) -> tuple[float, float] | None:
        """From the start of the timeline on [s]; where it ends by now, frames don't say."""
        return None if self.scene is None else (self.scene.start, math.inf)

    def receive(self, message: Reply, *, now: float) -> None:
        """Take a frame or the scene; answers come by the observer."""
        if isinstance(message, Scene) and message.number == self._follow.number:
            self.scene = message
            if message.rate is None:
                self.live.heard(message.now, now=now)
            else:
                self._due = now + max(self._resend, 2.0 / message.rate)
        elif isinstance(message, Broadcast):
            self.live.heard(message.frame.t, now=now)
            self._take(message)
        elif isinstance(message, Compact) and self.scene is not None:
            self._unpack(message, now)

    def _take(self, message: Broadcast) -> None:
        frame = message.frame
        if self._newest is None or frame.number > self._newest.number:
            self._newest = frame
            self._judge(message)
            self._recent.append(frame)
            if self._waited:
                self._recent = deque((_judged(one, message.verdicts) for one in self._recent), MOST_FRAMES)

    def _unpack(self, message: Compact, now: float) -> None:
        """Read compact frames; those that wait for others in a message are shown as much later."""
        try:
            frames = self._decoder.receive(message)
        except InvalidValueError:
            frames = ()
        for broadcast in frames:
            self._take(broadcast)
        if frames:
            self.live.heard(frames[-1].frame.t - self._waited, now=now)

    @property
    def _waited(self) -> float:
        """How long a frame waits for others, at most [s]: whole periods."""
        rate = None if self.scene is None else self.scene.rate
        return int(self._follow.delay * rate + 1e-6) / rate if rate else 0.0

    @property
    def _lacking(self) -> bool:
        """Whether the scene is to be asked for, and with it a key frame."""
        if self.scene is None:
            return True
        return self._follow.form is ViewForm.COMPACT and self.scene.rate is not None and self._decoder.lacking

    def _judge(self, message: Broadcast) -> None:
        """Learn what became of the frames that were shown; the older come first."""
        shown, verdicts = self._broadcast, message.verdicts
        if verdicts.falsified != self._falsified:
            self._falsified = verdicts.falsified
            numbers = list(shown)
        else:
            numbers = list(takewhile(verdicts.through.__ge__, shown))
        for number in numbers:
            verdict = status_of(number, verdicts)
            if verdict is not None:
                self._settled.append(replace(verdict, number=shown.pop(number)))
            elif number < verdicts.since:
                del shown[number]

    def advance(self, *, now: float) -> None:
        """Follow the broadcaster, and take what was asked for."""
        if self._lacking and now >= self._due:
            self._port.send(self._follow, now=now)
            self._due = now + self._resend
        for observation in self._observer.advance(now=now):
            frame = observation.frame
            if self._asked.pop(frame.number, None) is not None:
                self._round_trip = max(observation.lateness, 0.9 * self._round_trip)
            if frame.status is FrameStatus.FALSIFIED:
                self._buffer.pop(frame.number, None)
            else:
                _put(self._buffer, frame.number, frame, BUFFERED)
            shown = self._answered.get(frame.number)
            if shown is not None and frame.status is not FrameStatus.PREDICTED:
                del self._answered[frame.number]
                self._settled.append(FrameVerdict(shown, frame.status, frame.falsified_by))

    def frame(self, number: int, t: float, *, now: float, live: bool, ahead: Ahead, floor: float) -> Frame | None:
        """The frame nearest to a time, if it's near enough and not the last one; what comes next is asked for.

        Args:
            number: Number that the viewer gives it.
            t: The place of the play head [s].
            now: The user's time [s].
            live: Whether the newest frame is wanted.
            ahead: Where the play head will be.
            floor: The newest frame isn't wanted if it shows an earlier time than this [s].
        """
        if live and self._newest is not None:
            newest = self._newest
            if self._waited:
                newest = next((frame for frame in reversed(self._recent) if frame.t <= t + SAME), self._recent[0])
            return None if newest.t < floor else self._show(newest, number, self._broadcast)
        next_, later = ahead(self._period), ahead(self.delay)
        self._ask(t if later is None else later, now)
        near = SAME + (0.0 if next_ is None else NEAR * abs(next_ - t))
        nearest = min(self._buffer.values(), key=lambda frame: abs(frame.t - t), default=None)
        if nearest is None or abs(nearest.t - t) > near:
            self._ask(t, now)
            return None
        return self._show(nearest, number, self._answered)

    def _ask(self, t: float, now: float) -> None:
        known = (*self._asked.values(), *(frame.t for frame in self._buffer.values()))
        if all(abs(t - other) > SAME for other in known):
            _put(self._asked, self._observer.ask(t, now=now), t, BUFFERED)

    def _show(self, frame: Frame, number: int, shown: OrderedDict[int, int]) -> Frame | None:
        if frame is self._last:
            return None
        last, self._last = self._last, frame
        if last is not None and (last.number, last.t) == (frame.number, frame.t):
            return None
        if frame.status is FrameStatus.PREDICTED:
            _put(shown, frame.number, number, WINDOW)
        return replace(frame, number=number)

    def settled(self) -> tuple[FrameVerdict, ...]:
        """What became of frames since the last call."""
        settled, self._settled = tuple(self._settled), []
        return settled

    def next_deadline(self) -> float | None:
        """When something is asked for again [s]."""
        return earliest(self._observer.next_deadline(), self._due if self._lacking else None)

    def close(self) -> None:
        """Ask no more."""
        self._observer.close()


def _judged(frame: Frame, verdicts: Verdicts) -> Frame:
    """A frame with what became of it."""
    verdict = status_of(frame.number, verdicts) if frame.status is FrameStatus.PREDICTED else None
    if verdict is None:
        return frame
    return replace(frame, status=verdict.status, falsified_by=verdict.falsified_by)


_Value = TypeVar("_Value")


def _put(kept: OrderedDict[int, _Value], number: int, value: _Value, most: int) -> None:
    kept[number] = value
    if len(kept) > most:
        kept.popitem(last=False)
