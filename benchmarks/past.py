"""A sample's cost over the length of the past: 10 to 1,000,000 segments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks import moves, peers
from benchmarks.results import Bar, Chart, Part, Result
from benchmarks.timing import Call, Series, alternate, ratio

SIZES = (10, 100, 1_000, 10_000, 100_000, 1_000_000)
DRAKE_SIZES = SIZES[:-1]
"""To build Drake's takes some 80 µs a segment, and 6 kB: a million aren't tried."""
KINDS = ("sequence", "random")
OURS, SCIPY, DRAKE = "vrs", "SciPy PPoly", "Drake"


def part() -> Part:
    """Measure."""
    pieces = moves.cycle()
    rng = np.random.default_rng(3)
    rivals: dict[str, Call] = {}
    arguments: dict[str, Sequence[float]] = {}
    for count in SIZES:
        timeline = moves.repeated(count, pieces)
        knots = moves.knots(timeline)
        values: dict[str, Call] = {OURS: timeline.sample, SCIPY: peers.ppoly(timeline.segments, knots)}
        drake = peers.drake(timeline.segments, knots) if count in DRAKE_SIZES else None
        if drake is not None:
            values[DRAKE] = drake.value
        middle = float(knots[len(timeline) // 2])
        times = {
            "sequence": (middle + 1e-3 * (np.arange(4000) % 1000)).tolist(),
            "random": rng.uniform(timeline.start, timeline.end, 8000).tolist(),
        }
        for kind in KINDS:
            for rival, value in values.items():
                rivals[_name(rival, kind, count)] = value
                arguments[_name(rival, kind, count)] = times[kind]
    series = alternate(rivals, arguments, calls=400, blocks=40)
    lines: dict[str, list[tuple[float, float]]] = {}
    for kind in KINDS:
        for rival in (OURS, SCIPY, DRAKE):
            known = [(count, series.get(_name(rival, kind, count))) for count in SIZES]
            points = [(float(count), found.cost.median) for count, found in known if found is not None]
            if points:
                lines[f"{rival}, {kind}"] = points
    return Part(
        "Flat in the length of the past",
        "`timeline.sample(t)` on timelines of 10 to 1,000,000 segments, made of the same moves, all lengths and "
        "peers in turns. Drake is built to 100,000: a million take over a minute and gigabytes. Random times among "
        "very many segments also pay for memory that no cache holds, whoever samples.",
        tuple(_row(series, kind, count) for kind in KINDS for count in SIZES[2:]),
        (
            Chart(
                "past",
                "One sample over the length of the past",
                "lines",
                "segments in the timeline",
                "median cost [µs]",
                lines,
            ),
        ),
    )


def _name(rival: str, kind: str, count: int) -> str:
    return f"{rival}, {kind}, {count}"


def _row(series: dict[str, Series], kind: str, count: int) -> Result:
    """A long timeline beside the shortest."""
    long, short = series[_name(OURS, kind, count)], series[_name(OURS, kind, SIZES[0])]
    flat = kind == "sequence"
    return Result(
        f"{kind}, {count:,} segments",
        long.cost,
        bar=Bar(ratio=0.8 if flat else None),
        peer=f"vrs, {SIZES[0]} segments",
        theirs=short.cost,
        ratio=ratio(short, long),
        note="0.8: at most 1.25 times the cost among 10, the spread of the measurement" if flat else "",
    )
