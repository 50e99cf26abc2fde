"""Where a robot is, from its odometry, its laser and a line map; how sure that is, and what can't be known.

`Tracker` has a filter. `PaperLocalizer` is the paper's own way: differences of corresponding lines, averaged by how
much of each was seen.

    Δp̃_i = p_Gi − p_Li                      the line in the map, less the same line as seen, both in the world
    frame Δp = Σ w_i R_i Δp̃_i,   w_i ∝ l_Li / l_Gi, Σ w_i = 1,   p ← p + Δp        eq. (5), (7)–(9)

Eq. (4) is the same with w_i = 1/m and without R_i. Eq. (6) as printed turns the wrong way; (7) is right and is
used. Weights that add up to 1 take half a step where two walls at right angles are seen, so it's iterated. There's
no word on how lines are made to correspond: here the nearest that faces the same way within a gate. Neither
odometry nor a line's doubt count, an estimate of its own doubt isn't made.

Source: Kim, Han, Kim, Kim 2002, section 3.2.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from robots.onboard.gsp_map import GspMap, Lines, injection
from robots.onboard.laser import LaserScan, OdometryTrack, Points, deskewed
from robots.onboard.line_extraction import ExtractionConfig, extract
from robots.onboard.line_filter import Evidence, LineFilter, MatchingConfig, MotionConfig, Sights, evidence, matched
from vrs.checks import validated, within
from vrs.mobile import advanced
from vrs.mobile.model import all_wrapped
from vrs.model import Array, frozen_array

_BENT = 0.1
"""Share of a change in turning by which a scan's heading may be off: the odometry's readings don't say how the
robot turned in between. If it changes evenly it's 1/12."""
_TOLD = 0.05
"""Least share of a direction's doubt that a scan has to take away for anything to be learned from it."""
_SURPRISE = 6.0
"""Larger mean squares of corrections count as this: one scan alone may be wrong."""
_REMEMBERED = 100
"""Scans of which it's remembered where they were taken."""


@dataclass(frozen=True, slots=True)
@validated
class LocalizationConfig:
    """Of everything that localizes."""

    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    """What counts as a line."""
    motion: MotionConfig = field(default_factory=MotionConfig)
    """How far odometry is trusted."""
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """Which lines are the same."""
    across_floor: Annotated[float, within(0.0, 0.1)] = 0.0005
    """What a seen line is off across beside its noise [m], in [0, 0.1]: a sweep in motion, wrong cuts."""
    turn_floor: Annotated[float, within(0.0, 0.1)] = 3e-4
    """And in direction [rad], in [0, 0.1]."""
    fresh: Annotated[float, within(0.0, 10.0)] = 0.2
    """What lines are off beside noise is another after so long a way [m], in [0, 10]; until then scans share it."""
    fresh_turn: Annotated[float, within(0.0, 7.0)] = 0.15
    """Or after so much turning [rad], in [0, 7]."""
    slip: Annotated[float, within(0.0, 1.0)] = 0.1
    """Standard deviation of a sudden slip that the motion doesn't allow for [m], in [0, 1]."""
    slip_turn: Annotated[float, within(0.0, 1.0)] = 0.07
    """And of the heading [rad], in [0, 1]."""
    learning: Annotated[float, within(0.0, 1.0)] = 0.2
    """How fast it's learned that odometry is worse than was said, a scan, in [0, 1]."""
    most_unrest: Annotated[float, within(1.0, 1000.0)] = 25.0
    """Largest factor by which variances of the odometry grow so, in [1, 1000]."""
    better: Annotated[float, within(0.0, 1.0)] = 0.1
    """A slip is believed if this share of the beams is explained by it and not without, in [0, 1]."""
    unknown: Annotated[float, within(0.01, 10.0)] = 0.1
    """A standard deviation from lines alone above which a direction counts as unobservable [m], in [0.01, 10]."""


@dataclass(frozen=True, slots=True, eq=False)
class Observability:
    """What the lines of one scan say by themselves, without odometry and earlier scans."""

    information: Array
    """Of (x, y, θ), (3, 3): inverse of the covariance that they alone would give."""
    unobservable: Array
    """Unit vectors of the directions in the plane of which they say nothing, (0 to 2, 2)."""
    heading: bool
    """Whether they tell the heading."""


def observability(information: Array, unknown: float) -> Observability:
    """Say what can't be known.

    Args:
        information: Of the posture, (3, 3).
        unknown: Standard deviation [m] above which a direction isn't known.
    """
    turn = float(information[2, 2])
    if turn <= 0:
        return Observability(frozen_array(information), frozen_array(np.eye(2)), False)
    place = information[:2, :2] - np.outer(information[:2, 2], information[2, :2]) / turn
    values, vectors = np.linalg.eigh(place)
    return Observability(frozen_array(information), frozen_array(vectors[:, values < unknown**-2].T), True)


