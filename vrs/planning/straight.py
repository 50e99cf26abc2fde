"""Rest to rest on the straight line of joint space: one profile from 0 to 1 that every joint follows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vrs.model import Array, Limits
from vrs.planning.certificate import bounds
from vrs.planning.plan import Plan

NEGLIGIBLE = 1e-12
"""A joint distance [rad] below which there's nothing to move."""


class Rates(NamedTuple):
    """The joint limits as limits of the share of the way."""

    speed: float
    """[1/s]."""
    acceleration: float
    """[1/s²]."""
    jerk: float
    """[1/s³]."""


def rates(start: list[float], q: list[float], speed: float, limits: Limits) -> Rates | None:
    """Largest rates of the share of the way that keep every joint's limits; None if there's nothing to move.

    A plan whose share runs from 0 to 1 without turning back, within these rates, needs no other certificate:
    the position limits are a box, so the line between two positions inside lies inside, and each joint's
    derivatives are its distance times those of the share.

    Args:
        start: Where it begins [rad].
        q: Where it ends [rad].
        speed: Share v of the speed limits, in (0, 1].
        limits: Limits of the joints.

    Raises:
        PlanningError: If either position lies outside the limits.
    """
    bound = bounds(limits)
    longest = slowest = weakest = hardest = 0.0
    # Comparisons, because max() costs several times as much.
    for a, b, v, g, j, low, high in zip(
        start, q, bound.qd_max, bound.qdd_max, bound.qddd_max, bound.lowest, bound.highest, strict=True
    ):
        if not (low <= a <= high and low <= b <= high):
            bound.check_inside(start)
            bound.check_inside(q)
        reach = abs(b - a)
        longest = reach if reach > longest else longest
        if reach > slowest * v:
            slowest = reach / v
        if reach > weakest * g:
            weakest = reach / g
        if reach > hardest * j:
            hardest = reach / j
    return Rates(speed / slowest, 1.0 / weakest, 1.0 / hardest) if longest > NEGLIGIBLE else None


def follow(start: Array, q: Array, durations: list[float], share: list[float]) -> Plan:
    """Every joint on the line from start to q.

    Args:
        start: Where it begins [rad], (n,).
        q: Where it ends [rad], (n,).
        durations: Of the segments [s], m of them.
        share: The polynomial of each segment in turn, as many coefficients each, ascending powers.
    """
    m = len(durations)
    K = len(share) // m
    orders = []
    for end in range(K, m * K + 1, K):
        order = K
        while order > 1 and not share[end - K + order - 1]:
            order -= 1
        orders.append(order)
    # A flat list becomes an array in half the time of a nested one.
    a = np.array(share).reshape(m, K, 1) * (q - start)
    a[:, 0] += start
    return Plan(np.array(durations), a, orders)
