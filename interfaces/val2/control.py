"""Control over a robot elsewhere: the lease of a connection, asked for without waiting."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from interfaces.val2.errors import ValError, robot_halted
from robots.onboard.lease import LeaseState

if TYPE_CHECKING:
    from interfaces.stream.connect import Connection

PATIENCE: Final = 3.0
"""How long the lease is waited for [s]; the robot comes to rest between two."""
MEETING: Final = 10.0
"""How long a robot is waited for that doesn't follow a new lease yet [s]."""
_AGAIN: Final = 0.25
"""Time between two requests [s]."""
_LOOKS: Final = 0.1
"""Time between two looks at how the robot is [s]."""


class LeaseControl:
    """The lease of a connection; it's kept by the connection until it's released."""

    def __init__(self, connection: Connection) -> None:
        """Ask for nothing yet.

        Args:
            connection: Of an operator.
        """
        self._connection = connection
        self._since: float | None = None
        self._asked = 0.0
        self._granted: float | None = None
        """When the lease was first seen to be there [s]."""
        self._resumed = self._resume_until = -math.inf

    def wanted(self, *, now: float) -> str | None:
        """Ask for the lease: empty if it's there, why not, or None while nothing is known yet.

        Args:
            now: Session time [s].
        """
        connection, lease = self._connection, self._connection.lease
        if not connection.is_connected:
            return self._settled("there's no connection to the robot's server")
        if lease is not None and lease.yours and lease.state is LeaseState.HELD:
            return self._settled("") if self._follows(now) else None
        self._granted = None
        if lease is not None and lease.state is LeaseState.HELD:
            return self._settled(f"{lease.holder} has the lease")
        if self._since is None or now < self._since:
            self._since, self._asked = now, now - _AGAIN
        if now >= self._since + PATIENCE:
            return self._settled("the robot isn't at rest yet: try again")
        if now >= self._asked + _AGAIN:
            self._asked = now
            connection.acquire(wait=0.0)
        return None

    def _follows(self, now: float) -> bool:
        """Whether the robot follows this lease; one that doesn't in time says why to those who command it."""
        if self._granted is None:
            self._granted = now
        state = self._connection.state
        return now >= self._granted + MEETING or (state is not None and state.connected and not state.halted)

    def _settled(self, answer: str) -> str:
        self._since = None
        return answer

    def release(self, *, now: float) -> None:  # noqa: ARG002 - the connection has its clock
        """Give the lease back; the robot stops."""
        self._connection.release(wait=0.0)

    def resume(self, *, now: float) -> None:
        """Let a robot go on that stopped by itself, as soon as it can within a while."""
        self._resumed, self._resume_until = -math.inf, now + PATIENCE
        self.trouble(now=now)

    def trouble(self, *, now: float) -> ValError | None:
        """What is wrong with the robot or the way to it."""
        connection, state, lease = self._connection, self._connection.state, self._connection.lease
        if not connection.is_connected:
            return ValError("No connection", "to the robot's server; it's taken up again by itself")
        if state is None or not state.halted:
            self._resume_until = -math.inf
            return None
        commanded = lease is not None and lease.yours and lease.state is LeaseState.HELD
        if commanded and self._resumed + _AGAIN <= now < self._resume_until:
            self._resumed = now
            connection.resume(wait=0.0)
        return robot_halted(state.halted, commanded=commanded)

    @property
    def looks(self) -> float:
        """How often it's to be asked for trouble [s]."""
        return _LOOKS
