"""The same way at another pace: a time law s(t) on a timeline, its polynomials composed exactly.

The timeline after it is q(s(t)), q being the timeline before. With a pace r = ds/dt the joints move at
qd = q'(s) r and qdd = q''(s) r² + q'(s) dr/dt. A change of pace is smooth: dr/dt rises and falls linearly, so
that velocities and accelerations stay as continuous as they were.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from math import comb

import numpy as np

from vrs.insertion import piece
from vrs.model import Array, Limits
from vrs.planning.certificate import violation
from vrs.planning.fit import fit
from vrs.planning.plan import Plan, stacked
from vrs.segment import HOLD, Piece, evaluate, shifted
from vrs.timeline import Timeline

_RAMPS = np.geomspace(0.01, 40.0, 60)
"""Durations of a change of pace to try [s]."""
_LOOKS = 48
_NO_SPEED = 1e-13
"""A speed [rad/s] that's only rounding."""
_NEARLY = 1e-6
"""A speed [rad/s] that's worth a closer look."""
_KNOTS = 8
"""Knots that are looked at together, at first; then twice as many, and so on."""
_NO_JUMP = 1e-9
"""An acceleration, or a jump of one [rad/s²], that counts as none."""
_ASIDE = 1e-9
"""A coefficient aside from a straight line that's only rounding [rad / s**power]."""
_DEGREE_MAX = 24
"""Degree up to which polynomials are composed exactly; above, they're fitted anew."""
_STARTS_MAX = 24
"""Knots of the motion at which a change of pace may begin, if it can't at once."""
_MARGINS = (1.0, 0.99, 0.97, 0.93, 0.85, 0.7, 0.5)


