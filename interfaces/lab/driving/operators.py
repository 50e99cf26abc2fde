"""Who drives: seeded styles along a course, and recorded inputs; they see the virtual robot, and know no delay."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from interfaces.system import checked, is_own, own
from robots.onboard.driving import STAND, Drive, Posture
from vrs.checks import one_of
from vrs.errors import FormatError
from vrs.mobile import clipped, wrapped


@dataclass(frozen=True, slots=True)
class LineLeg:
    """To be pursued."""

    points: tuple[tuple[float, float], ...]
    """Two or more [m]."""
    reverse: bool = False


@dataclass(frozen=True, slots=True)
class TurnLeg:
    """On the spot."""

    heading: float
    """Where to [rad]."""


@dataclass(frozen=True, slots=True)
class PauseLeg:
    """Standing."""

    duration: float
    """[s]."""


@dataclass(frozen=True, slots=True)
class GoalLeg:
    """A place to get to, by whatever way."""

    point: tuple[float, float]
    """[m]."""
    patience: float
    """After so long [s] he gives up, and goes on to the next."""


Leg = LineLeg | TurnLeg | PauseLeg | GoalLeg


def share_of(points: Sequence[tuple[float, float]], i: int, x: float, y: float) -> float:
    """How far a point is along the i-th piece, as a share of it."""
    (ax, ay), (bx, by) = points[i], points[i + 1]
    dx, dy = bx - ax, by - ay
    return ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)


def way_left(points: Sequence[tuple[float, float]], i: int, x: float, y: float) -> float:
    """Way left along the line [m]; only as far as it matters to somebody who brakes."""
    share = min(max(share_of(points, i, x, y), 0.0), 1.0)
    left = (1.0 - share) * math.dist(points[i], points[i + 1])
    for k in range(i + 1, len(points) - 1):
        if left > 1.0:
            break
        left += math.dist(points[k], points[k + 1])
    return left


def point_ahead(
    points: Sequence[tuple[float, float]], i: int, x: float, y: float, distance: float
) -> tuple[float, float]:
    """The point a distance [m] ahead; beyond the end on its last piece's line."""
    share = max(share_of(points, i, x, y), 0.0)
    while True:
        (ax, ay), (bx, by) = points[i], points[i + 1]
        length = math.hypot(bx - ax, by - ay)
        if share * length + distance <= length or i == len(points) - 2:
            share += distance / length
            return ax + share * (bx - ax), ay + share * (by - ay)
        distance -= (1.0 - share) * length
        i, share = i + 1, 0.0


SPEED: Final = (0.22, 0.34)
"""Least and largest cruising speed of a style [m/s]."""
TURN: Final = math.radians(30)
"""Largest angular speed [rad/s]."""
ACCELERATION: Final = 0.36
"""[m/s²]."""
TURN_ACCELERATION: Final = 1.0
"""[rad/s²]."""
LOOK_AHEAD: Final = 0.35
"""How far ahead a driver looks along his line [m]."""
UNSTEADY: Final = 0.03
"""Standard deviation of what his hand adds to the angular speed [rad/s]."""
UNSTEADY_TIME: Final = 0.6
"""Its correlation time [s]."""
_NEAR: Final = 0.02
"""A line ends this near its end [m]."""
_TURNED: Final = math.radians(1)
_THERE: Final = 0.15
"""A goal is reached this near [m]."""
_ASIDE: Final = math.radians(50)
"""A goal further aside is turned to on the spot."""


class Operator(Protocol):
    """Somebody who drives the virtual robot.

    One that has `sees_estimate` set is shown it where the posture estimator moves it; one that has `sees_real` set
    is shown where the real robot was reported last, instead; one that comes to have `finished` set drives no more.
    """

    @property
    def start(self) -> Posture:
        """Where both robots begin."""

    @property
    def room(self) -> str:
        """In which room."""

    def drive(self, t: float, posture: Posture, before: Drive) -> Drive:
        """Say what to drive for the next period.

        Args:
            t: Time since the beginning [s].
            posture: Where the virtual robot is.
            before: What was driven in the last period.
        """


