"""What plans and certificates cost, and how long the plans last beside Ruckig's time-optimal ones."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import ruckig

from robots import puma560
from vrs import Profile
from vrs.planning import Plan, move, run_up, violation
from vrs.planning.plan import end_state
from vrs.segment import State

LIMITS = puma560.model().limits
ZERO = np.zeros(6)
SAMPLES = int(os.environ.get("VRS_PLANS", "1000"))
REPEATS = 3


def timed(action: Callable[[], object]) -> float:
    """Least seconds of a few runs: other processes' time isn't ours."""
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        action()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def report(name: str, seconds: list[float]) -> None:
    median, p99 = 1e6 * statistics.median(seconds), 1e6 * float(np.percentile(seconds, 99))
    print(f"{name:44s} median {median:7.1f} µs   p99 {p99:7.1f} µs   worst {1e6 * max(seconds):7.1f} µs")


def moving(rng: np.random.Generator, profile: Profile, speed: float) -> State:
    """A state somewhere in a random move."""
    start, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (2, 6))
    plan, _ = move(State(start, ZERO, ZERO), goal, speed, profile, LIMITS)
    t = rng.random() * plan.duration
    i = 0
    while t > plan.durations[i]:
        t -= plan.durations[i]
        i += 1
    return end_state(Plan(np.array([t]), plan.coefficients[i : i + 1]))


def optimum(state: State, q: np.ndarray, profile: Profile) -> float:
    """Ruckig's least duration [s], without position limits; infinite where it has none."""
    problem, trajectory = ruckig.InputParameter(6), ruckig.Trajectory(6)
    problem.current_position, problem.current_velocity = state.q.tolist(), state.qd.tolist()
    problem.target_position = q.tolist()
    problem.max_velocity, problem.max_acceleration = LIMITS.qd_max.tolist(), LIMITS.qdd_max.tolist()
    if profile is Profile.JERK_LIMITED:
        problem.current_acceleration, problem.max_jerk = state.qdd.tolist(), LIMITS.qddd_max.tolist()
    else:
        problem.max_jerk = [np.inf] * 6
    result = ruckig.Ruckig(6).calculate(problem, trajectory)
    return trajectory.duration if result == ruckig.Result.Working else np.inf


def redirections(profile: Profile, drawn: bool) -> None:
    """Redirections of a moving arm, and the joining move to a tail at rest."""
    rng = np.random.default_rng(0)
    costs: dict[str, list[float]] = {"move": [], "run_up": [], "both": [], "from rest": []}
    ratios, segments, ends = [], [], []
    notes = 0
    for _ in range(SAMPLES):
        speed = float(rng.uniform(0.05, 1.0)) if drawn else 1.0
        state = moving(rng, profile, 1.0)
        q, tail = rng.uniform(LIMITS.q_min, LIMITS.q_max, (2, 6))
        how = (speed, profile, LIMITS)
        first = timed(partial(move, state, q, *how))
        second = timed(partial(run_up, q, State(tail, ZERO, ZERO), *how))
        costs["move"].append(first)
        costs["run_up"].append(second)
        costs["both"].append(first + second)
        costs["from rest"].append(timed(partial(move, State(state.q, ZERO, ZERO), q, *how)))
        plan, note = move(state, q, speed, profile, LIMITS)
        end = end_state(plan)
        ends.append(max(np.abs(end.q - q).max(), np.abs(end.qd).max()))
        segments.append(len(plan))
        notes += bool(note)
        if not note:
            ratios.append(plan.duration / optimum(state, q, profile))
    print(f"-- {profile}, {SAMPLES} redirections, speed {'0.05 to 1' if drawn else '1'}")
    for name, seconds in costs.items():
        report(name, seconds)
    print(
        f"segments: median {statistics.median(segments):.0f}; braked first: {notes}; "
        f"largest error at the end: {max(ends):.1e}"
    )
    if not drawn:
        median, high, worst = np.percentile(ratios, [50, 99, 100])
        print(f"duration / Ruckig's least: median {median:.5f}   99 % {high:.4f}   worst {worst:.3f}")


def certificates() -> None:
    rng = np.random.default_rng(1)
    for pieces, degree in ((3, 2), (27, 3), (20, 9), (20, 16)):
        plan = Plan(np.full(pieces, 0.1), rng.normal(size=(pieces, degree + 1, 6)) * 0.02)
        costs = [timed(partial(violation, plan, LIMITS, jerk=True)) for _ in range(200)]
        report(f"certificate, {pieces} pieces of degree {degree}", costs)


def main() -> None:
    """Print the figures."""
    for profile in Profile:
        for drawn in (False, True):
            redirections(profile, drawn)
    certificates()


if __name__ == "__main__":
    main()
