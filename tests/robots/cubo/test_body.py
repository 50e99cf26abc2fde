"""CUBO's body: sizes and masses of the paper, and that it does and measures what its bindings say."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robots.bullet.vehicle import BulletVehicle
from robots.cubo import parameters as p
from robots.cubo.body import COMMANDS, MEASURES, MOVES, CuboBody
from robots.cubo.shapes import shapes
from robots.mobile.chassis import MobileReality
from robots.mobile.shapes import links
from robots.simulated import WORLDS
from vrs.errors import InvalidValueError

WORLD = [""]


@pytest.fixture(autouse=True, params=WORLDS)
def _world(request: pytest.FixtureRequest) -> None:
    """It does what its bindings say in each world."""
    WORLD[0] = request.param


def cubo(*given: Any, **named: Any) -> CuboBody:
    return CuboBody(*given, **named, world=WORLD[0])


IDEAL = replace(MobileReality.ideal(), ramps=True)


def test_it_is_as_large_and_heavy_as_the_paper_says() -> None:
    assert p.CUBO.mass == pytest.approx(2.0)
    low, high = bounds()
    assert high - low == pytest.approx([0.200, 0.218, 0.309], abs=2e-3)
    assert low[2] == pytest.approx(0.0, abs=1e-3)


def bounds() -> tuple[np.ndarray, np.ndarray]:
    corners = [
        shape.vertices @ X[:3, :3].T + X[:3, 3] for shape, X in zip(shapes(), links(p.CUBO, (0, 0, 0)), strict=True)
    ]
    points = np.concatenate(corners)
    return points.min(axis=0), points.max(axis=0)


def test_every_shape_is_closed_and_faces_outwards() -> None:
    import trimesh

    assert [shape.name for shape in shapes()] == [
        "body", "right wheel", "left wheel", "caster", "right arm", "left arm", "head",
    ]  # fmt: skip
    for shape in shapes():
        for part in trimesh.Trimesh(shape.vertices, shape.faces, process=False).split(only_watertight=False):
            assert part.is_watertight, shape.name
            assert part.volume > 0, shape.name
    assert sum(len(shape.faces) for shape in shapes()) < 20_000


@pytest.mark.needs("pybullet")
def test_what_pybullet_has_is_what_the_parameters_say() -> None:
    with CuboBody(world="bullet") as body:
        assert isinstance(body.vehicle, BulletVehicle)
        bullet, number = body.vehicle.world.bullet, body.vehicle.body
        mass = sum(bullet.getDynamicsInfo(number, j)[0] for j in range(-1, 6))
        assert mass == pytest.approx(2.0, rel=1e-6)
        for k, limb in enumerate(p.CUBO.limbs):
            info = bullet.getDynamicsInfo(number, 3 + k)
            assert info[0] == pytest.approx(limb.mass)
            assert info[2] == pytest.approx(limb.inertia(), rel=1e-6)
            assert info[3] == pytest.approx(limb.centre, abs=1e-9)
        loads = [wheel.load for wheel in body.wheels]
        assert loads[0] == pytest.approx(loads[1], rel=0.01)
        assert 0.7 * 2.0 * 9.81 < sum(loads) < 2.0 * 9.81


def test_it_drives_where_the_rims_say() -> None:
    with cubo((0, 0, 0), reality=IDEAL, exact=True) as body:
        body.move("wheels", (0.2, 0.2))
        body.go_on(120)
        start = body.truth[0]
        for _ in range(48):
            body.go_on(5)
        assert body.truth == pytest.approx((start + 0.2, 0.0, 0.0), abs=1e-3)
        assert body.measure("position") == pytest.approx(body.truth)
        body.move("wheel.left", (-0.1,))
        body.move("wheel.right", (0.1,))
        for _ in range(48):
            body.go_on(5)
        assert body.truth[2] == pytest.approx(0.2 / p.WHEEL_BASE, rel=0.08)
        assert body.measure("gyro") == pytest.approx((0.2 / p.WHEEL_BASE,), rel=0.03)
        assert body.measure("wheels") == pytest.approx((0.1, -0.1), abs=5e-3)
        body.move("wheels", (9.0, 9.0))
        body.go_on(240)
        assert body.motion[0] == pytest.approx(p.LIMITS.v_max, rel=0.01)


def test_it_brakes_from_full_speed_without_a_nod() -> None:
    with cubo() as body:
        body.move("wheels", (0.4, 0.4))
        body.go_on(240)
        body.move("wheels", (-0.4, -0.4))
        for _ in range(60):
            body.go_on(4)
            assert body.tilt < 0.01


def test_arms_and_head_go_where_they_are_told_as_fast_as_they_are_told() -> None:
    with cubo() as body:
        body.move("arm.left", (1.2, 1.0))
        body.move("arm.right", (9.0,))
        body.move("tilt", (-9.0, 0.0))
        body.go_on(120)
        assert body.measure("arm.left")[0] == pytest.approx(0.5, abs=0.05)
        body.go_on(360)
        assert body.angles() == pytest.approx((p.CUBO.limbs[0].high, 1.2, p.CUBO.limbs[2].low), abs=0.02)
        assert body.tilt < 0.02


def test_a_stop_stops_wheels_arms_and_head_where_they_are() -> None:
    with cubo() as body:
        body.move("wheels", (0.1, 0.1))
        for binding in ("arm.left", "arm.right", "tilt"):
            body.move(binding, (1.5, 0.5))
        body.go_on(120)
        body.carry_out("stop", ())
        body.go_on(60)
        stopped = body.angles()
        assert stopped == pytest.approx((0.25, 0.25, 0.25), abs=0.08)
        body.go_on(480)
        assert body.angles() == pytest.approx(stopped, abs=0.01)
        assert body.resting


def test_limbs_hold_their_posture_while_it_drives() -> None:
    with cubo() as body:
        body.move("wheels", (0.3, 0.1))
        for _ in range(20):
            body.go_on(24)
            assert max(map(abs, body.angles())) < 0.02


def test_it_senses_a_wall_touches_it_and_says_so() -> None:
    with cubo(room="furnished") as body:
        body.move("wheels", (0.3, 0.3))
        nearest, happened = 1.0, []
        for _ in range(400):
            body.go_on(12)
            nearest = min(nearest, body.measure("proximity")[0])
            happened += body.events()
        assert nearest < 0.06
        assert happened == ["bumper"]
        assert body.measure("bumper") == (1.0,)


def test_where_nothing_is_proximity_says_its_reach() -> None:
    with cubo() as body:
        assert body.measure("proximity") == (0.8,) * 8
        body.go_on(240)
        assert body.measure("proximity") == (0.8,) * 8


def test_the_battery_runs_down_faster_under_load() -> None:
    with cubo() as body:
        full = body.measure("battery")[0]
        body.go_on(480)
        idle = full - body.measure("battery")[0]
        assert full == pytest.approx(p.BATTERY[0])
        body.sound(b"music")
        body.go_on(480)
        assert full - idle - body.measure("battery")[0] > idle * 1.1
        assert body.played == 5


def test_commands_buttons_and_bindings() -> None:
    with cubo() as body:
        body.carry_out("ir", (7.0,))
        body.carry_out("whatever", ())
        assert [(name, values) for _, name, values in body.done] == [("ir", (7.0,)), ("whatever", ())]
        body.move("wheels", (0.1, 0.1))
        body.carry_out("stop", ())
        body.go_on(120)
        assert body.resting
        body.press("message")
        assert body.events() == ["button.message"]
        assert body.events() == []
        for call in (
            lambda: body.press("bell"),
            lambda: body.move("leg", (1.0,)),
            lambda: body.move("speaker", (1.0,)),
            lambda: body.move("wheels", (1.0,)),
            lambda: body.move("tilt", (math.nan,)),
        ):
            with pytest.raises(InvalidValueError):
                call()
        assert all(body.measure(binding) is not None for binding in MEASURES)
        assert body.measure("nothing") is None
        assert "ir" in COMMANDS
        assert "tilt" in MOVES


def test_the_same_seed_gives_the_same_to_the_last_bit() -> None:
    found = []
    for _ in range(2):
        with cubo(rng=4) as body:
            body.move("wheels", (0.2, 0.15))
            body.move("arm.left", (1.0,))
            body.go_on(480)
            found.append((body.truth, body.angles(), body.measure("position"), body.encoders))
    assert found[0] == found[1]