class StyledOperator:
    """Follows legs without end, in the manner that its seed gives it."""

    def __init__(self, start: Posture, room: str, legs: Iterator[Leg], rng: np.random.Generator, T: float) -> None:
        """Begin.

        Args:
            start: Where both robots begin.
            room: In which room.
            legs: Without end.
            rng: What its manner is drawn from.
            T: Period of its commands [s].
        """
        self.start, self.room = start, room
        self._legs, self._rng, self._T = legs, rng, T
        self._cruise = float(rng.uniform(*SPEED))
        self._swing = float(rng.uniform(0.0, 0.25)), float(rng.uniform(6.0, 15.0))
        self._fade = math.exp(-T / UNSTEADY_TIME)
        self._shake = 0.0
        self._leg: Leg = next(legs)
        self._at = 0
        self._begun = 0.0

    def drive(self, t: float, posture: Posture, before: Drive) -> Drive:
        """Return what is driven for the next period, as `Operator` says."""
        wanted = self._wanted(t, posture)
        while wanted is None:
            self._leg, self._at, self._begun = next(self._legs), 0, t
            wanted = self._wanted(t, posture)
        return Drive(
            clipped(wanted.v, ACCELERATION * self._T, before.v),
            clipped(clipped(wanted.w, TURN), TURN_ACCELERATION * self._T, before.w),
        )

    def _wanted(self, t: float, posture: Posture) -> Drive | None:
        """What the leg asks for; None where it's done."""
        leg = self._leg
        if isinstance(leg, PauseLeg):
            return STAND if t - self._begun < leg.duration else None
        if isinstance(leg, TurnLeg):
            error = wrapped(leg.heading - posture.theta)
            if abs(error) < _TURNED:
                return None
            w = min(TURN, math.sqrt(2 * 0.5 * TURN_ACCELERATION * abs(error)), 2.0 * abs(error))
            return Drive(0.0, math.copysign(w, error))
        return self._head_for(leg, t, posture) if isinstance(leg, GoalLeg) else self._pursue(leg, t, posture)

    def _head_for(self, goal: GoalLeg, t: float, posture: Posture) -> Drive | None:
        """Straight on, as far as he knows; on the spot where it's far aside."""
        dx, dy = goal.point[0] - posture.x, goal.point[1] - posture.y
        left = math.hypot(dx, dy)
        if left < _THERE or t - self._begun >= goal.patience:
            return None
        error = wrapped(math.atan2(dy, dx) - posture.theta)
        if abs(error) > _ASIDE:
            return Drive(0.0, math.copysign(TURN, error))
        v = min(self._speed(t), math.sqrt(2 * 0.8 * ACCELERATION * left))
        return Drive(v * (1.0 - abs(error) / math.radians(90)), 1.2 * error + self._shaken(v))

    def _pursue(self, line: LineLeg, t: float, posture: Posture) -> Drive | None:
        points = line.points
        x, y, theta = posture
        # The nearest point of the line, from where it was on.
        while self._at < len(points) - 2 and share_of(points, self._at, x, y) >= 1.0:
            self._at += 1
        left = way_left(points, self._at, x, y)
        if left < _NEAR:
            return None
        aim_x, aim_y = point_ahead(points, self._at, x, y, LOOK_AHEAD)
        heading = theta + math.pi if line.reverse else theta
        alpha = wrapped(math.atan2(aim_y - y, aim_x - x) - heading)
        v = min(self._speed(t) * (0.7 if line.reverse else 1.0), math.sqrt(2 * 0.8 * ACCELERATION * left))
        curvature = 2.0 * math.sin(alpha) / max(math.hypot(aim_x - x, aim_y - y), 0.1)
        v = min(v, 0.8 * TURN / max(abs(curvature), 1e-6)) if abs(alpha) < 1.2 else 0.05
        w = curvature * v + self._shaken(v)
        return Drive(-v if line.reverse else v, w)

    def _speed(self, t: float) -> float:
        share, period = self._swing
        return self._cruise * (1.0 - share * (0.5 + 0.5 * math.sin(math.tau * t / period)))

    def _shaken(self, v: float) -> float:
        """What his hand adds to the angular speed [rad/s]."""
        self._shake = self._fade * self._shake + math.sqrt(1 - self._fade**2) * UNSTEADY * float(
            self._rng.standard_normal()
        )
        return self._shake * min(v / 0.2, 1.0)


def _curve(points: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in points)


def _figure_eight(rng: np.random.Generator) -> tuple[Posture, str, Iterator[Leg]]:
    """Two circles that touch, round and round, through the crossing and back."""
    radius = float(rng.uniform(0.5, 1.0))
    side = 1 if rng.random() < 0.5 else -1

    def legs() -> Iterator[Leg]:
        angle = np.linspace(0.0, math.tau, 73)
        while True:
            first = [(radius * math.sin(a), side * radius * (1 - math.cos(a))) for a in angle]
            second = [(radius * math.sin(a), -side * radius * (1 - math.cos(a))) for a in angle[1:]]
            yield LineLeg(_curve([*first, *second]))

    return Posture(0.0, 0.0, 0.0), "", legs()


