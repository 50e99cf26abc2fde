"""The uni-vector field, literal and capped: it brings a robot to the path in time, without chatter."""

from __future__ import annotations

import math
import os
import random

import numpy as np
import pytest

from robots.onboard.driving import IPR_LIMITS
from robots.onboard.path import Arc, MovingPath, Pivot
from robots.onboard.path_following import (
    FieldLaw,
    PathFollowingConfig,
    PathFollowingController,
    field_direction,
    field_slope,
)
from tests.robots.onboard.driven import Unicycle, assert_kept
from vrs.errors import InvalidValueError
from vrs.mobile import wrapped

MANY = int(os.environ.get("VRS_POSTURES", "60"))
"""How many random postures are tried; 1000 for the record."""
SLOW = PathFollowingConfig(cruise=0.3)
EIGHT = [Arc(1 / 0.8, math.tau * 0.8), Arc(-1 / 0.8, math.tau * 0.8)] * 3


def follow(pieces, posture, *, law, config=SLOW, seconds=18.0, tau=0.0):
    """Rows (t, posture, drive, projection) of a robot on a path from (0, 0, 0)."""
    path = MovingPath((0.0, 0.0, 0.0))
    for piece in pieces:
        assert path.append(piece)
    controller = PathFollowingController(path, config, law=law)
    robot, rows = Unicycle(posture, tau), []
    for i in range(round(seconds / config.period)):
        drive = controller.control(robot.posture)
        rows.append((i * config.period, robot.posture, drive, controller.projection))
        robot.run(drive, config.period)
    assert_kept([row[2] for row in rows], config.limits, config.period)
    return rows


def settled(rows, far=0.01, turned=0.087):
    """When the robot had come to within 1 cm and 5 deg for good [s]."""
    last = -0.05
    for t, posture, _, place in rows:
        theta = posture.theta + (0 if place.direction > 0 else math.pi)
        if abs(place.l) > far or abs(wrapped(theta - place.theta_d)) > turned:
            last = t
    return last + 0.05


