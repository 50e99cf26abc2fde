"""Options that several commands have, and what those that listen share: who may come in, and what ends them."""

from __future__ import annotations

import contextlib
import gc
import os
import re
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeAlias

import typer

from interfaces.system import is_loopback, on_signal, written
from robots.robot import FOUND, USUAL, HeadCamera, described, load
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    import asyncio
    from concurrent.futures import Executor
    from contextlib import AsyncExitStack
    from ssl import SSLContext

    from rich.progress import Progress

    from interfaces.lab.finished import FinishedRows
    from interfaces.link import LinkConditions
    from interfaces.messages.control import Attached, Role
    from interfaces.stream.access import Access
    from interfaces.stream.audit import AuditLog
    from interfaces.stream.certificates import Certificate
    from interfaces.val2.values import Dialect
    from robots.onboard.watchdog import LossPolicy
    from robots.robot import Robot


def option(spelled: str, text: str, **more: Any) -> Any:
    """An option of a command, for the annotation of its parameter.

    Args:
        spelled: What it takes, as `S` or `NAME|FILE`, where the parameter's name is the flag's; else `--flag S`, or
            `--flag` alone where it takes nothing.
        text: What it's for, as help says it.
        **more: What else `typer.Option` takes, such as `min` and `max`.
    """
    *flags, metavar = spelled.split(" ") if " " in spelled or not spelled.startswith("--") else (spelled, None)
    return typer.Option(*flags, metavar=metavar, help=text, **more)


def argument(name: str, text: str) -> Any:
    """An argument of a command, for its annotation: what it's called, and what it's for."""
    return typer.Argument(metavar=name, help=text)


PROFILES = (
    "none, constant:S, domain, country, mon, tue, wed, thu, fri, lunar, gamma:MEAN,SD[,MIN], "
    "route:DISTANCE,NODES,ROUTING,LOAD,BANDWIDTH or trace:FILE.csv; thu@20 for a correlation time of 20 s."
)
"""What a delay may be."""

