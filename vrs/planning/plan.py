"""A plan: polynomials that follow one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from struct import pack

import numpy as np

from vrs.model import Array
from vrs.segment import State, evaluate, state_of

TAYLOR = np.array([[1.0], [1.0], [1.0 / 2.0], [1.0 / 6.0]])
"""What derivatives are multiplied by to be coefficients, (4, 1)."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Segments of a move, one after the other."""

    durations: Array
    """[s], (m,), positive."""
    coefficients: Array
    """(m, K, n), ascending powers of the time since each segment's start."""
    orders: Sequence[int] | None = None
    """How many coefficients of each segment aren't leading zeros; None while nobody knows."""

    @property
    def duration(self) -> float:
        """Of the whole [s]."""
        return float(sum(self.durations.tolist()))

    def __len__(self) -> int:
        return len(self.durations)

    def then(self, other: Plan) -> Plan:
        """This plan, then the other."""
        if len(self) == 0 or len(other) == 0:
            return self if len(other) == 0 else other
        a, b = self.coefficients, other.coefficients
        both = np.zeros((len(a) + len(b), max(a.shape[1], b.shape[1]), a.shape[2]))
        both[: len(a), : a.shape[1]] = a
        both[len(a) :, : b.shape[1]] = b
        return Plan(np.concatenate([self.durations, other.durations]), both)

    def rows(self) -> list[Array]:
        """The coefficients, an array of shape (degree + 1, n) a segment, read-only, leading zeros dropped."""
        a = self.coefficients
        a.flags.writeable = False
        orders = self.orders or _orders(a)
        return [row if order == len(row) else row[:order] for row, order in zip(a, orders, strict=True)]

    def packed_rows(self) -> list[bytes]:
        """The same as bytes, in C order: what a timeline keeps."""
        m, K, n = self.coefficients.shape
        data, size = self.coefficients.tobytes(), 8 * n
        begins = range(0, m * K * size, K * size)
        orders = self.orders or _orders(self.coefficients)
        return [data[begin : begin + order * size] for begin, order in zip(begins, orders, strict=True)]


def _orders(a: Array) -> list[int]:
    """How many coefficients of each segment aren't leading zeros, at least 1."""
    K = a.shape[1]
    # Of few numbers, `any` of a list is ten times quicker than an array's.
    full = list(map(any, a[:, -1].tolist()))
    orders = [K] * len(full)
    if not all(full):
        for i in [i for i, leads in enumerate(full) if not leads]:
            order = K - 1
            while order > 1 and not any(a[i, order - 1].tolist()):
                order -= 1
            orders[i] = max(order, 1)
    return orders


def parabolas(durations: list[float], rows: list[list[float]]) -> Plan:
    """A plan of parabolas from plain floats: position, speed and half the acceleration of each segment in turn."""
    orders = [3 if any(c) else 2 if any(b) else 1 for b, c in zip(rows[1::3], rows[2::3], strict=True)]
    a = packed(list(chain.from_iterable(rows))).reshape(len(durations), 3, len(rows[0]))
    return Plan(np.array(durations), a, orders)


def packed(values: list[float]) -> Array:
    """Floats as a read-only array, in a third of the time that np.array takes where they're many."""
    return np.frombuffer(pack(f"{len(values)}d", *values))


def stacked(durations: Sequence[float], rows: Sequence[Array], n: int) -> Plan:
    """A plan of n joints from the rows of its segments, arrays of shape (degree + 1, n)."""
    a = np.zeros((len(rows), max((len(row) for row in rows), default=1), n))
    for padded, row in zip(a, rows, strict=True):
        padded[: len(row)] = row
    return Plan(np.array(durations, dtype=np.float64), a)


def empty(n: int) -> Plan:
    """A plan that stays where it is."""
    return Plan(np.empty(0), np.empty((0, 1, n)))


def slowed(plan: Plan, factor: float) -> Plan:
    """The same path, every speed divided by a factor."""
    powers = factor ** -np.arange(float(plan.coefficients.shape[1]))
    return Plan(plan.durations * factor, plan.coefficients * powers[:, None], plan.orders)


def integrate(state: State, durations: Array, accelerations: Array) -> Plan:
    """Parabolas of piecewise constant accelerations.

    Args:
        state: Start.
        durations: [s], (m,).
        accelerations: Of each interval [rad/s²], (m, n).
    """
    m, n = accelerations.shape
    h = durations[:, None]
    q, qd = np.empty((2, m + 1, n))
    qd[0], qd[1:] = state.qd, h * accelerations
    np.add.accumulate(qd, 0, None, qd)
    q[0], q[1:] = state.q, (qd[:-1] + qd[1:]) * (0.5 * h)
    np.add.accumulate(q, 0, None, q)
    return Plan(durations, np.stack([q[:m], qd[:m], 0.5 * accelerations], 1))


def end_state(plan: Plan) -> State:
    """Where a plan that isn't empty ends."""
    last = plan.coefficients[-1]
    q, qd, qdd = state_of(last.tobytes(), last.shape[1], float(plan.durations[-1]))
    return State(np.array(q), np.array(qd), np.array(qdd))


def end_position(plan: Plan) -> Array:
    """Where a plan that isn't empty ends, (n,) [rad]."""
    return evaluate(plan.coefficients[-1], float(plan.durations[-1]), 0)
