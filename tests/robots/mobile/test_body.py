"""The simulated robots against exact arcs, Newton's and energy's laws, trimesh's masses, and themselves."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

from robots import ipr
from robots.bullet.vehicle import BulletVehicle
from robots.bullet.world import LostError, WorldClosedError
from robots.ipr.parameters import IPR, MICRO
from robots.mobile.body import MobileBody
from robots.mobile.chassis import CameraModel, Chassis, MobileReality, Senses, SonarModel
from robots.mobile.robot import BareBody, MobileRobot
from robots.robot import BARE, load
from robots.rooms import read_room
from robots.simulated import WORLDS, Payload
from vrs.errors import InvalidValueError
from vrs.model import Array

WORLD = [""]


@pytest.fixture(autouse=True, params=WORLDS)
def _world(request: pytest.FixtureRequest) -> None:
    """Every law of this module holds in each world."""
    WORLD[0] = request.param


def simulated(*given: Any, **named: Any) -> MobileBody:
    return MobileBody(*given, **named, world=WORLD[0])


BLIND = Senses(sonar=None, camera=None)
IDEAL = replace(MobileReality.ideal(), ramps=True, servo_lag=True)
"""Without errors, but with what a mass needs: ramps, and the servos' lag."""
START = (1.0, 2.0, 0.3)
WAYS = {
    "straight": (0.5, 0.0),
    "backwards": (-0.5, 0.0),
    "circle": (0.3, 0.5),
    "circle backwards": (-0.3, 0.4),
    "narrow": (0.5, -0.785),
    "pivot": (0.0, 0.785),
}


def driven(
    chassis: Chassis, v: float, w: float, seconds: float, reality: MobileReality = IDEAL
) -> tuple[Array, Array]:
    """Postures of the simulated and of the bare robot after a way and a stop."""
    ends = []
    for make in (simulated, BareBody):
        with make(chassis, START, reality=reality, senses=BLIND) as body:
            body.drive(v, w, round(seconds / reality.dt))
            body.drive(0.0, 0.0, round(2.0 / reality.dt))
            ends.append(body.posture)
    return ends[0], ends[1]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("chassis", [IPR, MICRO])
def test_with_errors_off_it_goes_the_exact_arcs_and_stops_where_they_end(chassis: Chassis, way: str) -> None:
    # The bare robot's arcs are the virtual one's to 1e-12: tests/robots/ipr/test_bare.py. A step's heading is that
    # of its start, which turns curved ways by half a step's turning: v t ω dt / 2.
    v, w = WAYS[way]
    body, exact = driven(chassis, v, w, 4.0)
    assert np.hypot(*(body - exact)[:2]) <= 1e-3 + 1.5 * abs(v * w) * 4.0 * 0.5 / 240
    assert abs(body[2] - exact[2]) <= 1e-3


@pytest.mark.parametrize("chassis", [IPR, MICRO])
def test_it_begins_where_it_is_put_at_rest(chassis: Chassis) -> None:
    with simulated(chassis, START, reality=MobileReality(encoder_counts=None)) as body:
        assert body.posture == pytest.approx(START, abs=1e-7)
        assert body.time == 0.0
        assert body.encoders == (0.0, 0.0)
        assert body.motion == pytest.approx((0.0, 0.0), abs=1e-4)
        body.drive(0.0, 0.0, 240)
        assert body.posture == pytest.approx(START, abs=1e-4)
        assert body.odometry == pytest.approx(START, abs=1e-4)


@pytest.mark.parametrize("chassis", [IPR, MICRO])
def test_a_quarter_of_the_step_gives_the_same_way(chassis: Chassis) -> None:
    for v, w in ((0.5, 0.0), (0.4, 0.6)):
        coarse, _ = driven(chassis, v, w, 4.0)
        fine, exact = driven(chassis, v, w, 4.0, replace(IDEAL, dt=1 / 960))
        assert np.hypot(*(coarse - fine)[:2]) < 4e-3
        assert abs(coarse[2] - fine[2]) < 1.5e-3
        assert np.hypot(*(fine - exact)[:2]) < 1e-3


def test_what_is_wrong_with_the_wheels_does_what_it_does_to_the_bare_robot() -> None:
    wrong = replace(IDEAL, radius_error=(0.01, -0.01), slip=(0.0, 0.04), base_error=0.03)
    body, exact = driven(IPR, 0.4, 0.1, 5.0, wrong)
    ideal, _ = driven(IPR, 0.4, 0.1, 5.0)
    assert np.hypot(*(body - exact)[:2]) < 3e-3
    assert abs(body[2] - exact[2]) < 2e-3
    assert abs(body[2] - ideal[2]) > 0.1


