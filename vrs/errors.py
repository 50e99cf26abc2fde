"""Errors of the engine.

    VrsError
    ├── InvalidValueError          a value of the wrong shape, type or range (also a ValueError)
    │   ├── NonFiniteTimeError     a time that is NaN or infinite
    │   └── OutOfLimitsError       joint values outside the position limits
    ├── UnreachablePoseError       no arm solution puts the tool there (also a ValueError)
    ├── UnknownCommandError        a command id that no receipt carries (also a LookupError)
    ├── PlanningError              no motion within the limits exists or was found
    │   └── UnresolvedError        a straight line too near a singularity for the joints to be smooth along it
    └── FormatError                bytes, JSON or a file that is not what it should be (also a ValueError)

Misuse raises; outcomes that a user must expect (postponed, rejected) are values: see `vrs.ledger.Receipt`.
"""

from __future__ import annotations

from typing import Any


class VrsError(Exception):
    """Root of every error that this project raises on purpose."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Cross from one process to another with message and data, whatever a class's own arguments are."""
        return _again, (type(self), self.args, self.__dict__)


def _again(kind: type[VrsError], args: tuple[object, ...], data: dict[str, object]) -> VrsError:
    error = kind.__new__(kind, *args)
    # OSError's own leaves this to __init__.
    error.args = args
    error.__dict__.update(data)
    return error


class InvalidValueError(VrsError, ValueError):
    """A value of the wrong type, shape or range."""

    def __init__(self, name: str, given: object, allowed: str, hint: str = "") -> None:
        self.name, self.given, self.allowed = name, given, allowed
        super().__init__(f"{name} must be {allowed}; given: {given!r}{hint}")


class NonFiniteTimeError(InvalidValueError):
    """A time that is NaN or infinite."""

    def __init__(self, given: object) -> None:
        super().__init__("time", given, "finite seconds")


class OutOfLimitsError(InvalidValueError):
    """Joint values outside the position limits."""

    def __init__(self, joint: int, given: float, low: float, high: float, unit: str = "rad") -> None:
        self.joint, self.low, self.high = joint, low, high
        super().__init__(f"joint {joint + 1}", given, f"within [{low:.6g}, {high:.6g}] {unit}")


class UnreachablePoseError(VrsError, ValueError):
    """A pose that no arm solution within the limits reaches."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(f"unreachable pose: {reason}")


class UnknownCommandError(VrsError, LookupError):
    """A command id that the engine never gave out."""

    def __init__(self, command_id: int, newest: int) -> None:
        self.command_id, self.newest = command_id, newest
        super().__init__(f"no command {command_id}: ids run from 1 to {newest}")


class PlanningError(VrsError):
    """No motion within the limits from this state to this target."""


class UnresolvedError(PlanningError):
    """The joints along a line are no smooth functions of the way: a singularity is there, or next to it."""

    def __init__(self, joint: int, place: str) -> None:
        self.joint, self.place = joint, place
        super().__init__(
            f"no straight line: it passes too near a singularity, where joint {joint + 1} turns too fast, "
            f"at {place}"
        )


class FormatError(VrsError, ValueError):
    """Bytes, JSON or a file that is not what it should be."""

    def __init__(self, where: str, problem: str) -> None:
        self.where, self.problem = where, problem
        super().__init__(f"{where}: {problem}")
