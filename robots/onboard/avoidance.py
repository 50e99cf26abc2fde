"""Obstacle avoidance on sonar: brakes before what it sees, goes round it where there's room, or else stops.

A reading says that something is somewhere on an arc across the sonar's cone. Such arcs are remembered for a while
as points; a later reading that looks through a point wipes it out. For a curvature, the way until the robot's
outline, with a clearance, touches a point is exact: seen from the robot the point goes round the centre of
rotation. The robot never drives faster than it can brake on that way (the admissible speeds of Fox, Burgard,
Thrun, *The Dynamic Window Approach to Collision Avoidance*, 1997). Where the way that is wanted is too short, the
curvature is taken whose way is long and ends in a direction near the wanted one; where none is, the robot turns on
the spot to the nearest free direction, and where there's none either, it stands. In reverse it only brakes.

`free_ways` says how far a robot gets on curves until its outline touches one of some points. For a curvature the
way is exact: seen from the robot, a point goes round the centre of rotation, and where its circle meets a side of
the outline is known in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robots.onboard.driving import IPR_LIMITS, STAND, Drive, kept
from vrs.checks import finite, validated, within
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, clipped, wrapped
from vrs.mobile.model import all_wrapped, placed
from vrs.model import Array

_STRAIGHT = 1e-4
"""Curvatures of less [1/m] are driven as this one: over a metre it's 0.05 mm beside."""
CREEP = 0.01
"""How much nearer the outline may come to a point that's within the clearance already [m]."""
ROUNDING = 1e-6
"""Lengths that differ by less [m] are taken as equal where points are left out."""


@dataclass(frozen=True, slots=True)
@validated
class Outline:
    """A rectangle round the robot, seen from the middle of its driving axle."""

    front: Annotated[float, within(0.005, 5.0)]
    """[m], in [0.005, 5]."""
    rear: Annotated[float, within(0.005, 5.0)]
    """[m], in [0.005, 5]."""
    half_width: Annotated[float, within(0.005, 5.0)]
    """[m], in [0.005, 5]."""


def free_ways(points: Array, curvatures: Array, outline: Outline, clearance: float, sense: int = 1) -> Array:
    """Ways until an outline touches a point.

    Args:
        points: In the robot's frame [m], (m, 2).
        curvatures: Of the curves [1/m], (n,), to the left positive.
        outline: Of the robot.
        clearance: Distance from it that counts as touching [m]; a point that's within it already may come nearer by
            `CREEP`.
        sense: 1 forward, −1 in reverse.

    Returns:
        For each curvature [m], (n,); infinity where nothing is ever touched.
    """
    if not len(points):
        return np.full(len(curvatures), np.inf)
    x, y = points[:, 0] * sense, points[:, 1]
    front, rear = (outline.front, outline.rear)[::sense]
    half = outline.half_width
    beyond = np.hypot(np.maximum(np.maximum(x - front, -rear - x), 0), np.maximum(np.abs(y) - half, 0))
    if ((beyond <= 0) & (x > 0)).any():
        return np.zeros(len(curvatures))
    margin = np.minimum(clearance, np.maximum(beyond - CREEP, 0))
    k = np.where(np.abs(curvatures) < _STRAIGHT, np.copysign(_STRAIGHT, curvatures), curvatures)
    # A reversing robot goes forward in a mirror, and turns the other way there.
    k = k * sense
    centre = (1 / k)[:, None]
    radius = np.hypot(x, y - centre)
    # Points nearer to the centre of rotation or further from it than any of the outline are never touched.
    inner = np.abs(centre) - half - clearance - ROUNDING
    outer = np.hypot(max(front, rear) + clearance, np.abs(centre) + half + clearance) + ROUNDING
    curve, point = np.nonzero((radius >= inner) & (radius <= outer))
    ways = np.full(len(curvatures), np.inf)
    if not len(curve):
        return ways
    k, centre, radius = k[curve], centre[curve, 0], radius[curve, point]
    x, y, margin = x[point], y[point], margin[point]
    # Front and rear are met at ± an angle, the sides at an angle and what it lacks to π.
    ends = np.stack([front + margin, -rear - margin])
    sides = np.stack([half + margin, -half - margin])
    with np.errstate(invalid="ignore", divide="ignore"):
        across, beside = np.arccos(ends / radius), np.arcsin((sides - centre) / radius)
    solution = np.concatenate([across, -across, beside, math.pi - beside])
    met = np.concatenate([centre + radius * np.sin(solution[:4]), radius * np.cos(solution[4:])])
    low, high = np.repeat([sides[1], ends[1]], 4, axis=0), np.repeat([sides[0], ends[0]], 4, axis=0)
    inside = (met >= low - 1e-9) & (met <= high + 1e-9)
    turned = np.remainder((np.arctan2(y - centre, x) - solution) * np.sign(k), math.tau)
    np.minimum.at(ways, curve, np.where(inside, turned / np.abs(k), np.inf).min(axis=0))
    return ways


