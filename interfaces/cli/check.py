"""`vrs check`: what is wrong with a VAL-II program, before it runs."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.options import RobotName, val_robot
from interfaces.cli.run import text_of
from robots.robot import USUAL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interfaces.val2.errors import CheckFinding
    from interfaces.val2.source import SourceFile
    from vrs.model import RobotModel

SUFFERED = 2
"""Exit code for a program that is wrong."""


def check(
    program: Annotated[Path, typer.Argument(metavar="PROGRAM.v2", help="File of VAL-II programs.")],
    static: Annotated[
        bool, typer.Option("--static", help="Only read the programs; don't plan what the first would do.")
    ] = False,
    name: RobotName = USUAL,
    as_json: Annotated[bool, typer.Option("--json", help="Write the findings as JSON on standard output.")] = False,
) -> int:
    """Say what is wrong with a program: undefined names and labels, mixed types, places out of reach.

    Exits 2 when there's an error; warnings alone don't count.
    """
    from interfaces.val2.check import check_text

    source, found = check_text(text_of(program), program.name)
    wrong = any(finding.severity == "error" for finding in found)
    if source is not None and not static and not wrong:
        found += _rehearsed(source, val_robot(name).arm)
    found = _once(found)
    wrong = any(finding.severity == "error" for finding in found)
    if as_json:
        typer.echo(json.dumps({"file": str(program), "findings": [_row(finding) for finding in found]}, indent=2))
    else:
        _show(program, found)
    return SUFFERED if wrong else 0


def _rehearsed(source: SourceFile, model: RobotModel) -> list[CheckFinding]:
    """What only planning shows: the first program on a virtual arm alone."""
    from interfaces.val2.playing import rehearse

    return [replace(found, error=found.error.at(place=found.place)) for found in rehearse(source, model).findings]


def _once(found: list[CheckFinding]) -> list[CheckFinding]:
    """Without what was found at the same place before: a loop comes by many times."""
    first: dict[tuple[object, ...], CheckFinding] = {}
    for finding in found:
        first.setdefault((finding.severity, finding.place, finding.error.what, finding.error.program), finding)
    return list(first.values())


def _row(finding: CheckFinding) -> dict[str, object]:
    error, place = finding.error, finding.place
    return {
        "severity": finding.severity,
        "what": error.what,
        "detail": error.detail,
        "program": error.program or None,
        "step": error.step,
        "line": None if place is None else place.line,
        "column": None if place is None else place.column,
    }


def _show(path: Path, found: Sequence[CheckFinding]) -> None:
    for finding in found:
        error, place = finding.error, finding.place
        where = str(path) if place is None else f"{path}:{place.line}:{place.column}"
        inside = f"program {error.program}" if error.program else ""
        inside += f", step {error.step}" if error.step is not None else ""
        detail = f"*{error.what}* {error.detail}".rstrip()
        typer.echo(f"{where}: {finding.severity}: {detail}" + (f" ({inside})" if inside else ""))
    errors = sum(finding.severity == "error" for finding in found)
    warnings = len(found) - errors
    typer.echo(f"{_counted(errors, 'error')}, {_counted(warnings, 'warning')}.")


def _counted(count: int, word: str) -> str:
    return f"{count or 'no'} {word}{'' if count == 1 else 's'}"
