"""A mobile robot live, driven and sent about by `connect_mobile`; losing the operator follows the policy."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from interfaces import connect_mobile
from interfaces.jobs import JobFile, RunnerConfig
from interfaces.link import LinkConditions
from interfaces.messages.control import Lease, Problem, Role
from interfaces.messages.jobs import (
    ArmJob,
    Doing,
    JobList,
    JobStage,
    ListCommand,
    MoveJob,
    OperatorLoss,
    Tasks,
    WaitJob,
)
from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
from interfaces.runtime.live.paced_body import PacedBody, PacedConfig
from interfaces.runtime.live.physics_body import PhysicsBody
from interfaces.runtime.live.robot import LiveBody, LiveRobot
from interfaces.runtime.live.robot_server import LARGEST
from interfaces.runtime.physics import PhysicsConfig
from interfaces.stream import sockets
from interfaces.stream.access import OPEN, Access, hosts
from interfaces.stream.client_socket import UnreachableError
from interfaces.stream.connection import Connection
from interfaces.stream.server import application
from interfaces.teleop.architectures.compositions import CONTROL
from interfaces.teleop.following_base import DrivenConfig
from interfaces.teleop.virtual_base import VirtualBase
from robots import load
from robots.mobile.robot import place
from robots.onboard.journey import Goal, JourneyState
from robots.robot import IDEAL
from robots.rooms import EMPTY
from robots.simulated import WORLDS, missing_for
from tests.contract import doors
from tests.interfaces.stream.served import served
from tests.interfaces.stream.serving import Serving, beside
from vrs.errors import InvalidValueError

ROBOT = load("ipr")
ROOM = place("empty")
HERE, THERE = Goal(1.5, 3.0), Goal(2.3, 3.0)


@asynccontextmanager
async def listening(robot: LiveRobot) -> AsyncIterator[str]:
    """A robot's site in this loop, and its URL."""
    at = sockets.bind("127.0.0.1", 0)
    port = at.getsockname()[1]
    app = application(robot.routes, hosts(["127.0.0.1"], port))
    async with sockets.serve(app, at, largest=LARGEST), robot.running():
        yield f"ws://127.0.0.1:{port}/site"


INSTALLED = [world for world in WORLDS if not missing_for(world)]
WORLD_OF = {OperatorLoss.STOP: INSTALLED[0], OperatorLoss.CARRY_ON: INSTALLED[-1]}
"""In which world of physics the robot drives."""


@asynccontextmanager
async def both(loss: OperatorLoss, jobs: Path) -> AsyncIterator[Serving]:
    """Robot and operator's site in one loop; no watchdog, as other tests share the processor."""
    robot = ROBOT.with_body(WORLD_OF[loss])
    config = PacedConfig(robot, ROOM, driven=DrivenConfig(period=CONTROL), jobs=RunnerConfig(loss=loss))
    async with listening(LiveRobot(PacedBody(config), Access(free={Role.SITE}))) as url:
        at = sockets.bind("127.0.0.1", 0)
        own = at.getsockname()[1]
        operator = LiveOperator(
            LiveOperatorConfig(ROBOT, url, LinkConditions(), room=ROOM, jobs=JobFile(jobs)),
            Access(free=OPEN),
        )
        app = application(operator.routes, hosts(["127.0.0.1"], own))
        async with sockets.serve(app, at), operator.running():
            yield Serving(own)


def met(url: str, name: str) -> Connection:
    """A connection whose robot has been met."""
    robot = connect_mobile(url, name=name, timeout=20.0)
    assert robot.wait(lambda it: it.postures is not None and it.postures.real is not None, 30.0)
    return robot


def controlled(robot: Connection) -> None:
    """Have control, with a drive begun or jobs going on."""

    def has(_: Connection) -> bool:
        answer = robot.acquire()
        return isinstance(answer, Lease) and answer.yours

    end = time.monotonic() + 20.0
    while not has(robot):
        assert time.monotonic() < end
        time.sleep(0.05)
    assert robot.wait(lambda it: it.postures is not None and not it.postures.halted, 20.0)


OWN = """
from interfaces.teleop.architectures import Immediate

class Drawn(Immediate):
    def __init__(self, constants, posture):
        super().__init__()

class Reckoned(Drawn):
    estimates = False
"""


@pytest.mark.parametrize("name", ["Drawn", "Reckoned"])
def test_an_architecture_of_ones_own_says_how_the_virtual_robot_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "own_estimating.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)

    async def estimating() -> bool:
        body = PacedBody(PacedConfig(ROBOT, ROOM, architecture=f"own_estimating:{name}"))
        async with listening(LiveRobot(body, Access(free={Role.SITE}))) as url:
            operator = LiveOperator(LiveOperatorConfig(ROBOT, url, LinkConditions(), room=ROOM), Access(free=OPEN))
            async with operator.running(), asyncio.timeout(20.0):
                while operator.robot.attached is None:
                    await asyncio.sleep(0.02)
                operator.twins.draw(operator.robot.attached, now=operator.clock.now())
                drawn: VirtualBase = operator.twins.operator.robot
                return drawn.estimating

    assert asyncio.run(estimating()) is (name == "Drawn")


