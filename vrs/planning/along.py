"""Plans along a path of the joints: a time law within the limits, put into polynomials and certified.

The time law says when the parameter is where: the fastest one within the limits, and a smooth one made of it.

Between knots the square of the parameter's speed is linear in the parameter, so its acceleration is constant
there and the law is a parabola of time. Source: Pham, Pham, "A new approach to time-optimal path parameterization
based on reachability analysis", IEEE T-RO 34(3), 2018; here the limits hold at many samples of each interval.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vrs.errors import PlanningError
from vrs.model import Array, Limits, RobotModel
from vrs.planning.certificate import violation
from vrs.planning.fit import fit_parts
from vrs.planning.path import Path
from vrs.planning.plan import Plan, slowed

_STEEP: Final = 1e-9
_ROUNDS: Final = 60


@dataclass(frozen=True, slots=True, eq=False)
class TimeLaw:
    """A parameter over time, piece by piece."""

    durations: Array
    """[s], (m,), positive."""
    coefficients: Array
    """(m, 4), ascending powers of the time since each piece's start."""
    smooth: bool = False
    """Whether its acceleration is continuous."""

    @property
    def duration(self) -> float:
        """Of the whole [s]."""
        return float(self.durations.sum())

    def value(self, part: NDArray[np.intp], u: Array) -> Array:
        """The parameter and its first three derivatives, (4, k), at times u (k,) [s] of pieces (k,)."""
        a, b, c, d = self.coefficients[part].T
        d3 = 3.0 * d
        growth = c + d3 * u
        return np.array(
            [a + u * (b + u * (c + u * d)), b + u * (c + growth), 2.0 * growth, 2.0 * d3],
        )


def fastest(
    s: Array, knots: NDArray[np.intp], first: Array, second: Array, acceleration: Array, cap: Array, start: float
) -> Array:
    """The fastest law on a path that ends at rest.

    Args:
        s: Parameters of the samples, (k,), increasing.
        knots: Which samples are knots, (m + 1,), the first and the last among them.
        first: q' at the samples, (k, n).
        second: q'' at the samples, (k, n).
        acceleration: Largest acceleration [rad/s²], (n,).
        cap: Largest square of the parameter's speed at the samples, (k,). A law of few knots needs that of many
            for a cap: speed gained too early has to be paid for dearly.
        start: Square of its speed at the beginning.

    Returns:
        The square of its speed at the knots, (m + 1,).

    Raises:
        PlanningError: If the limits can't be kept from this start.
    """
    rows = _rows(s, knots, first / acceleration, second / acceleration, cap)
    m = len(rows)
    most = np.empty(m + 1)
    most[m] = 0.0
    for k in range(m - 1, -1, -1):
        most[k] = _largest(*rows[k], float(cap[knots[k]]), float(most[k + 1]))
    if start > most[0] * (1.0 + 1e-9):
        raise PlanningError("the arm is too fast to stay on the path")
    best = np.empty(m + 1)
    best[0] = start
    for k, (p, g) in enumerate(rows):
        best[k + 1] = max(min(float((p - g * best[k]).min()), most[k + 1]), 0.0)
    if not (best[1:-1] > 0).all():
        raise PlanningError("the arm can't go on along the path")
    return best


def few_knots(s: Array, squares: Array, marks: NDArray[np.intp], tolerance: float) -> NDArray[np.intp]:
    """Choose knots between which squares of speed are nearly linear.

    Args:
        s: Parameters, (k,).
        squares: Squares of the parameter's speed there, (k,).
        marks: Indices that are knots anyway, the first and the last among them.
        tolerance: Largest deviation, as a share of the square.
    """
    kept, open_ = [0], [(int(i), int(j)) for i, j in pairwise(marks)][::-1]
    while open_:
        i, j = open_.pop()
        if j > i + 1:
            inner = slice(i + 1, j)
            line = squares[i] + (squares[j] - squares[i]) / (s[j] - s[i]) * (s[inner] - s[i])
            error = np.abs(line - squares[inner]) / (squares[inner] + 1e-9 * squares.max())
            k = int(error.argmax())
            if error[k] > tolerance:
                open_ += [(i + 1 + k, j), (i, i + 1 + k)]
                continue
        kept.append(j)
    return np.array(kept)


