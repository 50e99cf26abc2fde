"""Both sites live: real sockets, wall time, a body in a process of its own."""

from __future__ import annotations

import asyncio
import os
import signal
import time

import numpy as np
import pytest

from interfaces import connect
from interfaces.link import Conditions, LinkConditions, delay_profile
from interfaces.messages.control import Lease, Role
from interfaces.runtime.laboratory import Laboratory
from interfaces.stream.access import Access, make_token
from interfaces.stream.connection import Connection
from interfaces.teleop import FollowingArm, OperatorSite, RobotSiteConfig, VirtualArm
from robots import puma560
from tests.interfaces.live_rig import (
    HALT,
    MODEL,
    NOMINAL,
    READY,
    Rows,
    child,
    child_beside,
    lose_operator,
    operator_here,
    robot_here,
    until,
)
from vrs import Insertion, JointTarget, MotionCommand, SteerCommand
from vrs.commands import Command

LIMITS = MODEL.limits
MARGIN = 0.05
"""By how much execution margins exceed what the way takes [s]."""
KILLS = int(os.environ.get("VRS_KILLS", "2"))
"""How often an operator's process is killed in mid-motion."""
A = np.array([0.0, 0.8, -2.4, 0.0, 0.6, 0.0])
B = np.array([0.5, 0.6, -2.0, 0.3, 0.4, 0.6])


def lease(robot: Connection) -> None:
    """Have the lease of a robot that follows."""
    assert isinstance(robot.acquire(), Lease)
    assert robot.wait(lambda r: r.state is not None and not r.state.halted and r.state.connected, 20.0)


def script(t: float) -> list[tuple[float, Command]]:
    """When each command is given [s] and the command, whose time is 0.45 s later or more."""
    return [
        (t, MotionCommand(JointTarget(A), t, t + 0.5)),
        (t + 0.3, MotionCommand(JointTarget(B), t + 0.3, t + 0.8, speed=0.6)),
        (t + 0.6, MotionCommand(JointTarget(READY), t + 0.6, t + 2.5)),
        (t + 1.0, MotionCommand(JointTarget(A), t + 1.0, t + 1.6, insertion=Insertion.SPLICE)),
        (t + 1.8, MotionCommand(JointTarget(NOMINAL), t + 1.8, t + 2.4, insertion=Insertion.REPLACE)),
    ]


def test_a_script_is_the_same_live_and_in_the_laboratory() -> None:
    delay, D = 0.2, -0.4

    def play(url: str) -> tuple[list, float]:
        with connect(url) as robot:
            lease(robot)
            begin = np.ceil(robot.now() + 0.3)
            issued = []
            for t, command in script(begin):
                time.sleep(max(t - robot.now(), 0.0))
                issued.append(robot.designer.issue(command, wait=5.0))
            # Who leaves gives the lease back, and the robots stop.
            time.sleep(max(begin + 5.0 - robot.now(), 0.0))
            return [robot.designer.issued(i.number).receipt for i in issued], begin

    async def live() -> tuple | None:
        site = RobotSiteConfig(fixed_offset=D, beat=0.03)
        async with (
            robot_here(site=site) as (robot, url),
            operator_here(url, delay=f"constant:{delay}") as (operator, at),
        ):
            receipts, begin = await asyncio.to_thread(play, at)
            mine, theirs = operator.operator.robot.engine, robot.host.site
            assert theirs is not None
            late = max(operator.health()["timer_late"], robot.health()["timer_late"])
            assert not theirs.parted or late > MARGIN
            if theirs.parted:
                return None
            return receipts, begin, mine.timeline, theirs.engine.timeline, list(theirs.engine.receipts)

    # A machine that stood still for longer than the margins says nothing.
    made = next((made for made in (asyncio.run(live()) for _ in range(4)) if made is not None), None)
    assert made is not None
    receipts, begin, virtual, real, answers = made
    operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    robot = FollowingArm(MODEL, NOMINAL, now=0.0, config=RobotSiteConfig(fixed_offset=D))
    link = LinkConditions.symmetric(Conditions(delay=delay_profile(f"constant:{delay}")))
    lab = Laboratory(operator, robot, link, np.random.default_rng(0))
    for t, command in script(begin):
        lab.schedule(t, lambda now, command=command: operator.robot.execute(command, now=now))  # type: ignore[misc]
    lab.run(begin + 8.0)
    there = [r for r in robot.engine.receipts if r.command_id <= 5]
    for seen, expected in ((receipts, operator.robot.engine.receipts), (answers, there)):
        assert len(seen) == len(expected) == 5
        for one, other in zip(seen, expected, strict=True):
            assert (one.command_id, one.status, one.reason) == (other.command_id, other.status, other.reason)
            assert one.execute_at == other.execute_at
            assert one.end == pytest.approx(other.end, abs=1e-9)
            assert (one.shifted, one.superseded) == (other.shifted, other.superseded)
    t = np.linspace(begin, begin + 8.0, 4001)
    for timeline, other in ((virtual, operator.robot.engine.timeline), (real, robot.engine.timeline)):
        assert np.abs(timeline.sample(t) - other.sample(t)).max() <= 1e-9


