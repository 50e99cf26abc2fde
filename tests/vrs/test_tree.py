"""The tree below a timeline, against a list that does the same slowly; rounding, copies, memory."""

from __future__ import annotations

import copy
import pickle
import tracemalloc
from dataclasses import dataclass, replace
from math import perm

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.vrs.pieces import N, piece
from vrs import ArcSegment, PolynomialSegment, Timeline, tree
from vrs.codec import from_json, to_json
from vrs.errors import FormatError, InvalidValueError
from vrs.segment import HOLD, Piece


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
    assert timeline.height > 4
    first = {timeline.owner_of(i): timeline.start_of(i) for i in reversed(range(600))}
    assert all(first[k] == stamps[k] for k in range(1, 140))


@pytest.mark.usefixtures("small_nodes")
def test_a_tree_shrinks_with_what_is_dropped():
    rng = np.random.default_rng(1)
    timeline = Timeline(np.zeros(N))
    for k in range(60):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 5)])
    assert timeline.height >= 4
    short = timeline.edited(timeline.start_of(2), [piece(rng, 99, 1)])
    assert len(short) == 3
    assert short.height == 1
    assert len(short.edited(short.start, [])) == 0


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
    shifts = [shift for node, _ in nodes_of(timeline.root, timeline.height) for shift in node.offsets]
    assert any(shifts)


def nodes_of(node: object, height: int) -> list:
    below = [pair for child in node.children for pair in nodes_of(child, height - 1)] if height > 1 else []
    return [(node, height), *below]


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