def test_shafts_turn_as_told_whatever_the_casters_take() -> None:
    ends = []
    for make in (simulated, BareBody):
        with make(IPR, START, reality=replace(IDEAL, rolling=20.0), senses=BLIND) as body:
            body.drive(0.3, 0.5, 720)
            ends.append(body.odometry)
    assert np.abs(ends[0] - ends[1]).max() < 1e-4


def measured_mass(part: Chassis) -> tuple[float, Array, Array]:
    """Mass, centre and inertia of the lumps by trimesh's volume integrals."""
    meshes = []
    for lump in part.lumps:
        mesh = trimesh.creation.box(
            extents=lump.size, transform=trimesh.transformations.translation_matrix(lump.centre)
        )
        mesh.density = lump.mass / mesh.volume
        meshes.append(mesh)
    mass = sum(mesh.mass for mesh in meshes)
    centre = sum(mesh.mass * mesh.center_mass for mesh in meshes) / mass
    inertia = np.zeros((3, 3))
    for mesh in meshes:
        arm = mesh.center_mass - centre
        inertia += mesh.moment_inertia + mesh.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, centre, inertia


@pytest.mark.parametrize(("chassis", "total"), [(IPR, 75.0), (MICRO, 0.430)])
def test_masses_and_inertias(chassis: Chassis, total: float) -> None:
    part = chassis
    assert part.mass == pytest.approx(total, abs=1e-9)
    mass, centre, inertia = part.rigid()
    expected_mass, expected_centre, expected = measured_mass(part)
    assert mass == pytest.approx(expected_mass, rel=1e-9)
    assert centre == pytest.approx(expected_centre, abs=1e-9)
    assert inertia == pytest.approx(expected, abs=1e-9 * expected.max())
    model = ipr.model(chassis.kind)
    body, wheels = model.body, model.wheels
    assert (part.length, part.width, part.height, part.centre_x) == (
        body.length, body.width, body.height, -body.axle_offset,
    )  # fmt: skip
    assert (part.mass, part.wheel_base, part.wheel_radius) == (body.mass, wheels.base, wheels.radius)
    assert part.limits == model.limits


@pytest.mark.needs("pybullet")
@pytest.mark.parametrize("chassis", [IPR, MICRO])
def test_pybullet_has_what_it_was_given(chassis: Chassis) -> None:
    # It drops inertias silently when a call names damping, too.
    part, (_, _, inertia) = chassis, measured_mass(chassis)
    with MobileBody(chassis, START, senses=BLIND, world="bullet") as robot:
        vehicle = robot.vehicle
        assert isinstance(vehicle, BulletVehicle)
        bullet, number = vehicle.world.bullet, vehicle.body
        told = [bullet.getDynamicsInfo(number, j) for j in range(-1, bullet.getNumJoints(number))]
    assert sum(row[0] for row in told) == pytest.approx(part.mass, rel=1e-9)
    assert sorted(told[0][2]) == pytest.approx(sorted(np.linalg.eigvalsh(inertia)), rel=1e-9)
    spin = part.wheel_mass * part.wheel_radius**2 / 2 + part.gear**2 * part.rotor
    for row in told[1:3]:
        assert row[1] == MobileReality().friction
        assert row[2][1] == pytest.approx(spin, rel=0.01)


@pytest.mark.parametrize("chassis", [IPR, MICRO])
def test_wheels_bear_what_the_casters_leave_of_the_weight(chassis: Chassis) -> None:
    # By the lever: moments about the axle, of all masses and of what the casters bear behind it.
    lumps, centre, _ = chassis.rigid()
    leaning = [x for x, _ in chassis.casters if x < 0]
    swung = [x - 0.5 * chassis.caster_trail for x, _ in chassis.casters]
    moment = lumps * centre[0] + chassis.caster_mass * sum(swung)
    borne = moment / (np.mean(leaning) - chassis.caster_trail)
    with simulated(chassis, START, reality=IDEAL, senses=BLIND) as body:
        body.drive(0.3, 0.0, 480)
        loads = [wheel.load for wheel in body.wheels]
    assert sum(loads) == pytest.approx((chassis.mass - borne) * 9.81, rel=0.01)


