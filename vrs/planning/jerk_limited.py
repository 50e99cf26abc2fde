"""Jerk-limited moves (cubic pieces, continuous acceleration) from any state."""

from __future__ import annotations

import numpy as np

from vrs.chunk import State
from vrs.errors import PlanningError
from vrs.model import Array, Limits
from vrs.planning.online import online
from vrs.planning.parabolic import NEGLIGIBLE, brake
from vrs.planning.plan import Plan, empty, end_state, integrate, violation

BRAKED_FIRST = "braked with parabolas first: no jerk-limited plan from this state keeps the limits"


def to_rest(state: State, q: Array, speed: float, limits: Limits) -> tuple[Plan, str]:
    """Plan from any state to rest at q, all joints arriving together.

    Args:
        state: Start, its acceleration included.
        q: Target [rad], (n,), within the position limits.
        speed: Share v of the speed limits, in (0, 1].
        limits: Limits that hold at every instant.

    Returns:
        The plan, and what the user must know of it (empty if nothing).

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    still = np.zeros_like(q)
    if not state.qd.any() and not state.qdd.any():
        return rest_to_rest(state.q, q, speed, limits), ""
    plan = online(state, State(q, still, still), speed, limits, order=3)
    if plan is not None:
        return plan, ""
    stop = brake(state, limits)
    stopped = end_state(stop).q if len(stop) else state.q
    plan = stop.then(rest_to_rest(stopped, q, speed, limits))
    problem = violation(plan, limits, jerk=True)
    if problem is not None:
        raise PlanningError(f"no jerk-limited plan from this state: {problem}")
    return plan, BRAKED_FIRST


def rest_to_rest(start: Array, q: Array, speed: float, limits: Limits) -> Plan:
    """The seven-segment profile on the straight line of joint space, in the least time."""
    d = q - start
    reach = np.abs(d)
    if reach.max() <= NEGLIGIBLE:
        return empty(len(q))
    moving = reach > 0
    # One part in 1e12 inside, so that rounding can't pass a limit.
    bounds = (speed * limits.qd_max, limits.qdd_max, limits.qddd_max)
    rate, growth, jerk = (float((bound[moving] / reach[moving]).min()) * (1 - 1e-12) for bound in bounds)
    if rate * jerk >= growth * growth:
        ramp, steady = growth / jerk, rate / growth - growth / jerk
    else:
        ramp, steady = (rate / jerk) ** 0.5, 0.0
    cruise = 1.0 / rate - (2.0 * ramp + steady)
    if cruise < 0:
        cruise = 0.0
        ramp = growth / jerk
        whole = 0.5 * (ramp + (ramp * ramp + 4.0 / growth) ** 0.5)
        steady = whole - 2.0 * ramp
        if steady < 0:
            ramp, steady = (0.5 / jerk) ** (1.0 / 3.0), 0.0
    h = np.array([ramp, steady, ramp, cruise, ramp, steady, ramp])
    signs = np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])
    kept = h > 1e-12 * ramp
    h, signs = h[kept], signs[kept]
    # The jerk that covers the way exactly, whatever the knots were rounded to.
    zero = np.zeros(1)
    unit = integrate(State(zero, zero, zero), h, signs[:, None], 3)
    still = np.zeros_like(d)
    return integrate(State(start, still, still), h, signs[:, None] * (d / end_state(unit).q), 3)
