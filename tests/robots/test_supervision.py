from __future__ import annotations

import math
import pickle
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots import puma560
from robots.onboard.following import FollowingAbort
from robots.onboard.lease import Ended, Grant, LeaseConfig, LeaseEnd, LeaseRefusal, Pending
from robots.onboard.stamps import Kind, Stamp, Verdict
from robots.onboard.supervision import Output, Supervision
from robots.onboard.values import Refusal, RefusalCode, ValueGuard
from robots.onboard.watchdog import BeginStop, GoOn, LossPolicy, Manner, StopReason, WatchdogConfig, WatchdogState
from vrs import Engine, JointTarget, ManualClock, MotionCommand, Profile, SteerCommand
from vrs.errors import InvalidValueError

MODEL = puma560.model()
LIMITS = MODEL.limits
Q = MODEL.poses["nominal"]
GUARD = ValueGuard(LIMITS, tool_speed=MODEL.tool_speed, tool_turn_speed=MODEL.tool_turn_speed)
TICK = 1e-3


def held(**values: object) -> Supervision:
    guard = Supervision(WatchdogConfig(**values), guard=GUARD)  # type: ignore[arg-type]
    assert guard.acquire("ann", now=0.0) == Grant(1, "ann", 0.0)
    assert guard.advance(now=0.0) == (GoOn(0.0, 1),)
    return guard


def say(guard: Supervision, sequence: int, now: float, *, epoch: int = 1, **changes: object) -> Verdict | Refusal:
    return guard.receive(Stamp(epoch, sequence, now, **changes), now=now, authentic=True)  # type: ignore[arg-type]


def begun(outputs: tuple[Output, ...]) -> BeginStop:
    (stop,) = [item for item in outputs if isinstance(item, BeginStop)]
    return stop


def test_a_take_over_passes_through_a_stop() -> None:
    guard = held()
    assert guard.take_over("eve", admin=False, now=0.1) is LeaseRefusal.NOT_ADMIN
    assert guard.take_over("eve", admin=True, now=0.1) == Pending("eve")
    assert say(guard, 0, 0.1) is Verdict.STALE_EPOCH
    ended, stop = guard.advance(now=0.1)
    assert ended == Ended(1, "ann", LeaseEnd.TAKEN_OVER, 0.1)
    assert isinstance(stop, BeginStop)
    assert stop.reason is StopReason.LEASE
    assert (guard.state, guard.epoch) == (WatchdogState.STOPPING, None)
    assert say(guard, 0, 0.2, epoch=2) is Verdict.UNKNOWN_EPOCH
    assert not guard.stopped(stop.number - 1, now=0.3)
    assert guard.advance(now=0.3) == ()
    assert guard.stopped(stop.number, now=0.4)
    assert guard.advance(now=0.4) == (Grant(2, "eve", 0.4), GoOn(0.4, 2))
    assert guard.release(1, now=0.4) is LeaseRefusal.STALE_EPOCH
    assert say(guard, 0, 0.5) is Verdict.STALE_EPOCH
    assert say(guard, 0, 0.5, epoch=2) is Verdict.FRESH


def test_an_expired_lease_is_free_only_once_the_watchdog_has_stopped_the_robot() -> None:
    guard = held()
    first = begun(guard.advance(now=0.5))
    assert (first.reason, first.due) == (StopReason.LINK_LOSS, 0.5)
    assert guard.holder == "ann"
    second = begun(guard.advance(now=2.0))
    assert second.reason is StopReason.LEASE
    assert not guard.stopped(first.number, now=2.1)
    assert guard.acquire("bob", now=2.1) is LeaseRefusal.ENDING
    assert guard.stopped(second.number, now=2.2)
    assert guard.holder is None
    assert say(guard, 3, 2.2, kind=Kind.RESUME, answers=second.number) is Verdict.STALE_EPOCH
    assert guard.acquire("bob", now=2.3) == Grant(2, "bob", 2.3)


def test_heartbeats_keep_the_lease_of_a_robot_that_has_stopped() -> None:
    guard = held()
    guard.stopped(begun(guard.advance(now=0.5)).number, now=0.6)
    for k in range(100):
        assert say(guard, k, 0.7 + 0.1 * k, kind=Kind.HEARTBEAT) is Verdict.NOTED
    assert (guard.holder, guard.state) == ("ann", WatchdogState.HALTED)


