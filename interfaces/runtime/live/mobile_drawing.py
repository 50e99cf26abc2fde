"""Draws a mobile robot's operator site for those who look: both robots, their ways, and what's committed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from interfaces.messages.drive_sites import Doing
from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.stream.meshcat.scene import PIECE
from interfaces.teleop.operator import OperatorSite
from interfaces.teleop.virtual_base import VirtualBase
from robots.bullet.rooms import EMPTY, Room
from robots.onboard.driving import Posture
from robots.onboard.routes import Point
from robots.robot import Robot
from vrs.mobile import ArcPiece, ArcTimeline, Grid, wrapped
from vrs.mobile.model import advanced, braking

APART = 0.04
"""Distance between two places of a way that was driven [m]."""
KEPT = 24 * PIECE
"""Places of it that are kept at least."""
SMOOTHED = 0.05
"""A measured posture goes on at the measured speeds for so long, until the next comes [s]."""
ROUTE_SPEED: Final = 0.4
"""At which a route is drawn [m/s]: marks lie half a second apart."""
_CORNER: Final = 1e-3
"""So long it takes to turn at a corner of it [s]."""
NOISE: Final = (0.003, 0.005)
"""A real robot that's measured nearer than this to where it's shown stays there [m, rad]: nothing is drawn anew."""


def route_timeline(route: Sequence[Point]) -> ArcTimeline:
    """A route as a path: straight from point to point at one speed, as if it turned at once.

    Args:
        route: Two points or more [m].
    """
    drives: list[ArcPiece] = []
    first = theta = math.atan2(route[1][1] - route[0][1], route[1][0] - route[0][0])
    for a, b in pairwise(route):
        if math.dist(a, b) > 0:
            aim = math.atan2(b[1] - a[1], b[0] - a[0])
            drives.append(ArcPiece(_CORNER, 0.0, wrapped(aim - theta) / _CORNER, 0))
            drives.append(ArcPiece(math.dist(a, b) / ROUTE_SPEED, ROUTE_SPEED, 0.0, 0))
            theta = aim
    return ArcTimeline((*route[0], first)).edited(0.0, drives)


class _DrivenTrace:
    """Where a robot drove in this drive."""

    def __init__(self) -> None:
        self.places: list[tuple[float, float]] = []

    def go(self, posture: Posture) -> None:
        place = posture.x, posture.y
        if not self.places or math.dist(place, self.places[-1]) >= APART:
            self.places.append(place)
        if len(self.places) >= KEPT + PIECE:
            del self.places[:PIECE]


def reality(operator: OperatorSite[VirtualBase], now: float) -> tuple[tuple[float, float, float], float] | None:
    """Where the real robot is, and the time in its room, as far as is known; None before its first report.

    Args:
        operator: What has heard of it.
        now: Session time [s].

    Returns:
        x, y [m], θ [rad], and a time [s].
    """
    report = operator.report
    if report is None:
        return None
    posture = advanced(report.posture, *report.drive, min(now - operator.heard, SMOOTHED))
    world = 0.0 if report.world is None else report.world + max(0.0, now - report.measured_at)
    return posture, world


class MobileDrawing:
    """Draws an operator's site."""

    def __init__(self, robot: Robot, start: Posture, room: Room, grid: Grid) -> None:
        """Make the scene.

        Args:
            robot: A mobile robot.
            start: Where both stand at first.
            room: Where they drive.
            grid: Cells of the virtual environment.
        """
        self._model = robot.base
        self.scene = TwinScene(robot, start, room=None if room is EMPTY else room, grid=grid)
        """What all viewers see, once it's dressed."""
        self._ways: dict[str, _DrivenTrace] = {}
        self._drive = -1
        self._route: tuple[tuple[Point, ...], ArcTimeline] | None = None
        self._committed: tuple[int, ArcTimeline] | None = None
        self._real: tuple[float, float, float] | None = None

    def follow(self, operator: OperatorSite[VirtualBase]) -> None:
        """Note where both robots are; to be called also while nobody looks."""
        if operator.robot.epochs != self._drive:
            self._drive, self._ways = operator.robot.epochs, {"virtual": _DrivenTrace(), "real": _DrivenTrace()}
        if not operator.halted:
            self._ways["virtual"].go(operator.robot.architecture.posture)
            if operator.robot.deviation is not None and operator.report is not None:
                self._ways["real"].go(operator.report.posture)

    def show(self, operator: OperatorSite[VirtualBase], *, now: float) -> None:
        """Show everything as it is at session time now [s]."""
        known = reality(operator, now)
        if known is not None:
            self._measure(known[0])
        committed = self._to_goal(operator)
        if not operator.halted and operator.robot.deviation is not None:
            committed = Committed(self._to_rest(operator), operator.robot.path.place)
        around = operator.robot.architecture.surroundings
        self.scene.show(
            virtual=np.array(operator.robot.virtual(now)),
            real=None if self._real is None else np.array(self._real),
            path=committed,
            driven={twin: np.array(way.places).reshape(-1, 2) for twin, way in self._ways.items()},
            learned=() if around is None else around.environment.obstacles(operator.robot.next_t),
            t=0.0 if known is None else known[1],
            now=now,
        )

    def _to_goal(self, operator: OperatorSite[VirtualBase]) -> Committed | None:
        """The way that a robot drives by itself, as far as it hasn't driven it; None where there's none."""
        report, tasks = operator.report, operator.robot.tasks
        if report is None or tasks is None or report.doing is Doing.NOTHING or len(tasks.route) < 2:
            return None
        if self._route is None or self._route[0] != tasks.route:
            self._route = tasks.route, route_timeline(tasks.route)
        length = sum(math.dist(a, b) for a, b in pairwise(tasks.route))
        return Committed(self._route[1], max(0.0, length - report.left) / ROUTE_SPEED)

    def _measure(self, posture: tuple[float, float, float]) -> None:
        """Let the real robot be shown where it's measured."""
        shown = self._real
        if shown is None or math.dist(shown[:2], posture[:2]) > NOISE[0] or abs(shown[2] - posture[2]) > NOISE[1]:
            self._real = posture

    def _to_rest(self, operator: OperatorSite[VirtualBase]) -> ArcTimeline:
        """The virtual robot's path, and how it'd brake from there: what the real one is to follow."""
        known, robot = self._committed, operator.robot
        if known is None or known[0] != robot.steps:
            timeline, T = robot.engine.timeline, self._model.period
            tail = [ArcPiece(T, v, w, 0) for v, w in braking(robot.architecture.before, T, self._model.limits)]
            known = self._committed = robot.steps, timeline.edited(timeline.end, tail) if tail else timeline
        return known[1]
