"""`vrs compare`: how far apart the twins of a recording were, from the recording alone."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from interfaces.cli.options import RecordedRobot, Tip, argument, option, recorded_robot
from interfaces.report.tables import FIGURES, shown, table_of

if TYPE_CHECKING:
    from rich.table import Table

    from interfaces.recording.recording import Recording

ARM_ROWS = (
    ("duration_s", "duration", 1.0, "s"),
    ("gap_s", "not measured", 1.0, "s"),
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
MOBILE_ROWS = (("duration_s", "duration", 1.0, "s"), ("gap_s", "not measured", 1.0, "s"), *FIGURES)
"""The same of a mobile robot's."""
ROWS = {"arm": ARM_ROWS, "mobile": MOBILE_ROWS}
"""By the kind of robot."""


def compare(
    recording: Annotated[Path, argument("RUN.mcap", "A recording.")],
    other: Annotated[Path | None, argument("OTHER.mcap", "Another to set beside it.")] = None,
    name: RecordedRobot = None,
    tip: Tip = "",
    as_json: Annotated[bool, option("--json", "Write the figures as JSON on standard output.")] = False,
) -> None:
    """Say how far apart the twins of a recording were, and why.

    Of a whole recording of an arm, --json is the run's own summary.json. Of two recordings: both, and the
    differences.
    """
    from interfaces.recording.figures import differences
    from interfaces.recording.recording import check_alike, open_recording
    from interfaces.runs.summary import to_json

    robot = recorded_robot(name, tip)
    with ExitStack() as stack:
        paths = [path for path in (recording, other) if path is not None]
        opened = [stack.enter_context(open_recording(path, robot)) for path in paths]
        check_alike(opened)
        kind = opened[0].kind.word
        first, *others = (_summary(one) for one in opened)
    if as_json:
        if not others:
            typer.echo(to_json(first), nl=False)
            return
        value = {"first": first, "second": others[0], "differences": differences(first, others[0])}
        typer.echo(json.dumps(value, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False))
        return
    for path, found in zip((recording, other), (first, *others), strict=False):
        _show(path, kind, found)
    for second in others:
        _print(_beside(kind, first, second))


def _summary(recording: Recording) -> dict[str, Any]:
    """The summary of a recording; what is missing is also told on standard error.

    Raises:
        FormatError: If too little is left of it.
    """
    from interfaces.recording.figures import summary

    value = summary(recording)
    for line in value.get("missing", ()):
        typer.echo(f"vrs: {recording.path.name}: missing: {line}", err=True)
    return value


def _show(path: Path | None, kind: str, summary: dict[str, Any]) -> None:
    typer.echo(f"{path}: {summary['title']}, {summary['duration_s']:.1f} s")
    if kind == "arm":
        from interfaces.cli.demo import tables

        tables(summary)
    else:
        _print(_alone(kind, summary))


def _print(table: Table) -> None:
    from rich.console import Console

    Console().print(table)


def _alone(kind: str, summary: dict[str, Any]) -> Table:
    """The figures of one recording."""
    from rich.table import Table

    table = Table(show_header=False)
    for justify in ("left", "right", "left"):
        table.add_column(justify=justify)
    for path, name, scale, unit in ROWS[kind]:
        table.add_row(name, shown(_at(summary, path), scale, unit), unit)
    return table


def _beside(kind: str, first: dict[str, Any], second: dict[str, Any]) -> Table:
    """Figures of two recordings, and by how much the second's are larger."""
    table = table_of("Side by side", ("", "first", "second", "difference", ""), left=("",))
    for path, name, scale, unit in ROWS[kind]:
        a, b = _at(first, path), _at(second, path)
        change = None if a is None or b is None else b - a
        table.add_row(name, *(shown(value, scale, unit) for value in (a, b, change)), unit)
    return table


def _at(summary: dict[str, Any], path: str) -> float | None:
    value: Any = summary
    for name in path.split("."):
        value = value[name]
    return None if value is None else float(value)
