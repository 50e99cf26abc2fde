"""vrs lab: seeded experiments with a mobile robot, with confidence intervals; localization; goals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from interfaces.cli.demo import prepare
from interfaces.cli.options import PROFILES, On, Resume, Workers, argument, bars, option, sweeping
from interfaces.cli.reproduce import measured, show
from robots.robot import BARE, USUAL_BASE
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import AbstractContextManager

    from interfaces.lab.finished import FinishedRows, KeptRow
    from interfaces.lab.runner import Calls
    from interfaces.lab.runner import Workers as Who
    from interfaces.runs.drive_run import DriveCase

LOCALIZATION, GOALS, CONTROL, SWEEP = "localization", "goals", "control", "sweep"
"""What the command line calls them."""


def refuse(what: str, others: Mapping[str, object]) -> None:
    """Raise if options are given that are of other experiments than this one, and would do nothing.

    Raises:
        InvalidValueError: If there's one.
    """
    given = [name for name, value in others.items() if value]
    if given:
        raise InvalidValueError("options", " ".join(given), f"left out for {what}")


def study(
    what: str,
    out: Path,
    seed: int,
    runs: int | None,
    length: float | None,
    starts: int | None,
    operators: Sequence[str] | None,
    sweep: AbstractContextManager[tuple[Who, FinishedRows]],
    *,
    as_json: bool,
) -> None:
    """Measure something else than architectures, write summary.json, runs.csv and pictures; show tables or JSON.

    Args:
        what: `LOCALIZATION`, `GOALS` or `CONTROL`.
        out: Where the files go.
        seed: Of everything random.
        runs: Rooms in which accuracy is measured, goals among furniture and doors, or courses, 2 to 1000; 30, 100
            or 10 if None.
        length: Of a drive in a room [s]; 60 if None.
        starts: From which a robot that knows nothing is found; 200 if None.
        operators: Who see the real robot in `CONTROL`; those that come with it if None.
        sweep: Who measures, and where finished cases are kept, once it's entered.
        as_json: Whether JSON goes to standard output, instead of tables.
    """
    from interfaces.lab import Study
    from interfaces.lab.control import study as views
    from interfaces.lab.control.operators import OPERATORS
    from interfaces.lab.goals import study as trips
    from interfaces.lab.localization import study as rooms
    from interfaces.lab.output import to_json

    if what == GOALS:
        asked = Study(seed, trips.GOALS if runs is None else runs)
        paper, write = trips.study_of(asked.runs), trips.write
    elif what == CONTROL:
        asked = Study(seed, views.RUNS if runs is None else runs)
        paper, write = views.study_of(operators or tuple(OPERATORS)), views.write
    else:
        asked = Study(seed, rooms.ROOMS if runs is None else runs, rooms.LENGTH if length is None else length)
        paper, write = rooms.study_of(asked.runs, rooms.FULL_STARTS if starts is None else starts), rooms.write
    prepare(out, "runs.csv", "summary.json")
    with sweep as (workers, finished):
        (found,) = measured([(paper, asked)], workers, finished)
        write(found, out)
    if as_json:
        typer.echo(to_json(found), nl=False)
    else:
        show(found, out / "summary.json")


def swept(
    chosen: Sequence[DriveCase],
    settings: dict[str, Any],
    out: Path,
    sweep: AbstractContextManager[tuple[Who, FinishedRows]],
    *,
    only_plan: bool,
    as_json: bool,
) -> None:
    """Say what a design sweep costs, run it; write runs.parquet or runs.csv, summary.json and sweep.html.

    Args:
        chosen: Its cases.
        settings: What they are made of, for the summary.
        out: Where the files go.
        sweep: Who runs them, and where finished ones are kept, once it's entered.
        only_plan: Whether nothing is run but the one that the cost is measured by.
        as_json: Whether the summary goes to standard output, too.
    """
    import json

    from interfaces.lab.driving.design import planned, write_table
    from interfaces.lab.driving.output import summary
    from interfaces.lab.driving.sweep import measure
    from interfaces.lab.output import write_files
    from interfaces.report.surface import PAGE, write_sweep
    from vrs.clock import WallClock

    calls = [(measure, (case,)) for case in chosen]
    prepare(out, "runs.parquet", "runs.csv", "summary.json", PAGE)
    with sweep as (who, finished):
        kept, clock = finished.ready(calls), WallClock()
        if kept < len(calls):
            measure(chosen[0])
        each = clock.now()
        for line in planned(settings, len(calls), kept, each, who if isinstance(who, int) else None):
            typer.echo(line, err=True)
        if only_plan:
            return
        rows = _worked(calls, "runs", who, finished)
        found = summary([row.value for row in rows], settings)
        text = json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        write_files(out, (), {"summary.json": text})
        table, shown = write_table(rows, out), write_sweep(found, out)
    typer.echo(text, nl=False) if as_json else typer.echo(f"Wrote {shown}, summary.json and {table.name}")


def lab(
    ctx: typer.Context,
    out: Annotated[Path, option("DIR", "Where runs.csv, summary.json and figures go.")],
    what: Annotated[
        str,
        argument(
            "localization|goals|control|sweep",
            "How well the robot knows where it is, whether it gets where it's told to go, or what it's worth to see"
            " the virtual robot, instead of the architectures; or, of many of those under many networks, which one"
            " wins where, as Parquet and one page.",
        ),
    ] = "",
    architecture: Annotated[
        list[str] | None,
        option(
            "A",
            "I, II, III, III-capped, extended, timeline, or MODULE:NAME of your own; repeatable, III and "
            "timeline unless given.",
        ),
    ] = None,
    transport: Annotated[list[str] | None, option("T", "stream or datagrams (unless given); repeatable.")] = None,
    delay: Annotated[
        list[str] | None, option("PROFILE", f"Delay one way, thu unless given; repeatable: {PROFILES}")
    ] = None,
    correlation: Annotated[
        list[float] | None,
        option("S", "Correlation time of delays that have one [s], as thu@20 has; repeatable.", min=0, max=3600),
    ] = None,
    robot: Annotated[
        list[str] | None,
        option(
            "NAME|FILE|MODULE:NAME[@BODY]",
            f"A mobile robot's name ({USUAL_BASE} unless given), its file, MODULE:NAME of your own, or {BARE}: the "
            f"usual one without physics; with @BODY in another body than its usual one, as {USUAL_BASE}@mujoco; "
            "repeatable.",
        ),
    ] = None,
    operator: Annotated[
        list[str] | None,
        option(
            "O",
            "figure-eight, corridor, slalom, docking, wander, mixed (unless given), inputs:FILE.csv, or "
            "MODULE:NAME of your own; of control, tracker and move-and-wait (both unless given), or MODULE:NAME; "
            "repeatable.",
        ),
    ] = None,
    position: Annotated[
        str | None,
        option("P", "What tells the robot where it is: fused (unless given), laser, odometry, truth."),
    ] = None,
    runs: Annotated[
        int | None,
        option(
            "K",
            "Seeds of each, 5 unless given; courses of control, 10; rooms of localization, 30; goals, 100.",
            min=1,
            max=10_000,
        ),
    ] = None,
    starts: Annotated[
        int | None, option("K", "Of localization: starts anywhere, 200 unless given.", min=1, max=10_000)
    ] = None,
    seed: Annotated[int, option("N", "The first seed.", min=0, max=2**32 - 1)] = 0,
    length: Annotated[
        float | None,
        option("S", "For how long the operator drives [s]; 120, of localization 60.", min=2, max=3600),
    ] = None,
    workers: Workers = 2,
    on: On = "",
    resume: Resume = False,
    plan: Annotated[
        bool, option("--plan", "Of sweep: say what would be run and what it would cost, and end.")
    ] = False,
    record: Annotated[
        bool, option("--record", "Keep each run as runs/NAME.mcap in DIR; changes no figure.")
    ] = False,
    attribution: Annotated[
        bool, option("--attribution", "Say how much is due to delay, model, localization and environment.")
    ] = False,
    as_json: Annotated[bool, option("--json", "Write the summary on standard output too.")] = False,
) -> None:
    """Measure path error and time difference of a mobile robot under networks, architectures and operators."""
    from vrs.checks import one_of

    sweep = sweeping(ctx, out, workers, on, resume=resume)
    if what not in ("", SWEEP):
        one_of("experiment", what, (LOCALIZATION, GOALS, CONTROL, SWEEP))
        others: dict[str, object] = {
            "--architecture": architecture, "--transport": transport, "--delay": delay, "--robot": robot,
            "--position": position, "--attribution": attribution, "--record": record, "--plan": plan,
            "--correlation": correlation,
        }  # fmt: skip
        if what != LOCALIZATION:
            others |= {"--length": length, "--starts": starts}
        if what == CONTROL:
            _once("operator", operator or ())
        else:
            others["--operator"] = operator
        refuse(what, others)
        study(what, out, seed, runs, length, starts, operator, sweep, as_json=as_json)
        return
    if what == SWEEP:
        refuse(what, {"--starts": starts, "--attribution": attribution, "--record": record})
    else:
        refuse("the architectures", {"--starts": starts, "--plan": plan})
    runs, length = runs or 5, length or 120.0
    from interfaces.lab.driving.design import delays_of
    from interfaces.lab.driving.operators import operator as make
    from interfaces.lab.driving.output import (
        attributions,
        causes_table,
        drawn,
        pictures,
        rich_table,
        summary,
        write,
    )
    from interfaces.lab.driving.run import measure_recorded, paths
    from interfaces.lab.driving.sweep import attributed, cases
    from interfaces.runs.drive_run import DriveCase, DriveRun, Row
    from interfaces.teleop.architectures import Constants, Transport, controller
    from interfaces.teleop.architectures.compositions import POSITIONS
    from robots.onboard.driving import Posture

    architectures = architecture or ["III", "timeline"]
    transports = [Transport(one_of("transport", t, list(Transport))) for t in transport or ["datagrams"]]
    delays = delays_of(delay or ["thu"], correlation or [])
    robots = [DriveCase(robot=r).robot for r in robot or [USUAL_BASE]]
    operators, position = operator or ["mixed"], one_of("position", position or "fused", POSITIONS)
    combined_of: dict[str, Sequence[object]] = {
        "architecture": architectures, "transport": transports, "delay": delays, "robot": robots,
        "operator": operators,
    }  # fmt: skip
    for what_given, given in combined_of.items():
        _once(what_given, given)
    for name in architectures:
        controller(name, Posture(0.0, 0.0, 0.0), Constants())
    for who in operators:
        make(who, seed, 0.1)
    seeds = range(seed, seed + runs)
    combined = cases(architectures, transports, delays, robots, operators, seeds, length)
    chosen = [replace(case, position=position) for case in combined]
    settings = {
        "architectures": architectures, "transports": [t.value for t in transports], "delays": delays,
        "robots": robots, "operators": operators, "position": position, "runs": runs, "seed": seed,
        "length_s": length,
    }  # fmt: skip
    if what == SWEEP:
        swept(chosen, settings, out, sweep, only_plan=plan, as_json=as_json)
        return
    prepare(out, "runs.csv", "summary.json", "paths.svg", "errors.svg")
    if record:
        prepare(out / "runs")
    files = paths(chosen, out) if record else [None] * len(chosen)
    calls = [(measure_recorded, given) for given in zip(chosen, drawn(chosen), files, strict=True)]
    causes = []
    with sweep as who_works:
        measured: list[tuple[Row, DriveRun | None, str]]
        measured = [row.value for row in _worked(calls, "runs", *who_works)]
        rows, drives, problems = map(list, zip(*measured, strict=True))
        if attribution:
            taken = [(attributed, (case, row.metrics)) for case, row in zip(chosen, rows, strict=True)]
            causes = attributions(chosen, [row.value for row in _worked(taken, "causes", *who_works)])
        found = summary(rows, settings, causes)
        write(rows, found, pictures([drive for drive in drives if drive is not None]), out)
    if any(path is not None and not path.exists() for path in files) and not any(problems):
        problems.append(f"{out / 'runs'} lacks recordings: workers elsewhere write them to their own directory")
    for problem in dict.fromkeys(filter(None, problems)):
        typer.echo(f"vrs: {problem}", err=True)
    if as_json:
        import json

        typer.echo(json.dumps(found, indent=2, ensure_ascii=False))
        return
    from rich.console import Console

    Console().print(rich_table(rows))
    if causes:
        Console().print(causes_table(causes))
    typer.echo(f"Wrote {out / 'summary.json'}, runs.csv with {len(rows)} runs, and the figures")


def _once(name: str, given: Sequence[object]) -> None:
    """Check that nothing is asked for twice: its runs would count twice in the intervals.

    Raises:
        InvalidValueError: If something is.
    """
    if len(set(given)) < len(given):
        raise InvalidValueError(name, ", ".join(map(str, given)), "named once each")


def _worked(calls: Calls[Any], what: str, workers: Who, finished: FinishedRows) -> list[KeptRow]:
    from interfaces.lab.runner import pooled_rows

    with bars(what) as bar:
        task = bar.add_task(what, total=len(calls), completed=finished.ready(calls))
        return pooled_rows(calls, workers=workers, finished=finished, progress=lambda _: bar.advance(task))
