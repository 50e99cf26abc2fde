"""Inverse kinematics of described arms: how many of random reachable poses are found, how exactly, what it costs.

Each is asked for from the arm's nominal pose, which is far from most, and from joints nearby, as dragging does.
`python -m benchmarks.inverse [POSES]`; 10,000 a robot by default.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from robots.description.arm import DescribedArm
from tests.robots.description.described import arm
from vrs.errors import UnreachablePoseError
from vrs.model import Array

ARMS = ("panda", "iiwa", "rail", "xarm6", "puma", "al5d", "five", "scara")
NEARBY = 0.05
"""How far joints nearby are off [rad], as a share of the range at most."""
_HEAD = "| {:<8} | {:>6} | {:<6} | {:>8} | {:>11} | {:>8} | {:>8} | {:>10} |"
_ROW = "| {:<8} | {:>6} | {:<6} | {:>6.2f} % | {:>8.0f} µs | {:>5.0f} µs | {:>5.1f} ms | {:>7.0e} m |"


def measured(model: DescribedArm, q: Array, starts: Array) -> tuple[float, Array, float]:
    """Share of poses that are found, what each took [µs], and the largest residual [m, rad].

    Raises:
        AssertionError: If a solution passes a limit.
    """
    X, costs, worst, found = model.forward(q), np.empty(len(q)), 0.0, 0
    model.inverse_near(X[0], q[0])
    for k, (pose, start) in enumerate(zip(X, starts, strict=True)):
        begin = time.thread_time_ns()
        try:
            there = model.inverse_near(pose, start)
        except UnreachablePoseError:
            there = None
        costs[k] = (time.thread_time_ns() - begin) / 1e3
        if there is not None:
            assert (there >= model.limits.q_min).all()
            assert (there <= model.limits.q_max).all()
            worst = max(worst, float(np.abs(model.forward(there) - pose).max()))
            found += 1
    return found / len(q), costs, worst


def main(poses: int = 10_000) -> None:
    """Print a table."""
    print(_HEAD.format("robot", "joints", "from", "found", "median", "p99", "worst", "residual"))
    for name in ARMS:
        model = arm(name)
        low, high = model.limits.q_min, model.limits.q_max
        rng = np.random.default_rng(0)
        q = rng.uniform(low, high, (poses, len(low)))
        step = NEARBY * np.minimum(high - low, 1.0) * rng.uniform(-1, 1, q.shape)
        for where, starts in (
            ("afar", np.broadcast_to(model.poses["nominal"], q.shape)),
            ("nearby", np.clip(q + step, low, high)),
        ):
            share, costs, worst = measured(model, q, starts)
            median, p99 = np.percentile(costs, (50, 99))
            print(
                _ROW.format(name, len(low), where, 100 * share, median, p99, costs.max() / 1e3, worst), flush=True
            )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
