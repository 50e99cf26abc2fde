"""One pose, one arm solution, in plain floats: microseconds where small arrays would take hundreds.

A branch has turns: the joint values within limits that put the arm where the branch puts it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import atan2, ceil, cos, dist, floor, hypot, pi, sin, sqrt, tau
from typing import Final, NamedTuple, TypeAlias

from robots.puma560.parameters import A2, A3, D3, D4

Joints: TypeAlias = tuple[float, float, float, float, float, float]
Pose: TypeAlias = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
"""First three rows of a homogeneous transform, row by row."""
Triangle: TypeAlias = tuple[float, float, float]
"""What both shoulders and both elbows share: |u| [m], |sin e|, cos e."""
Asked: TypeAlias = tuple[bool | None, bool | None, bool | None]
"""Wanted signs righty, above, noflip; None where any will do."""

FOREARM: Final = hypot(A3, D4)
"""Elbow to wrist centre [m]."""
REACH_MAX: Final = A2 + FOREARM
"""Largest distance of the wrist centre from the shoulder in the arm's plane [m]."""
REACH_MIN: Final = FOREARM - A2
"""Smallest such distance [m]."""

RESIDUAL_MAX: Final = 1e-9
"""Largest root sum of squares of the differences of a pose's elements that a solution may leave."""
ORTHONORMAL: Final = 1e-6
"""How far from orthonormal a given rotation may be; the nearest one that is takes its place."""
MERGE_SHOULDER: Final = 1e-8
"""u [m] below which RIGHTY and LEFTY are one; it moves the wrist by u² / 2 d3 = 3e-16 m."""
MERGE_ELBOW: Final = 1e-7
"""|sin e| below which ABOVE and BELOW are one; it moves the wrist by less than 4e-14 m."""
MERGE_WRIST: Final = 1e-10
"""|sin q5| below which joints 4 and 6 share an axis; it turns the tool by as much."""
TIE: Final = 1e-11
"""Signs of smaller numbers are ties; well under the merging bounds, well over rounding."""

FOUR_SIDES: Final = 4 * A2 * FOREARM
"""Sum of the squares that the half angle of the elbow splits [m²]."""
COS_E3: Final = A3 / FOREARM
"""Cosine of e − q3."""
SIN_E3: Final = D4 / FOREARM
"""Sine of e − q3."""


class Branch(NamedTuple):
    """An arm solution."""

    q: Joints
    """Joint values in (−π, π] [rad]; where the wrist is singular, those with q4 = 0."""
    righty: bool | None
    """None where RIGHTY and LEFTY are one."""
    above: bool | None
    """None where ABOVE and BELOW are one."""
    noflip: bool | None
    """None where joints 4 and 6 share an axis."""
    sin5: float
    """|sin q5|."""

    @property
    def words(self) -> str:
        """Name of the branch."""
        return spell(self.righty is not False, self.above is not False, self.noflip is not False)

    def matches(self, asked: Asked) -> bool:
        """Say whether no asked word contradicts this branch."""
        own = (self.righty, self.above, self.noflip)
        return all(a is None or b is None or a == b for a, b in zip(asked, own, strict=True))


def forward(q: Joints) -> Pose:
    """Return the pose of the last link in the base frame for joint values q [rad]."""
    q1, q2, q3, q4, q5, q6 = q
    c1, s1 = cos(q1), sin(q1)
    c4, s4 = cos(q4), sin(q4)
    c5, s5 = cos(q5), sin(q5)
    c6, s6 = cos(q6), sin(q6)
    c23, s23 = cos(q2 + q3), sin(q2 + q3)
    u = A2 * cos(q2) + A3 * c23 - D4 * s23
    v = A2 * sin(q2) + A3 * s23 + D4 * c23
    # Rz(q4) Ry(−q5) Rz(q6), the wrist's Euler angles, column by column.
    c45, s45 = c4 * c5, s4 * c5
    nx, ny, nz = c45 * c6 - s4 * s6, s45 * c6 + c4 * s6, s5 * c6
    ox, oy, oz = -c45 * s6 - s4 * c6, c4 * c6 - s45 * s6, -s5 * s6
    ax, ay, az = -c4 * s5, -s4 * s5, c5
    tn, to, ta = c23 * nx - s23 * nz, c23 * ox - s23 * oz, c23 * ax - s23 * az
    return (
        c1 * tn - s1 * ny,
        c1 * to - s1 * oy,
        c1 * ta - s1 * ay,
        c1 * u + s1 * D3,
        s1 * tn + c1 * ny,
        s1 * to + c1 * oy,
        s1 * ta + c1 * ay,
        s1 * u - c1 * D3,
        s23 * nx + c23 * nz,
        s23 * ox + c23 * oz,
        s23 * ax + c23 * az,
        v,
    )


