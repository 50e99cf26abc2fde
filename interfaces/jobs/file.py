"""Keeps a list of jobs, and how far it is, in a file that people can read and mend."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final, Literal

import msgspec

from interfaces.messages.jobs import JobList, Progress
from interfaces.system import read_within, write_whole, written
from vrs.errors import FormatError, InvalidValueError

SCHEMA: Final = "vrs.jobs"
LARGEST: Final = 4_000_000
"""Longest file that is read [byte]."""
DAMAGED: Final = ".damaged"
"""What is put behind the name of a file that can't be read, before another is written in its place."""


class _FileHead(msgspec.Struct, frozen=True):
    schema: Literal["vrs.jobs"]
    version: int


class _JobsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    schema: Literal["vrs.jobs"]
    version: Literal[1]
    list: JobList
    progress: Progress = msgspec.field(default_factory=Progress)


class JobFile:
    """A list's file. What can't be read is kept beside it, never written over."""

    def __init__(self, path: Path) -> None:
        """Take the file, which needn't be there yet."""
        self.path = path
        self._damaged = False

    def load(self) -> tuple[JobList, Progress]:
        """The list, and how far it is; an empty one where there's no file yet.

        Raises:
            FormatError: If it can't be read, or isn't what it should be.
        """
        if not self.path.exists():
            return JobList(), Progress()
        try:
            return read_jobs(read_within(self.path, LARGEST), str(self.path))
        except FormatError:
            self._damaged = True
            raise

    def save(self, jobs: JobList, progress: Progress) -> None:
        """Write the list, whole or not at all.

        Raises:
            FormatError: If it can't be written.
        """
        with written(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self._damaged and self.path.is_file():
                self.path.rename(self._beside())
            write_whole(self.path, written_jobs(jobs, progress))
        self._damaged = False

    def _beside(self) -> Path:
        """A name that no file has, for what can't be read."""
        k, beside = 1, self.path.with_name(self.path.name + DAMAGED)
        while beside.exists():
            k += 1
            beside = self.path.with_name(f"{self.path.name}{DAMAGED}{k}")
        return beside


def written_jobs(jobs: JobList, progress: Progress) -> bytes:
    """A list as a file has it: JSON, indented."""
    return msgspec.json.format(msgspec.json.encode(_JobsFile(SCHEMA, 1, jobs, progress)), indent=2) + b"\n"


def read_jobs(data: bytes, name: str) -> tuple[JobList, Progress]:
    """The list in a file's bytes.

    Args:
        data: The bytes.
        name: Of the file, for the message.

    Raises:
        FormatError: If it isn't one.
    """
    try:
        head = msgspec.json.decode(data, type=_FileHead)
        if head.version != 1:
            raise FormatError(name, f"has version {head.version}; version 1 is read")
        file = msgspec.json.decode(data, type=_JobsFile)
        return file.list, file.progress
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, InvalidValueError) as error:
        raise FormatError(name, f"is no list of jobs: {error}") from None


def digest(jobs: JobList) -> str:
    """What two lists have in common only if they're the same."""
    return hashlib.sha256(msgspec.json.encode(jobs)).hexdigest()[:16]