def start(v: float, w: float, reality: MobileReality = IDEAL) -> tuple[Any, Any]:
    """Wheels of the IPR while it speeds up, averaged over half a second, and long after."""
    with simulated(IPR, START, reality=reality, senses=BLIND) as body:
        body.drive(v, w, 60)
        early = []
        for _ in range(120):
            body.drive(v, w)
            early.append([wheel.torque for wheel in body.wheels])
        body.drive(v, w, 960)
        late = []
        for _ in range(120):
            body.drive(v, w)
            late.append([wheel.torque for wheel in body.wheels])
    return np.mean(early, axis=0), np.mean(late, axis=0)


def test_torques_are_newtons() -> None:
    # Speeding up at a: the floor's push is M a; wheels and rotors, and the casters' wheels, need theirs.
    r, a, mass = IPR.wheel_radius, 0.52, IPR.mass
    spin = IPR.wheel_mass * r * r / 2 + IPR.gear**2 * IPR.rotor
    caster = 0.25 * IPR.caster_mass
    early, late = start(0.5, 0.0)
    assert early.sum() == pytest.approx((mass + 2 * caster) * a * r + 2 * spin * a / r, rel=0.02)
    assert np.abs(late).max() < 0.02
    # On a circle the centre of mass, behind the axle, is swung: M d ω² along and M d v ω about the axle's middle.
    lumps, centre, _ = IPR.rigid()
    trail = [x - IPR.caster_trail for x, _ in IPR.casters]
    d = -(
        lumps * centre[0] + IPR.caster_mass * sum(trail) / 2 + IPR.caster_mass * sum(x for x, _ in IPR.casters) / 2
    )
    v, w = 0.3, 0.5
    _, late = start(v, w)
    assert late.sum() == pytest.approx(d * w * w * r, rel=0.15)
    assert late[1] - late[0] == pytest.approx(2 * d * v * w * r / IPR.wheel_base, rel=0.05)
    # Rolling casters take their torque over their radius as a pull.
    _, late = start(0.5, 0.0, replace(IDEAL, rolling=1.0))
    assert late.sum() == pytest.approx(2 * IPR.caster_rolling * r / IPR.caster_radius, rel=0.1)


def test_work_becomes_energy_of_motion() -> None:
    with simulated(IPR, START, reality=IDEAL, senses=BLIND) as body:
        work = 0.0
        for _ in range(300):
            body.drive(0.5, 0.0)
            work += sum(wheel.torque * wheel.speed for wheel in body.wheels) / 240
        v, _ = body.motion
    spin = 2 * (IPR.wheel_mass * 0.01 / 2 + IPR.gear**2 * IPR.rotor) / 0.01 + 2 * 0.25 * IPR.caster_mass
    assert v == pytest.approx(0.5, abs=1e-3)
    assert work == pytest.approx((IPR.mass + spin) * v * v / 2, rel=0.02)


def test_it_never_tips_nor_slides_within_the_limits() -> None:
    for chassis, most in ((IPR, 0.004), (MICRO, 0.025)):
        with simulated(chassis, START, senses=BLIND, rng=1) as body:
            rng = np.random.default_rng(2)
            tilt, before = 0.0, body.motion
            for k in range(60):
                v, w = rng.choice([-0.5, 0.5, 0.0]), rng.choice([-0.785, 0.0, 0.785])
                for _ in range(1 + k % 4):
                    body.follow(v, w)
                    tilt = max(tilt, body.tilt)
                    now = body.motion
                    # Mean changes over a period keep to the limits; slip and wrong radii add their percents.
                    assert abs(now[0] - before[0]) <= 0.052 * 1.1
                    before = now
            assert tilt < most


def test_weak_drives_and_a_slippery_floor_fall_behind_and_say_nothing_wrong() -> None:
    weak = replace(IPR, torque=1.0)
    with simulated(weak, START, reality=replace(IDEAL, torque_limits=True), senses=BLIND) as body:
        body.drive(0.5, 0.0, 120)
        assert max(abs(wheel.torque) for wheel in body.wheels) <= 1.0 + 1e-9
        assert body.motion[0] < 0.16
    icy = replace(IDEAL, friction=0.02)
    with simulated(IPR, (0, 0, 0), reality=icy, senses=BLIND) as body:
        body.drive(0.5, 0.0, 240)
        # Less than μ g on three quarters of the weight is left of 0.52 m/s²; the wheels turn on.
        assert body.posture[0] < 0.12
        assert body.odometry[0] > 0.2


