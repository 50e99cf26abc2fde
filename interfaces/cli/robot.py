"""vrs robot: only the real robot, for an operator's site somewhere else; with --rsp the thin client CUBO."""

from __future__ import annotations

import asyncio
import secrets
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.mobile import (
    ARCHITECTURE,
    OPERATOR_LOSS,
    ROBOTS,
    ROOM,
    Architecture,
    OperatorLossName,
    RobotName,
    RoomName,
    left_out,
    room_of,
    without,
)
from interfaces.cli.options import (
    Hosts,
    ReachedAs,
    TokenFile,
    access_for,
    asked_for,
    end_on_signal,
    end_with_input,
    is_loopback,
    keep_quiet,
    saying_policy,
)
from interfaces.system import software
from vrs.checks import number_in, one_of
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    import socket

    from interfaces.link.proxy import Address
    from interfaces.rsp.model import RobotModel
    from interfaces.rsp.session import Keyring
    from interfaces.runtime.live.robot import LiveBody, LiveRobot
    from robots.bullet.rooms import Room


def thin_client(address: str, model: Path | None, room: Room, token_file: Path | None, *, until_eof: bool) -> None:
    """Run a CUBO until a signal comes or its body fails.

    Args:
        address: Where it listens for RSP, HOST:PORT.
        model: Of its devices; CUBO's own unless given.
        room: Where it drives.
        token_file: Keys; needed off loopback, made if it's missing.
        until_eof: Whether it ends with standard input.

    Raises:
        InvalidValueError: If something isn't allowed.
        FormatError: If a file or the address can't be used.
    """
    import uvloop

    from interfaces.link.proxy import parse_address
    from interfaces.rsp.live import bind
    from interfaces.rsp.model import read_model
    from robots.cubo.parameters import MODEL_FILE

    where = parse_address("--rsp", address)
    robot = read_model(MODEL_FILE if model is None else model)
    keys = _keys(where.host, token_file)
    sock = bind(where.host, where.port)
    problem = uvloop.run(_serve_rsp(robot, room, keys, sock, until_eof=until_eof))
    if problem:
        typer.echo(f"vrs: {problem}", err=True)
        raise typer.Exit(1)


def _keys(host: str, token_file: Path | None) -> Keyring | None:
    from interfaces.rsp.live import keys_of
    from interfaces.stream.access import make_tokens, read_tokens

    if token_file is None:
        if not is_loopback(host):
            raise InvalidValueError("host", host, "127.0.0.1 or localhost, unless a --token-file is given")
        return None
    return keys_of(read_tokens(token_file) if token_file.exists() else make_tokens(token_file), token_file)


async def _serve_rsp(
    model: RobotModel, room: Room, keys: Keyring | None, sock: socket.socket, *, until_eof: bool
) -> str:
    """Run until a signal comes, the body fails, or standard input ends; what failed, if anything did."""
    from interfaces.rsp.host import RspHost
    from interfaces.rsp.live import RspServer
    from interfaces.rsp.robot import RobotCore
    from interfaces.runtime.live.process import READY
    from interfaces.system import hasten
    from robots.cubo.body import MOVES, CuboBody
    from vrs.clock import WallClock

    ended = asyncio.Event()
    end_on_signal(ended)
    with CuboBody(room=room) as body:
        clock = WallClock()
        host = RspHost(RobotCore(model, secrets.token_bytes, keys=keys), body, frozenset(MOVES), now=clock.now())
        server = RspServer(host, sock, clock)
        server.failed.add_done_callback(lambda _: ended.set())
        address, port = sock.getsockname()[:2]
        async with server.running():
            keep_quiet()
            hasten(1)
            sealed = "sealed" if keys else "in the clear"
            typer.echo(f"{READY}rsp://{address}:{port} ({model.name}, {len(model.elements)} devices, {sealed})")
            sys.stdout.flush()
            if until_eof:
                end_with_input(ended)
            await ended.wait()
            failed = server.failed
            error = failed.exception() if failed.done() and not failed.cancelled() else None
    return "" if error is None else f"the body failed: {error}"


LISTEN = "127.0.0.1:8601"
"""Where an operator's site connects, unless told otherwise."""


