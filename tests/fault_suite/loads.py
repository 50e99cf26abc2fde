"""What others put on a server, while somebody has control."""

from __future__ import annotations

import re

from benchmarks import availability
from benchmarks.results import Bar, Result
from tests.fault_suite.effort import Effort, most

TIMES = 2.0
"""Longest p99 under a load, of that alone."""


def under_load(name: str, effort: Effort) -> tuple[Result, ...]:
    """A scenario of `benchmarks.availability`, beside nobody else there; nothing is said where that is too slow."""
    trip_alone, _, _, trip, halts, back = availability.results(("alone", name), effort.load)
    alone, p99 = (one.ours.p99 for one in (trip_alone, trip))  # type: ignore[union-attr]
    assert alone is not None
    assert p99 is not None
    if alone > availability.P99:
        note = f"alone it's {alone:.0f} ms: others keep the machine busy"
        return (
            Result("p99 of a command's round trip", None, "ms", Bar(median=availability.P99), note=note),
            Result("the same, of that alone", None, "", Bar(median=TIMES)),
        )
    untold = re.search(r"(\d+) flooders weren't told", trip.note)
    told = () if untold is None else (most("flooders that aren't told", float(untold[1]), 0),)
    return (
        most("p99 of a command's round trip", p99, availability.P99, "ms", note=trip.note),
        most("the same, of that alone", p99 / alone, TIMES, note=f"alone {alone:.1f} ms"),
        most("halts", halts.ours.median, 0, note=halts.note),  # type: ignore[union-attr]
        most("an operator who is cut off is back after", back.ours.median, availability.BACK, "s"),  # type: ignore[union-attr]
        *told,
    )