@pytest.mark.parametrize("law", FieldLaw)
@pytest.mark.parametrize("tau", [0.0, 0.05, 0.1])
def test_random_postures_come_to_a_line(law, tau):
    """Within 2 m of it, to 1 cm and 5 deg within 15 s at 0.3 m/s; then ω is next to nothing and keeps its sign."""
    rng = random.Random(7)
    for _ in range(max(MANY // 6, 1)):
        start = rng.uniform(-1, 3), rng.uniform(-2, 2), rng.uniform(-math.pi, math.pi)
        rows = follow([Arc(0.0, 50.0)], start, law=law, tau=tau)
        came = settled(rows)
        assert came <= 15.0, start
        after = [row for row in rows if row[0] > came + 0.5]
        w = np.array([row[2].w for row in after])
        # Chatter: ω changes its sign more than once a second, by more than 0.02 rad/s a step.
        changes = np.count_nonzero((w[1:] * w[:-1] < 0) & (np.abs(np.diff(w)) > 0.02))
        assert changes <= max(1.0, len(w) * SLOW.period)
        assert math.sqrt(float(np.mean(w**2))) < 0.05
        assert max(abs(row[3].l) for row in after) < 0.005


@pytest.mark.parametrize(("pieces", "inner", "law"), [
    ([Arc(1.0, 40.0)], 0.5, FieldLaw.CAPPED),
    ([Arc(-1 / 0.6, 40.0)], 0.3, FieldLaw.CAPPED),
    (EIGHT, 0.4, FieldLaw.CAPPED),
    ([Arc(1.0, 40.0)], 0.5, FieldLaw.LITERAL),
])  # fmt: skip
@pytest.mark.parametrize("tau", [0.0, 0.1])
def test_and_to_circles_and_eights(pieces, inner, law, tau):
    """Literally, nothing foresees the curve: a circle of 1 m is kept to 1 cm, tighter ones aren't."""
    rng = random.Random(5)
    for _ in range(max(MANY // 12, 1)):
        beside = math.copysign(1.0, pieces[0].curvature) * rng.uniform(-1.5 if len(pieces) == 1 else -1.0, inner)
        start = rng.uniform(-0.3, 0.3), beside, rng.uniform(-math.pi, math.pi)
        rows = follow(pieces, start, law=law, tau=tau)
        came = settled(rows)
        assert came <= 15.0, start
        # Round and round without a jerk: ω goes with the path's curvature.
        after = [row for row in rows if row[0] > came + 0.5]
        speed_off = [abs(r[2].w - r[3].curvature * r[2].v) for r in after]
        assert float(np.mean(speed_off)) < 0.05


def test_literally_a_tight_curve_is_left():
    """What the capped law mends: at 0.3 m/s on 0.6 m the literal one stays over a centimetre outside."""
    rows = follow([Arc(1 / 0.6, 20.0)], (0, 0, 0), law=FieldLaw.LITERAL)
    assert min(abs(row[3].l) for row in rows if row[0] > 8) > 0.01
    rows = follow([Arc(1 / 0.6, 20.0)], (0, 0, 0), law=FieldLaw.CAPPED)
    assert max(abs(row[3].l) for row in rows if row[0] > 1) < 0.005


SHAPE = [Arc(0.0, 1.0), Pivot(math.pi / 2), Arc(0.0, 0.8), Arc(0.8, 0.8, -1), Pivot(-4.0), Arc(1.0, 1.0)]


@pytest.mark.parametrize(("law", "most"), [(FieldLaw.CAPPED, 0.008), (FieldLaw.LITERAL, 0.02)])
@pytest.mark.parametrize("tau", [0.0, 0.1])
def test_pivots_and_reversals_are_driven(law, most, tau):
    rows = follow(SHAPE, (0, 0, 0), law=law, config=PathFollowingConfig(), seconds=45, tau=tau)
    end = MovingPath((0, 0, 0))
    for piece in SHAPE:
        end.append(piece)
    _, posture, _, place = rows[-1]
    assert math.hypot(posture.x - end.end.x, posture.y - end.end.y) < most
    assert abs(posture.theta - end.end.theta) < math.radians(5)
    assert place.left < 0.006
    assert max(abs(row[3].l) for row in rows) < 0.02
    assert min(row[2].v for row in rows) < -0.1


def test_capped_speeds_foresee_curves_and_ends():
    """ω never needs more than its limit on a hairpin after a straight, and the end isn't overrun."""
    limits = IPR_LIMITS
    pieces = [Arc(0.0, 1.5), Arc(4.0, math.pi / 4.0), Arc(0.0, 1.0)]
    rows = follow(pieces, (0, 0, 0), law=FieldLaw.CAPPED, config=PathFollowingConfig(), seconds=25, tau=0.05)
    assert max(row[2].v for row in rows) > 0.45
    assert max(abs(row[3].l) for row in rows) < 0.015
    on_curve = [row[2].v for row in rows if row[3].curvature == 4.0]
    assert max(on_curve) < 1.1 * limits.w_max / 4.0
    assert rows[-1][3].left < 0.006
    literal = follow(pieces, (0, 0, 0), law=FieldLaw.LITERAL, config=PathFollowingConfig(), seconds=25, tau=0.05)
    assert max(abs(row[3].l) for row in literal) > 0.05


@pytest.mark.parametrize("beside", [0.0, 1e-9, 0.5, -0.5])
def test_an_opposite_heading_is_no_dead_end(beside):
    """The field's direction, reversed to the last digit and with noise about it: one side, and there in time."""
    aim = field_direction(beside, 0.0, SLOW)
    rows = follow([Arc(0.0, 50.0)], (1.0, beside, aim + math.pi), law=FieldLaw.CAPPED)
    assert settled(rows) <= 15.0
    path = MovingPath((0, 0, 0))
    path.append(Arc(0.0, 50.0))
    controller, rng = PathFollowingController(path, SLOW), random.Random(1)
    signs = {math.copysign(1, controller.control((1.0, 0.0, math.pi + rng.gauss(0, 0.02))).w) for _ in range(50)}
    assert len(signs) == 1


def test_the_slope_is_the_fields_derivative():
    config = PathFollowingConfig(l_floor=1e-4)
    for l in (-1.3, -0.2, -0.01, 0.001, 0.03, 0.7, 2.0):  # noqa: E741
        h = 1e-6 * abs(l)
        slope = (field_direction(l + h, 0.3, config) - field_direction(l - h, 0.3, config)) / (2 * h)
        assert field_slope(l, config) == pytest.approx(slope, rel=1e-5)
    assert field_direction(0.2, 1.0, config) == pytest.approx(1.0 - math.atan(2.0 * 0.2 ** (1 / 1.5)))
    assert field_slope(0.0, config) == field_slope(1e-4, config)


def test_literal_is_equation_15_where_no_limit_holds():
    """One step, by hand: far enough from the path, at a small error, moving."""
    config = PathFollowingConfig(period=0.001, lag=0.0)
    path = MovingPath((0, 0, 0))
    path.append(Arc(0.0, 0.1))
    controller = PathFollowingController(path, config, law=FieldLaw.LITERAL)
    x, l = 0.04, 0.3  # noqa: E741
    theta = field_direction(l, 0.0, config) - 0.02
    h = 1e-6
    gradient = (field_direction(l + h, 0.0, config) - field_direction(l - h, 0.0, config)) / (2 * h)
    v = 1.0 * (0.1 - x)
    w = 2.0 * math.sqrt(0.02) + math.sin(theta) * gradient * v
    drive = controller.control((x, l, theta), v_before=v)
    assert (drive.v, drive.w) == pytest.approx((v, w), abs=1e-6)


@pytest.mark.parametrize("c", [1.0, 2.0, 2.5, 0.5, math.nan])
def test_the_exponent_is_between_1_and_2(c):
    with pytest.raises(InvalidValueError, match="c must be"):
        PathFollowingConfig(c=c)


@pytest.mark.parametrize("bad", [{"g": 0.0}, {"K_v": -1.0}, {"period": 0.0}, {"lag": math.inf}])
def test_impossible_constants_are_refused(bad):
    with pytest.raises(InvalidValueError):
        PathFollowingConfig(**bad)


def test_a_pivot_that_was_overshot_counts_as_driven():
    """It isn't turned back: the field beside what follows does that on the way."""
    path = MovingPath((0.0, 0.0, 0.0))
    for piece in (Pivot(1.0), Arc(0.0, 2.0)):
        path.append(piece)
    controller = PathFollowingController(path, SLOW)
    assert controller.control((0.0, 0.0, 0.0)).w > 0
    assert controller.control((0.0, 0.0, 1.0 + 2 * SLOW.arrival_angle)).v > 0
    assert controller.projection.turn is None


def test_a_curve_is_begun_before_the_robot_is_there():
    """By as much as the motors take to answer: else each curve is left at its beginning."""
    for ahead, turns in ((0.02, True), (0.2, False)):
        path = MovingPath((0.0, 0.0, 0.0))
        for piece in (Arc(0.0, 1.0), Arc(1.5, 1.0)):
            path.append(piece)
        w = PathFollowingController(path, SLOW).control((1.0 - ahead, 0.0, 0.0), v_before=0.3).w
        assert (w > 0.3) is turns
