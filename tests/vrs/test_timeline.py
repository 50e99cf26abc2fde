from __future__ import annotations

import json

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vrs import ArcSegment, PolynomialSegment, Timeline
from vrs.codec import from_json, from_msgpack, segment_from_wire, segment_to_wire, to_json, to_msgpack
from vrs.errors import FormatError, InvalidValueError, NonFiniteTimeError
from vrs.segment import HOLD, Piece


def drifting(pieces: int, n: int = 6, seed: int = 0) -> Timeline:
    """A continuous timeline of random cubics."""
    rng = np.random.default_rng(seed)
    q = rng.normal(size=n)
    timeline = Timeline(q, 1.0)
    for k in range(pieces):
        a = rng.normal(size=(4, n))
        a[0] = timeline.final()
        timeline = timeline.edited(timeline.end, [Piece([float(rng.uniform(0.1, 1))], [a], k + 1)])
    return timeline


def test_holds_before_the_start_and_after_the_end():
    timeline = drifting(3)
    assert np.array_equal(timeline.sample(-10.0), timeline.initial)
    assert np.array_equal(timeline.sample(timeline.end + 5), timeline.final())
    for order in (1, 2, 3):
        assert not timeline.sample([-10.0, timeline.end, 1e6], derivative=order).any()


def leaves(node: object, height: int) -> list:
    return [node] if height == 0 else [leaf for child in node.children for leaf in leaves(child, height - 1)]


def leaf_of(timeline: Timeline, index: int) -> object:
    for leaf in leaves(timeline.root, timeline.height):
        if index < leaf.count:
            return leaf
        index -= leaf.count
    raise IndexError(index)


def test_knots_are_the_segments_starts_and_first_velocities_across_leaves():
    timeline = drifting(130)
    timeline = timeline.edited(timeline.end, [Piece([0.5], [timeline.final()[None]], HOLD)])
    timeline = timeline.edited(20.0, [Piece([2.0], [np.ones((3, 6))], 999)], tail=60, tail_start=23.0)
    for low, high in ((0, len(timeline)), (0, 1), (40, 41), (30, 90), (47, 48), (5, 5)):
        starts, qd = timeline.knots(low, high)
        assert starts.tolist() == [timeline.start_of(i) for i in range(low, high)]
        assert np.array_equal(qd, np.array([timeline.state_after(i).qd for i in range(low, high)]).reshape(-1, 6))
        owners = dict.fromkeys(timeline.owner_of(i) for i in range(low, high))
        assert timeline.owners(low, high) == tuple(owner for owner in owners if owner != HOLD)


def test_scalar_and_batch_agree_and_with_the_segments():
    timeline = drifting(400)
    t = np.random.default_rng(1).uniform(0, timeline.end + 1, 500)
    t[:50] = [timeline.start_of(i) for i in range(50)]
    for order in range(4):
        batch = timeline.sample(t, derivative=order)
        each = np.array([timeline.sample(x, derivative=order) for x in t])
        if order:
            assert np.array_equal(batch, each)
        assert (np.abs(batch - each) <= 1e-14 * np.maximum(1, np.abs(batch))).all()
        for x, value in zip(t, batch, strict=True):
            i = timeline.index_at(x)
            if 0 <= i < len(timeline):
                assert np.allclose(timeline.segment(i).value(x, derivative=order), value, rtol=0, atol=1e-9)


def test_derivatives_are_the_slopes():
    timeline = drifting(20)
    t = np.array([timeline.start_of(i) + 0.4 * timeline.segment(i).duration for i in range(20)])
    for order in range(3):
        dt = 1e-6
        slope = timeline.sample(t + dt, derivative=order) - timeline.sample(t - dt, derivative=order)
        assert np.allclose(slope / (2 * dt), timeline.sample(t, derivative=order + 1), rtol=1e-5, atol=1e-5)


def test_lookup_is_half_open_at_every_knot():
    timeline = drifting(700)
    shifted = timeline.edited(timeline.start_of(300), [Piece([0.123456789], [np.zeros((1, 6))], 0)], 300, 1e3 / 3)
    for tau in (timeline, shifted):
        for i in range(len(tau)):
            knot = tau.start_of(i)
            assert tau.index_at(knot) == i
            assert tau.index_at(np.nextafter(knot, -np.inf)) == i - 1
        assert tau.index_at(tau.end) == len(tau)


def test_an_edit_leaves_the_old_value_alone_and_shares_what_it_keeps():
    timeline = drifting(500)
    before = list(timeline.segments)
    cut = timeline.start_of(250) + 0.05
    a = np.zeros((3, 6))
    a[0] = timeline.sample(cut)
    edited = timeline.edited(cut, [Piece([0.5], [a], 999)], 251, timeline.start_of(251) + 7.25)
    assert list(timeline.segments) == before
    assert list(edited.segments[:250]) == before[:250]
    assert edited.segment(250).coefficients is not None
    assert np.array_equal(edited.segment(250).coefficients, before[250].coefficients)
    assert edited.segment(250).duration == pytest.approx(0.05)
    assert edited.segment(251).command_id == 999
    for new, old in zip(edited.segments[252:], before[251:], strict=True):
        assert np.array_equal(new.coefficients, old.coefficients)
        assert new.duration == old.duration
        assert new.start == pytest.approx(old.start + 7.25, abs=1e-9)
    assert leaf_of(edited, len(edited) - 1) is leaf_of(timeline, len(timeline) - 1)
    assert leaf_of(edited, 0) is leaf_of(timeline, 0)
    assert edited.version == timeline.version + 1