def test_without_its_operator_the_robot_brakes_in_time() -> None:
    rng = np.random.default_rng(5)
    moving: list[bool] = []

    async def session() -> None:
        site = RobotSiteConfig(beat=0.03, watchdog=HALT)
        brake = float((LIMITS.qd_max / LIMITS.qdd_max).max())
        async with robot_here(site=site) as (robot, url):
            rows = Rows(robot)
            for wait in rng.uniform(0.3, 2.0, KILLS):
                lost = await lose_operator(robot, rows, url, float(wait))
                moving.append(lost.moved)
                assert "link loss" in lost.said
                # It's decided a lead ahead, so that it begins at T_loss.
                assert lost.halted <= HALT.timeout + 0.02
                assert lost.rested <= HALT.timeout + 0.02 + 2 * brake
                assert lost.excess <= 1 + 1e-6
                assert lost.went_on == 0.0
                assert lost.faults == 0
            # Some instants lie between two moves.
            assert sum(moving) >= KILLS / 2

    asyncio.run(session())


def test_a_robot_that_dies_is_missed_and_followed_again() -> None:
    async def session() -> None:
        options = "--body", "exact", "--max-age", "2", "--lead", "0.2"
        async with (
            child_beside("robot", "--listen", "127.0.0.1:0", *options) as first,
            operator_here(first.url) as (operator, at),
        ):

            def begin() -> Connection:
                client = connect(at)
                lease(client)
                client.designer.issue(MotionCommand(JointTarget(READY)), wait=5.0)
                time.sleep(0.3)
                first.kill()
                return client

            client = await asyncio.to_thread(begin)
            died = time.monotonic()
            with client:
                missed = await asyncio.to_thread(client.wait, lambda r: not r.state.connected, 5.0)
                assert missed
                assert time.monotonic() - died <= 1.0
                port = first.url.split(":")[2].split("/")[0]
                async with child_beside("robot", "--listen", f"127.0.0.1:{port}", *options) as second:

                    def go_on() -> None:
                        assert client.wait(lambda r: r.state.connected and r.state.halted != "", 30.0)
                        # It stands where it began, and moves for nobody who hasn't resumed.
                        assert np.abs(np.array(second.health()["q"]) - NOMINAL).max() <= 1e-9
                        refused = client.designer.issue(MotionCommand(JointTarget(A)), wait=5.0)
                        assert "resume" in refused.receipt.reason
                        end = time.monotonic() + 30.0
                        while not isinstance(client.resume(), Lease) and time.monotonic() < end:
                            time.sleep(0.2)
                        done = client.designer.issue(MotionCommand(JointTarget(A)), wait=5.0)
                        assert done.receipt.status == "accepted"
                        second.wait(lambda facts: np.abs(np.array(facts["q"]) - A).max() <= 1e-6, 20.0)

                    await asyncio.to_thread(go_on)
                    assert operator.robot.connections == 2

    asyncio.run(session())


