"""Values of a timeline: caches, threads, times of every kind, one by one and many at once."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from robots import puma560
from tests.vrs.pieces import N, piece
from vrs import (
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
from vrs.errors import NonFiniteTimeError
from vrs.segment import Piece


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
        assert any(node.index and node.index.columns for node in tau.root.children)
        assert np.array_equal(each[:12], cold)
        assert np.array_equal(each, [tau.sample(x) for x in t.tolist()])
        many = tau.sample(t)
        assert any(node.stack is not None for node in tau.root.children)
        assert np.array_equal(many[:8], few)
        assert (np.abs(many - each) <= 1e-14 * np.maximum(1, np.abs(many))).all()


def test_caches_are_bounded(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tree, "LEAF", 32)
    monkeypatch.setattr(evaluation.STACKS, "most", 2)
    monkeypatch.setattr(evaluation.INDEXES, "most", 2)
    rng = np.random.default_rng(4)
    timeline = Timeline(np.zeros(N))
    for k in range(3000):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 5)])
    t = np.linspace(timeline.start, timeline.end, 4000)
    first = timeline.sample(t)
    each = [timeline.sample(x) for x in t.tolist()]
    nodes = timeline.root.children
    assert len(nodes) > 5
    assert sum(node.stack is not None for node in nodes) <= 2
    assert sum(bool(node.index and node.index.columns) for node in nodes) <= 2
    assert np.array_equal(timeline.sample(t), first)
    assert np.array_equal([timeline.sample(x) for x in t.tolist()], each)


def test_of_a_plan_that_grows_the_newest_versions_alone_keep_caches(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tree, "LEAF", 32)
    rng = np.random.default_rng(6)
    timeline = Timeline(np.zeros(N))
    for k in range(60):
        timeline = timeline.edited(timeline.end, [piece(rng, k + 1, 5)])
    versions = []
    for k in range(12):
        timeline = timeline.edited(timeline.end, [piece(rng, 100 + k, 1)])
        versions.append(timeline)
        t = np.linspace(timeline.start, timeline.end, 400)
        many = timeline.sample(t)
        each = np.array([timeline.sample(x) for x in t.tolist()])
        assert (np.abs(many - each) <= 1e-14 * np.maximum(1, np.abs(many))).all()
    nodes = [node for tau in versions for node in evaluation.places_of(tau.root, tau.height)[2]]
    assert 1 <= len({id(node) for node in nodes if node.stack is not None}) <= 4
    assert 1 <= len({id(node) for node in nodes if node.index and node.index.columns}) <= 4


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
    monkeypatch.setattr(evaluation, "DENSE", 200)
    monkeypatch.setattr(evaluation, "GATHERED", 400)
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
