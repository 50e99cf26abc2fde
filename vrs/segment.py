"""Segments (t_s, t_f, a): the pieces of a timeline, as values.

A polynomial's coefficients are bytes; its values and states are those at one time. `Piece`s are what an edit puts
into a timeline.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from struct import unpack
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array
from vrs.errors import InvalidValueError, NonFiniteTimeError
from vrs.model import Array
from vrs.tree import Run

QUICK_ORDER = 4
"""Rows of coefficients up to which a sample makes no array but its result; where there are fewer, zeros follow."""

_DOUBLE = np.dtype(np.float64)

Product: TypeAlias = Callable[[Array], Array]

Cursor: TypeAlias = tuple[float, float, Product, Array, "array[float]", Product, Product]
"""A segment to be sampled, for one caller at a time: its start; the start of the next; what makes the value from
its coefficients, and these; the buffer of 1, u, u² and u³ that this reads; what does so for few coefficients, and
for many."""


def idle_cursor(n: int) -> Cursor:
    """A cursor for n joints, at no segment."""
    powers = array("d", (1.0, 0.0, 0.0, 0.0))
    few: Product = np.frombuffer(powers).dot

    def many(coefficients: Array) -> Array:
        return power_sum(coefficients, powers[1])

    return math.inf, -math.inf, few, np.zeros((QUICK_ORDER, n)), powers, few, many


def rows_of(row: bytes, n: int) -> Array:
    """The coefficients in a leaf's row, (degree + 1, n), read-only."""
    return np.ndarray((len(row) // (8 * n), n), _DOUBLE, row)


def filled_rows(row: bytes, n: int) -> Array:
    """The same with zeros for missing powers, QUICK_ORDER rows at least."""
    return rows_of(row.ljust(8 * n * QUICK_ORDER, b"\0"), n)


def power_sum(coefficients: Array, u: float) -> Array:
    """Polynomials at u: the product of 1, u, u² and so on with coefficients (K, n)."""
    power, powers = u, [1.0]
    for _ in range(len(coefficients) - 1):
        powers.append(power)
        power *= u
    value: Array = np.array(powers).dot(coefficients)
    return value


def state_of(row: bytes, n: int, u: float) -> tuple[list[float], list[float], list[float]]:
    """Position, velocity and acceleration, n values each, of the polynomials in a leaf's row at u [s]."""
    row = row.ljust(8 * n * QUICK_ORDER, b"\0")
    values = unpack(f"{len(row) // 8}d", row)
    last = len(values) - n
    q: list[float] = []
    qd: list[float] = []
    qdd: list[float] = []
    # By Horner's rule; for few joints plain floats are quicker than arrays. First the four highest powers at once.
    third, second, first = last - n, last - 2 * n, last - 3 * n
    highest = values[first:second], values[second:third], values[third:last], values[last:]
    for a, b, c, d in zip(*highest, strict=True):
        x = d * u + c
        v = d * u + x
        x = x * u + b
        q.append(x * u + a)
        qd.append(v * u + x)
        qdd.append(d * u + v)
    for k in range(last - 4 * n, -1, -n):
        qdd = [x * u + y for x, y in zip(qdd, qd, strict=True)]
        qd = [x * u + y for x, y in zip(qd, q, strict=True)]
        q = [x * u + y for x, y in zip(q, values[k : k + n], strict=True)]
    return q, qd, [2.0 * x for x in qdd]


def first_state(row: bytes, n: int) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration, (n,) each, where the polynomials in a leaf's row begin."""
    q, qd, half = np.frombuffer(row.ljust(24 * n, b"\0")[: 24 * n]).reshape(3, n)
    return q, qd, 2.0 * half


def settled(row: bytes, n: int, u: float) -> Array:
    """Position, velocity and acceleration (3, n) of a leaf's row at u [s], without what rounding leaves of rest.

    Polynomials of degree 2 at most leave no acceleration behind at rest.
    """
    q, qd, qdd = state_of(row, n, u)
    qd = [0.0 if -1e-11 < x < 1e-11 else x for x in qd]
    still = len(row) < 32 * n and not any(qd)
    qdd = [0.0 if still or -1e-9 < x < 1e-9 else x for x in qdd]
    return np.array((*q, *qd, *qdd)).reshape(3, -1)


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


def shifted(coefficients: Array, u: float) -> Array:
    """Coefficients (K, n) in powers of the time since u [s] after their own start."""
    K = len(coefficients)
    M = [[math.comb(j, k) * u ** (j - k) if j >= k else 0.0 for j in range(K)] for k in range(K)]
    moved: Array = np.array(M) @ coefficients
    moved.flags.writeable = False
    return moved


HOLD = 0
"""Command id, inside, of a hold; `PolynomialSegment.command_id` says None."""


_JOINT_TOLERANCE = 1e-6
"""Jump of a joint [rad] between segments that's only rounding."""


class Piece(NamedTuple):
    """New polynomials for an edit, one after the other."""

    durations: Sequence[float]
    """Durations [s], (m,), positive."""
    coefficients: Sequence[Array]
    """m arrays of shape (degree + 1, n)."""
    command_id: int
    """Who made them; HOLD for a hold."""

    @property
    def rows(self) -> list[bytes]:
        """The coefficients as bytes in C order."""
        return [a.tobytes() for a in self.coefficients]


class Packed(NamedTuple):
    """A piece that has its coefficients as a timeline keeps them."""

    durations: Sequence[float]
    """Durations [s], (m,), positive."""
    rows: Sequence[bytes]
    """m arrays of shape (degree + 1, n), as bytes in C order."""
    command_id: int
    """Who made them; HOLD for a hold."""


class State(NamedTuple):
    """Where the arm is and how it moves, each (n,)."""

    q: Array
    """[rad]."""
    qd: Array
    """[rad/s]."""
    qdd: Array
    """[rad/s²]."""


def run_of(pieces: Iterable[Piece | Packed], start: float) -> Run:
    """Pieces as consecutive segments from a time [s] on."""
    durations, owners, rows = list[float](), list[int](), list[bytes]()
    for piece in pieces:
        durations += piece.durations
        rows += piece.rows
        owners += [piece.command_id] * (len(rows) - len(owners))
    assert len(rows) == len(durations)
    starts = array("d", list(accumulate(durations, initial=start)))
    starts.pop()
    return Run(starts, array("d", durations), array("q", owners), tuple(rows))


def checked_run(segments: Iterable[PolynomialSegment], start: float, q: Array) -> Run:
    """Segments that begin at a time [s] and at joints q [rad], (n,).

    Raises:
        InvalidValueError: If they leave gaps, overlap, jump or differ in width.
    """
    starts, durations, owners, rows = array("d"), array("d"), array("q"), list[bytes]()
    end, position = start, q
    for index, segment in enumerate(segments):
        if segment.coefficients.shape[1] != len(q):
            raise InvalidValueError(f"segment {index}", segment.coefficients.shape, f"of width {len(q)}")
        if abs(segment.start - end) > 1e-9 * max(1.0, abs(end)):
            raise InvalidValueError(f"segment {index} start", segment.start, f"contiguous, at {end}")
        if np.abs(segment.coefficients[0] - position).max() > _JOINT_TOLERANCE:
            raise InvalidValueError(f"segment {index} position", segment.coefficients[0], f"at {position}")
        # What's only rounding doesn't let a segment start before the one that it follows.
        starts.append(max(segment.start, starts[-1]) if starts else segment.start)
        durations.append(segment.duration)
        owners.append(segment.command_id or HOLD)
        rows.append(segment.coefficients.tobytes())
        end = segment.end
        position = power_sum(segment.coefficients, segment.duration)
    return Run(starts, durations, owners, tuple(rows))
