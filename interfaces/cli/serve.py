"""`vrs serve`: the operator's site: virtual robot, streams, the operator station, and a robot if there's none."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote

import typer

from interfaces.cli.options import (
    ARCHITECTURE,
    OPERATOR_LOSS,
    PROFILES,
    ROOM,
    Architecture,
    Audit,
    BodyName,
    Host,
    Hosts,
    OperatorLossName,
    Port,
    ReachedAs,
    RobotNames,
    RoomName,
    SceneFile,
    Tip,
    Tls,
    TlsCert,
    TlsKey,
    TokenFile,
    ZenohFile,
    abandon,
    access_for,
    asked_for,
    audit_log,
    certificate_for,
    check_taken,
    class_access,
    collect_at_leisure,
    end_on_signal,
    end_with_input,
    keep_quiet,
    left_out,
    option,
    robot_of,
    say_certificate,
    say_lost,
    say_robot,
    schemes,
    shown_host,
    site_certificate,
    speaks_val,
    start_robot,
    tls_of,
    untaken,
)
from interfaces.system import run_loop, software
from robots.robot import USUAL, HeadCamera
from vrs.checks import number_in, one_of
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    import asyncio
    from contextlib import AbstractAsyncContextManager

    from interfaces.link import LinkConditions
    from interfaces.link.proxy import Address
    from interfaces.recording.live import LiveRecording
    from interfaces.relay.network import NetworkConfig
    from interfaces.relay.publisher import Publisher
    from interfaces.runtime.live.operator import LiveOperator
    from interfaces.station.page import Station
    from interfaces.stream.access import Access
    from interfaces.stream.audit import AuditLog
    from interfaces.stream.certificates import Certificate
    from interfaces.stream.join import JoinPages
    from robots.fleet import Fleet
    from robots.onboard.watchdog import LossPolicy
    from robots.robot import Robot
    from robots.rooms import Room
    from vrs.clock import Clock


def serve(
    ctx: typer.Context,
    host: Host = "127.0.0.1",
    port: Port = 8600,
    names: RobotNames = None,
    fleet_file: Annotated[
        Path | None,
        option("--robots FLEET.toml", "Many robots in one room, instead of --robot: docs/howto/fleet.md."),
    ] = None,
    tip: Tip = "",
    architecture: Architecture = ARCHITECTURE,
    room: RoomName = ROOM,
    camera: Annotated[
        float, option("RATE", "Pictures a second of a robot's camera, 1 to 30; 0 for no camera.")
    ] = 6.0,
    delay: Annotated[str, option("PROFILE", f"Emulated on the way to the robot: {PROFILES}")] = "none",
    loss: Annotated[str, option("P", "Emulated loss: a probability, or as vrs link takes it.")] = "0",
    service: Annotated[str, option("ORDER", "Emulated delivery: datagram or in-order.")] = "datagram",
    seed: Annotated[int, option("N", "Seed of the emulated link.", min=0)] = 0,
    offset: Annotated[
        str,
        option(
            "OFFSET",
            "How far the robot that this starts plays behind: adaptive, fixed (from the profile) or fixed:S.",
        ),
    ] = "adaptive",
    link_loss: Annotated[
        str | None,
        option(
            "POLICY",
            "What the robot does when nothing fresh comes: halt (it stops, and waits for a resume) or hold "
            "(it waits, and goes on). Unless given, hold where --delay is too slow for halt; else halt, or what "
            "the robot at --robot-at was started with.",
        ),
    ] = None,
    operator_loss: OperatorLossName = OPERATOR_LOSS,
    jobs: Annotated[Path, option("FILE.json", "Of a mobile robot, where the list of jobs is kept.")] = Path(
        "jobs.json"
    ),
    max_age: Annotated[
        float,
        option("S", "Of the robot that this starts: oldest message that counts under halt [s], 0.01 to 2."),
    ] = 0.5,
    body: BodyName = "",
    scene: SceneFile = None,
    robot_at: Annotated[
        str | None, option("HOST:PORT|URL", "Where vrs robot listens; without it one is started.")
    ] = None,
    robot_token_file: Annotated[Path | None, option("FILE", "Token file of that robot.")] = None,
    datagrams: Annotated[
        bool,
        option(
            "--datagrams/--no-datagrams", "What goes to that robot goes as datagrams, too, where it takes them."
        ),
    ] = True,
    token_file: TokenFile = None,
    reached_as: ReachedAs = None,
    tls: Tls = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    audit: Audit = None,
    class_: Annotated[
        bool,
        option(
            "--class",
            "Let a class in by short codes that are printed here, with QR codes; control is queued for.",
        ),
    ] = False,
    in_order: Annotated[
        bool,
        option(
            "--in-order",
            "Control is for who connects first; when it ends it's offered to the next, in the order of connection.",
        ),
    ] = False,
    val_port: Annotated[
        int | None,
        option(
            "N",
            "VAL-II's monitor on plain TCP, on loopback only, by a token; 0 for any port that's free.",
            min=0,
            max=65535,
        ),
    ] = None,
    val_files: Annotated[Path, option("DIR", "Where the LOAD and STORE of VAL-II find files.")] = Path(),
    record: Annotated[
        Path | None, option("FILE.mcap", "Record everything; vrs replay and compare read it.")
    ] = None,
    recordings: Annotated[Path, option("DIR", "Where the station records to; made when it's needed.")] = Path(
        "recordings"
    ),
    zenoh: Annotated[
        str, option("ENDPOINT", "Publish to relays, vrs view, by a router that's there: tcp/127.0.0.1:7447.")
    ] = "",
    site: Annotated[str, option("NAME", "What relays call this server; unless given, this machine's name.")] = "",
    zenoh_config: ZenohFile = None,
    until_eof: Annotated[bool, option("--until-eof", "End when standard input does.")] = False,
) -> None:
    """Serve the virtual robot to browsers and programs, and let a real one follow it, until Ctrl-C or SIGTERM."""
    from interfaces.link import Conditions, LinkConditions, delay_profile, loss_model
    from interfaces.messages.control import Role
    from interfaces.messages.jobs import OperatorLoss
    from interfaces.recording.live import RATE
    from interfaces.recording.mcap_file import Sink
    from interfaces.runs.twin_run import fixed_offset, spelled
    from interfaces.runtime.live.emulation import late_often, too_slow
    from interfaces.runtime.live.whereabouts import write_starts
    from interfaces.stream.access import OPEN, read_tokens
    from interfaces.stream.certificates import kept_certificate, peer
    from interfaces.teleop.architectures import architecture as makes
    from robots.bullet.grasping import fingered
    from robots.mobile.robot import find_room
    from robots.onboard.watchdog import LossPolicy
    from robots.things import read_scene

    fleet = None
    if fleet_file is not None:
        from robots.fleet import read_fleet

        left_out(ctx, "the fleet's file says it", ("robot", "tip", "room", "body"))
        left_out(ctx, "each robot of a fleet is started here", ("robot-at", "robot-token-file"))
        fleet = read_fleet(fleet_file)
    names = names or [USUAL]
    if tip and len(names) > 1:
        raise InvalidValueError("tip", tip, "left out of several robots: FILE#LINK says it of each")
    robots = [robot_of(name, tip) for name in names] if fleet is None else [one.robot for one in fleet.members]
    if len({robot.name for robot in robots}) < len(robots):
        raise InvalidValueError("robot", ", ".join(names), "each robot once")
    policy = None if link_loss is None else LossPolicy(one_of("link-loss", link_loss, LossPolicy))
    number_in("max-age", max_age, 0.01, 2.0, unit=" s")
    # Of several robots, those that have a body of that name get it.
    bodies = [body if robot.has_body(body) else "" for robot in robots]
    for robot, named in zip(robots, bodies, strict=True):
        robot.body(named if any(bodies) else body)
    if len(robots) > 1:
        left_out(ctx, "of several robots each is started here", ("robot-at", "robot-token-file"))
    if robot_at is not None:
        its_own = "offset", "max-age", "body", "operator-loss", "architecture", "scene"
        left_out(ctx, "the robot at --robot-at has its own", its_own)
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
    at = None if robot_at is None else _site_url(robot_at)
    allowed = asked_for(host, reached_as or ())
    token, theirs = None, None
    if robot_token_file is not None:
        token = read_tokens(robot_token_file).get(Role.SITE)
        if (copied := site_certificate(robot_token_file)).exists():
            theirs = kept_certificate(copied)
    if at is not None:
        peer(at, theirs)
    check_taken(robots, ctx)
    place = find_room(room)
    rooms = [place if fleet is None else fleet.room_of(k) for k in range(len(robots))]
    if any(robot.is_base for robot in robots):
        if jobs.exists() and not jobs.is_file():
            raise InvalidValueError("jobs", str(jobs), "a file, or one that can be made")
        makes(architecture)
    if camera:
        number_in("camera", camera, 1.0, 30.0, unit=" pictures a second, or 0 for no camera")
    one_of("operator-loss", operator_loss, OperatorLoss)
    behind = spelled(fixed_offset(offset, profile))
    if recordings.exists() and not recordings.is_dir():
        raise InvalidValueError("recordings", str(recordings), "a directory, or one that can be made")
    records = [None if record is None else _own(record, k, robot) for k, robot in enumerate(robots)]
    for path in records:
        if path is not None and path.is_file():
            raise InvalidValueError("record", str(path), "a file that isn't there yet: none is written over")
    if not val_files.is_dir():
        raise InvalidValueError("val-files", str(val_files), "a directory")
    for path in records:
        if path is not None:
            # Before a robot is started.
            Sink.create(path).close()
    if not zenoh:
        left_out(ctx, "nothing is published without --zenoh", ("site", "zenoh-config"))
    published = _published(zenoh, site, zenoh_config, reached_as)
    if advice:
        typer.echo(f"vrs: {advice}", err=True)
    given = {
        "offset": behind, "max-age": f"{max_age:g}", "architecture": architecture, "operator-loss": operator_loss,
    }  # fmt: skip
    if fleet is None:
        given["room"] = room
    if scene is not None:
        # Before a robot is started.
        for robot in robots:
            if not robot.is_base:
                fingered(robot)
        read_scene(scene)
        given["scene"] = str(scene)
    access, teacher = class_access(host, token_file) if class_ else (access_for(host, token_file, free=OPEN), None)
    certificate = certificate_for(host, token_file, reached_as or (), tls=tls, chain=tls_cert, key=tls_key)
    speaker = next((robot for robot in robots if speaks_val(robot)), None)
    shared = None
    if fleet is not None:
        shared = TemporaryDirectory(prefix="vrs-fleet-")
        given["whereabouts"] = str(Path(shared.name) / "whereabouts")
        write_starts(Path(given["whereabouts"]), [one.start for one in fleet.members])
    serving = []
    for k, (robot, named, path) in enumerate(zip(robots, bodies, records, strict=True)):
        kept = {option: value for option, value in given.items() if option not in untaken(robot)}
        kept["body"] = named
        if record is not None and not robot.is_base:
            kept["reports"] = f"{RATE:g}"
        options = [
            "--robot",
            robot.found_by,
            *(word for option, value in kept.items() for word in (f"--{option}", value)),
        ]
        eye = camera if robot.device(HeadCamera) else 0.0
        folder = f"/robots/{quote(robot.name, safe='')}" if k or fleet is not None else ""
        serving.append(_Serving(
            robot, link, seed + k, policy, at, token, theirs, datagrams, tuple(options), rooms[k],
            _own(jobs, k, robot), eye,
            val_port if robot is speaker else None, val_files if speaks_val(robot) else None, path, recordings,
            behind, architecture, folder, in_order,
        ))  # fmt: skip
    taught = _Class(reached_as[0] if reached_as else "", teacher) if class_ else None
    with audit_log(audit) as log, shared or contextlib.nullcontext():
        access.audit = log
        doors = access, host, port, allowed, taught, certificate, log
        run_loop(_serve(serving, *doors, fleet, published, until_eof=until_eof))


@dataclass(frozen=True, slots=True)
class _Published:
    """How a server is published to relays."""

    network: NetworkConfig
    site: str
    """Name of the server."""
    reached_as: str
    """By what others reach it, where that's not by its own address; empty where it is."""