_CURVATURES = np.array([0.0, *(s * k for k in (0.2, 0.4, 0.7, 1.0, 1.4, 1.9, 2.5, 3.3, 4.5) for s in (1, -1))])
"""Curvatures to choose from [1/m]."""
_ON_THE_SPOT = 1e3
"""Curvature [1/m] of a turn on the spot: its centre is 1 mm beside the axle's middle."""
_TURNS = np.radians(np.arange(15.0, 181.0, 15.0))
"""Turns on the spot to choose from, either way."""
_SPREAD, _SEEN = 0.85, 0.9
"""Shares of a cone that points are put on, and that are looked through: its edges are its neighbours', too."""
_ROOM = 0.5
"""Share of the look-ahead that's enough to set out."""
_INCHING = 0.02
"""A robot that may drive no faster [m/s] stands: else it would follow the readings' noise."""
_LEAST_WAY = 0.08
"""A way of less [m] isn't worth driving."""


@dataclass(frozen=True, slots=True)
class SonarMount:
    """Where a sonar sits, seen from the middle of the driving axle."""

    x: float
    """[m], forward."""
    y: float
    """[m], left."""
    angle: float
    """Where it looks [rad], from forward to the left."""


Mounts = Annotated[tuple[SonarMount, ...], Meta(min_length=1, max_length=64)]


def seen_from(origins: Array, angles: Array, points: Array) -> tuple[Array, Array]:
    """Distances of points (p, 2) from sonars (k, 2), and how far along where they look, (p, k) each."""
    dx = points[:, :1] - origins[:, 0]
    dy = points[:, 1:] - origins[:, 1]
    return np.sqrt(dx * dx + dy * dy), dx * np.cos(angles) + dy * np.sin(angles)


@dataclass(frozen=True, slots=True)
@validated
class AvoidanceConfig:
    """What the robot is, and how careful."""

    outline: Outline
    mounts: Mounts
    """As many as there are readings, 1 to 64."""
    half_cone: Annotated[float, within(0.0, 0.8)] = math.radians(12.5)
    """Half the sonar's cone [rad], in [0, 0.8]."""
    range_min: Annotated[float, within(0.0, 1.0)] = 0.1
    """Least reading [m], in [0, 1]; what is nearer reads as this."""
    range_max: Annotated[float, within(0.2, 20.0)] = 3.0
    """Readings from here on are of nothing [m], in [0.2, 20]."""
    clearance: Annotated[float, within(0.0, 1.0)] = 0.06
    """Least distance between outline and readings [m], in [0, 1]."""
    lookahead: Annotated[float, within(0.1, 5.0)] = 1.2
    """A free way of this much needn't be left [m], in [0.1, 5]."""
    detour: Annotated[float, within(0.0, 10.0)] = 0.2
    """Speed at which it goes round what is in the way, if it's wanted slower [m/s], in [0, 10]."""
    memory: Annotated[float, within(0.0, 60.0)] = 1.5
    """How long a reading counts [s], in [0, 60]: some readings miss."""
    noise: Annotated[float, within(0.0, 1.0)] = 0.05
    """A reading looks through a point if it's longer by this [m], in [0, 1]."""
    period: Annotated[float, within(1e-3, 1.0)] = 0.05
    """Between two calls [s], in [1e-3, 1]."""
    lag: Annotated[float, within(0.0, 1.0)] = 0.15
    """Of the motors and of the sonar, the longest to be expected [s], in [0, 1]."""
    limits: DriveLimits = IPR_LIMITS
    """Of the robot."""


