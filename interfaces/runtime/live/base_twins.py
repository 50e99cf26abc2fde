"""Two mobile robots live: what clients are told of them; drawn with their ways, and what's committed."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np
from typing_extensions import override

from interfaces.engine_server.site import Site
from interfaces.link import LinkConditions
from interfaces.messages.control import MOST_MESSAGES, Attached, Postures
from interfaces.messages.jobs import Doing
from interfaces.messages.sites import DriveReport
from interfaces.runtime.live.twins import LiveTwins
from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.stream.meshcat.scene import PIECE
from interfaces.teleop.architectures import OperatorSurroundings
from interfaces.teleop.architectures.compositions import grid_of, operator_surroundings
from interfaces.teleop.operator import Halt, HaltCause, OperatorSite
from interfaces.teleop.virtual_base import DriveLine, VirtualBase
from robots.onboard.driving import Posture
from robots.onboard.routes import Point
from robots.robot import Robot
from robots.rooms import EMPTY, Room
from vrs.mobile import ArcPiece, ArcTimeline, wrapped
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


class BaseTwins(LiveTwins[VirtualBase]):
    """Two mobile robots in a room."""

    reports = DriveReport
    patience = 6.0

    def __init__(self, robot: Robot, conditions: LinkConditions, seed: int, room: Room) -> None:
        """Make the operator's site at session time 0.

        Args:
            robot: Which mobile robot.
            conditions: Of the way to the real one.
            seed: Of what is random there.
            room: Where both drive.
        """
        start, self._model, self.room = Posture(*room.start), robot.base, room.name
        self._place = room
        virtual = VirtualBase(self._model, start, now=0.0, around=self._around)
        self.operator = OperatorSite(virtual, halted=Halt(HaltCause.NOT_MET))
        self.line: DriveLine = DriveLine(self.operator, conditions, np.random.default_rng(seed))
        self.site = Site(virtual, room=room.name)
        grid = grid_of(room, start)
        self.scene = TwinScene(robot, start, room=None if room is EMPTY else room, grid=grid)
        self._ways: dict[str, _DrivenTrace] = {}
        self._drive = -1
        self._route: tuple[tuple[Point, ...], ArcTimeline] | None = None
        self._committed: tuple[int, ArcTimeline] | None = None
        self._real: tuple[float, float, float] | None = None

    def _around(self, start: Posture) -> OperatorSurroundings | None:
        """What keeps the virtual robot out of the walls that are known."""
        room = self._place
        return None if room is EMPTY else operator_surroundings(room, start, self._model)

    def stand(self, now: float) -> tuple[tuple[float, float, float], float]:
        """Where the real robot is, and the time in its room; where it begins before it's been heard.

        Args:
            now: Session time [s].

        Returns:
            x, y [m], θ [rad], and a time [s].
        """
        operator, report = self.operator, self.operator.report
        if report is None:
            return self._place.start, 0.0
        posture = advanced(report.posture, *report.drive, min(now - operator.heard, SMOOTHED))
        return posture, 0.0 if report.world is None else report.world + max(0.0, now - report.measured_at)

    @property
    @override
    def news(self) -> Hashable:
        return self.operator.report, self.operator.robot.steps

    @property
    @override
    def halted(self) -> str:
        return self.operator.gone if self.operator.cause is HaltCause.BY_ITSELF else super().halted

    @override
    def state(self, number: int, *, connected: bool, now: float) -> Postures:
        operator, virtual, report = self.operator, self.operator.robot, self.operator.report
        driven, drawn = virtual.virtual(now), Posture(*virtual.shown(now=now).tolist())
        real: dict[str, Any] = {}
        if report is not None:
            real = {"t": report.measured_at, "real": report.posture, "drive": report.drive, "D": report.D}
            real |= {"starved": report.starved, "epoch": report.epoch}
        if virtual.deviation is not None and not operator.halted:
            path_error, time_difference = virtual.deviation
            real |= {"path_error": path_error, "time_difference": time_difference}
        return Postures(
            number=number,
            now=now,
            virtual=driven,
            command=virtual.architecture.before,
            estimate=Posture(*virtual.architecture.estimator.posture.tolist()),
            connected=connected,
            halted=self.halted,
            drives=virtual.epochs,
            round_trip=operator.round_trip,
            messages=self.line.messages()[-MOST_MESSAGES:],
            drawn=None if drawn == driven else drawn,
            **real,
        )

    def _follow(self) -> None:
        """Note where both are."""
        operator, virtual = self.operator, self.operator.robot
        if virtual.epochs != self._drive:
            self._drive, self._ways = virtual.epochs, {"virtual": _DrivenTrace(), "real": _DrivenTrace()}
        if not operator.halted:
            self._ways["virtual"].go(virtual.architecture.posture)
            if virtual.deviation is not None and operator.report is not None:
                self._ways["real"].go(operator.report.posture)

    @override
    def draw(self, attached: Attached | None, *, now: float) -> None:
        self.operator.robot.estimating = attached is not None and attached.estimates
        self._follow()
        if not self.scene.readers:
            return
        operator, virtual = self.operator, self.operator.robot
        posture, t = self.stand(now)
        if operator.report is not None:
            self._measure(posture)
        committed = self._to_goal()
        if not operator.halted and virtual.deviation is not None:
            committed = Committed(self._to_rest(), virtual.path.place)
        around = virtual.architecture.surroundings
        self.scene.show(
            virtual=virtual.shown(now=now),
            real=None if self._real is None else np.array(self._real),
            path=committed,
            driven={twin: np.array(way.places).reshape(-1, 2) for twin, way in self._ways.items()},
            learned=() if around is None else around.environment.obstacles(virtual.surrounded_at(now)),
            t=t,
            now=now,
        )

    def _to_goal(self) -> Committed | None:
        """The way that a robot drives by itself, as far as it hasn't driven it; None where there's none."""
        report, tasks = self.operator.report, self.operator.robot.tasks
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

    def _to_rest(self) -> ArcTimeline:
        """The virtual robot's path, and how it'd brake from there: what the real one is to follow."""
        known, virtual = self._committed, self.operator.robot
        if known is None or known[0] != virtual.steps:
            timeline, T = virtual.engine.timeline, self._model.period
            tail = [ArcPiece(T, v, w, 0) for v, w in braking(virtual.architecture.before, T, self._model.limits)]
            known = self._committed = virtual.steps, timeline.edited(timeline.end, tail) if tail else timeline
        return known[1]

    @override
    def freed(self) -> None:
        """A drive ends with its lease."""
        self.operator.halted = Halt(HaltCause.FREE)

    @override
    def health(self, attached: Attached | None) -> dict[str, Any]:
        virtual, report = self.operator.robot, self.operator.report
        path_error, time_difference = virtual.deviation or (None, None)
        return {
            "room": self.room,
            "architecture": "" if attached is None else attached.architecture,
            "drives": virtual.epochs,
            "doing": virtual.doing,
            "D": None if report is None else report.D,
            "path_error": path_error,
            "time_difference": time_difference,
        }