def _published(zenoh: str, site: str, file: Path | None, reached_as: Sequence[str] | None) -> _Published | None:
    """How `--zenoh` asks for it; None where it doesn't."""
    import socket

    if not zenoh:
        return None
    from interfaces.relay.network import NetworkConfig

    return _Published(
        NetworkConfig((zenoh,), file=file), site or socket.gethostname(), reached_as[0] if reached_as else ""
    )


def _site_url(text: str) -> str:
    """Where a robot's site is, of `--robot-at`."""
    from interfaces.link.proxy import parse_address
    from interfaces.stream.certificates import server_url

    base, hashed, known = text.partition("#")
    if "://" not in base:
        base = str(parse_address("--robot-at", base))
    return server_url(f"{base}{hashed}{known}", "/site")


def _own(path: Path, k: int, robot: Robot) -> Path:
    """The file of the k-th robot: what was asked for is the first one's."""
    return path.with_stem(f"{path.stem}-{robot.name}") if k else path


@dataclass(frozen=True, slots=True, eq=False)
class _Serving:
    """What is served of a robot, and how it's reached."""

    robot: Robot
    conditions: LinkConditions
    seed: int
    link_loss: LossPolicy | None
    """None leaves it to the robot."""
    robot_at: str | None
    """`ws://HOST:PORT/site`; None: one is started."""
    robot_token: str | None = field(repr=False)
    robot_certificate: Certificate | None
    """What is shown to it."""
    datagrams: bool
    """Whether it's sent datagrams, too, if it takes them."""
    options: tuple[str, ...]
    """Of the robot that is started."""
    room: Room
    """Where a mobile robot drives."""
    jobs: Path
    """Where its list of jobs is kept."""
    camera: float
    """Pictures a second; 0 for none, nor voice and screen."""
    val_port: int | None
    """Of VAL-II's terminals over TCP; None for none."""
    val_files: Path | None
    """Of VAL-II; None where it has no places for the robot."""
    record: Path | None
    """Where everything is recorded to; None for nowhere."""
    recordings: Path
    """Where the station records to."""
    offset: str
    """Of the robot that is started: how far it plays behind."""
    architecture: str
    """Of a mobile robot that is started: what it does with the operator's path."""
    folder: str
    """Below which its page and sockets are; empty for the server's first robot."""
    in_order: bool
    """Whether operators get control in the order in which they connect."""

    def recording(self, path: Path, *, over: bool = True) -> LiveRecording:
        """What is recorded into a file, which may be written over."""
        from interfaces.messages.recording import OWN
        from interfaces.recording.live import LiveRecording

        return LiveRecording(
            path,
            offset=self.offset if self.robot_at is None else OWN,
            link_loss=OWN if self.link_loss is None else self.link_loss.value,
            failed=lambda problem: typer.echo(f"vrs: {problem}", err=True),
            over=over,
            robot=self.robot.name,
            found_by=self.robot.recorded_by,
            room=self.room,
            architecture=self.architecture if self.robot_at is None else OWN,
        )


