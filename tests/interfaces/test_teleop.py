"""Both sites over a link in virtual time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from interfaces import Supervisor
from interfaces.link import BernoulliLoss, Conditions, LinkConditions, Service, delay_profile
from interfaces.messages.sites import LogEntry, Orders
from interfaces.runtime.laboratory import Laboratory
from interfaces.teleop import FollowingArm, OperatorSite, RobotSiteConfig, VirtualArm
from interfaces.teleop.following_arm import ReceivedLog
from interfaces.teleop.operator import Halt, HaltCause
from robots import puma560
from robots.onboard.watchdog import WatchdogConfig
from vrs import Insertion, JointTarget, MotionCommand, SteerCommand, Stop
from vrs.model import Array

MODEL = puma560.model()
LIMITS = MODEL.limits
NOMINAL = MODEL.poses["nominal"]


def laboratory(
    profile: str, seed: int, *, D: float | None = None, loss: float = 0.0, duplicate: float = 0.0,
    service: Service = Service.IN_ORDER, length: float = 15.0, tick: float = 0.02,
    conditions: Conditions | None = None,
) -> Laboratory:  # fmt: skip
    """Both sites, and an operator who moves, redirects, steers, stops and takes back for some seconds."""
    rng = np.random.default_rng(seed)
    operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    robot = FollowingArm(MODEL, NOMINAL, now=0.0, config=RobotSiteConfig(fixed_offset=D))
    if conditions is None:
        delay = delay_profile(profile)
        conditions = Conditions(delay=delay, loss=BernoulliLoss(loss), duplicate=duplicate, service=service)
    lab = Laboratory(operator, robot, LinkConditions.symmetric(conditions), rng, tick=tick)

    def move(q: Array, wait: float, how: Insertion, speed: float) -> None:
        command = MotionCommand(JointTarget(q), None, t + wait, speed, insertion=how)
        lab.schedule(t, lambda now: operator.robot.execute(command, now=now))

    def steer(rates: Array) -> None:
        for k in range(20):
            command = SteerCommand(rates=rates * np.sin(0.3 * k))
            lab.schedule(t + 0.05 * k, lambda now, command=command: operator.robot.execute(command, now=now))

    t = 0.5
    while t < length:
        choice = rng.random()
        if choice < 0.15:
            steer(rng.uniform(-0.4, 0.4, 6) * LIMITS.qd_max)
            t += 1.2
        elif choice < 0.25:
            lab.schedule(t, lambda now: operator.robot.undo(now=now))
        elif choice < 0.3:
            lab.schedule(t, lambda now: operator.robot.execute(Stop(), now=now))
        else:
            q = np.clip(NOMINAL + rng.uniform(-0.8, 0.8, 6), LIMITS.q_min, LIMITS.q_max)
            move(
                q,
                float(rng.choice([0.0, 0.0, 0.5, 2.0])),
                rng.choice(list(Insertion)),
                float(rng.choice([0.3, 0.6, 1])),
            )
        t += float(rng.exponential(0.8))
    return lab


def settle(lab: Laboratory, longest: float) -> None:
    lab.run(lab.operator.robot.engine.timeline.end + longest)


def check_body(lab: Laboratory) -> None:
    """What the body was asked to do keeps the limits, and has no jumps."""
    q, qd, qdd = lab.reference
    assert (np.abs(qd) <= LIMITS.qd_max * (1 + 1e-9)).all()
    assert (np.abs(qdd) <= LIMITS.qdd_max * (1 + 1e-9)).all()
    tick = float(lab.t[1] - lab.t[0])
    assert (np.abs(np.diff(q, axis=0)) <= LIMITS.qd_max * tick * (1 + 1e-9)).all()
    assert (np.abs(np.diff(qd, axis=0)) <= LIMITS.qdd_max * tick * (1 + 1e-6) + 1e-9).all()


@pytest.mark.parametrize(
    ("profile", "service", "loss", "duplicate"),
    [
        ("constant:0.3", Service.IN_ORDER, 0.0, 0.0),
        ("domain", Service.IN_ORDER, 0.0, 0.0),
        ("mon", Service.DATAGRAM, 0.3, 0.2),
        ("wed", Service.DATAGRAM, 0.1, 0.5),
    ],
)
def test_with_an_adaptive_offset_both_timelines_are_one(
    profile: str, service: Service, loss: float, duplicate: float
) -> None:
    lab = laboratory(profile, 1, service=service, loss=loss, duplicate=duplicate)
    settle(lab, 60.0)
    assert lab.robot.engine.timeline == lab.operator.robot.engine.timeline
    check_body(lab)
    # The body was on the operator's way throughout: only later.
    assert np.array_equal(lab.operator.robot.engine.timeline.sample(lab.play[:, 1]), lab.reference.q)
    assert not lab.operator.robot.corrections
    assert not lab.robot.halted


def test_the_offset_follows_the_delay() -> None:
    for delay in (0.1, 0.6):
        lab = laboratory(f"constant:{delay}", 2)
        settle(lab, 20.0)
        behind = lab.play[-200:, 0] - lab.play[-200:, 1]
        assert behind.min() >= delay
        assert behind.max() <= delay + 1.0


def test_a_fixed_offset_as_long_as_the_delay_postpones_nothing() -> None:
    lab = laboratory("constant:0.3", 3, D=-0.3)
    settle(lab, 5.0)
    assert not lab.operator.robot.corrections
    t = np.linspace(0.0, lab.now, 2000)
    assert np.abs(lab.robot.engine.timeline.sample(t) - lab.operator.robot.engine.timeline.sample(t)).max() < 1e-9


def test_where_commands_come_late_the_virtual_robot_follows_the_real_one() -> None:
    lab = laboratory("constant:0.3", 3, D=-0.1)
    settle(lab, 30.0)
    assert lab.operator.robot.corrections
    assert lab.robot.parted
    t = lab.now + np.linspace(0.0, 20.0, 50)
    assert np.abs(lab.robot.engine.timeline.sample(t) - lab.operator.robot.engine.timeline.sample(t)).max() < 1e-9
    check_body(lab)


def test_an_arm_that_is_held_stops_and_goes_on_only_when_told() -> None:
    """The body is blocked in mid-motion: the robot stops where it is, the virtual one goes there."""
    lab = laboratory("constant:0.2", 4, length=0.0)
    operator, robot = lab.operator, lab.robot
    lab.schedule(0.5, lambda now: operator.robot.execute(MotionCommand(JointTarget(NOMINAL + 0.8)), now=now))
    lab.run(1.5)
    robot.measured(NOMINAL + 0.1, now=lab.now)
    assert "from where it should be" in robot.halted
    lab.run(4.0)
    assert operator.halted == Halt(HaltCause.REPORTED, robot.halted)
    assert operator.robot.corrections[-1].error.any()
    assert np.abs(operator.robot.engine.joints(4.0) - NOMINAL - 0.1).max() < 1e-9
    assert "resume" in operator.robot.execute(MotionCommand(JointTarget(NOMINAL)), now=4.0).reason
    assert operator.resume(now=4.0) == ""
    assert operator.robot.execute(MotionCommand(JointTarget(NOMINAL), execute_at=4.5), now=4.0).stands
    lab.run(8.0)
    assert not robot.halted
    assert robot.epoch == 2
    assert np.abs(robot.engine.joints(8.0) - NOMINAL).max() < 1e-9
    assert np.abs(lab.measured[-1] - NOMINAL).max() < 1e-9


def test_t08_after_an_outage_nothing_from_before_it_is_executed() -> None:
    """Watchdog: the robot stops within T_loss + 20 ms, whatever it does, and waits for a new epoch."""
    operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    robot = FollowingArm(MODEL, NOMINAL, now=0.0, config=RobotSiteConfig(watchdog=WatchdogConfig(timeout=0.5)))
    lab = Laboratory(operator, robot, LinkConditions(), np.random.default_rng(0), tick=0.005)
    lab.schedule(
        1.0, lambda now: operator.robot.execute(MotionCommand(JointTarget(NOMINAL + 0.8), speed=0.1), now=now)
    )
    lab.run(1.5)
    assert not robot.halted
    late: list[Orders] = []
    now = lab.now
    while now < 6.5:
        now = round(now + 0.01, 9)
        if now == 2.5:
            operator.robot.execute(MotionCommand(JointTarget(NOMINAL - 0.5)), now=now)
        late += operator.advance(now=now)
        for report in robot.advance(now=now):
            if now > 6.0:
                operator.receive(report, now=now)
    assert "link loss" in robot.halted
    stopped = robot.engine.timeline
    for orders in late:
        robot.receive(orders, now=now)
    assert robot.engine.timeline is stopped
    play = robot.play_at(np.arange(1.0, 6.5, 0.005))
    q, qd, qdd = robot.reference(play)
    assert (np.abs(qdd) <= LIMITS.qdd_max * (1 + 1e-9)).all()
    moving = 1.0 + 0.005 * np.flatnonzero(np.abs(qd).max(1) > 1e-9)
    assert moving[0] < 1.5
    assert moving[-1] < 1.5 + 0.5 + 0.02 + 0.5
    assert 0.01 < np.abs(q[-1] - NOMINAL).max() < 0.5
    assert operator.halted
    lab.now = now
    lab.run(now + 3.0)
    assert operator.resume(now=lab.now) == ""
    assert operator.robot.execute(MotionCommand(JointTarget(NOMINAL)), now=lab.now).stands
    lab.run(lab.now + 8.0)
    assert not robot.halted
    assert np.abs(robot.engine.joints(lab.now) - NOMINAL).max() < 1e-9


def test_a_supervisor_of_the_virtual_robot_moves_the_real_one() -> None:
    lab = laboratory("constant:0.2", 4, length=0.0)
    supervisor = Supervisor(lab.operator.robot.engine)
    lab.schedule(1.0, lambda now: supervisor.issue(MotionCommand(JointTarget(NOMINAL + 0.2)), now=now))
    lab.run(5.0)
    assert np.abs(lab.measured[-1] - NOMINAL - 0.2).max() < 1e-9
    assert lab.operator.robot.receipts[1].stands


# Starved where one joint needs all of its acceleration: it goes on at a lower pace.
@example(
    seed=469, loss=0.44012571245102416, duplicate=0.0001, reorder=0.4166304010247954, mean=0.42730838066067267,
    service=Service.IN_ORDER,
)  # fmt: skip
@settings(max_examples=8, deadline=None, phases=(Phase.explicit, Phase.reuse, Phase.generate))
@given(
    seed=st.integers(0, 1000), loss=st.floats(0, 0.5), duplicate=st.floats(0, 0.5), reorder=st.floats(0, 0.5),
    mean=st.floats(0.02, 0.6), service=st.sampled_from(list(Service)),
)  # fmt: skip
def test_any_link_keeps_the_laws(
    seed: int, loss: float, duplicate: float, reorder: float, mean: float, service: Service
) -> None:
    """Delays, losses, duplicates and reorderings: the body keeps the limits, and goes the virtual robot's way."""
    # In order, what is lost holds back all after it for a second and more: many losses leave nothing through.
    loss = 0.1 * loss if service is Service.IN_ORDER else loss
    conditions = Conditions(
        delay=delay_profile(f"gamma:{mean:.3f},{0.7 * mean:.3f}"), loss=BernoulliLoss(loss), duplicate=duplicate,
        reorder=reorder, reorder_by=0.3, service=service,
    )  # fmt: skip
    lab = laboratory("none", seed, length=6.0, conditions=conditions)
    settle(lab, 120.0)
    assert lab.robot.engine.timeline == lab.operator.robot.engine.timeline
    check_body(lab)
    play = lab.play[lab.play[:, 0] > 2.0]
    assert (np.diff(play[:, 1]) >= 0).all()
    assert play[:, 2].max() <= 1.05
    assert play[-1, 1] > lab.operator.robot.engine.timeline.end