def test_refused_messages_keep_neither_robot_nor_lease() -> None:
    guard = held()
    bad = MotionCommand(JointTarget(LIMITS.q_max + 1))
    for k in range(49):
        now = 0.01 * k
        before = pickle.dumps(guard)
        refusal = guard.receive(Stamp(1, k, now), bad, now=now, authentic=True)
        assert isinstance(refusal, Refusal)
        assert refusal.code is RefusalCode.OUT_OF_LIMITS
        assert guard.receive(Stamp(1, k, now), bad, now=now, authentic=False) is Verdict.NOT_AUTHENTIC
        assert pickle.dumps(guard) == before
    assert begun(guard.advance(now=0.5)).due == 0.5
    assert begun(guard.advance(now=2.0)).reason is StopReason.LEASE


def test_a_violation_is_kept_until_the_robot_may_move_again() -> None:
    guard = held()
    violation = FollowingAbort(0.1, 2, 0.05, 0.03, np.zeros(6), np.zeros(6))
    guard.abort(violation, now=0.1)
    stop = begun(guard.advance(now=0.1))
    assert (stop.reason, stop.manner) == (StopReason.TOLERANCE, Manner.MEASURED)
    assert guard.aborted is violation
    guard.stopped(stop.number, now=0.3)
    assert say(guard, 0, 0.3, kind=Kind.RESUME, answers=stop.number) is Verdict.FRESH
    assert guard.aborted is None


def test_a_free_robot_that_is_stopping_isnt_given_away() -> None:
    guard = Supervision()
    guard.stop(StopReason.FAULT, now=0.0)
    assert guard.acquire("ann", now=0.1) is LeaseRefusal.ENDING
    assert guard.take_over("ann", admin=True, now=0.1) is LeaseRefusal.ENDING
    guard.stopped(begun(guard.advance(now=0.1)).number, now=0.2)
    assert guard.acquire("ann", now=0.2) == Grant(1, "ann", 0.2)


def test_a_lease_shorter_than_the_timeout_would_be_a_second_timeout() -> None:
    with pytest.raises(InvalidValueError, match="lease timeout"):
        Supervision(WatchdogConfig(timeout=1.0), LeaseConfig(timeout=0.9))
    assert Supervision(WatchdogConfig(timeout=1.0), LeaseConfig(timeout=1.0)).holder is None


def test_only_an_admin_takes_over_a_lease_that_is_free() -> None:
    guard = Supervision()
    assert guard.take_over("eve", admin=False, now=0.0) is LeaseRefusal.NOT_ADMIN
    assert guard.holder is None
    assert guard.take_over("eve", admin=True, now=0.0) == Grant(1, "eve", 0.0)


def test_the_next_deadline_is_the_earlier() -> None:
    guard = held()
    assert guard.next_deadline() == 0.5
    guard.advance(now=0.5)
    assert guard.next_deadline() == 2.0
    assert Supervision().next_deadline() is None


@dataclass
class Robot:
    """A robot on its own engine, under supervision, stepped tick by tick."""

    policy: LossPolicy = LossPolicy.HALT
    timeout: float = 0.5
    ticks: int = 0
    epoch: int = 1
    executed: list[Stamp] = field(default_factory=list)
    stops: list[BeginStop] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.clock = ManualClock(0.0)
        self.engine = Engine(MODEL, q=Q, clock=self.clock)
        self.guard = Supervision(WatchdogConfig(policy=self.policy, timeout=self.timeout), guard=GUARD)
        self.guard.acquire("ann", now=0.0)

    @property
    def now(self) -> float:
        return self.ticks * TICK

    def tick(self) -> None:
        self.ticks += 1
        self.clock.set(self.now)
        for item in self.guard.advance(now=self.now):
            if isinstance(item, BeginStop):
                self.engine.stop()
                self.stops.append(item)
        if self.guard.state is WatchdogState.STOPPING and self.now >= self.engine.timeline.end:
            self.guard.stopped(self.stops[-1].number, now=self.now)

    def run(self, until: float) -> None:
        while self.now < until - TICK / 2:
            self.tick()

    def hear(self, stamp: Stamp, command: MotionCommand | SteerCommand | None = None) -> Verdict | Refusal:
        verdict = self.guard.receive(stamp, command, now=self.now, authentic=True)
        if verdict is Verdict.FRESH:
            self.executed.append(stamp)
            if command is not None:
                self.engine.execute(command)
        return verdict