@dataclass(frozen=True, slots=True, eq=False)
class TimeScaling:
    """Timeline time s before, as polynomials of the time after."""

    durations: tuple[float, ...]
    """Of its pieces [s]."""
    coefficients: tuple[tuple[float, ...], ...]
    """Ascending powers of the time since each piece's start; s itself is the constant term."""

    @property
    def duration(self) -> float:
        """Of the whole [s]."""
        return sum(self.durations)

    @property
    def end(self) -> float:
        """Timeline time at the end [s]."""
        return _value(self.coefficients[-1], self.durations[-1]) if self.durations else 0.0

    @property
    def waits(self) -> float:
        """How long the pace stays what it was [s]."""
        return self.durations[0] if self.durations and len(self.coefficients[0]) == 2 else 0.0

    def when(self, s: float) -> float:
        """Time since the start [s] at which a timeline time is reached; the law's ends beyond its ends."""
        passed = 0.0
        for duration, c in zip(self.durations, self.coefficients, strict=True):
            if s <= c[0]:
                return passed
            if s < _value(c, duration):
                return passed + _when(c, s, 0.0, duration)
            passed += duration
        return passed

    def __call__(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Timeline time and its first three derivatives at times since the start, (k,) each."""
        ends = np.cumsum(self.durations)
        piece = np.minimum(np.searchsorted(ends, t, side="right"), len(ends) - 1)
        a = np.zeros((len(ends), 4))
        for row, c in zip(a, self.coefficients, strict=True):
            row[: len(c)] = c
        c0, c1, c2, c3 = a[piece].T
        u = t - (ends - self.durations)[piece]
        return c0 + u * (c1 + u * (c2 + u * c3)), c1 + u * (2 * c2 + 3 * u * c3), 2 * c2 + 6 * u * c3, 6 * c3


def change(s: float, wait: float, goal: float, ramp: float, pace: float = 1.0) -> TimeScaling:
    """Go on at a pace for `wait` seconds, then change to another within `ramp` seconds."""
    half, step = 0.5 * ramp, goal - pace
    begin = s + wait * pace
    middle = begin + half * pace + step * ramp / 12.0
    rising = (begin, pace, 0.0, 2.0 * step / (3.0 * ramp * ramp))
    falling = (middle, 0.5 * (pace + goal), step / ramp, -2.0 * step / (3.0 * ramp * ramp))
    if wait > 0:
        return TimeScaling((wait, half, half), ((s, pace), rising, falling))
    return TimeScaling((half, half), (rising, falling))


def composed(timeline: Timeline, law: TimeScaling) -> Iterator[Piece]:
    """Polynomials of q(s(t)) along a law, a piece for each run of segments of one command."""
    for duration, c in zip(law.durations, law.coefficients, strict=True):
        tau = 0.0
        index = timeline.index_at(c[0])
        while tau < duration:
            begin, a, owner, end = segment_at(timeline, index)
            until = duration if _value(c, duration) <= end else _when(c, end, tau, duration)
            if until > tau:
                w = _moved(c, tau)
                w[0] = max(w[0] - begin, 0.0) if index >= 0 else 0.0
                plan = _composition(a, w, until - tau)
                yield piece(plan, owner)
            tau = until
            index += 1


def remainder(timeline: Timeline, s: float, pace: float) -> Iterator[Piece]:
    """What comes from s on, at a constant pace; at pace 1 all but the first segment is as it was, to the bit."""
    for index in range(max(timeline.index_at(s), 0), len(timeline)):
        begin, a, owner, end = segment_at(timeline, index)
        late = max(s - begin, 0.0)
        if late > 0 and end - begin - late <= 0:
            continue
        b = shifted(a, late) if late > 0 else a
        if pace != 1.0:
            b = b * (pace ** np.arange(len(b)))[:, None]
            b.flags.writeable = False
        duration = (end - begin - late) if late > 0 else timeline.segment(index).duration
        yield Piece([duration / pace], [b], owner)


def paced(timeline: Timeline, s: float, goal: float, limits: Limits, *, jerk: bool) -> TimeScaling:
    """The quickest smooth change of pace from s on that keeps the limits.

    Where it can't begin at once, as in a deceleration that needs all the acceleration there is, it begins at a
    later knot of the motion; at the latest where the motion next rests.

    Args:
        timeline: The motion.
        s: Timeline time at which the law begins [s]; the pace there is 1.
        goal: Pace to reach; 0 stops.
        limits: Limits that hold at every instant.
        jerk: Whether jerk limits bind.
    """
    state = timeline.state_before(s)
    if not state.qd.any() and not state.qdd.any():
        return TimeScaling((), ())
    rest = rest_after(timeline, s)
    best = TimeScaling((rest - s,), ((s, 1.0),))
    for wait in _waits(timeline, s, rest):
        if wait >= best.duration:
            break
        low, high = -1, len(_RAMPS)
        while high - low > 1:
            middle = (low + high) // 2
            if seems_kept(timeline, change(s, wait, goal, float(_RAMPS[middle])), limits, jerk=jerk):
                high = middle
            else:
                low = middle
        for ramp in _RAMPS[high : high + 6].tolist():
            law = change(s, wait, goal, ramp)
            if law.duration >= best.duration:
                break
            if certified(timeline, law, limits, jerk=jerk) is None:
                best = law
                break
    return best


def halting(timeline: Timeline, s: float, limits: Limits, *, jerk: bool) -> TimeScaling:
    """Come to rest along the way, as fast as the limits allow: at the latest where the motion rests anyway.

    Args:
        timeline: The motion.
        s: Timeline time at which the law begins [s].
        limits: Limits that hold at every instant.
        jerk: Whether jerk limits bind: then the pace changes smoothly, else with all the deceleration that's left.

    Source: the lower edge of the phase plane (s, ds/dt), stepped forward in time.
    """
    if jerk:
        return paced(timeline, s, 0.0, limits, jerk=True)
    rest = rest_after(timeline, s)
    for margin in _MARGINS:
        law = _halting(timeline, s, rest, limits, margin)
        if certified(timeline, law, limits, jerk=False) is None:
            return law
    return TimeScaling((rest - s,), ((s, 1.0),))


def straight_until(timeline: Timeline, s: float) -> float | None:
    """When the motion from s on next rests [s], if until then it's on one straight line of joint space."""
    rest = rest_after(timeline, s)
    first = max(timeline.index_at(s), 0)
    d = timeline.state_before(s).qd
    square = float(d @ d)
    for index in range(first, len(timeline)):
        begin, a, _, _ = segment_at(timeline, index)
        if begin >= rest:
            break
        aside = a[1:] - np.outer(a[1:] @ d / square, d) if square else a[1:]
        if np.abs(aside).max(initial=0.0) > _ASIDE:
            return None
    return rest


def certified(timeline: Timeline, law: TimeScaling, limits: Limits, *, jerk: bool) -> str | None:
    """Say which limit the motion along a law passes; None if it keeps them all."""
    return violation(as_plan(composed(timeline, law), timeline.dof), limits, jerk=jerk)


def as_plan(pieces: Iterable[Piece], n: int) -> Plan:
    """Pieces as one plan."""
    parts = list(pieces)
    durations = [h for part in parts for h in part.durations]
    return stacked(durations, [a for part in parts for a in part.coefficients], n)


def _halting(timeline: Timeline, s: float, rest: float, limits: Limits, margin: float) -> TimeScaling:
    qd = np.abs(timeline.state_before(s).qd)
    step = float((qd / limits.qdd_max).max()) / 10.0
    durations: list[float] = []
    coefficients: list[tuple[float, ...]] = []
    pace, index = 1.0, timeline.index_at(s)
    while pace > 0 and s < rest:
        _, _, _, end = segment_at(timeline, index)
        dt = min(step, (end - s) / pace)
        rate = 0.0
        for _ in range(2):
            ahead = np.array([s, s + dt * (pace + 0.25 * dt * rate), s + dt * (pace + 0.5 * dt * rate)])
            ahead = np.clip(ahead, s, np.nextafter(end, s))
            paces = np.maximum(pace + rate * dt * np.array([0.0, 0.5, 1.0]), 0.0)
            rate = margin * _lowest_rate(timeline, ahead, paces, limits)
        if pace + rate * dt <= 0:
            dt = -pace / rate
        over = s + dt * (pace + 0.5 * dt * rate) - end
        if over > 0:
            dt = _when((s, pace, 0.5 * rate), end, 0.0, dt)
        durations.append(dt)
        coefficients.append((s, pace, 0.5 * rate))
        s += dt * (pace + 0.5 * dt * rate)
        pace += rate * dt
        if pace < 1e-12:
            break
        if s >= end - 1e-12:
            s, index = end, index + 1
    return TimeScaling(tuple(durations), tuple(coefficients))


def _lowest_rate(timeline: Timeline, s: Array, pace: Array, limits: Limits) -> float:
    """The strongest deceleration of the pace that every joint allows at all these places, ≤ 0."""
    qd, qdd = timeline.sample(s, derivative=1), timeline.sample(s, derivative=2)
    bend = qdd * (pace * pace)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        lowest = np.minimum((-limits.qdd_max - bend) / qd, (limits.qdd_max - bend) / qd)
        # (−a − b)/qd for qd > 0 and (a − b)/qd for qd < 0: the lower of the two in both cases.
    lowest = np.where(np.abs(qd) > 1e-12, lowest, -np.inf)
    return min(float(lowest.max()), 0.0)


def seems_kept(timeline: Timeline, law: TimeScaling, limits: Limits, *, jerk: bool) -> bool:
    """Whether samples of the motion along a law keep the limits; where they don't, it has no certificate."""
    s, *derivatives = law(np.linspace(0.0, law.duration, _LOOKS))
    p, r, third = (value[:, None] for value in derivatives)
    qd, qdd = timeline.sample(s, derivative=1), timeline.sample(s, derivative=2)
    inside = _within(qd * p, limits.qd_max) and _within(qdd * p * p + qd * r, limits.qdd_max)
    if inside and jerk:
        qddd = timeline.sample(s, derivative=3)
        inside = _within(qddd * p**3 + 3 * qdd * p * r + qd * third, limits.qddd_max)
    return inside


def _within(values: Array, most: Array) -> bool:
    return bool((np.abs(values) <= most * (1.0 + 1e-9)).all())


def _waits(timeline: Timeline, s: float, rest: float) -> Iterator[float]:
    """At once, then at the knots up to where the motion next rests."""
    yield 0.0
    first = max(timeline.index_at(s), 0) + 1
    for index in range(first, min(first + _STARTS_MAX, len(timeline) + 1)):
        knot = timeline.start_of(index)
        if knot > s:
            yield knot - s
        if knot >= rest:
            return


def rest_after(timeline: Timeline, s: float, until: float = np.inf) -> float:
    """When the motion next rests, at a knot [s]; infinity where it doesn't until a time."""
    low, size = max(timeline.index_at(s), 0) + 1, _KNOTS
    high = min(timeline.index_at(until) + 2, len(timeline)) if until < np.inf else len(timeline)
    while low < high:
        knots, qd = timeline.knots(low, min(low + size, high))
        slow = np.abs(qd).max(1) < _NEARLY
        for i in np.flatnonzero(slow & (knots > s)).tolist():
            knot = float(knots[i])
            if knot > until:
                return np.inf
            if _rests(timeline, knot, low + i):
                return knot
        low, size = low + size, 2 * size
    end = max(timeline.end, s)
    return end if end <= until else np.inf


def _rests(timeline: Timeline, knot: float, index: int) -> bool:
    """Whether the arm rests at the knot where a segment begins."""
    before = timeline.state_before(knot)
    if before.qd.any():
        return False
    # What is only nearly at rest goes on moving, with the acceleration that it had.
    after = timeline.state_after(index)
    accelerates = np.abs(after.qdd).max() > _NO_JUMP and np.abs(after.qdd - before.qdd).max() <= _NO_JUMP
    return bool(np.abs(after.qd).max() < _NO_SPEED and not accelerates)


def segment_at(timeline: Timeline, index: int) -> tuple[float, Array, int, float]:
    """Start, coefficients, owner and end of a segment; outside the timeline, of standing there."""
    if index < 0:
        return -np.inf, timeline.initial[None], HOLD, timeline.start
    if index >= len(timeline):
        return timeline.end, timeline.final()[None], HOLD, np.inf
    segment = timeline.segment(index)
    return segment.start, segment.coefficients, segment.command_id or HOLD, timeline.start_of(index + 1)


def _composition(a: Array, w: list[float], duration: float) -> Plan:
    """a(w(t)) for coefficients a, (K, n), and a polynomial w, on [0, duration]."""
    if (len(a) - 1) * (len(w) - 1) > _DEGREE_MAX:
        return fit(partial(_chained, a, w), np.array([0.0, duration]))
    total = a[-1:]
    for row in a[-2::-1]:
        product = np.zeros((len(total) + len(w) - 1, a.shape[1]))
        for k, factor in enumerate(w):
            product[k : k + len(total)] += factor * total
        product[0] += row
        total = product
    return Plan(np.array([duration]), np.array(total)[None])


def _chained(a: Array, w: list[float], t: Array) -> tuple[Array, Array, Array]:
    """q, qd and qdd of a(w(t)), (k, n) each."""
    s, pace, rate = (np.array([_value(_derived(w, k), u) for u in t.tolist()]) for k in range(3))
    q, qd, qdd = (evaluate(a, s, k) for k in range(3))
    p, r = pace[:, None], rate[:, None]
    return q, qd * p, qdd * p * p + qd * r


def _derived(c: list[float], order: int) -> list[float]:
    for _ in range(order):
        c = [k * factor for k, factor in enumerate(c)][1:]
    return c


def _value(c: tuple[float, ...] | list[float], u: float) -> float:
    total = 0.0
    for factor in reversed(c):
        total = total * u + factor
    return total


def _when(c: tuple[float, ...], s: float, low: float, high: float) -> float:
    """The time between low and high at which a rising polynomial reaches s."""
    rate = tuple(k * factor for k, factor in enumerate(c))[1:]
    t = 0.5 * (low + high)
    for _ in range(80):
        short = _value(c, t) - s
        low, high = (t, high) if short < 0 else (low, t)
        steep = _value(rate, t)
        # Newton's step where it stays between the bounds, else half of what they leave.
        step = t - short / steep if steep > 0 else low
        following = step if low < step < high else 0.5 * (low + high)
        if following in (t, low, high):
            break
        t = following
    return high


def _moved(c: tuple[float, ...], u: float) -> list[float]:
    """The polynomial in powers of the time since u."""
    n = len(c)
    return [sum(comb(j, k) * c[j] * u ** (j - k) for j in range(k, n)) for k in range(n)]