class Tracker:
    """Follows a robot through a known map, or one that it builds; it takes odometry and scans as they come."""

    def __init__(
        self,
        known: GspMap,
        posture: tuple[float, float, float],
        covariance: Array,
        config: LocalizationConfig | None = None,
        *,
        building: bool = False,
    ) -> None:
        """Begin at a posture that is known so well.

        Args:
            known: The map.
            posture: (x, y, θ) [m, m, rad].
            covariance: Of it, (3, 3).
            config: Of everything.
            building: Whether lines that are new go into the map, and old ones are corrected.
        """
        self._config = LocalizationConfig() if config is None else config
        self.filter = LineFilter(posture, covariance, known, self._config.motion, building=building)
        self.odometry = OdometryTrack()
        self.noise = self._config.extraction.noise
        """Of the ranges, as the scans show it [m]."""
        self.sights: Sights | None = None
        """What was recognised in the last scan."""
        self.seen = Lines.none()
        """All lines of the last scan, in the robot's frame, with all of their doubt."""
        self.points: Points | None = None
        """What it saw, in the robot's frame when it was taken in."""
        self.seen_from = posture
        """Where the robot was then, as was known with it, (x, y, θ) [m, m, rad]."""
        self.evidence = Evidence(0.0, 0.0, 0.0, 1.0)
        """How the last scan fits the map, beam by beam."""
        self._information = np.zeros((3, 3))
        self._places: deque[tuple[float, float, float]] = deque(maxlen=_REMEMBERED)
        """Where the last scans were taken."""

    @property
    def posture(self) -> tuple[float, float, float]:
        """Where the robot is at the last reading of the odometry, (x, y, θ) [m, m, rad]."""
        return self.filter.posture

    @property
    def covariance(self) -> Array:
        """Of the posture, (3, 3)."""
        return self.filter.covariance

    @property
    def observability(self) -> Observability:
        """What the last scan's lines say by themselves."""
        return observability(self._information, self._config.unknown)

    def move(self, time: float, reading: tuple[float, float, float]) -> None:
        """Take a reading of the odometry, in its own frame, θ counted on; one that isn't newer is no news."""
        step = self.odometry.step(time, reading)
        if step is not None:
            self.filter.move(*step)

    def see(self, scan: LaserScan) -> bool:
        """Take in a scan; returns whether it was: not if it isn't new, or the odometry doesn't cover it yet."""
        if not self.odometry.takes(scan):
            return False
        self.points = points = deskewed(scan, self.odometry)
        lines, noise = extract(points, self._config.extraction, self.noise)
        if math.isfinite(noise):
            self.noise += 0.1 * (min(max(noise, 1e-3), 0.1) - self.noise)
        self._take(lines)
        return True

    def _take(self, lines: Lines) -> None:
        config = self._config
        alike = self._alike(self.filter.posture)
        floors = alike * np.array([config.across_floor**2, config.turn_floor**2])
        seen = self.seen = replace(lines, variances=frozen_array(lines.variances + floors))
        turned = (_BENT * self.odometry.bend) ** 2
        sights = matched(self.filter, seen, config.matching, turned)
        if len(seen) > len(sights.of):
            sights = self._slipped(seen, sights)
        self.sights = sights
        H = self.filter.innovation(sights).H[:, :, :3]
        self._information = np.einsum("kai,ka,kaj->ij", H, 1 / sights.lines.variances, H)
        before, doubt = np.array(self.filter.posture), self.filter.covariance
        self.filter.correct(sights)
        self._learn(np.array(self.filter.posture) - before, doubt - self.filter.covariance)
        self.seen_from = self.filter.posture
        self.evidence = self._hold(self.filter)

    def _learn(self, shift: Array, doubt: Array) -> None:
        """Trust odometry less if corrections are larger than their covariance (3, 3) says, and more if not."""
        scale = np.sqrt(np.maximum(np.diag(doubt), 1e-16))
        values, vectors = np.linalg.eigh(doubt / np.outer(scale, scale))
        told = values > _TOLD
        if not told.any():
            return
        squares = (vectors.T @ (shift / scale))[told] ** 2 / values[told]
        config, more = self._config, min(float(squares.mean()), _SURPRISE) - 1.0
        unrest = self.filter.unrest * math.exp(config.learning * more)
        self.filter.unrest = min(max(unrest, 1.0), config.most_unrest)

    def _alike(self, here: tuple[float, float, float]) -> int:
        """How many of the last scans were taken nearly from here, with this one."""
        config = self._config
        self._places.append(here)
        x, y, theta = np.array(self._places).T
        near = np.hypot(x - here[0], y - here[1]) < config.fresh
        return int(np.sum(near & (np.abs(theta - here[2]) < config.fresh_turn)))

    def _hold(self, held: LineFilter) -> Evidence:
        assert self.points is not None
        return evidence(held.lines, self.points, held.posture, self.noise)

    def _slipped(self, seen: Lines, sights: Sights) -> Sights:
        """Look farther around if more lines are recognised there, and the scan agrees with it beam by beam."""
        config = self._config
        wide = self.filter.widened(config.slip, config.slip_turn)
        again = matched(wide, seen, config.matching, sights.turned)
        if len(again.of) < 2 or again.lines.lengths.sum() < 1.3 * sights.lines.lengths.sum():
            return sights
        here, there = self.filter.widened(0.0, 0.0), wide.widened(0.0, 0.0)
        here.correct(sights)
        there.correct(again)
        if self._hold(there).explained < self._hold(here).explained + config.better:
            return sights
        self.filter = wide
        return again