def targets(seed: int) -> MotionCommand:
    return MotionCommand(JointTarget(Q + np.random.default_rng(seed).uniform(-0.6, 0.6, 6)))


@given(st.floats(0.0, 3.0), st.sampled_from((0.1, 0.3, 0.5)), st.sampled_from(Profile), st.integers(0, 2**16))
@settings(max_examples=25, deadline=None)
def test_no_watchdog_collision(silence: float, timeout: float, profile: Profile, seed: int) -> None:
    """rosaria #51: the operator falls silent at any instant of moves, holds and steering, and the robot stops."""
    robot, k = Robot(timeout=timeout), 0
    rng = np.random.default_rng(seed)
    last = 0.0
    while robot.now < silence:
        command: MotionCommand | SteerCommand | None = None
        if k % 40 == 0:
            q = Q + rng.uniform(-0.6, 0.6, 6)
            command = MotionCommand(JointTarget(q), profile=profile, execute_at=robot.now + rng.uniform(0, 0.5))
        elif k % 40 > 30:
            command = SteerCommand(rates=rng.uniform(-0.3, 0.3, 6))
        last = robot.now
        assert robot.hear(Stamp(1, k, last), command) is Verdict.FRESH
        k += 1
        robot.run(robot.now + 0.02)
    planned = robot.engine.timeline
    robot.run(last + timeout + 3.0)
    (stop,) = robot.stops[:1]
    assert last + timeout <= stop.at <= last + timeout + TICK * 1.001
    made = robot.engine.timeline
    before = np.linspace(0.0, stop.at - 1e-9, 2000)
    np.testing.assert_array_equal(made.sample(before), planned.sample(before))
    after = np.arange(stop.at, stop.at + 3.0, 1e-4)
    qd, qdd = made.sample(after, derivative=1), made.sample(after, derivative=2)
    assert (np.abs(qd) <= LIMITS.qd_max * (1 + 1e-9)).all()
    assert (np.abs(qdd) <= LIMITS.qdd_max * (1 + 1e-9)).all()
    assert np.abs(qd[0] - made.state_before(stop.at).qd).max() <= 1e-9
    assert np.abs(made.sample(stop.at) - made.state_before(stop.at).q).max() <= 1e-12
    assert not made.sample(stop.at + 2.9, derivative=1).any()


@pytest.mark.parametrize("resumes", ["resume", "lease"])
@pytest.mark.parametrize("drift", [0.0, 3600.0])
def test_a_channel_that_buffers_an_outage_moves_nothing_at_its_end(resumes: str, drift: float) -> None:
    """libdatachannel #1518 delivered it all at the end. Not even stamps that lie about their age help it."""
    robot = Robot()
    for k in range(50):
        robot.hear(Stamp(1, k, robot.now), targets(k))
        robot.run(robot.now + 0.02)
    buffered = [(Stamp(1, 50 + k, robot.now + 0.02 * k + drift), targets(k)) for k in range(250)]
    robot.run(robot.now + 5.0)
    assert robot.guard.reason in (StopReason.LINK_LOSS, StopReason.LEASE)
    count, place = len(robot.executed), robot.engine.joints()
    for stamp, command in buffered:
        assert robot.hear(stamp, command) is not Verdict.FRESH
    robot.run(robot.now + 1.0)
    assert len(robot.executed) == count
    np.testing.assert_array_equal(robot.engine.joints(), place)
    begun_again = robot.guard.acquire("ann", now=robot.now)
    assert isinstance(begun_again, Grant)
    if resumes == "resume":
        robot.guard.stop(StopReason.OPERATOR, now=robot.now)
        robot.tick()
        robot.run(robot.now + 0.01)
        answer = Stamp(begun_again.epoch, 500, robot.now, Kind.RESUME, robot.guard.number)
        assert robot.hear(answer) is Verdict.FRESH
        late = Stamp(begun_again.epoch, 499, robot.now)
        assert robot.hear(late, targets(1)) is Verdict.BEFORE_RESUME
    for stamp, command in buffered:
        assert robot.hear(stamp, command) is Verdict.STALE_EPOCH
    robot.run(robot.now + 0.1)
    np.testing.assert_array_equal(robot.engine.joints(), place)


