"""vrs robot: only the real robot, for an operator's site somewhere else; with --rsp a thin client."""

from __future__ import annotations

import asyncio
import secrets
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from interfaces.cli.options import (
    ARCHITECTURE,
    OF_SITES,
    OPERATOR_LOSS,
    ROOM,
    Architecture,
    Audit,
    BodyName,
    Datagrams,
    Hosts,
    OperatorLossName,
    ReachedAs,
    RobotName,
    RoomName,
    SceneFile,
    Tip,
    Tls,
    TlsCert,
    TlsKey,
    TokenFile,
    access_for,
    asked_for,
    audit_log,
    certificate_for,
    check_taken,
    end_on_signal,
    end_with_input,
    keep_quiet,
    left_out,
    option,
    robot_of,
    say_certificate,
    saying_policy,
    schemes,
    shown_host,
    site_certificate,
    tls_of,
    tokens_for,
)
from interfaces.system import run_loop, software
from robots.driver import load_driver, standing
from robots.robot import TIP, USUAL, USUAL_CLIENT, ThinClient, is_driver, load, of_fleet
from vrs.checks import number_in, one_of
from vrs.errors import FormatError, InvalidValueError
from vrs.model import home

if TYPE_CHECKING:
    import socket
    from contextlib import AbstractContextManager

    from interfaces.link.proxy import Address
    from interfaces.rsp.host import HostedBody
    from interfaces.rsp.model import RobotModel
    from interfaces.rsp.session import Keyring
    from interfaces.runtime.live.robot import LiveBody, LiveRobot
    from interfaces.stream.audit import AuditLog
    from interfaces.stream.certificates import Certificate
    from robots.rooms import Room


def thin_client(
    name: str, body: str, address: str, model: Path | None, room: Room, token_file: Path | None, *, until_eof: bool
) -> None:
    """Run a thin client until a signal comes or its body fails.

    Args:
        name: What `robots.load` finds it by.
        body: What is real of it; the usual one if empty.
        address: Where it listens for RSP, HOST:PORT.
        model: Of its devices, a file, or the name of one that comes with it; its own unless given.
        room: Where it drives.
        token_file: Keys; needed off loopback, made if it's missing.
        until_eof: Whether it ends with standard input.

    Raises:
        InvalidValueError: If something isn't allowed.
        FormatError: If a file or the address can't be used.
    """
    from interfaces.link.proxy import parse_address
    from interfaces.rsp.live import bind, keys_of
    from interfaces.rsp.model import read_model

    where = parse_address("--rsp", address)
    client = load(name)
    device = client.device(ThinClient)
    if device is None:
        raise InvalidValueError("robot", name, f"a thin client with --rsp, as {USUAL_CLIENT} is")
    own = device.model if model is None else device.model.parent / f"{model}.xmi"
    chosen = model if model is not None and (model.exists() or not own.exists()) else own
    make, robot = client.body(body), read_model(chosen)
    tokens = tokens_for(where.host, token_file)
    keys = None if tokens is None else keys_of(tokens, token_file)
    sock = bind(where.host, where.port)
    _end(run_loop(_serve_rsp(make(room=room), device, robot, keys, sock, until_eof=until_eof)))


def _end(problem: str) -> None:
    """Say what failed, if anything did, and exit with it."""
    if problem:
        typer.echo(f"vrs: {problem}", err=True)
        raise typer.Exit(1)


async def _serve_rsp(
    made: AbstractContextManager[HostedBody],
    device: ThinClient,
    model: RobotModel,
    keys: Keyring | None,
    sock: socket.socket,
    *,
    until_eof: bool,
) -> str:
    """Run until a signal comes, the body fails, or standard input ends; what failed, if anything did."""
    from interfaces.rsp.host import RspHost
    from interfaces.rsp.live import RspServer
    from interfaces.rsp.robot import RobotCore
    from interfaces.runtime.live.process import READY
    from interfaces.system import hasten
    from vrs.clock import WallClock

    ended = asyncio.Event()
    end_on_signal(ended)
    with made as body:
        clock = WallClock()
        host = RspHost(
            RobotCore(model, secrets.token_bytes, keys=keys), body, frozenset(device.moves), now=clock.now()
        )
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


POSE = "nominal"
"""Pose to begin in, unless told otherwise; see `vrs.model.home`."""