Delay: TypeAlias = Annotated[str, option("--delay PROFILE", PROFILES)]
Offset: TypeAlias = Annotated[
    str,
    option(
        "--offset OFFSET",
        "How far the real robot plays behind: adaptive, fixed (the profile's 95 % quantile) or fixed:S.",
    ),
]
Order: TypeAlias = Annotated[str, option("--service ORDER", "Delivery on the link: datagram or in-order.")]
Out: TypeAlias = Annotated[Path, option("--out DIR", "Where report.html, summary.json and run.mcap go.")]
DialectName: TypeAlias = Annotated[
    str,
    option(
        "--dialect val2|vplus",
        "Angles of files that don't say: val2's O, A, T (unless given), or vplus's yaw, pitch, roll.",
    ),
]
ProgramFiles: TypeAlias = Annotated[
    Path | None, option("--files DIR", "Where programs may read and write files; nowhere unless given.")
]
VAL_JOINTS = 6
"""Joints that VAL-II's places have."""
_ROBOTS: Final = "NAME|FILE|MODULE:NAME"
_ROBOTS_ARE: Final = (
    f"{', '.join(FOUND)}, one that a package adds, a description (URDF, xacro, MJCF), a mobile robot's numbers "
    "(TOML, or diff:wheelbase=0.4,wheel=0.1), or MODULE:NAME of your own"
)
RobotName: TypeAlias = Annotated[
    str,
    option(f"--robot {_ROBOTS}", f"{_ROBOTS_ARE}."),
]
RobotNames: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--robot",
        metavar=_ROBOTS,
        help=f"{_ROBOTS_ARE}; repeated, several in one world. Unless given, {USUAL}.",
    ),
]
RecordedRobot: TypeAlias = Annotated[
    str | None, option(f"--robot {_ROBOTS}", "The robot that it's of, unless its name or its file is known.")
]
Tip: TypeAlias = Annotated[
    str, option("--tip LINK", "Of a description: the link at the end of the arm; as FILE#LINK says it, too.")
]
BodyName: TypeAlias = Annotated[
    str, option("--body BODY", "What is real of the robot: bullet, mujoco, of an arm ideal, or another of its own.")
]
ARCHITECTURE, ROOM, OPERATOR_LOSS = "timeline", "empty", "stop"
"""Unless others are asked for."""
Architecture: TypeAlias = Annotated[
    str,
    option(
        "--architecture NAME",
        "Of a mobile robot, what it does with the operator's path: I, II, III, III-capped, extended, "
        "timeline, or MODULE:NAME of your own.",
    ),
]
RoomName: TypeAlias = Annotated[
    str,
    option("--room NAME|FILE", "Of a mobile robot or with --rsp, where it drives: a room's name, or a .room file."),
]
SceneFile: TypeAlias = Annotated[
    Path | None,
    option("--scene FILE", "Of an arm whose gripper has fingers: what is around it, TOML or JSON."),
]
OperatorLossName: TypeAlias = Annotated[
    str,
    option(
        "--operator-loss POLICY",
        "Of a mobile robot, what becomes of its goals and jobs when the operator is lost: stop or carry-on.",
    ),
]
Host: TypeAlias = Annotated[
    str, option("--host HOST", "Address to listen on; off loopback with --token-file only.")
]
Port: TypeAlias = Annotated[int, option("--port N", "0 for any that's free.", min=0, max=65535)]
Seed: TypeAlias = Annotated[int, option("--seed N", "Seed of everything random.", min=0)]
Workers: TypeAlias = Annotated[int, option("--workers N", "Processes at once; changes no figure.", min=1, max=64)]
On: TypeAlias = Annotated[
    str,
    option(
        "--on tcp://HOST:8786|MODULE:NAME",
        "Who does the work instead of this machine: a Dask scheduler, or an executor of your own.",
    ),
]
Resume: TypeAlias = Annotated[
    bool,
    option("--resume", "Go on with what an ended run of this command had finished, and keep that for the next."),
]
TokenFile: TypeAlias = Annotated[
    Path | None, option("--token-file FILE", "Tokens; needed off loopback. Made if it's missing.")
]
"""What lets other machines in: see `access_for`."""
Audit: TypeAlias = Annotated[
    Path | None,
    option("--audit FILE", "Append to it who has control and what is refused; vrs doctor --log checks it."),
]
Tls: TypeAlias = Annotated[
    bool | None,
    option(
        "--tls/--no-tls",
        "TLS, usual off loopback, by a certificate that is made at first. Without it where a proxy speaks it.",
    ),
]
TlsCert: TypeAlias = Annotated[
    Path | None, option("--tls-cert FILE", "The certificate to show, PEM; with --tls-key.")
]
TlsKey: TypeAlias = Annotated[Path | None, option("--tls-key FILE", "Its key, PEM.")]
"""What is encrypted: see `certificate_for`."""
Datagrams: TypeAlias = Annotated[
    bool | None,
    option(
        "--datagrams/--no-datagrams",
        "Take and send datagrams, too, by UDP on the same port; usual where TLS is spoken.",
    ),
]
ReachedAs: TypeAlias = Annotated[
    list[str] | None,
    option(
        "--reached-as HOST[:PORT]",
        "Another address that it's reached by, as behind a forwarded port or a proxy; may be repeated.",
    ),
]
"""What else requests may ask for: see `asked_for`."""
ZenohFile: TypeAlias = Annotated[
    Path | None,
    option(
        "--zenoh-config FILE", "More of Zenoh's own configuration, JSON5: certificates of tls/ endpoints, users."
    ),
]
Hosts: TypeAlias = Callable[[int], frozenset[str]]
"""What the Host of a request may be, by the port that a server listens on."""
_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9_.-]+)(:[0-9]{1,5})?", re.IGNORECASE)
"""What a request's Host is made of."""


def robot_of(name: str, tip: str = "") -> Robot:
    """The robot that `--robot` and `--tip` ask for.

    Raises:
        InvalidValueError: If there's none, or no such tip.
        FormatError: If its file can't be read.
    """
    if tip and not described(name):
        raise InvalidValueError("tip", tip, "left out: only a robot of a description has one")
    return load(f"{name}#{tip}" if tip else name)


