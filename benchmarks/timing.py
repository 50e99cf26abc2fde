"""Timing on a machine that isn't quiet: rivals take turns in short blocks, and ratios are those of neighbours.

Blocks are timed by the thread's processor time, so that what others do meanwhile doesn't count.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.results import Bar, Cost, Result, number

Call = Callable[[Any], Any]

LONG = 50.0
"""Calls that take longer are timed by processor time one by one too [µs]; to read that takes 0.5 to 3 µs."""


@dataclass(frozen=True, slots=True)
class Series:
    """Costs of a call [µs]."""

    blocks: NDArray[np.float64]
    """Mean of each block."""
    calls: NDArray[np.float64]
    """Single calls, the timer's own 0.1 µs included."""

    @property
    def cost(self) -> Cost:
        """Median of the blocks, 99th percentile of the calls."""
        return Cost(float(np.median(self.blocks)), float(np.percentile(self.calls, 99)))


SETTLING = 10
"""Calls before single ones are timed, after a rival's turn."""


def singles(call: Call, arguments: Sequence[Any], typical: float) -> list[int]:
    """Nanoseconds of each call [ns], of which one takes typically so long [µs]."""
    clock = time.thread_time_ns if typical > LONG else time.perf_counter_ns
    costs = []
    for argument in arguments[:SETTLING]:
        call(argument)
    for argument in arguments:
        start = clock()
        call(argument)
        costs.append(clock() - start)
    return costs


def alternate(
    rivals: dict[str, Call],
    arguments: Sequence[Any] | dict[str, Sequence[Any]],
    *,
    calls: int = 500,
    blocks: int = 60,
) -> dict[str, Series]:
    """Time rivals in turns.

    Args:
        rivals: What to call, by name.
        arguments: What with, in order, the same for all or by name; each block goes on where the one before ended.
        calls: Calls a block.
        blocks: Blocks of each rival.

    Returns:
        The series of each rival; the blocks of one number are neighbours in time.
    """
    given = arguments if isinstance(arguments, dict) else dict.fromkeys(rivals, arguments)
    parts = {name: _parts(given[name], calls) for name in rivals}
    means: dict[str, list[float]] = {name: [] for name in rivals}
    each: dict[str, list[int]] = {name: [] for name in rivals}
    order = list(rivals)
    for block in range(blocks):
        for name in order:
            call = rivals[name]
            part = parts[name][block % len(parts[name])]
            start = time.thread_time_ns()
            deque(map(call, part), maxlen=0)
            means[name].append(1e-3 * (time.thread_time_ns() - start) / len(part))
        for name in order:
            part = parts[name][block % len(parts[name])]
            each[name] += singles(rivals[name], part[:200], means[name][-1])
        order.reverse()
    return {name: Series(np.array(means[name]), 1e-3 * np.array(each[name])) for name in rivals}


def _parts(arguments: Sequence[Any], calls: int) -> list[Sequence[Any]]:
    """Full blocks of the arguments; all of them where they don't fill one."""
    count = min(calls, len(arguments))
    return [arguments[i : i + count] for i in range(0, len(arguments) - count + 1, count)]


def ratio(peer: Series, ours: Series) -> float:
    """How many times as long the peer takes: the median over neighbouring blocks."""
    return float(np.median(peer.blocks / ours.blocks))


def beside(
    name: str,
    ours: str,
    series: dict[str, Series],
    peers: dict[str, float | None],
    *,
    note: str = "",
    bar: Bar | None = None,
) -> list[Result]:
    """One result a peer.

    Args:
        name: What was done.
        ours: Which of the series is ours.
        series: What `alternate` found; peers that aren't in it aren't installed.
        peers: Least ratio that is asked for beside each peer, or None.
        note: For the first row.
        bar: For the first row, instead of its ratio.
    """
    found: list[Result] = []
    for peer, least in peers.items():
        theirs = series.get(peer)
        first = not found
        found.append(
            Result(
                name,
                series[ours].cost,
                bar=bar if bar is not None and first else Bar(ratio=least),
                peer=peer,
                theirs=None if theirs is None else theirs.cost,
                ratio=None if theirs is None else ratio(theirs, series[ours]),
                note=note if first else "",
            )
        )
    return found


def yardstick() -> list[float]:
    """What a fixed calculation, small arrays and plain Python, takes in processor time, again and again [µs]."""
    a = np.eye(6) * 0.5
    costs = []
    for _ in range(200):
        start = time.thread_time_ns()
        total, x = 0.0, a[0]
        for k in range(100):
            x = a.dot(x) + k
            total += sum([0.5 * value for value in x.tolist()])
        costs.append(1e-3 * (time.thread_time_ns() - start))
    return costs


@dataclass(slots=True)
class Stopwatch:
    """Collects what single actions cost, in wall and in processor time [µs]."""

    wall: list[float]
    processor: list[float]

    @classmethod
    def new(cls) -> Stopwatch:
        """One that has measured nothing."""
        return cls([], [])

    def time(self, action: Callable[[], Any]) -> Any:
        """Carry out an action, note what it costs and return its result."""
        processor, wall = time.thread_time_ns(), time.perf_counter_ns()
        answer = action()
        taken = time.perf_counter_ns() - wall, time.thread_time_ns() - processor
        self.wall.append(1e-3 * taken[0])
        self.processor.append(1e-3 * taken[1])
        return answer

    @property
    def cost(self) -> Cost:
        """Median and 99th percentile in processor time: what others do on the machine isn't ours."""
        return _percentiles(self.processor)

    @property
    def in_wall_time(self) -> str:
        """The same in wall time, in words."""
        cost = _percentiles(self.wall)
        return f"in wall time {number(cost.median)} µs, p99 {number(cost.p99 or 0.0)} µs"


def _percentiles(values: list[float]) -> Cost:
    median, p99 = np.percentile(values, (50, 99))
    return Cost(float(median), float(p99))


def seconds(action: Callable[[], object]) -> float:
    """Return the processor time that an action takes [s]."""
    start = time.process_time()
    action()
    return time.process_time() - start