def test_over_a_lossy_link_timelines_that_parted_agree_again_in_a_stated_time() -> None:
    """After the last command: its delay, the time after which it counts as lost, a round trip, the correction."""
    for seed in range(3):
        lab = laboratory("constant:0.2", seed, D=-0.1, loss=0.3, service=Service.DATAGRAM, length=6.0)
        lab.run(6.0)
        last = lab.now
        while _apart(lab) > 1e-9 and lab.now < last + 60.0:
            lab.run(lab.now + 0.5)
        corrections = [c.end - c.t for c in lab.operator.robot.corrections]
        longest = max(corrections, default=0.0)
        assert lab.now - last <= 0.2 + 8 * (0.1 + 1.2 * 0.5) + 2 * longest + 0.5


def _apart(lab: Laboratory) -> float:
    """How far the plans are apart from now on [rad]."""
    t = lab.now + np.linspace(0.0, 30.0, 600)
    return float(np.abs(lab.robot.engine.timeline.sample(t) - lab.operator.robot.engine.timeline.sample(t)).max())


def test_what_is_of_an_old_epoch_is_ignored() -> None:
    lab = laboratory("constant:0.2", 4, length=0.0)
    operator, robot = lab.operator, lab.robot
    lab.run(1.0)
    operator.robot.execute(MotionCommand(JointTarget(NOMINAL + 0.3)), now=1.0)
    (old,) = operator.advance(now=1.0)
    robot.halt("somebody pulled the plug", now=1.0)
    lab.run(3.0)
    assert operator.resume(now=3.0) == ""
    lab.run(4.0)
    before = robot.engine.timeline
    robot.receive(old, now=4.0)
    assert robot.engine.timeline is before


