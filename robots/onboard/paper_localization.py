"""The paper's own localization: differences of corresponding lines, averaged by how much of each was seen.

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
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from robots.onboard.gsp_map import GspMap, Lines, injection
from robots.onboard.laser import LaserScan, OdometryTrack, deskewed
from robots.onboard.line_extraction import ExtractionConfig, extract
from robots.onboard.localization import step_between
from vrs.checks import validated, within
from vrs.mobile import advanced
from vrs.mobile.model import all_wrapped
from vrs.model import Array


@dataclass(frozen=True, slots=True)
@validated
class PaperConfig:
    """What the paper leaves open."""

    turn: Annotated[float, within(0.01, 1.5)] = 0.3
    """Lines correspond if they differ by no more [rad], in [0.01, 1.5]."""
    across: Annotated[float, within(0.01, 10.0)] = 0.3
    """Nor by more across [m], in [0.01, 10]."""
    rounds: Annotated[int, within(1, 1000)] = 20
    """Of eq. (9), at most, in [1, 1000]."""
    enough: Annotated[float, within(0.0, 1.0)] = 1e-4
    """A round that changes less ends it [m, rad], in [0, 1]."""


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


def nearest_lines(known: Lines, placed: Lines, config: PaperConfig) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Seen lines, in the world frame, and the nearest lines of the map that they may be."""
    turn = all_wrapped(placed.poses[:, None, 2] - known.poses[:, 2])
    delta = placed.poses[:, None, :2] - known.poses[:, :2]
    along, off = np.sum(delta * known.directions, axis=-1), np.abs(np.sum(delta * known.normals, axis=-1))
    beside = (along >= known.spans[:, 0]) & (along <= known.spans[:, 1])
    cost = np.where((np.abs(turn) < config.turn) & (off < config.across) & beside, off, np.inf)
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
        config: PaperConfig | None = None,
        extraction: ExtractionConfig | None = None,
    ) -> None:
        """Begin at a posture (x, y, θ) [m, m, rad] in a map."""
        self._known = known.lines
        self.posture = posture
        """Where the robot is taken to be, (x, y, θ) [m, m, rad]."""
        self._config = PaperConfig() if config is None else config
        self._extraction = ExtractionConfig() if extraction is None else extraction
        self.odometry = OdometryTrack()
        self._scanned = -math.inf

    def move(self, time: float, reading: tuple[float, float, float]) -> None:
        """Take a reading of the odometry, in its own frame; one that isn't newer is no news."""
        before = self.odometry.newest
        if time <= self.odometry.time:
            return
        self.odometry.add(time, reading)
        if before is not None:
            way, turn = step_between(before, reading)
            self.posture = advanced(self.posture, way, turn, 1.0)

    def see(self, scan: LaserScan) -> bool:
        """Take in a scan; returns whether it was: not if it isn't new, or the odometry doesn't cover it yet."""
        if scan.time <= self._scanned or not self.odometry.covers(scan.time, scan.end):
            return False
        self._scanned = scan.time
        seen = extract(deskewed(scan, self.odometry), self._extraction).lines
        for _ in range(self._config.rounds):
            placed = seen.moved(self.posture)
            mine, of = nearest_lines(self._known, placed, self._config)
            if not len(mine):
                break
            step = injected_update(self._known, placed.taken(mine), of)
            x, y, theta = self.posture
            self.posture = x + float(step[0]), y + float(step[1]), theta + float(step[2])
            if np.abs(step).max() < self._config.enough:
                break
        return True
