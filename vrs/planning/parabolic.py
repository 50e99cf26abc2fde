"""Linear moves with parabolic blends, from any state. Source: Doulgeri et al., section II-B and Fig. 1."""

from __future__ import annotations

import math

import numpy as np

from vrs.chunk import State
from vrs.errors import PlanningError
from vrs.model import Array, Limits
from vrs.planning.blend import blend
from vrs.planning.certificate import violation
from vrs.planning.online import online
from vrs.planning.plan import Plan, empty, end_state, integrate
from vrs.planning.straight import NEGLIGIBLE, follow, rates

__all__ = ["NEGLIGIBLE", "blend", "brake", "from_rest", "rest_to_rest", "to_rest"]


def to_rest(state: State, q: Array, speed: float, limits: Limits) -> Plan:
    """Plan from any state to rest at q, all joints arriving together.

    From rest: parabola, line, parabola, with common knots, in the least time; the line is left out where the
    way is short. Moving: the blend of Fig. 1 with common knots wherever one keeps the limits, else knots of
    each joint's own, else each joint brakes and the move starts from rest. A common blend that takes twice as
    long as that last way is no use to anybody and isn't taken.

    Args:
        state: Start; its acceleration doesn't bind.
        q: Target [rad], (n,), within the position limits.
        speed: Share v of the speed limits, in (0, 1].
        limits: Limits that hold at every instant.

    Raises:
        PlanningError: If none of these keeps the limits.
    """
    if not any(state.qd.tolist()):
        return rest_to_rest(state.q, q, speed, limits)
    plan = blend(state, q, speed, limits, patience=2.0)
    if plan is not None:
        return plan
    still = np.zeros(len(q))
    plan = online(state, State(q, still, still), speed, limits, order=2)
    if plan is not None:
        return plan
    stop = brake(state, limits)
    plan = stop.then(rest_to_rest(end_state(stop).q, q, speed, limits))
    problem = violation(plan, limits, jerk=False)
    if problem is not None:
        raise PlanningError(f"no blend from this state: {problem}")
    return plan


def rest_to_rest(start: Array, q: Array, speed: float, limits: Limits) -> Plan:
    """Parabola, line, parabola on the straight line of joint space, in the least time.

    Raises:
        PlanningError: If either position lies outside the limits.
    """
    allowed = rates(start.tolist(), q.tolist(), speed, limits)
    if allowed is None:
        return empty(len(q))
    rate, growth = allowed.speed, allowed.acceleration
    if rate * rate >= growth:
        rate = math.sqrt(growth)
    ramp, cruise = rate / growth, 1.0 / rate - rate / growth
    half, covered = 0.5 * growth, 0.5 * rate * ramp
    first, last = (0.0, 0.0, half), (1.0 - covered, rate, -half)
    if cruise > 1e-12 * ramp:
        return follow(start, q, [ramp, cruise, ramp], [*first, covered, rate, 0.0, *last])
    return follow(start, q, [ramp, ramp], [*first, *last])


def brake(state: State, limits: Limits) -> Plan:
    """Each joint to rest as fast as its acceleration limit allows; knots of each joint's own."""
    needed = np.abs(state.qd) / limits.qdd_max
    knots = np.array(sorted({time for time in needed.tolist() if time > 0.0}))
    if len(knots) == 0:
        return empty(len(needed))
    rate = np.copysign(limits.qdd_max, -state.qd)
    h = knots.copy()
    h[1:] -= knots[:-1]
    return integrate(state, h, np.where(needed >= knots[:, None], rate, 0.0), 2)


def from_rest(start: Array, goal: State, speed: float, limits: Limits) -> Plan:
    """Plan from rest to a moving state: in time's mirror, `to_rest` from that state with its speed reversed.

    Args:
        start: Where it begins [rad], (n,).
        goal: State to meet; its speed may raise v, its acceleration doesn't bind.
        speed: Share v of the speed limits, in (0, 1].
        limits: Limits that hold at every instant.

    Raises:
        PlanningError: If none of the ways keeps the limits.
    """
    if not any(goal.qd.tolist()):
        return rest_to_rest(start, goal.q, speed, limits)
    plan = blend(goal, start, speed, limits, back=True, patience=2.0)
    if plan is not None:
        return plan
    still = np.zeros(len(start))
    plan = online(State(start, still, still), goal, speed, limits, order=2)
    if plan is not None:
        return plan
    braking = brake(State(goal.q, -goal.qd, goal.qdd), limits)
    stop = end_state(braking)
    h = braking.durations[::-1].copy()
    run_up = integrate(State(stop.q, still, still), h, 2.0 * braking.coefficients[::-1, 2], 2)
    plan = rest_to_rest(start, stop.q, speed, limits).then(run_up)
    problem = violation(plan, limits, jerk=False)
    if problem is not None:
        raise PlanningError(f"the run-up to the scheduled move: {problem}")
    return plan
