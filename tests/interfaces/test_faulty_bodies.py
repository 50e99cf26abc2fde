"""Bodies that measure rubbish, or don't follow: nothing of it reaches a plan or a report, and the robot stops."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from interfaces.messages.sites import Report
from interfaces.runtime.physics_messages import FaultKind, Measurement
from interfaces.runtime.physics_process import BodyTicks
from interfaces.runtime.tick_loop import Moved
from interfaces.stream.codec import Encoding, decode, encode
from interfaces.teleop import JointReference, RobotSiteConfig
from interfaces.teleop.operator import Halt, HaltCause
from robots.onboard.following import FollowingAbort, SensorFault
from robots.onboard.watchdog import StopReason, WatchdogConfig, WatchdogState
from robots.robot import ExactArm, Prepared
from tests.interfaces.test_host import READY, STEP, Ends, to
from tests.interfaces.test_tick_loop import Bench, rows
from tests.interfaces.ticks import TICK, motion, sampled

BAD = [math.nan, math.inf, -math.inf, 1e300, -1e300]
Spoil = Callable[[Moved], Moved]


def joint(j: int, bad: float) -> Spoil:
    def spoil(moved: Moved) -> Moved:
        q = list(moved.q)
        q[j] = bad
        return moved._replace(q=q)

    return spoil


def shorter(moved: Moved) -> Moved:
    return moved._replace(q=moved.q[:4])


def wild(moved: Moved) -> Moved:
    return moved._replace(qd=[math.nan] * 6)


SPOILT = [*(joint(k % 6, bad) for k, bad in enumerate(BAD)), shorter, wild]


class Faulty(BodyTicks):
    """An exact body whose sensors fail in some ticks."""

    def __init__(self, spoil: Spoil, when: Callable[[int], bool]) -> None:
        super().__init__(ExactArm())
        self.spoil, self.when, self.ticks = spoil, when, 0

    def step(self, prepared: Prepared) -> Moved:
        self.ticks += 1
        moved = super().step(prepared)
        return self.spoil(moved) if self.when(self.ticks) else moved


def driven(body: Any, until: float = 1.5) -> Bench:
    bench, timeline = Bench(body), motion()
    for low in range(0, int(until / TICK) + 200, 150):
        bench.loop.receive(rows(sampled(timeline, 1 + low, 400), 1 + low))
        bench.run(TICK * (low + 150))
    return bench


def check_sound(measured: list[Measurement]) -> None:
    for values in zip(*((m.q, m.qd) for m in measured), strict=True):
        array = np.array(values)
        assert array.shape[1:] == (6,)
        assert (np.abs(array) < 50).all()


@pytest.mark.parametrize("spoil", SPOILT)
@pytest.mark.parametrize("length", [1, 30])
def test_few_bad_samples_are_left_out(spoil: Spoil, length: int) -> None:
    bench = driven(Faulty(spoil, lambda k: k % 400 < length))
    check_sound(bench.measured)
    assert bench.faults == []
    assert all((m.tick < k) is (k % 400 < length) for k, m in enumerate(bench.measured, 1))
    # What is told instead says when it was measured.
    reference = sampled(motion(), 0, 2000)
    assert all(np.array_equal(m.q, reference.q[m.tick]) for m in bench.measured if m.tick > 0)


@pytest.mark.parametrize("spoil", SPOILT)
def test_lasting_ones_brake_the_arm_and_it_doesnt_move_blind(spoil: Spoil) -> None:
    body = Faulty(spoil, lambda k: 500 <= k < 4000)
    bench = driven(body, 3.0)
    check_sound(bench.measured)
    (fault, *more) = bench.faults
    assert (fault.kind, fault.tick, more) == (FaultKind.SENSOR, 551, [])
    assert "encoder" in fault.text
    assert bench.measured[-1].q_ref == fault.rest
    bench.check()
    # Acknowledged while it still can't see, it moves for no longer than a tick.
    away = sampled(motion(), 551, 400)
    start = bench.measured[-1].counts.ticks + 5
    still = np.array(fault.rest)
    bench.loop.receive(rows(away._replace(q=still + away.q - away.q[0]), start, run=1))
    bench.run(TICK * (start + 500))
    assert len(bench.faults) >= 2
    assert {f.kind for f in bench.faults} <= {FaultKind.SENSOR, FaultKind.JUMPED}
    assert np.abs(np.array(bench.measured[-1].q_ref) - still).max() < 0.01
    check_sound(bench.measured)


def test_a_sensor_that_sees_again_lets_the_arm_go_on() -> None:
    bench = driven(Faulty(joint(2, math.nan), lambda k: 500 <= k < 1500), 2.0)
    (fault,) = bench.faults
    assert fault.text == "the encoder of joint 3 reads nan rad"
    timeline_start = bench.measured[-1].counts.ticks + 5
    q = np.array(fault.rest)
    away = q + 0.1 * (1 - np.cos(np.linspace(0, np.pi, 500)))[:, None]
    qd = np.gradient(away, TICK, axis=0)
    way = JointReference(away, qd, np.gradient(qd, TICK, axis=0))
    bench.loop.receive(rows(way, timeline_start, run=1))
    bench.run(TICK * (timeline_start + 400))
    assert len(bench.faults) == 1
    assert bench.measured[-1].tick == bench.measured[-1].counts.ticks
    assert np.abs(np.array(bench.measured[-1].q) - q).max() > 0.05


class Spoilt(Ends):
    """Both ends, with a body whose measurements a test spoils; every report crosses the wire."""

    def __init__(self, site: RobotSiteConfig | None = None) -> None:
        super().__init__("constant:0.05", site)
        self.reports: list[Report] = []
        self.spoil: Callable[[Any], Any] = lambda q: q

    def run(self, seconds: float, *, operator: bool = True, robot: bool = True) -> None:
        for _ in range(round(seconds / STEP)):
            self.t += STEP
            for message in self.line.advance(now=self.now):
                self.host.receive(message, now=self.robots())
            for message in self.host.advance(now=self.robots()):
                if isinstance(message, Report):
                    self.reports.append(message)
                    crossed = encode(message, Encoding.JSON)
                    message = decode(crossed, Encoding.JSON, allowed=Report)  # noqa: PLW2901 - as it crossed
                self.line.receive(message, now=self.now)
            q, qd, qdd = self.host.reference(np.array([self.robots()]))
            self.asked.append(np.concatenate([q, qd, qdd]))
            self.host.measured(self.spoil(q[0]), at=self.robots(), now=self.robots())


def spoilt(bad: Any, j: int = 2) -> Callable[[Any], Any]:
    def spoil(q: Any) -> Any:
        return q[:4] if bad == "short" else np.where(np.arange(6) == j, bad, q)

    return spoil


@pytest.mark.parametrize("watchdog", [None, WatchdogConfig()])
@pytest.mark.parametrize("bad", [*BAD, "short"])
def test_a_site_uses_no_bad_sample_brakes_if_they_last_and_goes_on_by_resume(bad: Any, watchdog: Any) -> None:
    ends = Spoilt(RobotSiteConfig(watchdog=watchdog))
    ends.go()
    ends.operator.robot.execute(to(READY, speed=0.3), now=ends.now)
    ends.run(0.5)
    ends.spoil = spoilt(bad)
    ends.run(STEP)
    ends.spoil = lambda q: q
    ends.run(0.3)
    site = ends.host.site
    assert site is not None
    assert (site.halted, site.violation) == ("", None)
    ends.spoil = spoilt(bad)
    ends.run(0.5)
    assert isinstance(site.violation, SensorFault)
    assert site.violation.joint == (None if bad == "short" else 2)
    assert site.halted == str(site.violation)
    assert ends.operator.halted == Halt(HaltCause.REPORTED, site.halted)
    ends.run(1.0)
    assert not ends.asked[-1][1:].any()
    stood = ends.asked[-1][0]
    # A resume while the sensor is still bad stops at once.
    assert ends.operator.resume(now=ends.now) == ""
    ends.operator.robot.execute(to(READY, speed=0.3), now=ends.now)
    ends.run(1.5)
    assert ends.operator.halted
    assert np.abs(ends.asked[-1][0] - stood).max() < 0.05
    ends.spoil = lambda q: q
    ends.run(2.0)
    assert ends.operator.resume(now=ends.now) == ""
    ends.operator.robot.execute(to(READY), now=ends.now)
    ends.run(6.0)
    assert np.abs(ends.asked[-1][0] - READY).max() <= 1e-9
    assert (site.halted, site.violation) == ("", None)
    ends.check()
    q = np.array([report.q for report in ends.reports])
    assert (np.abs(q) < 10).all()
    assert np.isfinite(ends.operator.robot.engine.timeline.sample(np.linspace(0, ends.now, 500))).all()


@pytest.mark.parametrize("watchdog", [None, WatchdogConfig()])
def test_t13_a_joint_that_seizes_is_a_typed_abort_and_the_arm_goes_on_once_it_is_free(watchdog: Any) -> None:
    ends = Spoilt(RobotSiteConfig(watchdog=watchdog))
    ends.go()
    ends.operator.robot.execute(to(READY, speed=0.5), now=ends.now)
    ends.run(0.3)
    seized = ends.asked[-1][0][1]
    ends.spoil = lambda q: np.where(np.arange(6) == 1, seized, q)
    ends.run(3.0)
    site = ends.host.site
    assert site is not None
    assert isinstance(site.violation, FollowingAbort)
    assert (site.violation.joint, site.violation.tolerance) == (1, 0.1)
    assert 0.1 < site.violation.error < 0.2
    if watchdog is not None:
        assert (site.watchdog.state, site.watchdog.reason) == (WatchdogState.HALTED, StopReason.TOLERANCE)
    # It's held where it was measured, and stays.
    assert not ends.asked[-1][1:].any()
    assert ends.asked[-1][0][1] == pytest.approx(seized, abs=1e-9)
    ends.run(2.0)
    assert ends.asked[-1][0][1] == pytest.approx(seized, abs=1e-9)
    ends.spoil = lambda q: q
    assert ends.operator.resume(now=ends.now) == ""
    ends.operator.robot.execute(to(READY), now=ends.now)
    ends.run(6.0)
    assert np.abs(ends.asked[-1][0] - READY).max() <= 1e-9
    assert site.violation is None
