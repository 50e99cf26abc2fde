"""Whether a place can be told from its scans at all: does any other place look the same, but for 3 cm rms?

A scan here is a whole turn, without noise. All places of a grid are compared by the correlation of their ranges
over all rotations at once; the pairs that are most alike are then moved against each other until they fit best.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robots.bullet.rooms import Room
from robots.ipr.floor_plan import FloorPlan, Ways
from vrs.model import Array

ALIKE: Final = 0.03
"""Scans that fit as well, rms [m], are of one place as far as anybody can tell."""
APART, APART_TURN = 0.5, math.radians(15)
"""Places that are nearer and turned less are the same [m, rad]."""
_BEAMS = 120
_GRID = 0.4
_CLOSE = 40
"""Pairs that are moved against each other."""
_REACH = 8.0
_CAP = 1.0
"""A beam that's off by more counts no more, when pairs are chosen [m]."""
_HALVINGS = 9


class Lookalikes:
    """Full turns from all over a room."""

    def __init__(self, room: Room, height: float) -> None:
        """Take a room as it stands, without people, and the scanner's height [m]."""
        standing = Room(room.name, room.length, room.width, room.start, room.blocks, room.columns)
        self._plan = FloorPlan(standing, height)
        places = Ways(room, 0.4).places
        cells = np.unique(np.floor(places / _GRID), axis=0, return_index=True)[1]
        self.places = places[cells]
        """Where scans were made [m], (n, 2)."""
        self._ways = np.arange(_BEAMS) * (math.tau / _BEAMS)
        self.scans = np.array([self.scan((x, y, 0.0)) for x, y in self.places.tolist()])
        """Ranges [m], (n, 120)."""

    def scan(self, posture: tuple[float, float, float]) -> Array:
        """A whole turn from a posture, counter-clockwise from ahead [m], (120,)."""
        x, y, theta = posture
        angles = theta + self._ways
        origins = np.tile((x, y), (_BEAMS, 1))
        found = self._plan.cast(origins, np.column_stack([np.cos(angles), np.sin(angles)]), 0.0, _REACH)
        return np.minimum(found, _REACH)

    def best(self) -> float:
        """How well the two most alike different places fit, rms [m]."""
        S = self.scans
        spectrum = np.fft.rfft(S, axis=1)
        power = (S * S).sum(axis=1)
        pairs = []
        for k in range(len(S)):
            same = np.fft.irfft(spectrum[k] * np.conj(spectrum[k:]), _BEAMS, axis=1)
            squares = np.maximum(power[k] + power[k:, None] - 2 * same, 0.0) / _BEAMS
            turn = np.minimum(np.arange(_BEAMS), _BEAMS - np.arange(_BEAMS)) * math.tau / _BEAMS
            near = np.linalg.norm(self.places[k:] - self.places[k], axis=1) < APART + _GRID
            squares[near[:, None] & (turn < APART_TURN + 0.2)] = np.inf
            i, j = np.unravel_index(np.argsort(squares, axis=None)[:3], squares.shape)
            pairs += [(float(squares[a, b]), k, k + int(a), int(b)) for a, b in zip(i, j, strict=True)]
        pairs.sort()
        return min((self._fit(k, other, shift) for _, k, other, shift in pairs[:_CLOSE]), default=math.inf)

    def _fit(self, k: int, other: int, shift: int) -> float:
        """Move one of two places until its scan fits the other's best; the rms then [m]."""
        wanted = self.scans[k]
        x, y = self.places[other].tolist()
        at = np.array([x, y, -shift * math.tau / _BEAMS])
        step = np.array([_GRID / 2, _GRID / 2, math.tau / _BEAMS])
        best = self._off(wanted, at)
        for _ in range(_HALVINGS):
            for _ in range(4):
                trials = [at + sign * step * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
                offs = [self._off(wanted, trial) for trial in trials]
                least = int(np.argmin(offs))
                if offs[least] >= best:
                    break
                at, best = trials[least], offs[least]
            step = step / 2
        if self._same(k, at):
            return math.inf
        return math.sqrt(float(np.mean((self.scan((at[0], at[1], at[2])) - wanted) ** 2)))

    def _off(self, wanted: Array, at: Array) -> float:
        difference = self.scan((float(at[0]), float(at[1]), float(at[2]))) - wanted
        return float(np.mean(np.minimum(difference * difference, _CAP)))

    def _same(self, k: int, at: Array) -> bool:
        turned = abs(math.remainder(float(at[2]), math.tau)) < APART_TURN
        return turned and math.dist(self.places[k].tolist(), at[:2].tolist()) < APART


def distinctive(room: Room, height: float = 0.3) -> bool:
    """Whether no two different places of a room look alike."""
    return Lookalikes(room, height).best() > ALIKE
