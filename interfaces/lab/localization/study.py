"""The study behind `vrs lab localization`: what's asked of the localization, measured."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from interfaces.lab.claims import Paper, PaperPart, Reproduction
from interfaces.lab.localization.accuracy import conclude_rooms, measure_room
from interfaces.lab.localization.searching import (
    STARTS,
    conclude_carried,
    conclude_starts,
    conclude_symmetric,
    measure_carried,
    measure_starts,
    measure_symmetric,
)
from interfaces.lab.localization.unobservable import PLACES, conclude_axes, measure_axis
from interfaces.lab.output import to_json, write_files
from vrs.checks import number_in

ROOMS, LENGTH, FULL_STARTS = 30, 60.0, 200
"""Rooms, length of a drive [s] and starts, unless said otherwise."""
SYMMETRIC, CARRIED = 3, 10
"""Symmetric rooms, and robots that are carried off; fewer where there are fewer rooms."""


def study_of(rooms: int, starts: int) -> Paper:
    """The parts of a study.

    Args:
        rooms: In which accuracy is measured, 2 to 1000.
        starts: From which a robot that knows nothing is found, 1 to 10,000.

    Raises:
        InvalidValueError: If there are too few or too many.
    """
    number_in("starts", starts, 1, 10_000, "a number")
    groups = tuple(f"{k}:{min(STARTS, starts - first)}" for k, first in enumerate(range(0, starts, STARTS)))
    return Paper(
        "localization",
        "Kim, Han, Kim, Kim, Internet-Based Personal Robot System using Map-Based Localization, 2002, section 3",
        (
            PaperPart("accuracy", measure_room, conclude_rooms, _cases(rooms)),
            PaperPart("what can't be known", measure_axis, conclude_axes, PLACES),
            PaperPart("starts anywhere", measure_starts, conclude_starts, groups),
            PaperPart("symmetric rooms", measure_symmetric, conclude_symmetric, _cases(SYMMETRIC)),
            PaperPart("carried off", measure_carried, conclude_carried, _cases(min(CARRIED, len(groups)))),
        ),
        runs=ROOMS,
        length=LENGTH,
    )


def _cases(count: int) -> tuple[str, ...]:
    return tuple(str(k) for k in range(count))


def write(found: Reproduction, out: Path) -> None:
    """Write summary.json, runs.csv with a row a room, and the pictures into an existing directory.

    Raises:
        FormatError: If it can't hold them.
    """
    rooms = next(table for table in found.findings.tables if table.name == "rooms")
    lines = io.StringIO()
    rows = csv.writer(lines, lineterminator="\n")
    rows.writerow(rooms.columns)
    rows.writerows([f"{cell:.6g}" if isinstance(cell, float) else cell for cell in row] for row in rooms.rows)
    write_files(out, found.findings.figures, {"runs.csv": lines.getvalue(), "summary.json": to_json(found)})
