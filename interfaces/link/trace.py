"""Trace files: recorded delays, a row a packet."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

from vrs.errors import FormatError

COLUMN = "delay_s"
MAX_BYTES = 64 * 1024 * 1024


def read_trace(path: Path, *, longest: float) -> tuple[float | None, ...]:
    """Read the delays of a CSV file.

    An empty cell, quoted or not, and a bare empty line each are a lost packet.

    Args:
        path: A CSV file whose header names a `delay_s` column [s].
        longest: Largest delay allowed [s].

    Returns:
        One-way delays [s], None for a lost packet; at least one row.

    Raises:
        FormatError: If the file can't be read, or a row holds anything else.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise FormatError(str(path), f"can't be read: {error.strerror}") from None
    if len(data) > MAX_BYTES:
        raise FormatError(str(path), f"is longer than the {MAX_BYTES} bytes allowed")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FormatError(str(path), "isn't UTF-8 text") from None
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = [cell.strip() for cell in next(rows, [])]
        if COLUMN not in header:
            raise FormatError(f"{path}:1", f"the header must name a {COLUMN} column; given: {header}")
        column = header.index(COLUMN)
        delays = [_delay(row, column, f"{path}:{rows.line_num}", longest) for row in rows]
    except csv.Error as error:
        raise FormatError(f"{path}:{rows.line_num}", f"isn't CSV: {error}") from None
    if not delays:
        raise FormatError(str(path), "must hold at least one row below its header")
    return tuple(delays)


def _delay(row: list[str], column: int, where: str, longest: float) -> float | None:
    cell = row[column].strip() if column < len(row) else ""
    if not cell:
        return None
    try:
        delay = float(cell)
    except ValueError:
        delay = math.nan
    if not 0 <= delay <= longest:
        allowed = f"seconds in [0, {longest:g}], or empty for a lost packet"
        raise FormatError(where, f"{COLUMN} must be {allowed}; given: {cell!r}")
    return delay
