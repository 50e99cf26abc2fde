"""A mobile robot driven live, in virtual time: epochs, wishes, stops, lost links, old messages."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from msgspec.structs import replace

from interfaces.link import Conditions, LinkConditions, delay_profile
from interfaces.messages.control import HOLDS
from interfaces.messages.fields import Epoch
from interfaces.messages.sites import DriveOrders
from interfaces.teleop.architectures import ARCHITECTURES
from interfaces.teleop.following_base import TOO_FAR
from interfaces.teleop.operator import Halt, HaltCause
from interfaces.teleop.virtual_base import MOVING
from robots.onboard.driving import IPR_LIMITS, Posture
from tests.interfaces.teleop.rig import CONTROL, MODEL, TURN, Rig


def within_limits(rig: Rig) -> bool:
    """Whether all that the body was told keeps its limits."""
    most = IPR_LIMITS.a_max * CONTROL * TURN + 1e-9
    speeds = all(abs(v) <= IPR_LIMITS.v_max and abs(w) <= IPR_LIMITS.w_max for v, w in rig.drives)
    return speeds and all(abs(b[0] - a[0]) <= most for a, b in pairwise(rig.drives))


def test_nothing_moves_before_the_robot_is_met() -> None:
    rig = Rig()
    assert HaltCause.NOT_MET in rig.operator.robot.wish(0.3, 0.0, issued_at=0.0, now=0.0)
    assert rig.operator.resume(now=0.0) == HaltCause.NOT_MET
    rig.run(3.5)
    assert rig.operator.halted
    assert rig.operator.robot.wish(0.3, 0.0, issued_at=rig.now, now=rig.now)
    assert rig.operator.robot.virtual(rig.now) == pytest.approx((1.0, 2.0, 0.5), abs=0.02)
    assert rig.truth[:2] == pytest.approx((1.0, 2.0), abs=1e-6)


@pytest.mark.parametrize("architecture", [name for name in ARCHITECTURES if name != "extended"])
def test_the_virtual_robot_drives_at_once_and_the_real_one_comes_after(architecture: str) -> None:
    rig = Rig("constant:0.1", architecture=architecture)
    rig.begin()
    start = rig.operator.robot.virtual(rig.now)
    rig.run(0.3, rig.wish(0.3, 0.2))
    assert math.dist(rig.operator.robot.virtual(rig.now)[:2], start[:2]) > 0.01
    rig.run(6.0, rig.wish(0.3, 0.2))
    deviation = rig.operator.robot.deviation
    assert deviation is not None
    assert 0.1 < deviation.time_difference < 2.0
    if architecture in {"III-capped", "timeline"}:
        assert deviation.path_error < 0.02
    rig.run(8.0)
    assert rig.operator.robot.stands
    assert rig.apart() < (0.03 if architecture in {"III-capped", "timeline"} else 0.5)
    assert within_limits(rig)


def test_a_wish_that_nobody_repeats_ends() -> None:
    rig = Rig()
    rig.begin()
    began = rig.now
    rig.run(1.0, rig.wish(0.2, 0.0))
    last = rig.now
    while not rig.operator.robot.stands:
        rig.run(TURN)
    braking = 0.2 / IPR_LIMITS.a_max
    assert last + HOLDS - 2 * TURN <= rig.now <= last + HOLDS + braking + 2 * MODEL.period
    assert rig.operator.robot.wish(0.3, 0.0, issued_at=began, now=rig.now) == ""
    rig.run(0.5)
    assert rig.operator.robot.stands


def test_a_stop_stops_both_where_they_are_and_the_next_drive_begins_there() -> None:
    rig = Rig("constant:0.2")
    rig.begin()
    rig.run(4.0, rig.wish(0.4, 0.3))
    v, w = rig.operator.robot.architecture.before
    assert rig.operator.robot.deviation is not None
    assert rig.operator.robot.deviation.time_difference > 0.4
    rig.operator.robot.stop(now=rig.now)
    told = len(rig.drives)
    assert "stopped" in rig.operator.robot.wish(0.4, 0.0, issued_at=rig.now, now=rig.now)
    seen = []
    while not rig.operator.robot.stands:
        rig.run(MODEL.period)
        seen.append(rig.operator.robot.architecture.before)
    assert len(seen) * MODEL.period <= v / IPR_LIMITS.a_max + 2 * MODEL.period
    assert all(drive.w * v == pytest.approx(drive.v * w, abs=1e-12) for drive in seen)
    while rig.operator.resume(now=rig.now) == MOVING:
        rig.run(MODEL.period)
    # It knows of the stop after the delay, brakes at once, and doesn't go to where the virtual one stood.
    moving = sum(abs(drive[0]) > 0.02 for drive in rig.drives[told:]) * CONTROL * TURN
    assert moving <= 0.2 + 0.4 / IPR_LIMITS.a_max + 0.1
    assert rig.operator.robot.virtual(rig.now) == pytest.approx(rig.truth, abs=0.05)
    rig.run(2.0, rig.wish(0.2, 0.0))
    assert not rig.operator.halted
    assert within_limits(rig)


def test_a_lost_link_halts_both_and_only_a_resume_goes_on() -> None:
    rig = Rig()
    rig.begin()
    rig.run(2.0, rig.wish(0.4, 0.2))
    rig.line.connected = False
    lost = rig.now
    while rig.drives[-1] != (0.0, 0.0) and rig.now < lost + 5.0:
        rig.run(0.05)
    assert rig.now - lost < 0.1 + 0.5 + 0.4 / IPR_LIMITS.a_max + 0.3
    assert "link loss" in rig.robot.halted
    rig.line.connected = True
    rig.run(1.0)
    assert "link loss" in rig.operator.halted.text
    assert "link loss" in rig.operator.robot.wish(0.4, 0.0, issued_at=rig.now, now=rig.now)
    here = rig.truth
    rig.run(1.0)
    assert rig.truth == pytest.approx(here, abs=0.01)
    assert rig.operator.resume(now=rig.now) == ""
    assert rig.operator.robot.virtual(rig.now) == pytest.approx(here, abs=0.05)
    rig.run(3.0, rig.wish(0.3, 0.0))
    assert math.dist(rig.truth[:2], here[:2]) > 0.3
    assert within_limits(rig)


@pytest.mark.parametrize("hold", [False, True])
def test_old_messages_move_a_robot_that_holds_and_none_that_halts(hold: bool) -> None:
    rig = Rig("constant:0.02", hold=hold)
    rig.begin()
    start = rig.truth
    rig.line.change(LinkConditions.symmetric(Conditions(delay=delay_profile("constant:0.7"))), now=rig.now)
    rig.run(2.0, lambda now: rig.operator.robot.wish(0.3, 0.0, issued_at=now, now=now))
    rig.run(4.0)
    moved = math.dist(rig.truth[:2], start[:2])
    if hold:
        assert moved > 0.3
        assert rig.apart() < 0.03
    else:
        assert moved < 0.01
        assert rig.operator.halted
        # The clocks are known to 20 ms: it's their age for which they are refused.
        assert rig.operator.resume(now=rig.now) == ""
        rig.run(3.0, lambda now: rig.operator.robot.wish(0.3, 0.0, issued_at=now, now=now))
        assert "too old" in rig.operator.halted.text
        assert math.dist(rig.truth[:2], start[:2]) < 0.02


def test_no_drive_begins_before_the_robot_knows_that_the_one_before_is_over() -> None:
    rig = Rig("constant:0.4", hold=True)
    rig.run(5.0)
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(2.0)
    rig.run(0.2, rig.wish(0.1, 0.0))
    rig.operator.robot.stop(now=rig.now)
    rig.run(0.4)
    # The virtual robot stands again, and the real one hasn't begun to move.
    assert rig.operator.robot.stands
    assert rig.operator.report is not None
    assert rig.operator.resume(now=rig.now) == MOVING
    rig.run(2.0)
    assert rig.operator.resume(now=rig.now) == ""
    assert rig.operator.robot.virtual(rig.now) == pytest.approx(rig.truth, abs=0.03)


def test_a_drive_begins_at_rest_and_where_the_robot_is() -> None:
    rig = Rig()
    rig.begin()
    rig.run(1.0, rig.wish(0.3, 0.0))
    rig.operator.halt(Halt(HaltCause.STOPPED, "for a test"))
    assert rig.operator.resume(now=rig.now) == MOVING
    robot, far = rig.robot, Posture(9.0, 9.0, 0.0)
    orders = DriveOrders(Epoch(robot.epoch + 1), 1, rig.now, rig.now, 0.0, far)
    t = rig.host.site_time(rig.now + rig.AHEAD)
    epoch = robot.epoch
    robot.receive(orders, now=t)
    assert robot.epoch == epoch
    rig.run(3.0)
    t = rig.host.site_time(rig.now + rig.AHEAD)
    robot.receive(orders, now=t)
    assert robot.epoch == epoch
    assert robot.advance(now=t + 0.05)[0].refused == TOO_FAR
    robot.receive(replace(orders, start=rig.position.posture(), sent_at=t), now=t + 0.05)
    assert robot.epoch == epoch + 1


def test_no_drive_begins_while_the_robot_moves() -> None:
    """Without a watchdog, too, which wouldn't let it."""
    rig = Rig(hold=True)
    rig.begin()
    rig.run(1.5, rig.wish(0.3, 0.0))
    robot, epoch = rig.robot, rig.robot.epoch
    assert not robot.rests(now=rig.now)
    robot.receive(
        DriveOrders(Epoch(epoch + 1), 1, rig.now, rig.now, 0.0, rig.position.posture()),
        now=rig.host.site_time(rig.now + rig.AHEAD),
    )
    assert robot.epoch == epoch


