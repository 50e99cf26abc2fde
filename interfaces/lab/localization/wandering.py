"""Somebody who drives a robot about a room by sight, from place to place, and waits for people."""

from __future__ import annotations

import math

import numpy as np

from robots.bullet.rooms import Room
from robots.ipr.floor_plan import Ways
from robots.onboard.driving import STAND, Drive
from vrs.mobile import clipped, wrapped
from vrs.model import Array

RADIUS = 0.38
"""Kept from things [m]."""
_AHEAD = 0.35
"""So far ahead on the way he aims [m]."""
_CAREFUL = 0.75
"""People who are nearer than this and ahead are waited for [m]; nearer than 0.7 of it, on any side."""
_SOON = (0.0, 0.4, 0.8)
"""So soon they'd be there [s]."""
_CHOICE = 200
"""Places that he chooses from."""
_ASTRAY = 0.8
"""If the way is farther off he looks for another [m]."""
_NO_ROUTE: Array = np.zeros((0, 2))
_LONGEST_WAIT = 6.0
"""Then he goes elsewhere [s]."""


class Wanderer:
    """Drives by the robot's true posture."""

    def __init__(
        self,
        room: Room,
        rng: np.random.Generator,
        *,
        speed: float = 0.4,
        still: float = 0.0,
        thorough: bool = False,
    ) -> None:
        """Take the room.

        Args:
            room: Where he drives.
            rng: What goals are drawn from.
            speed: How fast he goes at most [m/s].
            still: So long he stands first [s].
            thorough: Whether he goes where he wasn't yet, or anywhere.
        """
        self._thorough = thorough
        self._been: list[tuple[float, float]] = []
        self._still = still
        self._room, self._rng, self._speed = room, rng, speed
        self._ways = Ways(room, RADIUS, start=room.start[:2])
        self._places = self._ways.places
        self._route = _NO_ROUTE
        self._at = 0
        self._waiting = 0.0

    def drive(self, t: float, posture: tuple[float, float, float], dt: float) -> Drive:
        """What he does for the next dt seconds at t [s]."""
        x, y, theta = posture
        if t < self._still:
            return STAND
        if self._blocked(t, x, y, theta):
            self._waiting += dt
            if self._waiting > _LONGEST_WAIT:
                self._route, self._waiting = _NO_ROUTE, 0.0
            return STAND
        self._waiting = 0.0
        aim = self._aim(x, y)
        error = wrapped(math.atan2(aim[1] - y, aim[0] - x) - theta)
        turn = clipped(2.0 * error, 0.7)
        if abs(error) > 0.6:
            return Drive(0.0, turn)
        left = math.dist(self._route[-1], (x, y))
        return Drive(min(self._speed * (1 - abs(error) / 0.8), 0.05 + 0.8 * left), turn)

    def _aim(self, x: float, y: float) -> Array:
        """A point ahead on the way; on a new one, if he's there or was carried off."""
        route = self._route
        arrived = len(route) and math.dist(route[-1], (x, y)) < 0.12
        if not len(route) or arrived or math.dist(route[self._at], (x, y)) > _ASTRAY:
            self._route = route = self._ways.route((x, y), self._goal((x, y)))
            self._at = 0
        while self._at < len(route) - 1 and math.dist(route[self._at], (x, y)) < _AHEAD:
            self._at += 1
        return np.asarray(route[self._at])

    def _goal(self, here: tuple[float, float]) -> tuple[float, float]:
        """Where to go next."""
        places = self._places[self._rng.permutation(len(self._places))[:_CHOICE]]
        self._been += [here, *((float(x), float(y)) for x, y in self._route[::10])]
        if self._thorough:
            off = np.linalg.norm(places[:, None] - np.array(self._been), axis=2).min(axis=1)
            places = places[[int(np.argmax(off))]]
        return float(places[0, 0]), float(places[0, 1])

    def _blocked(self, t: float, x: float, y: float, theta: float) -> bool:
        for person in self._room.people:
            for soon in _SOON:
                px, py = person.at(t + soon)
                far = math.dist((px, py), (x, y)) - person.radius
                ahead = abs(wrapped(math.atan2(py - y, px - x) - theta)) < 1.2
                if far < _CAREFUL * (1.0 if ahead else 0.7):
                    return True
        return False
