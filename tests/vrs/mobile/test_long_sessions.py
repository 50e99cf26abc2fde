"""An hour of driving: memory a segment, and that nothing slows down."""

from __future__ import annotations

import gc
import tracemalloc
from time import process_time

import numpy as np

from robots import ipr
from vrs import DriveCommand, Engine, ManualClock, archive

MODEL = ipr.model()


def drive(engine, clock, count):
    """The best of some stretches of commands at ten a second, and of single times, each [s]."""
    commands, queries = [], []
    for _ in range(count // 100):
        begin = process_time()
        for k in range(100):
            clock.advance(0.1)
            engine.execute(DriveCommand(0.3, 0.1 + 1e-3 * k, 0.1))
        commands.append((process_time() - begin) / 100)
        now, begin = clock.now(), process_time()
        for k in range(100):
            engine.posture(now - 0.01 * k)
        queries.append((process_time() - begin) / 100)
    return min(commands), min(queries)


def test_a_long_session_stays_small_and_quick():
    """Ratios of one run: how the last tenth compares with the first, whatever the machine does."""
    clock = ManualClock()
    engine = Engine(MODEL, clock=clock)
    drive(engine, clock, 1000)
    early = drive(engine, clock, 1000)
    drive(engine, clock, 10_000)
    late = drive(engine, clock, 1000)
    assert late[0] <= 3 * early[0]
    assert late[1] <= 3 * early[1]


def leaves_below(node, height):
    if height == 0 or type(node) is archive.StoredNode:
        return [node]
    return [leaf for child in node.children for leaf in leaves_below(child, height - 1)]


def test_the_far_past_is_put_away_and_stays_what_it_was(monkeypatch):
    monkeypatch.setattr(archive, "KEPT", 1000)
    monkeypatch.setattr(archive, "RECENT", 10.0)
    monkeypatch.setattr(archive, "PATIENCE", 0.1)
    clock = ManualClock()
    engine = Engine(MODEL, clock=clock)
    drive(engine, clock, 3000)
    moments = np.linspace(0, 300, 500)
    before = engine.posture(moments), [engine.posture(t) for t in moments[::50].tolist()]
    drive(engine, clock, 4000)
    assert any(
        type(leaf) in (archive.StoredLeaf, archive.StoredNode)
        for leaf in leaves_below(engine.timeline.root, engine.timeline.height)
    )
    np.testing.assert_array_equal(engine.posture(moments), before[0])
    np.testing.assert_array_equal([engine.posture(t) for t in moments[::50].tolist()], before[1])


def test_a_segment_takes_less_than_a_kilobyte():
    clock = ManualClock()
    engine = Engine(MODEL, clock=clock)
    taken = []
    tracemalloc.start()
    try:
        # What can be taken back is bounded, and full after the first part.
        for _ in range(2):
            drive(engine, clock, 2000)
            gc.collect()
            taken.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert taken[1] - taken[0] <= 1000 * 2000