def test_what_waits_for_a_lost_entry_isnt_complete() -> None:
    first, second, third = (LogEntry(k, float(k), k, None) for k in (1, 2, 3))
    log = ReceivedLog(0.0)
    assert log.due((third,), as_they_come=False) == []
    log.claim(3, 9.0)
    assert log.complete_until == 0.0
    assert log.due((first,), as_they_come=False) == [first]
    log.claim(1, 5.0)
    assert log.complete_until == 5.0
    assert log.due((second,), as_they_come=False) == [second, third]
    log.claim(3, 8.0)
    assert log.complete_until == 9.0


def test_entries_that_nobody_acknowledges_are_sent_again() -> None:
    operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    for k in range(10):
        operator.robot.execute(MotionCommand(JointTarget(NOMINAL + 0.01 * k)), now=0.0)
    sent = []
    for _ in range(40):
        (orders,) = operator.advance(now=operator.next_deadline())
        sent.append([entry.number for entry in orders.entries])
    everything = list(range(1, 11))
    assert sent[0] == everything
    assert sent[1] == [8, 9, 10]
    again = next(k for k, numbers in enumerate(sent) if k and numbers == everything)
    # As long as an answer may take: a second at first.
    assert 1.0 <= operator.robot.config.beat * again <= 1.2