@pytest.mark.parametrize("friction", [0.05, 0.1])
@pytest.mark.parametrize("chassis", [IPR, MICRO])
def test_locked_wheels_brake_as_coulomb_says(chassis: Chassis, friction: float) -> None:
    # Three equations: what wheels and casters bear, as braking tips the robot forwards, and the deceleration.
    # Trailing casters roll, and have half a wheel's inertia; balls slide.
    reality, r = replace(MobileReality.ideal(), friction=friction), chassis.caster_radius
    lumps, (x, _, z), _ = chassis.rigid()
    trail, half, n = chassis.caster_trail, 0.5 * chassis.caster_mass, len(chassis.casters)
    behind = np.mean([x for x, _ in chassis.casters if x < 0]) - trail
    swung = sum(2 * x - trail for x, _ in chassis.casters)
    mass, moment = chassis.mass, lumps * x + half * swung
    height = (
        lumps * z + 2 * chassis.wheel_mass * chassis.wheel_radius + n * half * (3 * r if trail else 2 * r)
    ) / mass
    rows = [
        [1.0, 1.0, 0.0],
        [0.0, -behind, mass * height],
        [friction, 0.0 if trail else 0.02, -mass - (0.5 * n * half if trail else 0.0)],
    ]
    *_, slowing = np.linalg.solve(rows, [mass * 9.81, -moment * 9.81, 0.0])
    with simulated(chassis, (0, 0, 0), reality=reality, senses=BLIND) as body:
        for v in np.linspace(0.0, 0.5, round(240 * 0.5 / (0.25 * friction * 9.81))):
            body.drive(float(v), 0.0)
        begun, (v, _) = body.posture[0], body.motion
        body.drive(0.0, 0.0, 720)
        assert body.posture[0] - begun == pytest.approx(v * v / (2 * slowing), rel=0.06)
        assert v == pytest.approx(0.5, abs=0.01)


def test_drives_at_their_limit_speed_up_a_load_as_newton_says() -> None:
    weak = replace(IPR, torque=1.5)
    gone = []
    for payload in (None, Payload(37.5, (-0.06, 0.0, 0.3))):
        with simulated(weak, (0, 0, 0), reality=replace(IDEAL, torque_limits=True, payload=payload)) as body:
            body.drive(0.5, 0.0, 120)
            gone.append(body.motion[0])
    spin = 2 * (IPR.wheel_mass * 0.01 / 2 + IPR.gear**2 * IPR.rotor) / 0.01 + 2 * 0.25 * IPR.caster_mass
    assert gone[0] / gone[1] == pytest.approx((IPR.mass + 37.5 + spin) / (IPR.mass + spin), rel=0.02)


@pytest.mark.parametrize("numbers", ["wheelbase=0.2,wheel=0.05", "wheelbase=0.9,wheel=0.25,mass=300,axle=0.1"])
def test_bases_of_other_sizes_drive_as_exactly(numbers: str) -> None:
    robot = load(f"diff:{numbers}")
    for v, w in ((0.4, 0.0), (0.0, 0.8), (0.3, 0.4)):
        ends = []
        for name in (WORLD[0], BARE):
            with robot.body(name)((0, 0, 0), reality=IDEAL, senses=BLIND) as body:
                body.drive(v, w, 720)
                ends.append(body.posture)
        assert np.hypot(*(ends[0] - ends[1])[:2]) <= 1e-3 + 1.5 * abs(v * w) * 3.0 * 0.5 / 240
        assert abs(ends[0][2] - ends[1][2]) <= 1e-3


def test_a_payload_moves_the_centre_of_mass() -> None:
    behind, before = (Payload(20.0, (x, 0.0, 0.5)) for x in (-0.2, -0.02))
    loads = []
    for payload in (None, behind, before):
        with simulated(IPR, START, reality=replace(IDEAL, payload=payload), senses=BLIND) as body:
            body.drive(0.2, 0.0, 240)
            loads.append(sum(wheel.load for wheel in body.wheels))
            assert body.posture[1] == pytest.approx(START[1] + (body.posture[0] - 1) * math.tan(0.3), abs=2e-3)
    assert loads[1] < loads[0] + 60 < loads[2]


def test_one_that_falls_over_is_lost() -> None:
    heavy = replace(IDEAL, payload=Payload(50.0, (0.5, 0.0, 0.8)))
    with pytest.raises(LostError, match="fell over at"), simulated(IPR, START, reality=heavy) as body:
        body.drive(0.0, 0.0, 480)