def robot(
    ctx: typer.Context,
    rsp: Annotated[
        str | None, option("HOST:PORT", "Be a thin client instead, that is driven by RSP over UDP here.")
    ] = None,
    rsp_model: Annotated[
        Path | None,
        option("--model FILE.xmi|NAME", "With --rsp: another robot model; story, with camera and microphone."),
    ] = None,
    listen: Annotated[
        str, option("HOST:PORT", "Where an operator's site connects; port 0 for any.")
    ] = "127.0.0.1:8601",
    name: RobotName = USUAL,
    tip: Tip = "",
    architecture: Architecture = ARCHITECTURE,
    room: RoomName = ROOM,
    whereabouts: Annotated[
        Path | None,
        option("FILE", "Of a fleet's robot that vrs serve starts: where all of them say where they are."),
    ] = None,
    offset: Annotated[
        str, option("OFFSET", "How far behind the operator it plays: adaptive or fixed:S.")
    ] = "adaptive",
    link_loss: Annotated[
        str,
        option(
            "POLICY",
            "Unless the operator's site says otherwise. halt: stop when nothing fresh comes for "
            "--timeout, and wait for a resume; hold: wait and go on.",
        ),
    ] = "halt",
    operator_loss: OperatorLossName = OPERATOR_LOSS,
    timeout: Annotated[float, option("S", "T_loss under halt [s], 0.1 to 2.")] = 0.5,
    max_age: Annotated[
        float,
        option("S", "Oldest message that counts under halt [s], 0.01 to 2; doubt about the clocks is added."),
    ] = 0.5,
    lead: Annotated[
        float, option("S", "How far ahead the body is told what to do [s], 0.01 to 0.3; it's delay.")
    ] = 0.05,
    body: BodyName = "",
    scene: SceneFile = None,
    friction: Annotated[bool, option("--friction/--no-friction", "Friction in its joints.")] = True,
    pose: Annotated[str, option("NAME", "Named pose to begin in.")] = POSE,
    reports: Annotated[float, option("N", "How often it says where it is [1/s], 1 to 200.")] = 30.0,
    token_file: TokenFile = None,
    reached_as: ReachedAs = None,
    tls: Tls = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    datagrams: Datagrams = None,
    audit: Audit = None,
    until_eof: Annotated[
        bool, option("--until-eof", "End when standard input does, once the robot rests.")
    ] = False,
) -> None:
    """Run the real robot and its site, until Ctrl-C or SIGTERM."""
    if rsp is not None:
        left_out(ctx, "a thin client has nothing of the kind", OF_SITES)
        from robots.mobile.robot import find_room

        client = USUAL_CLIENT if name == USUAL else name
        thin_client(client, body, rsp, rsp_model, find_room(room), token_file, until_eof=until_eof)
        return
    if rsp_model is not None:
        raise InvalidValueError("--model", str(rsp_model), "given with --rsp only")
    from interfaces.link.proxy import parse_address
    from interfaces.messages.control import Role
    from interfaces.runtime.live.robot import LiveRobot
    from robots.onboard.watchdog import LossPolicy, WatchdogConfig

    number_in("timeout", timeout, 0.1, 2.0, unit=" s")
    number_in("max-age", max_age, 0.01, 2.0, unit=" s")
    chosen = robot_of(name, tip)
    check_taken([chosen], ctx)
    address = parse_address("--listen", listen)
    policy = LossPolicy(one_of("link-loss", link_loss, LossPolicy))
    beat = 1.0 / number_in("reports", reports, 1.0, 200.0, unit=" a second")
    halting = WatchdogConfig(timeout=timeout, max_age=max_age, max_uncertainty=1.0)
    watchdog = halting if policy is LossPolicy.HALT else None
    access = access_for(address.host, token_file, free={Role.SITE})
    allowed = asked_for(address.host, reached_as or ())
    shown = certificate_for(address.host, token_file, reached_as or (), tls=tls, chain=tls_cert, key=tls_key)
    theirs = None
    if shown is not None and token_file is not None:
        from interfaces.stream.certificates import own_certificate

        theirs = own_certificate(site_certificate(token_file), (), client=True)
    door = _Door(address, allowed, shown, theirs, shown is not None if datagrams is None else datagrams)
    made: LiveBody
    place, shared = _surroundings(ctx, name, room, whereabouts)
    if chosen.is_base:
        from interfaces.jobs import RunnerConfig
        from interfaces.media import Aloud
        from interfaces.messages.jobs import POLICY_SAYS, OperatorLoss
        from interfaces.runtime.live.paced_body import PacedBody, PacedConfig
        from interfaces.teleop.architectures.compositions import CONTROL
        from interfaces.teleop.autonomy import Hands
        from interfaces.teleop.following_base import DrivenConfig
        from interfaces.val2.val_arm import ValArm, in_a_thread

        driven = DrivenConfig(period=CONTROL, beat=beat, watchdog=watchdog)
        loss = OperatorLoss(one_of("operator-loss", operator_loss, OperatorLoss))
        hands = Hands(speaker=Aloud(), arm=ValArm(beside=in_a_thread()))
        jobs = RunnerConfig(loss=loss)
        made = PacedBody(
            PacedConfig(chosen.with_body(body), place, architecture, driven, jobs, hands, halting=halting, **shared)
        )
        kind, remark = architecture, POLICY_SAYS[loss]
    else:
        from interfaces.runtime.live.physics_body import PhysicsBody
        from interfaces.runtime.physics import PhysicsConfig
        from interfaces.teleop import RobotHostConfig, RobotSiteConfig
        from robots.things import read_scene

        model = chosen.arm
        q = home(model) if pose == POSE else model.poses[one_of("pose", pose, sorted(model.poses))]
        if is_driver(body):
            q = standing(load_driver(body), model.limits)
        around = None if scene is None else read_scene(scene)
        physics = PhysicsConfig(chosen, q, body, friction, scene=around)
        number_in("lead", lead, 0.01, 0.3, unit=" s")
        site = RobotSiteConfig(fixed_offset=_offset(offset), beat=beat, watchdog=watchdog)
        made, kind = PhysicsBody(physics, RobotHostConfig(site=site, lead=lead, halting=halting)), physics.body
        remark = ""

    async def main() -> str:
        says = f"{made.name}, {kind}", remark
        robot = LiveRobot(made, access, server=software(), audit=log)
        return await _serve(robot, says, door, log, until_eof=until_eof)

    with audit_log(audit) as log:
        access.audit = log
        problem = run_loop(main())
    _end(problem)


