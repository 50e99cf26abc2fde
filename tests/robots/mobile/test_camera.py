"""The camera's axes keep their limits whatever they're told, and its lens is where the head is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.ipr.parameters import IPR
from robots.ipr.shapes import SCREEN_SIZE, headless, ipr_shapes, screen_pose
from robots.mobile.camera import Lens, Look, PanTilt, PanTiltConfig, lens_pose
from robots.robot import HeadCamera, load
from vrs.errors import InvalidValueError
from vrs.model import Array

CAMERA = load("ipr").device(HeadCamera)
assert CAMERA is not None
CONFIG = PanTiltConfig()
share = st.floats(0.0, 1.0)
aims = st.lists(st.tuples(st.floats(0.0, 1.5), share, share), min_size=1, max_size=6)


def target(a: float, b: float) -> Look:
    return Look(CONFIG.pan * (2 * a - 1), -CONFIG.down + b * (CONFIG.down + CONFIG.up))


@given(aims)
def test_no_limit_is_passed_whatever_is_asked_for_on_the_way(asked: list[tuple[float, float, float]]) -> None:
    axes, k, step = PanTilt(CONFIG), 0, 0.004
    path = [axes.look(0.0)]
    for wait, a, b in asked:
        axes.aim(*target(a, b), now=k * step)
        for _ in range(int(wait / step)):
            k += 1
            path.append(axes.look(k * step))
    while axes.moves(k * step):
        k += 1
        path.append(axes.look(k * step))
    check(np.array(path), step)
    assert path[-1] == pytest.approx(axes.target, abs=1e-9)
    assert axes.target == target(*asked[-1][1:])


def check(path: Array, step: float) -> None:
    """Nowhere outside, nowhere too fast, and no change of speed that's too quick, by finite differences."""
    assert (path >= [-CONFIG.pan - 1e-9, -CONFIG.down - 1e-9]).all()
    assert (path <= [CONFIG.pan + 1e-9, CONFIG.up + 1e-9]).all()
    assert np.abs(np.diff(path, axis=0)).max(initial=0.0) <= CONFIG.speed * step * (1 + 1e-6)
    assert np.abs(np.diff(path, n=2, axis=0)).max(initial=0.0) <= CONFIG.acceleration * step**2 * (1 + 1e-6)


@given(share, share, st.floats(0.0, 1.2))
def test_a_change_of_mind_moves_neither_place_nor_speed_at_once(a: float, b: float, at: float) -> None:
    axes, h = PanTilt(CONFIG), 1e-5
    axes.aim(*target(0.9, 0.1), now=0.0)
    place, speed = (np.array(axes.look(at)), (np.array(axes.look(at)) - np.array(axes.look(at - h))) / h)
    axes.aim(*target(a, b), now=at)
    assert axes.look(at) == pytest.approx(place, abs=1e-9)
    after = (np.array(axes.look(at + h)) - np.array(axes.look(at))) / h
    assert after == pytest.approx(speed, abs=2.1 * CONFIG.acceleration * h)


def test_from_rest_it_takes_the_time_of_the_slower_axis() -> None:
    axes = PanTilt(CONFIG)
    axes.aim(CONFIG.pan, 0.1, now=3.0)
    least = CONFIG.pan / CONFIG.speed + CONFIG.speed / CONFIG.acceleration
    assert axes.moves(3.0 + least - 1e-6)
    assert not axes.moves(3.0 + least + 1e-6)
    assert axes.look(2.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("pan", "tilt", "now"),
    [
        (1.8, 0.0, 1.0),
        (0.0, 0.8, 1.0),
        (0.0, -0.7, 1.0),
        (math.nan, 0.0, 1.0),
        (0.0, math.inf, 1.0),
        (0.0, 0.0, 0.1),
    ],
)
def test_what_cannot_be_is_refused_and_changes_nothing(pan: float, tilt: float, now: float) -> None:
    axes = PanTilt(CONFIG)
    axes.aim(0.5, 0.2, now=0.5)
    expected = [axes.look(t) for t in (0.6, 0.9, 3.0)]
    with pytest.raises(InvalidValueError):
        axes.aim(pan, tilt, now=now)
    assert [axes.look(t) for t in (0.6, 0.9, 3.0)] == expected
    assert axes.target == (0.5, 0.2)


@pytest.mark.parametrize("given", [{"width": 100}, {"height": 47}, {"view": 3.0}, {"near": 0.0}, {"width": True}])
def test_a_lens_keeps_its_bounds(given: dict[str, float]) -> None:
    with pytest.raises(InvalidValueError):
        Lens(**given)  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [{"pan": 4.0}, {"speed": 0.0}, {"acceleration": math.nan}])
def test_axes_keep_their_bounds(given: dict[str, float]) -> None:
    with pytest.raises(InvalidValueError):
        PanTiltConfig(**given)


@given(st.floats(-1.7, 1.7), st.floats(-0.6, 0.7))
def test_the_lens_looks_where_the_angles_say(pan: float, tilt: float) -> None:
    X = lens_pose(Look(pan, tilt), CAMERA)
    R = X[:3, :3]
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert math.atan2(R[1, 0], R[0, 0]) == pytest.approx(pan, abs=1e-12)
    assert math.asin(R[2, 0]) == pytest.approx(tilt, abs=1e-12)
    assert R[2, 1] == 0.0
    assert np.linalg.norm(X[:3, 3] - CAMERA.neck) == pytest.approx(CAMERA.reach)


def test_the_lens_is_at_the_front_of_the_head_and_the_head_is_not_in_its_way() -> None:
    body, (whole, *_) = headless(), ipr_shapes()
    ahead = lens_pose(Look(0.0, 0.0), CAMERA)[:3, 3]
    head = whole.vertices[whole.vertices[:, 2] > 0.68]
    assert ahead[0] == pytest.approx(head[:, 0].max(), abs=1e-3)
    assert head[:, 2].min() < ahead[2] < head[:, 2].max() == pytest.approx(IPR.height)
    assert body.vertices[:, 2].max() < 0.68


def test_the_screen_is_on_the_glass() -> None:
    X = screen_pose()
    whole = ipr_shapes()[0]
    inside = (whole.vertices - X[:3, 3]) @ X[:3, :3]
    glass = inside[np.abs(inside[:, 0] - 0.009) < 1e-9]
    assert glass[:, 1].max() - glass[:, 1].min() == pytest.approx(SCREEN_SIZE[0])
    assert glass[:, 2].max() - glass[:, 2].min() == pytest.approx(SCREEN_SIZE[1])
