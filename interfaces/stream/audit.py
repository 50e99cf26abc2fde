"""The audit log: who had control when, and what was refused, one JSON line each in a chain of hashes.

A line's hash is that of the line's text and of the hash before it, so that no line is changed, left out or put in
without breaking the chain. FILE.head beside it has the number and the hash of the last line, by which lines are
missed that were cut off at the end. Who may write both files can write another chain: keep the last hash elsewhere.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import queue
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple, TypeAlias

from interfaces.stream.limits import Bucket
from interfaces.system import lock
from vrs.clock import WallClock, seconds_since_1970
from vrs.errors import FormatError

Fact: TypeAlias = str | int | float | bool | None
FIRST: Final = "0" * 64
"""The hash before the first line."""
LINES, LINES_BURST = 5.0, 200.0
"""Refusals a second that get a line, for long and at once; those beyond are counted, and get a line together."""
COUNTED: Final = 10.0
"""So often what was counted is written [s]."""
KINDS: Final = 64
"""Refusals that are counted apart; what is beyond is counted together."""
WAITING: Final = 1024
"""Lines that may wait for a slow disk; the file says how many were lost beyond."""
LONGEST: Final = 65536
"""Longest line [bytes]."""
_HASHED: Final = re.compile(rb'(\{.*),"hash":"([0-9a-f]{64})"\}\n', re.DOTALL)
_HEAD: Final = re.compile(rb"([0-9]{16}) ([0-9a-f]{64})\n")


def head_of(path: Path) -> Path:
    """Where the number and the hash of a log's last line are."""
    return path.with_name(f"{path.name}.head")


