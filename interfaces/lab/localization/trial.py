"""One robot driven about in one room: everybody who says where it is hears the same odometry and scans."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from robots.mobile.apartments import ApartmentConfig, apartment
from robots.mobile.chassis import MobileReality, Senses
from robots.mobile.floor_plan import Ways
from robots.mobile.robot import MobileRobot
from robots.onboard.driving import STAND, Drive
from robots.onboard.gsp_map import GspMap, Lines
from robots.onboard.laser import LaserModel, LaserScan
from robots.onboard.localization import PaperLocalizer
from robots.onboard.localizer import Localizer
from robots.onboard.map_building import MapBuilder
from robots.robot import BARE, USUAL_BASE, load
from robots.rooms import Room
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


CONTROL = 0.05
"""Between two drives, and two rows of what is recorded [s]."""
STILL = 3.0
"""So long the robot stands before a drive [s]: as long as it takes to see who is there."""
NOISES = (0.01, 0.02)
"""Of the ranges, in turns [m]."""


class Reckoning:
    """Dead reckoning alone."""

    def __init__(self) -> None:
        """Begin where the odometry begins."""
        self.posture: tuple[float, float, float] | None = None
        """What it says."""

    def move(self, _time: float, reading: tuple[float, float, float]) -> None:
        """Hear the odometry."""
        self.posture = reading

    def see(self, _scan: LaserScan) -> bool:
        """Take no notice of a scan."""
        return True


PostureSource: TypeAlias = Localizer | PaperLocalizer | MapBuilder | Reckoning
"""Whoever says where the robot is."""


@dataclass(frozen=True, slots=True)
class LocalizationSetting:
    """A room and a robot."""

    room: Room
    laser: LaserModel
    reality: MobileReality
    seed: tuple[int, ...]
    """Of noise, slip and where it drives."""


@dataclass(frozen=True, slots=True, eq=False)
class PostureErrors:
    """What somebody said all along."""

    errors: Array
    """Of x, y [m] and heading [rad], (k, 3)."""
    covariances: Array
    """(k, 3, 3); nan if there's none."""

    @property
    def place(self) -> Array:
        """Errors of the position [m], (k,)."""
        return np.hypot(self.errors[:, 0], self.errors[:, 1])

    @property
    def turn(self) -> Array:
        """Errors of the heading [rad], (k,)."""
        return np.abs(self.errors[:, 2])

    @property
    def normalised(self) -> Array:
        """Squared errors in their own deviations, NEES, (k,); nan without a covariance."""
        known = np.isfinite(self.covariances).all(axis=(1, 2))
        found = np.full(len(self.errors), np.nan)
        e, P = self.errors[known], self.covariances[known]
        found[known] = np.einsum("ki,ki->k", e, np.linalg.solve(P, e[:, :, None])[:, :, 0])
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """A drive."""

    t: Array
    """[s], (k,)."""
    truth: Array
    """(x, y, θ) [m, m, rad], (k, 3)."""
    tracks: dict[str, PostureErrors]
    """Of each listener, by name."""
    collisions: int
    """How often the robot or somebody ran into something."""


def furnished(seed: int, number: int, *, rooms: int = 0) -> Room:
    """The number-th room of a study: 0 to 4 people in turns."""
    made = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
    return apartment(made, ApartmentConfig(rooms=rooms, people=number % 5))


def worn(rng: np.random.Generator) -> MobileReality:
    """A robot whose wheels are 1 % wrong, each larger or smaller, and that slips: 0.5 % and 1 % that wanders."""
    right, left = (0.01 * rng.choice([-1.0, 1.0], 2)).tolist()
    return MobileReality(
        radius_error=(right, left), slip=(0.004, 0.006), slip_spread=0.01, slip_time=1.0, dt=1 / 60
    )  # fmt: skip


def setting(room: Room, number: int, sweep: float, seed: tuple[int, ...]) -> LocalizationSetting:
    """A worn robot in a room, its laser with 1 or 2 cm of noise in turns.

    Args:
        room: Where.
        number: Of the room.
        sweep: Of its laser [s].
        seed: Of the robot and the drive.
    """
    reality = worn(np.random.default_rng([*seed, 1]))
    return LocalizationSetting(room, LaserModel(noise=NOISES[number % 2], sweep=sweep), reality, seed)


def body_of(chosen: LocalizationSetting, posture: tuple[float, float, float] | None = None) -> MobileRobot:
    """The robot at a posture, where the room says unless given."""
    senses = Senses(sonar=None, camera=None, laser=chosen.laser)
    rng = np.random.default_rng([*chosen.seed, 2])
    make = load(USUAL_BASE).body(BARE)
    body: MobileRobot = make(posture, room=chosen.room, reality=chosen.reality, rng=rng, senses=senses)
    return body


Driver = Callable[[float, tuple[float, float, float]], Drive]
"""What to do at a time [s] and a true posture."""


def drive(
    body: MobileRobot,
    length: float,
    driver: Driver,
    listeners: Mapping[str, PostureSource],
    hook: Callable[[float], None] = lambda _: None,
) -> Record:
    """Drive about.

    Args:
        body: The robot.
        length: For how long [s].
        driver: Who drives.
        listeners: Who says where the robot is, by name.
        hook: Called at each step with the time [s], after all have heard.
    """
    rows: list[tuple[float, ...]] = []
    said: dict[str, list[tuple[Array, Array]]] = {name: [] for name in listeners}
    steps = round(CONTROL / body.reality.dt)
    for _ in range(round(length / CONTROL)):
        truth = body.truth
        for name, one in listeners.items():
            one.move(body.time, body.reckoned)
            if body.laser is not None:
                one.see(body.laser)
            said[name].append((_error(one.posture, truth), np.array(getattr(one, "covariance", _NONE))))
        rows.append((body.time, *truth))
        hook(body.time)
        told = driver(body.time, truth)
        body.drive(told.v, told.w, steps)
    table = np.array(rows)
    tracks = {
        name: PostureErrors(*(np.array(part) for part in zip(*found, strict=True))) for name, found in said.items()
    }
    return Record(table[:, 0], table[:, 1:], tracks, len(body.collisions))


_NONE = np.full((3, 3), np.nan)


def _error(posture: tuple[float, float, float] | None, truth: tuple[float, float, float]) -> Array:
    if posture is None:
        return np.full(3, np.nan)
    x, y, theta = (a - b for a, b in zip(posture, truth, strict=True))
    return np.array([x, y, math.remainder(theta, math.tau)])


def wander(chosen: LocalizationSetting, *, still: float = 0.0, thorough: bool = False) -> Driver:
    """Somebody who drives about in a setting's room, after so long [s]; or everywhere, if he's thorough."""
    rng = np.random.default_rng([*chosen.seed, 3])
    who = Wanderer(chosen.room, rng, still=still, thorough=thorough)
    return lambda t, posture: who.drive(t, posture, CONTROL)


def as_built(plan: GspMap, rng: np.random.Generator) -> GspMap:
    """The plan with errors as large as it says that it has: what its doubt means."""
    lines = plan.lines
    errors = rng.standard_normal((len(lines), 2)) * np.sqrt(lines.variances)
    poses = lines.poses.copy()
    poses[:, :2] += errors[:, :1] * lines.normals
    poses[:, 2] += errors[:, 1]
    return GspMap.of(plan.name, Lines.of(poses, lines.spans, lines.variances, lines.counts), plan.covariance)
