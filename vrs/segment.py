"""Segments (t_s, t_f, a): the pieces of a timeline, as values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array
from vrs.errors import InvalidValueError, NonFiniteTimeError
from vrs.model import Array


def times(t: ArrayLike) -> Array:
    """Return t as a float array, scalar or (k,).

    Raises:
        NonFiniteTimeError: If t isn't made of finite numbers.
    """
    try:
        array = np.asarray(t)
    except ValueError:
        raise NonFiniteTimeError(t) from None
    if array.dtype.kind not in "iuf" or array.ndim > 1 or not np.isfinite(array).all():
        raise NonFiniteTimeError(t)
    return array.astype(np.float64)


def _check_span(start: float, duration: float) -> tuple[float, float]:
    start = finite("start", start, "finite seconds")
    duration = finite("duration", duration, "positive seconds")
    if duration <= 0:
        raise InvalidValueError("duration", duration, "positive seconds")
    return start, duration


def _check_owner(command_id: object) -> None:
    if command_id is None:
        return
    whole = isinstance(command_id, (int, np.integer)) and not isinstance(command_id, bool)
    if not whole or not -(2**63) <= command_id < 2**63:  # type: ignore[operator]
        raise InvalidValueError("command_id", command_id, "None or an integer of 64 bits")


@dataclass(frozen=True, slots=True, eq=False)
class PolynomialSegment:
    """Joints on polynomials of t − start, valid on [start, end). Source: Doulgeri et al., eq. (3)."""

    start: float
    """t_s [s]."""
    duration: float
    """t_f − t_s [s], positive."""
    coefficients: Array
    """a, shape (degree + 1, n), ascending powers of t − start, [rad / s**power]."""
    command_id: int | None = None
    """The command that made it, an integer of 64 bits; None for a hold."""

    def __post_init__(self) -> None:
        start, duration = _check_span(self.start, self.duration)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "duration", duration)
        allowed = "finite, of shape (degree + 1, n)"
        coefficients = finite_array("coefficients", self.coefficients, None, allowed)
        if coefficients.ndim != 2 or 0 in coefficients.shape:
            raise InvalidValueError("coefficients", self.coefficients, allowed)
        object.__setattr__(self, "coefficients", coefficients)
        _check_owner(self.command_id)

    @property
    def end(self) -> float:
        """t_f [s]."""
        return self.start + self.duration

    @property
    def degree(self) -> int:
        """Degree of the polynomials."""
        return len(self.coefficients) - 1

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PolynomialSegment):
            return False
        mine = (self.start, self.duration, self.command_id)
        same = mine == (other.start, other.duration, other.command_id)
        return same and np.array_equal(self.coefficients, other.coefficients)

    def __hash__(self) -> int:
        return hash((self.start, self.duration, self.command_id, self.coefficients.tobytes()))

    def value(self, t: ArrayLike, *, derivative: int = 0) -> Array:
        """Evaluate the polynomials, also beyond the segment's ends.

        Args:
            t: Timeline time [s], scalar or (k,).
            derivative: Order of the time derivative, 0 to 3.

        Returns:
            Joint values [rad / s**derivative], (n,) or (k, n).
        """
        u = times(t) - self.start
        return evaluate(self.coefficients, u, check_derivative(derivative))


@dataclass(frozen=True, slots=True)
class ArcSegment:
    """A mobile robot on an arc at constant speeds, valid on [start, end)."""

    start: float
    """t_s [s]."""
    duration: float
    """t_f − t_s [s], positive."""
    posture: tuple[float, float, float]
    """(x, y, θ) at the start [m, m, rad], in the world frame."""
    v: float
    """Linear speed [m/s], forward positive."""
    w: float
    """Angular speed [rad/s], to the left positive."""
    command_id: int | None = None
    """The command that made it, an integer of 64 bits; None for standing."""

    def __post_init__(self) -> None:
        start, duration = _check_span(self.start, self.duration)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "duration", duration)
        posture = finite_array("posture", self.posture, (3,), "three finite numbers (x, y, θ)")
        object.__setattr__(self, "posture", tuple(float(value) for value in posture))
        object.__setattr__(self, "v", finite("v", self.v, "finite m/s"))
        object.__setattr__(self, "w", finite("w", self.w, "finite rad/s"))
        _check_owner(self.command_id)

    @property
    def end(self) -> float:
        """t_f [s]."""
        return self.start + self.duration

    def value(self, t: ArrayLike) -> Array:
        """Posture (x, y, θ) at t [s], (3,) or (k, 3); θ isn't wrapped."""
        u = times(t) - self.start
        x, y, theta = self.posture
        half = 0.5 * self.w * u
        chord = self.v * u * np.sinc(half / math.pi)
        return np.stack([x + chord * np.cos(theta + half), y + chord * np.sin(theta + half), theta + 2 * half], -1)


Segment: TypeAlias = PolynomialSegment | ArcSegment


def known_segment(start: float, duration: float, coefficients: Array, owner: int | None) -> PolynomialSegment:
    """A segment of what was checked before, in a sixth of the time; it shares the coefficients, read-only ones."""
    segment = PolynomialSegment.__new__(PolynomialSegment)
    put = object.__setattr__
    put(segment, "start", start)
    put(segment, "duration", duration)
    put(segment, "coefficients", coefficients)
    put(segment, "command_id", owner)
    return segment


def known_arc(
    start: float, duration: float, posture: tuple[float, float, float], v: float, w: float, owner: int | None = None
) -> ArcSegment:
    """An arc of numbers that were checked before, in a tenth of the time."""
    arc = ArcSegment.__new__(ArcSegment)
    put = object.__setattr__
    put(arc, "start", start)
    put(arc, "duration", duration)
    put(arc, "posture", posture)
    put(arc, "v", v)
    put(arc, "w", w)
    put(arc, "command_id", owner)
    return arc


def check_derivative(derivative: int) -> int:
    """Return an order of derivative, 0 to 3.

    Raises:
        InvalidValueError: If it's anything else.
    """
    if isinstance(derivative, bool) or derivative not in (0, 1, 2, 3):
        raise InvalidValueError("derivative", derivative, "0, 1, 2 or 3")
    return int(derivative)


def evaluate(coefficients: Array, u: Array | float, derivative: int) -> Array:
    """Horner's rule for (K, n) coefficients at u, or (k, K, n) coefficients at u of shape (k,).

    Scalar and batch follow the same operations in the same order, so they agree to the last bit.
    """
    order = coefficients.shape[-2]
    batch = coefficients.ndim == 3
    shape = np.shape(u)
    x = np.asarray(u)[:, None] if shape else u
    n = coefficients.shape[-1]
    if order <= derivative:
        return np.zeros((*shape, n))
    value: Array = np.zeros((*shape, n))
    for power in range(order - 1, derivative - 1, -1):
        term = coefficients[:, power] if batch else coefficients[power]
        value = value * x + (term * math.perm(power, derivative) if derivative else term)
    return value
