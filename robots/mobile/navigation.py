"""A mobile robot that goes to goals by itself: the ways of its room's plan, and its own senses on board."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from robots.base import Footprint
from robots.mobile.robot import MobileRobot
from robots.onboard.avoidance import AvoidanceConfig, Outline, SonarMount
from robots.onboard.driving import Drive, Posture
from robots.onboard.movers import MoversConfig, YieldingConfig
from robots.onboard.navigator import CELL, Navigator
from robots.onboard.routes import RouteConfig, RouteMap
from robots.rooms import Room
from vrs.mobile import Grid
from vrs.mobile.model import placed
from vrs.model import Array

CLEARANCE = 0.02
"""Between outline and what stands, less than what routes keep [m]."""
_ROUND = 16
"""Corners of a column's outline."""


def outline_of(body: Footprint) -> Outline:
    """The rectangle that a robot fills."""
    half = body.length / 2
    return Outline(half - body.axle_offset, half + body.axle_offset, body.width / 2)


def mounts_of(body: MobileRobot) -> tuple[SonarMount, ...]:
    """Where a robot's sonars sit and look."""
    places, angles = body.sonar_places.tolist(), body.sonar_angles.tolist()
    return tuple(SonarMount(x, y, angle) for (x, y), angle in zip(places, angles, strict=True))


def route_config(body: Footprint) -> RouteConfig:
    """What room a robot needs on its routes."""
    outline = outline_of(body)
    turning = math.hypot(max(outline.front, outline.rear), outline.half_width)
    return RouteConfig(turning, outline.half_width)


def route_map(room: Room, body: Footprint, kind: type[RouteMap] = RouteMap) -> RouteMap:
    """The ways that a robot knows: of a room's plan, as far as that is known."""
    known = room.known()
    things = [*(_corners(b.x, b.y, b.angle, b.length, b.width) for b in known.blocks)]
    out = 1 / math.cos(math.pi / _ROUND)
    turns = np.arange(_ROUND) * math.tau / _ROUND
    ring = out * np.column_stack([np.cos(turns), np.sin(turns)])
    things += [c.radius * ring + (c.x, c.y) for c in known.columns]
    return kind((room.length, room.width), things, route_config(body), via=room.via)


def _corners(x: float, y: float, angle: float, length: float, width: float) -> Array:
    half = 0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]])
    return placed(half, (x, y, angle))


class BodyNavigator:
    """A navigator on a robot's own odometry, laser and sonars."""

    def __init__(
        self,
        body: MobileRobot,
        period: float,
        ways: type[RouteMap] = RouteMap,
        navigator: Callable[..., Navigator] = Navigator,
    ) -> None:
        """Take a robot with a laser scanner and sonars.

        Args:
            body: The robot.
            period: Between two drives [s].
            ways: What finds its ways; another one for comparison.
            navigator: What decides; another one for comparison.
        """
        room = body.room
        shape = math.ceil(room.length / CELL - 1e-9), math.ceil(room.width / CELL - 1e-9)
        roads = route_map(room, body.chassis.footprint, ways)
        outline, (near, far) = outline_of(body.chassis.footprint), body.chassis.sonar_reach
        mounts, sonar = mounts_of(body), body.senses.sonar
        half_cone = 0.0 if sonar is None else sonar.half_angle
        avoidance = AvoidanceConfig(
            outline, mounts, half_cone=half_cone, range_min=near, range_max=far, clearance=CLEARANCE, period=period
        )
        movers = MoversConfig(mounts, half_cone=half_cone)
        self._body = body
        self.navigator = navigator(roads, Grid(shape, CELL), avoidance, movers, YieldingConfig(outline))
        """What decides."""

    def drive(self, posture: Posture, *, v_before: float) -> Drive:
        """Take in what the robot senses now, and say what to drive for a period.

        Args:
            posture: Where it takes itself to be.
            v_before: Linear speed that it was told to drive last [m/s].
        """
        body, one = self._body, self.navigator
        now = body.time
        one.reckon(body.reckoned, now=now)
        if body.laser is not None:
            one.see(body.laser, posture)
        if body.sonar is not None:
            one.hear(body.sonar.ranges, posture, time=body.sonar.time, now=now)
        return one.drive(posture, now=now, v_before=v_before)
