"""`vrs run`: a VAL-II program on both twins over an emulated internet."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.demo import (
    ADAPTIVE,
    DEFAULT_DELAY,
    DEFAULT_SEED,
    RECORDING,
    RESULTS,
    conclude,
    prepare,
    show,
)
from interfaces.cli.options import (
    BodyName,
    Delay,
    DialectName,
    Offset,
    Order,
    Out,
    ProgramFiles,
    RobotName,
    SceneFile,
    Tip,
    argument,
    dialect_of,
    option,
    program_files,
    val_robot,
)
from interfaces.system import read_within
from robots.robot import USUAL

if TYPE_CHECKING:
    from interfaces.val2.source import SourceFile
    from interfaces.val2.values import Dialect

MAX_BYTES = 4 * 1024 * 1024


def run(
    programs: Annotated[list[Path], argument("PROGRAM.v2", "Files of VAL-II programs and values.")],
    program: Annotated[str, option("NAME", "Which program is run; the first unless given.")] = "",
    name: RobotName = USUAL,
    tip: Tip = "",
    body: BodyName = "",
    delay: Delay = DEFAULT_DELAY,
    offset: Offset = ADAPTIVE,
    service: Order = "datagram",
    seed: Annotated[int, option("N", "Seed of everything random, RANDOM too.", min=0)] = DEFAULT_SEED,
    dialect: DialectName = "",
    files: ProgramFiles = None,
    corrections: Annotated[
        Path | None, option("FILE.csv", "Corrections of the path while the program says ALTER.")
    ] = None,
    scene: SceneFile = None,
    out: Out = Path("out"),
    limit: Annotated[float, option("S", "When the program is given up [s].", min=1, max=3600)] = 600.0,
) -> None:
    """Run a program of files, once, on virtual and real robot across an emulated internet.

    Standard output is what the program TYPEs; PROMPT reads standard input.
    """
    from interfaces.link import Conditions, delay_profile
    from interfaces.recording.run_recorders import RunRecorder
    from interfaces.runs.twin_run import fixed_offset
    from interfaces.val2.corrections import read_corrections
    from interfaces.val2.playing import Listeners
    from interfaces.val2.source import joined
    from interfaces.val2.twins import play
    from robots.things import read_scene

    profile = delay_profile(delay)
    D, order = fixed_offset(offset, profile), Conditions(service=service).service  # type: ignore[arg-type]
    source, robot = (
        joined([read(path, dialect_of(dialect)) for path in programs], program),
        val_robot(name, tip).with_body(body),
    )
    directory, corrected = program_files(files), None if corrections is None else read_corrections(corrections)
    prepare(out, *RESULTS)
    recorder = RunRecorder(out / RECORDING)
    played = play(
        source, robot, profile,
        seed=seed, offset=D, service=order, limit=limit, listeners=Listeners(_typed, _told, _asked),
        files=directory, corrections=corrected, keeper=recorder, scene=None if scene is None else read_scene(scene),
    )  # fmt: skip
    summary = conclude(played.plan, played.run, recorder, out, robot, profile, D=D, seed=seed, service=order)
    show(summary, out, recorded=not recorder.problem, err=True)
    if played.error is not None:
        raise played.error


def read(path: Path, dialect: Dialect | None = None) -> SourceFile:
    """Read a file of programs; in a dialect's angles, as far as it doesn't say.

    Raises:
        FormatError: If it can't be read, or is longer than 4 MiB.
        ValError: If it isn't VAL-II.
    """
    from interfaces.val2.source import parse_file
    from interfaces.val2.values import VAL2

    return parse_file(text_of(path), str(path), dialect or VAL2)


def text_of(path: Path) -> str:
    """The text of a file: UTF-8, or Latin-1 as old files are.

    Raises:
        FormatError: If it can't be read, or is longer than 4 MiB.
    """
    data = read_within(path, MAX_BYTES)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _typed(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


def _told(text: str) -> None:
    typer.echo(text, err=True)


def _asked(question: str) -> str | None:
    typer.echo(question, nl=False, err=True)
    line = sys.stdin.readline()
    return line.rstrip("\r\n") if line else None