@pytest.mark.parametrize("who", ["robot", "operator"])
def test_nothing_is_made_up_for_after_a_pause(who: str) -> None:
    with (
        child("robot", "--listen", "127.0.0.1:0", "--body", "exact", "--max-age", "2", "--lead", "0.2") as robot,
        child(
            "serve", "--port", "0", "--robot-at", robot.url.removeprefix("ws://").removesuffix("/site")
        ) as server,
        connect(server.url.replace("http", "ws").replace("/view", "/ws")) as client,
    ):
        lease(client)
        rates = 0.2 * LIMITS.qd_max * np.array([1.0, 0, 0, 0, 0, 1.0])
        for _ in range(40):
            client.designer.issue(SteerCommand(rates=rates))
            time.sleep(0.02)
        paused = robot if who == "robot" else server
        before = np.array(robot.health()["q"])
        paused.kill(signal.SIGSTOP)
        for _ in range(50):
            client.designer.issue(SteerCommand(rates=rates))
            time.sleep(0.1)
        paused.kill(signal.SIGCONT)
        robot.wait(lambda facts: facts["halted"] and facts["rests"])
        stopped = np.array(robot.health()["q"])
        # A second at most of the motion that was under way, then nothing: no input of the pause moves it.
        assert (np.abs(stopped - before) <= np.abs(rates) * 1.5 + 1e-6).all()
        time.sleep(2.0)
        assert np.abs(np.array(robot.health()["q"]) - stopped).max() <= 1e-9


@pytest.mark.parametrize("stuck", [False, True])
def test_hardware_behind_a_driver_follows_and_is_stopped_where_a_servo_is_stuck(stuck: bool) -> None:
    bus = f"tests.interfaces.servo_buses:{'Stuck' if stuck else 'Sound'}"
    start = puma560.model().poses["nominal"]
    with (
        child("serve", "--port", "0", "--body", bus, "--link-loss", "hold") as server,
        connect(server.url.replace("http", "ws").replace("/view", "/ws")) as robot,
    ):
        robot.acquire()
        robot.wait(lambda r: r.state is not None and not r.state.halted and r.state.connected, 30.0)
        assert robot.state is not None
        assert np.abs(robot.state.q - start).max() < 0.01
        receipt = robot.designer.issue(MotionCommand(JointTarget(start + 0.25), speed=0.3), wait=5.0).receipt
        assert receipt is not None
        assert receipt.end is not None
        end = receipt.end
        if stuck:
            robot.wait(lambda r: r.state is not None and "from where it should be" in r.state.halted, 20.0)
            assert "joint 2" in robot.state.halted
        else:
            robot.wait(lambda r: r.state is not None and r.state.play >= end + 0.5, 20.0)
            assert not robot.state.halted
            assert np.abs(robot.state.q - start - 0.25).max() < 0.02


def test_why_a_robot_cant_be_connected_to_is_said_once_for_each_reason() -> None:
    said: list[str] = []

    async def main() -> str:
        access = Access({Role.SITE: make_token()}, free=())
        async with robot_here(access=access) as (_, url):
            async with operator_here(url, say=said.append) as (operator, _):
                await until(lambda: said)
                await asyncio.sleep(1.5)
                operator.robot.url = url.replace(url.split(":")[2].partition("/")[0], "1")
                await until(lambda: len(said) > 1)
                await asyncio.sleep(1.0)
            return url

    url = asyncio.run(main())
    assert said[0].startswith(f"no robot at {url}: ")
    assert "token" in said[0]
    assert [line.count("it's tried again") for line in said] == [1, 1]
    assert "127.0.0.1:1/site" in said[1]
