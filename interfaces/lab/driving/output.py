"""What vrs lab writes: runs.csv, summary.json, pictures; and the table that it shows."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interfaces.lab.claims import Figure
from interfaces.lab.driving.sweep import CAUSES, Group, grouped, paired
from interfaces.lab.output import BAD, REAL, VIRTUAL, csv_of, draw, legend, write_files
from interfaces.lab.statistics import LEVEL, RANGE, Estimate
from interfaces.runs.drive_run import COLUMNS, KEYS, METRICS, DriveCase, DriveRun, Row, cell, values_of
from interfaces.runs.summary import Attribution
from vrs.comparison import PathMatch

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas
    from rich.table import Table as RichTable

MOST = 8
"""Most compositions in a picture."""
ACROSS = 3


def drawn(chosen: Sequence[DriveCase]) -> list[bool]:
    """Which cases are drawn: the first run of each composition under the first network.

    Args:
        chosen: Cases as they are swept.
    """
    alike = [(case.group[2:], case.seed) for case in chosen]
    places = [k for k, one in enumerate(alike) if one == alike[0]][:MOST]
    return [k in places for k in range(len(chosen))]


def pictures(drives: Sequence[DriveRun]) -> list[Figure]:
    """Pictures of the runs of cases that are `drawn`; at least one."""
    first = drives[0].case
    named = {f"{drive.case.architecture}, {drive.case.transport}": drive for drive in drives}
    return of_drives(named, f"{first.robot}, {first.operator}, {first.delay}, seed {first.seed}")


def of_drives(drives: dict[str, DriveRun], what: str) -> list[Figure]:
    """Pictures of runs by the names of their compositions.

    Args:
        drives: One or more.
        what: Is the same in all of them.
    """
    matches = {name: drive.match() for name, drive in drives.items()}
    titles = f"Paths of both robots: {what}", f"Path error and time difference: {what}"
    return [
        draw("paths", titles[0], lambda canvas: _paths(canvas, drives), height=2.5 * _shape(drives)[0]),
        draw("errors", titles[1], lambda canvas: _errors(canvas, matches), height=1.5 * len(drives) + 0.4),
    ]


def _shape(drives: dict[str, DriveRun]) -> tuple[int, int]:
    """Rows and columns of the picture of their paths."""
    across = min(len(drives), ACROSS)
    return math.ceil(len(drives) / across), across


def _paths(canvas: Canvas, drives: dict[str, DriveRun]) -> None:
    grid = canvas.subplots(*_shape(drives), squeeze=False)
    for ax in grid.flat[len(drives) :]:
        ax.set_visible(False)
    for ax, (name, drive) in zip(grid.flat, drives.items(), strict=False):
        ax.plot(drive.real[:, 0], drive.real[:, 1], color=REAL, label="real", linewidth=1.6)
        ax.plot(drive.virtual[:, 0], drive.virtual[:, 1], color=VIRTUAL, label="virtual", linewidth=0.9)
        ax.set_title(name)
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_xlabel("x [m]")
        ax.set_ylabel("y [m]")
    legend(grid.flat[0])


def _errors(canvas: Canvas, matches: dict[str, PathMatch]) -> None:
    grid = canvas.subplots(len(matches), 2, squeeze=False, sharex=True)
    for (left, right), (name, match) in zip(grid, matches.items(), strict=True):
        left.plot(match.t, 100 * match.distance, color=BAD)
        left.set_ylabel("path error [cm]")
        left.set_title(name)
        cells, late = match.time_difference
        when = match.t_leader[(cells / match.s[1]).round().astype(int)] if len(cells) else cells
        right.plot(when, late, color=VIRTUAL)
        right.set_ylabel("time diff. [s]")
        for ax in (left, right):
            ax.set_ylim(bottom=0)
    grid[-1][0].set_xlabel("time [s]")
    grid[-1][1].set_xlabel("time of the virtual robot [s]")


SCHEMA = "vrs-lab/1"
HEADS = {"localization": "locali-\nzation", "environment": "environ-\nment"}
COMPARED = ("path_error_max", "path_error_mean", "time_difference_mean", "speed_error")


def _row(row: Row) -> list[str]:
    return [cell(value) for value in values_of(row)]


def _estimate(found: Estimate | None) -> dict[str, Any] | None:
    """A figure with its interval; `level` only where that isn't 95 %, null of a range."""
    if found is None:
        return None
    value: dict[str, Any] = {name: float(cell(getattr(found, name))) for name in ("value", "low", "high")}
    return value if found.level == LEVEL else value | {"level": found.level}


def attributions(chosen: Sequence[DriveCase], found: Sequence[tuple[Attribution, ...]]) -> list[dict[str, Any]]:
    """What each cause does, means over seeds, an entry a combination and figure, as JSON takes them."""
    groups: dict[tuple[tuple[str, ...], str], list[Attribution]] = {}
    for case, parts in zip(chosen, found, strict=True):
        for one in parts:
            groups.setdefault((case.group, one.measure), []).append(one)
    return [
        {
            **dict(zip(KEYS, key, strict=True)),
            "figure": figure,
            "total": _mean([one.total for one in members]),
            "parts": {cause: _mean([one.parts[k][1] for one in members]) for k, cause in enumerate(CAUSES)},
            "residual": _mean([one.residual for one in members]),
        }
        for (key, figure), members in groups.items()
    ]


