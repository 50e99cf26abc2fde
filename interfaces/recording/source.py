"""A file that's read by place, and may still grow."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from vrs.errors import FormatError


class FileSource:
    """Reads a file by place; errors of the disk are errors of the format."""

    def __init__(self, path: Path) -> None:
        """Open a file.

        Raises:
            FormatError: If that can't be done.
        """
        self.where = str(path)
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        except OSError as error:
            raise FormatError(self.where, os.strerror(error.errno or 0)) from None
        self.size = 0
        """Bytes when it was looked at last."""
        try:
            self.look()
        except FormatError:
            self.close()
            raise

    def look(self) -> int:
        """How large it is now [bytes].

        Raises:
            FormatError: If it's no plain file, or is gone.
        """
        try:
            state = os.fstat(self._file)
        except OSError as error:
            raise FormatError(self.where, os.strerror(error.errno or 0)) from None
        if not stat.S_ISREG(state.st_mode):
            raise FormatError(self.where, "isn't a plain file")
        self.size = state.st_size
        return self.size

    def read(self, offset: int, length: int) -> bytes:
        """Bytes from a place on; fewer at the end of the file.

        Raises:
            FormatError: If the disk doesn't give them.
        """
        if offset < 0 or offset >= self.size:
            return b""
        length = min(length, self.size - offset)
        parts = []
        try:
            while length:
                part = os.pread(self._file, length, offset)
                if not part:
                    break
                parts.append(part)
                offset, length = offset + len(part), length - len(part)
        except OSError as error:
            raise FormatError(self.where, os.strerror(error.errno or 0)) from None
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def close(self) -> None:
        """Close it; it's closed once."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
