"""Robots that lack one thing that ours has: what claims about goals are held against."""

from __future__ import annotations

from functools import partial
from typing import Final

from numpy.typing import ArrayLike
from typing_extensions import override

from interfaces.lab.goals.trial import Aboard
from robots.mobile.position import OdometryPosition
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import JourneyConfig
from robots.onboard.laser import LaserScan
from robots.onboard.navigator import Navigator
from robots.onboard.routes import Bools, NoRoute, Point, Route, RouteMap
from vrs.model import Array


class HeedlessNavigator(Navigator):
    """Drives the ways of the map, and neither sees nor avoids what is on them."""

    @override
    def see(self, scan: LaserScan, posture: Posture) -> None:
        """Take no notice."""

    @override
    def hear(self, ranges: Array, posture: Posture, *, time: float, now: float) -> None:
        """Take no notice."""

    @override
    def drive(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        return self.journey.control(posture, now=now, v_before=v_before)


class StraightWays(RouteMap):
    """Goes straight to the goal, whatever the map has in between."""

    @override
    def route(self, start: Point, goal: Point, *, blocked: ArrayLike = ()) -> Route | NoRoute:
        return Route((start, goal))


class MappedWays(RouteMap):
    """Has the shortest way on the map alone, and no other where something newly stands on it."""

    @override
    def route(self, start: Point, goal: Point, *, blocked: ArrayLike = ()) -> Route | NoRoute:
        return super().route(start, goal)

    @override
    def turns_at(self, places: ArrayLike, *, blocked: ArrayLike = ()) -> Bools:
        return super().turns_at(places)


HEEDLESS: Final = Aboard(navigator=HeedlessNavigator)
"""Without avoidance."""
IMPATIENT: Final = Aboard(navigator=partial(Navigator, journey=JourneyConfig(patience=0.0)))
"""Without waiting."""
STRAIGHT: Final = Aboard(ways=StraightWays)
"""Without ways round what the map has."""
MAPPED: Final = Aboard(ways=MappedWays)
"""Without ways round what it hasn't."""
RECKONED: Final = Aboard(position=OdometryPosition)
"""Without localization."""