def _rows(s: Array, knots: NDArray[np.intp], first: Array, second: Array, cap: Array) -> list[tuple[Array, Array]]:
    """Limits of each interval as (p, g): with x and y the squares at its ends, |y + g x| <= p."""
    counts = np.diff(knots) + 1
    which = np.repeat(np.arange(len(counts)), counts)
    offset = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    at = knots[which] + offset
    width = (s[knots[1:]] - s[knots[:-1]])[which]
    share = ((s[at] - s[knots[which]]) / width)[:, None]
    bend, slope = second[at], first[at] / (2.0 * width)[:, None]
    # The cap at an interval's first knot bounds x itself, not a row of both.
    A = np.hstack([bend * (1.0 - share) - slope, np.where(share > 0, 1.0 - share, 0.0) / cap[at][:, None]])
    B = np.hstack([bend * share + slope, share / cap[at][:, None]])
    sign = np.where(B < 0, -1.0, 1.0)
    B = np.maximum(np.abs(B), _STEEP)
    p, g = 1.0 / B, sign * A / B
    ends = np.cumsum(counts)
    return [(p[b - c : b].ravel(), g[b - c : b].ravel()) for b, c in zip(ends, counts, strict=True)]


def _largest(p: Array, g: Array, x: float, top: float) -> float:
    """The largest x from which some y in [0, top] keeps |y + g x| <= p; Newton's method, from above."""
    for _ in range(_ROUNDS):
        way = g * x
        room, depth = p - way, p + way
        i, j = int(room.argmin()), int(depth.argmin())
        upper, lower = room.item(i), -depth.item(j)
        high, fall = (top, 0.0) if top <= upper else (upper, g.item(i))
        low, rise = (0.0, 0.0) if lower <= 0.0 else (lower, -g.item(j))
        excess, slope = low - high, rise + fall
        if excess <= 1e-13 * (high + top) or slope <= 0.0:
            break
        x = max(x - excess / slope, 0.0)
    return x


def parabolas(s: Array, squares: Array) -> TimeLaw:
    """The law of squares of speed at knots s, (m + 1,) each."""
    speed = np.sqrt(squares)
    h = 2.0 * np.diff(s) / (speed[:-1] + speed[1:])
    half = 0.25 * np.diff(squares) / np.diff(s)
    return TimeLaw(h, np.stack([s[:-1], speed[:-1], half, np.zeros_like(half)], axis=1))


def smoothed(law: TimeLaw, width: float) -> TimeLaw:
    """The moving average of a law that ends at rest over a time [s]: cubic pieces, continuous acceleration.

    A law that begins at a speed must keep it for half that time; it's then begun there and at that speed.
    """
    h, a = law.durations, law.coefficients
    t = np.concatenate([[0.0], np.cumsum(h)])
    end = float(a[-1, 0] + h[-1] * (a[-1, 1] + h[-1] * a[-1, 2]))
    # The integral of the parameter up to the knots: what the average's parameter is made of.
    area = np.concatenate([[0.0], np.cumsum(h * (a[:, 0] + h * (a[:, 1] / 2.0 + h * a[:, 2] / 3.0)))])

    def integrals(x: Array) -> Array:
        """Area under the law, the law and its speed, (3, k)."""
        i = np.searchsorted(t[1:-1], x, side="right")
        u = np.minimum(x - t[i], h[i])
        c = a[i].T
        before = u < 0.0
        c[2, before] = 0.0
        s = np.array(
            [
                area[i] + u * (c[0] + u * (c[1] / 2.0 + u * c[2] / 3.0)),
                c[0] + u * (c[1] + u * c[2]),
                c[1] + 2.0 * u * c[2],
            ]
        )
        over = x >= t[-1]
        s[0, over], s[1, over], s[2, over] = area[-1] + end * (x[over] - t[-1]), end, 0.0
        return s

    begin = 0.5 * width if a[0, 1] else 0.0
    knots = np.sort(np.concatenate([t, t + width, [begin]]))
    knots = knots[knots >= begin]
    knots = knots[np.concatenate([[True], np.diff(knots) > 1e-6 * width])]
    knots[-1] = t[-1] + width
    both = integrals(np.concatenate([knots, knots - width]))
    average = (both[:, : len(knots)] - both[:, len(knots) :]) / width
    steps = np.diff(knots)
    jerk = np.diff(average[2]) / steps
    return TimeLaw(steps, np.stack([*average[:2, :-1], 0.5 * average[2, :-1], jerk / 6.0], axis=1), smooth=True)


TOLERANCE: Final = 1e-10
"""Largest deviation of the polynomials from the path [rad]."""