def test_a_robot_that_never_takes_up_a_drive_is_given_up() -> None:
    rig = Rig()
    rig.run(3.5)
    assert rig.operator.resume(now=rig.now) == ""
    rig.operator.robot.start = Posture(5.0, 5.0, 0.0)
    rig.run(6.0)
    assert rig.operator.halted == Halt(HaltCause.STUCK, TOO_FAR)


def test_another_operator_finds_the_robot_where_it_stands() -> None:
    rig = Rig()
    rig.begin()
    rig.run(2.0, rig.wish(0.3, 0.3))
    rig.line.connected = False
    rig.run(4.0)
    stood = rig.truth
    assert rig.host.hello("another", now=rig.now + rig.AHEAD) == ""
    rig.run(1.0)
    assert rig.host.session == "another"
    assert rig.truth == pytest.approx(stood, abs=0.01)


def test_one_drive_after_another_needs_no_halt_in_between() -> None:
    rig = Rig()
    rig.begin()
    for _ in range(3):
        rig.run(1.5, rig.wish(0.3, 0.0))
        rig.run(3.0)
        rig.operator.halt(Halt(HaltCause.STOPPED, "given back"))
        rig.run(0.5)
        epoch = rig.robot.epoch
        assert rig.operator.resume(now=rig.now) == ""
        rig.run(0.5)
        assert rig.robot.epoch == epoch + 1
        assert not rig.robot.halted
    assert rig.operator.robot.epochs == 4


def test_a_robot_whose_drive_is_over_stands_wherever_it_is() -> None:
    rig = Rig()
    rig.begin()
    rig.run(2.0, rig.wish(0.4, 0.0))
    rig.operator.halt(Halt(HaltCause.STOPPED, "given back"))
    rig.run(0.12)
    assert rig.drives[-1][0] > 0
    rig.run(2.0)
    assert rig.drives[-1] == (0.0, 0.0)
    assert not rig.robot.halted
    assert within_limits(rig)
