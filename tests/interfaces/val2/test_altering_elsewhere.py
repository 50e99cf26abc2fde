"""Corrections of the path of a program that runs at a console elsewhere, over real sockets."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import time
from contextlib import contextmanager

from interfaces import connect
from interfaces.messages.control import Corrected, ProblemCode
from interfaces.teleop import RobotSiteConfig
from interfaces.val2.motion.places import Frames
from tests.interfaces.live_rig import operator_here, robot_here
from tests.interfaces.val2.bench import MODEL

PROGRAM = """.PROGRAM main()
    MOVE TRANS(100, 450, 150, 90, 90, 0)
    BREAK
    ALTER (1) 2
    SPEED 20 MMPS
    MOVES TRANS(-100, 450, 150, 90, 90, 0)
    NOALTER
.END
"""
WAIT = 60.0


@contextmanager
def console(url, directory):
    """A console that runs the program."""
    (directory / "main.v2").write_text(PROGRAM)
    process = subprocess.Popen(
        [sys.executable, "-m", "interfaces.cli", "console", "--connect", url, "--files", str(directory)],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    try:
        process.stdin.write("LOAD main\nEX main\n")
        process.stdin.flush()
        yield
    finally:
        process.stdin.close()
        process.kill()
        process.wait()


def height(engine, t):
    """How far the tip is above the planned line [mm]."""
    return 1000.0 * (MODEL.forward(engine.timeline.sample(t)) @ Frames(MODEL).tip())[2, 3] - 150.0


def session(url, engine, directory):
    with connect(url, name="sensor") as sensor, connect(url, role="viewer", name="visitor") as visitor:

        def correct(offset, channel=1, client=sensor):
            return client.correct(channel, [*offset, 0, 0, 0], wait=WAIT)

        alone = correct([0, 0, 1e-3])
        assert (alone.code, alone.text) == (
            ProblemCode.STALE_EPOCH, "only who has control, or shares it, corrects the path",
        )  # fmt: skip
        with console(url, directory):
            given_up, answers = time.monotonic() + WAIT, []
            while abs(height(engine, sensor.now()) - 3.0) > 0.01 or not isinstance(answers[-1], Corrected):
                assert time.monotonic() < given_up, answers
                answers.append(correct([0, 0, 3e-3]))
            wrong = correct([0, 0, 1e-3], channel=2)
            assert (wrong.code, wrong.text) == (
                ProblemCode.OUT_OF_RANGE, "*Path isn't altered* no program has ALTER on for channel 2",
            )  # fmt: skip
            far = correct([5.0, 0, 0])
            assert far.code is ProblemCode.OUT_OF_RANGE
            assert far.text.startswith("*Path can't be altered so*")
            looks = correct([0, 0, 1e-3], client=visitor)
            assert (looks.code, looks.text) == (ProblemCode.NOT_ALLOWED, "a viewer corrects nothing")


def test_an_operator_corrects_the_path_of_a_program_at_another_clients_console(tmp_path):
    async def live():
        async with (
            robot_here(site=RobotSiteConfig(beat=0.03)) as (_, url),
            operator_here(url) as (operator, at),
        ):
            await asyncio.to_thread(session, at, operator.twins.operator.robot.engine, tmp_path)

    asyncio.run(live())
