"""Steering at 50 Hz: what an input costs, and what hours of it leave behind.

`python -m benchmarks.hand HOURS [rates | twist | resting]` steers for so many hours of a manual clock and prints
what grows; the resting hand moves one minute in twenty.
"""

from __future__ import annotations

import gc
import sys
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from resource import getpagesize
from typing import NamedTuple

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
ENDURANCE = 0.3
"""Hours of steering whose memory is looked at."""
LOOKS = 12
"""How often."""
REWOUND = 5000
"""Times in the past that are sampled again, at most."""
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
                f"memory a segment, {name}, before it's put away",
                Cost(size / len(engine.timeline)),
                unit="B",
                note=f"receipts included; {size / TRACED_MINUTES * 60 / 1e6:.0f} MB an hour if all of it stayed",
            )
        )
    results += _in_the_long_run(_endure(_rates(9), ENDURANCE))
    return Part(
        "Steering",
        f"`engine.execute(SteerCommand(...))` every {1000 * PERIOD:g} ms for {60 * MINUTES:g} s of a manual "
        "clock, a hand that changes its mind about twice a second and lets go now and then, limits and "
        "singularities met as they come. Every input makes a certified plan that ends at rest by itself. Then "
        f"{60 * ENDURANCE:g} minutes with joint rates: what the process takes in memory and in a file; and times "
        "of the past again, in random order, beside what they were live. `python -m benchmarks.hand HOURS` goes on "
        "for longer.",
        tuple(results),
    )


class _Look(NamedTuple):
    """What there is after some steering, and what inputs cost since the look before."""

    hours: float
    segments: int
    resident: float
    """Memory of the process [MB]."""
    file: float
    """What was put away [MB]."""
    cost: Cost
    """Of an input [µs]."""


class _Endurance(NamedTuple):
    """What a long session leaves behind."""

    looks: list[_Look]
    commands: int
    rewound: Cost
    """Of a time in the past [µs]."""
    asked: int
    differing: int
    """How many of them aren't bit by bit what they were live."""


def _endure(hand: Hand, hours: float, told: Callable[[_Look], None] = lambda _: None) -> _Endurance:
    engine, clock = _session(None)
    inputs = round(hours * 3600 / PERIOD)
    kept = max(inputs // REWOUND, 1)
    times, live = [], np.empty((inputs // kept + 1, LIMITS.dof))
    looks: list[_Look] = []
    for look in range(LOOKS):
        watch = Stopwatch.new()
        for k in range(inputs * look // LOOKS, inputs * (look + 1) // LOOKS):
            watch.time(partial(engine.execute, hand(k)))
            clock.advance(PERIOD)
            if k % kept == 0:
                t = clock.now() - PERIOD * (0.5 + 0.49 * np.sin(k))
                live[len(times)] = engine.joints(t)
                times.append(t)
        size = engine._keeper.size / 1e6
        looks.append(_Look(clock.now() / 3600, len(engine.timeline), _resident(), size, watch.cost))
        told(looks[-1])
    watch, differing = Stopwatch.new(), 0
    for i in np.random.default_rng(0).permutation(len(times)).tolist():
        q = watch.time(partial(engine.joints, times[i]))
        differing += not np.array_equal(q, live[i])
    return _Endurance(looks, len(engine.receipts), watch.cost, len(times), differing)


def _resident() -> float:
    """Memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return 1e-6 * pages * getpagesize()


def _in_the_long_run(seen: _Endurance) -> list[Result]:
    looks = seen.looks
    # The newest 100,000 segments stay in memory: from here on there are more.
    half, last = looks[LOOKS // 2 - 1], looks[-1]
    more = last.segments - half.segments
    return [
        Result(
            "memory of the process a segment, in the second half",
            Cost((last.resident - half.resident) * 1e6 / more),
            unit="B",
            note=f"{looks[0].resident:.1f} MB after {looks[0].hours * 60:.1f} minutes, {half.resident:.1f} MB "
            f"after {half.hours * 60:.0f}, {last.resident:.1f} MB after {last.hours * 60:.0f} "
            f"({last.segments:,} segments, {seen.commands} commands)",
        ),
        Result("in the file, a segment", Cost((last.file - half.file) * 1e6 / more), unit="B",
               note=f"{last.file:.0f} MB at the end"),
        Result("an input, last twelfth", last.cost, peer="vrs, first twelfth", theirs=looks[0].cost,
               ratio=looks[0].cost.median / last.cost.median),
        Result("`joints(t)` at random times of the past", seen.rewound,
               note=f"{seen.differing} of {seen.asked:,} differ from what they were live"),
    ]  # fmt: skip


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


def _resting() -> Hand:
    move, still = _rates(9), SteerCommand(rates=np.zeros(LIMITS.dof))
    return lambda k: move(k) if k * PERIOD % 1200 < 60 else still


def _tell(look: _Look) -> None:
    print(
        f"{look.hours:6.2f} h  {look.segments:10,} segments  {look.resident:7.1f} MB  file {look.file:7.1f} MB  "
        f"an input {look.cost.median:5.0f} µs, p99 {look.cost.p99:5.0f} µs",
        flush=True,
    )


def main() -> None:
    """Steer for hours."""
    hands = {"rates": lambda: _rates(9), "twist": lambda: _twist(10), "resting": _resting}
    hours, kind = float(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "rates"
    seen = _endure(hands[kind](), hours, _tell)
    print(
        f"{seen.commands} commands; {seen.differing} of {seen.asked:,} times of the past differ from what they "
        f"were live, median {seen.rewound.median:.0f} µs, p99 {seen.rewound.p99:.0f} µs"
    )


if __name__ == "__main__":
    main()