_SAMPLES: Final = 128
_KNOTS: Final = (0.1, 0.02, 0.005)
"""Tolerances with which knots are chosen; the next is taken where the law is slower than _SLOWER times the best."""
_SLOWER: Final = 1.03
_SLOWER_SMOOTH: Final = 1.06
"""The same for a law that's smoothed afterwards, each knot becoming two."""
_WIDTHS: Final = (0.6, 0.9, 1.2, 1.6, 2.2)
"""Times of the moving average to try, in times of what the acceleration limit takes at the jerk limit."""
_JOININGS: Final = ((1.0, 0.02), (1.4, 0.1), (1.4, 0.3), (2.2, 0.5))
"""Such times for lines that go on from a blend, with shares of the limits that the fastest law leaves unused."""
_ROOM: Final = 1e-3
"""Relative overshoot of samples that's left to the certificate."""
_LEAST: Final = 8
"""Samples of the line that a blend must leave."""
_LOOKS: Final = 5
"""Samples of each piece of a smooth law."""
_MARGINS: Final = (2e-3, 1e-2, 5e-2)
_STRETCHES: Final = (0.0, 1e-6, 1e-4, 1e-3, 1e-2)


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples of a path, pieces' ends included, increasing."""

    s: Array
    """Parameters, (k,)."""
    joints: Array
    """q and its first three derivatives by the parameter, (k, 4, n)."""


