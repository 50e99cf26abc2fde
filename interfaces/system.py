"""What the machine provides: files, processes and their priority, our version, other people's modules by name.

What only some systems have is asked for here alone, and done without where it isn't there.
"""

from __future__ import annotations

import contextlib
import errno
import inspect
import ipaddress
import os
import secrets
import signal
import sys
from collections.abc import Callable, Coroutine, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from robots.robot import module_of
from vrs.errors import FormatError, InvalidValueError

if TYPE_CHECKING:
    import asyncio

T = TypeVar("T")
PLAIN_READ: Final = (
    os.O_RDONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
)
"""Flags to open a file for reading that may turn out to be none: nothing waits for its other end."""


def run_loop(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine to its end in a loop of its own: uvloop's, where that is installed."""
    import asyncio

    try:
        import uvloop
    except ImportError:
        return asyncio.run(main)
    return uvloop.run(main)


def on_signal(loop: asyncio.AbstractEventLoop, number: int, act: Callable[[], object]) -> None:
    """Let a signal do something in a running loop, and nothing else."""
    try:
        loop.add_signal_handler(number, act)
    except NotImplementedError:
        signal.signal(number, lambda *_: loop.call_soon_threadsafe(act))


def open_files(wanted: int) -> int:
    """Ask that this process may open so many files; returns how many it may."""
    try:
        import resource
    except ImportError:
        return wanted
    unlimited, kind = resource.RLIM_INFINITY, resource.RLIMIT_NOFILE
    soft, hard = (wanted if most == unlimited else most for most in resource.getrlimit(kind))
    if soft < min(wanted, hard):
        resource.setrlimit(kind, (min(wanted, hard), resource.getrlimit(kind)[1]))
    return max(soft, min(wanted, hard))


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def read_within(path: Path, most: int) -> bytes:
    """The bytes of a file.

    Args:
        path: Where it is.
        most: How many it may have.

    Raises:
        FormatError: If it can't be read, or is longer.
    """
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)
    except OSError as error:
        raise FormatError(str(path), f"can't be read: {error.strerror}") from None
    if len(data) > most:
        raise FormatError(str(path), f"is longer than the {most} bytes allowed")
    return data


@contextlib.contextmanager
def written(where: Path, problem: str = "can't be written") -> Iterator[None]:
    """Let what's written meanwhile fail with one clear error.

    Raises:
        FormatError: If the disk doesn't take it: where it was to go, the problem, and what the system says.
    """
    try:
        yield
    except OSError as error:
        raise FormatError(str(where), f"{problem}: {error.strerror or error}") from None


def write_whole(path: Path, data: bytes, *, mode: int = 0o666) -> None:
    """Write a file, whole or not at all: whoever reads it finds what was there before, or what is there now.

    Args:
        path: Where to.
        data: What.
        mode: Who may do what with it, less what this process takes from everybody (its umask).

    Raises:
        OSError: If it can't be written.
    """
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        with open(draft, "wb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            draft.unlink()


def software() -> str:
    """Name and version of this program."""
    from importlib import metadata

    return f"vrs-teleop {metadata.version('vrs-teleop')}"


def module_process(module: str, *arguments: str) -> tuple[list[str], dict[str, str]]:
    """Command line and environment of a process that runs a module, and imports what this one would.

    Args:
        module: Its dotted name.
        arguments: What it's given.
    """
    path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    return [sys.executable, "-P", "-m", module, *arguments], os.environ | {"PYTHONPATH": path}


def is_own(text: str) -> bool:
    """Whether a name is that of somebody's own part: `module:name`, both of them words of Python with dots."""
    module, colon, name = text.partition(":")
    return bool(colon and module and name.isidentifier() and all(part for part in module.split(".")))


def own(kind: str, text: str, given: tuple[str, ...]) -> Callable[..., Any]:
    """Import somebody's own part.

    Args:
        kind: What it's to be, for the messages: `architecture`, `operator`.
        text: `module:name`; the module may lie in the working directory.
        given: What it's to be called with, by order.

    Returns:
        What the name stands for, a callable.

    Raises:
        FormatError: If the module can't be imported; whatever it raised is in the message.
        InvalidValueError: If it hasn't got that name, or it can't be called so.
    """
    module, name = module_of(text, kind)
    where = module.__name__
    made = getattr(module, name, None)
    if not callable(made):
        names = ", ".join(sorted(_callables(module.__dict__, where))) or "none"
        raise InvalidValueError(f"{kind} in {where}", name, f"a function or class there ({names})")
    if not _takes(made, len(given)):
        raise InvalidValueError(f"{kind} in {where}", name, f"a function or class that takes ({', '.join(given)})")
    found: Callable[..., Any] = made
    return found


def checked(kind: str, text: str, made: object, parts: tuple[str, ...]) -> None:
    """See to it that what a stranger's function made has the parts that it needs.

    Raises:
        InvalidValueError: If one is missing.
    """
    missing = [part for part in parts if not hasattr(made, part)]
    if missing:
        raise InvalidValueError(f"{kind} {text}", type(made).__name__, f"something with {', '.join(parts)}")


def _takes(made: Callable[..., Any], count: int) -> bool:
    """Whether it can be called with so many arguments; whoever doesn't tell is believed."""
    try:
        inspect.signature(made).bind(*[None] * count)
    except TypeError:
        return False
    except ValueError:
        return True
    return True


def _callables(namespace: dict[str, Any], where: str) -> list[str]:
    return [
        name
        for name, value in namespace.items()
        if callable(value) and not name.startswith("_") and getattr(value, "__module__", "") == where
    ]


def lock(file: int) -> bool:
    """Keep a file to oneself as long as it's open; whether nobody else does. Not every system can tell.

    Args:
        file: Its descriptor.
    """
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        # Some network's file systems have no locks.
        return error.errno not in {errno.EACCES, errno.EAGAIN}
    return True


NICE = -10
"""Niceness to ask for where there's no real-time priority."""
OWN_TIME = 0.5
"""Processor time without a rest [s] after which it gives up its real-time priority, to leave the machine usable."""


def hasten(priority: int) -> bool:
    """Get ahead of other processes, as far as that's allowed; returns whether with real-time priority.

    Niceness alone doesn't do: with one task a session group, Linux weighs it inside the group only.

    Args:
        priority: Among real-time processes, from 1; the higher one goes first.
    """
    try:
        import resource

        signal.signal(signal.SIGXCPU, lambda *_: os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0)))
        _, hard = resource.getrlimit(resource.RLIMIT_RTTIME)
        resource.setrlimit(resource.RLIMIT_RTTIME, (round(OWN_TIME * 1e6), hard))
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except (OSError, ValueError, ImportError, AttributeError):
        be_nice(NICE)
        with suppress(OSError):
            Path("/proc/self/autogroup").write_text(str(NICE), encoding="ascii")
        return False
    return True


def be_nice(more: int) -> None:
    """Let other processes go first, by so much; or before them, where it's negative; as far as that's allowed."""
    with suppress(OSError, AttributeError):
        os.nice(more)
