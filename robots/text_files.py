"""Text files from anybody: of a bounded size, and text indeed."""

from __future__ import annotations

from pathlib import Path

from vrs.errors import FormatError


def bounded_text(path: Path, most: int, encoding: str = "utf-8") -> str:
    """Return the text of a file.

    Args:
        path: Where it is.
        most: Largest size [B]; no more is read.
        encoding: UTF-8 of a kind.

    Raises:
        FormatError: If it's longer, or isn't UTF-8.
        OSError: If it can't be read.
    """
    with path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise FormatError(path.name, f"longer than {most} bytes")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise FormatError(path.name, f"no UTF-8 at byte {error.start}") from None