def reaches(q: Joints, X: Pose) -> bool:
    """Say whether forward(q) is X to RESIDUAL_MAX."""
    return dist(forward(q), X) <= RESIDUAL_MAX


def spell(righty: bool, above: bool, noflip: bool) -> str:
    """Return the words of three signs."""
    return f"{'RIGHTY' if righty else 'LEFTY'} {'ABOVE' if above else 'BELOW'} {'NOFLIP' if noflip else 'FLIP'}"


def signs(q: Joints) -> tuple[bool, bool, bool]:
    """Return whether q is righty, above and noflip; a tie counts as yes."""
    q23 = q[1] + q[2]
    righty = A2 * cos(q[1]) + A3 * cos(q23) - D4 * sin(q23) >= -TIE
    sin_e = A3 * sin(q[2]) + D4 * cos(q[2])
    return righty, (sin_e <= TIE if righty else sin_e >= -TIE), sin(q[4]) <= TIE


def reach(X: Pose) -> Triangle | None:
    """Solve the triangle shoulder, elbow, wrist centre; None where it can't be closed to RESIDUAL_MAX."""
    px, py, pz = X[3], X[7], X[11]
    r = hypot(px, py)
    if r < D3 - RESIDUAL_MAX:
        return None
    u = sqrt((r - D3) * (r + D3)) if r > D3 else 0.0
    if u < MERGE_SHOULDER:
        u = 0.0
    w = hypot(u, pz)
    if not REACH_MIN - RESIDUAL_MAX <= w <= REACH_MAX + RESIDUAL_MAX:
        return None
    outer, inner = (REACH_MAX - w) * (REACH_MAX + w), (w - REACH_MIN) * (w + REACH_MIN)
    if outer > 0 and inner > 0:
        sin_e = 2 * sqrt(outer * inner) / FOUR_SIDES
        if sin_e >= MERGE_ELBOW:
            return u, sin_e, (inner - outer) / FOUR_SIDES
    return u, 0.0, 1.0 if inner > outer else -1.0


def shortfall(X: Pose) -> str:
    """Say by how much the wrist centre of X is out of reach; empty where it isn't."""
    r = hypot(X[3], X[7])
    if r < D3 - RESIDUAL_MAX:
        return f"the wrist centre is {D3 - r:.6g} m too close to the waist axis, which it clears by {D3} m"
    w = hypot(sqrt(max((r - D3) * (r + D3), 0.0)), X[11])
    if w > REACH_MAX + RESIDUAL_MAX:
        return f"the wrist centre is {w - REACH_MAX:.6g} m beyond the reach of {REACH_MAX:.6g} m"
    if w < REACH_MIN - RESIDUAL_MAX:
        return f"the wrist centre is {REACH_MIN - w:.6g} m too close to the shoulder"
    return ""


def solve(X: Pose, triangle: Triangle, righty: bool, above: bool) -> tuple[Joints, float]:
    """Solve the noflip branch of one shoulder and elbow.

    Args:
        X: A pose with an orthonormal rotation.
        triangle: reach(X).
        righty: Shoulder.
        above: Elbow.

    Returns:
        Joint values in (−π, π] [rad], and |sin q5|; where that is below MERGE_WRIST, q4 is 0.
    """
    nx, ox, ax, px, ny, oy, ay, py, nz, oz, az, pz = X
    u, sin_e, cos_e = triangle
    if not righty:
        u = -u
    if righty == above:
        sin_e = -sin_e
    x, y = px * u - py * D3, py * u + px * D3
    h = hypot(x, y)
    q1, c1, s1 = atan2(y, x), x / h, y / h
    kx, ky = A2 + FOREARM * cos_e, FOREARM * sin_e
    x, y = u * kx + pz * ky, pz * kx - u * ky
    h = hypot(x, y)
    q2, c2, s2 = atan2(y, x), x / h, y / h
    c3, s3 = cos_e * COS_E3 + sin_e * SIN_E3, sin_e * COS_E3 - cos_e * SIN_E3
    c23, s23 = c2 * c3 - s2 * s3, s2 * c3 + c2 * s3
    # The tool's z axis in the forearm's frame. Joint 6 follows from the joint 4 that was taken, so that
    # rounding in q4 near the singular wrist cancels.
    t = c1 * ax + s1 * ay
    zx, zy, zz = c23 * t + s23 * az, c1 * ay - s1 * ax, c23 * az - s23 * t
    sin5 = hypot(zx, zy)
    if sin5 < MERGE_WRIST:
        q6 = atan2(c1 * ny - s1 * nx, c1 * oy - s1 * ox)
        return (q1, q2, atan2(s3, c3), 0.0, 0.0 if zz > 0 else pi, q6), sin5
    c4, s4 = zx / sin5, zy / sin5
    t = s4 * c23
    x, y, z = -t * c1 - c4 * s1, c4 * c1 - t * s1, -s4 * s23
    q6 = atan2(x * nx + y * ny + z * nz, x * ox + y * oy + z * oz)
    return (q1, q2, atan2(s3, c3), atan2(zy, zx), -atan2(sin5, zz), q6), sin5