def recorded_robot(name: str | None, tip: str = "") -> Robot | None:
    """The robot that `RecordedRobot` asks for, if it does; errors as of `robot_of`."""
    if name is None and tip:
        raise InvalidValueError("tip", tip, "left out without --robot")
    return None if name is None else robot_of(name, tip)


def speaks_val(robot: Robot) -> bool:
    """Whether VAL-II has places for a robot: an arm of six joints that turn."""
    return not robot.is_base and robot.arm.limits.dof == VAL_JOINTS and not robot.arm.prismatic


def val_robot(name: str, tip: str = "") -> Robot:
    """A robot for VAL-II.

    Raises:
        InvalidValueError: If there's none of that name, or VAL-II has no places for it.
    """
    robot = robot_of(name, tip)
    if not speaks_val(robot):
        raise InvalidValueError("robot", name, f"an arm of {VAL_JOINTS} joints that turn, as VAL-II has places for")
    return robot


def dialect_of(name: str) -> Dialect | None:
    """The dialect of a name; None for no name.

    Raises:
        InvalidValueError: If there's none of that name.
    """
    from interfaces.val2.source import DIALECTS

    if name.upper() not in (*DIALECTS, ""):
        raise InvalidValueError("dialect", name, "val2 or vplus")
    return DIALECTS.get(name.upper())


def program_files(directory: Path | None) -> Path | None:
    """The directory of programs' files.

    Raises:
        InvalidValueError: If it's none.
    """
    if directory is not None and not directory.is_dir():
        raise InvalidValueError("files", str(directory), "a directory")
    return directory


OF_ARMS: Final = ("offset", "lead", "friction", "pose", "scene")
"""Options that arms alone have, by their names without dashes."""
OF_VAL: Final = ("val-port", "val-files")
"""The same of robots that VAL-II has places for."""
OF_BASES: Final = ("architecture", "room", "jobs", "operator-loss", "whereabouts")
"""The same of mobile robots."""
OF_CAMERAS: Final = ("camera",)
"""The same of robots that pictures are made of."""
OF_SITES: Final = (
    "listen", "architecture", "offset", "link-loss", "timeout", "operator-loss", "max-age", "lead", "whereabouts",
    "friction", "pose", "reports", "reached-as", "audit", "tls", "tls-cert", "tls-key", "datagrams",
)  # fmt: skip
"""The same of robots that have a site, as thin clients haven't."""


def check_taken(robots: Sequence[Robot], ctx: typer.Context) -> None:
    """Check that no option was given that none of some robots has anything of.

    Args:
        robots: The robots.
        ctx: Of the command.

    Raises:
        InvalidValueError: If one was.
    """
    names = ", ".join(robot.name for robot in robots)
    said = f"{names} {'has' if len(robots) == 1 else 'have'} nothing of the kind"
    left_out(ctx, said, [option for option in untaken(robots[0]) if all(option in untaken(r) for r in robots)])


def untaken(robot: Robot) -> tuple[str, ...]:
    """Options that a robot has nothing of."""
    others = OF_ARMS if robot.is_base else OF_BASES
    val = () if speaks_val(robot) else OF_VAL
    cameras = () if robot.device(HeadCamera) else OF_CAMERAS
    return *others, *val, *cameras


def left_out(ctx: typer.Context, why: str, options: Iterable[str]) -> None:
    """Check that no option was given that would do nothing; what is the usual value counts as not given.

    Args:
        ctx: Of the command.
        why: They would do nothing.
        options: Their names, without dashes; the command needn't have them all.

    Raises:
        InvalidValueError: If one was.
    """
    known = {option.opts[0]: option for option in ctx.command.params}
    for name in options:
        option = known.get(f"--{name}")
        if option is None:
            continue
        value = ctx.params[str(option.name)]
        # One that may be repeated is () unless it's given.
        if value not in (option.get_default(ctx), ()):
            raise InvalidValueError(name, str(value), f"left out: {why}")


