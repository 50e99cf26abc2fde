"""Other machines for a sweep: a Dask scheduler's workers, or any executor of `concurrent.futures`.

Versions are compared before anything is run, and again by each worker before its first call: rows of two versions
would be one table of two programs.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from contextlib import contextmanager
from typing import Any, Final

from interfaces.lab.finished import PACKAGES, SOURCES, KeptRow, machine, versions
from interfaces.system import is_own, own
from robots.robot import module_of
from vrs.errors import InvalidValueError, VrsError

SCHEDULERS: Final = ("tcp://", "tls://", "ws://", "wss://")
"""How a Dask scheduler's address begins."""
TIMEOUT: Final = 8.0
"""A scheduler answers within this time [s]."""
FIRST_WORKER: Final = 30.0
"""So long a scheduler is waited for that has no worker yet, as one that was started just before [s]."""
CLOSING: Final = 2.0
"""So long it's waited for connections to end [s]."""
RETRIES: Final = 2
"""Dask makes a call again so often that failed."""

_ONE: Final = threading.Lock()
"""A process makes one call at a time, whatever threads its executor has: physics and plots share state."""


class WorkersLostError(VrsError):
    """Whoever makes a sweep's calls is gone."""

    def __init__(self, what: str) -> None:
        self.what = what
        super().__init__(f"{what}; the same command with --resume goes on with what is finished")


class WorkerVersionError(VrsError):
    """A worker has another version of what results hang on than the one who asks, or none."""

    def __init__(self, worker: str, there: Mapping[str, str], here: Mapping[str, str]) -> None:
        self.worker, self.there, self.here = worker, dict(there), dict(here)
        if SOURCES not in there:
            super().__init__(f"{worker} hasn't got vrs-teleop: a sweep's workers have what its beginner has")
            return
        other = [
            f"{name} {there.get(name, 'not at all')} (here {here.get(name, 'not at all')})"
            for name in sorted(there.keys() | here.keys())
            if there.get(name) != here.get(name)
        ]
        super().__init__(f"{worker} has {', '.join(other)}: a sweep's workers have what its beginner has")


def make(expected: Mapping[str, str], work: Callable[..., Any], given: tuple[Any, ...]) -> KeptRow:
    """Make a call on a worker.

    Args:
        expected: The versions of whoever asks; empty where they are the same.
        work: A function of a module.
        given: Its arguments.

    Raises:
        WorkerVersionError: If this worker has others.
    """
    if expected and expected != versions():
        import socket

        raise WorkerVersionError(f"the worker on {socket.gethostname()}", versions(), expected)
    with _ONE:
        return KeptRow(work(*given), machine())


@contextmanager
def executor(on: str, say: Callable[[str], None] = lambda _: None) -> Iterator[Executor]:
    """An executor on other machines meanwhile; what it still has to do in the end is called off.

    Args:
        on: A Dask scheduler's address, `tcp://HOST:8786`, or `MODULE:NAME` of an executor or of a callable that
            returns one.
        say: Told where the scheduler's pages are.

    Raises:
        InvalidValueError: If it's neither, there's no scheduler, it has no workers, or Dask isn't installed.
        FormatError: If the module can't be imported.
        WorkerVersionError: If scheduler or workers have other versions than this program.
        WorkersLostError: If they're lost meanwhile.
    """
    if not on.startswith(SCHEDULERS) and not is_own(on):
        raise InvalidValueError("on", on, "a scheduler's address as tcp://HOST:8786, or MODULE:NAME of an executor")
    try:
        with _dask(on, say) if on.startswith(SCHEDULERS) else _own(on) as made:
            yield made
    except CancelledError:
        raise WorkersLostError(f"{on} is gone, or has called off what it was asked for") from None
    except BrokenExecutor as error:
        raise WorkersLostError(f"{on} lost a worker: {error}") from None
    except ModuleNotFoundError as error:
        if error.name not in PACKAGES:
            raise
        raise WorkerVersionError(f"a worker of {on}", {}, versions()) from None


@contextmanager
def _own(on: str) -> Iterator[Executor]:
    module, name = module_of(on, "an executor")
    found = getattr(module, name, None)
    made = found if isinstance(found, Executor) else own("executor", on, ())()
    if not isinstance(made, Executor):
        raise InvalidValueError(f"on {on}", type(made).__name__, "an executor of concurrent.futures")
    try:
        yield made
    finally:
        made.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _dask(address: str, say: Callable[[str], None]) -> Iterator[Executor]:
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        allowed = "left out, or with Dask installed: pip install 'vrs-teleop[cluster]'"
        raise InvalidValueError("on", address, allowed) from None
    # What it has to say of a lost scheduler is a page long; who uses this is told in a line.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    for name in ("distributed.client", "distributed.comm", "distributed.core", "distributed.utils"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client: Any = Client(address, timeout=TIMEOUT, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        allowed = f"the address of a Dask scheduler that answers within {TIMEOUT:g} s"
        raise InvalidValueError("on", address, allowed, f" ({_first_line(error)})") from None
    try:
        _compare(client, address)
        there = client.scheduler_info(n_workers=-1)["workers"].values()
        say(f"{len(there)} workers at {address}, dashboard {client.dashboard_link}")
        if any(worker["nthreads"] > 1 for worker in there):
            say("a worker makes one run at a time, whatever threads it has: dask worker --nthreads 1")
        with client.get_executor(pure=False, retries=RETRIES) as made:
            try:
                yield made
            finally:
                made.shutdown(wait=False)
    except KilledWorker as error:
        raise WorkersLostError(f"{address} lost worker after worker by one run ({_first_line(error)})") from None
    finally:
        client.close(timeout=CLOSING)


def _compare(client: Any, address: str) -> None:
    """Raise if the scheduler, or a worker that it has, has other versions than this program, or there's none."""

    # Defined here, it crosses by value: who hasn't got this package can say so.
    def look() -> dict[str, str]:
        from importlib.metadata import version

        dask = {"distributed": version("distributed")}
        try:
            from interfaces.lab import finished
        except ImportError:
            return dask
        return finished.versions() | dask

    here = look()
    try:
        client.wait_for_workers(1, timeout=FIRST_WORKER)
    except TimeoutError:
        raise InvalidValueError("on", address, f"a scheduler that has a worker within {FIRST_WORKER:g} s") from None
    there = {f"the scheduler at {address}": client.run_on_scheduler(look)}
    there |= {f"the worker at {worker}": found for worker, found in client.run(look).items()}
    for who, found in there.items():
        if found != here:
            raise WorkerVersionError(who, found, here)


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]