class ObstacleAvoidance:
    """Changes what the robot is told to drive so that it touches nothing it sees; it knows no clock."""

    def __init__(self, config: AvoidanceConfig) -> None:
        """Remember nothing."""
        self._config = config
        self._mounts = np.array([(m.x, m.y, m.angle) for m in config.mounts], float)
        self._bearings = _SPREAD * np.linspace(-config.half_cone, config.half_cone, 5)
        self._points = np.empty((0, 2))
        self._seen = np.empty(0)
        self._standing = np.empty((0, 2))
        self._curvature = 0.0
        self._side = 0.0
        self.acts = False
        """Whether the last drive isn't what was wanted."""

    def hear(self, ranges: Sequence[float], posture: tuple[float, float, float], *, now: float) -> None:
        """Take in a scan.

        Args:
            ranges: A distance for each sonar, in the order of the mounts [m]; NaN, infinity and what is at
                `range_max` or further say that it heard nothing.
            posture: Where the robot was, (x, y, θ) [m, m, rad].
            now: Time [s].

        Raises:
            InvalidValueError: If the number of readings is wrong.
        """
        config = self._config
        r = np.asarray(ranges, float)
        if r.shape != (len(self._mounts),):
            raise InvalidValueError("ranges", r.shape, f"{len(self._mounts)} distances")
        now = finite("now", now, "finite seconds")
        heard = np.isfinite(r) & (r < config.range_max)
        kept = np.searchsorted(self._seen, now - config.memory)
        points, seen = self._points[kept:], self._seen[kept:]
        if not heard.any():
            self._points, self._seen = points, seen
            return
        origins, angles = placed(self._mounts[:, :2], posture), self._mounts[:, 2] + posture[2]
        if len(points):
            stands = self._stands(points, origins[heard], angles[heard], r[heard])
            points, seen = points[stands], seen[stands]
        distance = np.maximum(r[heard], config.range_min)[:, None]
        bearing = angles[heard][:, None] + self._bearings
        spread = np.stack([distance * np.cos(bearing), distance * np.sin(bearing)], -1) + origins[heard][:, None]
        added = spread.reshape(-1, 2)
        self._points = np.concatenate([points, added])
        self._seen = np.concatenate([seen, np.full(len(added), now)])

    def stand(self, places: Array) -> None:
        """Take in where something stands by what else is known, as a laser or a map: until the next call.

        Args:
            places: In the world frame [m], (k, 2).
        """
        self._standing = places

    def drive(
        self,
        wanted: Drive,
        posture: tuple[float, float, float],
        *,
        now: float,
        towards: float,
        v_before: float,
        left: float = math.inf,
    ) -> Drive:
        """Say what to drive until the next call.

        Args:
            wanted: What would be driven if nothing was in the way.
            posture: Where the robot is, (x, y, θ) [m, m, rad].
            now: Time [s].
            towards: Direction in which the robot should get on [rad], as the field's.
            v_before: Linear speed that it was told to drive last [m/s].
            left: Way after which it's to stand anyway [m]: what is further doesn't matter, as before a dock.

        Returns:
            A drive within the limits.
        """
        points = self._near(posture, now)
        v, w = wanted
        config = self._config
        step = config.limits.a_max * config.period
        if abs(v_before) > step and v * v_before <= 0:
            found = self._brake(v_before)
        elif abs(v) < 1e-6:
            found = self._turn(points, w) if w else STAND
        elif v < 0 or v_before < -step:
            found = self._limited(points, v, w / v if v else 0.0)
        else:
            found = self._ahead(points, v, w, wrapped(towards - posture[2]), v_before, left)
        drive = kept(found.v, found.w, v_before, config.period, config.limits)
        if abs(drive.v) > abs(found.v) + 1e-9 and abs(found.v) > 1e-6:
            # It can't brake as much in a period: it stays on the curve all the same.
            drive = Drive(drive.v, clipped(found.w / found.v * drive.v, config.limits.w_max))
        self.acts = abs(drive.v - v) > 1e-9 or abs(drive.w - w) > 1e-9
        return drive

    def free_way(
        self, posture: tuple[float, float, float], curvature: float, *, now: float, sense: int = 1
    ) -> float:
        """Way [m] on a curve [1/m], forward (1) or in reverse (−1), until the outline and its clearance touch."""
        return float(self._ways(self._near(posture, now), np.array([curvature]), sense)[0])

    def free_ways(self, posture: tuple[float, float, float], v: Array, w: Array, *, now: float) -> Array:
        """Ways [m] on the curves of drives v [m/s], w [rad/s], (n,) each, until outline and clearance touch.

        Drives that only turn have 0: they don't get on.
        """
        points, found = self._near(posture, now), np.zeros(len(v))
        for sense in (1, -1):
            those = v * sense > ROUNDING
            if those.any():
                found[those] = self._ways(points, sense * w[those] / v[those], sense)
        return np.maximum(found - 2 * CREEP, 0.0)

    def slowed(self, wanted: Drive, posture: tuple[float, float, float], *, now: float, v_before: float) -> Drive:
        """Drive a curve, forward or in reverse, or turn, as fast as there's room and no faster than is wanted.

        Args:
            wanted: What it is.
            posture: Where the robot is, (x, y, θ) [m, m, rad].
            now: Time [s].
            v_before: Linear speed that it was told to drive last [m/s].
        """
        points, config = self._near(posture, now), self._config
        self._side = 0.0
        if v_before * wanted.v < 0 and abs(v_before) > config.limits.a_max * config.period:
            return self._brake(v_before)
        if abs(wanted.v) < ROUNDING:
            found = self._turn(points, wanted.w) if wanted.w else STAND
        else:
            found = self._limited(points, wanted.v, wanted.w / wanted.v)
            self._curvature = wanted.w / wanted.v
        return kept(found.v, found.w, v_before, config.period, config.limits)

    def _stands(self, points: Array, origins: Array, angles: Array, ranges: Array) -> NDArray[np.bool_]:
        """Whether no reading sees further than to a point, well inside its cone, (m,)."""
        config = self._config
        distance, along = seen_from(origins, angles, points)
        inside = along >= math.cos(_SEEN * config.half_cone) * distance
        through = (inside & (distance < ranges - config.noise)).any(axis=1)
        return np.asarray(~through)

    def _near(self, posture: tuple[float, float, float], now: float) -> Array:
        """The points that count, in the robot's frame, as far as they matter, (m, 2)."""
        config, outline = self._config, self._config.outline
        size = math.hypot(max(outline.front, outline.rear), outline.half_width) + config.clearance
        # In the order in which they were seen.
        d = self._points[np.searchsorted(self._seen, now - config.memory) :]
        if len(self._standing):
            d = np.concatenate([d, self._standing])
        if not len(d):
            return d
        d = d - posture[:2]
        x, y = d.T
        d = d[x * x + y * y < (size + config.lookahead + 0.5) ** 2]
        cos, sin = math.cos(posture[2]), math.sin(posture[2])
        local: Array = d @ np.array([[cos, -sin], [sin, cos]])
        return local

    def _ways(self, points: Array, curvatures: Array, sense: int = 1) -> Array:
        """Ways until the outline touches a point, for each curvature, (n,) [m]; infinity where it never does."""
        return free_ways(points, curvatures, self._config.outline, self._config.clearance, sense)

    def _straight_ways(self, points: Array, turns: Array) -> Array:
        """Ways straight ahead after turns on the spot [rad], (n,) [m]."""
        config, outline = self._config, self._config.outline
        cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
        x = cos * points[:, 0] + sin * points[:, 1]
        beside = np.abs(cos * points[:, 1] - sin * points[:, 0])
        ahead = (beside <= outline.half_width + config.clearance) & (x > 0)
        reach = np.where(ahead, x, np.inf).min(axis=1, initial=np.inf)
        ways: Array = reach - outline.front - config.clearance
        return ways

    def _speed(self, way: float) -> float:
        config = self._config
        return config.limits.braking_speed(way - 2 * CREEP, config.period + config.lag)

    def _limited(self, points: Array, v: float, curvature: float) -> Drive:
        """The same curve, slower if need be."""
        sense = 1 if v > 0 else -1
        way = float(self._ways(points, np.array([curvature * sense]), sense)[0])
        speed = min(abs(v), self._speed(way))
        if speed < min(_INCHING, abs(v)):
            speed = 0.0
        return Drive(sense * speed, curvature * sense * speed)

    def _brake(self, v_before: float) -> Drive:
        speed = max(abs(v_before) - self._config.limits.a_max * self._config.period, 0.0)
        return Drive(math.copysign(speed, v_before), self._curvature * speed)

    def _turn(self, points: Array, w: float) -> Drive:
        """A turn on the spot, as far as there's room."""
        k = math.copysign(_ON_THE_SPOT, w)
        angle = float(self._ways(points, np.array([k]))[0]) * _ON_THE_SPOT
        most = angle / (2 * (self._config.period + self._config.lag))
        self._curvature = 0.0
        return Drive(0.0, clipped(w, most)) if most > 0.02 else STAND

    def _ahead(self, points: Array, v: float, w: float, towards: float, v_before: float, left: float) -> Drive:
        """Forward: the wanted curve if there's room, else another, else a turn, else nothing."""
        config, limits = self._config, self._config.limits
        k_wanted = w / v
        way = float(self._ways(points, np.array([k_wanted]))[0])
        if way >= min(config.lookahead, left + CREEP):
            self._curvature, self._side = k_wanted, 0.0
            speed = min(v, self._speed(way))
            return Drive(speed, k_wanted * speed)
        curvatures = np.append(_CURVATURES, clipped(k_wanted, 8.0))
        ways = self._ways(points, curvatures)
        reach = np.minimum(ways, config.lookahead)
        turned = np.clip(curvatures * reach, -math.pi, math.pi)
        off = np.abs(all_wrapped(turned - towards)) / math.pi
        cost = off + 1.5 * (1 - reach / config.lookahead) + 0.06 * np.abs(curvatures - self._curvature)
        least = max(v_before - limits.a_max * config.period, 0.0)
        # So much is left that the robot's corners have room to turn on the spot where it comes to a stand.
        outline = config.outline
        spare = math.hypot(outline.front, outline.half_width) - outline.front + CREEP
        slow = np.array([self._speed(one - spare) for one in ways.tolist()])
        cost[(slow < least - 1e-9) | (ways < _LEAST_WAY)] = np.inf
        i = int(np.argmin(cost))
        if cost[i] < np.inf and (reach[i] >= _ROOM * config.lookahead or slow[i] > CREEP):
            self._curvature, self._side = float(curvatures[i]), 0.0
            bend = limits.w_max / max(abs(self._curvature), 1e-6)
            speed = min(max(v, config.detour), float(slow[i]), max(bend, least))
            return Drive(speed, self._curvature * speed)
        if v_before > limits.a_max * config.period:
            return self._brake(v_before)
        return self._look_for_room(points, towards)

    def _look_for_room(self, points: Array, towards: float) -> Drive:
        """Turn on the spot to the nearest direction with room, and keep to the side until there's one ahead."""
        best, side = math.inf, 0.0
        rooms = self._ways(points, np.array([_ON_THE_SPOT, -_ON_THE_SPOT])) * _ON_THE_SPOT
        for sign, room in zip((1.0, -1.0), rooms.tolist(), strict=True):
            if self._side not in (0.0, sign):
                continue
            turns = sign * _TURNS[room >= _TURNS]
            ways = self._straight_ways(points, turns)
            free = turns[ways >= _ROOM * self._config.lookahead]
            if len(free):
                off = abs(float(free[0])) + 0.5 * abs(wrapped(float(free[0]) - towards))
                if off < best:
                    best, side = off, sign
        if side == 0.0:
            self._side = 0.0
            return STAND
        self._side = side
        return self._turn(points, side * 0.7 * self._config.limits.w_max)
