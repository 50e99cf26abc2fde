"""Lets a journey drive a robot, by the robot's own time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from typing_extensions import override

from robots.onboard.driving import STAND, Drive, Posture
from robots.onboard.journey import GOING, Goal, Journey, JourneyState
from robots.onboard.routes import Point


class Pilot(Protocol):
    """Whatever takes a robot to a goal by itself."""

    @property
    def state(self) -> JourneyState:
        """How far it is."""

    @property
    def reason(self) -> str:
        """Why it waits or has failed."""

    @property
    def goal(self) -> Goal | None:
        """Where to; None before the first."""

    @property
    def route(self) -> tuple[Point, ...]:
        """The way that's being driven [m]."""

    @property
    def left(self) -> float:
        """Of that way [m]."""

    def go(self, goal: Goal, posture: Posture) -> None:
        """Set out for a goal, from where the robot stands."""

    def end(self) -> None:
        """Leave off."""

    def drive(self, posture: Posture, before: Drive) -> Drive:
        """What to drive in the next period, after what was driven before."""


class JourneyPilot(Pilot):
    """A journey by the map alone."""

    def __init__(self, journey: Journey, clock: Callable[[], float]) -> None:
        """Stand.

        Args:
            journey: What finds the way.
            clock: Tells the robot's own time [s].
        """
        self._journey, self._clock = journey, clock

    @property
    @override
    def state(self) -> JourneyState:
        return self._journey.state

    @property
    @override
    def reason(self) -> str:
        return self._journey.reason

    @property
    @override
    def goal(self) -> Goal | None:
        return self._journey.goal

    @property
    @override
    def route(self) -> tuple[Point, ...]:
        route = self._journey.route
        return () if route is None else route.points

    @property
    @override
    def left(self) -> float:
        return self._journey.way_left

    @override
    def go(self, goal: Goal, posture: Posture) -> None:
        self._journey.go(goal, posture, now=self._clock())

    @override
    def end(self) -> None:
        self._journey.end()

    @override
    def drive(self, posture: Posture, before: Drive) -> Drive:
        drive = self._journey.control(posture, now=self._clock(), v_before=before.v)
        return drive if self.state in GOING else STAND