def _surroundings(
    ctx: typer.Context, name: str, room: str, whereabouts: Path | None
) -> tuple[Room, dict[str, Any]]:
    """Where a robot drives, and what it shares with others there; one of a fleet drives in the fleet's room.

    Raises:
        InvalidValueError: If there's no such room; if one of a fleet is given a room, or another robot whereabouts.
        FormatError: If a file can't be read.
    """
    from robots.mobile.robot import find_room

    if not of_fleet(name):
        if whereabouts is not None:
            raise InvalidValueError("whereabouts", str(whereabouts), "left out but for a robot of a fleet")
        return find_room(room), {}
    from interfaces.runtime.live.whereabouts import Whereabouts
    from robots.fleet import read_fleet

    left_out(ctx, "the fleet's file says where its robots are", ("room",))
    file, _, called = name.rpartition(TIP)
    fleet = read_fleet(file)
    k = fleet.place(called)
    if whereabouts is None:
        return fleet.room_of(k), {}
    shared = Whereabouts(whereabouts)
    return fleet.room_of(k, shared.where), {"told": partial(shared.put, k), "since": shared.time()}


def _offset(text: str) -> float | None:
    from interfaces.link import delay_profile
    from interfaces.runs.twin_run import FIXED, fixed_offset

    if text == FIXED:
        allowed = "'adaptive' or 'fixed:S', as in fixed:0.5: a robot knows no profile"
        raise InvalidValueError("offset", text, allowed)
    return fixed_offset(text, delay_profile("none"))


class _Door(NamedTuple):
    """Where a robot's site listens, and what both ends show."""

    address: Address
    allowed: Hosts
    certificate: Certificate | None
    """Its own; None without TLS."""
    theirs: Certificate | None
    """What operators' sites show; None where anybody's may come."""
    datagrams: bool
    """Whether datagrams are taken, too."""

    def bound(self, port: int) -> socket.socket | None:
        """Where datagrams come to that port; None without them, or where the port is another program's by UDP."""
        from interfaces.rsp.live import bind

        try:
            return bind(self.address.host, port) if self.datagrams else None
        except FormatError as error:
            typer.echo(f"vrs: no datagrams, the stream alone: UDP, {error}", err=True)
            return None


async def _serve(
    robot: LiveRobot, says: tuple[str, str], door: _Door, log: AuditLog | None, *, until_eof: bool
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
    address, certificate, theirs = door.address, door.certificate, door.theirs
    listening = sockets.bind(address.host, address.port)
    port = listening.getsockname()[1]
    app = application(robot.routes, door.allowed(port), audit=log)
    kind, remark = says
    tls, datagrams = tls_of(certificate, None if theirs is None else theirs.chain), door.bound(port)
    async with sockets.serve(app, listening, largest=LARGEST, tls=tls), robot.running(datagrams):
        await robot.ready()
        keep_quiet()
        hasten(1)
        if not robot.ended.is_set():
            here = Address(shown_host(address.host), port)
            _, scheme, known = schemes(certificate)
            typer.echo(f"{READY}{scheme}://{here}/site{known} ({kind})")
            say_certificate(certificate)
            if theirs is not None:
                typer.echo(f"vrs: operators' sites show {theirs.chain}: copy it to them with the token file")
            if datagrams is not None:
                typer.echo(f"vrs: datagrams, too, by UDP on port {port}")
            if remark:
                typer.echo(f"vrs: {remark}", err=True)
            sys.stdout.flush()
        if until_eof:
            end_with_input(robot.ended)
        await robot.ended.wait()
        await robot.rest()
    return robot.body.problem