def test_a_cut_after_the_end_holds_and_before_the_start_begins_there():
    timeline = drifting(2)
    late = timeline.edited(timeline.end + 2, [Piece([1.0], [np.array([timeline.final()])], 9)])
    assert late.segment(2).command_id is None
    assert late.segment(2).duration == pytest.approx(2)
    assert np.array_equal(late.sample(timeline.end + 1), timeline.final())
    early = timeline.edited(-3.0, [Piece([1.0], [timeline.initial[None]], 9)])
    assert early.start == -3.0
    assert len(early) == 1


def test_many_edits_anywhere_stay_exact():
    rng = np.random.default_rng(3)
    timeline = drifting(300)
    for k in range(2000):
        i = int(rng.integers(1, len(timeline)))
        a = np.array([timeline.sample(timeline.start_of(i))])
        timeline = timeline.edited(
            timeline.start_of(i), [Piece([0.01], [a], 5000 + k)], i, timeline.start_of(i) + 0.01
        )
    ends = np.array([s.end for s in timeline.segments])
    starts = np.array([s.start for s in timeline.segments])
    assert np.abs(ends[:-1] - starts[1:]).max() < 1e-9
    assert len(timeline) == 2300
    assert len(leaves(timeline.root, timeline.height)) < 200


@given(st.integers(0, 60), st.integers(1, 8), st.integers(0, 10**6))
@settings(max_examples=40, deadline=None)
def test_round_trip_is_exact(pieces: int, n: int, seed: int):
    timeline = drifting(pieces, n, seed)
    for write, read in ((to_json, from_json), (to_msgpack, from_msgpack)):
        again = read(write(timeline))
        assert again == timeline
        assert again.version == timeline.version
        assert write(again) == write(timeline)


def test_documents_name_their_schema_and_wrong_ones_are_refused():
    timeline = drifting(3)
    document = json.loads(to_json(timeline))
    assert document["schema"] == "vrs.timeline"
    wrong = [
        b"", b"{}", b"\xff\xfe", b"[" * 10000,
        json.dumps({**document, "schema_version": 2}).encode(),
        json.dumps({**document, "initial": document["initial"][:5]}).encode(),
        json.dumps({**document, "extra": 1}).encode(),
        json.dumps({**document, "segments": document["segments"][1:]}).encode(),
        to_json(timeline).replace(b'"duration":', b'"duration":-', 1),
        to_json(timeline).replace(b"[[", b'[["a",', 1),
    ]  # fmt: skip
    for data in wrong:
        with pytest.raises(FormatError):
            from_json(data)
        with pytest.raises(FormatError):
            from_msgpack(data)


def test_segments_of_both_kinds_carry_a_tag():
    arc = ArcSegment(1.0, 2.0, (0.1, 0.2, 0.3), 0.5, -0.4, 7)
    line = drifting(1).segment(0)
    for segment, tag in ((arc, "arc"), (line, "polynomial")):
        wire = segment_to_wire(segment)
        assert json.loads(msgspec.json.encode(wire))["type"] == tag
        assert segment_from_wire(wire) == segment


def test_an_arc_agrees_with_its_differential_equation():
    for w in (0.0, 1e-9, 0.7, -1.3):
        arc = ArcSegment(2.0, 3.0, (1.0, -1.0, 0.5), 0.4, w)
        t = np.linspace(2, 5, 31)
        dt = 1e-6
        rate = (arc.value(t + dt) - arc.value(t - dt)) / (2 * dt)
        theta = arc.value(t)[:, 2]
        wanted = np.stack([0.4 * np.cos(theta), 0.4 * np.sin(theta), np.full(31, w)], 1)
        assert np.allclose(rate, wanted, atol=1e-8)
        assert np.allclose(arc.value(2.0), arc.posture)


@pytest.mark.parametrize("t", [np.nan, np.inf, [0.0, np.nan], "1", None, [[1.0]], [1j]])
def test_times_must_be_finite(t):
    with pytest.raises(NonFiniteTimeError):
        drifting(1).sample(t)


@pytest.mark.parametrize("derivative", [-1, 4, 1.5, "1", True, None])
def test_derivatives_are_0_to_3(derivative):
    with pytest.raises(InvalidValueError, match="0, 1, 2 or 3"):
        drifting(1).sample(1.0, derivative=derivative)


def test_segments_that_do_not_fit_together_are_refused():
    one = PolynomialSegment(0.0, 1.0, np.zeros((2, 3)))
    jump = PolynomialSegment(1.0, 1.0, np.ones((2, 3)))
    gap = PolynomialSegment(1.5, 1.0, np.zeros((2, 3)))
    wide = PolynomialSegment(1.0, 1.0, np.zeros((2, 4)))
    for bad in (jump, gap, wide):
        with pytest.raises(InvalidValueError):
            Timeline(np.zeros(3), 0.0, [one, bad])
    for arguments in ((0.0, 0.0, np.zeros((1, 2))), (np.nan, 1.0, np.zeros((1, 2))), (0.0, 1.0, [[np.inf]])):
        with pytest.raises(InvalidValueError):
            PolynomialSegment(*arguments)


def test_values_cannot_be_changed():
    timeline = drifting(2)
    with pytest.raises(ValueError, match="read-only"):
        timeline.segments[0].coefficients[0, 0] = 1.0
    with pytest.raises(AttributeError):
        timeline.segments[0].start = 3.0
    with pytest.raises(AttributeError):
        timeline.end = 3.0
    timeline.sample(timeline.end)[0] = 99.0
    timeline.final()[0] = 99.0
    assert 99.0 not in timeline.final()


def test_the_view_behaves_like_a_sequence():
    timeline = drifting(5)
    view = timeline.segments
    assert len(view) == 5
    assert view[-1] == view[4]
    assert view[1:3] == (view[1], view[2])
    assert [s.command_id for s in view] == [1, 2, 3, 4, 5]
    with pytest.raises(IndexError):
        view[5]
    assert timeline.owner_of(0) != HOLD
