"""The tree below a timeline, against a list that does the same slowly; caches, threads, memory."""

from __future__ import annotations

import copy
import pickle
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import perm

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robots import puma560
from vrs import (
    ArcSegment,
    Engine,
    JointTarget,
    Motion,
    MotionCommand,
    PolynomialSegment,
    PoseTarget,
    Timeline,
    evaluation,
    tree,
)
from vrs.chunk import HOLD, Piece
from vrs.codec import from_json, to_json
from vrs.errors import FormatError, InvalidValueError, NonFiniteTimeError

N = 3


@pytest.fixture
def small_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few segments make a deep tree."""
    monkeypatch.setattr(tree, "LEAF", 3)
    monkeypatch.setattr(tree, "CAPACITY", 3)


@dataclass(frozen=True)
class Entry:
    start: float
    duration: float
    a: np.ndarray
    owner: int


def piece(rng: np.random.Generator, owner: int, count: int, orders: int = 5) -> Piece:
    durations = (rng.uniform(0.01, 1.0, count) * 10.0 ** rng.integers(-3, 1)).tolist()
    a = [rng.normal(size=(int(rng.integers(1, orders)), N)) for _ in range(count)]
    return Piece(durations, a, owner)


def naive(entries: list[Entry], end: float, cut: float, pieces: list[Piece], tail: int | None, begin: float):
    """What an edit makes, by its words."""
    kept = [e for e in entries if e.start < cut]
    if kept and cut < end:
        following = entries[len(kept)].start if len(kept) < len(entries) else end
        if cut < following:
            kept[-1] = replace(kept[-1], duration=cut - kept[-1].start)
    moment = cut
    if cut > end:
        last = kept[-1].a if kept else None
        h = kept[-1].duration if kept else 0.0
        held = sum(row * h**k for k, row in enumerate(last)) if kept else np.zeros(N)
        kept.append(Entry(end, cut - end, held[None], HOLD))
        moment = end + (cut - end)
    for new in pieces:
        for h, a in zip(new.durations, new.coefficients, strict=True):
            kept.append(Entry(moment, h, a, new.command_id))
            moment += h
    if tail is None:
        return kept
    delta = begin - entries[tail].start
    return kept + [replace(e, start=e.start + delta) for e in entries[tail:]]


def check(timeline: Timeline, entries: list[Entry]) -> None:
    assert len(timeline) == len(entries)
    for i, entry in enumerate(entries):
        segment = timeline.segment(i)
        if entry.owner == HOLD:
            assert np.allclose(segment.coefficients, entry.a, rtol=1e-12, atol=1e-12)
        else:
            assert np.array_equal(segment.coefficients, entry.a)
        assert timeline.owner_of(i) == entry.owner
        assert segment.start == timeline.start_of(i) == pytest.approx(entry.start, rel=1e-14, abs=1e-12)
        assert segment.duration == pytest.approx(entry.duration, rel=1e-12, abs=1e-12)
    owners = [e.owner for e in entries if e.owner != HOLD]
    assert timeline.owners(0, len(timeline)) == tuple(dict.fromkeys(owners))


def value_of(timeline: Timeline, t: float, order: int) -> np.ndarray:
    """The value by a walk over all segments and plain sums."""
    count = len(timeline)
    if count == 0 or t < timeline.start_of(0):
        return timeline.initial if order == 0 else np.zeros(N)
    if t >= timeline.end:
        return timeline.final() if order == 0 else np.zeros(N)
    segment = timeline.segment(max(i for i in range(count) if timeline.start_of(i) <= t))
    u = t - segment.start
    terms = [perm(k, order) * row * u ** (k - order) for k, row in enumerate(segment.coefficients) if k >= order]
    return sum(terms, np.zeros(N))


def check_samples(timeline: Timeline, rng: np.random.Generator) -> None:
    span = max(timeline.end - timeline.start, 1.0)
    knots = [timeline.start_of(int(i)) for i in rng.integers(0, len(timeline) + 1, 8)]
    t = np.concatenate([rng.uniform(timeline.start - 0.1 * span, timeline.end + 0.1 * span, 12), knots])
    t = np.concatenate([t, np.nextafter(knots, -np.inf), [timeline.end]])
    for order in range(4):
        want = np.array([value_of(timeline, x, order) for x in t.tolist()])
        size = np.maximum(1, np.abs(want))
        each = np.array([timeline.sample(x, derivative=order) for x in t.tolist()])
        assert (np.abs(each - want) <= 2e-13 * size).all()
        for _ in range(2):
            batch = timeline.sample(t, derivative=order)
            assert (np.abs(batch - each) <= (1e-14 if order == 0 else 0.0) * np.maximum(1, np.abs(batch))).all()
        ordered = np.sort(t)
        assert np.array_equal(timeline.sample(ordered, derivative=order), batch[np.argsort(t)])


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e3, -5.0]), st.sampled_from([(3, 3), (4, 2), (64, 64)]))
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_edits_do_what_a_list_does(monkeypatch: pytest.MonkeyPatch, seed: int, start: float, sizes: tuple):
    monkeypatch.setattr(tree, "LEAF", sizes[0])
    monkeypatch.setattr(tree, "CAPACITY", sizes[1])
    rng = np.random.default_rng(seed)
    timeline = Timeline(np.zeros(N), start)
    entries: list[Entry] = []
    for step in range(int(rng.integers(5, 60))):
        old_starts = [timeline.start_of(i) for i in range(len(timeline))]
        kind = rng.integers(6)
        index = int(rng.integers(0, len(timeline) + 1))
        cut = timeline.start_of(index)
        if kind == 0:
            cut = float(rng.uniform(timeline.start, timeline.end + 0.2))
        elif kind == 1:
            cut = timeline.end
        elif kind == 2 and step % 7 == 0:
            cut = timeline.start - 1.0
        pieces = [
            piece(rng, int(rng.integers(0, 9)), int(rng.integers(1, 8))) for _ in range(int(rng.integers(1, 3)))
        ]
        tail = begin = None
        low = timeline.index_at(cut)
        if kind >= 3 and low < len(timeline):
            tail = int(rng.integers(max(low, 0), len(timeline)))
            begin = ready = cut + sum(sum(new.durations) for new in pieces)
            if ready < timeline.start_of(tail):
                begin = timeline.start_of(tail)
                pieces.append(Piece([begin - ready], [np.zeros((1, N))], HOLD))
        # The list's sums are rounded otherwise: it goes on from the tree's own starts, which were near enough.
        entries = [replace(entry, start=begun) for entry, begun in zip(entries, old_starts, strict=True)]
        entries = naive(entries, timeline.end, cut, pieces, tail, begin)
        before = timeline
        timeline = timeline.edited(cut, pieces, tail, begin)
        assert timeline.version == before.version + 1
        assert [before.start_of(i) for i in range(len(before))] == old_starts
        new_starts = [timeline.start_of(i) for i in range(len(timeline))]
        assert new_starts == pytest.approx([entry.start for entry in entries], rel=1e-14, abs=1e-12)
        kept = sum(s < cut for s in old_starts)
        assert new_starts[:kept] == old_starts[:kept]
        if cut <= before.end:
            assert new_starts[kept] == cut
        if tail is not None and begin == old_starts[tail]:
            count = len(before) - tail
            assert new_starts[-count:] == old_starts[tail:]
    check(timeline, entries)
    check_samples(timeline, rng)
    for i in range(len(timeline)):
        knot = timeline.start_of(i)
        assert timeline.start_of(timeline.index_at(knot)) == knot


@pytest.mark.usefixtures("small_nodes")
def test_stamps_stay_exact_through_deep_restructuring():
    rng = np.random.default_rng(0)
    timeline = Timeline(np.zeros(N), 0.1)
    stamps: dict[int, float] = {}
    for k in range(1, 400):
        cut = timeline.end + float(rng.uniform(0, 1)) * 0.1
        stamps[k] = cut
        timeline = timeline.edited(cut, [piece(rng, k, 3)])
    for k in range(400, 700):
        index = int(rng.integers(len(timeline) - 300, len(timeline) - 4))
        cut = timeline.start_of(index) + 0.3 * (timeline.start_of(index + 1) - timeline.start_of(index))
        new = piece(rng, k, 4)
        timeline = timeline.edited(cut, [new], index + 1, cut + sum(new.durations))
    assert len(timeline._levels) > 4
    first = {timeline.owner_of(i): timeline.start_of(i) for i in reversed(range(600))}
    assert all(first[k] == stamps[k] for k in range(1, 140))


@pytest.mark.usefixtures("small_nodes")
def test_a_tree_shrinks_with_what_is_dropped():
    rng = np.random.default_rng(1)
    timeline = Timeline(np.zeros(N))
    for k in range(60):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 5)])
    assert len(timeline._levels) >= 4
    short = timeline.edited(timeline.start_of(2), [piece(rng, 99, 1)])
    assert len(short) == 3
    assert len(short._levels) == 1
    assert len(short.edited(short.start, [])) == 0


def test_every_order_of_coefficients_keeps_its_place():
    rng = np.random.default_rng(2)
    segments, q, t = [], np.zeros(N), 0.0
    for k in range(300):
        a = rng.normal(size=(int(rng.integers(1, 41)), N))
        a[0] = q
        segments.append(PolynomialSegment(t, 0.25, a, k + 1))
        t = segments[-1].end
        q = segments[-1].value(t)
    timeline = Timeline(np.zeros(N), 0.0, segments)
    assert tuple(timeline.segments) == tuple(segments)
    times = rng.uniform(-1, t + 1, 900)
    for order in range(4):
        batch = timeline.sample(times, derivative=order)
        each = np.array([timeline.sample(x, derivative=order) for x in times.tolist()])
        assert (np.abs(batch - each) <= 1e-14 * np.maximum(1, np.abs(batch))).all()
        inside = [(x, b) for x, b in zip(times, batch, strict=True) if 0 <= x < t]
        assert all(
            np.allclose(segments[int(x / 0.25)].value(x, derivative=order), b, atol=1e-12) for x, b in inside
        )


def test_caches_change_no_bit(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tree, "LEAF", 32)
    rng = np.random.default_rng(3)
    timeline = Timeline(np.zeros(N))
    for k in range(500):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 5)])
    middle = timeline.start_of(700)
    shifted = timeline.edited(middle, [piece(rng, 9999, 2)], 705, timeline.start_of(705) + 1 / 3)
    for tau in (timeline, shifted):
        t = rng.uniform(tau.start, tau.end, 3000)
        cold = np.array([tau.with_version(0).sample(x) for x in t[:12].tolist()])
        few = tau.sample(t[:8])
        each = np.array([tau.sample(x) for x in t.tolist()])
        assert any(node.index and node.index.columns for node in tau._root.children)
        assert np.array_equal(each[:12], cold)
        assert np.array_equal(each, [tau.sample(x) for x in t.tolist()])
        many = tau.sample(t)
        assert any(node.stack is not None for node in tau._root.children)
        assert np.array_equal(many[:8], few)
        assert (np.abs(many - each) <= 1e-14 * np.maximum(1, np.abs(many))).all()


def test_caches_are_bounded(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tree, "LEAF", 32)
    monkeypatch.setattr(evaluation, "STACKS", 2)
    monkeypatch.setattr(evaluation, "INDEXES", 2)
    rng = np.random.default_rng(4)
    timeline = Timeline(np.zeros(N))
    for k in range(3000):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 5)])
    t = np.linspace(timeline.start, timeline.end, 4000)
    first = timeline.sample(t)
    each = [timeline.sample(x) for x in t.tolist()]
    nodes = timeline._root.children
    assert len(nodes) > 5
    assert sum(node.stack is not None for node in nodes) <= 2
    assert sum(bool(node.index and node.index.columns) for node in nodes) <= 2
    assert np.array_equal(timeline.sample(t), first)
    assert np.array_equal([timeline.sample(x) for x in t.tolist()], each)


def test_threads_sample_one_timeline_at_once():
    rng = np.random.default_rng(5)
    timeline = Timeline(np.zeros(N))
    for k in range(100):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 5, orders=8)])
    t = rng.uniform(timeline.start - 1, timeline.end + 1, 2000)
    want = np.array([timeline.sample(x) for x in t.tolist()])
    fresh = timeline.with_version(1)

    def walk(shift: int) -> bool:
        order = np.roll(np.arange(len(t)), shift)
        return all(np.array_equal(fresh.sample(float(t[i])), want[i]) for i in order.tolist())

    with ThreadPoolExecutor(6) as pool:
        assert all(pool.map(walk, range(0, 1800, 300)))
    # Branches made and sampled while others sample their parent.
    with ThreadPoolExecutor(4) as pool:
        branches = pool.map(lambda _: fresh.edited(fresh.end, [piece(rng, 1, 1)]).sample(0.5), range(200))
        assert all(pool.map(walk, range(0, 1800, 600)))
        assert all(np.array_equal(b, fresh.sample(0.5)) for b in branches)


def test_a_result_is_the_callers_own():
    rng = np.random.default_rng(6)
    timeline = Timeline(np.ones(N)).edited(0.0, [piece(rng, 1, 4)])
    for t in (-1.0, 0.001, np.float64(0.002), timeline.end + 1, 5):
        first = timeline.sample(t)
        want = first.copy()
        assert first.shape == (N,)
        assert first.dtype == np.float64
        first[:] = 77.0
        assert np.array_equal(timeline.sample(t), want)


def test_times_out_of_all_proportion():
    rng = np.random.default_rng(7)
    timeline = Timeline(np.ones(N)).edited(0.0, [piece(rng, 1, 4)])
    for t in (-1.7e308, 1.7e308, 1e300):
        assert np.isfinite(timeline.sample(t)).all()
        assert np.isfinite(timeline.sample([t])).all()
    assert np.array_equal(timeline.sample(-1.7e308), np.ones(N))
    assert np.array_equal(timeline.sample(1.7e308), timeline.final())
    timeline.sample(-1.0)
    for t in (-np.inf, np.nan, np.inf, np.float64("nan"), np.float32("inf")):
        with pytest.raises(NonFiniteTimeError):
            timeline.sample(t)
    # Starts that rounding makes one, far from the origin: the last of them counts.
    far = Timeline(np.zeros(1)).edited(0.0, [Piece([1e-12] * 200, list(np.arange(200.0).reshape(-1, 1, 1)), 1)])
    far = far.edited(0.0, [Piece([1e6], [np.zeros((1, 1))], 2)], 0, 1e6)
    for t in (1e6, np.nextafter(1e6, 2e6), 1e6 + 1e-10, far.end):
        index = far.index_at(t)
        want = max(i for i in range(len(far)) if far.start_of(i) <= t) if t < far.end else len(far)
        assert index == want
        for _ in range(40):
            assert far.sample(t) == far.sample([t])[0]


def test_copies_and_pickles_are_equal():
    rng = np.random.default_rng(8)
    timeline = Timeline(np.ones(N)).edited(0.0, [piece(rng, 1, 50)])
    before = timeline.sample(0.1)
    for again in (copy.deepcopy(timeline), pickle.loads(pickle.dumps(timeline))):
        assert again == timeline
        assert np.array_equal(again.sample(0.1), before)


def test_an_edit_and_a_segment_take_little_memory():
    rng = np.random.default_rng(9)
    pieces = [Piece([0.1] * 5, list(rng.normal(size=(5, 4, 6))), k + 1) for k in range(4000)]
    tracemalloc.start()
    try:
        timeline = Timeline(np.zeros(6))
        for new in pieces:
            timeline = timeline.edited(timeline.end, [new])
        assert tracemalloc.get_traced_memory()[0] / len(timeline) < 320
        before = tracemalloc.get_traced_memory()[0]
        versions = []
        for k in range(100):
            index = 150 * k + 60
            versions.append(
                timeline.edited(timeline.start_of(index), [pieces[k]], index + 3, timeline.start_of(index + 3) + 1)
            )
        assert (tracemalloc.get_traced_memory()[0] - before) / 100 < 10_000
    finally:
        tracemalloc.stop()


def test_a_node_that_is_made_from_one_keeps_its_offset(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tree, "LEAF", 4)
    monkeypatch.setattr(tree, "CAPACITY", 4)
    rng = np.random.default_rng(10)
    timeline = Timeline(np.zeros(N), 0.1)
    for k in range(120):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 3)])
    rounding = 4 * np.spacing(timeline.end)
    for k in range(100):
        index = int(rng.integers(1, len(timeline) - 12))
        tail = index + int(rng.integers(1, 10))
        cut = timeline.start_of(index) + 0.5 * (timeline.start_of(index + 1) - timeline.start_of(index))
        new = piece(rng, k + 1, 3)
        begin = cut + sum(new.durations)
        before = [timeline.start_of(i) for i in range(len(timeline))]
        delta = begin - before[tail]
        timeline = timeline.edited(cut, [new], tail, begin)
        after = [timeline.start_of(i) for i in range(len(timeline))]
        assert after[: index + 1] == before[: index + 1]
        assert after[index + 1] == cut
        moved = np.array(before[tail:]) + delta
        assert np.abs(np.array(after[index + 4 :]) - moved).max() <= rounding
        assert [timeline.index_at(t) for t in after] == list(range(len(after)))
    shifts = [shift for node, _ in nodes_of(timeline._root, len(timeline._levels)) for shift in node.offsets]
    assert any(shifts)


def nodes_of(node: object, height: int) -> list:
    below = [pair for child in node.children for pair in nodes_of(child, height - 1)] if height > 1 else []
    return [(node, height), *below]


def test_many_times_a_segment_and_few_agree():
    rng = np.random.default_rng(11)
    timeline = Timeline(np.zeros(N)).edited(0.0, [Piece([0.5] * 300, list(rng.normal(size=(300, 4, N))), 1)])
    knots = [timeline.start_of(i) for i in range(301)]
    dense = np.sort(np.concatenate([np.linspace(20.0, 40.0, 4000), knots[40:80], np.nextafter(knots[40:80], 0)]))
    sparse = np.sort(rng.uniform(timeline.start, timeline.end, 100))
    one = np.array([3.25])
    for t in (dense, dense[::-1], sparse, one, np.full(50, knots[60])):
        for order in range(4):
            each = np.array([timeline.sample(x, derivative=order) for x in t.tolist()])
            batch = timeline.sample(t, derivative=order)
            assert (np.abs(batch - each) <= (1e-14 if order == 0 else 0.0) * np.maximum(1, np.abs(batch))).all()


@pytest.mark.parametrize("derivative", range(4))
def test_times_over_many_nodes_are_as_the_segments_have_them(derivative: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tree, "LEAF", 8)
    monkeypatch.setattr(tree, "CAPACITY", 8)
    monkeypatch.setattr(evaluation, "_DENSE", 200)
    monkeypatch.setattr(evaluation, "_GATHERED", 400)
    rng = np.random.default_rng(6)
    timeline = Timeline(np.zeros(N))
    # Cubic nodes in a row, more than are gathered at once, and now and then one of a higher degree between them.
    for k in range(300):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 5, orders=9 if k % 50 == 30 else 5)])
    t = np.sort(rng.uniform(timeline.start, timeline.end, 4000))
    segments = timeline.segments
    want = [segments[timeline.index_at(x)].value(x, derivative=derivative) for x in t.tolist()]
    timeline.sample(t)
    assert np.array_equal(timeline.sample(t, derivative=derivative), want)


def test_a_state_before_is_that_of_the_earlier_segment_and_clean_at_rest():
    # A parabola that ends at rest, up to rounding; then a cubic that doesn't.
    down = np.array([[0.0] * N, [0.2 + 1e-13] * N, [-0.1] * N])
    away = np.array([[0.1] * N, [0.0] * N, [0.3] * N, [0.4] * N])
    timeline = Timeline(np.zeros(N)).edited(0.0, [Piece([1.0, 1.0], [down, away], 1)])
    at_rest = timeline.state_before(1.0)
    assert np.allclose(at_rest.q, 0.1)
    assert not at_rest.qd.any()
    assert not at_rest.qdd.any()
    assert timeline.state_before(np.nextafter(1.0, 2.0)).qdd == pytest.approx([0.6] * N)
    moving = timeline.state_before(2.0)
    assert moving.q == pytest.approx([0.8] * N)
    assert moving.qd == pytest.approx([1.8] * N)
    assert moving.qdd == pytest.approx([3.0] * N)
    for t, q in ((-1.0, 0.0), (0.0, 0.0), (5.0, 0.8)):
        held = timeline.state_before(t)
        assert held.q == pytest.approx([q] * N)
        assert not held.qd.any()
        assert not held.qdd.any()


@pytest.mark.parametrize("command_id", [2**63, -(2**63) - 1, 2**200, 1.5, "7", True])
def test_command_ids_beyond_64_bits_are_refused(command_id: object):
    with pytest.raises(InvalidValueError, match="64 bits"):
        PolynomialSegment(0.0, 1.0, np.zeros((1, N)), command_id)
    with pytest.raises(InvalidValueError, match="64 bits"):
        ArcSegment(0.0, 1.0, (0.0, 0.0, 0.0), 0.1, 0.2, command_id)


def test_the_largest_command_id_is_kept():
    most = PolynomialSegment(0.0, 1.0, np.zeros((1, N)), 2**63 - 1)
    timeline = Timeline(np.zeros(N), 0.0, [most])
    assert timeline.owner_of(0) == 2**63 - 1
    assert from_json(to_json(timeline)) == timeline
    with pytest.raises(FormatError, match="64 bits"):
        from_json(to_json(timeline).replace(b"9223372036854775807", b"9223372036854775808"))


def test_long_certified_motions_sample_alike_one_by_one():
    model = puma560.model()
    pose = model.forward(model.poses["nominal"]).copy()
    pose[:3, 3] += (0.05, -0.1, 0.1)
    for target, motion in ((PoseTarget(pose), Motion.LINE), (JointTarget(np.full(6, 0.5)), Motion.JOINT)):
        engine = Engine(model)
        engine.execute(MotionCommand(target, speed=0.001, motion=motion))
        timeline = engine.timeline
        assert timeline.end - timeline.start > 60
        t = np.random.default_rng(12).uniform(timeline.start, timeline.end, 300)
        batch = timeline.sample(t)
        each = np.array([timeline.sample(x) for x in t.tolist()])
        assert (np.abs(batch - each) <= 2e-15 * np.maximum(1, np.abs(batch))).all()


def check_at_knots(timeline: Timeline) -> None:
    """One by one, indexed and many at once, the last segment that doesn't start after a time counts."""
    knots = np.array([timeline.start_of(i) for i in range(len(timeline))])
    t = np.sort(
        np.concatenate([np.repeat(knots, 100), np.linspace(timeline.start, timeline.end, 2000, endpoint=False)])
    )
    last = len(knots) - 1 - np.argmax(knots[::-1] <= t[:, None], axis=1)
    want = [timeline.segment(i).value(x)[0] for i, x in zip(last.tolist(), t.tolist(), strict=True)]
    for _ in range(2):
        assert np.array_equal(timeline.sample(t)[:, 0], want)
        assert np.array_equal([timeline.sample(x)[0] for x in t.tolist()], want)