def _corridor(rng: np.random.Generator) -> tuple[Posture, str, Iterator[Leg]]:
    """Along a corridor with a corner, to its end; a turn on the spot, and back."""
    side, radius = float(rng.uniform(-0.15, 0.15)), float(rng.uniform(0.6, 1.0))

    def legs() -> Iterator[Leg]:
        angle = np.linspace(0.0, math.pi / 2, 10)
        corner = [(13.0 + radius * (math.sin(a) - 1), 1.0 + radius * (1 - math.cos(a))) for a in angle]
        there = [(1.0, 1.0), (4.5, 1.0 + abs(side)), (8.5, 1.0 - side), *corner, (13.0, 6.8)]
        while True:
            yield LineLeg(_curve(there))
            yield PauseLeg(float(rng.uniform(0.5, 2.0)))
            yield TurnLeg(-math.pi / 2)
            yield LineLeg(_curve(there[::-1]))
            yield PauseLeg(float(rng.uniform(0.5, 2.0)))
            yield TurnLeg(0.0)

    return Posture(1.0, 1.0, 0.0), "lane", legs()


def _slalom(rng: np.random.Generator) -> tuple[Posture, str, Iterator[Leg]]:
    """Between six columns 1.6 m apart, round the last, and back."""
    wide = float(rng.uniform(0.72, 0.82))

    def legs() -> Iterator[Leg]:
        x = np.linspace(1.2, 10.8, 97)
        there = [(float(a), 2.5 + wide * math.sin((a - 1.2) * math.pi / 1.6)) for a in x]
        loop = [(10.8 + 0.7 * math.sin(a), 3.2 - 0.7 * math.cos(a)) for a in np.linspace(0.2, math.pi, 10)]
        back = [(float(a), 3.9) for a in np.linspace(10.4, 1.2, 47)]
        turn = [(1.2 - 0.7 * math.sin(a), 3.2 + 0.7 * math.cos(a)) for a in np.linspace(0.2, math.pi, 10)]
        while True:
            yield LineLeg(_curve([*there, *loop, *back, *turn]))

    return Posture(1.2, 2.5, 0.0), "slalom", legs()


def _docking(rng: np.random.Generator) -> tuple[Posture, str, Iterator[Leg]]:
    """Out of a berth backwards, a turn on the spot, to another berth, and so on."""

    def legs() -> Iterator[Leg]:
        berths = [(5.0, 1.0), (5.0, 2.2), (5.0, 3.4)]
        at = 1
        x, y = berths[at]
        while True:
            yield LineLeg(_curve([(x, y), (x - 1.4, y)]), reverse=True)
            yield PauseLeg(float(rng.uniform(0.2, 1.0)))
            at = int(rng.choice([k for k in range(len(berths)) if k != at]))
            X, Y = berths[at]
            mid = (float(rng.uniform(1.2, 2.0)), 0.5 * (y + Y))
            yield TurnLeg(math.atan2(mid[1] - y, mid[0] - (x - 1.4)))
            yield LineLeg(_curve([(x - 1.4, y), mid]))
            yield TurnLeg(math.atan2(Y - mid[1], X - 1.4 - mid[0]))
            yield LineLeg(_curve([mid, (X - 1.4, Y)]))
            yield TurnLeg(0.0)
            yield LineLeg(_curve([(X - 1.4, Y), (X, Y)]))
            yield PauseLeg(float(rng.uniform(0.5, 2.0)))
            x, y = X, Y

    return Posture(5.0, 2.2, 0.0), "berths", legs()


def _wander(rng: np.random.Generator) -> tuple[Posture, str, Iterator[Leg]]:
    """About the room of Fig. 13, from one end to the other through the middle, whatever turns up there."""

    def legs() -> Iterator[Leg]:
        right = True
        while True:
            ends = (8.9, 11.4) if right else (1.1, 3.6)
            for low, high in ((5.6, 6.9), ends):
                yield GoalLeg((float(rng.uniform(low, high)), float(rng.uniform(1.5, 4.5))), 25.0)
            if rng.random() < 0.3:
                yield PauseLeg(float(rng.uniform(0.5, 2.0)))
            right = not right

    return Posture(1.5, 3.05, 0.0), "fig13", legs()


