"""The far past in a file: bit by bit what it was, wherever it's shared, and memory that doesn't grow."""

from __future__ import annotations

import copy
import errno
import gc
import logging
import os
import pickle
import tempfile
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from robots import puma560
from tests.vrs.laws import Figures
from tests.vrs.sessions import Generator, Session
from vrs import Engine, JointTarget, ManualClock, MotionCommand, SteerCommand, Timeline, archive, tree
from vrs.archive import Keeper, StoredLeaf, StoredNode
from vrs.codec import from_msgpack, to_msgpack
from vrs.segment import Piece

MODEL = puma560.model()
N = 3


@pytest.fixture(autouse=True)
def eager(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that's over is put away at once, from a tree of small leaves, and next to nothing is kept when read."""
    for name, value in (("KEPT", 0), ("RECENT", 0.0), ("PATIENCE", 0.0), ("RESERVE", 0)):
        monkeypatch.setattr(archive, name, value)
    monkeypatch.setattr(archive.READ_LEAVES, "most", 3)
    monkeypatch.setattr(archive.READ_NODES, "most", 2)
    monkeypatch.setattr(archive, "GRANT", 0)
    monkeypatch.setattr(archive, "PORTION", 8)
    monkeypatch.setattr(tree, "LEAF", 4)
    monkeypatch.setattr(tree, "CAPACITY", 5)


def timeline_of(seed: int, count: int, orders: int = 9) -> Timeline:
    """A timeline of segments of many degrees, with commands of its own for each three."""
    rng = np.random.default_rng(seed)
    timeline = Timeline(rng.normal(size=N), 0.1)
    for k in range(count // 3):
        a = [rng.normal(size=(int(rng.integers(1, orders)), N)) for _ in range(3)]
        timeline = timeline.edited(timeline.end, [Piece(rng.uniform(0.001, 0.4, 3).tolist(), a, k % 7)])
    return timeline


def again(timeline: Timeline) -> Timeline:
    """An equal timeline that shares nothing."""
    return pickle.loads(pickle.dumps(timeline))


def put_away(timeline: Timeline, keeper: Keeper | None = None) -> Keeper:
    """Put all of a timeline away but what's at its end."""
    keeper = keeper or Keeper()
    for _ in range(len(timeline)):
        keeper.tidy(timeline, timeline.end + 1.0)
    return keeper


def parts(timeline: Timeline) -> list:
    """All nodes and leaves; what's below a stored node isn't looked at."""
    found: list = []

    def walk(node: object, height: int) -> None:
        found.append(node)
        if height and type(node) is not StoredNode:
            for child in node.children:
                walk(child, height - 1)

    walk(timeline.root, timeline.height)
    return found


def stored(timeline: Timeline) -> int:
    return sum(part.count for part in parts(timeline) if type(part) is StoredNode)


def stored_leaves(timeline: Timeline) -> int:
    return sum(type(part) in (StoredLeaf, StoredNode) for part in parts(timeline))


def test_all_that_can_be_asked_of_the_past_stays_bit_identical():
    timeline = timeline_of(1, 900)
    live = again(timeline)
    rng = np.random.default_rng(2)
    t = rng.uniform(timeline.start - 1, timeline.end + 1, 700)
    put_away(timeline)
    assert stored(timeline) > 850
    assert len(parts(timeline)) < 200
    assert timeline == live
    assert live == timeline
    assert hash(timeline) == hash(live)
    assert tuple(timeline.segments) == tuple(live.segments)
    assert [timeline.start_of(i) for i in range(901)] == [live.start_of(i) for i in range(901)]
    assert [timeline.owner_of(i) for i in range(900)] == [live.owner_of(i) for i in range(900)]
    assert timeline.owners(5, 890) == live.owners(5, 890)
    assert [timeline.end_of_run(i) for i in range(0, 900, 7)] == [live.end_of_run(i) for i in range(0, 900, 7)]
    for order in range(4):
        assert np.array_equal(timeline.sample(t, derivative=order), live.sample(t, derivative=order))
    for x in t.tolist():
        assert np.array_equal(timeline.sample(x), live.sample(x))
        assert timeline.index_at(x) == live.index_at(x)
        for here, there in zip(timeline.state_before(x), live.state_before(x), strict=True):
            assert np.array_equal(here, there)
    knots = [live.start_of(i) for i in range(901)]
    assert np.array_equal(timeline.sample(knots), live.sample(knots))
    longer = timeline.edited(timeline.end, [Piece([1.0], [np.ones((1, N))], 1)])
    assert longer.index_at(knots[0]) == 0
    assert longer.index_at(np.nextafter(knots[0], -np.inf)) == -1
    assert to_msgpack(timeline) == to_msgpack(live)


def test_edits_in_what_was_put_away_do_what_they_did():
    rng = np.random.default_rng(3)
    timeline = timeline_of(4, 300)
    live = again(timeline)
    put_away(timeline)
    for _ in range(60):
        cut = float(rng.uniform(timeline.start - 0.1, timeline.end + 0.1))
        new = Piece([0.2, 0.1], [rng.normal(size=(4, N)) for _ in range(2)], 8)
        tail = int(rng.integers(max(timeline.index_at(cut), 0), len(timeline) + 1))
        begin = max(timeline.start_of(tail), cut + 0.3) if tail < len(timeline) and cut < timeline.end else None
        before = again(timeline)
        shared, alone = timeline.edited(cut, [new], tail, begin), live.edited(cut, [new], tail, begin)
        assert shared == alone
        assert timeline == before
        timeline, live = shared, alone
        knots = [live.start_of(i) for i in range(len(live))]
        assert np.array_equal(timeline.sample(knots), live.sample(knots))
        if rng.random() < 0.3:
            put_away(timeline)
        if len(timeline) < 60:
            break
    assert len(timeline) != 300


def test_older_timelines_lose_the_leaves_that_they_share():
    older = timeline_of(5, 300)
    newer = older.edited(older.end, [Piece([0.1] * 200, [np.zeros((4, N))] * 200, 9)])
    live = again(older)
    put_away(newer)
    leaves = [part for part in parts(older) if isinstance(part, tree.Leaf)]
    assert sum(type(leaf) is not StoredLeaf for leaf in leaves) <= 1
    for leaf in leaves:
        for column in ("starts", "durations", "owners", "rows") if type(leaf) is StoredLeaf else ():
            with pytest.raises(AttributeError):
                getattr(tree.Leaf, column).__get__(leaf)
    assert older == live


def test_pickles_and_copies_need_no_file():
    timeline = timeline_of(6, 200)
    live = again(timeline)
    put_away(timeline)
    copies = [again(timeline), copy.deepcopy(timeline)]
    assert not any(type(part) in (StoredNode, StoredLeaf) for one in copies for part in parts(one))
    del timeline
    assert all(one == live for one in copies)


def test_the_file_goes_with_the_last_timeline_that_needs_it():
    def files() -> int:
        return len(os.listdir("/proc/self/fd"))

    gc.collect()
    before = files()
    keeper = put_away(timeline := timeline_of(7, 200))
    branch = timeline.edited(timeline.start_of(150), [Piece([1.0], [np.zeros((1, N))], 1)])
    assert files() == before + 1
    live = again(branch)
    del keeper, timeline
    assert branch == live
    assert files() == before + 1
    del branch
    assert files() == before


@pytest.mark.parametrize("fault", ["broken", "short write", "nearly full", "no place"])
def test_a_full_disk_loses_nothing_and_says_so_once(fault: str, caplog: pytest.LogCaptureFixture):
    timeline = timeline_of(8, 300)
    live = again(timeline)
    keeper = Keeper()
    keeper.tidy(timeline, timeline.end if fault != "no place" else -1.0)
    here = stored_leaves(timeline)
    assert (here > 0) == (fault != "no place")
    write = os.pwrite

    def fail(*_: object, **__: object) -> int:
        raise OSError(errno.EIO, fault)

    def half(file: int, data: bytes, at: int) -> int:
        return write(file, data[: len(data) // 2], at)

    with pytest.MonkeyPatch.context() as patch, caplog.at_level(logging.WARNING):
        if fault == "nearly full":
            patch.setattr(archive, "RESERVE", 2**62)
        elif fault == "no place":
            patch.setattr(tempfile, "TemporaryFile", fail)
        else:
            patch.setattr(os, "pwrite", fail if fault == "broken" else half)
        put_away(timeline, keeper)
        assert [record.name for record in caplog.records] == ["vrs.archive"]
        assert "stays in memory" in caplog.text
        assert stored_leaves(timeline) == here
        assert timeline == live
    # As soon as there's space, it goes on.
    put_away(timeline, keeper)
    assert stored(timeline) > 250
    assert timeline == live


def test_what_is_young_stays_in_memory(monkeypatch: pytest.MonkeyPatch):
    timeline = timeline_of(9, 600)
    monkeypatch.setattr(archive, "RECENT", 20.0)
    keeper = Keeper()
    for _ in range(600):
        keeper.tidy(timeline, timeline.end - 10.0)
    first = timeline.start_of(stored(timeline))
    assert timeline.end - 32.0 - 0.4 * 30 < first <= timeline.end - 30.0
    monkeypatch.setattr(archive, "RECENT", 0.0)
    monkeypatch.setattr(archive, "KEPT", 50)
    put_away(timeline, keeper)
    assert 600 - 50 - 40 < stored(timeline) <= 550


def test_threads_read_while_it_is_put_away():
    timeline = timeline_of(10, 1500)
    live = again(timeline)
    t = np.random.default_rng(11).uniform(timeline.start, timeline.end, 400).tolist()
    want = [live.sample(x) for x in t]

    def walk(turn: int) -> bool:
        fresh = timeline.with_version(turn)
        return all(np.array_equal(fresh.sample(x), y) for x, y in zip(t, want, strict=True))

    with ThreadPoolExecutor(6) as pool:
        reading = [pool.submit(walk, turn) for turn in range(8)]
        keepers = [pool.submit(put_away, timeline) for _ in range(2)]
        assert all(one.result() for one in reading)
        assert all(one.result() for one in keepers)
    assert stored(timeline) > 1450
    assert timeline == live


def test_what_is_read_is_dropped_again():
    def in_memory() -> tuple[int, int]:
        gc.collect()
        return tuple(sum(type(o) is kind for o in gc.get_objects()) for kind in (tree.Leaf, tree.Node))

    timeline = timeline_of(15, 900)
    put_away(timeline)
    leaves, nodes = in_memory()
    assert sum(len(segment.coefficients) for segment in timeline.segments) > 900
    more = in_memory()
    assert more[0] <= leaves + 3
    assert more[1] <= nodes + 2


def test_a_forked_process_writes_a_file_of_its_own():
    timeline = timeline_of(12, 300)
    live = again(timeline)
    keeper = put_away(timeline)
    context = get_context("fork")
    written = context.Event()

    def longer(value: float) -> Timeline:
        return timeline.edited(timeline.end, [Piece([0.1] * 100, [np.full((4, N), value)] * 100, 9)])

    def child() -> None:
        written.wait(20)
        mine = longer(5.0)
        alone = again(mine)
        put_away(mine, keeper)
        os._exit(0 if mine == alone and timeline == live and stored(mine) > stored(timeline) else 3)

    process = context.Process(target=child)
    process.start()
    mine = longer(7.0)
    alone = again(mine)
    put_away(mine, keeper)
    written.set()
    process.join()
    assert process.exitcode == 0
    assert mine == alone
    assert timeline == live
    assert stored(mine) > stored(timeline)


@pytest.mark.parametrize("seed", range(12))
def test_the_laws_hold_with_everything_put_away(seed: int):
    session = Session(MODEL, Generator([31, seed]), Figures(), lines=False)
    session.go_on(30)
    session.audit()


def test_engines_without_a_clock_and_short_sessions_touch_no_file(monkeypatch: pytest.MonkeyPatch):
    offline = Engine(MODEL, timeline=None)
    for k in range(20):
        offline.execute(MotionCommand(JointTarget(MODEL.poses["nominal"] + 0.1 * (k % 2))))
    assert stored_leaves(offline.timeline) == 0
    monkeypatch.setattr(archive, "KEPT", 100_000)
    clock = ManualClock()
    engine = Engine(MODEL, clock=clock)
    for k in range(20):
        engine.execute(MotionCommand(JointTarget(MODEL.poses["nominal"] + 0.1 * (k % 2))))
        clock.advance(2.0)
    assert stored_leaves(engine.timeline) == 0


def test_memory_does_not_grow(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tree, "LEAF", 48)
    monkeypatch.setattr(tree, "CAPACITY", 96)
    monkeypatch.setattr(archive, "KEPT", 5000)
    rng = np.random.default_rng(13)
    keeper, timeline = Keeper(), Timeline(np.zeros(6))
    last = Piece([0.1] * 5, [np.zeros((1, 6))] * 5, 1)
    tracemalloc.start()
    try:
        took = []
        for count in (12_000, 32_000):
            while len(timeline) < count:
                new = Piece(rng.uniform(0.001, 0.02, 20).tolist(), list(rng.normal(size=(20, 4, 6))), count)
                timeline = timeline.edited(timeline.end - 0.2, [new, last])
                keeper.tidy(timeline, timeline.end)
            gc.collect()
            took.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert keeper.size > 200 * 25_000
    assert (took[1] - took[0]) / 20_000 < 15


def test_a_steered_past_is_what_it_was_live(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tree, "LEAF", 48)
    monkeypatch.setattr(tree, "CAPACITY", 8)
    rng = np.random.default_rng(14)
    clock = ManualClock()
    engine = Engine(MODEL, clock=clock)
    seen = []
    for k in range(700):
        if k % 10 == 0:
            rates = rng.uniform(-0.5, 0.5, 6) * MODEL.limits.qd_max * (rng.random() > 0.2)
        engine.execute(SteerCommand(rates=rates))
        clock.advance(0.02)
        t = clock.now() - 0.02 * rng.random()
        seen.append((t, engine.joints(t)))
    timeline = engine.timeline
    assert stored(timeline) > 500
    for i in rng.permutation(len(seen)).tolist():
        t, q = seen[i]
        assert np.array_equal(engine.joints(t), q)
    q = np.array([q for _, q in seen])
    assert np.abs(engine.joints([t for t, _ in seen]) - q).max() <= 1e-14
    assert from_msgpack(to_msgpack(timeline)) == timeline
    assert Engine(MODEL, timeline=timeline).timeline == again(timeline)
