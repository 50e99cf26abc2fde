"""What moves by itself around a robot, from sonar echoes: where it is, how it moves, and how to yield to it.

A sonar knows ranges well and bearings badly, so each thing is followed by a Kalman filter of constant velocity
whose measurements are sharp along the line of sight and wide across it; neighbours' echoes at nearly one range are
one. A thing moves if it does so by more than the filter's own doubt.

Yielding, the robot goes where it's least met in the next seconds. Obstacle avoidance brakes before what stands.
Somebody who walks stops for nobody, and is faster than the robot: one that stands is run into. So the drive that
is wanted, and others on either side, forward and in reverse, are played ahead together with what moves, at
constant velocities. If the wanted one keeps its distance it's driven; else the one that keeps the most. All go
only as far as there's room among what stands.

Source: Fiorini, Shiller, "Motion planning in dynamic environments using velocity obstacles", Int. J. Robotics
Research 17(7), 1998, and the dynamic window of Fox, Burgard, Thrun, 1997; with a few drives tried instead of sets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robots.onboard.avoidance import Mounts, ObstacleAvoidance, Outline
from robots.onboard.driving import IPR_LIMITS, Drive
from vrs.checks import validated, within
from vrs.mobile import DriveLimits, wrapped
from vrs.mobile.model import composed
from vrs.model import Array


@dataclass(frozen=True, slots=True)
@validated
class MoversConfig:
    """How things are followed."""

    mounts: Mounts
    """As many as there are readings, 1 to 64, in order around the robot."""
    half_cone: Annotated[float, within(0.0, 0.8)] = math.radians(12.5)
    """Half the sonar's cone [rad], in [0, 0.8]."""
    radius: Annotated[float, within(0.0, 1.0)] = 0.25
    """Of whatever moves [m], in [0, 1]: a person's."""
    together: Annotated[float, within(0.0, 2.0)] = 0.2
    """Echoes of neighbours that differ by less are of one thing [m], in [0, 2]."""
    range_noise: Annotated[float, within(1e-3, 1.0)] = 0.06
    """Standard deviation along the line of sight [m], in [1e-3, 1]: shapes, more than the sonar."""
    bearing_noise: Annotated[float, within(1e-3, 1.0)] = 0.12
    """Across it [rad], in [1e-3, 1]: half a cone."""
    agility: Annotated[float, within(0.0, 10.0)] = 0.3
    """Standard deviation of a thing's acceleration [m/s²], in [0, 10]."""
    start_speed: Annotated[float, within(0.0, 10.0)] = 0.5
    """And of its speed when it's first seen [m/s], in [0, 10]."""
    gate: Annotated[float, within(0.01, 5.0)] = 0.7
    """An echo further from where a thing is expected is another's [m], in [0.01, 5]."""
    surprise: Annotated[float, within(0.5, 100.0)] = 3.0
    """So is one that's off by more of the filter's own deviations, in [0.5, 100]."""
    memory: Annotated[float, within(0.05, 10.0)] = 1.0
    """What wasn't seen for so long is given up [s], in [0.05, 10]."""
    slowest: Annotated[float, within(0.0, 10.0)] = 0.12
    """What is slower stands [m/s], in [0, 10]."""
    doubt: Annotated[float, within(0.0, 10.0)] = 2.5
    """It moves if its speed is so many deviations, in [0, 10]."""
    least: Annotated[float, within(0.0, 10.0)] = 0.3
    """Nothing is said of what was first seen a shorter time ago [s], in [0, 10]."""
    most: Annotated[int, within(1, 1000)] = 16
    """Most things that are followed, 1 to 1000."""


@dataclass(frozen=True, slots=True)
class Mover:
    """Something that moves by itself."""

    x: float
    """Of its middle [m]."""
    y: float
    vx: float
    """[m/s]."""
    vy: float
    across: float = 0.0
    """Standard deviation of its speed across its way [m/s]."""


@dataclass(slots=True)
class _Thing:
    state: Array
    """x, y, vx, vy."""
    doubt: Array
    """Covariance, (4, 4)."""
    t: float
    seen: float
    begun: float


