"""`vrs console`: the VAL-II monitor, at a robot of its own or at one that a server serves."""

from __future__ import annotations

import contextlib
import re
import selectors
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Final

import typer

from interfaces.cli.options import (
    DialectName,
    RobotName,
    Tip,
    dialect_of,
    option,
    program_files,
    state_directory,
    val_robot,
)
from interfaces.system import module_process, on_signal, software
from robots.robot import USUAL
from vrs.errors import InvalidValueError, VrsError
from vrs.model import home

if TYPE_CHECKING:
    from interfaces.val2.monitor.control import Control
    from interfaces.val2.monitor.monitor import TerminalMonitor
    from interfaces.val2.motion import Arm
    from interfaces.val2.values import Dialect
    from robots.robot import Robot
    from vrs.clock import Clock

START: Final = 90.0
"""Time for it to be ready [s]."""
_END: Final = 8.0
"""Time for it and its robot to come to rest and end [s]."""
_SAYS: Final = re.compile(r"vrs: serving \S+ on (http://\S+)/view\b.*")


def console(
    connect: Annotated[
        str | None,
        option("URL", "A server, 127.0.0.1:8600 or wss://… as vrs serve says it; without it one is begun."),
    ] = None,
    token_file: Annotated[Path | None, option("FILE", "Tokens of that server.")] = None,
    alone: Annotated[bool, option("--alone", "A virtual arm in this process only: no real one, no page.")] = False,
    name: RobotName = USUAL,
    tip: Tip = "",
    delay: Annotated[str, option("PROFILE", "Emulated on the way to the robot that this begins.")] = "none",
    files: Annotated[
        Path | None,
        option("DIR", "Where LOAD, STORE and programs find files; unless given, here, and programs nowhere."),
    ] = None,
    dialect: DialectName = "",
) -> None:
    """Move an arm by VAL-II commands; HELP lists them. From a pipe, lines are done one after the other."""
    from interfaces.link import delay_profile

    if connect is not None and alone:
        raise InvalidValueError("alone", alone, "left out with --connect")
    if token_file is not None and connect is None:
        raise InvalidValueError("token-file", str(token_file), "left out without --connect")
    if delay != "none" and (alone or connect is not None):
        raise InvalidValueError("delay", delay, "left out with --connect and --alone: no robot is begun here")
    robot = val_robot(name, tip)
    program_files(files)
    delay_profile(delay)
    spoken = dialect_of(dialect)
    if alone:
        _alone(robot, files, spoken)
    elif connect is not None:
        _connected(connect, robot, token_file, files, spoken)
    else:
        typer.echo("vrs: starting both robots ..", err=True)
        with local_server(["--robot", robot.found_by, "--delay", delay, "--link-loss", "hold"]) as url:
            typer.echo(f"vrs: {url}/view shows both robots", err=True)
            _connected(url, robot, None, files, spoken)


def _alone(robot: Robot, files: Path | None, dialect: Dialect | None) -> None:
    from interfaces.val2.monitor.control import Control
    from interfaces.val2.motion import arm_for
    from vrs.clock import ManualClock, WallClock
    from vrs.engine import Engine

    model = robot.arm
    engine = Engine(model, q=home(model), clock=ManualClock(0.0))
    what = f"{software()}, a virtual {robot.name} alone"
    _converse(arm_for(engine, robot), Control(), WallClock(), files, dialect, what)


def _connected(
    url: str, robot: Robot, token_file: Path | None, files: Path | None, dialect: Dialect | None
) -> None:
    from interfaces import connect
    from interfaces.messages.control import Role
    from interfaces.stream.access import read_tokens
    from interfaces.val2.monitor.control import RemoteControl
    from interfaces.val2.motion import arm_for

    token = None if token_file is None else read_tokens(token_file).get(Role.OPERATOR)
    with connect(url, token=token, name="vrs console", alters=True) as connection:
        what = f"{software()}, connected to {url}"
        _converse(arm_for(connection, robot), RemoteControl(connection), connection, files, dialect, what)


def _converse(
    arm: Arm, control: Control, clock: Clock, files: Path | None, dialect: Dialect | None, what: str
) -> None:
    """Let a person, or a pipe, work at the monitor."""
    import asyncio

    from interfaces.val2.controller import Controller
    from interfaces.val2.monitor.control import SharedController
    from interfaces.val2.monitor.files import Files
    from interfaces.val2.monitor.monitor import TerminalMonitor
    from interfaces.val2.units import Units
    from interfaces.val2.values import VPLUS

    controller = Controller(arm, parameters=arm.parameters, units=Units(files), now=clock.now())
    controller.parameters["VPLUS"] = float(dialect is VPLUS)
    typed = sys.stdin.isatty() and sys.stdout.isatty()
    shared = SharedController(controller, control)
    monitor = TerminalMonitor(shared, Files(files or Path(), anywhere=True), what, queues_commands=not typed)
    asyncio.run(_typed(monitor, clock) if typed else _piped(monitor, clock))


async def _typed(monitor: TerminalMonitor, clock: Clock) -> None:
    from interfaces.val2.monitor.terminal import Terminal

    await Terminal(monitor, clock, history=state_directory() / "console").run()


async def _piped(monitor: TerminalMonitor, clock: Clock) -> None:
    import asyncio
    import signal

    from interfaces.val2.monitor.teletype import Pipe

    pipe = Pipe(monitor, clock, source=sys.stdin.fileno())
    on_signal(asyncio.get_running_loop(), signal.SIGINT, pipe.interrupt)
    await pipe.run()


class ServerStartError(VrsError):
    """The server couldn't be started."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"the server didn't start: {problem}")


@contextlib.contextmanager
def local_server(options: Sequence[str]) -> Iterator[str]:
    """Run `vrs serve` on a free loopback port meanwhile.

    Args:
        options: Of `vrs serve`, but for the address.

    Returns:
        Its address, `http://127.0.0.1:PORT`.

    Raises:
        ServerStartError: If it isn't ready in time.
    """
    command, environment = module_process("interfaces.cli", "serve", "--port", "0", "--until-eof", *options)
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        yield _address(process.stdout)
    finally:
        try:
            process.communicate(timeout=_END)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def _address(output: IO[bytes]) -> str:
    """What it says first."""
    with selectors.DefaultSelector() as selector:
        selector.register(output, selectors.EVENT_READ)
        if not selector.select(START):
            raise ServerStartError(f"it said nothing for {START:g} s")
    line = output.readline().decode(errors="replace").strip()
    found = _SAYS.fullmatch(line)
    if found is None:
        raise ServerStartError(line or "it ended at once")
    return found[1]
