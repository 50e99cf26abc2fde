"""Pictures of runs like the paper's Figures 11, 12, 15 and 16: paths, path error and time difference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from interfaces.lab.claims import Figure
from interfaces.lab.drawing import BAD, REAL, VIRTUAL, draw, legend
from interfaces.runs.drive_run import DriveCase, DriveRun
from vrs.comparison import PathMatch

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

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
