from __future__ import annotations

import math

import numpy as np
import pytest

from robots import puma560
from robots.bullet import Payload, Reality
from robots.bullet.drives import Drives
from robots.onboard.following import FollowingAbort, FollowingMonitor, Tolerance
from robots.onboard.stamps import Kind, Stamp, Verdict
from robots.onboard.stops import at_rest, from_commanded, from_measured
from robots.onboard.supervision import Supervision
from robots.onboard.watchdog import BeginStop, Manner, StopReason, WatchdogConfig, WatchdogState
from robots.puma560 import dynamics
from robots.puma560.body import RealArm
from vrs import Engine, JointTarget, ManualClock, MotionCommand, Timeline
from vrs.errors import InvalidValueError
from vrs.model import Array

MODEL = puma560.model()
Q = MODEL.poses["nominal"]
GOAL = np.array([1.2, 1.2, -2.2, 0.6, -0.6, 0.8])
TOLERANCE = Tolerance(np.full(6, 0.03), 0.03)
BLOCK = 10
DT = 1e-3


def monitor() -> FollowingMonitor:
    return FollowingMonitor(TOLERANCE, MODEL.forward)


def test_errors_within_the_tolerance_pass() -> None:
    t, q_ref = np.arange(3.0), np.tile(Q, (3, 1))
    assert monitor().check(t, q_ref, q_ref) is None
    assert monitor().check(t, q_ref, q_ref + np.array([0.029, 0, 0, 0, 0, 0])) is None
    assert monitor().check([], np.empty((0, 6)), np.empty((0, 6))) is None


def test_an_abort_says_which_joint_by_how_much_and_when() -> None:
    q_ref = np.tile(Q, (4, 1))
    q = q_ref.copy()
    q[1, 2] += 0.029
    q[2, 4] += 0.05
    q[2, 1] -= 0.031
    q[3, 0] += 9.0
    abort = monitor().check([0.5, 0.6, 0.7, 0.8], q_ref, q)
    assert abort is not None
    assert (abort.t, abort.joint, abort.tolerance) == (0.7, 4, 0.03)
    assert abort.error == pytest.approx(-0.05)
    np.testing.assert_array_equal(abort.q, q[2])
    np.testing.assert_array_equal(abort.q_ref, q_ref[2])
    assert str(abort) == "at 0.700 s joint 5 was -0.05 rad away, over 0.03 rad"


def test_small_errors_of_many_joints_may_be_a_large_one_of_the_tool() -> None:
    straight = np.array([0, 0, -np.pi / 2, 0, 0, 0])
    q = straight + np.array([0.028, 0.028, 0.028, 0, 0, 0])
    abort = FollowingMonitor(Tolerance(np.full(6, 0.03), 0.03), MODEL.forward).check([1.0], [straight], [q])
    assert abort is not None
    assert (abort.joint, abort.tolerance) == (None, 0.03)
    away = MODEL.forward(straight)[:3, 3] - MODEL.forward(q)[:3, 3]
    assert abort.error == pytest.approx(float(np.linalg.norm(away)))
    assert "the tool was" in str(abort)
    assert FollowingMonitor(Tolerance(np.full(6, 0.03))).check([1.0], [straight], [q]) is None


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_sensor_that_fails_is_a_violation(bad: float) -> None:
    q = np.tile(Q, (2, 1))
    q[1, 3] = bad
    for watch in (monitor(), FollowingMonitor(Tolerance(np.full(6, 0.03)))):
        abort = watch.check([0.0, 1.0], np.tile(Q, (2, 1)), q)
        assert abort is not None
        assert (abort.t, abort.joint) == (1.0, 3)
        assert not math.isfinite(abort.error)


