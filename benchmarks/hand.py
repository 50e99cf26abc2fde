"""Steering at 50 Hz: what an input costs, and what an hour leaves behind."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks import moves
from benchmarks.moves import LIMITS, MODEL
from benchmarks.results import Cost, Part, Result
from benchmarks.timing import Stopwatch
from vrs import Engine, ManualClock, Status, SteerCommand, Timeline

PERIOD = 0.02
"""Between inputs [s]."""
MINUTES = 1.0
TRACED_MINUTES = 0.5
LONG = 500_000
"""Segments of the plan that a long session has behind it."""

Hand = Callable[[int], SteerCommand]


def part() -> Part:
    """Measure."""
    hands: dict[str, Hand] = {"joint rates": _rates(9), "tool twist": _twist(10)}
    results: list[Result] = []
    for name, hand in hands.items():
        engine, clock = _session(None)
        watch, rejected = _steer(engine, clock, hand, MINUTES)
        made = len(engine.timeline) / MINUTES * 60
        worn, late = _session(moves.repeated(LONG, moves.cycle()))
        beside, _ = _steer(worn, late, hand, 0.25)
        del worn
        short = watch.cost
        results += [
            Result(
                f"an input, {name}",
                short,
                note=watch.in_wall_time + (f"; {rejected} of {len(watch.wall)} rejected" if rejected else ""),
            ),
            Result(
                f"an input, {name}, {LONG:,} segments in the past",
                beside.cost,
                peer="vrs, nothing in the past",
                theirs=short,
                ratio=short.median / beside.cost.median,
            ),
            Result(f"segments an hour, {name}", Cost(made), unit=""),
        ]
        gc.collect()
        tracemalloc.start()
        engine, clock = _session(None)
        _steer(engine, clock, hand, TRACED_MINUTES)
        gc.collect()
        size = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        results.append(
            Result(
                f"memory an hour, {name}",
                Cost(size / TRACED_MINUTES * 60 / 1e6),
                unit="MB",
                note=f"{size / len(engine.timeline):.0f} B a segment, receipts included; "
                f"{size / TRACED_MINUTES * 60 * 24 / 1e9:.2f} GB a day",
            )
        )
    return Part(
        "Steering",
        f"`engine.execute(SteerCommand(...))` every {1000 * PERIOD:g} ms for {60 * MINUTES:g} s of a manual "
        "clock, a hand that changes its mind about twice a second and lets go now and then, limits and "
        "singularities met as they come. Every input makes a certified plan that ends at rest by itself.",
        tuple(results),
    )


def _session(timeline: Timeline | None) -> tuple[Engine, ManualClock]:
    clock = ManualClock(0.0 if timeline is None else timeline.end)
    if timeline is None:
        return Engine(MODEL, clock=clock), clock
    return Engine(MODEL, timeline=timeline, clock=clock), clock


def _steer(engine: Engine, clock: ManualClock, hand: Hand, minutes: float) -> tuple[Stopwatch, int]:
    """Costs of the inputs, and how many were rejected."""
    watch = Stopwatch.new()
    rejected = 0
    for k in range(round(minutes * 60 / PERIOD)):
        command = hand(k)
        receipt = watch.time(partial(engine.execute, command))
        rejected += receipt.status is Status.REJECTED
        clock.advance(PERIOD)
    return watch, rejected


def _wishes(seed: int, size: np.ndarray) -> Callable[[int], np.ndarray]:
    """What a hand wants at each input: a smooth change towards something new every half a second."""
    rng = np.random.default_rng(seed)
    goals: list[np.ndarray] = [np.zeros(len(size))]

    def wish(k: int) -> np.ndarray:
        at = k * PERIOD / 0.5
        while len(goals) < at + 2:
            goals.append(rng.uniform(-size, size) * (rng.random() > 0.2))
        share = at % 1.0
        return goals[int(at)] * (1 - share) + goals[int(at) + 1] * share

    return wish


def _rates(seed: int) -> Hand:
    wish = _wishes(seed, 0.6 * LIMITS.qd_max)
    return lambda k: SteerCommand(rates=wish(k))


def _twist(seed: int) -> Hand:
    wish = _wishes(seed, np.repeat((0.25, 0.6), 3))
    return lambda k: SteerCommand(twist=wish(k))
