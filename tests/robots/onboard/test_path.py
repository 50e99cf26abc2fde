"""Paths of arcs and pivots: exact against brute force, no capture at crossings, bounded memory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.onboard.driving import Posture
from robots.onboard.path import Arc, MovingPath, Pivot
from vrs import ArcSegment
from vrs.errors import InvalidValueError
from vrs.mobile import wrapped

POSTURES = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-10, 10))
CURVATURES = st.one_of(st.just(0.0), st.floats(-3, 3), st.floats(-1e-7, 1e-7))


def points(start, arcs, step):
    """Brute force: (s, x, y, θ_d) every `step` metres, by the exact arcs of the engine, one after the other."""
    rows, posture, s0 = [], np.asarray(start, float), 0.0
    for arc in arcs:
        segment = ArcSegment(0.0, arc.length, tuple(posture), float(arc.direction), arc.curvature)
        s = np.linspace(0.0, arc.length, max(int(arc.length / step), 2))
        at = segment.value(s)
        turned = 0.0 if arc.direction > 0 else math.pi
        rows.append(np.column_stack([s0 + s, at[:, :2], at[:, 2] + turned]))
        posture, s0 = at[-1], s0 + arc.length
    return np.concatenate(rows)


@given(
    POSTURES, st.lists(st.tuples(CURVATURES, st.floats(0.05, 2)), min_size=1, max_size=5), st.sampled_from([1, -1])
)
@settings(max_examples=60, deadline=None)
def test_the_end_and_the_length_are_exact(start, shape, direction):
    arcs = [Arc(k, length, direction) for k, length in shape]
    path = MovingPath(start)
    assert all(path.append(arc) for arc in arcs)
    s, x, y, theta_d = points(start, arcs, 0.5)[-1]
    assert (path.length, path.end.x, path.end.y) == pytest.approx((s, x, y), abs=1e-12)
    assert path.end.theta + (0 if direction > 0 else math.pi) == pytest.approx(theta_d, abs=1e-12)


@given(
    POSTURES,
    st.lists(st.tuples(CURVATURES, st.floats(0.1, 2)), min_size=1, max_size=4),
    st.sampled_from([1, -1]),
    st.floats(0, 1),
    st.floats(-0.3, 0.3),
    st.floats(-0.2, 0.2),
)
@settings(max_examples=60, deadline=None)
def test_projections_equal_brute_force(start, shape, direction, share, side, shift):
    """From just before a point of the path: nearest point on the way down, its side, direction and curvature."""
    arcs = [Arc(k, length, direction) for k, length in shape]
    dense = points(start, arcs, 1e-3)
    i = int(share * (len(dense) - 1))
    x, y, theta_d = dense[i, 1:]
    path = MovingPath(start)
    for arc in arcs:
        path.append(arc)
    begin = max(i - 40, 0)
    # Walk there point by point, so that what has been passed is known.
    for row in dense[0 : begin + 1 : 80]:
        path.locate((row[1], row[2], 0.0))
    passed = path.locate((*dense[begin, 1:3], 0.0)).s
    assert passed == pytest.approx(dense[begin, 0], abs=1e-6) or passed > dense[begin, 0] - 1e-6
    robot = (
        x - side * math.sin(theta_d) + shift * math.cos(theta_d),
        y + side * math.cos(theta_d) + shift * math.sin(theta_d),
        0.0,
    )
    ahead = dense[dense[:, 0] >= passed - 1e-9]
    far = np.hypot(ahead[:, 1] - robot[0], ahead[:, 2] - robot[1])
    rising = np.flatnonzero(np.diff(far) > 1e-12)
    j = int(rising[0]) if len(rising) else len(far) - 1
    found = path.locate(robot)
    assert found.s == pytest.approx(ahead[j, 0], abs=5e-3) or far[j] == pytest.approx(
        math.hypot(found.x - robot[0], found.y - robot[1]), abs=1e-5
    )
    assert found.left == pytest.approx(path.length - found.s, abs=1e-12)
    k = int(np.argmin(np.abs(dense[:, 0] - found.s)))
    assert (found.x, found.y) == pytest.approx(tuple(dense[k, 1:3]), abs=1e-3)
    assert abs(wrapped(found.theta_d - dense[k, 3])) < 5e-3
    beside = -math.sin(found.theta_d) * (robot[0] - found.x) + math.cos(found.theta_d) * (robot[1] - found.y)
    assert found.l == pytest.approx(beside, abs=1e-12)
    if min(found.s - passed, found.left) > 1e-6:
        # The nearest point of all that's on the way: the robot is straight beside it.
        assert abs(found.l) == pytest.approx(math.hypot(found.x - robot[0], found.y - robot[1]), abs=1e-6)


def test_left_is_positive_also_in_reverse():
    ahead, back = MovingPath((0, 0, 0)), MovingPath((0, 0, 0))
    ahead.append(Arc(0.0, 2.0))
    back.append(Arc(0.0, 2.0, -1))
    assert ahead.locate((1.0, 0.3, 0.0)).l == pytest.approx(0.3)
    found = back.locate((-1.0, 0.3, 0.0))
    assert (found.l, found.s, abs(wrapped(found.theta_d))) == pytest.approx((-0.3, 1.0, math.pi))


def test_crossings_capture_nobody():
    """Round a figure of eight with noise: s grows evenly although the other branch is as near at the crossing."""
    path, R = MovingPath((0, 0, 0)), 0.5
    arcs = [Arc(1 / R, math.tau * R), Arc(-1 / R, math.tau * R)] * 3
    for arc in arcs:
        path.append(arc)
    rng = np.random.default_rng(3)
    for s, x, y, theta_d in points((0, 0, 0), arcs, 0.01):
        noise = rng.normal(0, 0.005, 2)
        found = path.locate((x + noise[0], y + noise[1], theta_d))
        assert -0.02 < found.s - s < 0.05
        assert abs(found.l) < 0.03


def test_stops_are_pivots_and_reversals():
    path = MovingPath((0, 0, 0))
    for piece in [Arc(0.0, 1.0), Arc(0.5, 1.0), Pivot(4.0), Arc(0.0, 0.5), Arc(0.0, 0.25, -1), Arc(1.0, 1.0, -1)]:
        assert path.append(piece)
    assert path.length == pytest.approx(3.75)
    found = path.locate((0.25, 0.0, 0.0))
    assert (found.to_stop, found.left, found.turn) == pytest.approx((1.75, 3.5, None))
    assert list(path.ahead(0.8)) == [(0.0, 0.0), (pytest.approx(0.75), 0.5)]
    assert list(path.ahead(9.0))[-1] == (pytest.approx(0.75), 0.5)
    path.locate((5.0, 0.0, 0.0))
    assert path.pass_stop()
    at = points((0, 0, 0), [Arc(0.0, 1.0), Arc(0.5, 1.0)], 0.5)[-1]
    theta, turned = at[3], 0.0
    assert path.locate((at[1], at[2], theta)).turn == pytest.approx(4.0)
    while turned < 4.0:
        turned += 0.3
        found = path.locate((at[1], at[2], wrapped(theta + turned)))
        assert found.turn == pytest.approx(4.0 - turned)
        assert found.to_stop == 0.0
    assert path.pass_stop()
    assert path.locate((at[1], at[2], theta + 4.0)).to_stop == pytest.approx(0.5)
    assert path.pass_stop()
    found = path.locate((at[1] + 0.5 * math.cos(theta + 4), at[2] + 0.5 * math.sin(theta + 4), 0.0))
    assert (found.direction, found.to_stop, found.left) == pytest.approx((-1, 1.25, 1.25))
    assert not path.pass_stop()


def test_an_empty_path_is_a_point():
    path = MovingPath((1.0, 2.0, 0.5))
    found = path.locate((1.0, 2.0, 0.0))
    assert (found.left, found.to_stop, found.theta_d, found.l) == (0.0, 0.0, 0.5, 0.0)
    assert not path.pass_stop()
    assert list(path.ahead(1.0)) == []


def test_equal_pieces_are_one_and_passed_ones_are_forgotten():
    """A day of driving at ten commands a second, here ten minutes of it: some pieces are kept, never more."""
    path = MovingPath((0, 0, 0))
    rng = np.random.default_rng(1)
    most, x = 0, Posture(0, 0, 0)
    for i in range(6_000):
        if i % 50 == 0:
            v, w = (0.3, float(rng.uniform(-0.5, 0.5)))
        assert path.drive(v, w + (1e-3 if i % 3 else 0.0), duration=0.1)
        if i > 20:
            x = Posture(*path.end)
            path.locate(x)
        most = max(most, len(path))
    assert most < 60
    assert path.length == pytest.approx(6_000 * 0.03)
    same = MovingPath((0, 0, 0))
    for _ in range(1000):
        same.drive(0.3, 0.2, duration=0.1)
    assert len(same) == 1


def test_a_full_path_refuses_and_stays_as_it_was():
    path = MovingPath((0, 0, 0), capacity=2)
    assert path.drive(0.3, 0.1, duration=0.1)
    assert path.drive(0.3, 0.2, duration=0.1)
    before = path.end, path.length
    assert not path.drive(0.3, 0.3, duration=0.1)
    assert (path.end, path.length) == before


COMMANDS = st.lists(
    st.tuples(st.sampled_from([0.0, 0.3, -0.2, 1e-4, 0.5]), st.sampled_from([0.0, 0.7, -0.3, 1e-3])), max_size=60
)


@given(COMMANDS, POSTURES)
@settings(deadline=None)
def test_the_generator_restores_the_virtual_robots_path(commands, start):
    """Its end is the composition of the exact arcs, whatever is driven as a pivot; the pieces say the same."""
    path = MovingPath(start)
    posture = np.asarray(start)
    for v, w in commands:
        assert path.drive(v, w, duration=0.1)
        posture = ArcSegment(0.0, 0.1, tuple(posture), v, w).value(0.1)
    assert path.end == pytest.approx(tuple(posture), abs=1e-10)
    turned = sum(p.angle if isinstance(p, Pivot) else p.curvature * p.length for p in path.pieces())
    assert start[2] + turned == pytest.approx(posture[2], abs=1e-10)
    driven = sum(abs(v) * 0.1 for v, w in commands if abs(v) > 1e-3 * abs(w))
    assert path.length == pytest.approx(driven, abs=1e-10)


@pytest.mark.parametrize("bad", [lambda: Arc(0.0, 0.0), lambda: Arc(math.nan, 1.0), lambda: Arc(0.0, 1.0, 0),
                                 lambda: Pivot(0.0), lambda: MovingPath((0, 0, math.inf)),
                                 lambda: MovingPath((0, 0, 0)).drive(math.nan, 0.0, duration=0.1)])  # fmt: skip
def test_impossible_values_are_refused(bad):
    with pytest.raises(InvalidValueError):
        bad()


def test_what_has_been_passed_stays_passed():
    path = MovingPath((0, 0, 0))
    path.append(Arc(0.0, 2.0))
    assert path.locate((1.0, 0.1, 0.0)).s == pytest.approx(1.0)
    assert path.locate((0.4, 0.1, 0.0)).s == pytest.approx(1.0)


def test_pivots_to_opposite_sides_are_two():
    """Else a turn to the left and back would be no turn, and the robot would never look aside."""
    path = MovingPath((0, 0, 0))
    for angle in (1.0, 0.5, -0.7):
        path.append(Pivot(angle))
    assert path.pieces() == [Pivot(1.5), Pivot(-0.7)]
    assert path.end.theta == pytest.approx(0.8)
