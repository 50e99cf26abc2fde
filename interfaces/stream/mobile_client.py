"""The client's end of the protocol for a mobile robot, without sockets."""

from __future__ import annotations

from typing import Any, ClassVar

from interfaces.link.round_trip import Ping, Pong
from interfaces.messages import Outcome
from interfaces.stream import control
from interfaces.stream.client import ClientCore
from interfaces.stream.codec import Value
from interfaces.stream.control import ProblemCode
from interfaces.stream.mobile import MobileWelcome, Postures
from interfaces.stream.network import Network
from interfaces.stream.tasks import Plan, Seen, Tasks


class MobileCore(ClientCore):
    """See `ClientCore`; what it's told of the robot is kept here, the newest of each kind."""

    coming: ClassVar[Any] = (
        Outcome | control.Welcome | control.Lease | Ping | Pong | control.Problem | Network
        | MobileWelcome | Postures | Tasks | Seen | Plan
    )  # fmt: skip
    postures: Postures | None = None
    """Where both robots are."""
    tasks: Tasks | None = None
    """What the robot does by itself."""
    seen: Seen | None = None
    """What it sees."""
    plan: Plan | None = None
    """The known map."""

    def _take(self, message: Value, now: float) -> None:
        """Take what a server says."""
        if isinstance(message, MobileWelcome):
            self._begin(message, now)
        elif isinstance(message, control.Welcome):
            text = f"the arm {message.robot} is served here, not a mobile robot: use interfaces.connect"
            self._complain(control.Problem(ProblemCode.REFUSED, text, fatal=True))
        elif isinstance(message, Postures):
            self.postures = message
        elif isinstance(message, Tasks):
            self.tasks = message
            self._settle(message.answers, message)
        elif isinstance(message, Seen):
            self.seen = message
        elif isinstance(message, Plan):
            self.plan = message
        else:
            super()._take(message, now)
