"""`vrs check`: what is wrong with a VAL-II program, before it runs; what a robot's description leaves out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from interfaces.cli.options import (
    DialectName,
    ProgramFiles,
    RobotName,
    Tip,
    argument,
    dialect_of,
    left_out,
    option,
    program_files,
    robot_of,
    val_robot,
)
from interfaces.cli.run import text_of
from robots.robot import USUAL, described
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interfaces.val2.errors import CheckFinding
    from interfaces.val2.source import SourceFile
    from robots.robot import Robot

_Found: TypeAlias = "tuple[Path, CheckFinding]"
"""What was found, and in which file."""
OF_PROGRAMS = ("program", "static", "robot", "dialect", "files")
"""Options that only programs have, by their names without dashes."""
SUFFERED = 2
"""Exit code for a program that is wrong."""


def check(
    ctx: typer.Context,
    programs: Annotated[
        list[Path] | None,
        argument("PROGRAM.v2|ROBOT", "Files of VAL-II programs and values; or of robots: URDF, xacro, MJCF, TOML."),
    ] = None,
    program: Annotated[str, option("NAME", "Which program is planned; the first unless given.")] = "",
    static: Annotated[bool, option("--static", "Only read the programs; don't plan what one would do.")] = False,
    name: RobotName = USUAL,
    tip: Tip = "",
    dialect: DialectName = "",
    files: ProgramFiles = None,
    driver: Annotated[
        str, option("MODULE:NAME", "Instead: whether a driver of the robot's hardware does what one must.")
    ] = "",
    move: Annotated[bool, option("--move", "Let the driver move each joint a little.")] = False,
    as_json: Annotated[bool, option("--json", "Write the findings as JSON on standard output.")] = False,
) -> int:
    """Say what is wrong with programs: undefined names and labels, mixed types, places out of reach.

    Exits 2 when there's an error; warnings alone don't count. Of descriptions of robots: links, joints, limits, the
    tip, what is assumed and how it's stated.
    """
    if driver:
        from interfaces.cli.check_driver import check_driver

        limits = robot_of(name, tip).arm.limits
        return 0 if check_driver(driver, limits, move=move, as_json=as_json) else SUFFERED
    if not programs:
        raise InvalidValueError("what is checked", "nothing", "files, or --driver MODULE:NAME")
    if any(described(str(path)) for path in programs):
        from interfaces.cli.check_robot import check_robots

        left_out(ctx, "descriptions of robots have nothing of the kind", OF_PROGRAMS)
        check_robots([str(path) for path in programs], tip, as_json=as_json)
        return 0
    from interfaces.val2.check import check_files

    checked = check_files([(text_of(path), path.name) for path in programs], dialect_of(dialect))
    found = [(path, finding) for path, (_, some) in zip(programs, checked, strict=True) for finding in some]
    sources = [source for source, _ in checked if source is not None]
    if not static and len(sources) == len(programs) and not _wrong(_of(found, sources, program)):
        found += _rehearsed(
            dict(zip(programs, sources, strict=True)), program, val_robot(name, tip), program_files(files)
        )
    found = _once(found)
    if as_json:
        listed = [
            {"file": str(path), "findings": [_row(finding) for where, finding in found if where == path]}
            for path in programs
        ]
        typer.echo(json.dumps(listed[0] if len(listed) == 1 else listed, indent=2))
    else:
        _show(found)
    return SUFFERED if _wrong(found) else 0


def _wrong(found: Sequence[_Found]) -> bool:
    return any(finding.severity == "error" for _, finding in found)


def _of(found: list[_Found], sources: Sequence[SourceFile], program: str) -> list[_Found]:
    """What was found in the program that's meant and in those that it calls, or in none."""
    from interfaces.val2.grammar import name_of
    from interfaces.val2.source import with_called

    known = {one.name: one for source in sources for one in source.programs}
    first = name_of(program) if program else next(iter(known), "")
    counted = with_called(known, {first: known[first]}) if first in known else known
    return [one for one in found if one[1].error.program in ("", *counted)]


def _rehearsed(sources: Mapping[Path, SourceFile], program: str, robot: Robot, files: Path | None) -> list[_Found]:
    """What only planning shows: a program on a virtual arm alone."""
    from interfaces.val2.motion import conventions_of
    from interfaces.val2.playing import rehearse
    from interfaces.val2.source import joined

    spoken = conventions_of(robot)
    found = rehearse(joined([*sources.values()], program), robot.arm, files=files, conventions=spoken).findings
    path_of = {one.name: path for path, source in sources.items() for one in source.programs}
    usual = next(iter(sources))
    return [
        (path_of.get(one.error.program, usual), replace(one, error=one.error.at(place=one.place))) for one in found
    ]


def _once(found: list[_Found]) -> list[_Found]:
    """Without what was found at the same place before: a loop comes by many times."""
    first: dict[tuple[object, ...], _Found] = {}
    for path, finding in found:
        key = (path, finding.severity, finding.place, finding.error.what, finding.error.program)
        first.setdefault(key, (path, finding))
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


def _show(found: Sequence[_Found]) -> None:
    for path, finding in found:
        error, place = finding.error, finding.place
        where = str(path) if place is None else f"{path}:{place.line}:{place.column}"
        inside = f"program {error.program}" if error.program else ""
        inside += f", step {error.step}" if error.step is not None else ""
        detail = f"*{error.what}* {error.detail}".rstrip()
        typer.echo(f"{where}: {finding.severity}: {detail}" + (f" ({inside})" if inside else ""))
    errors = sum(finding.severity == "error" for _, finding in found)
    warnings = len(found) - errors
    typer.echo(f"{_counted(errors, 'error')}, {_counted(warnings, 'warning')}.")


def _counted(count: int, word: str) -> str:
    return f"{count or 'no'} {word}{'' if count == 1 else 's'}"
