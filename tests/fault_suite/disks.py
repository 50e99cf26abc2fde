"""Disks that are full or slow, at every file that the house writes."""

from __future__ import annotations

import asyncio
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from unittest.mock import patch

import numpy as np

from benchmarks.results import Result
from interfaces.jobs import JobFile
from interfaces.messages.control import Role
from interfaces.messages.jobs import JobList, Progress, WaitJob
from interfaces.recording import open_recording
from interfaces.recording.mcap_file import Sink
from interfaces.runtime.live.operator import LiveOperator
from interfaces.stream.access import add_person, make_tokens
from interfaces.stream.audit import AuditLog, check_audit
from interfaces.stream.certificates import own_certificate
from interfaces.system import write_whole, written
from interfaces.val2.errors import ValError
from interfaces.val2.monitor.files import Files
from tests.fault_suite.effort import Effort, Tries, most
from tests.interfaces.live_rig import NOMINAL, READY, robot_here, until
from tests.interfaces.recording import test_live
from tests.interfaces.recording.disks import Filling, Hanging
from tests.interfaces.recording.test_recorder import failing_at_each_write
from vrs import JointTarget, MotionCommand
from vrs.errors import FormatError

TOLD = 1.0
"""A recording that fails is told within that [s]."""


def recording_cut_short(effort: Effort) -> tuple[Result, ...]:
    """Each write of a recording fails in turn

    A disk that's full, broken, or takes nothing without saying so: at each write of a recording in turn it takes
    half of what it's given, and then nothing. That's to be a typed error, and what was written before it readable.
    """
    del effort
    with tempfile.TemporaryDirectory() as folder:
        tried = [
            failing_at_each_write(Path(folder) / "run.mcap", how) for how in ("full", "broken", "zero", "none")
        ]
    return (most("not told, or not readable up to there", 0, 0, tries=sum(tried)),)


def recording_full(effort: Effort) -> tuple[Result, ...]:
    """The disk fills up while a live site is recorded

    Both sites live, and a disk that has room for up to 20 kB more. From the first write that it cuts short it's
    measured until `/health` says it; then the arm is commanded.
    """
    tries: Tries[tuple[float, bool, bool]] = Tries(effort, 0, 20_000)

    async def session(path: Path) -> None:
        async with robot_here() as (_, url):
            for room in tries:
                disk = Filling(path, 10**9)
                with patch.object(
                    Sink, "create", classmethod(lambda cls, path, disk=disk, **_: cls(disk, str(path)))
                ):
                    async with test_live.recorded(url, path, []) as live:
                        disk.room = round(room)
                        await until(lambda disk=disk: disk.full)
                        await until(lambda live=live: live.health()["recording"]["problem"])
                        told = time.monotonic() - disk.full
                        stands = not await _follows(live, len(tries.found))
                with open_recording(path) as recording:
                    lost = not recording.damage.cut or bool(recording.damage.blocks)
                tries.take((told, stands, lost), sound=told <= TOLD and not stands)

    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(session(Path(folder) / "run.mcap"))
    told, stands, lost = zip(*tries.found, strict=True)
    return (
        most('"recording failed" after', max(told), TOLD, "s", tries=tries.count, note=tries.note),
        most("the motion doesn't go on", sum(stands), 0, tries=tries.count),
        most("its beginning isn't readable", sum(lost), 0, tries=tries.count),
    )


def recording_slow(effort: Effort) -> tuple[Result, ...]:
    """The disk hangs while a live site is recorded

    As above with a disk that takes nothing for a while, and then goes on.
    """
    tries: Tries[tuple[float, bool]] = Tries(effort)

    async def session() -> None:
        async with robot_here() as (_, url):
            for _ in tries:
                disk = Hanging(np.inf)
                with patch.object(
                    Sink, "create", classmethod(lambda cls, path, disk=disk, **_: cls(disk, str(path)))
                ):
                    async with test_live.recorded(url, Path("nowhere.mcap"), []) as live:
                        assert not live.health()["recording"]["problem"]
                        disk.after = disk.calls
                        await until(disk.hangs.is_set)
                        hung = time.monotonic()
                        await until(lambda live=live: live.health()["recording"]["problem"])
                        told = time.monotonic() - hung
                        stands = not await _follows(live, len(tries.found))
                        disk.free.set()
                        await until(lambda live=live: not live.health()["recording"]["problem"])
                tries.take((told, stands), sound=told <= TOLD and not stands)

    asyncio.run(session())
    told, stands = zip(*tries.found, strict=True)
    return (
        most('"recording stalls" after', max(told), TOLD, "s", tries=tries.count, note=tries.note),
        most("the motion doesn't go on", sum(stands), 0, tries=tries.count),
    )


