"""Maps of trips: what the operator's map has, what it hasn't, where the robot drove."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from interfaces.lab.claims import Figure
from interfaces.lab.drawing import BAD, GOOD, INK, MUTED, REAL, draw
from interfaces.lab.goals.trial import MeasuredTrip
from robots.bullet.rooms import Block, Column, Room

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

DRAWN = 4
"""Trips of each group that are drawn; those that went wrong first."""


def maps(found: Sequence[MeasuredTrip]) -> list[Figure]:
    """A picture of each group's trips."""
    figures = []
    for group in dict.fromkeys(one.group for one in found):
        those = [one for one in found if one.group == group]
        those.sort(key=lambda one: one.trip.arrived and not one.trip.touched)
        shown = those[:DRAWN]
        rows = math.ceil(len(shown) / 2)
        title = f"Trips: {group}"
        figures.append(draw(f"goals_{group}", title, lambda c, s=shown: _maps(c, s), height=3.4 * rows))  # type: ignore[misc]
    return figures


def _maps(canvas: Canvas, found: Sequence[MeasuredTrip]) -> None:
    axes = np.ravel(canvas.subplots(math.ceil(len(found) / 2), min(len(found), 2), squeeze=False))
    for ax, one in zip(axes, found, strict=False):
        draw_trip(ax, one)
    for ax in axes[len(found) :]:
        ax.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside upper center", ncols=5, fontsize=8.0, labelcolor=INK)


def draw_trip(ax: Axes, one: MeasuredTrip) -> None:
    """Draw the room and the way that was driven in it."""
    trip, goal = one.trip, one.setting.goal
    draw_room(ax, one.setting.room)
    ax.plot(trip.track[:, 0], trip.track[:, 1], color=REAL, linewidth=1.4, label="driven")
    ax.plot(*one.setting.start[:2], "o", color=GOOD, markersize=4, label="start")
    ax.plot(goal.x, goal.y, "x", color=BAD, markersize=6, label="goal")
    for touch in trip.touched:
        x, y, _ = trip.track[min(round(touch.time / 0.05), len(trip.track) - 1)]
        ax.plot(x, y, "*", color=BAD, markersize=8)
    ax.set_title(f"{one.setting.room.name}: {trip.state}, {trip.way:.1f} m, {trip.time:.0f} s", fontsize=8.0)


def draw_room(ax: Axes, room: Room) -> None:
    """Draw what stands in a room; doors as they are at first."""
    from matplotlib.patches import Polygon

    ax.grid(False)
    ax.set_aspect("equal")
    for thing in (*room.things, *(door.at(0.0) for door in room.doors)):
        fill = MUTED if thing.known else "none"
        ax.add_patch(Polygon(_ring(thing), closed=True, facecolor=fill, edgecolor=MUTED, linewidth=0.8))
    for person in room.people:
        x, y = np.array(person.places).T
        ax.plot(x, y, color=MUTED, linewidth=0.6, linestyle=":")
    ax.set_xlim(-0.1, room.length + 0.1)
    ax.set_ylim(-0.1, room.width + 0.1)


def _ring(thing: Block | Column) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    if isinstance(thing, Column):
        turn = np.linspace(0.0, math.tau, 33)
        return np.column_stack([thing.x + thing.radius * np.cos(turn), thing.y + thing.radius * np.sin(turn)])
    c, s = math.cos(thing.angle), math.sin(thing.angle)
    half = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (thing.length, thing.width)
    return np.asarray(half @ np.array([[c, s], [-s, c]]) + (thing.x, thing.y))