def sampled(path: Path) -> Samples:
    """Sample a path densely enough to judge it."""
    m = len(path.edges) - 1
    x = np.linspace(-1.0, 1.0, max(8, -(-_SAMPLES // m)) + 1)
    s, joints = path.sample(x)
    inner = joints[:, :-1].reshape(-1, *joints.shape[2:])
    return Samples(np.append(s[:, :-1].ravel(), path.edges[-1]), np.concatenate([inner, joints[-1:, -1]]))


@dataclass(frozen=True, slots=True, eq=False)
class Traversal:
    """A path to travel, and under which limits."""

    path: Path
    samples: Samples
    start: Array
    """q at the beginning [rad], (n,)."""
    end: Array
    """q at the end [rad], (n,)."""
    speed: float
    """Share v of the speeds."""
    model: RobotModel
    limits: Limits
    qd: Array | None = None
    """Velocity at the beginning [rad/s], (n,), that of a blend; None for rest."""
    qdd: Array | None = None
    """Acceleration at the beginning [rad/s²], (n,), that of a smooth blend; None leaves it to the path."""
    rate: float = 0.0
    """Speed of the parameter at the beginning [1/s]."""

    def caps(self, margin: float) -> Array:
        """Largest squares of the parameter's speed at the samples, (k,).

        On a blend the arm may be faster than v allows: it was when it came.
        """
        s, first = self.samples.s, np.abs(self.samples.joints[:, 1])
        linear, angular = self.path.course.speeds(s)
        v = np.full(len(s), self.speed)
        tool, turn = np.full(len(s), self.model.tool_speed), np.full(len(s), self.model.tool_turn_speed)
        tool, turn = tool * v, turn * v
        if self.qd is not None:
            blend = s < 1.0
            v[blend] = 1.0
            tool[blend] = np.maximum(tool[blend], self.rate * linear[0])
            turn[blend] = np.maximum(turn[blend], self.rate * angular[0])
        with np.errstate(divide="ignore"):
            fastest_joints = (self.limits.qd_max * (1.0 - margin) / first).min(1) * v
            speed = np.minimum(fastest_joints, np.minimum(tool / linear, turn / angular))
        if self.qd is not None:
            speed[0] = max(speed[0], self.rate * (1.0 + 1e-9))
        cap: Array = speed * speed
        return cap

    def law(self, margin: float, slower: float = _SLOWER) -> TimeLaw:
        """The fastest time law, of few parabolas.

        Args:
            margin: Share of the joint limits that is left unused.
            slower: How many times the least duration it may take.

        Raises:
            PlanningError: If the arm is too fast for the path.
        """
        s, first, second = self.samples.s, self.samples.joints[:, 1], self.samples.joints[:, 2]
        acceleration = self.limits.qdd_max * (1.0 - margin)
        cap, square = self.caps(margin), self.rate**2
        edges = self.path.course.edges
        marks = np.unique(np.searchsorted(s, np.clip(edges, s[0], s[-1])))
        every = np.unique(np.concatenate([np.arange(0, len(s), 2), marks]))
        best = fastest(s, every, first, second, acceleration, cap, square)
        least = parabolas(s[every], best)
        cap[every[1:-1]] = np.minimum(cap[every[1:-1]], best[1:-1])
        for tolerance in _KNOTS:
            knots = every[few_knots(s[every], best, np.searchsorted(every, marks), tolerance)]
            try:
                law = parabolas(s[knots], fastest(s, knots, first, second, acceleration, cap, square))
            except PlanningError:
                continue
            if law.duration <= slower * least.duration:
                return law
        return least

    def polynomials(self, law: TimeLaw) -> Plan:
        """The joints under a time law, not certified."""
        edges = self.path.edges
        law = split(law, edges)
        last = len(law.durations) - 1
        ends = law.value(np.arange(last + 1), law.durations)[0]
        inside = 0.5 * (law.coefficients[:, 0] + ends)
        # At a place where the path bends, each part looks at its own side.
        marks = self.path.course.edges
        stretch = np.searchsorted(marks, inside, side="right")
        part_low = np.searchsorted(edges, marks[stretch - 1])
        part_high = np.searchsorted(edges, marks[stretch]) - 1
        shared = 3 if law.smooth else 2

        def motion(part: NDArray[np.intp], u: Array) -> tuple[Array, Array, Array]:
            values = law.value(part, u)
            # Where parts meet, rounding must not tell one's end from the next one's start.
            ending = np.flatnonzero((u == law.durations[part]) & (part < last))
            following = part[ending] + 1
            values[:shared, ending] = law.value(following, np.zeros(len(ending)))[:shared]
            s, rate, growth, _ = values
            joints = self.path.value(s, part_low[part], part_high[part])
            bending = ending[part_high[part[ending]] < part_low[following]]
            if len(bending):
                beyond = part[bending] + 1
                other_side = self.path.value(s[bending], part_low[beyond], part_high[beyond])
                joints[bending, :shared] = other_side[:, :shared]
            q = joints[:, 0]
            qd = joints[:, 1] * rate[:, None]
            qdd = joints[:, 1] * growth[:, None] + joints[:, 2] * (rate * rate)[:, None]
            first, final = (part == 0) & (u == 0.0), (part == last) & (u == law.durations[last])
            q[first], q[final] = self.start, self.end
            qd[first], qd[final] = (0.0 if self.qd is None else self.qd), 0.0
            if self.qdd is not None:
                qdd[first] = self.qdd
            return q, qd, qdd

        return fit_parts(motion, law.durations, max(TOLERANCE, self.path.tolerance))

    def parabolic(self) -> Plan:
        """The fastest plan of bounded acceleration, certified.

        Raises:
            PlanningError: If there's none.
        """
        problem: str | None = None
        if self.qd is None:
            return self.stretched(self.polynomials(self.law(0.0)), jerk=False)
        for margin in _MARGINS:
            plan = self.polynomials(self.law(margin))
            problem = violation(plan, self.limits, jerk=False)
            if problem is None:
                return plan
        raise PlanningError(f"no blend onto the line: {problem}")

    def jerk_limited(self) -> Plan:
        """A plan from rest to rest of bounded jerk and continuous acceleration, certified.

        Raises:
            PlanningError: If there's none.
        """
        unit = float((self.limits.qdd_max / self.limits.qddd_max).max())
        fast = self.law(0.0, _SLOWER_SMOOTH)
        laws = [smoothed(fast, share * unit) for share in _WIDTHS]
        needed = [law.duration * factor for law, factor in zip(laws, self._factors(laws), strict=True)]
        return self.stretched(self.polynomials(laws[int(np.argmin(needed))]), jerk=True)

    def joined_smoothly(self) -> Plan:
        """The blend at an even rate, then the line, with bounded jerk and continuous acceleration; certified.

        Raises:
            PlanningError: If none is found.
        """
        unit = float((self.limits.qdd_max / self.limits.qddd_max).max())
        problem: str | None = "the arm is too fast for the line"
        for share, margin in _JOININGS:
            try:
                law = self._onward(share * unit, margin)
            except PlanningError:
                # Those that follow ask for more.
                break
            if self._factors([law])[0] > 1.0 + _ROOM:
                continue
            blend = [0.0, self.rate, 0.0, 0.0]
            whole = TimeLaw(
                np.append(1.0 / self.rate, law.durations), np.vstack([blend, law.coefficients]), smooth=True
            )
            plan = self.polynomials(whole)
            problem = violation(plan, self.limits, jerk=True)
            if problem is None:
                return plan
        raise PlanningError(f"no smooth blend onto the line: {problem}")

    def _onward(self, width: float, margin: float) -> TimeLaw:
        """The law from the end of a blend on: smooth, begun at the blend's rate and without acceleration."""
        lead = 1.0 + 0.5 * width * self.rate
        later = self.samples.s > lead + 1e-9
        if np.count_nonzero(later) < _LEAST:
            raise PlanningError("the line is too short for its blend")
        begin = np.array([lead])
        s = np.concatenate([begin, self.samples.s[later]])
        joints = np.concatenate([self.path.value(begin), self.samples.joints[later]])
        after = replace(self, samples=Samples(s, joints)).law(margin, _SLOWER_SMOOTH)
        durations = np.append(0.5 * width, after.durations)
        return smoothed(TimeLaw(durations, np.vstack([[1.0, self.rate, 0.0, 0.0], after.coefficients])), width)

    def _factors(self, laws: list[TimeLaw]) -> Array:
        """By how much smooth laws must be slowed to keep the limits, at least 1; judged at samples, (m,)."""
        x = np.linspace(0.0, 1.0, _LOOKS)
        values = []
        for law in laws:
            part = np.repeat(np.arange(len(law.durations)), _LOOKS)
            values.append(law.value(part, np.tile(x, len(law.durations)) * law.durations[part]))
        s, rate, growth, jerk = np.concatenate(values, axis=1)
        first, second, third = self.between(s)
        r, g, j = rate[:, None], growth[:, None], jerk[:, None]
        linear, angular = self.path.course.speeds(s)
        tool = np.maximum(linear / self.model.tool_speed, angular / self.model.tool_turn_speed) * rate
        needed = np.max(
            [
                np.maximum((np.abs(first * r) / self.limits.qd_max).max(1), tool) / self.speed,
                np.sqrt((np.abs(first * g + second * r * r) / self.limits.qdd_max).max(1)),
                np.cbrt((np.abs(first * j + 3.0 * second * r * g + third * r**3) / self.limits.qddd_max).max(1)),
                np.ones(len(s)),
            ],
            axis=0,
        )
        starts = np.cumsum([0, *(value.shape[1] for value in values[:-1])])
        return np.maximum.reduceat(needed, starts)

    def between(self, s: Array) -> tuple[Array, Array, Array]:
        """First three derivatives of q by the parameter at s, (k,), between samples: good enough to choose by."""
        at = self.samples.s
        i = np.searchsorted(at[1:-1], s, side="right")
        share = ((s - at[i]) / (at[i + 1] - at[i]))[:, None, None]
        joints = self.samples.joints[:, 1:]
        low = joints[i]
        low += share * (joints[i + 1] - low)
        return low[:, 0], low[:, 1], low[:, 2]

    def stretched(self, plan: Plan, *, jerk: bool) -> Plan:
        """Slow a plan from rest to rest, as a whole, as far as the limits demand.

        Raises:
            PlanningError: If it can't be certified.
        """
        limits = self.limits
        if self.speed < 1.0:
            limits = replace(limits, qd_max=self.speed * limits.qd_max)
        bounds = (limits.qd_max, limits.qdd_max, limits.qddd_max)
        factor = _peak(plan, bounds[: 3 if jerk else 2])
        problem: str | None = None
        for more in _STRETCHES:
            slower = slowed(plan, factor * (1.0 + more))
            problem = violation(slower, limits, jerk=jerk)
            if problem is None:
                return slower
        raise PlanningError(f"no time law along the line: {problem}")


def split(law: TimeLaw, edges: Array) -> TimeLaw:
    """Divide pieces of a law that run through several pieces of a path: no one polynomial would do for those."""
    m = len(law.durations)
    ends = law.value(np.arange(m), law.durations)[0]
    begin = np.searchsorted(edges, law.coefficients[:, 0], side="right")
    counts = np.maximum(np.searchsorted(edges, ends) - begin, 1)
    if counts.max() == 1:
        return law
    part = np.repeat(np.arange(m), counts)
    h = (law.durations / counts)[part]
    u = h * (np.arange(len(part)) - np.repeat(np.cumsum(counts) - counts, counts))
    s = law.value(part, u)
    factorials = np.array([1.0, 1.0, 2.0, 6.0])
    return TimeLaw(h, (s / factorials[:, None]).T, law.smooth)


def _peak(plan: Plan, bounds: tuple[Array, ...]) -> float:
    """By how much a plan must be slowed for its derivatives, first and up, to keep bounds; judged at samples."""
    x = 0.5 - 0.5 * np.cos(np.pi * np.arange(33) / 32)
    h = plan.durations[:, None, None]
    K = plan.coefficients.shape[1]
    a = plan.coefficients * h ** np.arange(K)[:, None]
    factor = 1.0
    for order, bound in enumerate(bounds, start=1):
        powers = np.arange(order, K)
        scale = np.prod([powers - i for i in range(order)], axis=0)
        values = (scale * x[:, None] ** (powers - order)) @ a[:, order:] / h**order
        factor = max(factor, float((np.abs(values) / bound).max()) ** (1.0 / order))
    return factor
