"""A directory of recordings: what is in it, and what may be put there; named by plain file names alone."""

from __future__ import annotations

import os
import re
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from interfaces.recording.recording import open_recording
from robots.robot import Robot
from vrs.errors import FormatError, InvalidValueError

LISTED: Final = 200
"""Recordings that are listed at most: the newest."""
LOOKED_INTO: Final = 128 * 2**20
"""Larger files are listed without being looked into [bytes]."""
AT_ONCE: Final = 8
"""Files that one look at the directory looks into, at most: the others come with the next looks."""
ENTRIES: Final = 20_000
"""Entries of the directory that a look goes through, at most."""
_NAME: Final = re.compile(r"\A[^\W_][\w .()+-]{0,94}\.mcap\Z")
_LONGEST: Final = 200
"""Bytes of a name."""
_ALLOWED: Final = "a plain file name of letters, digits and  . _ - + ( )  that ends in .mcap, up to 100 characters"


def checked_name(name: object) -> str:
    """The name of a recording.

    Raises:
        InvalidValueError: If it's no plain file name that ends in `.mcap`.
    """
    if not isinstance(name, str) or not _NAME.match(name) or len(name.encode()) > _LONGEST:
        raise InvalidValueError("name", name if isinstance(name, str) else type(name).__name__, _ALLOWED)
    return name


@dataclass(frozen=True, slots=True)
class ShelfEntry:
    """A recording in the directory."""

    name: str
    size: int
    """[bytes]"""
    changed: float
    """When it was written last, seconds since 1970."""
    began: float | None = None
    """Seconds since 1970; None where that isn't known."""
    length: float | None = None
    """From its beginning to its last sample [s]; None where that isn't known."""
    problem: str = ""
    """What is wrong with it; empty if nothing is."""
    playable: bool = True

    def facts(self) -> dict[str, Any]:
        """The entry for a page."""
        return {name: getattr(self, name) for name in self.__slots__}


class Shelf:
    """Looks at the directory; each file is looked into once, as long as it stays as it is."""

    def __init__(self, directory: Path, robot: Robot | None = None) -> None:
        """Look at a directory, which needn't be there yet.

        Args:
            directory: Where recordings are.
            robot: What they may be of, beside robots that are found by their names.
        """
        self.directory, self.robot = directory, robot
        self.known: OrderedDict[tuple[str, int, int], ShelfEntry] = OrderedDict()
        """Files that were looked into, by name, size and time; the last ones."""

    def place(self, name: object) -> Path:
        """Where a new recording goes; the directory is made if it's missing.

        Raises:
            InvalidValueError: If the name isn't one, or is taken, or the directory can't be made.
        """
        checked = checked_name(name)
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidValueError("recordings", str(self.directory), f"a directory ({error.strerror})") from None
        path = self.directory / checked
        if os.path.lexists(path):
            raise InvalidValueError("name", checked, "a name that isn't taken: no recording is written over")
        return path

    def path(self, name: object) -> Path:
        """Where a recording that is there stands.

        Raises:
            InvalidValueError: If there's none of that name.
        """
        checked = checked_name(name)
        path = self.directory / checked
        if path.is_symlink() or not path.is_file():
            raise InvalidValueError("recording", checked, "one that is listed")
        return path

    def entries(self, growing: str | None = None) -> tuple[list[ShelfEntry], int]:
        """What is there, the newest first, and how many more there are. Takes a while: call it in a thread.

        Args:
            growing: Name of the one that is being written, which isn't looked into.
        """
        found = []
        try:
            with os.scandir(self.directory) as directory:
                for count, item in enumerate(directory):
                    if count >= ENTRIES:
                        break
                    if _NAME.match(item.name) and item.is_file(follow_symlinks=False):
                        found.append((item.name, item.stat(follow_symlinks=False)))
        except OSError:
            return [], 0
        found.sort(key=lambda pair: (-pair[1].st_mtime_ns, pair[0]))
        entries, left = [], AT_ONCE
        for name, state in found[:LISTED]:
            key = name, state.st_size, state.st_mtime_ns
            known = self.known.get(key)
            if known is None:
                known = ShelfEntry(name, state.st_size, state.st_mtime)
                if left > 0 and name != growing:
                    left -= 1
                    known = self.known[key] = look_into(self.directory / name, known)
                    while len(self.known) > 2 * LISTED:
                        self.known.popitem(last=False)
            entries.append(known)
        return entries, max(len(found) - LISTED, 0)


def look_into(path: Path, entry: ShelfEntry) -> ShelfEntry:
    """What is in a recording, or why it can't be played."""
    facts = entry.name, entry.size, entry.changed
    if entry.size > LOOKED_INTO:
        return ShelfEntry(*facts, problem="too large for this page: vrs replay opens it", playable=False)
    try:
        with open_recording(path) as recording:
            start, end = recording.span
            session, damage = recording.session, recording.damage
            return ShelfEntry(*facts, session.began, end - start, str(damage) if damage else "")
    except FormatError as error:
        return ShelfEntry(*facts, problem=error.problem, playable=False)