def robot(
    rsp: Annotated[
        str | None,
        typer.Option(
            "--rsp",
            metavar="HOST:PORT",
            help="Be a thin client instead, CUBO, that is driven by RSP over UDP here.",
        ),
    ] = None,
    rsp_model: Annotated[
        Path | None,
        typer.Option("--model", metavar="FILE.xmi", help="With --rsp: another robot model than CUBO's own."),
    ] = None,
    listen: Annotated[
        str,
        typer.Option("--listen", metavar="HOST:PORT", help="Where an operator's site connects; port 0 for any."),
    ] = LISTEN,
    name: RobotName = "puma560",
    architecture: Architecture = ARCHITECTURE,
    room: RoomName = ROOM,
    offset: Annotated[
        str,
        typer.Option(
            "--offset", metavar="OFFSET", help="How far behind the operator it plays: adaptive or fixed:S."
        ),
    ] = "adaptive",
    link_loss: Annotated[
        str,
        typer.Option(
            "--link-loss",
            metavar="POLICY",
            help="Unless the operator's site says otherwise. halt: stop when nothing fresh comes for "
            "--timeout, and wait for a resume; hold: wait and go on.",
        ),
    ] = "halt",
    operator_loss: OperatorLossName = OPERATOR_LOSS,
    timeout: Annotated[
        float, typer.Option("--timeout", metavar="S", help="T_loss under halt [s], 0.1 to 2.")
    ] = 0.5,
    max_age: Annotated[
        float,
        typer.Option(
            "--max-age",
            metavar="S",
            help="Oldest message that counts under halt [s], 0.01 to 2; doubt about the clocks is added.",
        ),
    ] = 0.5,
    lead: Annotated[
        float,
        typer.Option(
            "--lead", metavar="S", help="How far ahead the body is told what to do [s], 0.01 to 0.3; it's delay."
        ),
    ] = 0.05,
    body: Annotated[
        str, typer.Option("--body", metavar="BODY", help="puma560 (simulated physics) or exact (follows exactly).")
    ] = "puma560",
    friction: Annotated[bool, typer.Option("--friction/--no-friction", help="Friction in its joints.")] = True,
    pose: Annotated[str, typer.Option("--pose", metavar="NAME", help="Named pose to begin in.")] = "nominal",
    reports: Annotated[
        float, typer.Option("--reports", metavar="N", help="How often it says where it is [1/s], 1 to 200.")
    ] = 30.0,
    token_file: TokenFile = None,
    reached_as: ReachedAs = None,
    until_eof: Annotated[
        bool, typer.Option("--until-eof", help="End when standard input does, once the robot rests.")
    ] = False,
) -> None:
    """Run the real robot and its site, until Ctrl-C or SIGTERM."""
    if rsp is not None:
        left_out("a thin client has nothing of the kind", {
            "listen": (listen, LISTEN), "robot": (name, "puma560"), "architecture": (architecture, ARCHITECTURE),
            "offset": (offset, "adaptive"), "link-loss": (link_loss, "halt"), "timeout": (timeout, 0.5),
            "operator-loss": (operator_loss, OPERATOR_LOSS), "max-age": (max_age, 0.5), "lead": (lead, 0.05),
            "body": (body, "puma560"), "friction": (friction, True), "pose": (pose, "nominal"),
            "reports": (reports, 30.0), "reached-as": (reached_as, None),
        })  # fmt: skip
        thin_client(rsp, rsp_model, room_of(room), token_file, until_eof=until_eof)
        return
    if rsp_model is not None:
        raise InvalidValueError("--model", str(rsp_model), "given with --rsp only")
    import uvloop

    from interfaces.link.proxy import parse_address
    from interfaces.messages.control import Role
    from interfaces.runtime.live.robot import LiveRobot
    from robots.onboard import LossPolicy, WatchdogConfig

    number_in("timeout", timeout, 0.1, 2.0, unit=" s")
    number_in("max-age", max_age, 0.01, 2.0, unit=" s")
    arms = {
        "offset": (offset, "adaptive"), "lead": (lead, 0.05), "body": (body, "puma560"),
        "friction": (friction, True), "pose": (pose, "nominal"),
    }  # fmt: skip
    bases = {
        "architecture": (architecture, ARCHITECTURE), "room": (room, ROOM),
        "operator-loss": (operator_loss, OPERATOR_LOSS),
    }  # fmt: skip
    mobile = one_of("robot", name, ROBOTS) == "ipr"
    without(name, arms if mobile else bases)
    address = parse_address("--listen", listen)
    policy = LossPolicy(one_of("link-loss", link_loss, LossPolicy))
    beat = 1.0 / number_in("reports", reports, 1.0, 200.0, unit=" a second")
    halting = WatchdogConfig(timeout=timeout, max_age=max_age, max_uncertainty=1.0)
    watchdog = halting if policy is LossPolicy.HALT else None
    access = access_for(address.host, token_file, free={Role.SITE})
    allowed = asked_for(address.host, reached_as or ())
    made: LiveBody
    if mobile:
        from interfaces.jobs import RunnerConfig
        from interfaces.media import Aloud
        from interfaces.messages.jobs import POLICY_SAYS, OperatorLoss
        from interfaces.runtime.live.paced_body import PacedBody, PacedConfig
        from interfaces.teleop.architectures.compositions import CONTROL
        from interfaces.teleop.driving import DrivenConfig, Hands
        from interfaces.val2.val_arm import ValArm, in_a_thread

        driven = DrivenConfig(period=CONTROL, beat=beat, watchdog=watchdog)
        loss = OperatorLoss(one_of("operator-loss", operator_loss, OperatorLoss))
        hands = Hands(speaker=Aloud(), arm=ValArm(beside=in_a_thread()))
        made = PacedBody(
            PacedConfig(room_of(room), architecture, driven, RunnerConfig(loss=loss), hands, halting=halting)
        )
        kind, remark = architecture, POLICY_SAYS[loss]
    else:
        from interfaces.runtime.live.physics_body import PhysicsBody
        from interfaces.runtime.physics import PhysicsConfig
        from interfaces.runtime.physics_messages import BodyKind
        from interfaces.teleop import RobotHostConfig, RobotSiteConfig
        from robots import puma560

        model = puma560.model()
        q, kind = model.poses[one_of("pose", pose, sorted(model.poses))], one_of("body", body, BodyKind)
        number_in("lead", lead, 0.01, 0.3, unit=" s")
        site = RobotSiteConfig(fixed_offset=_offset(offset), beat=beat, watchdog=watchdog)
        host = RobotHostConfig(site=site, lead=lead, halting=halting)
        made = PhysicsBody(model, PhysicsConfig(model.limits, q, BodyKind(kind), friction), host)
        remark = ""

    async def main() -> str:
        says = f"{made.name}, {kind}", remark
        return await _serve(LiveRobot(made, access, server=software()), says, address, allowed, until_eof=until_eof)

    problem = uvloop.run(main())
    if problem:
        typer.echo(f"vrs: {problem}", err=True)
        raise typer.Exit(1)


