"""Sensors of a mobile robot that read rubbish: it's left out, and where it lasts the robot stops and says so."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from interfaces.messages.sites import DriveReport
from interfaces.runtime.live.paced_body import PacedBody, PacedConfig
from interfaces.stream.codec import Encoding, decode, encode
from interfaces.teleop.architectures.compositions import CONTROL
from interfaces.teleop.operator import Halt, HaltCause
from robots import load
from robots.ipr.parameters import IPR
from robots.mobile.chassis import Senses
from robots.mobile.robot import BareBody, place
from robots.onboard.driving import Posture
from robots.onboard.following import SensorWatch, SoundPosition
from robots.onboard.laser import LaserModel
from tests.interfaces.teleop.rig import Rig

BAD = [math.nan, math.inf, 1e300, -1e300]


class Spoilt:
    """A position that a test spoils."""

    def __init__(self, position: Any) -> None:
        self.position, self.bad = position, None

    def posture(self) -> Posture:
        there: Posture = self.position.posture()
        return there if self.bad is None else there._replace(**self.bad)


def rig(*, sound: bool = True) -> tuple[Rig, Spoilt, list[DriveReport]]:
    made = Rig()
    spoilt = Spoilt(made.position)
    made.position = SoundPosition(spoilt, lambda: made.now) if sound else spoilt
    reports: list[DriveReport] = []
    receive = made.line.receive

    def crossed(answer: Any, *, now: float) -> None:
        if isinstance(answer, DriveReport):
            reports.append(answer)
            answer = decode(encode(answer, Encoding.JSON), Encoding.JSON, allowed=DriveReport)
        receive(answer, now=now)

    made.line.receive = crossed
    return made, spoilt, reports


def asks(made: Rig) -> Callable[[float], object]:
    """What wishes to go ahead, whether it may or not."""
    return lambda now: made.operator.robot.wish(0.3, 0.0, issued_at=now, now=now)


def check(made: Rig, reports: list[DriveReport]) -> None:
    postures = [report.posture for report in reports]
    postures += [report.report.posture for report in reports if report.report is not None]
    assert (np.abs(np.array(postures)) < 100).all()
    assert np.isfinite(np.array(made.drives)).all()
    assert np.isfinite(made.operator.robot.virtual(made.now)).all()


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("field", ["x", "y", "theta"])
def test_a_position_that_fails_stops_the_robot_and_a_resume_goes_on(bad: float, field: str) -> None:
    made, spoilt, reports = rig()
    made.begin()
    made.run(1.0, asks(made))
    # One control period's is left out.
    spoilt.bad = {field: bad}
    made.run(0.05, asks(made))
    spoilt.bad = None
    made.run(0.5, asks(made))
    assert not made.robot.halted
    assert made.drives[-1][0] > 0.2
    spoilt.bad = {field: bad}
    made.run(2.0, asks(made))
    assert made.robot.halted.startswith("the position reads ")
    assert made.operator.halted == Halt(HaltCause.REPORTED, made.robot.halted)
    assert made.drives[-1] == (0.0, 0.0)
    stood = made.truth
    assert made.operator.resume(now=made.now) == ""
    made.run(1.5, asks(made))
    assert made.robot.halted
    assert math.dist(made.truth[:2], stood[:2]) < 0.02
    spoilt.bad = None
    made.run(1.0)
    assert made.operator.resume(now=made.now) == ""
    made.run(3.0, asks(made))
    assert not made.robot.halted
    assert math.dist(made.truth[:2], stood[:2]) > 0.3
    check(made, reports)


@pytest.mark.parametrize("bad", BAD[:2])
def test_no_drive_is_made_of_it_whatever_the_architecture_reads(bad: float) -> None:
    made, spoilt, reports = rig(sound=False)
    made.begin()
    made.run(1.0, asks(made))
    spoilt.bad = {"x": bad}
    made.run(1.0, asks(made))
    assert made.robot.halted
    assert made.drives[-1] == (0.0, 0.0)
    check(made, reports)


def body() -> BareBody:
    return BareBody(IPR, room=place("furnished"), senses=Senses(laser=LaserModel()), rng=1)


def spoil(robot: Any, name: str, bad: float) -> None:
    """Let what one sensor reads be bad from now on."""
    read = getattr(robot, name)
    if name == "shafts":
        setattr(robot, name, lambda: (read()[0], bad))
    else:
        setattr(robot, name, lambda *given: np.where(np.arange(len(given[0])) == 3, bad, read(*given)))


@pytest.mark.parametrize("bad", [math.nan, 1e300, -1.0])
@pytest.mark.parametrize("name", ["shafts", "distances"])
def test_wheels_and_scans_are_looked_at_before_anybody_reads_them(name: str, bad: float) -> None:
    if name == "shafts" and bad == -1.0:
        bad = -math.inf
    robot = body()
    robot.drive(0.2, 0.1, 90)
    known = robot.laser, robot.sonar, robot.encoders, robot.reckoned
    read = getattr(robot, name)
    spoil(robot, name, bad)
    robot.drive(0.2, 0.1, 240)
    if name == "shafts":
        assert (robot.encoders, robot.reckoned) == known[2:]
        assert robot.watch.fault.startswith("the left wheel's encoder reads ")
    else:
        assert robot.laser is known[0]
        assert robot.sonar is known[1]
        assert "reads" in robot.watch.fault
    setattr(robot, name, read)
    robot.drive(0.2, 0.1, 120)
    assert robot.watch.fault == ""
    assert np.isfinite(robot.reckoned).all()
    assert math.dist(robot.reckoned[:2], robot.truth[:2]) < 0.05
    assert robot.laser is not known[0]


def test_one_bad_reading_is_no_fault() -> None:
    watch = SensorWatch()
    for k in range(100):
        assert (
            watch.see("sonar ring", [1.0, math.inf if k % 2 else math.nan], 0, 10, now=0.05 * k, endless=True)
            == k % 2
        )
        assert watch.fault == ""
    assert not watch.see("sonar ring", "x", 0, 10, now=9.0)
    assert not watch.see("sonar ring", [None], 0, 10, now=9.05)
    assert watch.fault == "the sonar ring reads no numbers" or "nan" in watch.fault


@pytest.mark.parametrize(("name", "sensor"), [("shafts", "left wheel's encoder"), ("distances", "sonar ring")])
def test_a_live_robot_halts(name: str, sensor: str) -> None:
    async def run() -> None:
        robot = PacedBody(PacedConfig(load("ipr"), place("empty")))
        try:
            now = robot.clock.now()
            robot.host.site = robot.new_site(now)
            site = robot.host.site
            site.epoch = 1
            for _ in range(3):
                robot.drive_tick(robot.clock.now())
            assert site.halted == ""
            spoil(robot.body, name, math.nan)
            for _ in range(round(0.6 / CONTROL)):
                robot.drive_tick(robot.clock.now())
            assert site.halted == f"the {sensor} reads nan"
            assert np.isfinite(robot.health()["posture"]).all()
        finally:
            robot.body.close()

    asyncio.run(run())
