"""Straight lines of the tool: what planning costs, how long they take beside the best, how straight they are.

Figures for every line that the planner takes, out of random starts and goals in one configuration. The best time
scaling is that of TOPP-RA where the package `toppra` is installed, and of a dense optimum of our own beside it.
`python -m benchmarks.lines [LINES]`; 200 lines by default, the soak takes 10,000.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from benchmarks.kinematics import sample
from robots import puma560
from vrs import Profile
from vrs.errors import PlanningError
from vrs.model import Array
from vrs.planning.along import TOLERANCE
from vrs.planning.certificate import violation
from vrs.planning.line import line
from vrs.planning.path import Course, rotation_vector, rotations
from vrs.planning.plan import Plan
from vrs.segment import State, evaluate

MODEL = puma560.model()
LIMITS = MODEL.limits
STILL = np.zeros(6)
DENSE = 1000
"""Intervals of the dense optimum."""


class Line(NamedTuple):
    """A line that was planned."""

    q: Array
    X: Array
    plan: Plan
    course: Course


def lines(seed: int, profile: Profile, distance: float | None = None) -> Iterator[Line]:
    """Yield lines between random poses, or of one length [m] and a turn of some 40 degrees."""
    rng = np.random.default_rng(seed)
    while True:
        q, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (2, 6))
        X0, X = MODEL.forward(q), MODEL.forward(goal)
        if distance is not None:
            way = rng.normal(size=3)
            X = X0.copy()
            X[:3, 3] += distance * way / np.linalg.norm(way)
            X[:3, :3] = rotations(rng.normal(0.0, 0.4, (1, 3)))[0] @ X[:3, :3]
        elif MODEL.configuration(q) != MODEL.configuration(goal):
            continue
        try:
            plan, _ = line(State(q, STILL, STILL), X, 1.0, profile, MODEL, LIMITS)
        except PlanningError:
            continue
        y = np.concatenate([X0[:3, 3], rotation_vector(X0[:3, :3] @ X[:3, :3].T)])
        yield Line(q, X, plan, Course(y, y, X))


class Error(NamedTuple):
    """What a line is off by."""

    way: float
    """From the line [m]."""
    turn: float
    """From the orientation that belongs to the way travelled [rad]."""
    joints: float
    """From the inverse kinematics of the line [rad]."""


def error(move: Line, per_piece: int = 40) -> Error:
    """How far the tool is off the line, and off an even turn."""
    course = move.course
    q = np.concatenate(
        [
            evaluate(a, np.linspace(0.0, h, per_piece), 0)
            for a, h in zip(move.plan.coefficients, move.plan.durations, strict=True)
        ]
    )
    X = MODEL.forward(q)
    along, start = course.along[:3], course.start[:3]
    x = (X[:, :3, 3] - start) @ along / (along @ along)
    off = X[:, :3, 3] - (start + x[:, None] * along)
    ideal = course.poses(np.clip(x, 0.0, 1.0))
    # The sines of the angles between the two, which are small.
    between = X[:, :3, :3] @ ideal[:, :3, :3].swapaxes(1, 2)
    turn = 0.5 * np.abs(between - between.swapaxes(1, 2)).max()
    joints = np.abs(MODEL.follow(ideal, move.q) - q).max()
    return Error(float(np.sqrt((off**2).sum(1)).max()), float(turn), float(joints))


def samples(move: Line, intervals: int) -> tuple[Array, Array, Array, Array, Array]:
    """x, q, q', q'' and the largest speed of x that the speeds allow, on a line: from the inverse kinematics."""
    x = np.linspace(0.0, 1.0, intervals + 1)
    q = MODEL.follow(move.course.poses(x), move.q)
    J = MODEL.jacobian(q)
    ways = np.broadcast_to(move.course.along[:, None], (len(x), 6, 1))
    first = np.asarray(np.linalg.solve(J, ways)[:, :, 0], dtype=np.float64)
    second = np.gradient(first, x, axis=0, edge_order=2)
    cap = np.minimum(
        (LIMITS.qd_max / np.maximum(np.abs(first), 1e-12)).min(1),
        min(
            MODEL.tool_speed / max(move.course.length, 1e-12),
            MODEL.tool_turn_speed / max(move.course.angle, 1e-12),
        ),
    )
    return x, q, first, second, cap


def dense_optimum(move: Line) -> float:
    """Least duration by controllable sets on a dense grid, each a small linear programme [s].

    Source: Pham, Pham, "A new approach to time-optimal path parameterization based on reachability analysis",
    IEEE T-RO 34(3), 2018, with constraints collocated at the grid points.
    """
    x, _, first, second, cap = samples(move, DENSE)
    step = x[1] - x[0]
    A, B, top = first / LIMITS.qdd_max, second / LIMITS.qdd_max, cap**2
    most = np.zeros(len(x))
    for i in range(len(x) - 2, -1, -1):
        most[i] = _highest(A[i], B[i], top[i], most[i + 1], step)
    speed2 = np.zeros(len(x))
    for i in range(len(x) - 1):
        bound = np.inf
        for a, b in zip(A[i], B[i], strict=True):
            if abs(a) > 1e-12:
                bound = min(bound, (np.sign(a) - b * speed2[i]) / a)
        speed2[i + 1] = min(max(speed2[i] + 2.0 * step * bound, 0.0), most[i + 1])
    root = np.sqrt(speed2)
    return float((2.0 * step / (root[1:] + root[:-1])).sum())


