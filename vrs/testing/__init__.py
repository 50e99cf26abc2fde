"""Laws of the timeline as functions, and an engine under watch: for tests of whatever is built on the engine."""

from __future__ import annotations

from vrs.testing.laws import (
    BOUNDS,
    Columns,
    Figures,
    LawBrokenError,
    changed,
    check_limits,
    check_memory,
    check_moves,
    check_names,
    check_pace,
    check_past,
    check_receipts,
    check_rest,
    check_run,
    check_same,
    check_tail,
    check_way,
    columns,
    extremes,
)
from vrs.testing.sessions import KINDS, Draws, Generator, Session, Source, lines_are_planned
from vrs.testing.watch import Watch

__all__ = [
    "BOUNDS",
    "KINDS",
    "Columns",
    "Draws",
    "Figures",
    "Generator",
    "LawBrokenError",
    "Session",
    "Source",
    "Watch",
    "changed",
    "check_limits",
    "check_memory",
    "check_moves",
    "check_names",
    "check_pace",
    "check_past",
    "check_receipts",
    "check_rest",
    "check_run",
    "check_same",
    "check_tail",
    "check_way",
    "columns",
    "extremes",
    "lines_are_planned",
]
