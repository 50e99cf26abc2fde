"""Posture, wheels and lines in one covariance: what odometry and seen lines together say.

The state is the posture, the errors of the two wheels and of the wheel base as odometry counts with them, and the
errors of the map's lines, each along its normal and in direction. A step of the odometry moves the posture; lines
seen again correct it in one least-squares step (Gauss-Newton, the odometry as prior). A line says nothing along
itself.

A map's errors don't average out: the same wall is wrong in the same way each time that it's seen. So they are in
the state. A map that *stands* is only considered (Schmidt 1966): its errors count in the doubt and aren't
estimated. A map that is being built is corrected, too (Smith, Self and Cheeseman 1990).

Which line of the map a line of a scan is, is told by gates on what the filter expects, and by what the others say.
A seen line may be the map's if it faces the same way, lies where that is, and differs by no more than the doubt
allows (Mahalanobis). Where two lines of the map at different places could be it, nobody says which. Then each is
held against the rest: what it is off from what all others together say, in its own deviations; the worst goes
until none is too far off. That drops furniture that stands nearly where a wall is.

A scan is held against the map beam by beam: what the map explains, and what contradicts it. A beam that ends
before the map's first wall met something that the map doesn't have. One that goes on behind it contradicts the
map: nothing that's put into a room makes a wall transparent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.onboard.gsp_map import GspMap, Lines, cast_lines
from robots.onboard.laser import Points
from vrs.checks import finite_array, validated, within
from vrs.errors import InvalidValueError
from vrs.mobile import wrapped
from vrs.mobile.model import all_wrapped, placed, sinc, turned
from vrs.model import Array, frozen_array

OWN = 6
"""Entries of the state before the lines: x, y, θ, errors of the right and the left wheel, and of the base."""
_SAME = 1e-8
"""Variance that is left between two lines that are one [m², rad²]: numbers stay sound."""
_ROUNDS = 3
"""Of Gauss-Newton, at most."""


@dataclass(frozen=True, slots=True)
@validated
class MotionConfig:
    """How far odometry is trusted."""

    base: Annotated[float, within(0.01, 5.0)] = 0.4
    """Nominal wheel base [m], in [0.01, 5]."""
    wheel: Annotated[float, within(0.0, 0.3)] = 0.02
    """Standard deviation of a wheel's relative error, wrong radius and slip together, in [0, 0.3]."""
    wheel_time: Annotated[float, within(0.1, 1e6)] = 4.0
    """How long it stays about the same [s], in [0.1, 1e6]."""
    base_error: Annotated[float, within(0.0, 0.3)] = 0.01
    """Standard deviation of the wheel base's relative error, in [0, 0.3]; it stays the same."""
    rolling: Annotated[float, within(0.0, 0.2)] = 0.002
    """Standard deviation of a wheel's way after 1 m, on top [m], growing as the square root; in [0, 0.2]."""


class Sights(NamedTuple):
    """Lines of a scan, each with the line of the map that it's taken for."""

    lines: Lines
    """In the robot's frame."""
    of: NDArray[np.int64]
    """Numbers of the map's lines, (k,)."""
    turned: float = 0.0
    """Variance of an angle by which all of them are turned together [rad²]."""

    def taken(self, which: NDArray[np.int64]) -> Sights:
        """Some of them."""
        return Sights(self.lines.taken(which), self.of[which], self.turned)


class Innovation(NamedTuple):
    """What lines of the map would say to lines of a scan."""

    off: Array
    """Distance of the seen line's centre before the map's line [m], (k,)."""
    turn: Array
    """Angle between both [rad], (k,)."""
    along: Array
    """Where the seen line's centre is along the map's line, from that one's centre [m], (k,)."""
    H: Array
    """Derivatives of (off, turn) by the posture and the map line's errors, (k, 2, 5)."""