def _highest(a: Array, b: Array, top: float, after: float, step: float) -> float:
    """The largest z <= top with some u: |a u + b z| <= 1 and 0 <= z + 2 step u <= after."""
    low, high = 0.0, top

    def possible(z: float) -> bool:
        least, most = -z / (2.0 * step), (after - z) / (2.0 * step)
        for one, two in zip(a, b, strict=True):
            if abs(one) > 1e-12:
                ends = sorted(((-1.0 - two * z) / one, (1.0 - two * z) / one))
                least, most = max(least, ends[0]), min(most, ends[1])
            elif abs(two * z) > 1.0:
                return False
        return bool(least <= most)

    if possible(high):
        return high
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if possible(middle) else (low, middle)
    return low


def topp_ra(move: Line) -> float | None:
    """Duration of the best time scaling that TOPP-RA finds on the same path [s]; None where it fails."""
    import toppra
    from toppra import algorithm, constraint

    x, q, _, _, _ = samples(move, 400)
    cap = min(MODEL.tool_speed / move.course.length, MODEL.tool_turn_speed / max(move.course.angle, 1e-12))
    # The share of the way is one more joint: its speed is the tool's.
    path = toppra.SplineInterpolator(x, np.column_stack([q, x]))
    speeds = np.append(LIMITS.qd_max, cap)
    growths = np.append(LIMITS.qdd_max, 1e6)
    limits = [
        constraint.JointVelocityConstraint(np.column_stack([-speeds, speeds])),
        constraint.JointAccelerationConstraint(np.column_stack([-growths, growths])),
    ]
    limits[1].set_discretization_type(1)
    solver = algorithm.TOPPRA(limits, path, gridpoints=np.linspace(0.0, 1.0, 801), solver_wrapper="seidel")
    trajectory = solver.compute_trajectory(0.0, 0.0)
    return None if trajectory is None else float(trajectory.duration)


def cost(profile: Profile) -> tuple[float, float]:
    """Median and 99th percentile of planning a line of 0.5 m [ms]."""
    source = lines(1, profile, 0.5)
    moves = [next(source) for _ in range(40)]
    median, worst = sample(
        lambda i: line(State(moves[i % 40].q, STILL, STILL), moves[i % 40].X, 1.0, profile, MODEL, LIMITS), 400
    )
    return median / 1e3, worst / 1e3


def accuracy(count: int, profile: Profile) -> None:
    """Print how straight and even lines are, and that their certificates hold."""
    source = lines(2, profile)
    start = time.perf_counter()
    errors, pieces, passed = [], [], 0
    for _ in range(count):
        move = next(source)
        errors.append(error(move))
        pieces.append(len(move.plan))
        passed += violation(move.plan, LIMITS, jerk=profile is Profile.JERK_LIMITED) is not None
    worst, joints = np.max(errors, axis=0), np.array(errors)[:, 2]
    print(
        f"{profile}, {count} lines: off the line {worst[0]:.1e} m, off an even turn {worst[1]:.1e} rad, off the "
        f"inverse kinematics {worst[2]:.1e} rad (fitted to {TOLERANCE:g}), more than 1e-9 rad in "
        f"{np.count_nonzero(joints > 1e-9)}; pieces median {np.median(pieces):.0f}, "
        f"largest {max(pieces)}; limits passed by {passed}; {time.perf_counter() - start:.0f} s"
    )


def durations(count: int) -> None:
    """Print planned durations over the best ones."""
    ours, dense, peers = [], [], []
    source = lines(3, Profile.PARABOLIC)
    known = importlib.util.find_spec("toppra") is not None
    jerky = []
    for _ in range(count):
        move = next(source)
        ours.append(move.plan.duration)
        dense.append(dense_optimum(move))
        if known:
            peers.append(topp_ra(move) or np.nan)
        smooth, _ = line(State(move.q, STILL, STILL), move.X, 1.0, Profile.JERK_LIMITED, MODEL, LIMITS)
        jerky.append(smooth.duration)
    _report("parabolic over the dense optimum", np.divide(ours, dense))
    if known:
        _report("parabolic over TOPP-RA", np.divide(ours, peers))
    else:
        print("toppra isn't installed: no comparison with it")
    _report("jerk-limited over the parabolic optimum", np.divide(jerky, dense))


def _report(what: str, ratios: Array) -> None:
    good = ratios[np.isfinite(ratios)]
    print(
        f"duration, {what}: median {np.median(good):.4f}, 99 % {np.percentile(good, 99):.4f}, worst "
        f"{good.max():.4f}, of {len(good)} lines ({len(ratios) - len(good)} not solved)"
    )


def main(count: int = 200) -> None:
    for profile in Profile:
        median, worst = cost(profile)
        print(f"{profile}: planning and certifying a line of 0.5 m: median {median:.2f} ms, p99 {worst:.2f} ms")
    durations(min(count, 200))
    for profile in Profile:
        accuracy(count, profile)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
