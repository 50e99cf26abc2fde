"""Linear moves with parabolic blends, from any state. Source: Doulgeri et al., section II-B and Fig. 1.

From rest to rest every joint follows one profile from 0 to 1 on the straight line of joint space.

A moving arm is redirected with common knots: blend, line, parabola (s3' s4' s5' of Fig. 1).

With blend time b and L = b/2 + line + last/2, joint j cruises at V = D/L, D = q − q0 − qd0 b/2; the last parabola
takes A/L at least, A = max |D|/qdd_max, and the whole T = L + b/2 + A/(2 L). T grows with L wherever the line isn't
negative, so each b has one best L, and what is left is a search for b.
Source: Doulgeri, Zikos, Delopoulos, section II-B.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vrs.errors import PlanningError
from vrs.model import Array, Limits
from vrs.planning.certificate import Bounds, bounds, violation
from vrs.planning.online import online
from vrs.planning.plan import Plan, empty, end_state, integrate, parabolas
from vrs.segment import State

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


_OVER = 2e-5
"""Share by which a blend time is taken longer than needed, so that the search for it ends."""
_GAIN = 1e-4
"""Share of the duration below which a longer search isn't worth it."""
_WITHIN = 1.0 + 4e-10
"""What a limit is multiplied by to be kept: a little less than what the general certificate lets pass."""
_STOPPING = np.concatenate([np.linspace(0.05, 2.0, 40), np.geomspace(2.2, 40.0, 16)])
"""Blend times to try, in times of what stopping takes."""
_REVERSING = np.linspace(0.03, 2.1, 40)
"""Blend times to try, in times of what reaching full speed takes."""


def blend(
    state: State, q: Array, speed: float, limits: Limits, *, back: bool = False, patience: float = math.inf
) -> Plan | None:
    """The fastest redirection with common knots that keeps the limits.

    Args:
        state: Start, moving; its acceleration doesn't bind.
        q: Target [rad], (n,), within the position limits.
        speed: Share v of the speed limits, in (0, 1].
        limits: Limits that hold at every instant.
        back: Plan the other way, from rest at q to the state. In time's mirror that's a redirection, from the state
            with its speed reversed; a joint may cruise as fast as the state is, if that's more than v allows.
        patience: How many times as long as braking and a move from there it may take.

    Returns:
        The plan, which keeps the limits, or None if the search finds none that's quick enough.
    """
    bound = bounds(limits)
    qd = state.qd.tolist()
    fastest = [speed * limit for limit in bound.qd_max]
    if back:
        qd = [-value for value in qd]
        fastest = [abs(v) if abs(v) > top else top for v, top in zip(qd, fastest, strict=True)]
    move = ParabolicMove(state.q.tolist(), qd, q.tolist(), fastest, bound)
    slowest = slowest_joint(move)
    times = quickest(move, slowest)
    plan = None if times is None else certified(move, times, back=back)
    if plan is None:
        times = _searched(move, limits)
        plan = None if times is None else certified(move, times, back=back)
    # Through rest nothing is quicker than its slowest joint alone would be, and that's known.
    if plan is None or plan.duration <= patience * slowest.total:
        return plan
    return plan if plan.duration <= patience * _through_rest(move, speed) else None


class ParabolicTimes(NamedTuple):
    """Of a redirection [s]."""

    total: float
    blend: float
    L: float


class _Slowest(NamedTuple):
    """The joint that needs longest when it's alone."""

    total: float
    """What it needs [s]."""
    blend: float
    """Of which its blend [s]."""
    too_fast: bool
    """Whether any joint is faster than it may cruise."""


class _Value(NamedTuple):
    """The best redirection of one blend time."""

    total: float
    """T [s]; infinite where there's none."""
    L: float
    """[s]."""
    slope: float
    """dT/db; negative where a longer blend might do."""