async def _follows(live: LiveOperator, k: int) -> bool:
    """Command the arm; whether the real one does it."""
    goal = JointTarget(NOMINAL if k % 2 else READY)
    receipt = live.operator.robot.execute(MotionCommand(goal), now=live.clock.now())
    await until(lambda: live.operator.report.q_at > receipt.execute_at + 0.2)
    return bool(receipt.stands) and not live.operator.halted


@contextmanager
def full_from(size: int) -> Iterator[None]:
    """No file of this process may grow beyond so many bytes: a write is cut short there, and the next one fails."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _writers(folder: Path) -> dict[str, tuple[Path, Callable[[int], object]]]:
    """What writes files beside recordings: of each the file, and what writes its k-th version."""
    jobs = JobFile(folder / "jobs.json")
    tokens, files = folder / "tokens", Files(folder)

    def some(k: int) -> JobList:
        return JobList(tuple(WaitJob(number + 1, 1.0) for number in range(1 + k % 20)))

    def poses(k: int) -> None:
        with written(folder / "poses.json"):
            write_whole(folder / "poses.json", b"[" + b"0," * k + b"0]")

    return {
        "jobs": (jobs.path, lambda k: jobs.save(some(k), Progress.of(some(k)))),
        "poses": (folder / "poses.json", poses),
        "people's tokens": (tokens, lambda k: add_person(tokens, f"ada{k}", Role.VIEWER, "2090-01-31")),
        "programs": (folder / "kept.v2", lambda k: files.write(files.path("kept.v2"), "x = 1\n" * (1 + k))),
        "a first token file": (folder / "fresh", lambda _: make_tokens(folder / "fresh")),
        "a first certificate": (folder / "own.pem", lambda _: own_certificate(folder / "own.pem", ["localhost"])),
    }


def files_full(effort: Effort) -> tuple[Result, ...]:
    """The disk is full for jobs, poses, tokens, certificates and programs

    No file may grow beyond a random size, from nothing to a little less than what is to be written. That's to be a
    typed error, and what was there before is to be there, to the bit; where nothing was there, nothing is to be.
    """
    random, untyped, torn, tries = Random(effort.seed), [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        for name, (path, write) in _writers(Path(folder)).items():
            write(0)
            whole = path.stat().st_size
            first = name.startswith("a first")
            for k in range(1, effort.tries + 1):
                if first:
                    path.unlink(missing_ok=True)
                before = None if first else path.read_bytes()
                with full_from(random.randrange(whole)):
                    try:
                        write(k)
                    except (FormatError, ValError):
                        pass
                    except OSError as error:
                        untyped.append(f"{name}: {error}")
                    else:
                        untyped.append(f"{name}: nothing")
                tries += 1
                if (path.read_bytes() if path.exists() else None) != before:
                    torn.append(name)
    return (
        most("not a typed error", len(untyped), 0, tries=tries, note="; ".join(sorted(set(untyped)))),
        most("what was there before is lost or changed", len(torn), 0, tries=tries,
             note="; ".join(sorted(set(torn)))),
    )  # fmt: skip


def audit_full(effort: Effort) -> tuple[Result, ...]:
    """The disk is full for the audit log

    The log may grow by a random number of bytes, less than a line, and again without limit a little later. It's to
    be said once, lines that are lost are to be counted in the file, and the chain is to be whole.
    """
    random, broken, unsaid, uncounted = Random(effort.seed), 0, 0, 0
    for k in range(effort.tries):
        with tempfile.TemporaryDirectory() as folder:
            path, said = Path(folder) / "audit.jsonl", list[str]()
            log = AuditLog(path, failed=said.append)
            log.note("control", who="before")
            _wait(lambda path=path: path.read_bytes().count(b"\n") == 2)
            with full_from(path.stat().st_size + random.randrange(100)):
                lost = 1 + k % 5
                for _ in range(lost):
                    log.note("control", who="lost")
                _wait(lambda log=log, lost=lost: log.lost == lost)
            log.note("control", who="after")
            log.close()
            broken += bool(check_audit(path).problem)
            unsaid += len(said) != 2
            uncounted += f'"lost":{lost},'.encode() not in path.read_bytes()
    return (
        most("the chain is broken", broken, 0, tries=effort.tries),
        most("not said once, and once that it's over", unsaid, 0, tries=effort.tries),
        most("lines that are lost aren't counted", uncounted, 0, tries=effort.tries),
    )


def _wait(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 30.0
    while not holds():
        if time.monotonic() > end:
            raise TimeoutError
        time.sleep(0.002)
