"""The Observer: asks an engine, here or elsewhere, for its position at any time.

Source: Doulgeri, Zikos, Delopoulos, section III.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, replace

from interfaces.clients.ports import RemotePort, port_to
from interfaces.engine_server.site import earliest
from interfaces.link.delivery import Resending
from interfaces.messages import Answer, Ask, Frame, FrameStatus, Reply
from vrs.commands import finite
from vrs.engine import Engine
from vrs.errors import NonFiniteTimeError

REMEMBERED = 4096
"""Answers that are kept; the oldest is forgotten first."""

PENDING = 1024
"""Questions that wait, for an answer or for the fate of a predicted one; the oldest is given up first."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """An answer, and how old it was when it came. Times are the user's, but for the frame's own."""

    frame: Frame
    """Its status is as far as it's known."""
    asked_at: float
    """[s]."""
    received_at: float
    """[s]."""

    @property
    def number(self) -> int:
        """Number of the question."""
        return self.frame.number

    @property
    def status(self) -> FrameStatus:
        """How far it can be trusted."""
        return self.frame.status

    @property
    def age(self) -> float:
        """The user's time when it came less the time it shows [s]; negative for the future."""
        return self.received_at - self.frame.t

    @property
    def lateness(self) -> float:
        """How long after the question it came [s]."""
        return self.received_at - self.asked_at


class Observer:
    """Asks for g(t) at any time.

    What's predicted is asked for again when its time has passed, until its fate is known.
    """

    def __init__(self, engine: RemotePort | Engine, *, resend: float = 0.3) -> None:
        """Reach an engine.

        Args:
            engine: A port, or an engine in this process.
            resend: After how long without an answer a question is sent again [s], at first; longer and longer then.
        """
        self._port, self._own = port_to(engine)
        self._port.join(self)
        self._asked: OrderedDict[int, tuple[Ask, float]] = OrderedDict()
        self._open: Resending[Ask] = Resending(resend)
        self.answers: OrderedDict[int, Observation] = OrderedDict()
        """What was answered lately, by number."""
        self._news: OrderedDict[int, None] = OrderedDict()
        self.confirmed = 0
        """Predicted answers that came true."""
        self.falsified = 0
        """Predicted answers that a command changed."""

    def ask(self, t: float | None = None, *, now: float) -> int:
        """Ask for the position.

        Args:
            t: Time [s]; None for the engine's present when the question arrives.
            now: The user's time [s].

        Returns:
            Number of the question. An engine in this process has answered it already.

        Raises:
            NonFiniteTimeError: If t is NaN or infinite.
        """
        if t is not None:
            t = float(t)
            if not math.isfinite(t):
                raise NonFiniteTimeError(t)
        now = finite("now", now, "finite seconds")
        ask = Ask(self._port.number(), t)
        self._asked[ask.number] = ask, now
        if len(self._asked) > PENDING:
            self._open.drop(self._asked.popitem(last=False)[0])
        self._open.add(ask.number, ask, now)
        self._port.send(ask, now=now)
        return ask.number

    def receive(self, message: Reply, *, now: float) -> None:
        """Take an answer, or news of an earlier one."""
        if not isinstance(message, Answer) or message.frame.number not in self._asked:
            return
        frame = message.frame
        ask, asked_at = self._asked[frame.number]
        known = self.answers.get(frame.number)
        if known is None:
            known = Observation(frame, asked_at, now)
            self._keep(known)
        elif known.frame.status is not FrameStatus.PREDICTED or not _same(known.frame, frame):
            return
        elif frame.status is not FrameStatus.PREDICTED:
            self._count(frame.status)
            self._keep(replace(known, frame=frame))
        if frame.status is FrameStatus.PREDICTED:
            first = now + max(frame.t - message.now, 0.0)
            if known.frame is frame:
                self._open.add(frame.number, ask, now, first=first)
        else:
            self._open.drop(frame.number)
            del self._asked[frame.number]

    def _count(self, status: FrameStatus) -> None:
        self.confirmed += status is FrameStatus.CONFIRMED
        self.falsified += status is FrameStatus.FALSIFIED

    def _keep(self, observation: Observation) -> None:
        number = observation.number
        self.answers[number] = observation
        self._news[number] = None
        for kept in (self.answers, self._news):
            if len(kept) > REMEMBERED:
                kept.popitem(last=False)

    def advance(self, *, now: float) -> tuple[Observation, ...]:
        """Send again what is open; the answers that came or changed since the last call."""
        if self._own is not None:
            self._own.advance(now=now)
        for ask in self._open.due(now):
            self._port.send(ask, now=now)
        news = tuple(self.answers[number] for number in self._news if number in self.answers)
        self._news.clear()
        return news

    def next_deadline(self) -> float | None:
        """When something is sent again [s]; −∞ where something came, None for nothing to do."""
        if self._news:
            return -math.inf
        return earliest(self._open.next_deadline(), None if self._own is None else self._own.next_deadline())

    def observation(self, number: int) -> Observation | None:
        """The answer to a question; None while there's none, or where it's forgotten."""
        return self.answers.get(number)

    def close(self) -> None:
        """Listen no more."""
        self._port.leave(self)

    @property
    def share_falsified(self) -> float | None:
        """Share of the predicted answers with a known fate that were falsified; None before the first."""
        settled = self.confirmed + self.falsified
        return self.falsified / settled if settled else None


def _same(a: Frame, b: Frame) -> bool:
    return a.t == b.t and a.q.tobytes() == b.q.tobytes()