@given(
    st.floats(0.0, 2.0),
    st.lists(st.floats(0.0, 6.0), min_size=20, max_size=20),
    st.integers(0, 2**16),
    st.booleans(),
)
@settings(max_examples=25, deadline=None)
def test_after_an_outage_nothing_issued_before_it_is_executed(
    begin: float, delays: list[float], seed: int, by_resume: bool
) -> None:
    """5 s of outage at any instant; what was sent meanwhile comes in any order, some of it after the resume."""
    robot, k = Robot(), 0
    rng = np.random.default_rng(seed)
    while robot.now < begin:
        robot.hear(Stamp(1, k, robot.now), targets(k) if k % 10 == 0 else None)
        k += 1
        robot.run(robot.now + 0.02)
    start, end = robot.now, robot.now + 5.0
    lost = [Stamp(1, k + i, start + 5.0 * i / len(delays)) for i in range(len(delays))]
    k += len(lost)
    arrivals = sorted((end + delay, i) for i, delay in enumerate(delays))
    if not by_resume:
        robot.run(end)
    else:
        # Heartbeats that get through keep the lease; commands don't get through.
        while robot.now < end:
            robot.run(robot.now + 0.6)
            robot.hear(Stamp(1, 10_000 + robot.ticks, robot.now, Kind.HEARTBEAT))
    count = len(robot.executed)
    at = end + rng.uniform(0, 1.0)
    resumed = False
    for arrival, i in arrivals:
        if not resumed and arrival >= at:
            robot.run(at)
            if by_resume and robot.guard.holder == "ann":
                stamp = Stamp(1, 10_000 + robot.ticks, robot.now, Kind.RESUME, robot.guard.number)
                resumed = robot.hear(stamp) is Verdict.FRESH
            else:
                resumed = isinstance(robot.guard.acquire("ann", now=robot.now), Grant)
        robot.run(arrival)
        robot.hear(lost[i], targets(i))
    executed = robot.executed[count:]
    assert [stamp for stamp in executed if stamp.kind is not Kind.RESUME and stamp.issued_at < end] == []


def test_under_hold_what_was_late_is_executed_by_design() -> None:
    robot = Robot(policy=LossPolicy.HOLD, timeout=0.5)
    robot.hear(Stamp(1, 0, 0.0), targets(0))
    robot.run(1.8)
    assert robot.guard.reason is StopReason.LINK_LOSS
    assert robot.hear(Stamp(1, 1, 0.05), targets(1)) is Verdict.FRESH
    robot.run(2.2)
    assert robot.engine.joints(2.2) is not None
    assert robot.engine.timeline.sample(2.2, derivative=1).any()


def test_it_doesnt_keep_moving_after_an_abort() -> None:
    """ros_controllers #48, #461: aborted, and the motors went on."""
    robot = Robot()
    robot.hear(Stamp(1, 0, 0.0), targets(0))
    robot.run(0.3)
    robot.guard.stop(StopReason.FAULT, now=robot.now)
    robot.run(1.0)
    assert robot.guard.state is WatchdogState.HALTED
    for k in range(1, 100):
        assert robot.hear(Stamp(1, k, robot.now), targets(k)) is Verdict.HALTED
        assert robot.hear(Stamp(1, 1000 + k, robot.now, Kind.HEARTBEAT)) is Verdict.NOTED
        robot.run(robot.now + 0.02)
    q = robot.engine.timeline.sample(np.linspace(1.0, robot.now + 9, 500))
    np.testing.assert_array_equal(q, np.tile(q[0], (500, 1)))


@pytest.mark.parametrize("now", [math.nan, -1.0])
def test_time_that_isnt_or_runs_back_is_refused(now: float) -> None:
    guard = held()
    say(guard, 0, 0.1)
    before = pickle.dumps(guard)
    violation = FollowingAbort(0.1, 2, 0.05, 0.03, np.zeros(6), np.zeros(6))
    for call in (
        lambda: guard.advance(now=now),
        lambda: say(guard, 1, now),
        lambda: guard.stop(StopReason.FAULT, now=now),
        lambda: guard.abort(violation, now=now),
        lambda: guard.acquire("bob", now=now),
        lambda: guard.release(1, now=now),
    ):
        with pytest.raises(InvalidValueError):
            call()
    assert pickle.dumps(guard) == before
