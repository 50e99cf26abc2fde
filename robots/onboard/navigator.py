"""Takes a robot from goal to goal among what its laser and its sonars see: journey, obstacles, people.

    scan ─▶ ObstacleMap ─▶ what stands ─▶ Journey: another route ─▶ ObstacleAvoidance: slower, or it stops
                  └──────▶ what moves ──▶ MoverTracker ─▶ Yielding: out of the way of who comes

The laser sees what is ahead, exactly. Behind it are the sonars: what they hear that neither the map nor the laser
has explained keeps the robot from backing or turning into it, and doesn't block a way.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.onboard.avoidance import AvoidanceConfig, ObstacleAvoidance
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal, Journey, JourneyConfig, JourneyState
from robots.onboard.laser import LaserScan, OdometryTrack
from robots.onboard.movers import MoversConfig, MoverTracker, Yielding, YieldingConfig
from robots.onboard.obstacle_map import ObstacleMap, ObstacleMapConfig
from robots.onboard.routes import RouteMap
from vrs.mobile.environment import Grid
from vrs.mobile.model import all_wrapped, composed
from vrs.model import Array

CELL = 0.05
"""Side of the cells in which obstacles are kept [m]."""
_SPACING = 0.04
"""Between places on outlines of known things [m]."""
_ASTERN = math.radians(95.0)
"""Sonars that look further aside [rad] are behind the laser."""
_EXPLAINED = 0.15
"""An echo is of something known that's so near to where it came from [m]."""
_BODY = 0.45
"""What is so near to the middle of somebody who walks is he [m]."""
_INSIDE = 0.1
"""So far behind its surface one is inside of somebody [m]."""
_AROUND = 4.0
"""Known things further away don't matter to a drive [m]."""


class Navigator:
    """Goals in, drives out; it knows no clock. Odometry, scans and echoes come as they're there."""

    def __init__(
        self,
        roads: RouteMap,
        grid: Grid,
        avoidance: AvoidanceConfig,
        movers: MoversConfig,
        yielding: YieldingConfig,
        journey: JourneyConfig | None = None,
    ) -> None:
        """Stand.

        Args:
            roads: The known ways.
            grid: Cells over the building.
            avoidance: Of what keeps it off what stands; its clearance is smaller than the margins of the routes.
            movers: Of what follows who walks.
            yielding: Of what goes out of their way.
            journey: How it drives to a goal, and how long it tries.
        """
        self._mounts, self._half_cone, self._range_max = avoidance.mounts, avoidance.half_cone, avoidance.range_max
        tolerance = ObstacleMapConfig().tolerance
        self.obstacles = ObstacleMap(grid, lambda places: roads.knows(places, tolerance))
        """What stands there beside the map."""
        self.avoidance = ObstacleAvoidance(avoidance)
        self.movers = MoverTracker(movers)
        """Who walks."""
        self.yielding = Yielding(yielding, self.avoidance)
        self.journey = Journey(roads, self._standing, journey, room=self._room)
        """Its goal, its route, how far it is."""
        self._known = roads.outlines(_SPACING)
        self._odometry = OdometryTrack()
        self._now = -math.inf
        self._seen = self._heard = -math.inf
        angles = np.array([mount.angle for mount in avoidance.mounts])
        self._astern = np.abs(all_wrapped(angles)) > _ASTERN

    def go(self, goal: Goal, posture: Posture, *, now: float) -> JourneyState:
        """Set out for a goal; see `Journey.go`."""
        self._now = now
        return self.journey.go(goal, posture, now=now)

    def reckon(self, odometry: tuple[float, float, float], *, now: float) -> None:
        """Take the odometry's reading, (x, y, θ) [m, m, rad], of now [s]."""
        self._odometry.add(now, odometry)

    def see(self, scan: LaserScan, posture: Posture) -> None:
        """Take in a sweep; one that came before, or that the odometry doesn't cover, is no news.

        Args:
            scan: By the clock of the odometry.
            posture: Where the robot is at the last reading of the odometry.
        """
        if scan.time <= self._seen or not self._odometry.covers(scan.time, scan.end):
            return
        self._seen = scan.time
        self.obstacles.see(scan, self._odometry, posture)
        self.movers.see(self.obstacles.movers, now=self._odometry.time)

    def hear(self, ranges: Array, posture: Posture, *, time: float, now: float) -> None:
        """Take in a scan of the sonars; one that came before is no news.

        Args:
            ranges: A distance for each, in the order of the mounts [m].
            posture: Where the robot is.
            time: When it was taken [s].
            now: Time [s].
        """
        if time <= self._heard:
            return
        self._heard = time
        ranges = np.where(self._astern, ranges, math.inf)
        ranges = np.where(self._is_explained(ranges, posture), math.inf, ranges)
        self.avoidance.hear(ranges.tolist(), posture, now=now)
        self.movers.hear(ranges.tolist(), self._comes_near(ranges, posture).tolist(), posture, now=now)

    def drive(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Say what to drive until the next call; to be called while it stands, too, as people walk.

        Args:
            posture: Where the robot takes itself to be.
            now: Time [s].
            v_before: Linear speed that it was told to drive last [m/s].
        """
        self._now = now
        self.avoidance.stand(self._around(posture))
        wanted = self.journey.control(posture, now=now, v_before=v_before)
        found = self.avoidance.slowed(wanted, posture, now=now, v_before=v_before)
        return self.yielding.drive(found, self.movers.movers(now=now), posture, now=now, v_before=v_before)

    def _standing(self) -> Array:
        """What blocks ways: what stands, without those who walk slowly."""
        places = self.obstacles.standing(self._now)
        for one in self.movers.movers(now=self._now):
            places = places[np.hypot(places[:, 0] - one.x, places[:, 1] - one.y) > _BODY]
        return places

    def _room(self, posture: Posture, curvature: float, sense: int) -> float:
        return self.avoidance.free_way(posture, curvature, now=self._now, sense=sense)

    def _around(self, posture: Posture) -> Array:
        """Where something stands or walks near the robot [m], (k, 2)."""
        places = np.concatenate([self._known, self.obstacles.places()])
        return np.asarray(places[np.abs(places - posture[:2]).max(axis=1) < _AROUND])

    def _comes_near(self, ranges: Array, posture: Posture) -> NDArray[np.bool_]:
        """Which echoes come from where nothing stood before: of something that has come there."""
        found = np.isfinite(ranges)
        half = self._half_cone
        for k in np.flatnonzero(found).tolist():
            mount = self._mounts[k]
            *at, direction = composed(posture, (mount.x, mount.y, mount.angle))
            bearing = direction + np.linspace(-half, half, 5)
            arc = at + (ranges[k] + _INSIDE) * np.column_stack([np.cos(bearing), np.sin(bearing)])
            found[k] = bool(self.obstacles.was_free(arc).all())
        return found

    def _is_explained(self, ranges: Array, posture: Posture) -> NDArray[np.bool_]:
        """Which echoes come from where something is known to be."""
        places = self._around(posture)
        found = np.zeros(len(ranges), bool)
        for k in np.flatnonzero(ranges < self._range_max).tolist():
            mount = self._mounts[k]
            dx, dy = (places - composed(posture, (mount.x, mount.y, mount.angle))[:2]).T
            far = np.hypot(dx, dy)
            aside = np.abs(all_wrapped(np.arctan2(dy, dx) - posture.theta - mount.angle))
            near = np.abs(far - ranges[k]) < _EXPLAINED
            found[k] = bool((near & (aside < self._half_cone + 0.05)).any())
        return found