class AuditLog:
    """Appends to a log in a thread of its own, which a slow or full disk holds up, and nothing else.

    To be closed in the end; it may be used from one thread.
    """

    def __init__(self, path: Path, *, failed: Callable[[str], None] = lambda _: None) -> None:
        """Go on with a log, or begin one, mode 0600.

        Args:
            path: The log.
            failed: Is told in the log's thread when lines can't be written, and again when they can.

        Raises:
            FormatError: If the file can't be written, or isn't a log.
        """
        self.path, self._failed = path, failed
        self.problem = ""
        """Why lines aren't written at present."""
        self.lost = 0
        """Lines that weren't written since then."""
        self._clock = WallClock()
        self._allowed = Bucket(LINES, LINES_BURST, self._clock.now())
        self._counted: dict[tuple[tuple[str, Fact], ...], int] = {}
        self._due = float("inf")
        self._queue: queue.Queue[dict[str, Fact] | None] = queue.Queue(WAITING)
        began: dict[str, Fact] = {"event": "began"}
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
            self._head = os.open(head_of(path), os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            raise FormatError(f"audit log {path}", error.strerror or "can't be opened") from None
        try:
            if not lock(self._file):
                raise FormatError(f"audit log {path}", "another process writes it: each has a file of its own")
            for one in (path, head_of(path)):
                one.chmod(0o600)
            self._number, self._hash = self._resume(began)
        except BaseException:
            self._close_files()
            raise
        self._thread = threading.Thread(target=self._run, name="audit", daemon=True)
        self._thread.start()
        self._put({"at": seconds_since_1970(), **began})

    def _resume(self, began: dict[str, Fact]) -> tuple[int, str]:
        """Number and hash of the last line; what's wrong with the end of the log is noted."""
        last, torn = _last_line(self.path)
        if torn:
            # The machine stopped in the middle of a line.
            os.write(self._file, b"\n")
            began["torn"] = hashlib.sha256(torn).hexdigest()
        if last is None:
            number, found = 0, FIRST
        elif (parsed := _Line.of(last)) is None:
            raise FormatError(
                f"audit log {self.path}", "its last line isn't one of a log's: vrs doctor --log says more"
            )
        else:
            number, found = parsed.number, parsed.hash
        head = _read_head(self.path)
        if head is not None and head[0] > number:
            began["missing"] = head[0] - number
        return number, found

    def note(self, event: str, **facts: Fact) -> None:
        """Write what has happened.

        Args:
            event: Of what kind.
            **facts: What is known of it; those that are None are left out.
        """
        self._put({"at": seconds_since_1970(), "event": event, **_known(facts)})

    def refused(self, **facts: Fact) -> None:
        """Write that something was refused; what is refused again and again is counted.

        Args:
            **facts: What, to whom and why.
        """
        now, known = self._clock.now(), _known(facts)
        kind = tuple(known.items())
        if kind not in self._counted and self._allowed.take(now):
            self.note("refused", **known)
            if len(self._counted) < KINDS:
                self._counted[kind] = 0
        else:
            if kind not in self._counted and len(self._counted) >= KINDS:
                kind = (("what", "others"),)
            self._counted[kind] = self._counted.get(kind, 0) + 1
        self._due = min(self._due, now + COUNTED)

    def health(self) -> dict[str, Fact]:
        """How it is, for `/health`."""
        return {"problem": self.problem, "lost": self.lost}

    def advance(self) -> None:
        """Write what was counted, when it's time."""
        if self._clock.now() >= self._due:
            self._write_counted()

    def _write_counted(self) -> None:
        self._due = float("inf")
        for kind, count in self._counted.items():
            if count:
                self.note("refused", **dict(kind), again=count)
        self._counted.clear()

    def close(self) -> None:
        """Write what is left, and that it ends."""
        self._write_counted()
        self._put({"at": seconds_since_1970(), "event": "ended"})
        with contextlib.suppress(queue.Full):
            self._queue.put(None, timeout=1.0)
        self._thread.join(2.0)

    def _put(self, facts: dict[str, Fact]) -> None:
        try:
            self._queue.put_nowait(facts)
        except queue.Full:
            self.lost += 1

    def _run(self) -> None:
        while (facts := self._queue.get()) is not None:
            lost = self.lost
            try:
                self._write(facts | ({"lost": lost} if lost else {}))
                if self._queue.empty():
                    # All that has come meanwhile is on the disk at once.
                    self._sync()
            except OSError as error:
                self.lost += 1
                if not self.problem:
                    self.problem = f"audit log {self.path}: {error.strerror}"
                    self._failed(f"{self.problem}; nothing of it is kept until it can be written")
            else:
                self.lost -= lost
                if self.problem:
                    self.problem = ""
                    self._failed(f"audit log {self.path} is written again; {lost} lines were lost")
        with contextlib.suppress(OSError):
            self._sync()
        self._close_files()

    def _sync(self) -> None:
        for one in (self._file, self._head):
            os.fsync(one)

    def _write(self, facts: dict[str, Fact]) -> None:
        text = json.dumps(
            {"n": self._number + 1, **facts}, ensure_ascii=True, allow_nan=False, separators=(",", ":")
        )
        found = _chained(self._hash, text.encode())
        line = f'{text[:-1]},"hash":"{found}"}}\n'.encode()
        size = os.fstat(self._file).st_size
        # A full disk takes a part of a line, and says so at the next one.
        if os.write(self._file, line) < len(line):
            os.ftruncate(self._file, size)
            raise OSError(None, "no space left on device")
        self._number, self._hash = self._number + 1, found
        os.lseek(self._head, 0, os.SEEK_SET)
        os.write(self._head, f"{self._number:016d} {found}\n".encode())

    def _close_files(self) -> None:
        for one in (self._file, self._head):
            os.close(one)


def _known(facts: dict[str, Fact]) -> dict[str, Fact]:
    return {name: fact for name, fact in facts.items() if fact is not None}


def _chained(before: str, text: bytes) -> str:
    return hashlib.sha256(before.encode() + text).hexdigest()


class _Line(NamedTuple):
    number: int
    hash: str
    text: bytes
    """What is hashed, with the hash before it."""
    torn: str | None
    """Hash of a line before it that was cut off by a stop of the machine."""
    missing: int
    """Lines that were missing at the end when a process went on with the log."""

    @classmethod
    def of(cls, data: bytes) -> _Line | None:
        """A line of a log; None of what is none."""
        found = _HASHED.fullmatch(data)
        if found is None:
            return None
        text = found[1] + b"}"
        try:
            facts = json.loads(text)
            return cls(int(facts["n"]), found[2].decode(), text, facts.get("torn"), int(facts.get("missing", 0)))
        except (ValueError, KeyError, TypeError):
            return None


def _last_line(path: Path) -> tuple[bytes | None, bytes]:
    """The last whole line of a file, and what stands behind it without an end."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - 2 * LONGEST))
        lines = file.read().splitlines(keepends=True)
    torn = lines.pop() if lines and not lines[-1].endswith(b"\n") else b""
    return (lines[-1] if lines else None), torn


def _read_head(path: Path) -> tuple[int, str] | None:
    """Number and hash of the last line; 0 while none has been written, None where there's no head."""
    try:
        data = head_of(path).read_bytes()
    except OSError:
        return None
    found = _HEAD.fullmatch(data or f"{0:016d} {FIRST}\n".encode())
    return None if found is None else (int(found[1]), found[2].decode())


@dataclass(frozen=True, slots=True)
class AuditCheck:
    """How a log is."""

    lines: int
    """Those that are in order, from the first one."""
    hash: str
    """Of the last one of them."""
    problem: str = ""
    """What is wrong first, and in which line; empty where nothing is."""


def check_audit(path: Path) -> AuditCheck:
    """Follow the chain of a log from its first line.

    Args:
        path: The log; what is beside it tells whether lines at its end are missing.

    Raises:
        FormatError: If it can't be read.
    """
    try:
        with path.open("rb") as file:
            found = _follow(file)
    except OSError as error:
        raise FormatError(f"audit log {path}", error.strerror or "can't be read") from None
    if found.problem:
        return found
    head = _read_head(path)
    if head is None:
        return AuditCheck(found.lines, found.hash, f"{head_of(path)} is missing, or isn't a head of a log")
    number, last = head
    if number > found.lines:
        return AuditCheck(found.lines, found.hash, f"{_lines(found.lines + 1, number)} missing at the end")
    # A kill may come between a line and its head.
    if found.lines - number > 1 or (number == found.lines and last != found.hash):
        return AuditCheck(found.lines, found.hash, f"line {found.lines} isn't the last one by {head_of(path)}")
    return found


def _lines(first: int, last: int) -> str:
    return f"line {first} is" if first == last else f"lines {first} to {last} are"


def _follow(file: BinaryIO) -> AuditCheck:
    number, found = 0, FIRST
    torn: bytes | None = None
    for data in iter(lambda: file.readline(LONGEST + 1), b""):
        line, here = _Line.of(data), number + 1
        if line is None:
            if torn is not None:
                break
            torn = data.rstrip(b"\n")
            continue
        if torn is not None and line.torn != hashlib.sha256(torn).hexdigest():
            break
        if line.number > here:
            return AuditCheck(number, found, f"{_lines(here, line.number - 1)} missing")
        if line.number < here:
            return AuditCheck(number, found, f"line {here} is changed: it has the number {line.number}")
        if _chained(found, line.text) != line.hash:
            return AuditCheck(number, found, f"line {here} is changed, or the one before it")
        if line.missing:
            text = f"{_lines(here, here + line.missing - 1)} missing that was there before line {here} began"
            return AuditCheck(number, found, text)
        number, found, torn = here, line.hash, None
    if torn is not None:
        return AuditCheck(number, found, f"line {number + 1} is changed or cut: it isn't a line of a log")
    return AuditCheck(number, found)
