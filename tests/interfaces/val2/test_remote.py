"""An arm at the other end of a connection: the same motions, answered later."""

from __future__ import annotations

import asyncio
import re
import time
from types import SimpleNamespace

import numpy as np
import pytest

from interfaces import Designer, Viewer, connect
from interfaces.messages.control import Lease
from interfaces.teleop import OperatorSite, RobotSiteConfig, VirtualArm
from interfaces.teleop.operator import Halt, HaltCause
from interfaces.val2.errors import ValError
from interfaces.val2.motion import Arm, SiteRobot, arm_for
from interfaces.val2.motion.conventions import PUMA
from interfaces.val2.motion.remote import RemoteRobot
from tests.interfaces.joined import MODEL, Joined, bad, constant
from tests.interfaces.live_rig import operator_here, robot_here
from tests.interfaces.val2.bench import from_oat, to_oat
from vrs.commands import Stop

NEAR = from_oat(-100, 550, 0, 90, 90, 0)
CORNER = from_oat(100, 550, 0, 90, 90, 0)
FAR = from_oat(0, -500, 0, 90, 90, 0)


class Line:
    """A connection as `connect` makes it, over an emulated link in virtual time."""

    def __init__(self, link, seen=0.3):
        self.joined = Joined()
        self._designer = self.joined.add(Designer(self.joined.remote(link, link, seed=3)))
        self._seen_by = self.joined.remote(constant(seen), constant(seen), seed=4)
        """What the timeline crosses is a connection of its own, and slower."""
        self.designer = self
        self.heard()
        self.history = ()
        self.is_connected = True

    @property
    def now(self):
        return self.joined.now

    def heard(self, halted=""):
        """Something new of the real robot."""
        self.state = SimpleNamespace(q=MODEL.poses["ready"], halted=halted, hand=None, play=0.0)

    def issue(self, command):
        return self._designer.issue(command, now=self.now)

    def undo(self):
        return self._designer.undo(now=self.now)

    def issued(self, number):
        return self._designer.issued(number)

    def viewer(self, *, rate):
        viewer = self.joined.add(Viewer(self._seen_by, rate=rate))

        def wait(ready, timeout):
            given_up = self.now + timeout
            while not ready(viewer) and self.now < given_up:
                self.joined.run(0.01)
            return ready(viewer)

        self.following = _Following(viewer, wait)
        return self.following

    def until(self, ready, limit=20.0):
        given_up = self.now + limit
        while not ready(now=self.now):
            assert self.now < given_up
            self.joined.run(0.01)


class _Following:
    def __init__(self, viewer, wait):
        self._viewer, self.wait = viewer, wait
        self.frozen = None

    @property
    def timeline(self):
        return self._viewer.timeline if self.frozen is None else self.frozen


@pytest.fixture(params=[constant(0.0), constant(0.2), bad(0.1, 0.1, 0.05, 0.02)], ids=["near", "far", "bad"])
def line(request):
    return Line(request.param)


def off(arm, place, now):
    return np.abs(arm.here(now=now).tool.X - place.X).max()


def test_answers_come_later_and_the_motions_are_the_same(line):
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(NEAR, straight=False, now=line.now)
    assert not arm.answered(now=line.now)
    assert not arm.ready(now=line.now)
    assert line.now < arm.next_deadline() <= line.now + 0.1
    line.until(arm.ready)
    assert off(arm, NEAR, line.now) > 1.0
    assert np.abs(arm.destination(now=line.now).tool.X - NEAR.X).max() < 1e-6
    arm.move(CORNER, straight=True, now=line.now)
    line.until(arm.ready)
    assert np.abs(arm.destination(now=line.now).tool.X - CORNER.X).max() < 1e-6
    assert "before command 1 is over" in line.joined.engine.receipts[-1].reason
    arm.set_monitor_speed(50, now=line.now)
    line.until(arm.settled)
    assert off(arm, CORNER, line.now) < 1e-9
    assert np.abs(line.joined.engine.joints(line.now) - line.joined.engine.timeline.final()).max() == 0.0
    assert arm.real(now=line.now).joints.joints == pytest.approx(PUMA.ready.joints)


def test_what_is_refused_raises_once_and_changes_nothing(line):
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.settled)
    arm.move(FAR, straight=True, now=line.now)
    with pytest.raises(ValError, match=r"^\*Straight line not possible\* (?!no straight line)") as caught:
        line.until(arm.answered)
    assert re.search(r"at [0-9.]+ mm from the beginning", caught.value.detail)
    line.until(arm.settled)
    assert off(arm, NEAR, line.now) < 1e-9


@pytest.mark.parametrize("straight", [False, True])
def test_a_real_robot_that_stops_by_itself_interrupts_the_motion_at_once_and_retry_goes_on(line, straight):
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.settled)
    arm.move(CORNER, straight=straight, now=line.now)
    line.until(arm.ready)
    line.joined.run(0.2)
    stopped = line.now
    line.joined.engine.execute(Stop())
    line.heard("nothing fresh came")
    assert arm.next_deadline() <= line.now + 0.06
    with pytest.raises(ValError, match=r"^\*Motion interrupted\* the real arm has stopped: nothing fresh came$"):
        line.until(arm.settled)
    assert line.now <= stopped + 0.06
    line.joined.run(0.5)
    line.until(arm.settled)
    assert off(arm, CORNER, line.now) > 1.0
    line.heard()
    assert arm.retry(now=line.now)
    line.until(arm.settled)
    assert off(arm, CORNER, line.now) < 1e-9