def test_what_makes_no_sense_is_refused() -> None:
    for joints, tool in (([], None), ([0.0], None), ([math.nan], None), ([0.1], 0.0), ([[0.1]], None)):
        with pytest.raises(InvalidValueError):
            Tolerance(joints, tool)
    with pytest.raises(InvalidValueError):
        FollowingMonitor(TOLERANCE)
    with pytest.raises(InvalidValueError):
        monitor().check([0.0], [Q], [Q, Q])
    with pytest.raises(InvalidValueError):
        monitor().check([0.0], [[math.nan] * 6], [Q])
    with pytest.raises(InvalidValueError):
        monitor().check([0.0], [Q], [["a"] * 6])


class Rig:
    """The PyBullet arm under supervision, with a heartbeat in every block."""

    def __init__(self, arm: RealArm, config: WatchdogConfig | None = None) -> None:
        self.arm, self.steps, self.sequence = arm, 0, 0
        self.clock = ManualClock(0.0)
        self.engine = Engine(MODEL, q=Q, clock=self.clock)
        self.timeline: Timeline = self.engine.timeline
        self.guard = Supervision(config)
        self.guard.acquire("ann", now=0.0)
        self.rest = np.array(Q)
        self.stops: list[BeginStop] = []
        self.aborts: list[FollowingAbort] = []
        self.speeds: list[float] = []
        self.measured = np.array(Q)

    @property
    def now(self) -> float:
        return self.steps * DT

    def say(self, kind: Kind = Kind.HEARTBEAT, answers: int | None = None) -> Verdict:
        self.sequence += 1
        stamp = Stamp(1, self.sequence, self.now, kind, answers)
        verdict = self.guard.receive(stamp, now=self.now, authentic=True)
        assert isinstance(verdict, Verdict)
        return verdict

    def go(self, q: Array) -> Verdict:
        verdict = self.say(Kind.COMMAND)
        if verdict is Verdict.FRESH:
            self.engine.execute(MotionCommand(JointTarget(q), execute_at=self.now))
            self.timeline = self.engine.timeline
        return verdict

    def run(self, seconds: float, *, heartbeats: bool = True) -> None:
        for _ in range(round(seconds / DT / BLOCK)):
            if heartbeats:
                self.say()
            for action in self.guard.advance(now=self.now):
                if isinstance(action, BeginStop):
                    self.stops.append(action)
                    self.begin(action.manner)
            t = (self.steps + np.arange(1, BLOCK + 1)) * DT
            refs = [self.timeline.sample(t, derivative=d) for d in range(3)]
            done = self.arm.run(refs[0], refs[1], refs[2])
            self.steps += BLOCK
            self.measured = done.q[-1]
            self.speeds.append(float(np.abs(self.arm.qd).max()))
            self.clock.set(self.now)
            abort = monitor().check(t, refs[0], done.q)
            if abort is not None:
                self.aborts.append(abort)
                self.guard.abort(abort, now=self.now)
            elif (
                self.guard.state is WatchdogState.STOPPING
                and self.now >= self.timeline.end
                and at_rest(self.arm.qd, MODEL.limits)
            ):
                assert self.guard.stopped(self.stops[-1].number, now=self.now)

    def begin(self, manner: Manner) -> None:
        if manner is Manner.MEASURED:
            stop = from_measured(self.now, self.measured, self.arm.qd, MODEL.limits)
        else:
            stop = from_commanded(self.timeline, self.now, MODEL.limits)
        self.timeline, self.rest = stop.timeline, stop.rest

    def recover(self) -> None:
        """Resume, with an engine that begins where the robot was told to stay."""
        assert self.say(Kind.RESUME, self.guard.number) is Verdict.FRESH
        self.engine = Engine(MODEL, q=self.rest, clock=self.clock)


def stopped_really(rig: Rig) -> None:
    """Halted, slow, holding still, and deaf to commands: it doesn't move on (ros_controllers #48, #461)."""
    assert rig.guard.state is WatchdogState.HALTED
    assert rig.guard.reason is StopReason.TOLERANCE
    assert rig.guard.aborted is rig.aborts[-1]
    place = rig.arm.q
    assert rig.go(GOAL) is Verdict.HALTED
    rig.run(0.5)
    assert np.abs(rig.arm.q - place).max() < 5e-3
    assert max(rig.speeds[-20:]) < 0.05


