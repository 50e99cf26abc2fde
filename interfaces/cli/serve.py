"""`vrs serve`: the operator's site: virtual robot, streams, the operator station, and a robot if there's none."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.mobile import (
    ARCHITECTURE,
    CAMERA,
    JOBS,
    OPERATOR_LOSS,
    ROOM,
    Architecture,
    CameraRate,
    MobileServing,
    OperatorLossName,
    RoomName,
    left_out,
    room_of,
    serve_mobile,
    without,
)
from interfaces.cli.options import (
    PROFILES,
    BodyName,
    Host,
    Hosts,
    Port,
    ReachedAs,
    RobotName,
    TokenFile,
    abandon,
    access_for,
    asked_for,
    collect_at_leisure,
    end_on_signal,
    end_with_input,
    keep_quiet,
    say_lost,
    say_robot,
    speaks_val,
    start_robot,
)
from interfaces.system import software
from robots.robot import USUAL, HeadCamera, load
from vrs.checks import number_in, one_of
from vrs.errors import InvalidValueError
from vrs.model import home

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interfaces.link import LinkConditions
    from interfaces.recording.live import LiveRecording
    from interfaces.stream.access import Access
    from robots.onboard import LossPolicy
    from robots.robot import Robot

RECORDINGS = Path("recordings")
"""Where the station records to, unless told otherwise."""


def serve(
    host: Host = "127.0.0.1",
    port: Port = 8600,
    name: RobotName = USUAL,
    architecture: Architecture = ARCHITECTURE,
    room: RoomName = ROOM,
    camera: CameraRate = CAMERA,
    delay: Annotated[
        str,
        typer.Option(
            "--delay",
            metavar="PROFILE",
            help=f"Emulated on the way to the robot: {PROFILES}",
        ),
    ] = "none",
    loss: Annotated[
        str, typer.Option("--loss", metavar="P", help="Emulated loss: a probability, or as vrs link takes it.")
    ] = "0",
    service: Annotated[
        str, typer.Option("--service", metavar="ORDER", help="Emulated delivery: datagram or in-order.")
    ] = "datagram",
    seed: Annotated[int, typer.Option("--seed", min=0, metavar="N", help="Seed of the emulated link.")] = 0,
    offset: Annotated[
        str,
        typer.Option(
            "--offset",
            metavar="OFFSET",
            help="How far the robot that this starts plays behind: adaptive, fixed (from the profile) or fixed:S.",
        ),
    ] = "adaptive",
    link_loss: Annotated[
        str | None,
        typer.Option(
            "--link-loss",
            metavar="POLICY",
            help="What the robot does when nothing fresh comes: halt (it stops, and waits for a resume) or hold "
            "(it waits, and goes on). Unless given, hold where --delay is too slow for halt; else halt, or what "
            "the robot at --robot-at was started with.",
        ),
    ] = None,
    operator_loss: OperatorLossName = OPERATOR_LOSS,
    jobs: Annotated[
        Path, typer.Option("--jobs", metavar="FILE.json", help="Of a mobile robot, where the list of jobs is kept.")
    ] = JOBS,
    max_age: Annotated[
        float,
        typer.Option(
            "--max-age",
            metavar="S",
            help="Of the robot that this starts: oldest message that counts under halt [s], 0.01 to 2.",
        ),
    ] = 0.5,
    body: BodyName = "",
    robot_at: Annotated[
        str | None,
        typer.Option("--robot-at", metavar="HOST:PORT", help="Where vrs robot listens; without it one is started."),
    ] = None,
    robot_token_file: Annotated[
        Path | None, typer.Option("--robot-token-file", metavar="FILE", help="Token file of that robot.")
    ] = None,
    token_file: TokenFile = None,
    reached_as: ReachedAs = None,
    val_port: Annotated[
        int | None,
        typer.Option(
            "--val-port",
            min=0,
            max=65535,
            metavar="N",
            help="VAL-II's monitor on plain TCP, on loopback only, by a token; 0 for any port that's free.",
        ),
    ] = None,
    val_files: Annotated[
        Path, typer.Option("--val-files", metavar="DIR", help="Where the LOAD and STORE of VAL-II find files.")
    ] = Path(),
    record: Annotated[
        Path | None,
        typer.Option("--record", metavar="FILE.mcap", help="Record everything; vrs replay and compare read it."),
    ] = None,
    recordings: Annotated[
        Path,
        typer.Option("--recordings", metavar="DIR", help="Where the station records to; made when it's needed."),
    ] = RECORDINGS,
    until_eof: Annotated[bool, typer.Option("--until-eof", help="End when standard input does.")] = False,
) -> None:
    """Serve the virtual robot to browsers and programs, and let a real one follow it, until Ctrl-C or SIGTERM."""
    import uvloop

    from interfaces.link import Conditions, LinkConditions, delay_profile, loss_model
    from interfaces.link.proxy import parse_address
    from interfaces.messages.control import Role
    from interfaces.messages.jobs import OperatorLoss
    from interfaces.messages.recording import OWN
    from interfaces.recording.live import RATE, LiveRecording
    from interfaces.recording.mcap_file import Sink
    from interfaces.runs.twin_run import fixed_offset, spelled
    from interfaces.runtime.live.emulation import late_often, too_slow
    from interfaces.stream.access import OPEN, read_tokens
    from interfaces.teleop.architectures import architecture as makes
    from robots.onboard import LossPolicy

    robot = load(name)
    policy = None if link_loss is None else LossPolicy(one_of("link-loss", link_loss, LossPolicy))
    number_in("max-age", max_age, 0.01, 2.0, unit=" s")
    robot.body(body)
    if robot_at is not None:
        left_out("the robot at --robot-at has its own", {
            "offset": (offset, "adaptive"), "max-age": (max_age, 0.5),
            "body": (body, ""), "operator-loss": (operator_loss, OPERATOR_LOSS),
            "architecture": (architecture, ARCHITECTURE),
        })  # fmt: skip
    elif robot_token_file is not None:
        raise InvalidValueError("robot-token-file", str(robot_token_file), "left out without --robot-at")
    profile = delay_profile(delay)
    way = Conditions(delay=profile, loss=loss_model(loss), service=service)  # type: ignore[arg-type]
    link = LinkConditions.symmetric(way)
    if policy is not None:
        advice = late_often(link, policy, max_age)
    elif slow := too_slow(link, max_age):
        policy, advice = LossPolicy.HOLD, f"--link-loss hold: {slow}"
    else:
        policy, advice = None if robot_at is not None else LossPolicy.HALT, ""
    at = None if robot_at is None else f"ws://{parse_address('--robot-at', robot_at)}/site"
    allowed = asked_for(host, reached_as or ())
    token = None if robot_token_file is None else read_tokens(robot_token_file).get(Role.SITE)
    if robot.is_base:
        without(robot.name, {
            "offset": (offset, "adaptive"), "body": (body, ""), "val-port": (val_port, None),
            "val-files": (val_files, Path()), "record": (record, None), "recordings": (recordings, RECORDINGS),
        })  # fmt: skip
        room_of(room)
        if jobs.exists() and not jobs.is_file():
            raise InvalidValueError("jobs", str(jobs), "a file, or one that can be made")
        makes(architecture)
        if robot.device(HeadCamera) is None:
            without(robot.name, {"camera": (camera, CAMERA)})
        if camera:
            number_in("camera", camera, 1.0, 30.0, unit=" pictures a second, or 0 for no camera")
        serving = MobileServing(
            robot, host, port, allowed, room, architecture, link, policy, max_age, seed, at, token, until_eof,
            one_of("operator-loss", operator_loss, OperatorLoss), jobs, camera,
        )  # fmt: skip
        _advise(advice)
        uvloop.run(serve_mobile(serving, access_for(host, token_file, free=OPEN)))
        return
    without(robot.name, {
        "architecture": (architecture, ARCHITECTURE), "room": (room, ROOM), "jobs": (jobs, JOBS),
        "operator-loss": (operator_loss, OPERATOR_LOSS), "camera": (camera, CAMERA),
    })  # fmt: skip
    if not speaks_val(robot):
        without(robot.name, {"val-port": (val_port, None), "val-files": (val_files, Path())})
    behind = spelled(fixed_offset(offset, profile))
    options = ["--robot", name, "--offset", behind, "--max-age", f"{max_age:g}"]
    options += ["--body", body] if body else []
    recording = None
    told = behind if robot_at is None else OWN, OWN if policy is None else policy.value
    if recordings.exists() and not recordings.is_dir():
        raise InvalidValueError("recordings", str(recordings), "a directory, or one that can be made")
    if record is not None:
        if record.is_file():
            raise InvalidValueError("record", str(record), "a file that isn't there yet: none is written over")
        # Before a robot is started.
        Sink.create(record).close()
        options += ["--reports", f"{RATE:g}"]
        recording = LiveRecording(record, *told, _recording_failed)
    _advise(advice)
    if not val_files.is_dir():
        raise InvalidValueError("val-files", str(val_files), "a directory")
    access = access_for(host, token_file, free=OPEN)
    doors = _Doors(host, port, allowed, val_port, val_files, until_eof)
    uvloop.run(
        _serve(
            robot,
            access,
            doors,
            link,
            seed,
            at,
            token,
            policy,
            options,
            recording,
            _Shelved(recordings, *told),
        )
    )


def _advise(advice: str) -> None:
    """Say what is likely to go wrong, if anything is."""
    if advice:
        typer.echo(f"vrs: {advice}", err=True)


def _recording_failed(problem: str) -> None:
    typer.echo(f"vrs: {problem}", err=True)


@dataclass(frozen=True, slots=True)
class _Doors:
    """Where it listens."""

    host: str
    port: int
    allowed: Hosts
    """What requests may ask for."""
    val_port: int | None
    """Of the monitor; None for none."""
    val_files: Path
    until_eof: bool


@dataclass(frozen=True, slots=True)
class _Shelved:
    """Where the station records to, and what a recording says of the robot."""

    directory: Path
    offset: str
    link_loss: str


async def _serve(
    arm: Robot,
    access: Access,
    doors: _Doors,
    conditions: LinkConditions,
    seed: int,
    robot_at: str | None,
    robot_token: str | None,
    link_loss: LossPolicy | None,
    options: Sequence[str],
    recording: LiveRecording | None,
    shelved: _Shelved,
) -> None:
    """Run until a signal comes. The page is there before the robot is."""
    import asyncio
    import contextlib

    from interfaces.link.proxy import Address
    from interfaces.stream import sockets

    ended = asyncio.Event()
    end_on_signal(ended)
    host = doors.host
    async with contextlib.AsyncExitStack() as robots, contextlib.AsyncExitStack() as stack:
        listening = stack.enter_context(contextlib.closing(sockets.bind(host, doors.port)))
        port = listening.getsockname()[1]
        val_listening = None
        if doors.val_port is not None:
            val_listening = stack.enter_context(contextlib.closing(sockets.bind("127.0.0.1", doors.val_port)))
        lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        robot = asyncio.create_task(start_robot(robots, robot_at, options, lost.set_result))
        stack.push_async_callback(abandon, robot)
        await asyncio.to_thread(_load)

        from interfaces.messages.control import Role
        from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
        from interfaces.station.chain import described
        from interfaces.station.page import Station
        from interfaces.station.panels import PANELS
        from interfaces.station.record import Recordings
        from interfaces.station.shelf import Shelf
        from interfaces.stream.access import Access, make_token
        from interfaces.stream.local import LocalClient
        from interfaces.stream.server import application
        from interfaces.val2.pages import PageTerminalServer
        from interfaces.val2.rooms import HOST, served_room
        from interfaces.val2.tcp import TcpTerminalServer
        from robots.onboard.lease import LeaseState

        model = arm.arm
        config = LiveOperatorConfig(
            arm, home(model), "", conditions, robot_token, seed,
            server=software(), recording=recording, link_loss=link_loss,
        )  # fmt: skip
        operator = LiveOperator(config, access)
        lost.add_done_callback(partial(say_lost, operator.lose))
        panels = tuple(panel for panel in PANELS if speaks_val(arm) or panel.name != "terminal")
        station = Station(described(model, operator.scene.tool), panels=panels)
        shown = Address(host, port)
        client = LocalClient(operator.hub, operator.clock, "VAL-II terminals", operator.server.kick)
        val = served_room(client, operator.operator, doors.val_files, software())
        terminals = PageTerminalServer(val, access).route
        recordings = Recordings(
            operator, Shelf(shelved.directory, arm), access,
            offset=shelved.offset, link_loss=shelved.link_loss, failed=_recording_failed,
        )  # fmt: skip
        routes = [*operator.routes, terminals, *recordings.routes, *station.routes]
        app = application(routes, doors.allowed(port))
        await stack.enter_async_context(station.running())
        await stack.enter_async_context(sockets.serve(app, listening))
        await stack.enter_async_context(operator.running())
        await stack.enter_async_context(recordings.running())
        keep_quiet()
        tidying = asyncio.create_task(collect_at_leisure(lambda: operator.hub.lease_state is LeaseState.FREE))
        stack.callback(tidying.cancel)
        typer.echo(f"vrs: serving {arm.name} on http://{shown}/view (programs: ws://{shown}/ws)")
        typer.echo(f"vrs: operator station on http://{shown}/")
        if val_listening is not None:
            val_token = None if access.needs_tokens else make_token()
            val_access = access if val_token is None else Access({Role.OPERATOR: val_token}, free=())
            await val.ready()
            val_door = TcpTerminalServer(val, val_access)
            await stack.enter_async_context(val_door.listening(val_listening))
            typer.echo(f"vrs: VAL-II on {HOST} port {val_listening.getsockname()[1]}")
            if val_token is not None:
                typer.echo(f"vrs: VAL-II asks each terminal for a token, the first line to send: {val_token}")
        sys.stdout.flush()
        if doors.until_eof:
            end_with_input(ended)
        ending = asyncio.create_task(ended.wait())
        await asyncio.wait([robot, ending], return_when=asyncio.FIRST_COMPLETED)
        if robot.done():
            operator.robot.url = robot.result()
            say_robot(robot.result(), conditions, link_loss)
        await ending


def _load() -> None:
    """Import what takes long, while the robot's process does the same."""
    import interfaces.runtime.live.operator
    import interfaces.station.page  # noqa: F401
