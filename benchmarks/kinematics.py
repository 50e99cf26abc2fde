"""PUMA 560 kinematics beside the Robotics Toolbox and Pinocchio, all checked against each other first."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from benchmarks import peers
from benchmarks.results import Chart, Part, Result
from benchmarks.timing import Call, Series, alternate, beside
from robots import puma560
from robots.puma560.parameters import PEDESTAL

OURS, TOOLBOX, TOOLBOX_C, PINOCCHIO = "vrs", "Toolbox", "Toolbox, compiled ETS", "Pinocchio"
AGREEMENT = 1e-12
POSES = 2000


def sample(function: Callable[[int], object], runs: int) -> tuple[float, float]:
    """Median and 99th percentile [µs] of function(i) for i in range(runs)."""
    times = np.empty(runs)
    for i in range(runs):
        start = time.perf_counter()
        function(i)
        times[i] = time.perf_counter() - start
    median, worst = np.percentile(times * 1e6, (50, 99))
    return float(median), float(worst)


def part() -> Part:
    """Measure."""
    model, toolbox, pinocchio = puma560.model(), peers.toolbox(), peers.pinocchio()
    compiled = toolbox.ets()
    q = np.random.default_rng(0).uniform(model.limits.q_min, model.limits.q_max, (POSES, 6))
    X = model.forward(q)
    pedestal = np.zeros((4, 4))
    pedestal[2, 3] = PEDESTAL
    lifted = X + pedestal
    words = [model.configuration(row) for row in q]

    forward: dict[str, Call] = {
        OURS: model.forward,
        TOOLBOX: lambda row: toolbox.fkine(row).A,
        TOOLBOX_C: compiled.eval,
    }
    jacobian: dict[str, Call] = {OURS: model.jacobian, TOOLBOX: toolbox.jacob0, TOOLBOX_C: compiled.jacob0}
    if pinocchio is not None:
        forward[PINOCCHIO], jacobian[PINOCCHIO] = pinocchio.forward, pinocchio.jacobian
    for rivals, lift in ((forward, pedestal), (jacobian, np.zeros((6, 6)))):
        for name, call in rivals.items():
            up = lift if name.startswith(TOOLBOX) else 0.0
            off = max(np.abs(np.asarray(call(row)) - up - rivals[OURS](row)).max() for row in q[:200])
            assert off <= AGREEMENT, f"{name} is off by {off}"

    rows = list(q)
    series: dict[str, dict[str, Series]] = {
        "forward": alternate(forward, rows, calls=100, blocks=30),
        "jacobian": alternate(jacobian, rows, calls=100, blocks=20),
        "inverse, one branch": alternate(
            {
                OURS: lambda i: model.inverse_near(X[i], q[i], words[i]),
                TOOLBOX: lambda i: toolbox.ikine_a(lifted[i]),
            },
            range(POSES),
            calls=50,
            blocks=20,
        ),
        "inverse, every branch and turn": alternate({OURS: model.inverse}, list(X), calls=100, blocks=20),
        "poses of all links": alternate({OURS: model.links}, rows, calls=100, blocks=20),
    }
    results: list[Result] = []
    for name, found in series.items():
        asked: dict[str, float | None] = {TOOLBOX: None}
        if name in {"forward", "jacobian"}:
            asked |= {TOOLBOX_C: None, PINOCCHIO: None}
        results += (
            beside(name, OURS, found, asked)
            if len(found) > 1 or len(asked) > 1
            else [Result(name, found[OURS].cost)]
        )
    results += _batches(model, toolbox, compiled, pinocchio, q, X, lifted)
    return Part(
        "Kinematics of the PUMA 560",
        f"One pose a call, {POSES:,} random ones, and all of them at once, a pose. Forward kinematics and "
        f"Jacobians of the peers agree with ours to {AGREEMENT:g}, checked before timing. Pinocchio's model is "
        "made from the same Denavit-Hartenberg parameters; it has no inverse kinematics, nor calls for many poses. "
        "The Toolbox's compiled path is its elementary transform sequence. Ours checks its arguments, the peers "
        "don't.",
        tuple(results),
        (_chart(series),),
    )


def _batches(
    model: puma560.Puma560,
    toolbox: object,
    compiled: object,
    pinocchio: peers.Pinocchio | None,
    q: np.ndarray,
    X: np.ndarray,
    lifted: np.ndarray,
) -> list[Result]:
    """Many poses at once, microseconds a pose."""
    few = 50
    batches: dict[str, dict[str, tuple[Call, int]]] = {
        "forward": {OURS: (lambda _: model.forward(q), POSES), TOOLBOX_C: (lambda _: compiled.eval(q), POSES)},  # type: ignore[attr-defined]
        "jacobian": {OURS: (lambda _: model.jacobian(q), POSES)},
        "inverse, all eight branches": {
            OURS: (lambda _: puma560.inverse_batch(X), POSES),
            TOOLBOX: (lambda _: toolbox.ikine_a(lifted[:few]), few),  # type: ignore[attr-defined]
        },
    }
    if pinocchio is not None:
        one = pinocchio.forward
        batches["forward"][PINOCCHIO] = (lambda _: [one(row) for row in q], POSES)
    peer_of = {"forward": (TOOLBOX_C, PINOCCHIO), "jacobian": (), "inverse, all eight branches": (TOOLBOX,)}
    found = []
    for name, rivals in batches.items():
        timed = alternate({rival: call for rival, (call, _) in rivals.items()}, range(16), calls=1, blocks=16)
        apiece = {
            rival: Series(each.blocks / rivals[rival][1], each.calls / rivals[rival][1])
            for rival, each in timed.items()
        }
        title = f"{name}, {POSES:,} at once, a pose"
        note = "the Toolbox: one branch, 50 at once" if name.startswith("inverse") else ""
        if peer_of[name]:
            found += beside(title, OURS, apiece, dict.fromkeys(peer_of[name]), note=note)
        else:
            found.append(Result(title, apiece[OURS].cost))
    return found


def _chart(series: dict[str, dict[str, Series]]) -> Chart:
    rows = tuple(name for name, found in series.items() if len(found) > 1)
    points: dict[str, list[tuple[float, float]]] = {}
    for place, name in enumerate(rows):
        for rival, found in series[name].items():
            points.setdefault(rival, []).append((found.cost.median, place))
    return Chart("kinematics", "Kinematics, one pose a call", "dots", "median cost [µs]", series=points, rows=rows)
