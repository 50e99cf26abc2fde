"""Files: read whole, if they aren't too long, and written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

from vrs.errors import FormatError


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


def write_whole(path: Path, data: bytes) -> None:
    """Write a file, whole or not at all: whoever reads it finds what was there before, or what is there now.

    Args:
        path: Where to.
        data: What.

    Raises:
        OSError: If it can't be written.
    """
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        with draft.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            draft.unlink()
