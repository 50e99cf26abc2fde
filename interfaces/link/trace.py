"""Trace files: recorded delays, a row a packet."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interfaces.link.delay import MAX_DELAY, DelaySource, share_of
from interfaces.system import read_within
from vrs.checks import number_in
from vrs.errors import FormatError, InvalidValueError

COLUMN = "delay_s"
MAX_BYTES = 64 * 1024 * 1024


@dataclass(frozen=True, slots=True)
class TraceDelay:
    """Recorded delays, a row a packet; after the last row the first comes again."""

    name: str
    delays: tuple[float | None, ...]
    """One-way delays [s], in [0, 3600]; None is a lost packet. Not empty."""

    def __post_init__(self) -> None:
        if not self.delays:
            raise InvalidValueError("delays", self.delays, "at least one row")
        for delay in self.delays:
            if delay is not None:
                number_in("delay", delay, 0.0, MAX_DELAY, "seconds")

    def source(self, rng: np.random.Generator) -> DelaySource:  # noqa: ARG002
        """Start at the first row."""
        return _TracePosition(self.delays)

    def quantile(self, share: float) -> float:
        """Smallest recorded delay that the share of arriving packets keeps within [s]; 0 if none arrives."""
        arriving = sorted(d for d in self.delays if d is not None)
        return arriving[max(0, math.ceil(share_of(share) * len(arriving)) - 1)] if arriving else 0.0


class _TracePosition:
    """Position in a trace."""

    def __init__(self, delays: tuple[float | None, ...]) -> None:
        self._delays, self._row = delays, 0

    def draw(self, now: float, size: int = 0) -> float | None:  # noqa: ARG002
        delay = self._delays[self._row]
        self._row = (self._row + 1) % len(self._delays)
        return delay


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
        text = read_within(path, MAX_BYTES).decode("utf-8-sig")
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