def test_an_arm_too_heavily_laden_stops_and_can_go_on() -> None:
    with RealArm(q=Q) as arm:
        rig = Rig(arm)
        rig.run(0.1)
        assert rig.go(GOAL) is Verdict.FRESH
        rig.run(0.4)
        assert not rig.aborts
        arm.attach(Payload(16.0))
        rig.run(1.0)
        (abort,) = rig.aborts
        assert 0.5 < abort.t < 0.75
        assert abs(abort.error) > abort.tolerance == 0.03
        assert [stop.manner for stop in rig.stops] == [Manner.MEASURED]
        assert np.abs(arm.q - GOAL).max() > 0.1
        stopped_really(rig)
        arm.release()
        rig.run(0.2)
        rig.recover()
        assert rig.go(GOAL) is Verdict.FRESH
        rig.run(2.0)
        assert len(rig.aborts) == 1
        assert np.abs(arm.q - GOAL).max() < 2e-3
        assert max(rig.speeds[-20:]) < 1e-3


def test_an_arm_with_a_seized_joint_stops_and_can_go_on() -> None:
    with RealArm(Reality(), q=Q) as arm:
        rig = Rig(arm)
        rig.go(GOAL)
        rig.run(0.4)
        moving = arm._drives
        seized = [(high, low) for high, low in dynamics.JOINT_COULOMB]
        seized[0] = (500.0, -500.0)
        arm._drives = Drives(
            armature=dynamics.ARMATURE, viscous=dynamics.JOINT_VISCOUS, coulomb=seized, dt=arm.reality.dt
        )
        rig.run(1.0)
        assert rig.aborts[0].joint == 0
        stopped_really(rig)
        arm._drives = moving
        rig.recover()
        assert rig.go(GOAL) is Verdict.FRESH
        rig.run(2.5)
        assert np.abs(arm.q - GOAL).max() < 2e-3


def test_an_arm_whose_tool_is_held_stops_and_can_go_on() -> None:
    with RealArm(q=Q) as arm:
        rig = Rig(arm)
        rig.go(GOAL)
        rig.run(0.4)
        bullet, client = arm._world.bullet, arm._world.client
        place = bullet.getLinkState(arm._body, 5, physicsClientId=client)[0]
        grip = bullet.createConstraint(
            arm._body, 5, -1, -1, bullet.JOINT_POINT2POINT, [0] * 3, [0] * 3, place, physicsClientId=client
        )
        bullet.changeConstraint(grip, maxForce=2000, physicsClientId=client)
        rig.run(2.0)
        assert rig.aborts
        stopped_really(rig)
        bullet.removeConstraint(grip, physicsClientId=client)
        rig.run(0.5)
        rig.recover()
        assert rig.go(GOAL) is Verdict.FRESH
        rig.run(2.5)
        assert np.abs(arm.q - GOAL).max() < 2e-3


def test_without_an_operator_the_real_arm_stops_on_its_path() -> None:
    """There was no watchdog in rosaria #51, and a collision."""
    with RealArm(q=Q) as arm:
        rig = Rig(arm, WatchdogConfig(timeout=0.1))
        rig.go(GOAL)
        rig.run(0.4)
        rig.run(1.0, heartbeats=False)
        (stop,) = rig.stops
        assert (stop.reason, stop.manner) == (StopReason.LINK_LOSS, Manner.COMMANDED)
        assert stop.due <= stop.at <= stop.due + BLOCK * DT
        assert rig.guard.state is WatchdogState.HALTED
        assert not rig.aborts
        assert max(rig.speeds[-20:]) < 1e-3
        assert np.abs(arm.q - GOAL).max() > 0.05
