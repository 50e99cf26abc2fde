"""`vrs demo`: both twins over an emulated internet, and a report of how far apart they were and why."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vrs.errors import FormatError

if TYPE_CHECKING:
    from interfaces.link import DelayProfile
    from interfaces.runtime import TwinRun
    from interfaces.runtime.attribution import Attribution
    from interfaces.runtime.plan import Plan
    from vrs.model import RobotModel

DEFAULT_DELAY = "thu"
DEFAULT_SEED = 6
"""With it the default link delivers four commands too late, so that the report has something to explain."""


def demo(
    commands: Annotated[
        Path | None,
        typer.Option("--commands", metavar="FILE", help="Plan file, JSON lines; the demo's own without it."),
    ] = None,
    delay: Annotated[
        str,
        typer.Option(
            "--delay",
            metavar="PROFILE",
            help="none, constant:S, domain, country, mon, tue, wed, thu, fri, lunar or trace:FILE.csv.",
        ),
    ] = DEFAULT_DELAY,
    seed: Annotated[
        int, typer.Option("--seed", min=0, metavar="N", help="Seed of everything random.")
    ] = DEFAULT_SEED,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Where report.html and summary.json go.")
    ] = Path("out"),
    as_json: Annotated[bool, typer.Option("--json", help="Write the summary as JSON on standard output.")] = False,
) -> None:
    """Run virtual and real robot on one plan across an emulated internet, and compare them."""
    from interfaces.link import delay_profile
    from interfaces.runtime.plan import default_plan, read_plan
    from robots import puma560

    profile = delay_profile(delay)
    model = puma560.model()
    plan = default_plan(model) if commands is None else read_plan(commands, model)
    prepare(out)
    run, attributions = _run(plan, model, profile, seed)
    _finish(run, attributions, out, as_json=as_json)


def prepare(out: Path) -> None:
    """Make the directory of the results, before any work is done.

    Raises:
        FormatError: If it can't be made or written to.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise FormatError(str(out), f"can't hold the results: {error.strerror}") from None


def _run(
    plan: Plan, model: RobotModel, profile: DelayProfile, seed: int
) -> tuple[TwinRun, tuple[Attribution, ...]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    from interfaces.runtime.attribution import CAUSES, attribute, measures, run_without

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        stages = []
        for off in range(len(CAUSES) + 1):
            name = f"without {CAUSES[off - 1].replace('_', ' ')}" if off else "both twins"
            task = bar.add_task(f"{name:30}", total=_length(plan))
            run = run_without(
                frozenset(CAUSES[:off]),
                plan,
                model,
                profile,
                seed=seed,
                progress=lambda t, task=task: bar.update(task, completed=t),  # type: ignore[misc]
            )
            bar.update(task, total=float(run.t[-1]), completed=float(run.t[-1]))
            stages.append((run, measures(run)))
    return stages[0][0], attribute(tuple(measured for _, measured in stages))


def _length(plan: Plan) -> float:
    """A guess at how long the run will be [s]; the bar is corrected at the end."""
    return max(motion.command.execute_at or motion.registered_at for motion in plan.motions) + 8.0


def _finish(run: TwinRun, attributions: tuple[Attribution, ...], out: Path, *, as_json: bool) -> None:
    from interfaces.report.html import write_report
    from interfaces.report.summary import summarize, to_json

    summary = summarize(run, attributions)
    text = to_json(summary)
    try:
        (out / "summary.json").write_text(text, encoding="utf-8")
        write_report(out / "report.html", run, summary)
    except OSError as error:
        raise FormatError(str(out), f"can't hold the results: {error.strerror}") from None
    if as_json:
        typer.echo(text, nl=False)
    else:
        _show(summary, out)


def _show(summary: dict[str, Any], out: Path) -> None:
    from rich.console import Console

    from interfaces.report.tables import attribution_table, error_table, time_lines

    console = Console()
    console.print(error_table(summary))
    if summary["attribution"]:
        console.print(attribution_table(summary))
    for line in time_lines(summary):
        console.print(line, highlight=False)
    typer.echo(f"Wrote {out / 'report.html'} and {out / 'summary.json'}")
