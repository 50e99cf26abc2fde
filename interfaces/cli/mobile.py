"""What `vrs serve` and `vrs robot` do for a mobile robot."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from interfaces.cli.options import (
    abandon,
    collect_at_leisure,
    end_on_signal,
    end_with_input,
    keep_quiet,
    say_lost,
    say_robot,
    start_robot,
)
from interfaces.system import software
from robots.robot import HeadCamera
from vrs.errors import FormatError, InvalidValueError

if TYPE_CHECKING:
    from interfaces.cli.options import Hosts
    from interfaces.link import LinkConditions
    from interfaces.stream.access import Access
    from robots.bullet.rooms import Room
    from robots.onboard import LossPolicy
    from robots.robot import Robot

ARCHITECTURE, ROOM, OPERATOR_LOSS, JOBS = "timeline", "empty", "stop", Path("jobs.json")
"""Unless others are asked for."""
Architecture: TypeAlias = Annotated[
    str,
    typer.Option(
        "--architecture",
        metavar="NAME",
        help="Of a mobile robot, what it does with the operator's path: I, II, III, III-capped, extended, "
        "timeline, or MODULE:NAME of your own.",
    ),
]
CAMERA = 6.0
"""Pictures a second of a robot's camera, unless others are asked for."""
CameraRate: TypeAlias = Annotated[
    float,
    typer.Option(
        "--camera", metavar="RATE", help="Pictures a second of a robot's camera, 1 to 30; 0 for no camera."
    ),
]
OperatorLossName: TypeAlias = Annotated[
    str,
    typer.Option(
        "--operator-loss",
        metavar="POLICY",
        help="Of a mobile robot, what becomes of its goals and jobs when the operator is lost: stop or carry-on.",
    ),
]
RoomName: TypeAlias = Annotated[
    str,
    typer.Option(
        "--room",
        metavar="NAME|FILE",
        help="Of a mobile robot or with --rsp, where it drives: a room's name, or a .room file.",
    ),
]


def without(robot: str, given: Mapping[str, tuple[Any, Any]]) -> None:
    """Check that no option was given that a robot hasn't: see `left_out`."""
    left_out(f"{robot} has nothing of the kind", given)


def left_out(why: str, given: Mapping[str, tuple[Any, Any]]) -> None:
    """Check that no option was given that would do nothing.

    Args:
        why: It would do nothing.
        given: What each option is, and what it is unless given.

    Raises:
        InvalidValueError: If one was.
    """
    for name, (value, usual) in given.items():
        if value != usual:
            raise InvalidValueError(name, str(value), f"left out: {why}")


def room_of(text: str) -> Room:
    """A room by its name, or of a file.

    Raises:
        InvalidValueError: If there's neither a room of that name nor such a file.
        FormatError: If the file can't be read.
    """
    from robots.bullet.rooms import load_room
    from robots.ipr.robot import PLACES, place

    if text in PLACES:
        return place(text)
    path = Path(text)
    if not path.is_file():
        raise InvalidValueError("room", text, f"one of {', '.join(PLACES)}, or a file that's there")
    try:
        return load_room(path)
    except OSError as error:
        raise FormatError(path.name, error.strerror or str(error)) from None


@dataclass(frozen=True, slots=True)
class MobileServing:
    """What `vrs serve` serves of a mobile robot, and where."""

    robot: Robot

    host: str
    port: int
    allowed: Hosts
    """What requests may ask for."""
    room: str
    architecture: str
    conditions: LinkConditions
    link_loss: LossPolicy | None
    """None leaves it to the robot."""
    max_age: float
    seed: int
    robot_at: str | None
    """`ws://HOST:PORT/site`; None: one is started."""
    robot_token: str | None = field(repr=False)
    until_eof: bool
    operator_loss: str = "stop"
    jobs: Path | None = None
    """File of the list of jobs; None: it isn't kept."""
    camera: float = CAMERA
    """Pictures a second; 0 for none, nor voice and screen."""

    @property
    def options(self) -> tuple[str, ...]:
        """Of the robot that is started."""
        return (
            "--robot", self.robot.found_by, "--room", self.room, "--architecture", self.architecture,
            "--max-age", f"{self.max_age:g}", "--operator-loss", self.operator_loss,
        )  # fmt: skip


async def serve_mobile(serving: MobileServing, access: Access) -> None:
    """Serve until a signal comes. The page is there before the robot is."""
    import asyncio
    import contextlib

    from interfaces.link.proxy import Address
    from interfaces.stream import sockets

    ended = asyncio.Event()
    end_on_signal(ended)
    room = room_of(serving.room)
    host = serving.host
    async with contextlib.AsyncExitStack() as robots, contextlib.AsyncExitStack() as stack:
        listening = stack.enter_context(contextlib.closing(sockets.bind(host, serving.port)))
        port = listening.getsockname()[1]
        lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        robot = asyncio.create_task(start_robot(robots, serving.robot_at, serving.options, lost.set_result))
        stack.push_async_callback(abandon, robot)
        await asyncio.to_thread(_load)

        from interfaces.jobs import JobFile
        from interfaces.media import CameraConfig
        from interfaces.runtime.live.mobile_operator import LiveMobileOperator, LiveMobileOperatorConfig
        from interfaces.station.page import Station
        from interfaces.station.panels import MOBILE_PANELS
        from interfaces.stream.server import application
        from interfaces.val2.val_arm import lasts
        from robots.onboard.lease import LeaseState

        seeing = bool(serving.camera) and serving.robot.device(HeadCamera) is not None
        config = LiveMobileOperatorConfig(
            serving.robot, room, "", serving.conditions, serving.robot_token, serving.seed, software(),
            None if serving.jobs is None else JobFile(serving.jobs),
            camera=CameraConfig(serving.camera, robot=serving.robot.found_by) if seeing else None,
            link_loss=serving.link_loss, arm=lasts,
        )  # fmt: skip
        operator = LiveMobileOperator(config, access)
        lost.add_done_callback(partial(say_lost, operator.lose))
        panels = tuple(panel for panel in MOBILE_PANELS if seeing or panel.name != "camera")
        station = Station({"mobile": True, "name": serving.robot.name}, panels=panels)
        app = application([*operator.routes, *station.routes], serving.allowed(port))
        await stack.enter_async_context(station.running())
        await stack.enter_async_context(sockets.serve(app, listening))
        await stack.enter_async_context(operator.running())
        keep_quiet()
        tidying = asyncio.create_task(collect_at_leisure(lambda: operator.hub.lease_state is LeaseState.FREE))
        stack.callback(tidying.cancel)
        shown = Address(host, port)
        typer.echo(f"vrs: serving {serving.robot.name} on http://{shown}/view (programs: ws://{shown}/ws)")
        typer.echo(f"vrs: operator station on http://{shown}/")
        sys.stdout.flush()
        if serving.until_eof:
            end_with_input(ended)
        ending = asyncio.create_task(ended.wait())
        await asyncio.wait([robot, ending], return_when=asyncio.FIRST_COMPLETED)
        if robot.done():
            operator.robot.url = robot.result()
            say_robot(robot.result(), serving.conditions, serving.link_loss)
        await ending


def _load() -> None:
    """Import what takes long, while the robot's process does the same."""
    import interfaces.runtime.live.mobile_operator
    import interfaces.station.page  # noqa: F401