def test_of_more_lost_entries_than_a_message_takes_each_has_its_turn() -> None:
    operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    for k in range(100):
        operator.robot.execute(MotionCommand(JointTarget(NOMINAL + 0.001 * k)), now=0.0)
    again: set[int] = set()
    operator.advance(now=operator.next_deadline())
    for _ in range(30):
        (orders,) = operator.advance(now=operator.next_deadline())
        assert len(orders.entries) <= operator.robot.config.resent + operator.robot.config.repeat
        again |= {entry.number for entry in orders.entries}
    assert again == set(range(1, 101))


def test_what_was_under_way_to_a_robot_that_halted_isnt_expected_of_it() -> None:
    lab = laboratory("constant:0.2", 4, length=0.0)
    operator, robot = lab.operator, lab.robot
    lab.run(1.0)
    operator.robot.execute(MotionCommand(JointTarget(NOMINAL + 0.3)), now=1.0)
    robot.halt("somebody pulled the plug", now=1.0)
    lab.run(1.3)
    assert operator.halted
    sent = [entry for orders in operator.advance(now=operator.next_deadline()) for entry in orders.entries]
    assert not sent
    lab.run(6.0)
    assert _apart(lab) < 1e-9
    assert np.abs(operator.robot.engine.joints(lab.now) - NOMINAL).max() < 1e-9


def test_an_arm_that_has_stopped_may_be_held_elsewhere() -> None:
    robot = FollowingArm(MODEL, NOMINAL, now=0.0)
    robot.halt("somebody pulled the plug", now=1.0)
    robot.halt("it was pushed", now=2.0)
    np.testing.assert_allclose(robot.engine.timeline.sample(9.0), NOMINAL, rtol=0, atol=1e-12)
    robot.halt("it was pushed", now=3.0, measured=NOMINAL + 0.05)
    np.testing.assert_allclose(robot.engine.timeline.sample(9.0), NOMINAL + 0.05, rtol=0, atol=1e-12)
    assert robot.halted == "somebody pulled the plug"
