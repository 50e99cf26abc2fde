"""The bare robot: exact arcs, limits, slip as said, senses, repeatable to the last bit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from robots.ipr.parameters import IPR, MICRO
from robots.mobile.chassis import CameraModel, Chassis, MobileReality, Senses, SonarModel
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.robot import BareBody, MobileRobot
from robots.mobile.sensing import SonarRing
from robots.rooms import read_room
from vrs.errors import InvalidValueError
from vrs.mobile import advanced
from vrs.model import Array

IDEAL = MobileReality.ideal(dt=1 / 60)
QUIET = Senses(
    sonar=SonarModel(noise=0.0, noise_share=0.0, misses=0.0), camera=CameraModel(noise=0.0, noise_angle=0.0)
)
KINDS = [IPR, MICRO]


def commands(seed: int, count: int) -> Array:
    return np.random.default_rng(seed).uniform((-0.5, -0.785), (0.5, 0.785), (count, 2))


@pytest.mark.parametrize("chassis", KINDS, ids=lambda one: one.kind)
def test_ideal_it_is_the_virtual_robot(chassis: Chassis) -> None:
    body = BareBody(chassis, (1.0, 2.0, 0.3), reality=IDEAL)
    expected = np.array((1.0, 2.0, 0.3))
    for v, w in [(0.5, 0.0), (0.0, 0.785), *commands(1, 60).tolist()]:
        body.follow(v, w)
        expected = np.asarray(advanced(expected, v, w, 0.1))
        assert np.abs(body.posture - expected).max() < 1e-12
        assert body.motion == pytest.approx((v, w), abs=1e-12)
    assert np.abs(body.odometry - expected).max() < 1e-12


def test_what_is_wrong_with_the_wheels_bends_its_way_as_worked_out() -> None:
    # Ground speeds: r (1 + e) (1 - s) times the shafts'; the base is wider.
    reality = replace(IDEAL, radius_error=(0.01, -0.02), slip=(0.03, 0.05), base_error=0.04)
    body = BareBody(IPR, (0, 0, 0), reality=reality)
    body.drive(0.4, 0.2, 600)
    base = 0.4
    right = (0.4 + 0.1 * base) * 1.01 * 0.97
    left = (0.4 - 0.1 * base) * 0.98 * 0.95
    v, w = (right + left) / 2, (right - left) / (base * 1.04)
    assert np.abs(body.posture - advanced(np.zeros(3), v, w, 10.0)).max() < 1e-9
    assert body.motion == pytest.approx((v, w), abs=1e-12)
    # Encoders tell the shafts, so odometry follows what was commanded and not what came of it.
    assert np.abs(body.odometry - advanced(np.zeros(3), 0.4, 0.2, 10.0)).max() < 1e-9


def test_speeds_change_within_the_limits_and_with_the_servos_lag() -> None:
    body = BareBody(IPR, reality=replace(IDEAL, ramps=True))
    speeds = []
    for k in range(240):
        body.drive(0.5 if k < 120 else -0.5, 0.7 if k % 50 < 25 else -0.7)
        speeds.append(body.motion)
    change = np.abs(np.diff(np.array([(0.0, 0.0), *speeds]), axis=0)) * 60
    assert change[:, 0].max() == pytest.approx(0.52, abs=1e-9)
    assert change[:, 1].max() == pytest.approx(2 * 0.52 / 0.4, abs=1e-9)
    lagging = BareBody(IPR, reality=replace(IDEAL, servo_lag=True))
    for k in range(1, 6):
        lagging.drive(0.5, 0.0)
        assert lagging.motion[0] == pytest.approx(0.5 * (1 - math.exp(-k / 60 / 0.03)), abs=1e-12)


@pytest.mark.parametrize(
    ("v", "w"), [(0.51, 0.0), (-0.6, 0.0), (0.0, 0.79), (math.nan, 0.0), (0.0, math.inf), ("1", 0.0)]
)
def test_a_command_beyond_the_limits_is_refused_and_nothing_moves(v: float, w: float) -> None:
    body = BareBody(IPR, rng=3)
    body.follow(0.2, 0.1)
    before, time = body.posture.tolist(), body.time
    with pytest.raises(InvalidValueError, match=r"^(v|w) must be a number in"):
        body.follow(v, w)
    assert (body.posture.tolist(), body.time) == (before, time)
    body.follow(0.5, math.radians(45))


@pytest.mark.parametrize("steps", [-1, 1.0, True, 2_000_000])
def test_steps_are_counted_in_whole_numbers(steps: int) -> None:
    with pytest.raises(InvalidValueError, match="steps"):
        BareBody(IPR).drive(0.1, 0.0, steps)


def trace(make: Callable[[], MobileRobot], parts: list[int], seed: int = 5) -> bytes:
    """Everything that a robot tells on a way, the same commands for any parts that add up to 24 steps."""
    found = []
    with make() as body:
        for v, w in commands(seed, 25).tolist():
            for steps in parts:
                body.drive(v, w, steps)
            scan, fix = body.sonar, body.camera
            assert scan is not None
            told = [*body.posture, *body.odometry, *body.encoders, *body.motion, *scan.ranges, scan.time]
            found.append(np.array(told + ([] if fix is None else [fix.time, *fix.posture])).tobytes())
    return b"".join(found)


def test_the_same_seed_gives_the_same_to_the_last_bit() -> None:
    narrow = read_room(
        "room 1\nsize 2 2\nstart 1.745 1 0\nwall 0 0 2 0\nwall 2 0 2 2\nwall 2 2 0 2\nwall 0 2 0 0\n"
    )

    def made(seed: int) -> Callable[[], MobileRobot]:
        return lambda: BareBody(IPR, room=narrow, rng=seed)

    first = trace(made(1), [24])
    assert trace(made(1), [24]) == first
    assert trace(made(1), [1] * 24) == first
    assert trace(made(1), [5, 0, 11, 8]) == first
    assert trace(made(2), [24]) != first


def test_a_collision_is_the_same_however_calls_are_split() -> None:
    room = read_room("room 1\nsize 4 4\nwall 3 0 3 4\n")
    ends = set()
    for parts in ([300], [1] * 300, [3, 150, 147]):
        body = BareBody(IPR, (2.4, 2.0, 0.1), room=room, reality=replace(IDEAL, dt=1 / 240))
        for steps in parts:
            body.drive(0.5, 0.1, steps)
        assert body.touching
        ends.add(body.posture.tobytes())
    assert len(ends) == 1


def test_one_sense_switched_off_leaves_the_others_as_they_were() -> None:
    def told(senses: Senses) -> tuple[bytes, bytes, bytes]:
        body = BareBody(IPR, room="furnished", rng=4, senses=senses)
        for v, w in (0.3 * commands(2, 30)).tolist():
            body.follow(v, w)
        scan, fix = body.sonar, body.camera
        return (
            np.concatenate([body.posture, body.odometry]).tobytes(),
            b"" if scan is None else scan.ranges.tobytes(),
            b"" if fix is None else fix.posture.tobytes(),
        )

    all_of_them, deaf, unseen = told(Senses()), told(Senses(sonar=None)), told(Senses(camera=None))
    assert deaf == (all_of_them[0], b"", all_of_them[2])
    assert unseen == (*all_of_them[:2], b"")


def test_it_stands_where_the_way_leads_into_a_wall_and_its_wheels_turn() -> None:
    room = read_room("room 1\nsize 4 4\nwall 3 0 3 4\n")
    body = BareBody(IPR, (1.0, 2.0, 0.0), room=room, reality=replace(IDEAL, ramps=True))
    body.drive(0.5, 0.0, 60 * 10)
    # The front is half the length before the body's middle, which is behind the axle.
    stop = 2.95 - (0.26 - 0.06)
    assert stop - 0.01 < body.posture[0] <= stop
    assert body.touching == "wall in line 3"
    assert [c.thing for c in body.collisions] == ["wall in line 3"]
    assert body.motion == (0.0, 0.0)
    assert body.odometry[0] > 5.0
    body.drive(-0.5, 0.0, 60 * 2)
    assert body.touching == ""
    assert body.posture[0] < stop - 0.2
    with pytest.raises(InvalidValueError, match="not in the wall in line 3"):
        BareBody(IPR, (3.0, 2.0, 0.0), room=room)


@pytest.mark.parametrize("person", ["", "person 0.2 0,4.5,3.5 5,1.5,1 9,4.5,3.5\n"])
def test_no_touch_is_missed_however_the_robot_goes(person: str) -> None:
    plan = "room 1\nsize 5 4\nbox 2.5 2 0.3 0.9\ncolumn 4 1 0.1\nbox 1 3 0.3 0.3 from=3 until=20\n"
    room = read_room(plan + person)
    collisions = 0
    for seed in range(6):
        body = BareBody(IPR, (0.8, 0.8, 0.25 * seed), room=room, rng=seed)
        seen = FloorPlan(room)
        for v, w in np.repeat(commands(seed, 15), 12, axis=0).tolist():
            body.follow(0.3 + 0.4 * abs(v), 0.2 * w)
            x, y, theta = body.posture
            middle = x - 0.06 * math.cos(theta), y - 0.06 * math.sin(theta)
            inside = seen.touched(*middle, theta, (0.26 - 0.02, 0.225 - 0.02), body.time)
            assert not inside or body.touching
        collisions += len(body.collisions)
    assert collisions > 3


def test_sonars_tell_the_room() -> None:
    room = read_room("room 1\nsize 6 4\nwall 0 0 6 0\nwall 6 0 6 4\nwall 6 4 0 4\nwall 0 4 0 0\n")
    body = BareBody(IPR, (3.06, 2.0, 0.0), room=room, senses=QUIET)
    body.drive(0.0, 0.0, 1)
    scan = body.sonar
    assert scan is not None
    # Walls are 5 cm nearer than the plan's lines; the cone's shortest ray is the straight one.
    assert scan.ranges[[0, 4, 8, 12]] == pytest.approx(
        [2.95 - 0.26, 1.95 - 0.225, 2.95 - 0.26, 1.95 - 0.225], abs=1e-9
    )
    assert scan.time == 0.0
    body.drive(0.0, 0.0, 5)
    assert body.sonar is not None
    assert body.sonar.time == pytest.approx(0.1, abs=1e-12)
    far = BareBody(IPR, (3.06, 2.0, 0.0), senses=QUIET)
    far.drive(0.0, 0.0, 1)
    assert far.sonar is not None
    assert np.isinf(far.sonar.ranges).all()


def test_noise_and_misses_are_as_said() -> None:
    room = read_room("room 1\nsize 6 4\nwall 0 0 6 0\nwall 6 0 6 4\nwall 6 4 0 4\nwall 0 4 0 0\n")
    model = SonarModel(rate=60.0, noise=0.01, noise_share=0.02, misses=0.1)
    body = BareBody(IPR, (3.06, 2.0, 0.0), room=room, senses=Senses(model, CameraModel(rate=60.0)), rng=6)
    ranges, fixes = [], []
    for _ in range(2000):
        body.drive(0.0, 0.0, 1)
        assert body.sonar is not None
        ranges.append(body.sonar.ranges[4])
        if body.camera is not None:
            assert body.camera.time <= body.time - 0.08 + 1e-9
            fixes.append(body.camera.posture)
    side = np.array(ranges)
    assert np.isinf(side).mean() == pytest.approx(0.1, abs=0.03)
    heard = side[np.isfinite(side)]
    assert heard.mean() == pytest.approx(1.725, abs=0.005)
    assert heard.std() == pytest.approx(math.hypot(0.01, 0.02 * 1.725), rel=0.1)
    assert np.array(fixes).std(axis=0) == pytest.approx([0.003, 0.003, math.radians(0.5)], rel=0.1)
    assert np.array(fixes).mean(axis=0) == pytest.approx([3.06, 2.0, 0.0], abs=1e-3)


def test_encoders_count_with_noise_and_odometry_drifts() -> None:
    body = BareBody(IPR, (0, 0, 0), rng=7)
    for _ in range(200):
        body.follow(0.4, 0.1)
    assert all(count == round(count) for count in body.encoders)
    turns = np.array(body.encoders) / (8000 * 40)
    assert turns.mean() * math.tau * 0.1 == pytest.approx(8.0 - 0.4**2 / 1.04, abs=0.05)
    drift = float(np.hypot(*(body.odometry - body.posture)[:2]))
    assert 0.01 < drift < 1.0
    exact = BareBody(IPR, (0, 0, 0), reality=IDEAL, rng=7)
    exact.drive(0.4, 0.1, 1200)
    assert np.abs(exact.odometry - exact.posture).max() < 1e-9


def test_values_are_checked() -> None:
    for name, value in {
        "slip": (0.6, 0.0), "slip_spread": -0.1, "base_error": 0.3, "friction": 0.0, "dt": 0.0, "ramps": 1,
        "encoder_counts": 0, "payload": 3, "radius_error": 0.1, "gravity": math.nan,
    }.items():  # fmt: skip
        with pytest.raises(InvalidValueError, match=name):
            MobileReality(**{name: value})  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="posture"):
        BareBody(IPR, (0, 0))
    with pytest.raises(InvalidValueError, match="period"):
        BareBody(IPR, period=0.07)
    with pytest.raises(InvalidValueError, match="rays"):
        SonarModel(rays=0)
    drawn = MobileReality.drawn(np.random.default_rng(1))
    assert drawn == MobileReality.drawn(np.random.default_rng(1)) != MobileReality.drawn(np.random.default_rng(2))


def test_a_sonar_tells_nothing_nearer_than_it_can_and_nothing_farther() -> None:
    model = SonarModel(noise=0.0, noise_share=0.0, misses=0.0)
    ring = SonarRing(IPR, model, np.random.default_rng(0))
    near, far = IPR.sonar_reach
    for exact, told in ((0.0, near), (0.5 * near, near), (1.7, 1.7), (1.01 * far, math.inf), (math.inf, math.inf)):
        distances = np.full((16, model.rays), exact)
        assert (ring.scan(distances.ravel(), 1.0).ranges == told).all()
    # Of a cone's rays the shortest counts.
    distances[3, 2] = 0.8
    assert ring.scan(distances.ravel(), 1.0).ranges[3] == 0.8