class ParabolicMove:
    """What a redirection starts from and goes to, as plain floats."""

    __slots__ = ("bound", "joints", "q", "q0", "qd", "way")

    def __init__(
        self, q0: list[float], qd: list[float], q: list[float], fastest: list[float], bound: Bounds
    ) -> None:
        self.q0, self.qd, self.q, self.bound = q0, qd, q, bound
        self.way = [b - a for a, b in zip(q0, q, strict=True)]
        self.joints = list(zip(self.way, qd, fastest, bound.qdd_max, strict=True))
        """Way, speed, fastest cruise and acceleration of each joint."""


def quickest(move: ParabolicMove, slowest: _Slowest) -> ParabolicTimes | None:
    """The fastest redirection, its turning points not looked at; None where the search doesn't end.

    Where the other joints can follow the slowest, nothing is faster.
    """
    b = slowest.blend
    before = None
    for _ in range(20):
        L, A, needed = _needed(move, b)
        if needed <= b:
            break
        longer = needed
        if before is not None:
            # The secant of needed(b) − b through the last two.
            bend = (needed - b) - (before[1] - before[0])
            secant = b - (needed - b) * (b - before[0]) / bend if bend else b
            longer = secant if secant > b else needed
        before = b, needed
        b = longer * (1.0 + _OVER)
    else:
        return None
    found = ParabolicTimes(L + 0.5 * (b + A / L), b, L)
    return _slowing(move, found) if slowest.too_fast else found


def slowest_joint(move: ParabolicMove) -> _Slowest:
    """The joint that needs longest when it's alone."""
    longest, b = 0.0, 0.0
    too_fast = False
    for way, qd, fastest, g in move.joints:
        # As if the target lay ahead; where braking alone gets there, it does.
        if way * g < (0.5 - 1e-9) * qd * abs(qd):
            D, v = -way, -qd
        else:
            D, v = way, qd
        V = fastest
        if v > V:
            too_fast = True
            ramp = (v - V) / g
            line = (D - 0.5 * (v + V) * ramp) / V - 0.5 * V / g
        else:
            if -v > V * (1.0 + 1e-9):
                too_fast = True
            line = (D - (V * V - 0.5 * v * v) / g) / V
            if line < 0.0:
                V, line = math.sqrt(abs(g * D + 0.5 * v * v)), 0.0
            ramp = (V - v) / g
        total = ramp + line + V / g
        if total > longest:
            longest, b = total, ramp
    return _Slowest(longest, b if b > 1e-6 * longest else 1e-6 * longest, too_fast)


def _needed(move: ParabolicMove, b: float) -> tuple[float, float, float]:
    """Smallest L of a blend time that cruises and stops within the limits, A, and the time that its blend needs."""
    L = A = needed = 0.0
    half = 0.5 * b
    for way, qd, fastest, g in move.joints:
        reach = abs(way - half * qd)
        if reach > L * fastest:
            L = reach / fastest
        if reach > A * g:
            A = reach / g
    triangle = 0.25 * (b + math.sqrt(b * b + 8.0 * A))
    L = triangle if triangle > L else L
    for way, qd, _, g in move.joints:
        change = abs((way - half * qd) / L - qd)
        if change > needed * g:
            needed = change / g
    return L, A, needed


def _through_rest(move: ParabolicMove, speed: float) -> float:
    """Duration of braking and of the move from there [s], whether or not it keeps the position limits."""
    longest = slowest = weakest = 0.0
    for (way, qd, _, g), v in zip(move.joints, move.bound.qd_max, strict=True):
        braking = abs(qd) / g
        reach = abs(way - 0.5 * qd * braking)
        longest = max(longest, braking)
        slowest = max(slowest, reach / v)
        weakest = max(weakest, reach / g)
    if slowest == 0.0:
        return longest
    rate = min(speed / slowest, 1.0 / math.sqrt(weakest))
    return longest + 1.0 / rate + rate * weakest


