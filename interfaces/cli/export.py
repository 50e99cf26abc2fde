"""`vrs export`: a recording as CSV, as Parquet, as a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.options import RecordedRobot, Tip, argument, option, recorded_robot
from interfaces.system import written
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from interfaces.recording.recording import Recording


def export(
    recording: Annotated[Path, argument("RUN.mcap", "A recording.")],
    to_csv: Annotated[Path | None, option("--csv DIR", "Write its tables there, as CSV.")] = None,
    to_parquet: Annotated[
        Path | None, option("--parquet DIR", "Write its tables there, as Parquet; needs pyarrow.")
    ] = None,
    to_report: Annotated[Path | None, option("--report FILE.html", "Write its report there.")] = None,
    name: RecordedRobot = None,
    tip: Tip = "",
) -> None:
    """Write a recording as tables (units are in the columns' names), or as the report of its run."""
    from interfaces.recording.export import tables, write_csv, write_parquet
    from interfaces.recording.recording import open_recording

    if to_csv is None and to_parquet is None and to_report is None:
        raise InvalidValueError("export", "nothing", "one or more of --csv DIR, --parquet DIR, --report FILE.html")
    written: list[Path] = []
    with open_recording(recording, recorded_robot(name, tip)) as opened:
        if opened.damage and to_report is None:
            typer.echo(f"vrs: {recording.name}: the recording is damaged: {opened.damage}", err=True)
        found = () if to_csv is None and to_parquet is None else tables(opened)
        if to_csv is not None:
            written += write_csv(found, to_csv)
        if to_parquet is not None:
            written += write_parquet(found, to_parquet)
        if to_report is not None:
            _report(opened, to_report)
            written.append(to_report)
    for path in written:
        typer.echo(f"Wrote {path}")


def _report(recording: Recording, path: Path) -> None:
    from interfaces.report.html import render_recording as render

    text, missing = render(recording)
    for line in missing:
        typer.echo(f"vrs: {recording.path.name}: missing: {line}", err=True)
    with written(path):
        path.write_text(text, encoding="utf-8", newline="\n")