@dataclass(frozen=True, slots=True)
class _Class:
    """How a class comes in."""

    reached_as: str
    """By what others reach the server, where that's not by its own address; empty where it is."""
    teacher: str | None = field(repr=False)
    """The token that was made for the teacher; None where a file has one."""

    def pages(self, access: Access, clock: Clock, at: Address, scheme: str) -> JoinPages:
        """What tells the codes, of a server at an address by http or https."""
        from interfaces.stream.join import JoinPages

        assert access.invitations is not None
        base = f"{scheme}://{self.reached_as or at}/"
        return JoinPages(access.invitations, access, clock, base)


async def _show_codes(pages: JoinPages) -> None:
    """Print the codes of a class whenever there are new ones."""
    import asyncio

    pictures = sys.stdout.isatty() and sys.stdout.encoding.lower() == "utf-8"
    while True:
        text, left = pages.shown(pictures=pictures)
        with contextlib.suppress(OSError):
            # Nobody waits for a terminal that takes no lines.
            await asyncio.to_thread(typer.echo, text, nl=False)
        await asyncio.sleep(left)


async def _serve(
    serving: Sequence[_Serving],
    access: Access,
    host: str,
    port: int,
    allowed: Hosts,
    taught: _Class | None,
    certificate: Certificate | None,
    log: AuditLog | None,
    fleet: Fleet | None,
    published: _Published | None,
    *,
    until_eof: bool,
) -> None:
    """Run until a signal comes. The page is there before the robots are."""
    import asyncio

    from interfaces.link.proxy import Address
    from interfaces.stream import sockets

    ended = asyncio.Event()
    end_on_signal(ended)
    robots = [contextlib.AsyncExitStack() for _ in serving]

    async def end_robots() -> None:
        await asyncio.gather(*(robot.aclose() for robot in robots))

    async with contextlib.AsyncExitStack() as last, contextlib.AsyncExitStack() as stack:
        last.push_async_callback(end_robots)
        listening = stack.enter_context(contextlib.closing(sockets.bind(host, port)))
        shown = Address(shown_host(host), listening.getsockname()[1])
        val_listening = None
        for one in serving:
            if one.val_port is not None:
                val_listening = stack.enter_context(contextlib.closing(sockets.bind("127.0.0.1", one.val_port)))
        starting = []
        for one, own in zip(serving, robots, strict=True):
            lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
            robot = asyncio.create_task(start_robot(own, one.robot_at, one.options, lost.set_result))
            stack.push_async_callback(abandon, robot)
            starting.append((robot, lost))
        await asyncio.to_thread(_load)

        from starlette.routing import BaseRoute, Mount

        from interfaces.messages.control import Role
        from interfaces.runtime.live.operator import share_world
        from interfaces.runtime.live.twins import ArmTwins
        from interfaces.station.fleet_page import FleetPage
        from interfaces.station.plans import Plans
        from interfaces.station.poses import Poses
        from interfaces.station.record import Recordings
        from interfaces.station.shelf import Shelf
        from interfaces.stream.access import Access, make_token
        from interfaces.stream.local import LocalClient
        from interfaces.stream.server import admit, application
        from interfaces.val2.pages import PageTerminalServer
        from interfaces.val2.rooms import HOST, served_room
        from interfaces.val2.tcp import TcpTerminalServer
        from robots.onboard.lease import LeaseState
        from vrs.clock import WallClock

        clock = WallClock()
        parts: list[AbstractAsyncContextManager[object]] = []
        operators = [_operator(one, access, clock, log) for one in serving]
        overview = starts = None
        if fleet is not None:
            pages = [f"{one.folder}/" for one in serving]
            starts = [one.start for one in fleet.members]
            shown_to = partial(admit, access, Role.VIEWER)
            overview = FleetPage(fleet.room, starts, operators, pages, clock, shown_to)
            parts.append(overview.running())
        if len(serving) > 1:
            await asyncio.to_thread(share_world, operators, starts, None if overview is None else overview.scene)
        page, ws, known = schemes(certificate)
        if published is not None:
            base = f"{page}://{published.reached_as or shown}"
            for one, operator in zip(serving, operators, strict=True):
                operator.devices = *operator.devices, _publisher(published, one, operator, f"{base}{one.folder}/")
        first: list[BaseRoute] = [] if overview is None else overview.routes
        others: list[BaseRoute] = []
        for one, operator, (_, lost) in zip(serving, operators, starting, strict=True):
            lost.add_done_callback(partial(say_lost, operator.lose))
            shelf, what = Shelf(one.recordings, one.robot), partial(one.recording, over=False)
            recordings = Recordings(operator.recording, operator.clock, shelf, access, what)
            routes = [*operator.routes, *recordings.routes]
            parts += operator.running(), recordings.running()
            if one.val_files is not None:
                assert isinstance(operator.twins, ArmTwins)
                client = LocalClient(operator.hub, operator.clock, "VAL-II terminals", operator.server.kick)
                room = served_room(client, operator.twins.operator, one.robot, one.val_files, software())
                operator.hub.alterer = room
                routes.append(PageTerminalServer(room, access).route)
                if one.val_port is not None:
                    val_room = room
            if not one.robot.is_base:
                journal = operator.twins.site.journal
                assert journal is not None
                routes += Plans(journal, access, operator.clock).routes
                routes += Poses(one.robot.arm, one.recordings, access, operator.clock).routes
            routes += _station(one, serving, taught=taught is not None).routes
            if one.folder:
                others.append(Mount(one.folder, routes=routes))
            else:
                first = routes
        joining = None if taught is None else taught.pages(access, clock, shown, page)
        app = application([*(joining.routes if joining else ()), *others, *first], allowed(shown.port), audit=log)
        for part in (sockets.serve(app, listening, tls=tls_of(certificate)), *parts):
            await stack.enter_async_context(part)
        keep_quiet()
        tidying = asyncio.create_task(
            collect_at_leisure(lambda: all(operator.hub.lease_state is LeaseState.FREE for operator in operators))
        )
        stack.callback(tidying.cancel)
        if overview is not None:
            below = f"programs: {ws}://{shown}/robots/NAME/ws{known}"
            typer.echo(f"vrs: operator station of {len(serving)} robots on {page}://{shown}/ ({below})")
        for one in serving if overview is None else ():
            at = f"{shown}{one.folder}"
            typer.echo(f"vrs: serving {one.robot.name} on {page}://{at}/view (programs: {ws}://{at}/ws{known})")
            typer.echo(f"vrs: operator station on {page}://{at}/")
        say_certificate(certificate)
        if val_listening is not None:
            val_token = None if access.needs_tokens else make_token()
            val_access = access if val_token is None else Access({Role.OPERATOR: val_token}, free=())
            await val_room.ready()
            val_door = TcpTerminalServer(val_room, val_access)
            await stack.enter_async_context(val_door.listening(val_listening))
            typer.echo(f"vrs: VAL-II on {HOST} port {val_listening.getsockname()[1]}")
            if val_token is not None:
                typer.echo(f"vrs: VAL-II asks each terminal for a token, the first line to send: {val_token}")
        if taught is not None and taught.teacher is not None:
            typer.echo(f"vrs: token of the teacher, an admin: {taught.teacher}")
        sys.stdout.flush()
        if joining is not None:
            showing = asyncio.create_task(_show_codes(joining))
            stack.callback(showing.cancel)
        if until_eof:
            end_with_input(ended)
        ending = asyncio.create_task(ended.wait())
        met = asyncio.gather(*(
            _meet(one, operator, robot, says=fleet is None)
            for one, operator, (robot, _) in zip(serving, operators, starting, strict=True)
        ))  # fmt: skip
        stack.push_async_callback(abandon, met)
        waiting: list[asyncio.Future[Any]] = [met, ending]
        await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        if met.done():
            met.result()
            if fleet is not None:
                say_robot(f"all {len(serving)} robots are there", serving[0].conditions, serving[0].link_loss)
        await ending


