"""Files that users give: read whole, if they aren't too long."""

from __future__ import annotations

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
