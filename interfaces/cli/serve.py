"""`vrs serve`: the operator's site: virtual robot, streams, a page to look at, and a robot if there's none."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.doors import TokenFile, access_for, end_on_signal, end_with_input, keep_quiet, names_of
from interfaces.cli.options import PROFILES, Host, Port
from interfaces.software import software
from vrs.checks import one_of
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interfaces.link import LinkConditions
    from interfaces.recording.live import LiveRecording
    from interfaces.stream.access import Access


def serve(
    host: Host = "127.0.0.1",
    port: Port = 8600,
    robot: Annotated[str, typer.Option("--robot", metavar="NAME", help="puma560.")] = "puma560",
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
        str,
        typer.Option("--link-loss", metavar="POLICY", help="Of the robot that this starts: halt or hold."),
    ] = "halt",
    max_age: Annotated[
        float,
        typer.Option("--max-age", metavar="S", help="Of the robot that this starts: oldest message that counts."),
    ] = 0.5,
    body: Annotated[
        str, typer.Option("--body", metavar="BODY", help="Of the robot that this starts: puma560 or exact.")
    ] = "puma560",
    robot_at: Annotated[
        str | None,
        typer.Option("--robot-at", metavar="HOST:PORT", help="Where vrs robot listens; without it one is started."),
    ] = None,
    robot_token_file: Annotated[
        Path | None, typer.Option("--robot-token-file", metavar="FILE", help="Token file of that robot.")
    ] = None,
    token_file: TokenFile = None,
    val_port: Annotated[
        int | None,
        typer.Option(
            "--val-port",
            min=0,
            max=65535,
            metavar="N",
            help="VAL-II's monitor on plain TCP, on loopback only; 0 for any port that's free.",
        ),
    ] = None,
    val_files: Annotated[
        Path, typer.Option("--val-files", metavar="DIR", help="Where that monitor's LOAD and STORE find files.")
    ] = Path(),
    record: Annotated[
        Path | None,
        typer.Option("--record", metavar="FILE.mcap", help="Record everything; vrs replay and compare read it."),
    ] = None,
    until_eof: Annotated[bool, typer.Option("--until-eof", help="End when standard input does.")] = False,
) -> None:
    """Serve the virtual robot to browsers and programs, and let a real one follow it, until Ctrl-C or SIGTERM."""
    import uvloop

    from interfaces.link import Conditions, LinkConditions, delay_profile, loss_model
    from interfaces.link.proxy import parse_address
    from interfaces.recording.live import RATE, LiveRecording
    from interfaces.recording.messages import OWN
    from interfaces.recording.sink import Sink
    from interfaces.runtime.offset import QUANTILE, fixed_offset, spelled
    from interfaces.stream.access import OPEN, read_tokens
    from interfaces.stream.control import Role
    from robots.onboard import LossPolicy

    if robot != "puma560":
        raise InvalidValueError("robot", robot, "puma560")
    policy = LossPolicy(one_of("link-loss", link_loss, LossPolicy))
    profile = delay_profile(delay)
    way = Conditions(delay=profile, loss=loss_model(loss), service=service)  # type: ignore[arg-type]
    behind = spelled(fixed_offset(offset, profile))
    options = ["--offset", behind, "--link-loss", policy, "--body", body, "--max-age", f"{max_age:g}"]
    recording = None
    if record is not None:
        if record.is_file():
            raise InvalidValueError("record", str(record), "a file that isn't there yet: none is written over")
        # Before a robot is started.
        Sink.create(record).close()
        options += ["--reports", f"{RATE:g}"]
        facts = (behind, str(policy)) if robot_at is None else (OWN, OWN)
        recording = LiveRecording(record, *facts, _recording_failed)
    # Half a round trip isn't known of the clocks, and counts as age.
    usual = 2.0 * profile.quantile(QUANTILE)
    if policy is LossPolicy.HALT and usual > max_age:
        typer.echo(
            f"vrs: messages will often be {usual:.2g} s old, with what isn't known of the clocks, and those older "
            f"than {max_age:g} s don't count: try --link-loss hold, or --max-age up to 2",
            err=True,
        )
    at = None if robot_at is None else parse_address("--robot-at", robot_at)
    token = None if robot_token_file is None else read_tokens(robot_token_file).get(Role.SITE)
    if not val_files.is_dir():
        raise InvalidValueError("val-files", str(val_files), "a directory")
    access = access_for(host, token_file, free=OPEN)
    own = None if token_file is None else read_tokens(token_file).get(Role.OPERATOR)
    doors = _Doors(host, port, val_port, val_files, own, until_eof)
    uvloop.run(
        _serve(
            access,
            doors,
            LinkConditions.symmetric(way),
            seed,
            None if at is None else f"ws://{at}/site",
            token,
            options,
            recording,
        )
    )


def _recording_failed(problem: str) -> None:
    typer.echo(f"vrs: {problem}", err=True)


@dataclass(frozen=True, slots=True)
class _Doors:
    """Where it listens."""

    host: str
    port: int
    val_port: int | None
    """Of the monitor; None for none."""
    val_files: Path
    own_token: str | None = field(repr=False)
    """By which the monitor is an operator."""
    until_eof: bool


async def _serve(
    access: Access,
    doors: _Doors,
    conditions: LinkConditions,
    seed: int,
    robot_at: str | None,
    robot_token: str | None,
    options: Sequence[str],
    recording: LiveRecording | None,
) -> None:
    """Run until a signal comes."""
    import asyncio
    import contextlib

    from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
    from interfaces.runtime.live.process import local_robot
    from interfaces.stream import sockets
    from interfaces.stream.access import hosts
    from interfaces.stream.server import application
    from interfaces.val2.served import HOST, ServedVal
    from robots import puma560

    ended = asyncio.Event()
    end_on_signal(ended)
    model = puma560.model()
    host = doors.host
    listening = sockets.bind(host, doors.port)
    port = listening.getsockname()[1]
    async with contextlib.AsyncExitStack() as stack:
        stack.callback(listening.close)
        val_listening = None if doors.val_port is None else sockets.bind(HOST, doors.val_port)
        if val_listening is not None:
            stack.callback(val_listening.close)
        url = await stack.enter_async_context(local_robot(options)) if robot_at is None else robot_at
        config = LiveOperatorConfig(
            model, model.poses["nominal"], url, conditions, robot_token, seed,
            server=software(), recording=recording,
        )  # fmt: skip
        operator = LiveOperator(config, access)
        app = application(operator.routes, hosts(names_of(host), port))
        await stack.enter_async_context(sockets.serve(app, listening))
        await stack.enter_async_context(operator.running())
        keep_quiet()
        shown = f"[{host}]" if ":" in host else host
        typer.echo(f"vrs: serving {model.name} on http://{shown}:{port}/view (programs: ws://{shown}:{port}/ws)")
        typer.echo(f"vrs: robot at {url}, emulated delay {conditions.forward.delay.name}", err=True)
        if val_listening is not None:
            near = shown if shown not in {"0.0.0.0", "[::]"} else "127.0.0.1"  # noqa: S104 - compared
            door = ServedVal(f"ws://{near}:{port}/ws", doors.own_token, access, doors.val_files, software())
            await stack.enter_async_context(door.listening(val_listening))
            typer.echo(f"vrs: VAL-II on {HOST} port {val_listening.getsockname()[1]}")
        sys.stdout.flush()
        if doors.until_eof:
            end_with_input(ended)
        await ended.wait()