def flipped(q: Joints) -> Joints:
    """Return the other wrist of the same pose."""
    q1, q2, q3, q4, q5, q6 = q
    return q1, q2, q3, (q4 - pi if q4 > 0 else q4 + pi), -q5, (q6 - pi if q6 > 0 else q6 + pi)


def branches(X: Pose) -> Iterator[Branch]:
    """Yield every branch once, checked forward to RESIDUAL_MAX.

    One check does for both wrists of an arm: they differ by exact half turns.
    """
    triangle = reach(X)
    if triangle is None:
        return
    two_shoulders, two_elbows = triangle[0] > 0, triangle[1] > 0
    for righty in (True, False) if two_shoulders else (True,):
        for above in (True, False) if two_elbows else (True,):
            q, sin5 = solve(X, triangle, righty, above)
            if not reaches(q, X):
                continue
            shoulder, elbow = righty if two_shoulders else None, above if two_elbows else None
            if sin5 < MERGE_WRIST:
                yield Branch(q, shoulder, elbow, None, sin5)
            else:
                yield Branch(q, shoulder, elbow, True, sin5)
                yield Branch(flipped(q), shoulder, elbow, False, sin5)


SLACK: Final = 1e-10
"""How far outside a limit rounding may put a solution [rad]; it is moved onto the limit."""
NEARLY_SINGULAR: Final = 1e-4
"""|sin q5| below which rounding in q4 and q6 is worth compensating between them at a limit."""


def turns(q: float, low: float, high: float) -> Sequence[float]:
    """Return the values q + 2πk [rad] within [low, high], ends included to SLACK."""
    if q - tau < low - SLACK and q + tau > high + SLACK:
        if low <= q <= high:
            return (q,)
        return (min(max(q, low), high),) if low - SLACK <= q <= high + SLACK else ()
    return [min(max(value, low), high) for value in _between(q, low - SLACK, high + SLACK)]


def _between(q: float, low: float, high: float) -> list[float]:
    """Return the values q + 2πk [rad] within [low, high]."""
    return [q + k * tau for k in range(ceil((low - q) / tau), floor((high - q) / tau) + 1)]


def _shared(
    branch: Branch, low: Joints, high: Joints, near: tuple[float, float] | None
) -> Iterator[tuple[float, float]]:
    """Yield q4 and q6 where the wrist is singular: one pair for every turn of the sum that they share.

    Args:
        branch: A branch with |sin q5| ≈ 0.
        low: Lowest joint values [rad].
        high: Highest joint values [rad].
        near: Values of q4 and q6 to be close to; None means q4 = 0.
    """
    q4, q6 = branch.q[3], branch.q[5]
    fold = 1.0 if cos(branch.q[4]) > 0 else -1.0
    shared = q6 + fold * q4
    ends = sorted((fold * low[3], fold * high[3]))
    for total in turns(shared, low[5] + ends[0], high[5] + ends[1]):
        bounds = sorted((fold * (total - low[5]), fold * (total - high[5])))
        least, most = max(bounds[0], low[3]), min(bounds[1], high[3])
        wanted = 0.0 if near is None else (near[0] + fold * (total - near[1])) / 2
        p4 = min(max(wanted, least), most)
        yield min(max(p4, low[3]), high[3]), min(max(total - fold * p4, low[5]), high[5])


def _traded(branch: Branch, low: Joints, high: Joints) -> list[tuple[float, float]]:
    """Return the turns of q4 and q6 near the singular wrist, where one makes up for the other at a limit."""
    q4, q6 = branch.q[3], branch.q[5]
    give = SLACK / branch.sin5
    fold = 1.0 if cos(branch.q[4]) > 0 else -1.0
    found = []
    for a in _between(q4, low[3] - give, high[3] + give):
        moved = min(max(a, low[3]), high[3])
        for b in _between(q6, low[5] - give, high[5] + give):
            p6 = min(max(b + fold * (a - moved), low[5]), high[5])
            p4 = a + fold * (b - p6)
            if abs(p4 - a) <= give and low[3] - SLACK <= p4 <= high[3] + SLACK:
                found.append((min(max(p4, low[3]), high[3]), p6))
    return found