def test_an_arm_that_something_else_stops_has_not_arrived(line):
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.ready)
    line.joined.run(0.2)
    line.joined.engine.execute(Stop())
    with pytest.raises(ValError, match=r"^\*Motion interrupted\* the arm was stopped before its destination$"):
        line.until(arm.settled)
    line.until(arm.settled)
    assert off(arm, NEAR, line.now) > 1.0
    assert arm.retry(now=line.now)
    line.until(arm.settled)
    assert off(arm, NEAR, line.now) < 1e-9


def test_an_arrival_that_nothing_is_heard_of_is_none(line):
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.ready)
    line.is_connected = False
    line.joined.run(0.2)
    assert not arm.settled(now=line.now)
    line.is_connected = True
    line.until(arm.settled)
    arm.move(CORNER, straight=False, now=line.now)
    line.until(arm.ready)
    line.is_connected = False
    with pytest.raises(ValError, match=r"^\*Motion interrupted\* there's no connection"):
        line.until(arm.settled)
    assert line.now >= line.joined.engine.timeline.end


def test_a_halt_after_the_arrival_interrupts_nothing(line):
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.ready)
    line.joined.run(line.joined.engine.timeline.end - line.now + 0.05)
    line.heard("nothing fresh came")
    assert arm.settled(now=line.now)


def test_what_was_heard_before_an_answer_says_nothing_of_it(line):
    arm = Arm(RemoteRobot(line, MODEL))
    line.heard("it hasn't gone on yet")
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.ready)
    line.heard("nothing fresh came")
    with pytest.raises(ValError, match="nothing fresh came"):
        line.until(arm.settled)


def test_a_motion_that_is_seen_late_lasts_to_its_end():
    line = Line(constant(0.02), seen=2.5)
    arm = Arm(RemoteRobot(line, MODEL))
    line.until(arm.settled)
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.settled)
    assert line.now >= line.joined.engine.timeline.end
    assert off(arm, NEAR, line.now) < 1e-9


def test_a_motion_that_is_never_seen_ends_as_an_error_a_while_after_its_end(line):
    robot = RemoteRobot(line, MODEL)
    arm = Arm(robot)
    line.following.frozen = robot.timeline
    arm.move(NEAR, straight=False, now=line.now)
    with pytest.raises(ValError, match=r"\*Command refused\* the server took it, but doesn't show"):
        line.until(arm.settled)
    assert line.joined.engine.timeline.end <= line.now <= line.joined.engine.timeline.end + 3.0


def test_a_robot_that_has_halted_says_how_it_goes_on():
    virtual = VirtualArm(MODEL, MODEL.poses["nominal"], now=0.0)
    site = OperatorSite(virtual, halted=Halt(HaltCause.REPORTED, "nothing fresh came"))
    with pytest.raises(ValError, match=r"\*Robot halted\* nothing fresh came; ENABLE POWER lets it go on"):
        Arm(SiteRobot(site)).go_ready(now=0.0)


def test_braking_and_going_on(line):
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.ready)
    line.joined.run(0.2)
    arm.brake(now=line.now)
    line.until(arm.settled)
    assert off(arm, NEAR, line.now) > 1.0
    assert arm.retry(now=line.now)
    line.until(arm.settled)
    assert off(arm, NEAR, line.now) < 1e-9
    assert not arm.retry(now=line.now)


def test_taking_back(line):
    arm = Arm(RemoteRobot(line, MODEL))
    before = arm.here(now=line.now).tool
    arm.at(line.now + 5.0)
    arm.move(NEAR, straight=False, now=line.now)
    line.until(arm.answered)
    assert not arm.ready(now=line.now)
    assert arm.undo(now=line.now) == "The newest command is taken back"
    line.until(arm.settled)
    assert off(arm, before, line.now) < 1e-9


def session(url):
    with connect(url) as connection:
        arm = arm_for(connection)

        def until(ready):
            given_up = time.monotonic() + 20.0
            while not ready(now=connection.now()):
                assert time.monotonic() < given_up
                time.sleep(0.02)

        def refused():
            arm.go_ready(now=connection.now())
            until(arm.answered)

        with pytest.raises(ValError, match=r"\*Command refused\*"):
            refused()
        assert isinstance(connection.acquire(), Lease)
        assert connection.wait(lambda r: r.state is not None and r.state.connected and not r.state.halted, 20.0)
        arm.drive(6, 20.0, 50.0, now=connection.now())
        until(arm.settled)
        where = arm.here(now=connection.now())
        assert where.joints.joints == pytest.approx((0, -135, 0, 0, 45, 20), abs=1e-6)
        assert to_oat(where.tool)[3:] == pytest.approx((-90, 0, -160), abs=1e-6)
        assert len(arm.timeline(now=connection.now() - 0.2)) == 1
        assert arm.real(now=connection.now()) is not None


def test_a_robot_that_a_server_serves():
    async def live():
        async with robot_here(site=RobotSiteConfig(beat=0.03)) as (_, url), operator_here(url) as (_, at):
            await asyncio.to_thread(session, at)

    asyncio.run(live())
