"""`vrs lab goals`: robots that are told where to go, and whether they get there."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import typer

from interfaces.cli.demo import prepare
from interfaces.cli.reproduce import measured, show

GOALS: Final = "goals"
"""What the command line calls it."""


def send(out: Path, seed: int, goals: int | None, workers: int, *, as_json: bool) -> None:
    """Measure it, write summary.json, runs.csv and maps, and show tables or JSON.

    Args:
        out: Where they go.
        seed: Of everything random.
        goals: Among furniture and doors, 2 to 1000; 100 if None.
        workers: Processes at once.
        as_json: Whether JSON goes to standard output, instead of tables.
    """
    from interfaces.lab import Study
    from interfaces.lab.goals.study import GOALS as USUAL
    from interfaces.lab.goals.study import study_of, write
    from interfaces.lab.output import to_json

    study = Study(seed, USUAL if goals is None else goals)
    paper = study_of(study.runs)
    prepare(out, "runs.csv", "summary.json")
    found = measured(paper, study, workers)
    write(found, out)
    if as_json:
        typer.echo(to_json(found), nl=False)
    else:
        show(found, out / "summary.json")
