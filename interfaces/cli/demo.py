"""`vrs demo`: both twins over an emulated internet, and a report of how far apart they were and why."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from interfaces.cli.options import BodyName, Delay, Offset, Order, Out, RobotName, Seed, Tip, bars, option, robot_of
from interfaces.system import written
from robots.robot import USUAL
from vrs.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable

    from interfaces.link import DelayProfile
    from interfaces.recording.run_recorders import RunRecorder
    from interfaces.runs.summary import Measures, OffsetOutcome
    from interfaces.runs.twin_run import TwinRun
    from interfaces.runtime.plan import RunPlan
    from robots.robot import Robot

ADAPTIVE = "adaptive"
DEFAULT_DELAY = "thu"
RECORDING = "run.mcap"
"""Name of a run's recording."""
RESULTS = ("report.html", "summary.json", RECORDING)
"""What a run leaves."""
NO_ROOM = "can't hold the results"
"""What is wrong with a directory."""
DEFAULT_SEED = 6
"""With it the default link stalls four times in mid-motion, so that the report has something to explain."""


def demo(
    commands: Annotated[Path | None, option("FILE", "Plan file, JSON lines; the demo's own without it.")] = None,
    name: RobotName = USUAL,
    tip: Tip = "",
    body: BodyName = "",
    delay: Delay = DEFAULT_DELAY,
    offset: Offset = ADAPTIVE,
    service: Order = "datagram",
    seed: Seed = DEFAULT_SEED,
    out: Out = Path("out"),
    as_json: Annotated[bool, option("--json", "Write the summary as JSON on standard output.")] = False,
) -> None:
    """Run virtual and real robot on one plan across an emulated internet, and compare them."""
    from interfaces.link import Conditions, delay_profile
    from interfaces.recording.run_recorders import RunRecorder
    from interfaces.runs.summary import to_json
    from interfaces.runs.twin_run import fixed_offset
    from interfaces.runtime.plan import default_plan, read_plan

    profile = delay_profile(delay)
    D, order = fixed_offset(offset, profile), Conditions(service=service).service  # type: ignore[arg-type]
    robot = robot_of(name, tip).with_body(body)
    plan = default_plan(robot.arm) if commands is None else read_plan(commands, robot.arm)
    prepare(out, *RESULTS)
    recorder = RunRecorder(out / RECORDING)
    summary = conclude(plan, None, recorder, out, robot, profile, D=D, seed=seed, service=order)
    if as_json:
        typer.echo(to_json(summary), nl=False)
    else:
        show(summary, out, recorded=not recorder.problem)


def prepare(out: Path, *names: str) -> None:
    """Make the directory of the results, before any work is done.

    Args:
        out: The directory.
        names: Of files that will be written there, so that no work is lost in the end.

    Raises:
        FormatError: If it can't be made or written to, or a directory stands where a file is to be.
    """
    with written(out, NO_ROOM):
        out.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=out).close()
    for name in names:
        if (out / name).is_dir():
            raise FormatError(str(out / name), f"{NO_ROOM}: it's a directory, and is to be a file")


def conclude(
    plan: RunPlan,
    run: TwinRun | None,
    recorder: RunRecorder,
    out: Path,
    *where: Any,
    D: float | None,
    **link: Any,
) -> dict[str, Any]:
    """Run a plan under other conditions too, close the recording, and write `report.html` and `summary.json`.

    Why a recording isn't whole is said on standard error.

    Args:
        plan: What the operator does.
        run: The run itself, where it has been made; else the recorder has it.
        recorder: Of the run.
        out: Where the results go.
        *where: Which arm, and the link's delay.
        D: The offset [s]; None adapts it.
        **link: `seed`, and `service`, the order of delivery.

    Returns:
        The summary.

    Raises:
        FormatError: If they can't be written.
    """
    from interfaces.report.html import write_report
    from interfaces.runs.summary import attribute, summarize, to_json

    stages, offsets = _explained(plan, run, recorder, *where, D=D, **link)
    attributions = attribute(tuple(measured for _, measured in stages))
    recorder.finish(attributions, offsets)
    summary = summarize(stages[0][0], attributions, offsets)
    with written(out, NO_ROOM):
        (out / "summary.json").write_text(to_json(summary), encoding="utf-8")
        write_report(out / "report.html", stages[0][0], summary)
    if recorder.problem:
        typer.echo(f"vrs: {recorder.problem}", err=True)
    return summary


def _explained(
    plan: RunPlan,
    run: TwinRun | None,
    recorder: RunRecorder,
    robot: Robot,
    profile: DelayProfile,
    *,
    D: float | None,
    **link: Any,
) -> tuple[list[tuple[TwinRun, Measures]], tuple[OffsetOutcome, ...]]:
    """The run, and runs with ever more causes of error off; and what other offsets make of the network."""
    from interfaces.runs.summary import CAUSES, measures
    from interfaces.runs.twin_run import FIXED, fixed_offset, spelled
    from interfaces.runtime.session import offset_outcome, run_without

    with bars("{task.description}", "{task.percentage:>3.0f}%") as bar:

        def shown(name: str) -> Callable[[float], None]:
            task = bar.add_task(f"{name:30}", total=_length(plan))
            return lambda t: bar.update(task, completed=t, total=max(t, _length(plan)))

        def finished() -> None:
            for task in bar.tasks:
                bar.update(task.id, completed=task.total)

        stages, offsets = [], []
        for off in range(len(CAUSES) + 1):
            made = None if off else run
            if made is None:
                name = f"without {CAUSES[off - 1].replace('_', ' ')}" if off else "both twins"
                causes, keeper = frozenset(CAUSES[:off]), None if off else recorder
                made = run_without(
                    causes, plan, robot, profile, offset=D, progress=shown(name), keeper=keeper, **link
                )
            stages.append((made, measures(made)))
            finished()
        for other in (None, fixed_offset(FIXED, profile) if D is None else D):
            progress = shown(f"offset {spelled(other)}")
            offsets.append(offset_outcome(plan, robot, profile, offset=other, progress=progress, **link))
            finished()
    return stages, tuple(offsets)


def _length(plan: RunPlan) -> float:
    """A guess at how long the run will be [s]; the bar is full at the end, whatever it was."""
    times = (motion.command.execute_at or motion.registered_at for motion in plan.motions)
    return max(times, default=0.0) + 8.0


def show(summary: dict[str, Any], out: Path, *, recorded: bool, err: bool = False) -> None:
    """Show a summary's tables, on standard error if asked for, and where the results are."""
    tables(summary, err=err)
    *names, last = [str(out / name) for name in (RESULTS if recorded else RESULTS[:-1])]
    typer.echo(f"Wrote {', '.join(names)} and {last}", err=err)


def tables(summary: dict[str, Any], *, err: bool = False) -> None:
    """Show a summary's tables, on standard error if asked for."""
    from rich.console import Console

    from interfaces.report.tables import rich_tables

    Console(stderr=err, markup=False).print(*rich_tables(summary), sep="\n")