def _offset(text: str) -> float | None:
    from interfaces.link import delay_profile
    from interfaces.runs.twin_run import FIXED, fixed_offset

    if text == FIXED:
        allowed = "'adaptive' or 'fixed:S', as in fixed:0.5: a robot knows no profile"
        raise InvalidValueError("offset", text, allowed)
    return fixed_offset(text, delay_profile("none"))


async def _serve(
    robot: LiveRobot, says: tuple[str, str], address: Address, allowed: Hosts, *, until_eof: bool
) -> str:
    """Run until a signal comes, the body fails, or standard input ends; what failed, if anything did."""
    from interfaces.link.proxy import Address
    from interfaces.runtime.live.process import READY
    from interfaces.runtime.live.robot_server import LARGEST
    from interfaces.stream import sockets
    from interfaces.stream.server import application
    from interfaces.system import hasten

    end_on_signal(robot.ended)
    robot.met = saying_policy()
    listening = sockets.bind(address.host, address.port)
    port = listening.getsockname()[1]
    app = application(robot.routes, allowed(port))
    kind, remark = says
    async with sockets.serve(app, listening, largest=LARGEST), robot.running():
        await robot.ready()
        keep_quiet()
        hasten(1)
        if not robot.ended.is_set():
            here = Address(address.host, port)
            typer.echo(f"{READY}ws://{here}/site ({kind})")
            if remark:
                typer.echo(f"vrs: {remark}", err=True)
            sys.stdout.flush()
        if until_eof:
            end_with_input(robot.ended)
        await robot.ended.wait()
        await robot.rest()
    return robot.body.problem
