"""Where the mobile robots of one room truly are, for each other's senses: a small file that processes share."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from robots.robot import Closing
from robots.rooms import Posture
from vrs.clock import seconds_since_1970
from vrs.errors import FormatError

_ROW: Final = struct.Struct("=Q3d")
"""How often it was written, odd while it's being written; x, y [m], θ [rad]."""
_HEAD: Final = struct.Struct("=d")
"""When the room's time began [s since 1970]."""
_TRIES: Final = 100
"""Looks at a row that is being written; a process that stands still in the middle of it keeps it no longer."""


class Whereabouts(Closing):
    """Postures by number, written by a process each and read by all."""

    def __init__(self, path: Path) -> None:
        """Open a file that `write_starts` made.

        Raises:
            FormatError: If it can't be opened.
        """
        try:
            with path.open("r+b") as file:
                self._map = mmap.mmap(file.fileno(), 0)
        except (OSError, ValueError) as error:
            raise FormatError(str(path), str(error)) from None
        self._began = float(_HEAD.unpack_from(self._map)[0])
        rows = _ROW.iter_unpack(self._map[_HEAD.size :])
        self._last: list[Posture] = [(x, y, theta) for _, x, y, theta in rows]

    def time(self) -> float:
        """Time in the room now [s]."""
        return max(seconds_since_1970() - self._began, 0.0)

    def put(self, k: int, posture: Posture) -> None:
        """Say where the k-th robot is."""
        at = _HEAD.size + k * _ROW.size
        written = _ROW.unpack_from(self._map, at)[0] | 1
        struct.pack_into("=Q", self._map, at, written)
        _ROW.pack_into(self._map, at, written, *posture)
        struct.pack_into("=Q", self._map, at, written + 1)

    def where(self, k: int) -> Posture:
        """Where the k-th robot was last said to be."""
        at = _HEAD.size + k * _ROW.size
        for _ in range(_TRIES):
            before, x, y, theta = _ROW.unpack_from(self._map, at)
            if before % 2 == 0 and struct.unpack_from("=Q", self._map, at)[0] == before:
                self._last[k] = x, y, theta
                break
        return self._last[k]

    def close(self) -> None:
        """Close the file."""
        self._map.close()


def write_starts(path: Path, starts: Sequence[Posture]) -> None:
    """Make the file of robots that begin at these postures; the room's time begins now."""
    path.write_bytes(_HEAD.pack(seconds_since_1970()) + b"".join(_ROW.pack(0, *start) for start in starts))
