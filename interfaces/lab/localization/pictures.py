"""Pictures of a drive: map, scans where the estimate puts them, estimates with ellipses; errors over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from interfaces.lab.claims import Figure
from interfaces.lab.drawing import BAD, GOOD, INK, MUTED, REAL, VIRTUAL, draw
from interfaces.lab.localization.trial import PostureErrors, Record
from robots.bullet.rooms import Room
from robots.onboard.gsp_map import GspMap
from robots.onboard.localizer import Localizer
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

EACH = 10.0
"""A scan is drawn each so many seconds [s]."""
SCALE = 30.0
"""Ellipses of 95 % are drawn so many times as large: they're of millimetres."""
_TWO_SIGMA = 2.4477
"""Radius of the 95 % ellipse of two degrees of freedom, in deviations."""
COLOURS = (VIRTUAL, "#7b4fa3", GOOD, MUTED, REAL, BAD)


@dataclass(slots=True, eq=False)
class DrawnInstant:
    """An instant that is drawn."""

    time: float
    posture: tuple[float, float, float]
    covariance: Array
    points: Array
    """What was seen, in the world frame as the estimate has it [m], (k, 2)."""


@dataclass(slots=True, eq=False)
class DrawnDrive:
    """A drive to be drawn."""

    room: Room
    plan: GspMap
    built: GspMap
    record: Record | None = None
    looks: list[DrawnInstant] = field(default_factory=list)

    def look(self, t: float, localizer: Localizer) -> None:
        """Note what a localizer says at a time [s], each so often."""
        tracker = localizer.tracker
        if tracker is None or tracker.points is None or t < EACH * (len(self.looks) + 0.5):
            return
        x, y, theta = tracker.seen_from
        c, s = math.cos(theta), math.sin(theta)
        points = tracker.points.places @ np.array([[c, s], [-s, c]]) + (x, y)
        self.looks.append(DrawnInstant(t, tracker.seen_from, np.array(tracker.covariance), points))


def scenes(given: Sequence[DrawnDrive]) -> list[Figure]:
    """Pictures of the first scene, if there's one."""
    if not given or given[0].record is None:
        return []
    scene, record = given[0], given[0].record
    what = f"{scene.room.name}, ellipses {SCALE:g} times as large"
    height = 7.2 * scene.room.width / scene.room.length
    return [
        draw(
            "localization_map", f"Map, scans and estimates: {what}", lambda c: _map(c, scene, record), height=height
        ),
        draw("localization_errors", "Errors over time", lambda c: _errors(c, record), height=4.2),
    ]


def _lines(ax: Axes, known: GspMap, colour: str, label: str, width: float) -> None:
    for k, end in enumerate(known.lines.ends):
        ax.plot(end[:, 0], end[:, 1], color=colour, linewidth=width, label=label if k == 0 else None)


def _map(canvas: Canvas, scene: DrawnDrive, record: Record) -> None:
    ax = canvas.subplots()
    ax.grid(False)
    _lines(ax, scene.plan, INK, "floor-plan map", 2.4)
    _lines(ax, scene.built, GOOD, "map built from a drive", 1.2)
    points = np.concatenate([look.points for look in scene.looks]) if scene.looks else np.zeros((0, 2))
    ax.plot(points[:, 0], points[:, 1], ".", color=VIRTUAL, markersize=1.2, alpha=0.5, label="scans")
    ax.plot(record.truth[:, 0], record.truth[:, 1], color=REAL, linewidth=1.0, label="true way")
    for k, look in enumerate(scene.looks):
        ring = _ellipse(look)
        ax.plot(ring[:, 0], ring[:, 1], color=BAD, linewidth=1.0, label="estimate, 95 %" if k == 0 else None)
        x, y, theta = look.posture
        ax.plot([x, x + 0.25 * math.cos(theta)], [y, y + 0.25 * math.sin(theta)], color=BAD, linewidth=1.0)
    ax.set_aspect("equal")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")
    canvas.legend(loc="outside upper center", ncols=5, fontsize=8.0, labelcolor=INK)


def _ellipse(look: DrawnInstant) -> Array:
    values, vectors = np.linalg.eigh(look.covariance[:2, :2])
    turn = np.linspace(0, math.tau, 49)
    ring = np.column_stack([np.cos(turn), np.sin(turn)]) * np.sqrt(np.maximum(values, 0.0)) * _TWO_SIGMA * SCALE
    return np.asarray(ring @ vectors.T + look.posture[:2])


def _errors(canvas: Canvas, record: Record) -> None:
    upper, lower = canvas.subplots(2, 1, sharex=True)
    for colour, (name, track) in zip(COLOURS, record.tracks.items(), strict=False):
        upper.plot(record.t, 100 * np.maximum(track.place, 1e-6), color=colour, linewidth=0.9, label=name)
        lower.plot(record.t, np.degrees(np.maximum(track.turn, 1e-7)), color=colour, linewidth=0.9)
    first = next(iter(record.tracks.values()))
    _bound(upper, record, first, (0, 1), 100.0)
    _bound(lower, record, first, (2,), math.degrees(1.0))
    for ax, what, low, bar in ((upper, "position [cm]", 0.01, 1.0), (lower, "heading [deg]", 0.003, 0.3)):
        ax.set_yscale("log")
        ax.set_ylim(bottom=low)
        ax.axhline(bar, color=INK, linewidth=0.7, linestyle=":")
        ax.set_ylabel(what)
    lower.set_xlabel("time [s]")
    canvas.legend(loc="outside upper center", ncols=5, fontsize=8.0, labelcolor=INK)


def _bound(ax: Axes, record: Record, track: PostureErrors, of: tuple[int, ...], scale: float) -> None:
    """Two deviations of what the first one says."""
    variance = sum(track.covariances[:, k, k] for k in of)
    ax.fill_between(record.t, 1e-4, 2 * scale * np.sqrt(variance), color=VIRTUAL, alpha=0.12, linewidth=0)