def _slowing(move: ParabolicMove, found: ParabolicTimes) -> ParabolicTimes:
    """A longer blend, where a joint that is faster than it may cruise had better slow down gradually.

    T(b) is convex but for details: tangents at both ends of a bracket meet near its minimum.
    """
    low, at_low = found.blend, _value(move, found.blend)
    if at_low.slope >= 0.0 or at_low.total == math.inf:
        return found
    high, at_high = low, at_low
    for _ in range(12):
        high = max(3.0 * high, 0.25 * at_low.total)
        at_high = _value(move, high)
        if at_high.total < found.total:
            found = ParabolicTimes(at_high.total, high, at_high.L)
        if at_high.slope >= 0.0:
            break
        if at_high.total < math.inf:
            low, at_low = high, at_high
    else:
        return found
    for _ in range(20):
        fall = at_low.total - at_low.slope * low - at_high.total + at_high.slope * high
        meet = fall / (at_high.slope - at_low.slope)
        if at_low.total + at_low.slope * (meet - low) > found.total * (1.0 - _GAIN):
            break
        edge = 0.05 * (high - low)
        b = min(max(meet, low + edge), high - edge)
        value = _value(move, b)
        if value.total < found.total:
            found = ParabolicTimes(value.total, b, value.L)
        if value.slope >= 0.0:
            high, at_high = b, value
        elif value.total < math.inf:
            low, at_low = b, value
        else:
            break
    return found


def _value(move: ParabolicMove, b: float) -> _Value:
    """The best redirection of a blend time, all limits but the positions kept."""
    L = A = L_slope = A_slope = 0.0
    longest = math.inf
    for way, speed, fastest, g in move.joints:
        reach, qd = way - 0.5 * b * speed, speed
        if reach < 0.0:
            reach, qd = -reach, -qd
        if reach > L * fastest:
            L, L_slope = reach / fastest, -0.5 * qd / fastest
        if reach > A * g:
            A, A_slope = reach / g, -0.5 * qd / g
        # qd − g b ≤ V = reach/L ≤ qd + g b.
        top, bottom = qd + g * b, qd - g * b
        if top <= 0.0:
            return _Value(math.inf, 0.0, -1.0)
        if reach > L * top:
            L = reach / top
            L_slope = -(0.5 * qd + L * g) / top
        if bottom > 0.0 and reach < longest * bottom:
            longest = reach / bottom
    root = math.sqrt(b * b + 8.0 * A)
    triangle = 0.25 * (b + root)
    if triangle > L:
        L, L_slope = triangle, 0.25 * (1.0 + (b + 4.0 * A_slope) / root)
    if longest < L:
        return _Value(math.inf, L, -1.0)
    half = 0.5 * A / L
    return _Value(L + 0.5 * b + half, L, L_slope * (1.0 - half / L) + 0.5 + 0.5 * A_slope / L)


def certified(move: ParabolicMove, times: ParabolicTimes, *, back: bool = False) -> Plan | None:
    """The plan, or its mirror image in time, or None if it passes a limit.

    The certificate is exact: speeds are linear between q0', V, V and 0, accelerations constant, and a joint turns
    back within the blend at most, so that its positions lie between those at the knots and that turning point.
    """
    total, b, L = times
    bound = move.bound
    last = 2.0 * (total - L) - b
    line = L - 0.5 * (b + last)
    triangle = line <= 1e-9 * total
    if triangle:
        last = 2.0 * L - b
    if not (b > 0.0 and last > 0.0):
        return None
    half, fading = 0.5 * b, 0.5 * last
    V, blending, stopping, corner, foot = [], [], [], [], []
    for start, end, way, qd, growth, speed, low, high in zip(
        move.q0, move.q, move.way, move.qd, bound.qdd_max, bound.qd_max, bound.lowest, bound.highest, strict=True
    ):
        g, v_max = growth * _WITHIN, speed * _WITHIN
        v = (way - half * qd) / L
        rise, fall = (v - qd) / b, -v / last
        first, second = start + 0.5 * (qd + v) * b, end - fading * v
        turn = start - 0.5 * qd * qd / rise if qd * v < 0.0 else first
        # Written so that NaN fails.
        if not (
            -g <= rise <= g
            and -g <= fall <= g
            and -v_max <= qd <= v_max
            and -v_max <= v <= v_max
            and low <= start <= high
            and low <= first <= high
            and low <= turn <= high
            and low <= second <= high
            and low <= end <= high
        ):
            return None
        V.append(v)
        blending.append(0.5 * rise)
        stopping.append(0.5 * fall)
        corner.append(first)
        foot.append(second)
    zero = [0.0] * len(V)
    if back:
        V = [-v for v in V]
        opening, closing = (move.q, zero, stopping), (corner, V, blending)
        b, last, corner = last, b, foot
    else:
        # The last parabola is written from the target, so that it ends there and at rest.
        opening, closing = (move.q0, move.qd, blending), (foot, V, stopping)
    if triangle:
        return parabolas([b, last], [*opening, *closing])
    return parabolas([b, line, last], [*opening, corner, V, zero, *closing])


