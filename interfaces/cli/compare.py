"""`vrs compare`: how far apart the twins of a recording were, from the recording alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.table import Table

ROWS = (
    ("duration_s", "duration", 1.0, "s"),
    ("behind.mean_s", "behind, mean", 1.0, "s"),
    ("behind.max_s", "behind, at most", 1.0, "s"),
    ("messages.delay_mean_s", "message delay, mean", 1.0, "s"),
    ("messages.lost", "messages lost", 1.0, ""),
    ("commands.late", "commands late", 1.0, ""),
    ("commands.corrections", "corrections", 1.0, ""),
    ("lag_timeline_s", "control lag", 1.0, "s"),
    ("errors.timeline_time.tool_rms_m", "tool rms, timeline", 1e3, "mm"),
    ("errors.timeline_time.tool_max_m", "tool max, timeline", 1e3, "mm"),
    ("errors.lag_removed.tool_rms_m", "tool rms, no lag", 1e3, "mm"),
    ("errors.user_time.tool_rms_m", "tool rms, user", 1e3, "mm"),
    ("errors.servo.tool_rms_m", "tool rms, servo", 1e3, "mm"),
    ("path.path_error_mean", "path error, mean", 1e3, "mm"),
    ("path.path_error_max", "path error, max", 1e3, "mm"),
    ("path.time_difference_mean", "time difference, mean", 1.0, "s"),
    ("path.progress", "progress", 1e2, "%"),
)
"""Path in a summary, name, factor and unit (none: a count) of what two recordings are compared by."""


def compare(
    recording: Annotated[Path, typer.Argument(metavar="RUN.mcap", help="A recording.")],
    other: Annotated[Path | None, typer.Argument(metavar="[OTHER.mcap]", help="Another to set beside it.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Write the figures as JSON on standard output.")] = False,
) -> None:
    """Compare the twins of a recording; of a whole one of the laboratory --json is the run's own summary.json."""
    from interfaces.recording.figures import differences
    from interfaces.report.summary import to_json

    first = summary_of(recording)
    if other is None:
        if as_json:
            typer.echo(to_json(first), nl=False)
        else:
            _show(recording, first)
        return
    second = summary_of(other)
    changes = differences(first, second)
    if as_json:
        value = {"first": first, "second": second, "differences": changes}
        typer.echo(json.dumps(value, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False))
    else:
        _show(recording, first)
        _show(other, second)
        _print(_beside(first, second))


def summary_of(path: Path) -> dict[str, Any]:
    """The summary of a recording; what is missing is also told on standard error.

    Raises:
        FormatError: If it's none, or too little is left of it.
    """
    from interfaces.recording.figures import summary
    from interfaces.recording.recording import open_recording

    with open_recording(path) as recording:
        value = summary(recording)
    for line in value.get("missing", ()):
        typer.echo(f"vrs: {path.name}: missing: {line}", err=True)
    return value


def _show(path: Path, summary: dict[str, Any]) -> None:
    from interfaces.cli.demo import tables

    typer.echo(f"{path}: {summary['title']}, {summary['duration_s']:.1f} s")
    tables(summary)


def _print(table: Table) -> None:
    from rich.console import Console

    Console().print(table)


def _beside(first: dict[str, Any], second: dict[str, Any]) -> Table:
    """Figures of two recordings, and by how much the second's are larger."""
    from rich.table import Table

    table = Table(title="Side by side", title_justify="left")
    for name in ("", "first", "second", "difference", ""):
        table.add_column(name, justify="right" if name else "left")
    for path, name, scale, unit in ROWS:
        a, b = _at(first, path), _at(second, path)
        change = None if a is None or b is None else b - a
        table.add_row(name, *(_shown(value, scale, unit) for value in (a, b, change)), unit)
    return table


def _at(summary: dict[str, Any], path: str) -> float | None:
    value: Any = summary
    for name in path.split("."):
        value = value[name]
    return None if value is None else float(value)


def _shown(value: float | None, scale: float, unit: str) -> str:
    """A value in its unit; without one it's a count."""
    if value is None:
        return "undefined"
    return f"{scale * value:z.3f}" if unit else f"{value:z.0f}"
