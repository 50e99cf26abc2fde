"""Runs that are kept as recordings, and what their files are called."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from interfaces.lab.driving.run import run
from interfaces.runs.drive_run import DriveCase, DriveRun, Row, row_of

FOLDER: Final = "runs"
"""Where recordings are, below the results."""
LONGEST: Final = 24
"""Characters of a part of a name."""
_FILES: Final = ("trace:", "inputs:")
_PLAIN: Final = re.compile(r"[A-Za-z0-9.+@:-]+\Z")
_OTHERS: Final = re.compile(r"[^A-Za-z0-9.+-]")


class Kept(NamedTuple):
    """What is left of a run."""

    row: Row
    drive: DriveRun | None
    """All of it, where that's to be drawn."""
    problem: str
    """Why its recording isn't there; empty where it is, or wasn't asked for."""


def measure_recorded(case: DriveCase, keep: bool, path: Path | None) -> Kept:
    """Run a case and keep its figures, all of it if that's to be drawn, and its recording if that has a path."""
    if path is None:
        drive, problem = run(case), ""
    else:
        from interfaces.recording.run_recorders import DriveRecorder

        recorder = DriveRecorder(path)
        drive = run(case, witness=recorder)
        recorder.finish(drive)
        problem = recorder.problem
    return Kept(row_of(drive), drive if keep else None, problem)


def paths(chosen: Sequence[DriveCase], out: Path) -> list[Path | None]:
    """Where recordings of cases go; of equal cases the first one's is kept."""
    found: list[Path | None] = []
    for case in chosen:
        path = out / FOLDER / f"{name_of(case)}.mcap"
        found.append(None if path in found else path)
    return found


def name_of(case: DriveCase) -> str:
    """What a case's recording is called: its architecture, transport, delay, robot, operator and seed.

    What no file name should have becomes `_`; of what is a file, or too long, its end stays and some digits that
    tell it from others.
    """
    parts = case.group
    return "-".join([*(_part(part) for part in parts), str(case.seed)])


def _part(text: str) -> str:
    plain = _OTHERS.sub("_", text)
    if _PLAIN.match(text) and len(text) <= LONGEST and not text.startswith(_FILES):
        return plain
    digest = hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:8]
    kind = text.partition(":")[0] + "_" if text.startswith(_FILES) else ""
    return f"{kind}{_OTHERS.sub('_', Path(text.partition(':')[2] or text).stem)[-12:]}_{digest}"
