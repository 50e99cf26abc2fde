"""`vrs lab localization`: how well the robot knows where it is, and whether it knows how well."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import typer

from interfaces.cli.demo import prepare
from interfaces.cli.reproduce import measured, show
from vrs.errors import InvalidValueError

LOCALIZATION: Final = "localization"
"""What the command line calls it."""


def refuse(what: str, others: Mapping[str, object]) -> None:
    """Raise if options are given that are of other experiments than this one, and would do nothing.

    Raises:
        InvalidValueError: If there's one.
    """
    given = [name for name, value in others.items() if value]
    if given:
        raise InvalidValueError("options", " ".join(given), f"left out for {what}")


def localize(
    out: Path, seed: int, rooms: int | None, length: float | None, starts: int, workers: int, *, as_json: bool
) -> None:
    """Measure it, write summary.json, runs.csv and pictures, and show tables or JSON.

    Args:
        out: Where they go.
        seed: Of everything random.
        rooms: In which accuracy is measured, 2 to 1000; 30 if None.
        length: Of a drive [s]; 60 if None.
        starts: From which a robot that knows nothing is found.
        workers: Processes at once.
        as_json: Whether JSON goes to standard output, instead of tables.
    """
    from interfaces.lab import Study
    from interfaces.lab.localization.study import LENGTH, ROOMS, study_of, write
    from interfaces.lab.output import to_json

    study = Study(seed, ROOMS if rooms is None else rooms, LENGTH if length is None else length)
    paper = study_of(study.runs, starts)
    prepare(out, "runs.csv", "summary.json")
    found = measured(paper, study, workers)
    write(found, out)
    if as_json:
        typer.echo(to_json(found), nl=False)
    else:
        show(found, out / "summary.json")