def _mean(values: Sequence[float]) -> float:
    return float(cell(math.fsum(values) / len(values)))


def causes_table(causes: Sequence[dict[str, Any]]) -> RichTable:
    """What each cause does, as a table."""
    from rich.table import Table

    table = Table(title="what it is due to, switched off from left to right", title_justify="left")
    for name in ("architecture", "network", "of"):
        table.add_column(name, no_wrap=True)
    for name in ("all", *(HEADS.get(cause, cause) for cause in CAUSES), "rest"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in causes:
        path = one["figure"].startswith("path")
        scale, what = (100, "path, cm") if path else (1, "time, s")
        values = (one["total"], *one["parts"].values(), one["residual"])
        who = f"{one['architecture']}, {one['transport']}"
        # Without a minus before nothing.
        table.add_row(who, one["delay"], what, *(f"{round(scale * value, 2) + 0.0:.2f}" for value in values))
    return table


def summary(rows: Sequence[Row], settings: dict[str, Any], causes: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """The groups and their paired tests, as JSON takes them; the same rows give the same."""
    groups = grouped(rows)
    return {
        "schema": SCHEMA,
        "settings": settings,
        "groups": [_group(group) for group in groups],
        "attribution": list(causes),
        "paired": [
            {
                "metric": metric,
                "first": dict(zip(KEYS, first.key, strict=True)),
                "second": dict(zip(KEYS, second.key, strict=True)),
                "difference": _estimate(found[0]),
                "verdict": found[1],
            }
            for first, second in combinations(groups, 2)
            # The same network, robot and operator.
            if first.key[2:] == second.key[2:]
            for metric in COMPARED
            if (found := paired(first, second, metric)) is not None
        ],
    }


def _group(group: Group) -> dict[str, Any]:
    return {
        **dict(zip(KEYS, group.key, strict=True)),
        "runs": len(group.rows),
        "collisions": sum(row.collisions for row in group.rows),
        "limits_passed": sum(row.limits_passed for row in group.rows),
        "mean": {name: _estimate(group.mean(name)) for name in METRICS},
        "median": {name: _estimate(group.median(name)) for name in METRICS},
        "largest": {name: float(cell(max(found))) if (found := group.values(name)) else None for name in METRICS},
    }


def write(rows: Sequence[Row], found: dict[str, Any], figures: Sequence[Figure], out: Path) -> None:
    """Write runs.csv, summary.json and the pictures into an existing directory.

    Raises:
        FormatError: If it can't hold them.
    """
    text = json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False)
    write_files(out, figures, {"runs.csv": csv_of(COLUMNS, map(_row, rows)), "summary.json": text + "\n"})


SHOWN = ("path_error_max", "time_difference_mean", "speed_error")
"""Figures whose intervals the table shows."""


def rich_table(rows: Sequence[Row]) -> RichTable:
    """Medians of the groups with their intervals, and the worst path error."""
    from rich.table import Table

    groups = grouped(rows)
    shown = [group.median(name) for group in groups for name in SHOWN]
    names = sorted({found.name for found in shown if found is not None}, key=lambda name: name == RANGE)
    what = ", ".join(f"({name})" if name == RANGE else f"[{name} interval]" for name in names)
    # What is the same in all rows is said once.
    varying = [k for k in range(len(KEYS)) if len({group.key[k] for group in groups}) > 1 or k == 0]
    same = ", ".join(groups[0].key[k] for k in range(len(KEYS)) if k not in varying)
    title = f"{same}; " if same else ""
    table = Table(
        title=f"{title}medians of {len(groups[0].rows)} runs {what}".replace("[", r"\["),
        title_justify="left",
    )
    for k in varying:
        table.add_column(KEYS[k], no_wrap=True)
    for name in (
        "path error,\nlargest [cm]",
        "worst\n[cm]",
        "time diff.\n[s]",
        "speed err.\n[cm/s]",
        "done\n[%]",
        "hits",
    ):
        table.add_column(name.replace("[", r"\["), justify="right")
    for group in groups:
        (path, late, speed), progress = map(group.median, SHOWN), group.median("progress")
        table.add_row(
            *(group.key[k].rpartition("/")[2] for k in varying),
            _said(path, 100),
            f"{100 * max(group.values('path_error_max')):.1f}",
            _said(late, 1, 2),
            _said(speed, 100),
            "" if progress is None else f"{100 * progress.value:.1f}",
            str(sum(row.collisions for row in group.rows)),
        )
    return table


def _said(found: Estimate | None, scale: float, digits: int = 1) -> str:
    if found is None:
        return ""
    value, low, high = (f"{scale * x:.{digits}f}" for x in found[:3])
    ends = f"({low} to {high})" if found.level is None else f"[{low}, {high}]"
    return f"{value} {ends}".replace("[", r"\[")