def bars(before: str, after: str = "{task.completed}/{task.total}") -> Progress:
    """Bars on standard error for what takes long, with the time left and the time so far: to be entered.

    Args:
        before: What stands before a bar, as a format of its `task`.
        after: What stands behind it.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    texts = TextColumn(before), BarColumn(bar_width=20), TextColumn(after)
    times = TimeRemainingColumn(), TextColumn("left,"), TimeElapsedColumn()
    # What takes minutes each time says little of its pace within rich's usual half minute.
    return Progress(*texts, *times, console=Console(stderr=True), redirect_stdout=False, speed_estimate_period=3600)


@contextlib.contextmanager
def sweeping(
    ctx: typer.Context, out: Path, workers: int, on: str, *, resume: bool
) -> Iterator[tuple[int | Executor, FinishedRows]]:
    """Who makes a sweep's runs meanwhile, and where finished ones are kept: `Workers`, `On` and `Resume`.

    Args:
        ctx: Of the command.
        out: Where the results go, an existing directory; once they are there, rows are kept for `--resume` alone.
        workers: Processes at once.
        on: Who does the work instead.
        resume: Whether rows that are there count.

    Raises:
        InvalidValueError: If both ask for workers, or there's nobody there.
        FormatError: If a module can't be imported, or the directory can't hold the results.
        WorkersLostError: If they're lost meanwhile.
        WorkerVersionError: If they have other versions than this program.
    """
    from interfaces.lab.executors import executor
    from interfaces.lab.finished import FinishedRows

    if on:
        left_out(ctx, "--on says who does the work", ["workers"])
    finished = FinishedRows(out / "finished", resume=resume)

    def say(said: str) -> None:
        typer.echo(f"vrs: {said}", err=True)

    try:
        with executor(on, say) if on else contextlib.nullcontext(workers) as who:
            yield who, finished
    except KeyboardInterrupt:
        say(f"{len(finished.machines)} runs are finished; the same command with --resume goes on with them")
        raise
    if finished.problem:
        say(finished.problem)
    if on or resume:
        with written(out, "can't hold the results"):
            finished.write_machines(out / "machines.csv")
    if not resume:
        finished.clear()


def tokens_for(host: str, token_file: Path | None) -> dict[Role, str] | None:
    """The tokens of a file, which is made if it's missing; None without one, where only this machine comes in.

    Raises:
        InvalidValueError: If other machines would come in without tokens.
        FormatError: If the file can't be used.
    """
    from interfaces.stream.access import make_tokens, read_tokens

    if token_file is None:
        if not is_loopback(host):
            raise InvalidValueError("host", host, "127.0.0.1 or localhost, unless a --token-file is given")
        return None
    return read_tokens(token_file) if token_file.exists() else make_tokens(token_file)


def class_access(host: str, token_file: Path | None) -> tuple[Access, str | None]:
    """Who may come in of a class: by codes, and by tokens; and the teacher's token where no file has one.

    Args:
        host: Where it listens.
        token_file: Read, or made if it's missing.

    Raises:
        InvalidValueError: If other machines would come in without tokens, or the file has no teacher's.
        FormatError: If the file can't be used.
    """
    from interfaces.messages.control import Role
    from interfaces.stream.access import Access, make_token
    from interfaces.stream.invitations import Invitations

    tokens = tokens_for(host, token_file)
    if tokens is not None and Role.ADMIN not in tokens:
        raise InvalidValueError("token-file", str(token_file), "a file with the token of an admin, who teaches")
    made = make_token() if tokens is None else None
    given = {Role.ADMIN: made} if made else tokens
    return Access(given, free=(), invitations=Invitations(0.0), people=token_file), made


def access_for(host: str, token_file: Path | None, *, free: Iterable[Role]) -> Access:
    """Who may come in: with a token file whoever has a token, without one whoever is on this machine.

    Args:
        host: Where it listens.
        token_file: Read, or made if it's missing.
        free: Roles that need no token on loopback without a token file.

    Raises:
        InvalidValueError: If other machines would come in without tokens.
        FormatError: If the file can't be used.
    """
    from interfaces.stream.access import Access

    tokens = tokens_for(host, token_file)
    return Access(free=free) if tokens is None else Access(tokens, free=(), people=token_file)


def certificate_for(
    host: str,
    token_file: Path | None,
    also: Iterable[str],
    *,
    tls: bool | None,
    chain: Path | None,
    key: Path | None,
) -> Certificate | None:
    """What a server shows by TLS: one of somebody's own, or one that is made beside its tokens; None without TLS.

    Args:
        host: Where it listens.
        token_file: Its tokens; without a file the user's state directory has the certificate.
        also: Other addresses that it's reached by.
        tls: Whether TLS is spoken; None: off loopback, and where there's a certificate.
        chain: A certificate.
        key: Its key.

    Raises:
        InvalidValueError: If one of the two files is missing, or they are given without TLS.
        FormatError: If the certificate can't be used or made.
    """
    if tls is None:
        tls = chain is not None or not is_loopback(host)
    if (chain is None) != (key is None) or (chain is not None and not tls):
        raise InvalidValueError("tls-cert", str(chain), "given together with --tls-key, and without --no-tls")
    if not tls:
        return None
    from interfaces.stream.certificates import given_certificate, own_certificate

    if chain is not None and key is not None:
        return given_certificate(chain, key)
    others = [found[1].strip("[]") for address in also if (found := _HOST.fullmatch(address))]
    return own_certificate(_beside(token_file, "tls.pem"), [*names_of(host), *others])


def site_certificate(token_file: Path) -> Path:
    """Where the certificate is that operators' sites show to a robot, as the robot makes it: beside its tokens."""
    return _beside(token_file, "site.pem")