async def _meet(serving: _Serving, operator: LiveOperator, robot: asyncio.Task[str], *, says: bool) -> None:
    """Let an operator's site find its robot, once that's there, and perhaps say so."""
    operator.robot.url = await robot
    if says:
        say_robot(f"robot at {operator.robot.url}", serving.conditions, serving.link_loss)


def _operator(serving: _Serving, access: Access, clock: Clock, log: AuditLog | None) -> LiveOperator:
    """Make the operator's site."""
    from interfaces.jobs import JobFile
    from interfaces.media import CameraConfig
    from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
    from interfaces.val2.val_arm import lasts

    record = serving.record
    config = LiveOperatorConfig(
        serving.robot, "", serving.conditions, serving.robot_token, serving.robot_certificate, serving.seed,
        software(), serving.link_loss,
        recording=None if record is None else serving.recording(record),
        room=serving.room, jobs=JobFile(serving.jobs), arm=lasts,
        camera=CameraConfig(serving.camera, robot=serving.robot.found_by) if serving.camera else None,
        datagrams=serving.datagrams, say=lambda said: typer.echo(f"vrs: {said}", err=True),
        in_order=serving.in_order,
    )  # fmt: skip
    return LiveOperator(config, access, clock=clock, audit=log)


def _publisher(published: _Published, serving: _Serving, operator: LiveOperator, address: str) -> Publisher:
    """What publishes a robot to relays."""
    from interfaces.relay.network import Network, prefix
    from interfaces.relay.publisher import Publisher
    from interfaces.station.chain import described

    return Publisher(
        operator.hub, operator.clock, operator.scene, Network(published.network, operator.clock),
        key=prefix(published.site, serving.robot.name), page=described(serving.robot), address=address,
    )  # fmt: skip


def _station(serving: _Serving, all_served: Sequence[_Serving], *, taught: bool) -> Station:
    """Make a robot's page."""
    from interfaces.station.chain import described
    from interfaces.station.page import Station
    from interfaces.station.panels import Offer, panels_of

    robot = serving.robot
    offers = {Offer.RECORDINGS} | ({Offer.ARCS, Offer.JOBS} if robot.is_base else {Offer.POLYNOMIALS})
    offers |= {Offer.CAMERA} if serving.camera else set()
    offers |= {Offer.TERMINALS} if serving.val_files is not None else set()
    offers |= {Offer.QUEUE} if taught or serving.in_order else set()
    pages = [(one.robot.name, f"{one.folder}/", one is serving) for one in all_served]
    if all(one.folder for one in all_served):
        pages = [("all robots", "/", False), (robot.name, f"{serving.folder}/", True)]
    return Station(described(robot), panels_of(offers), pages if len(pages) > 1 else (), codes=taught)


def _load() -> None:
    """Import what takes long, while the robot's process does the same."""
    import interfaces.runtime.live.operator
    import interfaces.station.page  # noqa: F401