def all_turns(branch: Branch, low: Joints, high: Joints) -> list[Joints]:
    """Return every joint solution of a branch within the limits.

    Where the wrist is singular only those with the smallest possible |q4|.
    """
    q1, q2, q3, q4, q5, q6 = branch.q
    if not (first := turns(q1, low[0], high[0])):
        return []
    if not (second := turns(q2, low[1], high[1])):
        return []
    if not (third := turns(q3, low[2], high[2])):
        return []
    if not (fifth := turns(q5, low[4], high[4])):
        return []
    if branch.sin5 >= NEARLY_SINGULAR:
        fourth, sixth = turns(q4, low[3], high[3]), turns(q6, low[5], high[5])
        return [*product(first, second, third, fourth, fifth, sixth)]
    if branch.sin5 >= MERGE_WRIST:
        pairs = _traded(branch, low, high)
    else:
        pairs = list(_shared(branch, low, high, None))
        least = min((abs(pair[0]) for pair in pairs), default=0.0)
        pairs = [pair for pair in pairs if abs(pair[0]) <= least]
    return [(a, b, c, d, e, f) for a, b, c, e, (d, f) in product(first, second, third, fifth, pairs)]


def nearest_turns(q: Joints, near: Joints, low: Joints, high: Joints) -> Joints | None:
    """Return the turns of q nearest to near, for a wrist that isn't singular; None where a limit forbids all."""
    q1, q2, q3, q4, q5, q6 = q
    a1, a2, a3, a4, a5, a6 = low
    b1, b2, b3, b4, b5, b6 = high
    if a1 <= q1 <= b1 and a2 <= q2 <= b2 and a3 <= q3 <= b3 and a4 <= q4 <= b4 and a5 <= q5 <= b5:
        n1, n2, n3, n4, n5, n6 = near
        if (
            a6 <= q6 <= b6
            and -pi <= q1 - n1 <= pi
            and -pi <= q2 - n2 <= pi
            and -pi <= q3 - n3 <= pi
            and -pi <= q4 - n4 <= pi
            and -pi <= q5 - n5 <= pi
            and -pi <= q6 - n6 <= pi
        ):
            return q
    found = []
    for value, reference, least, most in zip(q, near, low, high, strict=True):
        if least <= value <= most and -pi <= value - reference <= pi:
            found.append(value)
            continue
        turned = value + tau * round((reference - value) / tau)
        if turned < least:
            turned += tau * ceil((least - turned) / tau)
        elif turned > most:
            turned -= tau * ceil((turned - most) / tau)
        if not least <= turned <= most:
            return None
        found.append(turned)
    q1, q2, q3, q4, q5, q6 = found
    return q1, q2, q3, q4, q5, q6


def nearest_joints(branch: Branch, near: Joints, low: Joints, high: Joints) -> Joints | None:
    """Return the joint solution of a branch that is nearest to near within the limits, or None."""
    if branch.sin5 < MERGE_WRIST:
        pairs = list(_shared(branch, low, high, (near[3], near[5])))
        q1, q2, q3, _, q5, _ = branch.q
        arms = [turns(v, low[j], high[j]) for j, v in ((0, q1), (1, q2), (2, q3), (4, q5))]
        candidates = [(a, b, c, d, e, f) for a, b, c, e in product(*arms) for d, f in pairs]
    else:
        candidates = all_turns(branch, low, high)
    return min(candidates, key=lambda q: distance2(q, near), default=None)


def distance2(q: Joints, p: Joints) -> float:
    """Return the sum of squares of the joint differences [rad²]."""
    return sum((a - b) ** 2 for a, b in zip(q, p, strict=True))


def limit_violation(branch: Branch, low: Joints, high: Joints) -> tuple[float, int, float]:
    """Return by how much a branch misses its worst limit [rad], that joint's index, and its value [rad]."""
    worst = (0.0, 0, branch.q[0])
    for j, value in enumerate(branch.q):
        if j == 3 and branch.sin5 < MERGE_WRIST:
            continue
        best = min((max(low[j] - v, v - high[j], 0.0), v) for v in (value + k * tau for k in (0, -1, 1, -2, 2)))
        worst = max(worst, (best[0], j, best[1]))
    return worst