def test_it_runs_into_a_wall_and_says_so() -> None:
    room = read_room("room 1\nsize 4 4\nwall 3 0 3 4\nperson 0.25 0,1,3.5 3,1,3.5 5,1,2\n")
    with simulated(IPR, (2.0, 2.0, 0.0), room=room, rng=1) as body:
        body.drive(0.5, 0.0, 240 * 3)
        assert [c.thing for c in body.collisions] == ["wall in line 3"]
        assert body.touching == "wall in line 3"
        # The front is half the length before the body's middle, which is behind the axle.
        assert body.posture[0] == pytest.approx(2.95 - 0.20, abs=5e-3)
        assert body.tilt < 0.05
        body.drive(-0.5, 0.0, 240 * 2)
        assert body.touching != "wall in line 3"
        assert body.posture[0] < 2.5
        with pytest.raises(InvalidValueError):
            body.drive(0.6, 0.0)
    with simulated(IPR, (1.0, 2.0, 0.0), room=room, rng=1) as body:
        body.drive(0.0, 0.0, 240 * 5)
        assert [c.thing for c in body.collisions] == ["person in line 4"]
        # Who goes on to where it stood pushes it away, and comes into it by two steps of his at most.
        x, y, theta = body.truth
        off = complex(1.0 - x, 2.0 - y) * cmath.exp(-1j * theta) - IPR.centre_x
        apart = max(abs(off.real) - IPR.length / 2, 0.0), max(abs(off.imag) - IPR.width / 2, 0.0)
        assert math.hypot(*apart) == pytest.approx(0.25, abs=0.05)


def test_what_comes_and_goes_is_met_only_while_it_stands() -> None:
    room = read_room("room 1\nsize 4 4\nbox 3 2 0.2 2 from=2 until=4\n")
    quiet = Senses(SonarModel(noise=0.0, noise_share=0.0, misses=0.0))
    seen = []
    with simulated(IPR, (1.0, 2.0, 0.0), room=room, senses=quiet) as body:
        for _ in range(50):
            body.follow(0.0, 0.0)
            assert body.sonar is not None
            seen.append(bool(np.isfinite(body.sonar.ranges[0])))
    assert np.flatnonzero(np.diff(seen)).tolist() == [18, 38]


def test_its_sonars_tell_what_the_bare_robots_tell() -> None:
    quiet = Senses(SonarModel(noise=0.0, noise_share=0.0, misses=0.0), CameraModel())
    postures = [(1.0, 1.0, 1.57), (1.6, 3.3, -2.0), (5.2, 2.2, 0.7)]
    for posture in postures:
        scans = []
        for make in (simulated, BareBody):
            with make(IPR, posture, room="furnished", senses=quiet) as body:
                body.drive(0.0, 0.0, 1)
                assert body.sonar is not None
                scans.append(body.sonar.ranges)
        assert (np.isfinite(scans[0]) == np.isfinite(scans[1])).all()
        seen = np.isfinite(scans[0])
        assert seen.sum() >= 8
        assert np.abs(scans[0][seen] - scans[1][seen]).max() < 5e-3


def trace(parts: list[int], seed: int) -> bytes:
    found = []
    exact = MobileReality(encoder_counts=None)
    with simulated(IPR, room="furnished", rng=seed, reality=exact) as body:
        for k in range(15):
            for steps in parts:
                body.drive(0.3, 0.7 * math.sin(k), steps)
            assert body.sonar is not None
            told = [*body.posture, *body.odometry, *body.encoders, *body.motion, *body.sonar.ranges]
            found.append(np.array(told + ([] if body.camera is None else [*body.camera.posture])).tobytes())
    return b"".join(found)


def test_the_same_seed_gives_the_same_to_the_last_bit() -> None:
    first = trace([24], 1)
    assert trace([24], 1) == first
    assert trace([24], 2) != first
    assert trace([5, 0, 19], 1) == first


def test_a_closed_robot_is_of_no_use() -> None:
    body = simulated(MICRO, START)
    body.close()
    body.close()
    with pytest.raises(WorldClosedError):
        body.follow(0.1, 0.0)


@pytest.mark.parametrize("make", [simulated, BareBody])
def test_who_is_lifted_in_motion_stands_where_he_is_put(make: Callable[..., MobileRobot]) -> None:
    with make(IPR, START, reality=IDEAL, senses=BLIND) as body:
        body.drive(0.5, 0.3, 480)
        there = (4.0, -1.0, 2.0)
        body.carry(there)
        assert np.abs(np.array(body.motion)).max() < 1e-9
        assert np.abs(body.posture - there).max() < 1e-9
        # Its wheels still turn, as nobody told them.
        body.drive(0.0, 0.0, 480)
        assert np.hypot(*(body.posture - there)[:2]) < 0.5
    with make(IPR, room="furnished", senses=BLIND) as body:
        before = body.posture
        with pytest.raises(InvalidValueError, match="stands free"):
            body.carry((0.0, 0.0, 0.0))
        assert np.array_equal(body.posture, before)
