"""Corrections of a path from a file: what an external computer would send to a program that says ALTER."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from interfaces.system import read_within
from interfaces.val2.motion.arm import Arm
from interfaces.val2.motion.places import in_millimetres
from vrs.errors import FormatError

COLUMNS: Final = ("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg")
"""A way, and a turn of the tip: a rotation vector."""
CLOCKS: Final = {"t_s": False, "alter_s": True}
"""The first column: times of the program, or since each ALTER."""
LARGEST: Final = 16 * 1024 * 1024
"""Longest file [B]."""
_FURTHEST: Final = 1e6
"""No time [s], way [mm] or turn [deg] is more."""


@dataclass(frozen=True, slots=True)
class Corrections:
    """The rows of a file."""

    rows: tuple[tuple[float, ...], ...]
    """A time [s], a way [mm] and a turn [deg] each; times rise."""
    since_alter: bool
    """Whether times begin anew with each ALTER; else with the program."""


def read_corrections(path: Path) -> Corrections:
    """Read a CSV file whose header is `t_s` or `alter_s`, and `COLUMNS`.

    Raises:
        FormatError: If it can't be read as such, with the line.
    """
    text = read_within(path, LARGEST).decode("utf-8-sig", errors="replace")
    lines = csv.reader(line.replace("\0", "\ufffd") for line in text.splitlines())
    first, *others = [cell.strip() for cell in next(lines, [])] or [""]
    if first not in CLOCKS or tuple(others) != COLUMNS:
        wanted = " or ".join(",".join((clock, *COLUMNS)) for clock in CLOCKS)
        given = ",".join((first, *others))[:80]
        raise FormatError(str(path), f"line 1 must be {wanted}; given: {given!r}")
    rows: list[tuple[float, ...]] = []
    for cells in lines:
        if cells:
            rows.append(_row(cells, rows[-1][0] if rows else -math.inf, f"{path}: line {lines.line_num}"))
    if not rows:
        raise FormatError(str(path), "must have a row or more below its header")
    return Corrections(tuple(rows), CLOCKS[first])


def _row(cells: list[str], before: float, where: str) -> tuple[float, ...]:
    try:
        row = tuple(map(float, cells))
    except ValueError:
        row = ()
    if len(row) != 1 + len(COLUMNS) or not all(abs(value) <= _FURTHEST for value in row):
        raise FormatError(where, f"must be a time and six numbers; given: {','.join(cells)[:80]!r}")
    if not max(before, -math.ulp(0.0)) < row[0]:
        raise FormatError(where, f"a time must be 0 s or more, and later than the one before; given: {row[0]:g}")
    return row


class Corrector:
    """Gives an arm the corrections of a file at their times, whatever the channel of ALTER is."""

    def __init__(self, corrections: Corrections, arm: Arm) -> None:
        self._corrections, self._arm = corrections, arm
        self._begun: float | None = None if corrections.since_alter else 0.0
        """From when on their times count [s]; None while they don't."""
        self._next = 0
        self._missed = 0
        self._problems: list[str] = []

    def advance(self, now: float) -> None:
        """Give what is due by now [s]."""
        altered = self._arm.altered_since(now=now)
        if self._corrections.since_alter and altered != self._begun:
            self._begun, self._next = altered, 0
        while (due := self.next_deadline()) <= now:
            row = self._corrections.rows[self._next]
            self._next += 1
            if altered is None:
                self._missed += 1
                continue
            outcome = self._arm.correct(row[1:], given=due, now=now)
            receipt = None if outcome is None else outcome.receipt
            late = "" if receipt is None else receipt.hindrance
            if problem := late if outcome is None or not outcome.reason else in_millimetres(outcome.reason):
                self._problems.append(f"correction of {row[0]:g} s: {problem}")

    def report(self) -> list[str]:
        """What wasn't done as the file has it, in few lines."""
        lines, more = self._problems[:1], len(self._problems) - 1
        if more > 0:
            lines.append(f"{more} more weren't followed, or not in time")
        if self._missed:
            lines.append(f"{self._missed} corrections came while no program said ALTER")
        return lines

    def next_deadline(self) -> float:
        """When the next one is due [s]; infinity for never."""
        if self._begun is None or self._next == len(self._corrections.rows):
            return math.inf
        return self._begun + self._corrections.rows[self._next][0]
