"""The IPR as a value."""

from __future__ import annotations

import dataclasses
import math

import pytest

from robots import ipr
from vrs import RobotModel
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, MobileModel


@pytest.mark.parametrize("kind", ["ipr", "micro"])
def test_the_papers_limits_and_sizes(kind):
    model = ipr.model(kind)
    assert isinstance(model, MobileModel)
    assert not isinstance(model, RobotModel)
    assert (model.name, model.period) == ("ipr", 0.1)
    assert (model.limits.v_max, model.limits.w_max, model.limits.a_max) == (0.5, math.radians(45), 0.52)
    body = model.body
    given = {"ipr": (0.52, 0.45, 0.75, 75.0), "micro": (0.075, 0.075, 0.075, 0.43)}[kind]
    assert (body.length, body.width, body.height, body.mass) == given
    assert model.wheels.base < body.width
    assert 2 * model.wheels.radius < body.height


def test_the_circle_holds_the_body():
    body = ipr.model().body
    corners = [(s * body.length / 2 - body.axle_offset, t * body.width / 2) for s in (-1, 1) for t in (-1, 1)]
    assert body.radius == pytest.approx(max(math.hypot(*corner) for corner in corners))


def test_turning_on_the_spot_keeps_the_rims_within_the_linear_limit():
    model = ipr.model()
    assert model.limits.alpha_max * model.wheels.base / 2 == pytest.approx(model.limits.a_max)


def test_a_model_is_frozen_and_equal_to_its_like():
    model = ipr.model()
    assert model == ipr.model()
    assert model != ipr.model("micro")
    with pytest.raises(dataclasses.FrozenInstanceError):
        model.period = 1.0
    slow = DriveLimits(0.1, 0.1, 0.1, 0.1)
    assert ipr.model(limits=slow, period=0.05).limits is slow
    assert ipr.model(period=0.05).period == 0.05


@pytest.mark.parametrize("bad", [{"kind": "big"}, {"period": 0.0}])
def test_no_such_robot(bad):
    with pytest.raises(InvalidValueError):
        ipr.model(**bad)
