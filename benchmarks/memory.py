"""Bytes that a segment takes, traced by Python's allocator."""

from __future__ import annotations

import gc
import tracemalloc

import numpy as np

from benchmarks import moves
from benchmarks.results import Bar, Cost, Part, Result
from vrs import Timeline

SEGMENTS = 100_000
COMMANDED = 20_000


def part() -> Part:
    """Measure."""
    pieces = moves.cycle()
    # What is made once, whatever the length, isn't a segment's.
    moves.repeated(1000, pieces).sample(np.linspace(0.0, 1.0, 100))
    gc.collect()
    tracemalloc.start()
    timeline = moves.repeated(SEGMENTS, pieces)
    bare = _traced() / len(timeline)
    t = np.linspace(timeline.start, timeline.end, SEGMENTS)
    timeline.sample(t)
    sampled = _traced() / len(timeline)
    for x in np.random.default_rng(8).uniform(timeline.start, timeline.end, 20_000).tolist():
        timeline.sample(x)
    indexed = _traced() / len(timeline)
    del timeline
    before = _traced()
    engine, _ = moves.appended(COMMANDED)
    whole = (_traced() - before) / len(engine.timeline)
    tracemalloc.stop()
    coefficients = _coefficients(engine.timeline)
    bar = Bar(median=1000.0)
    return Part(
        "Memory",
        f"Bytes a segment by `tracemalloc`: a timeline of {SEGMENTS:,} segments of real moves (six joints, degree "
        "2 and 3), appended move by move; then what sampling it densely, and at 20,000 single times, adds by its "
        f"bounded caches; and an engine with {COMMANDED:,} segments, every receipt and undo included. The "
        f"coefficients alone are {coefficients:.0f} B.",
        (
            Result("timeline", Cost(bare), unit="B", bar=bar),
            Result("timeline, after dense sampling", Cost(sampled), unit="B", bar=bar),
            Result("timeline, after random single samples too", Cost(indexed), unit="B", bar=bar),
            Result("engine: receipts, commands and undo too", Cost(whole), unit="B"),
        ),
    )


def _traced() -> int:
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def _coefficients(timeline: Timeline) -> float:
    return sum(segment.coefficients.nbytes for segment in timeline.segments) / len(timeline)
