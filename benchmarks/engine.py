"""What a command and a sample cost, beside SciPy's PPoly on the same polynomials in the same run."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np
from scipy.interpolate import PPoly

from robots import puma560
from vrs import Engine, Insertion, JointTarget, MotionCommand, Profile, Timeline


def timed(action: Callable[[], object]) -> float:
    """Seconds that an action takes [s]."""
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def report(name: str, seconds: list[float]) -> None:
    ordered = sorted(seconds)
    p99 = ordered[int(0.99 * (len(ordered) - 1))]
    print(f"{name:38s} median {1e6 * statistics.median(seconds):9.1f} µs   p99 {1e6 * p99:9.1f} µs")


def commands(profile: Profile, insertion: Insertion) -> list[float]:
    model = puma560.model()
    rng = np.random.default_rng(0)
    engine = Engine(model)
    costs = []
    for k in range(400):
        if k % 20 == 0:
            engine = Engine(model)
        q = rng.uniform(model.limits.q_min, model.limits.q_max)
        t = engine.timeline.end * rng.uniform(0.2, 0.9)
        command = MotionCommand(JointTarget(q), execute_at=t, profile=profile, insertion=insertion)
        costs.append(timed(lambda command=command, engine=engine: engine.execute(command)))
    return costs


def long_timeline(moves: int) -> Timeline:
    model = puma560.model()
    rng = np.random.default_rng(1)
    engine = Engine(model)
    for _ in range(moves):
        q = rng.uniform(model.limits.q_min, model.limits.q_max)
        engine.execute(MotionCommand(JointTarget(q), insertion=Insertion.APPEND))
    return engine.timeline


def main() -> None:
    """Print the figures."""
    for profile in Profile:
        for insertion in Insertion:
            report(f"execute, {profile}, {insertion}", commands(profile, insertion))
    timeline = long_timeline(3000)
    segments = timeline.segments
    a = np.zeros((3, len(segments), 6))
    for i, segment in enumerate(segments):
        a[3 - len(segment.coefficients) :, i] = segment.coefficients[::-1]
    knots = np.append([segment.start for segment in segments], timeline.end)
    peer = PPoly(a, knots)
    times = np.random.default_rng(2).uniform(0, timeline.end, 2000)
    print(f"{len(segments)} segments")
    report("sample at random times", [timed(lambda t=t: timeline.sample(t)) for t in times])
    report("PPoly at random times", [timed(lambda t=t: peer(t)) for t in times])
    many = np.sort(np.random.default_rng(3).uniform(0, timeline.end, 10000))
    report("sample at 10,000 times", [timed(lambda: timeline.sample(many)) for _ in range(9)])
    report("PPoly at 10,000 times", [timed(lambda: peer(many)) for _ in range(9)])


if __name__ == "__main__":
    main()