def _searched(move: ParabolicMove, limits: Limits) -> ParabolicTimes | None:
    """The fastest redirection on a grid of blend times whose turning points lie within the limits."""
    stopping = float(np.max(np.abs(move.qd) / limits.qdd_max))
    reversing = float(np.max(limits.qd_max / limits.qdd_max))
    lengths = np.concatenate([_STOPPING * stopping, _REVERSING * reversing])
    best = _least_time(move, limits, lengths)
    if best is None:
        return None
    finer = _least_time(move, limits, best.blend * np.linspace(0.94, 1.06, 25))
    return finer if finer is not None and finer.total < best.total else best


def _least_time(move: ParabolicMove, limits: Limits, b: Array) -> ParabolicTimes | None:
    """The fastest feasible redirection among blend times b, or None."""
    q0, qd = np.array(move.q0), np.array(move.qd)
    fastest = np.array([fastest for _, _, fastest, _ in move.joints])
    bb = b[:, None]
    D = np.array(move.way) - 0.5 * bb * qd
    reach = np.abs(D)
    with np.errstate(divide="ignore", invalid="ignore"):
        # |D/L − qd| ≤ qdd b bounds x = 1/L from both sides.
        low, high = (qd - limits.qdd_max * bb) / D, (qd + limits.qdd_max * bb) / D
        x_low = np.where(reach > 0, np.minimum(low, high), 0.0).max(1)
        x_high = np.where(reach > 0, np.maximum(low, high), np.inf).min(1)
        stoppable = ((reach > 0) | (np.abs(qd) <= limits.qdd_max * bb)).all(1)
        shortest = np.maximum((reach / fastest).max(1), 1.0 / x_high)
        longest = 1.0 / np.maximum(x_low, 0.0)
    A = (reach / limits.qdd_max).max(1)
    L = np.maximum(shortest, 0.25 * (b + np.sqrt(b * b + 8.0 * A))) * (1.0 + 1e-12)
    last = A / L
    T = L + 0.5 * (b + last)
    possible = stoppable & (x_high > 0) & (longest >= L) & (last > 0) & np.isfinite(T)
    if possible.any():
        V = D / np.where(possible, L, 1.0)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = q0 + 0.5 * bb * qd * qd / (qd - V)
        outside = (turn > limits.q_max) | (turn < limits.q_min)
        possible &= ~((qd * V < 0) & outside).any(1) & ~((qd != 0) & (V == 0) & outside).any(1)
    if not possible.any():
        return None
    i = int(np.argmin(np.where(possible, T, np.inf)))
    return ParabolicTimes(float(T[i]), float(b[i]), float(L[i]))


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
    return integrate(state, h, np.where(needed >= knots[:, None], rate, 0.0))


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
    run_up = integrate(State(stop.q, still, still), h, 2.0 * braking.coefficients[::-1, 2])
    plan = rest_to_rest(start, stop.q, speed, limits).then(run_up)
    problem = violation(plan, limits, jerk=False)
    if problem is not None:
        raise PlanningError(f"the run-up to the scheduled move: {problem}")
    return plan
