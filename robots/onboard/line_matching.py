"""Which line of the map a line of a scan is: by gates on what the filter expects, and by what the others say.

A seen line may be the map's if it faces the same way, lies where that is, and differs by no more than the doubt
allows (Mahalanobis). Where two lines of the map at different places could be it, nobody says which. Then each is
held against the rest: what it is off from what all others together say, in its own deviations; the worst goes until
none is too far off. That drops furniture that stands nearly where a wall is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.onboard.gsp_map import Lines
from robots.onboard.line_filter import LineFilter, Sights
from vrs.checks import number_in
from vrs.mobile.kinematics import all_wrapped
from vrs.model import Array


@dataclass(frozen=True, slots=True)
class MatchingConfig:
    """Gates."""

    gate: float = 13.8
    """Largest squared Mahalanobis distance, two degrees of freedom, in [1, 100]; 13.8 lets 99.9 % pass."""
    against: float = 14.0
    """The same of a line against all others, in [1, 100]."""
    overlap: float = 0.5
    """Share of the seen line that lies on the map's, in [0, 1]."""
    slack: float = 0.1
    """By how much the ends of the map's lines may be off [m], in [0, 1]."""
    apart: float = 0.04
    """Two candidates this far apart across are different [m], in [0, 1]."""
    turn: float = 0.35
    """Largest difference in direction that's looked at [rad], in [0.01, 1]."""
    across: float = 1.0
    """And across [m], in [0.05, 10]."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("gate", 1.0, 100.0), ("against", 1.0, 100.0), ("overlap", 0.0, 1.0), ("slack", 0.0, 1.0),
            ("apart", 0.0, 1.0), ("turn", 0.01, 1.0), ("across", 0.05, 10.0),
        ):  # fmt: skip
            number_in(name, getattr(self, name), low, high)


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
