"""The Observer: asks an engine, here or elsewhere, for its position at any time.

Source: Doulgeri, Zikos, Delopoulos, section III.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, replace

from typing_extensions import override

from interfaces.clients.ports import Asking, RemotePort
from interfaces.messages import Answer, Ask, Frame, FrameStatus, Reply
from vrs.checks import finite
from vrs.engine import Engine
from vrs.errors import NonFiniteTimeError

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


class Observer(Asking[Ask, Observation]):
    """Asks for g(t) at any time.

    What's predicted is asked for again when its time has passed, until its fate is known.
    """

    def __init__(self, engine: RemotePort | Engine, *, resend: float = 0.3) -> None:
        """Reach an engine.

        Args:
            engine: A port, or an engine in this process.
            resend: After how long without an answer a question is sent again [s], at first; longer and longer then.
        """
        super().__init__(engine, resend)
        self.answers = self._kept
        """What was answered lately, by number."""
        self._asked: OrderedDict[int, tuple[Ask, float]] = OrderedDict()
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

    @override
    def receive(self, message: Reply, *, now: float) -> None:
        """Take an answer, or news of an earlier one."""
        if not isinstance(message, Answer) or message.frame.number not in self._asked:
            return
        frame = message.frame
        ask, asked_at = self._asked[frame.number]
        known = self.answers.get(frame.number)
        if known is None:
            known = Observation(frame, asked_at, now)
            self._keep(frame.number, known)
        elif known.frame.status is not FrameStatus.PREDICTED or not _same(known.frame, frame):
            return
        elif frame.status is not FrameStatus.PREDICTED:
            self._count(frame.status)
            self._keep(frame.number, replace(known, frame=frame))
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

    def observation(self, number: int) -> Observation | None:
        """The answer to a question; None while there's none, or where it's forgotten."""
        return self.answers.get(number)

    @property
    def share_falsified(self) -> float | None:
        """Share of the predicted answers with a known fate that were falsified; None before the first."""
        settled = self.confirmed + self.falsified
        return self.falsified / settled if settled else None


def _same(a: Frame, b: Frame) -> bool:
    return a.t == b.t and a.q.tobytes() == b.q.tobytes()