STYLES: Final[dict[str, Callable[[np.random.Generator], tuple[Posture, str, Iterator[Leg]]]]] = {
    "figure-eight": _figure_eight,
    "corridor": _corridor,
    "slalom": _slalom,
    "docking": _docking,
    "wander": _wander,
}
"""The seeded driving styles by name."""

MIXED: Final = "mixed"
"""Seed k drives in the k-th style of `MIXTURE`, round and round."""
MIXTURE: Final = ("figure-eight", "corridor", "slalom", "docking")


class RecordedOperator:
    """Plays recorded inputs: a speed holds until the next row."""

    def __init__(self, rows: Sequence[tuple[float, float, float]]) -> None:
        """Take rows (t, v, ω), times ascending from 0."""
        self.start, self.room = Posture(0.0, 0.0, 0.0), ""
        self._rows = rows
        self._at = 0

    def drive(self, t: float, _posture: Posture, _before: Drive) -> Drive:
        """See `Operator`; after the last row it stands."""
        rows = self._rows
        while self._at + 1 < len(rows) and rows[self._at + 1][0] <= t + 1e-9:
            self._at += 1
        _, v, w = rows[self._at]
        return STAND if self._at == len(rows) - 1 else Drive(v, w)


MOST_ROWS: Final = 1_000_000
"""Most rows of a file of inputs."""


def read_inputs(path: Path) -> RecordedOperator:
    """Read a CSV file of recorded inputs, with the columns `t` [s], `v` [m/s] and `w` [rad/s].

    The last row only says when the one before it ends. What passes the robot's limits is limited as it's driven.

    Raises:
        FormatError: If it can't be read as such, with the line.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            header = next(reader, [])
            if header != ["t", "v", "w"]:
                raise FormatError(str(path), f"line 1 must be t,v,w; given: {','.join(header)[:60]!r}")
            rows: list[tuple[float, float, float]] = []
            for number, row in enumerate(reader, start=2):
                if not row:
                    continue
                rows.append(_inputs(path, number, row, rows[-1][0] if rows else None))
                if len(rows) > MOST_ROWS:
                    raise FormatError(str(path), f"has more than {MOST_ROWS} rows")
    except OSError as error:
        raise FormatError(str(path), f"can't be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise FormatError(str(path), f"isn't a CSV file: {error}") from None
    if len(rows) < 2:
        raise FormatError(str(path), "must have two rows or more below its header")
    return RecordedOperator(rows)


def _inputs(path: Path, number: int, row: list[str], before: float | None) -> tuple[float, float, float]:
    try:
        t, v, w = (float(cell) for cell in row)
    except ValueError:
        raise FormatError(
            str(path), f"line {number} must be three numbers; given: {','.join(row)[:60]!r}"
        ) from None
    if not (math.isfinite(t) and abs(v) <= 100 and abs(w) <= 100):
        raise FormatError(str(path), f"line {number} must be finite, speeds within ±100")
    if (t != 0.0) if before is None else (t <= before):
        wanted = "0" if before is None else f"more than {before:g}"
        raise FormatError(str(path), f"line {number}: t must be {wanted}; given: {t:g}")
    return t, v, w


def operator(name: str, seed: int, period: float) -> Operator:
    """Make an operator.

    Args:
        name: A style, `mixed`, `inputs:FILE.csv`, or `module:name` of one's own, which is called with a generator
            and the period.
        seed: Its manner; `mixed` chooses the style by it, too.
        period: T, between its commands [s].

    Raises:
        InvalidValueError: If there's none of that name, or it makes something else.
        FormatError: If the file can't be read, or the module be imported.
    """
    kind, _, file = name.partition(":")
    if kind == "inputs" and file:
        return read_inputs(Path(file))
    if is_own(name):
        made: Operator = own("operator", name, ("rng", "period"))(np.random.default_rng(seed), period)
        checked("operator", name, made, ("start", "room", "drive"))
        return made
    styles = list(STYLES)
    one_of("operator", name, [*styles, MIXED], "inputs:FILE.csv", "or MODULE:NAME of your own")
    chosen = MIXTURE[seed % len(MIXTURE)] if name == MIXED else name
    # A seed drives alike, whether the style was named or chosen.
    rng = np.random.default_rng([seed, styles.index(chosen)])
    start, room, legs = STYLES[chosen](rng)
    return StyledOperator(start, room, legs, rng, period)