class MoverTracker:
    """Follows things from scan to scan; it knows no clock."""

    def __init__(self, config: MoversConfig) -> None:
        """Follow nothing yet."""
        self._config = config
        self._mounts = np.array([(m.x, m.y, m.angle) for m in config.mounts], float)
        self._things: list[_Thing] = []

    def hear(
        self, ranges: Sequence[float], new: Sequence[bool], posture: tuple[float, float, float], *, now: float
    ) -> None:
        """Take in a scan.

        Args:
            ranges: A distance for each sonar, in the order of the mounts [m].
            new: Which of them are of something that the known map doesn't have.
            posture: Where the robot was, (x, y, θ) [m, m, rad].
            now: When it was taken [s], not before an earlier one.
        """
        found = []
        for r, bearing, origin in self._groups(ranges, new, posture):
            reach, c, s = r + self._config.radius, math.cos(bearing), math.sin(bearing)
            turn = np.array([[c, -s], [s, c]])
            noise = np.diag([self._config.range_noise**2, (self._config.bearing_noise * reach) ** 2])
            found.append((origin + reach * np.array([c, s]), turn @ noise @ turn.T))
        self._follow(found, now)

    def see(self, middles: Sequence[tuple[float, float]], *, now: float) -> None:
        """Take in what a laser saw.

        Args:
            middles: Of things that may move [m], in the world frame.
            now: When it was seen [s], not before an earlier time.
        """
        noise = self._config.range_noise**2 * np.eye(2)
        self._follow([(np.array(middle), noise) for middle in middles], now)

    def _follow(self, found: Sequence[tuple[Array, Array]], now: float) -> None:
        """Tell things by where they were seen, with what noise, which were known and which are new."""
        config = self._config
        self._things = [thing for thing in self._things if now - thing.seen <= config.memory]
        for thing in self._things:
            self._expect(thing, now)
        free = list(self._things)
        for z, noise in found:
            off = [self._off(thing, z, noise) for thing in free]
            best = int(np.argmin(off)) if off else -1
            if off and off[best] < math.inf:
                self._correct(free.pop(best), z, noise, now)
            elif len(self._things) < config.most:
                doubt = np.zeros((4, 4))
                doubt[:2, :2] = noise
                doubt[2:, 2:] = config.start_speed**2 * np.eye(2)
                self._things.append(_Thing(np.array([*z, 0.0, 0.0]), doubt, now, now, now))

    def movers(self, *, now: float) -> tuple[Mover, ...]:
        """What moves, and where it is now [s]."""
        config, found = self._config, []
        for thing in self._things:
            x, y, vx, vy = thing.state.tolist()
            speed = math.hypot(vx, vy)
            if now - thing.begun < config.least or speed < config.slowest:
                continue
            way = np.array([vx, vy]) / speed
            if speed > config.doubt * math.sqrt(float(way @ thing.doubt[2:, 2:] @ way)):
                dt = now - thing.t
                beside = np.array([-way[1], way[0]])
                across = math.sqrt(max(float(beside @ thing.doubt[2:, 2:] @ beside), 0.0))
                found.append(Mover(x + vx * dt, y + vy * dt, vx, vy, across))
        return tuple(found)

    def _groups(
        self, ranges: Sequence[float], new: Sequence[bool], posture: tuple[float, float, float]
    ) -> list[tuple[float, float, Array]]:
        """Range [m], bearing [rad] and origin [m] of each thing that was heard."""
        groups: list[list[int]] = []
        for k in (k for k, one in enumerate(new) if one):
            if groups and k == groups[-1][-1] + 1 and abs(ranges[k] - ranges[k - 1]) < self._config.together:
                groups[-1].append(k)
            else:
                groups.append([k])
        last = len(self._mounts) - 1
        closes = len(groups) > 1 and groups[0][0] == 0 and groups[-1][-1] == last
        if closes and abs(ranges[0] - ranges[last]) < self._config.together:
            groups = [groups[-1] + groups[0], *groups[1:-1]]
        found = []
        for group in (part for together in groups for part in self._parts(together, ranges)):
            nearest = min(ranges[k] for k in group)
            places = self._mounts[[k for k in group if ranges[k] < nearest + self._config.radius]]
            angle = posture[2] + math.atan2(float(np.sin(places[:, 2]).sum()), float(np.cos(places[:, 2]).sum()))
            mx, my = places[:, :2].mean(axis=0).tolist()
            found.append((nearest, angle, np.array(composed(posture, (mx, my, 0.0))[:2])))
        return found

    def _parts(self, group: Sequence[int], ranges: Sequence[float]) -> list[Sequence[int]]:
        """Echoes side by side, told apart where they're too many for one thing: somebody before a wall."""
        config, parts, rest = self._config, list[Sequence[int]](), [group]
        while rest:
            here = rest.pop()
            middle = min(range(len(here)), key=lambda i: ranges[here[i]])
            r = ranges[here[middle]]
            # The nearest echo's own direction is known by half a cone.
            wide = math.asin(config.radius / max(r + config.radius, 1e-9)) + 2 * config.half_cone
            near = [abs(wrapped(self._angle(k) - self._angle(here[middle]))) <= wide for k in here]
            low, high = near.index(True), len(near) - near[::-1].index(True)
            parts.append(here[low:high])
            rest += [part for part in (here[:low], here[high:]) if part]
        return parts

    def _angle(self, k: int) -> float:
        return float(self._mounts[k, 2])

    def _off(self, thing: _Thing, z: Array, noise: Array) -> float:
        """How far an echo is from where a thing is expected [m]; infinity if it's too far for that thing's."""
        apart = z - thing.state[:2]
        far = math.hypot(*apart.tolist())
        if far >= self._config.gate:
            return math.inf
        deviations = float(apart @ np.linalg.solve(thing.doubt[:2, :2] + noise, apart))
        return far if deviations < self._config.surprise**2 else math.inf

    def _expect(self, thing: _Thing, now: float) -> None:
        dt = now - thing.t
        move = np.eye(4)
        move[0, 2] = move[1, 3] = dt
        q = self._config.agility**2
        grow = np.zeros((4, 4))
        for i in (0, 1):
            grow[i, i], grow[i + 2, i + 2] = q * dt**4 / 4, q * dt * dt
            grow[i, i + 2] = grow[i + 2, i] = q * dt**3 / 2
        thing.state = move @ thing.state
        thing.doubt = move @ thing.doubt @ move.T + grow
        thing.t = now

    @staticmethod
    def _correct(thing: _Thing, z: Array, noise: Array, now: float) -> None:
        gain = thing.doubt[:, :2] @ np.linalg.inv(thing.doubt[:2, :2] + noise)
        thing.state = thing.state + gain @ (z - thing.state[:2])
        thing.doubt = thing.doubt - gain @ thing.doubt[:2]
        thing.seen = now


