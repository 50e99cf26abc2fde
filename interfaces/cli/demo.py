"""`vrs demo`: both twins over an emulated internet, and a report of how far apart they were and why."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from interfaces.cli.options import Delay, Offset, Order, Out, RobotName, Seed, option
from robots.robot import USUAL, load
from vrs.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable

    from interfaces.link import DelayProfile, Service
    from interfaces.recording.run_recorders import RunRecorder
    from interfaces.runs.summary import Attribution, OffsetOutcome
    from interfaces.runs.twin_run import TwinRun
    from interfaces.runtime.plan import RunPlan
    from robots.robot import Robot

ADAPTIVE = "adaptive"
DEFAULT_DELAY = "thu"
RECORDING = "run.mcap"
"""Name of a run's recording."""
RESULTS = ("report.html", "summary.json", RECORDING)
"""What a run leaves."""
DEFAULT_SEED = 6
"""With it the default link stalls four times in mid-motion, so that the report has something to explain."""


def demo(
    commands: Annotated[Path | None, option("FILE", "Plan file, JSON lines; the demo's own without it.")] = None,
    name: RobotName = USUAL,
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
    from interfaces.runs.summary import summarize
    from interfaces.runs.twin_run import fixed_offset
    from interfaces.runtime.plan import default_plan, read_plan

    profile = delay_profile(delay)
    D, order = fixed_offset(offset, profile), Conditions(service=service).service  # type: ignore[arg-type]
    robot = load(name)
    plan = default_plan(robot.arm) if commands is None else read_plan(commands, robot.arm)
    prepare(out, *RESULTS)
    recorder = RunRecorder(out / RECORDING)
    run, attributions, offsets = explained(plan, recorder, robot, profile, seed, D, order)
    recorder.finish(attributions, offsets)
    summary = summarize(run, attributions, offsets)
    text = write(summary, run, out)
    complain(recorder)
    if as_json:
        typer.echo(text, nl=False)
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
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise FormatError(str(out), f"can't hold the results: {error.strerror}") from None
    for name in names:
        if (out / name).is_dir():
            raise FormatError(str(out / name), "can't hold the results: it's a directory, and is to be a file")


def complain(recorder: RunRecorder) -> None:
    """Say why a recording isn't whole, where it isn't."""
    if recorder.problem:
        typer.echo(f"vrs: {recorder.problem}", err=True)


def explained(
    plan: RunPlan,
    whole: TwinRun | RunRecorder,
    robot: Robot,
    profile: DelayProfile,
    seed: int,
    D: float | None,
    service: Service,
) -> tuple[TwinRun, tuple[Attribution, ...], tuple[OffsetOutcome, ...]]:
    """Run a plan on both twins, and again under other conditions, for what made them differ.

    Args:
        plan: What the operator does.
        whole: The run itself, where it has been made; else what records it.
        robot: Which arm.
        profile: The link's delay.
        seed: Seed of the link.
        D: The offset [s]; None adapts it.
        service: Order of delivery on the link.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    from interfaces.runs.summary import CAUSES, attribute, measures
    from interfaces.runs.twin_run import FIXED, TwinRun, fixed_offset, spelled
    from interfaces.runtime.session import offset_outcome, run_without

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), redirect_stdout=False) as bar:

        def shown(name: str) -> Callable[[float], None]:
            task = bar.add_task(f"{name:30}", total=_length(plan))
            return lambda t: bar.update(task, completed=t, total=max(t, _length(plan)))

        def finished() -> None:
            for task in bar.tasks:
                bar.update(task.id, completed=task.total)

        stages, offsets = [], []
        for off in range(len(CAUSES) + 1):
            name = f"without {CAUSES[off - 1].replace('_', ' ')}" if off else "both twins"
            causes = frozenset(CAUSES[:off])
            if not off and isinstance(whole, TwinRun):
                run = whole
            else:
                keeper = None if off or isinstance(whole, TwinRun) else whole
                run = run_without(
                    causes, plan, robot, profile,
                    seed=seed, offset=D, service=service, progress=shown(name), keeper=keeper,
                )  # fmt: skip
            stages.append((run, measures(run)))
            finished()
        for other in (None, fixed_offset(FIXED, profile) if D is None else D):
            progress = shown(f"offset {spelled(other)}")
            outcome = offset_outcome(
                plan, robot, profile, seed=seed, offset=other, service=service, progress=progress
            )
            offsets.append(outcome)
            finished()
    return stages[0][0], attribute(tuple(measured for _, measured in stages)), tuple(offsets)


def _length(plan: RunPlan) -> float:
    """A guess at how long the run will be [s]; the bar is full at the end, whatever it was."""
    times = (motion.command.execute_at or motion.registered_at for motion in plan.motions)
    return max(times, default=0.0) + 8.0


def write(summary: dict[str, Any], run: TwinRun, out: Path) -> str:
    """Write `report.html` and `summary.json`; the latter's text.

    Raises:
        FormatError: If they can't be written.
    """
    from interfaces.report.html import write_report
    from interfaces.runs.summary import to_json

    text = to_json(summary)
    try:
        (out / "summary.json").write_text(text, encoding="utf-8")
        write_report(out / "report.html", run, summary)
    except OSError as error:
        raise FormatError(str(out), f"can't hold the results: {error.strerror}") from None
    return text


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
