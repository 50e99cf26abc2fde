"""PUMA 560 kinematics beside the Robotics Toolbox: microseconds, median and 99th percentile."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from robots import puma560


def sample(function: Callable[[int], object], runs: int) -> tuple[float, float]:
    """Median and 99th percentile [µs] of function(i) for i in range(runs)."""
    times = np.empty(runs)
    for i in range(runs):
        start = time.perf_counter()
        function(i)
        times[i] = time.perf_counter() - start
    median, worst = np.percentile(times * 1e6, (50, 99))
    return float(median), float(worst)


def main() -> None:
    import roboticstoolbox

    toolbox = roboticstoolbox.models.DH.Puma560()
    model = puma560.model()
    q = np.random.default_rng(0).uniform(model.limits.q_min, model.limits.q_max, (2000, 6))
    X = model.forward(q)
    words = [model.configuration(row) for row in q]
    k = len(q)
    rows = {
        "inverse_near, asked branch": sample(lambda i: model.inverse_near(X[i], q[i], words[i]), k),
        "inverse_near, own branch": sample(lambda i: model.inverse_near(X[i], q[i]), k),
        "inverse, every branch and turn": sample(lambda i: model.inverse(X[i]), k),
        "forward, one": sample(lambda i: model.forward(q[i]), k),
        "links, one": sample(lambda i: model.links(q[i]), k),
        "jacobian, one": sample(lambda i: model.jacobian(q[i]), k),
        "Toolbox ikine_a, one branch": sample(lambda i: toolbox.ikine_a(X[i]), 200),
    }
    for name, function in (("forward", model.forward), ("jacobian", model.jacobian)):
        median, worst = sample(lambda _, call=function: call(q), 20)  # type: ignore[misc]
        rows[f"{name}, a pose of {k}"] = median / k, worst / k
    median, worst = sample(lambda _: puma560.inverse_batch(X), 20)
    rows[f"inverse_batch, a pose of {k}"] = median / k, worst / k
    median, worst = sample(lambda _: toolbox.ikine_a(X[:50]), 10)
    rows["Toolbox ikine_a, a pose of 50"] = median / 50, worst / 50
    print(f"{'PUMA 560 kinematics':34}{'median µs':>12}{'p99 µs':>12}")
    for name, (median, worst) in rows.items():
        print(f"{name:34}{median:12.2f}{worst:12.2f}")
    ratio = rows["Toolbox ikine_a, a pose of 50"][0] / rows[f"inverse_batch, a pose of {k}"][0]
    print(f"inverse_batch is {ratio:.0f} times faster a pose than ikine_a, for eight branches against one")


if __name__ == "__main__":
    main()