class LineFilter:
    """Posture and lines with their covariance; it knows no clock and draws no conclusions."""

    def __init__(
        self,
        posture: tuple[float, float, float],
        covariance: Array,
        known: GspMap,
        config: MotionConfig | None = None,
        *,
        building: bool = False,
    ) -> None:
        """Begin at a posture.

        Args:
            posture: (x, y, θ) [m, m, rad].
            covariance: Of it, (3, 3).
            known: The map, perhaps without any line.
            config: How far odometry is trusted.
            building: Whether the map is corrected and grows, or stands.

        Raises:
            InvalidValueError: If the posture isn't three finite numbers, or the covariance none of them.
        """
        finite_array("posture", posture, (3,), "three finite numbers (x, y, θ)")
        P = finite_array("covariance", covariance, (3, 3), "(3, 3) finite numbers, symmetric, not negative")
        if np.abs(P - P.T).max() > 1e-9 or (np.diag(P) < 0).any():
            raise InvalidValueError("covariance", covariance, "symmetric, with variances that aren't negative")
        self._config = config = MotionConfig() if config is None else config
        self.building = building
        """Whether the map is corrected and grows."""
        self.lines = known.lines
        """The map's lines as they are known now."""
        self.unrest = 1.0
        """By how much more than the config says odometry is wrong, as a factor of variances, from 1."""
        self._own = np.array([*posture, 0.0, 0.0, 0.0])
        n = OWN + 2 * len(known.lines)
        self._P = np.zeros((n, n))
        self._P[:3, :3] = P
        self._P[3:OWN, 3:OWN] = np.diag([config.wheel**2, config.wheel**2, config.base_error**2])
        self._P[OWN:, OWN:] = known.covariance

    @property
    def posture(self) -> tuple[float, float, float]:
        """(x, y, θ) [m, m, rad], θ counted on."""
        x, y, theta = self._own[:3].tolist()
        return x, y, theta

    @property
    def covariance(self) -> Array:
        """Of the posture, (3, 3)."""
        return frozen_array(self._P[:3, :3])

    @property
    def wheels(self) -> Array:
        """Estimated relative errors of right wheel, left wheel and base, (3,)."""
        return frozen_array(self._own[3:OWN])

    @property
    def line_covariance(self) -> Array:
        """Of the lines' errors, (2 m, 2 m)."""
        return frozen_array(self._P[OWN:, OWN:])

    @property
    def joint_covariance(self) -> Array:
        """Of the robot's own errors and the lines' together, (OWN + 2 m, OWN + 2 m)."""
        return frozen_array(self._P)

    def widened(self, place: float, turn: float) -> LineFilter:
        """Return a copy that may be off by so much more: standard deviations [m] and [rad]."""
        other = LineFilter.__new__(LineFilter)
        other._config, other.building, other.lines = self._config, self.building, self.lines
        other._own, other._P, other.unrest = self._own.copy(), self._P.copy(), self.unrest
        other._P[np.diag_indices(3)] += np.array([place, place, turn]) ** 2
        return other

    def move(self, way: float, turn: float, dt: float) -> None:
        """Go on by what odometry says.

        Args:
            way: Length of the arc that the middle of the axle made, with nominal wheels [m].
            turn: Angle that it turned by [rad].
            dt: How long it took [s].
        """
        config, own = self._config, self._own
        half_base = 0.5 * config.base
        right, left = way + half_base * turn, way - half_base * turn
        k_right, k_left, k_base = own[3:OWN].tolist()
        a, b = right * (1 + k_right), left * (1 + k_left)
        way, turn = 0.5 * (a + b), (a - b) / (config.base * (1 + k_base))
        middle = own[2] + 0.5 * turn
        chord = way * sinc(0.5 * turn)
        c, s = math.cos(middle), math.sin(middle)
        own[:3] += (chord * c, chord * s, turn)
        by_way = np.array([c, s, 0.0])
        by_turn = np.array([-0.5 * chord * s, 0.5 * chord * c, 1.0])
        per_base = by_turn / config.base
        keep = math.exp(-dt / config.wheel_time)
        F = np.eye(OWN)
        F[0, 2], F[1, 2] = -chord * s, chord * c
        F[:3, 3] = right * (0.5 * by_way + per_base)
        F[:3, 4] = left * (0.5 * by_way - per_base)
        F[:3, 5] = -turn * by_turn
        F[3, 3] = F[4, 4] = keep
        own[3:5] *= keep
        P = self._P
        P[:OWN, :] = F @ P[:OWN, :]
        P[:, :OWN] = P[:, :OWN] @ F.T
        fresh = self.unrest * config.wheel**2 * (1 - keep * keep)
        P[3, 3] += fresh
        P[4, 4] += fresh
        slip = self.unrest * config.rolling**2
        for wheel, by in ((right, 0.5 * by_way + per_base), (left, 0.5 * by_way - per_base)):
            P[:3, :3] += slip * abs(wheel) * np.outer(by, by)

    def innovation(self, sights: Sights, posture: Array | None = None) -> Innovation:
        """Compare lines of a scan with the map's, as seen from a posture (3,), the filter's own unless given."""
        seen, of = sights.lines, sights.of
        x, y, theta = (self._own[:3] if posture is None else posture).tolist()
        c, s = math.cos(theta), math.sin(theta)
        px, py, angle = seen.poses.T
        rx, ry = c * px - s * py, s * px + c * py
        mx, my, direction = self.lines.poses[of].T
        tx, ty = np.cos(direction), np.sin(direction)
        dx, dy = x + rx - mx, y + ry - my
        along = tx * dx + ty * dy
        H = np.zeros((len(of), 2, 5))
        H[:, 0, 0], H[:, 0, 1], H[:, 0, 2] = -ty, tx, ty * ry + tx * rx
        H[:, 0, 3], H[:, 0, 4] = -1.0, -along
        H[:, 1, 2], H[:, 1, 4] = 1.0, -1.0
        turn = all_wrapped(theta + angle - direction)
        return Innovation(tx * dy - ty * dx, turn, along, H)

    def doubts(self, found: Innovation, sights: Sights) -> Array:
        """Covariances of innovations, (k, 2, 2), with the seen lines' own."""
        k = len(sights.of)
        index = np.empty((k, 5), dtype=np.int64)
        index[:, :3] = (0, 1, 2)
        index[:, 3] = OWN + 2 * sights.of
        index[:, 4] = index[:, 3] + 1
        P = self._P[index[:, :, None], index[:, None, :]]
        S = found.H @ P @ found.H.transpose(0, 2, 1)
        S[:, 0, 0] += sights.lines.variances[:, 0]
        S[:, 1, 1] += sights.lines.variances[:, 1]
        S += sights.turned * found.H[:, :, 2, None] * found.H[:, None, :, 2]
        return np.asarray(S)

    def joint(self, found: Innovation, sights: Sights) -> Array:
        """Covariance of all innovations together, (2 k, 2 k), with the seen lines' own."""
        H = self._whole(found, sights.of)
        S = H @ self._P @ H.T
        return np.asarray(S + self._noise(H, sights))

    @staticmethod
    def _noise(H: Array, sights: Sights) -> Array:
        """Covariance of what the seen lines are off themselves, (2 k, 2 k)."""
        return np.diag(sights.lines.variances.ravel()) + sights.turned * np.outer(H[:, 2], H[:, 2])

    def correct(self, sights: Sights) -> Array:
        """Take in lines of a scan; returns what each is off afterwards, squared and in its own deviations, (k,)."""
        k = len(sights.of)
        if not k:
            return np.zeros(0)
        before = self._own.copy()
        n = len(self._P)
        own = OWN if not self.building else n
        errors = np.zeros(n - OWN)
        for _ in range(_ROUNDS):
            found = self.innovation(sights, self._own[:3])
            H = self._whole(found, sights.of)
            z = np.stack([found.off, found.turn], axis=-1).ravel()
            if self.building:
                z = z + H[:, OWN:] @ errors
            # What is left of the prior where this round is linearised.
            back = np.concatenate([before - self._own, -errors])
            back[2] = before[2] - self._own[2]
            PH = self._P @ H.T
            S = H @ PH
            S += self._noise(H, sights)
            K = np.asarray(np.linalg.solve(S, PH[:own].T).T)
            step = back[:own] - K @ (z + H[:, :own] @ back[:own])
            self._own += step[:OWN]
            if self.building:
                errors += step[OWN:]
            if np.abs(step[:3]).max() < 1e-6:
                break
        self._shrink(K, PH, S)
        if self.building:
            self._correct_lines(errors)
        found = self.innovation(sights)
        rest = np.column_stack([found.off, found.turn])
        return np.asarray((rest * rest / sights.lines.variances).sum(axis=1))

    def _whole(self, found: Innovation, of: NDArray[np.int64]) -> Array:
        """Derivatives by the whole state, (2 k, n)."""
        k = len(of)
        H = np.zeros((k, 2, len(self._P)))
        H[:, :, :3] = found.H[:, :, :3]
        rows = np.arange(k)
        H[rows, :, OWN + 2 * of] = found.H[:, :, 3]
        H[rows, :, OWN + 2 * of + 1] = found.H[:, :, 4]
        return H.reshape(2 * k, len(self._P))

    def _shrink(self, K: Array, PH: Array, S: Array) -> None:
        P, own = self._P, len(K)
        cross = K @ PH[own:].T
        P[:own, :own] -= K @ S @ K.T
        P[:own, own:] -= cross
        P[own:, :own] -= cross.T
        P[:own, :own] = 0.5 * (P[:own, :own] + P[:own, :own].T)

    def _correct_lines(self, errors: Array) -> None:
        lines, moved = self.lines, errors.reshape(-1, 2)
        poses = lines.poses.copy()
        poses[:, :2] += moved[:, :1] * lines.normals
        poses[:, 2] += moved[:, 1]
        self.lines = Lines.of(poses, lines.spans, self._own_variances(), lines.counts)

    def _own_variances(self) -> Array:
        return np.diag(self._P)[OWN:].reshape(-1, 2)

    def add(self, seen: Lines) -> None:
        """Put new lines, in the robot's frame, into the map that is being built."""
        x, y, _ = self.posture
        placed = seen.moved(self.posture)
        m = len(self._P)
        k = len(seen)
        G = np.zeros((k, 2, m))
        n = placed.normals
        G[:, 0, 0], G[:, 0, 1] = n[:, 0], n[:, 1]
        lever = placed.poses[:, :2] - (x, y)
        G[:, 0, 2] = n[:, 1] * lever[:, 0] - n[:, 0] * lever[:, 1]
        G[:, 1, 2] = 1.0
        rows = G.reshape(2 * k, m)
        P = np.zeros((m + 2 * k, m + 2 * k))
        P[:m, :m] = self._P
        P[m:, :m] = rows @ self._P
        P[:m, m:] = P[m:, :m].T
        P[m:, m:] = rows @ self._P @ rows.T + np.diag(seen.variances.ravel())
        self._P = P
        old = self.lines
        self.lines = Lines.of(
            np.vstack([old.poses, placed.poses]),
            np.vstack([old.spans, placed.spans]),
            self._own_variances(),
            np.concatenate([old.counts, placed.counts]),
        )

    def stretch(self, sights: Sights) -> None:
        """Make the map's lines as long as what was seen of them, and count its points."""
        found = self.innovation(sights)
        spans, counts = self.lines.spans.copy(), self.lines.counts.copy()
        np.minimum.at(spans[:, 0], sights.of, found.along + sights.lines.spans[:, 0])
        np.maximum.at(spans[:, 1], sights.of, found.along + sights.lines.spans[:, 1])
        np.add.at(counts, sights.of, sights.lines.counts)
        self.lines = Lines.of(self.lines.poses, spans, self.lines.variances, counts)

    def _between(self, i: int, j: int) -> tuple[Array, Array]:
        """How far line j's centre is off line i and turned against it, (2,), and the derivatives, (2, n)."""
        poses = self.lines.poses
        theta = float(poses[i, 2])
        c, s = math.cos(theta), math.sin(theta)
        dx, dy = (poses[j, :2] - poses[i, :2]).tolist()
        turn = wrapped(float(poses[j, 2]) - theta)
        H = np.zeros((2, len(self._P)))
        at_i, at_j = OWN + 2 * i, OWN + 2 * j
        H[0, at_i], H[0, at_i + 1], H[1, at_i + 1] = -1.0, -(c * dx + s * dy), -1.0
        H[0, at_j], H[1, at_j + 1] = math.cos(turn), 1.0
        return np.array([c * dy - s * dx, turn]), H

    def difference(self, i: int, j: int) -> float:
        """How much two lines differ, squared and in their own doubt."""
        z, H = self._between(i, j)
        S = H @ self._P @ H.T + _SAME * np.eye(2)
        return float(z @ np.linalg.solve(S, z))

    def join(self, i: int, j: int) -> None:
        """Take line j of a map that is being built for line i: both are corrected, then j goes."""
        z, H = self._between(i, j)
        PH = self._P @ H.T
        S = H @ PH + _SAME * np.eye(2)
        K = np.asarray(np.linalg.solve(S, PH.T).T)
        step = -K @ z
        self._own += step[:OWN]
        self._shrink(K, PH, S)
        self._correct_lines(step[OWN:])
        lines = self.lines
        along = float((lines.poses[j, :2] - lines.poses[i, :2]) @ lines.directions[i])
        spans, counts = lines.spans.copy(), lines.counts.copy()
        spans[i] = min(spans[i, 0], along + spans[j, 0]), max(spans[i, 1], along + spans[j, 1])
        counts[i] += counts[j]
        self.lines = Lines.of(lines.poses, spans, lines.variances, counts)
        self.keep(np.arange(len(lines)) != j)

    def keep(self, which: NDArray[np.bool_]) -> None:
        """Forget the lines of a map that is being built that aren't marked, (m,)."""
        entries = np.concatenate([np.ones(OWN, dtype=np.bool_), np.repeat(which, 2)])
        self._P = self._P[np.ix_(entries, entries)]
        self.lines = self.lines.taken(which)


