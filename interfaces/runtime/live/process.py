"""Starting a site: modules loaded before the first command, and a robot's site as a child process."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Callable, Sequence

import numpy as np

from interfaces.system import module_process
from vrs.clock import ManualClock
from vrs.commands import (
    Cancel,
    Insertion,
    JointTarget,
    Motion,
    MotionCommand,
    PoseTarget,
    Profile,
    Resume,
    ScaleTime,
    SteerCommand,
    Stop,
)
from vrs.engine import Engine
from vrs.errors import VrsError
from vrs.model import Array, RobotModel

_AWAY = 0.05
"""How far the joints of an engine that nobody sees are moved [rad, m], at most a quarter of their range."""


def warm(model: RobotModel, q: Array) -> None:
    """Carry out a command of each kind on an engine that is thrown away.

    Args:
        model: The robot.
        q: Joints [rad], (n,), within the limits; what can't be done from there is left.
    """
    clock = ManualClock(0.0)
    engine = Engine(model, q=q, clock=clock)
    middle = 0.5 * (model.limits.q_min + model.limits.q_max)
    near = q + np.minimum(_AWAY, 0.25 * (model.limits.q_max - model.limits.q_min)) * np.sign(middle - q)
    rates = np.full(len(q), 0.05)
    for command in (
        MotionCommand(JointTarget(near)),
        MotionCommand(JointTarget(q), execute_at=0.05, profile=Profile.JERK_LIMITED),
        MotionCommand(JointTarget(near), insertion=Insertion.APPEND, deviation=0.01),
        MotionCommand(PoseTarget(model.forward(q)), insertion=Insertion.APPEND, motion=Motion.LINE),
        ScaleTime(0.5),
        Cancel(2),
        Stop(),
        Resume(),
        SteerCommand(rates),
        SteerCommand(twist=np.zeros(6)),
    ):
        clock.advance(0.02)
        engine.execute(command)
    engine.undo()
    clock.advance(0.01)
    engine.anchor(Engine(model, timeline=engine.timeline, clock=clock).timeline)


READY = "vrs: robot listens on "
"""What a robot's site says on standard output before its address."""
_START = 60.0
"""Time for it to be ready [s]."""
_END = 4.0
"""Time for it to come to rest and end [s]."""


class RobotStartError(VrsError):
    """The robot's site couldn't be started."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"the robot's site didn't start: {problem}")


async def _watch(process: Process, ended: Callable[[str], None]) -> None:
    """Tell when a process ends."""
    status = await process.wait()
    how = f"killed by {signal.Signals(-status).name}" if status < 0 else f"with status {status}"
    ended(f"the robot's process has ended ({how}): start vrs serve again")


@contextlib.asynccontextmanager
async def local_robot(options: Sequence[str], ended: Callable[[str], None]) -> AsyncIterator[str]:
    """Run `vrs robot` on a loopback port meanwhile; it ends by itself if this process does.

    Args:
        options: Of `vrs robot`, but for the address.
        ended: Is told why there's no robot any more, if it ends meanwhile.

    Returns:
        Where its site listens.

    Raises:
        RobotStartError: If it isn't ready in time.
    """
    command, environment = module_process("interfaces.cli", "robot", "--listen", "127.0.0.1:0", "--until-eof")
    process = await asyncio.create_subprocess_exec(
        *command,
        *options,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env=environment,
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        try:
            async with asyncio.timeout(_START):
                line = (await process.stdout.readline()).decode().strip()
        except TimeoutError:
            raise RobotStartError(f"it said nothing for {_START:g} s") from None
        if not line.startswith(READY):
            raise RobotStartError(line or "it ended at once")
        watch = asyncio.create_task(_watch(process, ended))
        try:
            yield line.removeprefix(READY).split()[0]
        finally:
            watch.cancel()
    finally:
        if process.stdin is not None:
            process.stdin.close()
        try:
            async with asyncio.timeout(_END):
                await process.wait()
        except TimeoutError:
            process.kill()
            await process.wait()