def stairs(count: int, first: int = 0) -> list[np.ndarray]:
    """Coefficients of segments that can be told apart by their values."""
    return [np.full((1, 1), 1e-8 * (first + i)) for i in range(count)]


def test_a_segment_that_is_only_rounding_starts_no_later_than_what_follows_it():
    timeline = Timeline(np.zeros(1), 1000.0).edited(1000.0, [Piece([0.7] * 5, stairs(5), 1)])
    follows = np.nextafter(timeline.start_of(3), 0.0)
    new = Piece([timeline.start_of(3) - timeline.start_of(2), 1e-13], stairs(2, 5), 2)
    after = timeline.edited(timeline.start_of(2), [new], 4, float(follows))
    starts = [segment.start for segment in after.segments]
    assert starts == sorted(starts)
    assert starts[-1] == follows
    check_at_knots(after)


@pytest.mark.usefixtures("small_nodes")
def test_leaves_that_overlap_by_rounding_are_read_alike():
    rng = np.random.default_rng(373)
    durations = 1e-3 * 0.5 ** rng.integers(30, 52, 24)
    timeline = Timeline(np.zeros(1)).edited(0.0, [Piece(durations.tolist(), stairs(24), 1)])
    for _ in range(3):
        index = int(rng.integers(0, 12))
        start = timeline.start_of(index)
        timeline = timeline.edited(start, [], index, start + float(rng.uniform(0.0, 1.0)))
    starts = np.array([segment.start for segment in timeline.segments])
    assert (np.diff(starts) < 0).any()
    check_at_knots(timeline)


def test_segments_that_overlap_by_rounding_are_put_in_order():
    spans = [(0.0, 1.0), (1.0, 1e-10), (1.0 - 5e-10, 1.0), (2.0 - 5e-10, 1.0)]
    rows = stairs(len(spans))
    timeline = Timeline(np.zeros(1), 0.0, [PolynomialSegment(*at, a) for at, a in zip(spans, rows, strict=True)])
    assert [segment.start for segment in timeline.segments] == [0.0, 1.0, 1.0, 2.0 - 5e-10]
    check_at_knots(timeline)