@dataclass(frozen=True, slots=True)
@validated
class MatchingConfig:
    """Gates."""

    gate: Annotated[float, within(1.0, 100.0)] = 13.8
    """Largest squared Mahalanobis distance, two degrees of freedom, in [1, 100]; 13.8 lets 99.9 % pass."""
    against: Annotated[float, within(1.0, 100.0)] = 14.0
    """The same of a line against all others, in [1, 100]."""
    overlap: Annotated[float, within(0.0, 1.0)] = 0.5
    """Share of the seen line that lies on the map's, in [0, 1]."""
    slack: Annotated[float, within(0.0, 1.0)] = 0.1
    """By how much the ends of the map's lines may be off [m], in [0, 1]."""
    apart: Annotated[float, within(0.0, 1.0)] = 0.04
    """Two candidates this far apart across are different [m], in [0, 1]."""
    turn: Annotated[float, within(0.01, 1.0)] = 0.35
    """Largest difference in direction that's looked at [rad], in [0.01, 1]."""
    across: Annotated[float, within(0.05, 10.0)] = 1.0
    """And across [m], in [0.05, 10]."""


def matched(filter_: LineFilter, seen: Lines, config: MatchingConfig, turned: float = 0.0) -> Sights:
    """Say which of the filter's lines those of a scan, in the robot's frame, are; without those that are none."""
    i, j = _candidates(filter_, seen, config)
    pairs = Sights(seen.taken(i), j, turned)
    if not len(i):
        return pairs
    found = filter_.innovation(pairs)
    z = np.stack([found.off, found.turn], axis=-1)
    d2 = np.einsum("ka,kab,kb->k", z, np.linalg.inv(filter_.doubts(found, pairs)), z)
    chosen = np.array(_unambiguous(i, d2, found.off, config), dtype=np.int64)
    return against_others(filter_, pairs.taken(chosen), config.against)