_MORE = 0.15
"""By so much more than its space [m] the wanted drive must keep before the robot leaves off yielding."""
_KEEP = 0.1
"""So much more distance [m] another drive must promise than the one that was chosen last."""
_SOONER = 0.015
"""What a metre of distance is worth less for each step ahead: what is foreseen far ahead is doubtful."""


@dataclass(frozen=True, slots=True)
@validated
class YieldingConfig:
    """What the robot is, and how far it looks ahead."""

    outline: Outline
    radius: Annotated[float, within(0.0, 1.0)] = 0.25
    """Of whatever moves [m], in [0, 1]."""
    space: Annotated[float, within(0.0, 2.0)] = 0.7
    """Distance that it keeps from it [m], in [0, 2]."""
    doubt: Annotated[float, within(0.0, 10.0)] = 1.5
    """So many deviations to either side of its way it may go, in [0, 10]."""
    horizon: Annotated[float, within(0.2, 20.0)] = 5.0
    """How far ahead it looks [s], in [0.2, 20]."""
    step: Annotated[float, within(0.01, 1.0)] = 0.2
    """Between two places that are looked at [s], in [0.01, 1]."""
    limits: DriveLimits = IPR_LIMITS
    """Of the robot."""


class Yielding:
    """Changes what the robot is told to drive where somebody comes; it knows no clock."""

    def __init__(self, config: YieldingConfig, avoidance: ObstacleAvoidance) -> None:
        """Take what knows where there's room."""
        self._config, self._avoidance = config, avoidance
        limits = config.limits
        self._others = [
            Drive(a * limits.v_max, b * limits.w_max)
            for a in (-1.0, -0.6, 0.0, 0.6, 1.0)
            for b in (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)
        ]
        self._times = np.arange(1, round(config.horizon / config.step) + 1) * config.step
        self._chosen: Drive | None = None
        self.acts = False
        """Whether the last drive isn't what was wanted."""

    def drive(
        self,
        wanted: Drive,
        movers: Sequence[Mover],
        posture: tuple[float, float, float],
        *,
        now: float,
        v_before: float,
    ) -> Drive:
        """Say what to drive until the next call.

        Args:
            wanted: What would be driven if nobody came.
            movers: What moves, where it is now.
            posture: Where the robot is, (x, y, θ) [m, m, rad].
            now: Time [s].
            v_before: Linear speed that it was told to drive last [m/s].
        """
        self.acts = False
        if not movers:
            self._chosen = None
            return wanted
        drives = [wanted, *self._others]
        gaps = self._gaps(drives, movers, posture, now, v_before)
        if gaps[0] >= self._config.space + (_MORE if self._chosen is not None else 0.0):
            self._chosen = None
            return wanted
        worth = np.minimum(gaps, self._config.space + 2 * _MORE)
        if self._chosen is not None:
            worth[drives.index(self._chosen)] += _KEEP
        best = int(np.argmax(worth))
        if worth[best] <= worth[0] + 0.02:
            self._chosen = None
            return wanted
        self._chosen, self.acts = drives[best], True
        return self._avoidance.slowed(drives[best], posture, now=now, v_before=v_before)

    def _supposed(self, mover: Mover) -> list[tuple[float, float]]:
        """How it may move [m/s]: as it's thought to, and to either side as far as that's doubtful."""
        vx, vy = mover.vx, mover.vy
        share = self._config.doubt * mover.across / max(math.hypot(vx, vy), 1e-9)
        return [(vx - side * vy, vy + side * vx) for side in ((0.0, share, -share) if share else (0.0,))]

    def _gaps(
        self,
        drives: Sequence[Drive],
        movers: Sequence[Mover],
        posture: tuple[float, float, float],
        now: float,
        v_before: float,
    ) -> Array:
        """Least distance between outline and movers that each drive leads to [m], (n,)."""
        config, steps = self._config, len(self._times)
        v, w = np.array(drives).T
        ways = self._avoidance.free_ways(posture, v, w, now=now)
        # The speed follows along its ramp; where there's no more room it stands, and doesn't turn.
        t = self._times
        ramp = np.abs(v - v_before) / config.limits.a_max
        grown = np.minimum(t, ramp[:, None])
        s = v[:, None] * t + (v_before - v)[:, None] * (grown - 0.5 * grown**2 / np.maximum(ramp, 1e-9)[:, None])
        turns = np.abs(v) < 1e-9
        s = np.clip(s, -ways[:, None], ways[:, None])
        k = np.where(turns, 0.0, w / np.where(turns, 1.0, v))
        turned = np.where(turns[:, None], w[:, None] * t, k[:, None] * s)
        half = 0.5 * turned
        chord = s * np.sinc(half / math.pi)
        x, y, theta = posture
        px, py, heading = x + chord * np.cos(theta + half), y + chord * np.sin(theta + half), theta + turned
        # Then it stands: who runs away along the way of somebody quicker is only met later.
        last = np.minimum(np.arange(2 * steps), steps - 1)
        px, py, heading = px[:, last], py[:, last], heading[:, last]
        t = config.step * np.arange(1, 2 * steps + 1)
        cos, sin = np.cos(heading), np.sin(heading)
        outline = config.outline
        least = np.full(len(v), np.inf)
        for mover, vx, vy in [(one, *speeds) for one in movers for speeds in self._supposed(one)]:
            dx, dy = mover.x + vx * t - px, mover.y + vy * t - py
            ahead, aside = cos * dx + sin * dy, np.abs(cos * dy - sin * dx)
            beyond = np.hypot(
                np.maximum(np.maximum(ahead - outline.front, -outline.rear - ahead), 0.0),
                np.maximum(aside - outline.half_width, 0.0),
            )
            inside = np.hypot(dx, dy) * 1e-3
            gap = np.where(beyond > 0, beyond, inside - 0.1) - config.radius
            least = np.minimum(least, (gap + _SOONER * np.arange(len(t))).min(axis=1))
        return least
