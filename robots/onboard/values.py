"""What a robot looks at before it believes a number: type, shape, finiteness, size, limits."""

from __future__ import annotations

import enum
import sys
from dataclasses import dataclass

import numpy as np

from vrs.checks import finite
from vrs.commands import JointTarget, MotionCommand, PoseTarget, SteerCommand
from vrs.errors import InvalidValueError
from vrs.model import Array, Limits

_SMALLEST = sys.float_info.min
_LARGEST = 1e9


class RefusalCode(enum.StrEnum):
    """Why a value was refused."""

    WRONG_TYPE = "wrong type"
    WRONG_SHAPE = "wrong shape"
    NOT_FINITE = "not finite"
    """NaN or infinity."""
    SUBNORMAL = "subnormal"
    """Not zero, and nearer to it than 2.3e-308: what is divided by it overflows."""
    HUGE = "huge"
    """Beyond ±1e9: its square and products aren't worth a motion."""
    OUT_OF_LIMITS = "out of limits"


@dataclass(frozen=True, slots=True)
class Refusal:
    """A value that was refused; nothing has changed."""

    code: RefusalCode
    name: str
    """Of the value."""
    index: tuple[int, ...]
    """Where in an array the first bad number is; empty for a single number, a wrong shape or type."""
    given: str
    """The number, shape or type."""
    allowed: str

    def __str__(self) -> str:
        """Say it in a line."""
        return f"{self.name} must be {self.allowed}; given: {self.given} ({self.code})"


class ValueGuard:
    """Looks at the values for one robot before anything else does. It keeps no state; its answers are values."""

    __slots__ = ("_limits", "_turn", "_velocity")

    def __init__(self, limits: Limits, *, tool_speed: float, tool_turn_speed: float) -> None:
        """Take the joints' limits, and the tool's largest speeds [m/s], [rad/s], positive.

        Raises:
            InvalidValueError: If a speed isn't finite and positive.
        """
        for name, speed in (("tool_speed", tool_speed), ("tool_turn_speed", tool_turn_speed)):
            if finite(name, speed, "finite and positive") <= 0:
                raise InvalidValueError(name, speed, "finite and positive")
        self._limits = limits
        self._velocity, self._turn = tool_speed, tool_turn_speed

    def joints(self, q: object) -> Refusal | None:
        """Look at joint positions [rad], (n,)."""
        return within("joints", q, self._limits.q_min, self._limits.q_max, "rad")

    def rates(self, qd: object) -> Refusal | None:
        """Look at joint rates [rad/s], (n,)."""
        return within("rates", qd, -self._limits.qd_max, self._limits.qd_max, "rad/s")

    def twist(self, twist: object) -> Refusal | None:
        """Look at a twist of the tool, (6,): linear [m/s], then angular [rad/s]; each part within its speed."""
        most = np.array([self._velocity] * 3 + [self._turn] * 3)
        return within("twist", twist, -most, most, "m/s, rad/s")

    def number(self, name: str, value: object, low: float, high: float) -> Refusal | None:
        """Look at one number in [low, high]."""
        return within(name, value, np.array(low), np.array(high), "")

    def command(self, command: object) -> Refusal | None:
        """Look at what a command asks for: targets within the limits, rates and twists within the speeds.

        Commands of other kinds hold one or two numbers, which their own classes have looked at.
        """
        if isinstance(command, MotionCommand):
            target = command.target
            if isinstance(target, JointTarget):
                return self.joints(target.q)
            if isinstance(target, PoseTarget):
                return within("pose", target.X, np.full((4, 4), -1e3), np.full((4, 4), 1e3), "m")
        if isinstance(command, SteerCommand):
            return self.twist(command.twist) if command.rates is None else self.rates(command.rates)
        return None


def within(name: str, value: object, low: Array, high: Array, unit: str) -> Refusal | None:
    """Look at numbers of a given shape and range.

    Args:
        name: What they are.
        value: Anything.
        low: Least values.
        high: Largest values, of the same shape.
        unit: For the message.

    Returns:
        The first thing that's wrong, whole arrays before single numbers; None if nothing is.
    """
    kind = "a number" if low.shape == () else f"numbers of shape {low.shape}"
    span = f"in [{low.min():.6g}, {high.max():.6g}]"
    allowed = f"{kind} {span} {unit}".strip()

    def refused(code: RefusalCode, index: tuple[int, ...], given: object) -> Refusal:
        return Refusal(code, name, index, f"{given}"[:80], allowed)

    try:
        raw = np.asarray(value)
    except (ValueError, TypeError, OverflowError):
        return refused(RefusalCode.WRONG_SHAPE, (), type(value).__name__)
    if raw.dtype.kind not in "iuf" or raw.dtype.itemsize > 8:
        return refused(RefusalCode.WRONG_TYPE, (), type(value).__name__ if raw.ndim == 0 else raw.dtype)
    if raw.shape != low.shape:
        return refused(RefusalCode.WRONG_SHAPE, (), raw.shape)
    array = raw.astype(np.float64)
    size = np.abs(array)
    tests = (
        (RefusalCode.NOT_FINITE, ~np.isfinite(array)),
        (RefusalCode.SUBNORMAL, (size > 0) & (size < _SMALLEST)),
        (RefusalCode.HUGE, size > _LARGEST),
        (RefusalCode.OUT_OF_LIMITS, (array < low) | (array > high)),
    )
    for code, bad in tests:
        if bad.any():
            index = tuple(int(i) for i in np.argwhere(bad)[0])
            return refused(code, index, float(array[index]))
    return None
