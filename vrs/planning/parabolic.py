"""Linear moves with parabolic blends, from any state. Source: Doulgeri et al., section II-B and Fig. 1."""

from __future__ import annotations

import numpy as np

from vrs.chunk import State
from vrs.errors import PlanningError
from vrs.model import Array, Limits
from vrs.planning.online import online
from vrs.planning.plan import Plan, empty, end_state, integrate, violation

NEGLIGIBLE = 1e-12
"""A joint distance [rad] below which there's nothing to move."""

_STOPPING = np.concatenate([np.linspace(0.05, 2.0, 40), np.geomspace(2.2, 40.0, 16)])
"""Blend times to try, in times of what stopping takes."""
_REVERSING = np.linspace(0.03, 2.1, 40)
"""Blend times to try, in times of what reaching full speed takes."""


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
    if not state.qd.any():
        return rest_to_rest(state.q, q, speed, limits)
    stop = brake(state, limits)
    through_rest = stop.then(rest_to_rest(end_state(stop).q, q, speed, limits))
    plan = blend(state, q, speed, limits)
    sane = plan is not None and plan.duration <= 2.0 * through_rest.duration
    if plan is not None and sane and violation(plan, limits, jerk=False) is None:
        return plan
    still = np.zeros_like(q)
    plan = online(state, State(q, still, still), speed, limits, order=2)
    if plan is not None:
        return plan
    problem = violation(through_rest, limits, jerk=False)
    if problem is not None:
        raise PlanningError(f"no blend from this state: {problem}")
    return through_rest


def rest_to_rest(start: Array, q: Array, speed: float, limits: Limits) -> Plan:
    """Parabola, line, parabola on the straight line of joint space, in the least time."""
    d = q - start
    reach = np.abs(d)
    if reach.max() <= NEGLIGIBLE:
        return empty(len(q))
    moving = reach > 0
    rate = float((speed * limits.qd_max[moving] / reach[moving]).min())
    growth = float((limits.qdd_max[moving] / reach[moving]).min())
    if rate * rate >= growth:
        rate = growth**0.5
    blend_time, cruise = rate / growth, 1.0 / rate - rate / growth
    half = 0.5 * growth * d
    ramp = half * blend_time**2
    zero = np.zeros_like(d)
    first = [start, zero, half]
    line = [start + ramp, rate * d, zero]
    last = [q - ramp, rate * d, -half]
    if cruise > 1e-12 * blend_time:
        return Plan(np.array([blend_time, cruise, blend_time]), np.array([first, line, last]))
    return Plan(np.array([blend_time, blend_time]), np.array([first, last]))


def blend(state: State, q: Array, speed: float, limits: Limits) -> Plan | None:
    """Redirect a moving arm with common knots: blend, line, parabola (s3' s4' s5' of Fig. 1).

    With blend time b and L = b/2 + line + parabola/2, a joint's cruise speed is D/L, D = q − q0 − qd0 b/2. For
    each b on a grid, the smallest L that keeps every limit gives the least time.

    Returns:
        The fastest such plan, or None if the grid has none.
    """
    stopping = float(np.max(np.abs(state.qd) / limits.qdd_max))
    reversing = float(np.max(limits.qd_max / limits.qdd_max))
    lengths = np.concatenate([_STOPPING * stopping, _REVERSING * reversing])
    best = _least_time(state, q, speed, limits, lengths)
    if best is None:
        return None
    finer = _least_time(state, q, speed, limits, best[1] * np.linspace(0.94, 1.06, 25))
    if finer is not None and finer[0] < best[0]:
        best = finer
    total, b, L = best
    V = (q - state.q - 0.5 * b * state.qd) / L
    last = 2.0 * (total - L) - b
    line = L - 0.5 * (b + last)
    if line > 1e-9 * total:
        h, control = np.array([b, line, last]), np.array([(V - state.qd) / b, np.zeros_like(V), -V / last])
    else:
        h, control = np.array([b, last]), np.array([(V - state.qd) / b, -V / last])
    plan = integrate(state, h, control, 2)
    # The last parabola is written from the target, so that it ends there and at rest.
    a = plan.coefficients[-1]
    a[1] = V
    a[2] = -0.5 * V / last
    a[0] = q - 0.5 * V * last
    return plan


def _least_time(
    state: State, q: Array, speed: float, limits: Limits, b: Array
) -> tuple[float, float, float] | None:
    """(T, b, L) of the fastest feasible redirection among blend times b, or None."""
    qd = state.qd
    bb = b[:, None]
    D = q - state.q - 0.5 * bb * qd
    reach = np.abs(D)
    fastest = speed * limits.qd_max
    with np.errstate(divide="ignore", invalid="ignore"):
        shortest = (reach / fastest).max(1)
        # |D/L − qd| ≤ qdd b bounds x = 1/L from both sides.
        low, high = (qd - limits.qdd_max * bb) / D, (qd + limits.qdd_max * bb) / D
        x_low = np.where(reach > 0, np.minimum(low, high), 0.0)
        x_high = np.where(reach > 0, np.maximum(low, high), np.inf)
        stoppable = np.where(reach > 0, True, np.abs(qd) <= limits.qdd_max * bb).all(1)
        shortest = np.maximum(shortest, 1.0 / x_high.min(1))
        longest = 1.0 / np.maximum(x_low.max(1), 0.0)
    A = (reach / limits.qdd_max).max(1)
    L = np.maximum(shortest, 0.25 * (b + np.sqrt(b * b + 8.0 * A))) * (1.0 + 1e-12)
    last = A / L
    T = L + 0.5 * (b + last)
    possible = stoppable & (x_high.min(1) > 0) & (longest >= L) & (last > 0) & np.isfinite(T)
    if possible.any():
        V = D / np.where(possible, L, 1.0)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = state.q + 0.5 * bb * qd * qd / (qd - V)
        outside = (turn > limits.q_max) | (turn < limits.q_min)
        possible &= ~((qd * V < 0) & outside).any(1) & ~((qd != 0) & (V == 0) & outside).any(1)
    if not possible.any():
        return None
    i = int(np.argmin(np.where(possible, T, np.inf)))
    return float(T[i]), float(b[i]), float(L[i])


def brake(state: State, limits: Limits) -> Plan:
    """Each joint to rest as fast as its acceleration limit allows; knots of each joint's own."""
    needed = np.abs(state.qd) / limits.qdd_max
    knots = np.unique(needed[needed > 0])
    if len(knots) == 0:
        return empty(len(needed))
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.where(needed > 0, -state.qd / needed, 0.0)
    h = np.diff(knots, prepend=0.0)
    active = needed >= knots[:, None]
    return integrate(state, h, np.where(active, rate, 0.0), 2)


def from_rest(start: Array, goal: State, speed: float, limits: Limits) -> Plan:
    """Plan from rest to a moving state: the mirror image, in time, of braking from it.

    Raises:
        PlanningError: If the way that the mirror needs passes a limit.
    """
    mirrored = brake(State(goal.q, -goal.qd, goal.qdd), limits)
    if len(mirrored) == 0:
        return rest_to_rest(start, goal.q, speed, limits)
    stop = end_state(mirrored)
    h = mirrored.durations[::-1].copy()
    control = 2.0 * mirrored.coefficients[::-1, 2]
    still = np.zeros_like(start)
    run_up = integrate(State(stop.q, still, still), h, control, 2)
    problem = violation(run_up, limits, jerk=False)
    if problem is not None:
        raise PlanningError(f"the run-up to the scheduled move: {problem}")
    return rest_to_rest(start, stop.q, speed, limits).then(run_up)