def _beside(token_file: Path | None, name: str) -> Path:
    return state_directory() / name if token_file is None else token_file.with_name(f"{token_file.name}.{name}")


def state_directory() -> Path:
    """Where what this user's commands keep lies."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "vrs-teleop"


def say_certificate(certificate: Certificate | None) -> None:
    """Say by what a server is known."""
    if certificate is not None:
        new = "made just now: tell its clients, " if certificate.renewed else ""
        typer.echo(f"vrs: certificate {certificate.chain}, {new}SHA-256 {certificate.shown}")


def tls_of(certificate: Certificate | None, clients: Path | None = None) -> Callable[[], SSLContext] | None:
    """What a server's handshakes are done by; another certificate in its files is said on standard error.

    Args:
        certificate: The server's; None without TLS.
        clients: Certificates of those who may come in at all; None for everybody.
    """
    if certificate is None:
        return None
    from interfaces.stream.certificates import ServerTls

    return ServerTls(certificate, clients, say=lambda said: typer.echo(f"vrs: {said}", err=True)).context


def schemes(certificate: Certificate | None) -> tuple[str, str, str]:
    """What addresses of pages and of programs begin with, and what those of programs end with."""
    return ("http", "ws", "") if certificate is None else ("https", "wss", f"#sha256={certificate.fingerprint}")


@contextlib.contextmanager
def audit_log(path: Path | None) -> Iterator[AuditLog | None]:
    """The audit log of a file meanwhile; None without one.

    Raises:
        FormatError: If it can't be written, or isn't one.
    """
    if path is None:
        yield None
        return
    from interfaces.stream.audit import AuditLog

    with contextlib.closing(AuditLog(path, failed=lambda said: typer.echo(f"vrs: {said}", err=True))) as log:
        yield log


def _is_any(host: str) -> bool:
    """Whether a host stands for all addresses of this machine."""
    return host in {"0.0.0.0", "::"}  # noqa: S104 - compared, not listened on


def shown_host(host: str) -> str:
    """By what others of its network reach a server that listens on a host."""
    if not _is_any(host):
        return host
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # Nothing is sent: that's what the system would send from.
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return socket.gethostname()
        return str(probe.getsockname()[0])


def names_of(host: str) -> list[str]:
    """Names by which a server is rightly addressed that listens on a host."""
    if is_loopback(host):
        return ["127.0.0.1", "localhost", "::1"]
    if not _is_any(host):
        return [host]
    own = socket.gethostname()
    try:
        found = {str(info[4][0]) for info in socket.getaddrinfo(own, None)}
    except OSError:
        found = set()
    return sorted({"127.0.0.1", "localhost", "::1", own, shown_host(host), *found})


def asked_for(host: str, also: Iterable[str]) -> Hosts:
    """What the Host of a request may be, by the port that a server listens on.

    Args:
        host: Where it listens.
        also: Other addresses that it's reached by, just as a browser's address line has them.

    Raises:
        InvalidValueError: If one of those is no address.
    """
    others = [address.lower() for address in also]
    for address in others:
        if not _HOST.fullmatch(address):
            raise InvalidValueError("reached-as", address, "HOST or HOST:PORT, as a browser's address line has it")

    def allowed(port: int) -> frozenset[str]:
        from interfaces.stream.access import hosts

        return hosts(names_of(host), port).union(others)

    return allowed


def end_with_input(ended: asyncio.Event) -> None:
    """Set an event of the running loop when standard input ends; none, or a file, has ended."""
    import asyncio

    if sys.stdin is None:
        ended.set()
        return
    loop, source = asyncio.get_running_loop(), sys.stdin.fileno()

    def look() -> None:
        if not os.read(source, 4096):
            loop.remove_reader(source)
            ended.set()

    try:
        loop.add_reader(source, look)
    except PermissionError:
        # Files and /dev/null can't be waited for: there's always something to read, or the end.
        ended.set()
    except NotImplementedError:
        # Loops of some systems wait for sockets alone.
        def wait() -> None:
            while os.read(source, 4096):
                pass
            loop.call_soon_threadsafe(ended.set)

        threading.Thread(target=wait, daemon=True).start()


def end_on_signal(ended: asyncio.Event) -> None:
    """Let Ctrl-C and SIGTERM set an event of the running loop, and do nothing else."""
    import asyncio

    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        on_signal(loop, number, ended.set)


ROUNDS = 2000
"""The collector looks at old objects after so many passes over young ones, each after some 7,000 new objects."""
LEISURE = 10.0
"""Time between two looks at whether old garbage may be collected [s]."""


def keep_quiet() -> None:
    """Let the garbage collector pass over all that is old: its long passes would stop a robot for 20 to 500 ms."""
    gc.collect()
    gc.freeze()
    young, middle, _ = gc.get_threshold()
    gc.set_threshold(young, middle, ROUNDS)


async def collect_at_leisure(free: Callable[[], bool]) -> None:
    """Collect old garbage whenever it's convenient, until it's cancelled.

    Args:
        free: Whether a moment's pause matters to nobody.
    """
    import asyncio

    while True:
        await asyncio.sleep(LEISURE)
        if gc.get_count()[2] and free():
            gc.collect()


async def start_robot(
    stack: AsyncExitStack, robot_at: str | None, options: Sequence[str], ended: Callable[[str], None]
) -> str:
    """Where the robot is; one is started if there's none, and if that ends it's told why."""
    from interfaces.runtime.live.process import local_robot

    return await stack.enter_async_context(local_robot(options, ended)) if robot_at is None else robot_at


def say_lost(lose: Callable[[str], None], lost: asyncio.Future[str]) -> None:
    """Say once that the robot is lost for good, here and to whoever commands it."""
    if not lost.cancelled():
        typer.echo(f"vrs: {lost.result()}", err=True)
        lose(lost.result())


async def abandon(task: asyncio.Future[Any]) -> None:
    """Let a task end that nobody waits for any more."""
    import asyncio

    task.cancel()
    await asyncio.wait([task])
    # Of some that are gathered, being cancelled is an exception, which asyncio logs unless somebody looks.
    if not task.cancelled():
        task.exception()


def say_robot(where: str, conditions: LinkConditions, link_loss: LossPolicy | None) -> None:
    """Say on standard error where robots are, what is emulated on the way there, and what they're asked to do."""
    asked = "" if link_loss is None else f", link loss: {link_loss}"
    typer.echo(f"vrs: {where}, emulated delay {conditions.forward.delay.name}{asked}", err=True)


def saying_policy() -> Callable[[Attached], None]:
    """What says on standard error what a robot does when the link is lost, for each operator where that's news."""
    said = ""

    def say(attached: Attached) -> None:
        nonlocal said
        if attached.link_loss != said:
            said = attached.link_loss
            typer.echo(f"vrs: operator's site connected, link loss: {said}", err=True)

    return say