def _candidates(
    filter_: LineFilter, seen: Lines, config: MatchingConfig
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of lines that face the same way, near each other, one beside the other."""
    known = filter_.lines
    placed = seen.moved(filter_.posture)
    turn = all_wrapped(placed.poses[:, None, 2] - known.poses[:, 2])
    delta = placed.poses[:, None, :2] - known.poses[:, :2]
    along = np.sum(delta * known.directions, axis=-1)
    off = np.sum(delta * known.normals, axis=-1)
    low = np.maximum(along + placed.spans[:, :1], known.spans[:, 0] - config.slack)
    high = np.minimum(along + placed.spans[:, 1:], known.spans[:, 1] + config.slack)
    # The end of a map's line isn't known while it's being built: what lies beside the shorter of both counts.
    whole = np.minimum(placed.lengths[:, None], known.lengths) if filter_.building else placed.lengths[:, None]
    beside = high - low >= config.overlap * whole
    i, j = np.nonzero((np.abs(turn) < config.turn) & (np.abs(off) < config.across) & beside)
    return i, j


def _unambiguous(i: NDArray[np.int64], d2: Array, off: Array, config: MatchingConfig) -> list[int]:
    """The best pair of each seen line, where no other place could be it as well."""
    chosen = []
    for line in np.unique(i):
        mine = np.flatnonzero((i == line) & (d2 < config.gate))
        if not len(mine):
            continue
        best = int(mine[np.argmin(d2[mine])])
        if (np.abs(off[mine] - off[best]) <= config.apart).all():
            chosen.append(best)
    return chosen


def against_others(filter_: LineFilter, sights: Sights, most: float) -> Sights:
    """Leave out, one by one, lines that what is known and all others together contradict.

    Args:
        filter_: What is known.
        sights: Lines and whose they are.
        most: Largest squared distance in own deviations.
    """
    found = filter_.innovation(sights)
    S = filter_.joint(found, sights)
    z = np.stack([found.off, found.turn], axis=-1).ravel()
    kept = np.arange(len(sights.of))
    while len(kept) > 1:
        rows = (2 * kept[:, None] + (0, 1)).ravel()
        inverse = np.linalg.inv(S[np.ix_(rows, rows)])
        y = (inverse @ z[rows]).reshape(-1, 2)
        k = np.arange(len(kept))
        blocks = inverse.reshape(len(kept), 2, len(kept), 2)[k, :, k, :]
        worst = np.einsum("ka,kab,kb->k", y, np.linalg.inv(blocks), y)
        at = int(np.argmax(worst))
        if worst[at] <= most:
            break
        kept = np.delete(kept, at)
    return sights.taken(kept)


CLOSE = 0.03
"""A beam that ends so near where it should, or within three deviations of the noise, is explained [m]."""
THROUGH = 0.15
"""One that goes so much too far, and more than five deviations, contradicts [m]."""
MOST_BEAMS = 91
"""Beams of a scan that are looked at."""


class Evidence(NamedTuple):
    """Shares of the beams."""

    explained: float
    """End at the map's first line."""
    before: float
    """End before it."""
    through: float
    """Go on behind it."""
    blank: float
    """Look where the map has nothing."""


def evidence(lines: Lines, points: Points, posture: tuple[float, float, float], noise: float) -> Evidence:
    """Hold a scan against a map.

    Args:
        lines: Of the map.
        points: What was seen, in the robot's frame.
        posture: Where the robot would be, (x, y, θ) [m, m, rad].
        noise: Standard deviation of a range [m].
    """
    step = max(1, math.ceil(len(points.beams) / MOST_BEAMS))
    ranges = points.ranges[::step]
    if not len(ranges):
        return Evidence(0.0, 0.0, 0.0, 1.0)
    expected = expected_ranges(lines, points.origins[::step], points.ways[::step], posture)
    return judged(ranges - expected, noise)


def expected_ranges(lines: Lines, origins: Array, ways: Array, posture: tuple[float, float, float]) -> Array:
    """How far beams in the robot's frame would go in a map [m], (k,), inf where they'd meet nothing."""
    return cast_lines(lines.ends, placed(origins, posture), turned(ways, posture[2]))


def judged(difference: Array, noise: float) -> Evidence:
    """Shares of beams by how much farther they went than expected [m], (k,), −inf where nothing was."""
    close, far = max(CLOSE, 3 * noise), max(THROUGH, 5 * noise)
    explained = float(np.mean(np.abs(difference) <= close))
    blank = float(np.mean(difference == -np.inf))
    return Evidence(explained, float(np.mean(difference < -close)) - blank, float(np.mean(difference > far)), blank)
