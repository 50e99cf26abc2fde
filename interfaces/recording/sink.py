"""A file that takes all of what it's given, or says that it doesn't."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Protocol

from interfaces.recording.errors import RecordingError


class RawFile(Protocol):
    """An unbuffered file: it may take less than it's given."""

    def write(self, data: bytes | memoryview, /) -> int | None:
        """Write some of the bytes; how many, or None for none."""

    def close(self) -> None:
        """Close the file."""


class Sink:
    """Writes all of its input, in order; after the first failure nothing more.

    A full disk shows first as a short write without an exception: the rest is tried again, and then it raises.
    """

    def __init__(self, file: RawFile, where: str) -> None:
        """Write to a raw file.

        Args:
            file: Unbuffered.
            where: What to call it in messages.
        """
        self._file = file
        self.where = where
        self.size = 0
        """Bytes that the file took."""
        self._failed = False

    @classmethod
    def create(cls, path: Path, *, over: bool = True) -> Sink:
        """Make a file, or take the place of an old one where that's allowed.

        Raises:
            RecordingError: If that can't be done.
        """
        try:
            return cls(path.open("wb" if over else "xb", buffering=0), str(path))
        except FileExistsError:
            raise RecordingError(str(path), "it's there already: none is written over") from None
        except OSError as error:
            raise RecordingError(str(path), os.strerror(error.errno or 0)) from error

    def write(self, data: bytes) -> int:
        """Write everything.

        Raises:
            RecordingError: If the file doesn't take it all; what it took stays.
        """
        if self._failed:
            raise RecordingError(self.where, "it failed before")
        rest = memoryview(data)
        while rest:
            try:
                taken = self._file.write(rest)
            except (OSError, ValueError) as error:
                self._failed = True
                problem = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
                raise RecordingError(self.where, problem) from error
            if not taken:
                self._failed = True
                raise RecordingError(self.where, f"it takes no more after {self.size} bytes")
            self.size += taken
            rest = rest[taken:]
        return len(data)

    def tell(self) -> int:
        """Bytes so far."""
        return self.size

    def flush(self) -> None:
        """Nothing is held back."""

    def close(self) -> None:
        """Close the file.

        Raises:
            RecordingError: If its last bytes didn't get there.
        """
        try:
            self._file.close()
        except OSError as error:
            raise RecordingError(self.where, os.strerror(error.errno or 0)) from error
