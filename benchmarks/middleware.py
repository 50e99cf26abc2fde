"""What the network middleware costs a control step, its training, and a whole run."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from benchmarks.timing import seconds
from interfaces.lab.tipsuwan.gain import behind_a_network
from interfaces.lab.tipsuwan.run import START, NetworkControl, NetworkRunSetting, agent, network_of, run, s_path
from interfaces.middleware import GainScheduler, default_network, optimal_way, train
from robots.onboard.curve_trackers import QuadraticCurveTracker
from robots.onboard.driving import Drive, Posture

if TYPE_CHECKING:
    from benchmarks.results import Part

BLOCKS = 200
CALLS = 100
"""In a block."""
DRIVES = [Drive(2.0, 4.0 * math.sin(k)) for k in range(CALLS)]


def costs(action: Callable[[Drive], object]) -> list[float]:
    """Processor time of a call [µs], sorted, a figure a block."""
    found = []
    for _ in range(BLOCKS):
        start = time.process_time()
        for drive in DRIVES:
            action(drive)
        found.append(1e6 * (time.process_time() - start) / CALLS)
    return sorted(found)


def median_seconds(action: Callable[[], object], rounds: int = 3) -> float:
    """Median processor time of an action [s]."""
    return statistics.median(seconds(action) for _ in range(rounds))


def part() -> Part:
    """Measure."""
    from benchmarks.results import Bar, Cost, Part, Result

    network, curve, setting = default_network(), s_path(0), NetworkRunSetting()
    by_network, by_root = GainScheduler(0.25, network), GainScheduler(0.25)
    driving, posture = Drive(1.0, 0.5), Posture(*START)
    wanted = [driving]
    whole = behind_a_network(lambda _: wanted[0], network)
    tracker = QuadraticCurveTracker(curve)

    def step(drive: Drive) -> None:
        wanted[0] = drive
        whole.drive(posture, driving)

    def row(what: str, action: Callable[[Drive], object], asked: float | None = None) -> Result:
        found = costs(action)
        return Result(what, Cost(statistics.median(found), found[round(0.99 * BLOCKS) - 1]), bar=Bar(median=asked))

    def whole_run(control: NetworkControl) -> Result:
        taken = median_seconds(lambda: run(curve, agent(control, curve, setting), network_of(0), setting=setting))
        return Result(f"a run of 15 s by {control.value}, kinematic robot", Cost(1e6 * taken))

    return Part(
        "The network middleware",
        f"Processor time on one core; single steps in blocks of {CALLS}, medians over {BLOCKS} of them.",
        (
            row("a control step: prediction and scheduling by the network", step, 50.0),
            row("scheduling alone, by the network", lambda drive: by_network.schedule(drive, 0.21)),
            row("scheduling alone, by the exact root", lambda drive: by_root.schedule(drive, 0.21)),
            row("the exact root alone", lambda drive: optimal_way(drive.w, 0.25)),
            row("the quadratic-curve tracker, for comparison", lambda _: tracker.control(posture)),
            Result("training the network", Cost(1e6 * median_seconds(lambda: train(seed=1), 1))),
            *(
                whole_run(control)
                for control in (NetworkControl.DIRECT, NetworkControl.NETWORK, NetworkControl.PREDICTIVE)
            ),
        ),
    )
