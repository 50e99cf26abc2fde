"""Draws a mobile robot's operator site for those who look: both robots, their ways, and what's committed."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from interfaces.stream.meshcat import Committed, MobileScene
from interfaces.stream.meshcat.driving import PIECE
from interfaces.teleop.driving import DrivingOperator
from robots.bullet.rooms import EMPTY, Room
from robots.onboard.driving import Posture
from vrs.mobile import ArcTimeline, Drive, Grid, MobileModel
from vrs.mobile.kinematics import advanced
from vrs.mobile.limiting import braking

APART = 0.04
"""Distance between two places of a way that was driven [m]."""
KEPT = 24 * PIECE
"""Places of it that are kept at least."""
SMOOTHED = 0.05
"""A measured posture goes on at the measured speeds for so long, until the next comes [s]."""
NOISE: Final = (0.003, 0.005)
"""A real robot that's measured nearer than this to where it's shown stays there [m, rad]: nothing is drawn anew."""


class _Way:
    """Where a robot drove in this drive."""

    def __init__(self) -> None:
        self.places: list[tuple[float, float]] = []

    def go(self, posture: Posture) -> None:
        place = posture.x, posture.y
        if not self.places or math.dist(place, self.places[-1]) >= APART:
            self.places.append(place)
        if len(self.places) >= KEPT + PIECE:
            del self.places[:PIECE]


class MobileDrawing:
    """Draws an operator's site."""

    def __init__(self, model: MobileModel, start: Posture, room: Room, grid: Grid) -> None:
        """Make the scene.

        Args:
            model: The robot.
            start: Where both stand at first.
            room: Where they drive.
            grid: Cells of the virtual environment.
        """
        self._model = model
        self.scene = MobileScene(model, start, room=None if room is EMPTY else room, grid=grid)
        """What all viewers see."""
        self._ways: dict[str, _Way] = {}
        self._drive = -1
        self._committed: tuple[int, ArcTimeline] | None = None
        self._real: tuple[float, float, float] | None = None

    def follow(self, operator: DrivingOperator) -> None:
        """Note where both robots are; to be called also while nobody looks."""
        if operator.epochs != self._drive:
            self._drive, self._ways = operator.epochs, {"virtual": _Way(), "real": _Way()}
        if not operator.halted:
            self._ways["virtual"].go(operator.site.posture)
            if operator.deviation is not None and operator.report is not None:
                self._ways["real"].go(operator.report.posture)

    def show(self, operator: DrivingOperator, *, now: float) -> None:
        """Show everything as it is at session time now [s]."""
        report = operator.report
        age = 0.0 if report is None else max(0.0, now - report.measured_at)
        if report is not None:
            self._measure(advanced(report.posture, *report.drive, min(operator.heard_ago(now), SMOOTHED)))
        committed = None
        if not operator.halted and operator.deviation is not None:
            committed = Committed(self._to_rest(operator), operator.path.place)
        around = operator.site.surroundings
        world = 0.0 if report is None or report.world is None else report.world + age
        self.scene.show(
            virtual=np.array(operator.virtual(now)),
            real=None if self._real is None else np.array(self._real),
            path=committed,
            driven={twin: np.array(way.places).reshape(-1, 2) for twin, way in self._ways.items()},
            learned=() if around is None else around.environment.obstacles(operator.next_t),
            t=world,
            now=now,
        )

    def _measure(self, posture: tuple[float, float, float]) -> None:
        """Let the real robot be shown where it's measured."""
        shown = self._real
        if shown is None or math.dist(shown[:2], posture[:2]) > NOISE[0] or abs(shown[2] - posture[2]) > NOISE[1]:
            self._real = posture

    def _to_rest(self, operator: DrivingOperator) -> ArcTimeline:
        """The virtual robot's path, and how it'd brake from there: what the real one is to follow."""
        known = self._committed
        if known is None or known[0] != operator.steps:
            timeline, T = operator.site.engine.timeline, self._model.period
            steps = braking(operator.site.before, T, self._model.limits)
            tail = [Drive(T, v, w, 0) for v, w in steps]
            known = self._committed = operator.steps, timeline.edited(timeline.end, tail) if tail else timeline
        return known[1]