@pytest.mark.parametrize("loss", OperatorLoss)
def test_goals_jobs_and_an_operator_who_goes(tmp_path: Path, loss: OperatorLoss) -> None:
    with beside(both(loss, tmp_path / "jobs.json")) as serving:
        with met(serving.url, "watcher") as watcher:
            with met(serving.url, "driver") as robot:
                assert robot.welcome.robot == "ipr"
                assert isinstance(robot.go(THERE), Problem)
                controlled(robot)
                assert isinstance(watcher.go(THERE), Problem)
                if loss is OperatorLoss.STOP:
                    going = robot.go(Goal(1.7, 3.0))
                    assert isinstance(going, Tasks)
                    assert robot.wait(lambda it: it.tasks is not None and it.tasks.doing is Doing.GOAL, 10.0)
                    # Who takes the wheel drives.
                    robot.drive(0.0, 0.3, wait=5.0)
                    assert robot.finished(10.0)
                    assert robot.tasks is not None
                    assert robot.tasks.journey is JourneyState.ENDED
                    assert robot.wait(lambda it: it.postures is not None and not it.postures.halted, 20.0)
                assert isinstance(robot.load(JobList((MoveJob(1, THERE), WaitJob(2)))), Tasks)
                assert isinstance(robot.dry_run(), tuple)
                assert isinstance(robot.do(ListCommand.KEY), Problem)
                assert isinstance(robot.do(ListCommand.RUN), Tasks)
                assert watcher.wait(lambda it: it.tasks is not None and it.tasks.left > 0, 20.0)
                assert watcher.tasks is not None
                assert watcher.tasks.loss is loss
            # The driver has gone, in the middle of the move.
            if loss is OperatorLoss.STOP:
                assert watcher.wait(
                    lambda it: it.tasks is not None and it.tasks.progress.stage is JobStage.PAUSED, 20.0
                )
            else:
                assert watcher.wait(
                    lambda it: it.tasks is not None and it.tasks.progress.jobs[0].stage == "done", 40.0
                )
                assert watcher.seen is not None
                assert watcher.plan is not None
                # Whoever has control next takes it up.
                controlled(watcher)
                assert isinstance(watcher.do(ListCommand.KEY), Tasks)
            assert watcher.finished(20.0)
            assert watcher.postures is not None
            assert watcher.postures.real is not None
            off = abs(watcher.postures.real.x - THERE.x)
            assert off < 0.05 if loss is OperatorLoss.CARRY_ON else off > 0.1
        jobs, progress = JobFile(tmp_path / "jobs.json").load()
        assert jobs.jobs == (MoveJob(1, THERE), WaitJob(2))
        assert progress.stage is (JobStage.PAUSED if loss is OperatorLoss.STOP else JobStage.DONE)


def test_a_robot_whose_body_fails_says_so_and_ends(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise OSError("no such wheel")

    async def run() -> None:
        body = PacedBody(PacedConfig(ROBOT, EMPTY))
        robot = LiveRobot(body, Access(free={Role.SITE}))
        async with robot.running(), asyncio.timeout(20.0):
            await robot.ready()
            assert robot.health()["ok"]
            monkeypatch.setattr(body.body, "drive", fails)
            await robot.ended.wait()
            assert not robot.health()["ok"]
            await robot.rest()
        assert body.problem == "the body failed: no such wheel"

    asyncio.run(run())
    assert [record.message for record in caplog.records] == ["the body failed"]


@pytest.mark.parametrize("other", ["arm", "room"])
def test_an_operator_takes_no_other_robot_and_no_other_room(other: str) -> None:
    async def run() -> str:
        body: LiveBody
        if other == "room":
            body = PacedBody(PacedConfig(ROBOT, place("lane")))
        else:
            arm = load("puma560")
            body = PhysicsBody(PhysicsConfig(arm, arm.arm.poses["ready"], IDEAL))
        async with listening(LiveRobot(body, Access(free={Role.SITE}))) as url:
            config = LiveOperatorConfig(ROBOT, url, LinkConditions(), room=ROOM)
            async with LiveOperator(config, Access(free=OPEN)).running() as operator, asyncio.timeout(20.0):
                while "driven here" not in operator.robot.problem:
                    await asyncio.sleep(0.02)
                assert not operator.robot.connected
                return operator.robot.problem

    assert (
        asyncio.run(run()).removeprefix("not the robot that is driven here: ")
        == {
            "arm": "it's a puma560, and this site drives an ipr",
            "room": f"its room is {place('lane').name!r}, and this site has {ROOM.name!r}: give both one",
        }[other]
    )


@pytest.mark.needs("mujoco")
def test_a_program_for_the_arm_is_a_job_of_a_served_robot(tmp_path: Path) -> None:
    wave = ".PROGRAM wave()\n    DRIVE 1, 5, 50\n.END\n"
    with (
        doors.served("serve", "--robot", "ipr", "--body", "mujoco", "--port", "0", cwd=tmp_path) as serving,
        met(f"http://{serving.address}", "driver") as robot,
    ):
        controlled(robot)
        assert isinstance(robot.load(JobList((ArmJob(1, "wave", wave),))), Tasks)
        assert isinstance(robot.do(ListCommand.RUN), Tasks)
        assert robot.wait(lambda it: it.tasks is not None and it.tasks.progress.stage is JobStage.DONE, 30.0)


def test_an_arm_is_no_mobile_robot() -> None:
    with served() as serving, pytest.raises(UnreachableError, match=r"use interfaces\.connect"):
        connect_mobile(f"127.0.0.1:{serving.port}")


def test_a_robot_finds_its_place_by_its_laser_where_there_is_something_to_see() -> None:
    assert PacedConfig(ROBOT, ROOM).position == "laser"
    assert PacedConfig(ROBOT, EMPTY).position == "fused"
    assert PacedConfig(ROBOT, ROOM, position="truth").position == "truth"
    with pytest.raises(InvalidValueError, match="odometry"):
        PacedConfig(ROBOT, ROOM, position="stars")