_TURN, _ACROSS = 0.3, 0.3
"""The paper's lines correspond if they differ by no more [rad], [m]; it leaves this open, and what follows."""
_ROUNDS = 20
"""Of eq. (9), at most."""
_ENOUGH = 1e-4
"""A round that changes less ends it [m, rad]."""


def differences(known: Lines, placed: Lines, of: NDArray[np.int64]) -> Array:
    """Δp̃ of seen lines in the world frame and the map's lines that they are, (k, 3)."""
    delta = known.poses[of] - placed.poses
    delta[:, 2] = all_wrapped(delta[:, 2])
    return delta


def mean_update(known: Lines, placed: Lines, of: NDArray[np.int64]) -> Array:
    """Δp, (3,), for lines that are seen as long as they are. Source: eq. (4)."""
    return np.asarray(differences(known, placed, of).mean(axis=0))


def weights(known: Lines, placed: Lines, of: NDArray[np.int64]) -> Array:
    """W of lines of which a part is seen, (k,). Source: below eq. (5)."""
    share = placed.lengths / known.lengths[of]
    return np.asarray(share / share.sum())


def weighted_update(known: Lines, placed: Lines, of: NDArray[np.int64]) -> Array:
    """Δp, (3,), for finite lines. Source: eq. (5)."""
    return np.asarray(weights(known, placed, of) @ differences(known, placed, of))


def injected_update(known: Lines, placed: Lines, of: NDArray[np.int64]) -> Array:
    """Δp, (3,), of what each line can tell alone. Source: eq. (8)."""
    R = injection(known.poses[of, 2])
    return np.asarray(np.einsum("k,kij,kj->i", weights(known, placed, of), R, differences(known, placed, of)))


def nearest_lines(known: Lines, placed: Lines) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Seen lines, in the world frame, and the nearest lines of the map that they may be."""
    turn = all_wrapped(placed.poses[:, None, 2] - known.poses[:, 2])
    delta = placed.poses[:, None, :2] - known.poses[:, :2]
    along, off = np.sum(delta * known.directions, axis=-1), np.abs(np.sum(delta * known.normals, axis=-1))
    beside = (along >= known.spans[:, 0]) & (along <= known.spans[:, 1])
    cost = np.where((np.abs(turn) < _TURN) & (off < _ACROSS) & beside, off, np.inf)
    if not cost.size:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    of = cost.argmin(axis=1)
    seen = np.flatnonzero(np.isfinite(cost.min(axis=1)))
    return seen, of[seen]


class PaperLocalizer:
    """Dead reckoning, corrected by the paper's update after each scan."""

    def __init__(
        self,
        known: GspMap,
        posture: tuple[float, float, float],
        update: Callable[[Lines, Lines, NDArray[np.int64]], Array] = injected_update,
    ) -> None:
        """Begin at a posture in a map.

        Args:
            known: The map.
            posture: (x, y, θ) [m, m, rad].
            update: Δp of known and seen lines; another of the paper's for comparison.
        """
        self._known, self._update = known.lines, update
        self.posture = posture
        """Where the robot is taken to be, (x, y, θ) [m, m, rad]."""
        self._extraction = ExtractionConfig()
        self.odometry = OdometryTrack()

    def move(self, time: float, reading: tuple[float, float, float]) -> None:
        """Take a reading of the odometry, in its own frame; one that isn't newer is no news."""
        step = self.odometry.step(time, reading)
        if step is not None:
            self.posture = advanced(self.posture, step.way, step.turn, 1.0)

    def see(self, scan: LaserScan) -> bool:
        """Take in a scan; returns whether it was: not if it isn't new, or the odometry doesn't cover it yet."""
        if not self.odometry.takes(scan):
            return False
        seen, _ = extract(deskewed(scan, self.odometry), self._extraction)
        for _ in range(_ROUNDS):
            placed = seen.moved(self.posture)
            mine, of = nearest_lines(self._known, placed)
            if not len(mine):
                break
            step = self._update(self._known, placed.taken(mine), of)
            x, y, theta = self.posture
            self.posture = x + float(step[0]), y + float(step[1]), theta + float(step[2])
            if np.abs(step).max() < _ENOUGH:
                break
        return True
