"""Errors of RSP.

    VrsError
    └── RspError
        ├── NoSessionError     a robot that gives no session, and why
        ├── PacketError        a datagram that isn't a packet of this robot: the other side's fault, or a stranger's
        ├── FullError          a queue that takes no more: whoever asks is faster than the link
        └── DeadlineError      nothing came in time (also a TimeoutError)

Packet errors never leave a core: it drops the datagram and counts why.
"""

from __future__ import annotations

from vrs.errors import VrsError


class RspError(VrsError):
    """Root of what goes wrong in RSP alone."""


class PacketError(RspError):
    """A datagram that isn't a packet of this robot."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"not a packet of this robot: {problem}")


class NoSessionError(RspError):
    """A robot that gives no session."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(f"the robot gives no session: {reason}")


class FullError(RspError):
    """A queue that takes no more."""

    def __init__(self, what: str, most: int) -> None:
        self.what, self.most = what, most
        super().__init__(f"{what} takes no more than {most} at once: wait until some are done")


class DeadlineError(RspError, TimeoutError):
    """Nothing came in time."""

    def __init__(self, what: str, timeout: float) -> None:
        self.what, self.timeout = what, timeout
        super().__init__(f"{what}: nothing within {timeout:g} s")
