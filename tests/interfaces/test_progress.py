"""A robot that hears the operator and doesn't carry out what it's told counts as halted, and resuming mends it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interfaces.link import BernoulliLoss, Conditions, LinkConditions, Service, delay_profile
from interfaces.messages.sites import Orders
from interfaces.runtime.laboratory import Laboratory
from interfaces.teleop import FollowingArm, OperatorSite, RobotSiteConfig, VirtualArm
from robots import puma560
from robots.onboard.watchdog import WatchdogConfig
from vrs import JointTarget, MotionCommand, SteerCommand

MODEL = puma560.model()
NOMINAL, READY = MODEL.poses["nominal"], MODEL.poses["ready"]
HALT = WatchdogConfig(max_age=2.0, max_uncertainty=1.0)
SERVICES = (Service.DATAGRAM, Service.IN_ORDER)


def sites(delay: str, *, loss: float = 0.0, service: Service = Service.DATAGRAM, halts: bool = False) -> Laboratory:
    conditions = Conditions(delay=delay_profile(delay), loss=BernoulliLoss(loss), service=service)
    robot = FollowingArm(MODEL, NOMINAL, now=0.0, config=RobotSiteConfig(watchdog=HALT if halts else None))
    operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    return Laboratory(operator, robot, LinkConditions.symmetric(conditions), np.random.default_rng(1))


def move(lab: Laboratory, q: np.ndarray, *, now: float) -> None:
    lab.schedule(now, lambda t: lab.operator.robot.execute(MotionCommand(JointTarget(q)), now=t))


def never_hears(robot: FollowingArm, missing: int) -> None:
    """Let an entry of the first epoch get lost between the link and the robot, however often it's sent."""
    receive = robot.receive

    def lossy(orders: Orders, **named: float) -> None:
        kept = tuple(e for e in orders.entries if orders.epoch > 1 or e.number != missing)
        receive(replace(orders, entries=kept), **named)

    robot.receive = lossy  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("delay", "halts", "within"),
    [("constant:0.01", True, 3.0), ("constant:0.01", False, 3.0), ("constant:1", False, 40.0)],
)
def test_a_robot_that_waits_for_ever_is_halted_and_resuming_mends_it(delay, halts, within):
    lab = sites(delay, halts=halts)
    never_hears(lab.robot, 2)
    for k, q in enumerate((READY, NOMINAL, READY)):
        move(lab, q, now=6.0 + 0.5 * k)
    lab.run(6.9)
    assert not lab.operator.halted
    lab.run(7.0 + within)
    operator, robot = lab.operator, lab.robot
    assert "hasn't carried out" in operator.halted.text
    assert "hasn't carried out" in robot.halted
    assert operator.robot.engine.execute(MotionCommand(JointTarget(READY))).status == "rejected"
    lab.run(lab.now + 15.0)
    assert operator.resume(now=lab.now) == ""
    move(lab, READY, now=lab.now + 0.1)
    lab.run(lab.now + 15.0)
    assert not operator.halted
    assert not robot.halted
    assert np.allclose(robot.engine.timeline.sample(lab.now), READY, atol=1e-9)


@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize(("delay", "loss"), [("mon", 0.2), ("tue", 0.0), ("wed", 0.3), ("constant:20", 0.5)])
def test_long_ways_that_lose_much_are_no_halt(delay, loss, service):
    lab = sites(delay, loss=loss, service=service)
    for k in range(60):
        move(lab, READY if k % 2 else NOMINAL, now=1.0 + 2.0 * k)
    halted = []
    lab.schedule(0.0, lambda t: None)
    for _ in range(200):
        lab.run(lab.now + 1.0)
        if lab.operator.halted:
            halted.append((lab.now, lab.operator.halted.text))
            break
    assert not halted


def test_a_robot_that_doesnt_take_up_a_new_epoch_is_halted_again():
    lab = sites("constant:0.01")
    lab.run(2.0)
    lab.robot.halt("for a reason", now=lab.now)
    lab.run(4.0)
    begin, lab.robot.begin = lab.robot.begin, lambda orders, now: None  # type: ignore[method-assign]
    assert lab.operator.resume(now=lab.now) == ""
    assert not lab.operator.halted
    lab.run(lab.now + 11.0)
    assert "resumed" in lab.operator.halted.text
    lab.robot.begin = begin  # type: ignore[method-assign]
    assert lab.operator.resume(now=lab.now) == ""
    lab.run(lab.now + 3.0)
    assert not lab.operator.halted
    assert lab.robot.epoch == lab.operator.epoch


@pytest.mark.parametrize("service", SERVICES)
def test_an_outage_right_after_resuming_is_no_halt(service):
    lab = sites("constant:0.05", service=service)
    lab.run(2.0)
    lab.robot.halt("for a reason", now=lab.now)
    lab.run(4.0)
    assert lab.operator.resume(now=lab.now) == ""
    before = lab.link.conditions
    down = replace(before.forward, loss=BernoulliLoss(1.0), service=Service.DATAGRAM)
    lab.link.change(LinkConditions.symmetric(down), lab.now)
    lab.run(lab.now + 30.0)
    lab.link.change(before, lab.now)
    lab.run(lab.now + 3.0)
    assert not lab.operator.halted
    assert not lab.robot.halted
    assert lab.robot.epoch == lab.operator.epoch


@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize("delay", ["constant:0.05", "mon"])
def test_an_outage_while_somebody_steers_is_no_halt(delay, service):
    """The robot hears again before all that got lost has been sent again: it needs a moment for that."""
    lab = sites(delay, service=service)
    lab.run(5.0)
    up, report = lab.link.conditions, None
    down = replace(up.forward, loss=BernoulliLoss(1.0), service=Service.DATAGRAM)
    for k in range(5):
        for j in range(50):
            lab.schedule(
                lab.now + 0.02 * j, lambda t: lab.operator.robot.execute(SteerCommand(rates=[0.1] * 6), now=t)
            )
        # Reports still come at first.
        lab.link.change(LinkConditions(down, up.backward), lab.now)
        lab.run(lab.now + 1.0)
        lab.link.change(LinkConditions.symmetric(down), lab.now)
        lab.run(lab.now + 3.0 + 0.213 * k)
        lab.link.change(up, lab.now)
        end = lab.now + 60.0
        while lab.now < end and (report is None or report.executed < lab.operator.robot.log.count):
            lab.run(lab.now + 1.0)
            report = lab.operator.report
        assert not lab.operator.halted
        assert report is not None
        assert report.executed == lab.operator.robot.log.count == 50 * (k + 1)
