"""The polynomials of a timeline's segments: coefficients as bytes, their values and states at one time."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from struct import unpack
from typing import TypeAlias

import numpy as np

from vrs.model import Array

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
