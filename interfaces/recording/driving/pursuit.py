"""How a real mobile robot follows the virtual one's path: at which place it is when, and how far beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vrs.model import Array
from vrs.path_matching import PathMatch, match_paths

if TYPE_CHECKING:
    from interfaces.recording.recording import Recording

MOST = 36_000
"""Samples of a recording that is matched at most: beyond that it takes too long, and nobody is told."""


FARTHEST = 50_000.0
"""Longest path that is matched [m]: what a recording's length allows at full speed, and no hostile one's."""


def matchable(postures: Array) -> bool:
    """Whether a virtual robot's path, (k, 3), isn't too long to be matched."""
    steps = np.linalg.norm(np.diff(postures[:, :2], axis=0), axis=1)
    return bool(steps.sum() <= FARTHEST)


class Pursuit:
    """A recording's match, made when it's first asked for."""

    def __init__(self, recording: Recording) -> None:
        """Take a recording."""
        self._recording = recording
        self._match: PathMatch | None = None
        self._place: Array = np.empty(0)
        self._moments: Array = np.empty(0)
        self._until = -np.inf

    def prepare(self) -> None:
        """Match what the recording holds now."""
        until = self._recording.span[1]
        if until == self._until:
            return
        self._until, self._match = until, None
        track = self._recording.track(self._recording.kind.real)
        virtual = self._recording.virtual(track.t)
        known = np.isfinite(virtual).all(axis=1)
        if not 2 <= np.count_nonzero(known) <= MOST or not matchable(virtual[known]):
            return
        t, leader = track.t[known], virtual[known, :2]
        self._match = match_paths(t, leader, track.q[known, :2])
        self._moments = t
        self._place = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(leader, axis=0), axis=1))))

    def play(self, t: float) -> float | None:
        """When the virtual robot was last where the real one is at a time [s]; that time if it still is there."""
        self.prepare()
        match = self._match
        if match is None:
            return None
        reached = len(match.t_follower)
        whole = reached == len(match.s) and t >= match.t_follower[-1]
        s = self._place[-1] if whole else float(np.interp(t, match.t_follower, match.s[:reached]))
        after = int(np.searchsorted(self._place, s + 1e-9, side="right"))
        if after == len(self._place):
            return t
        before = after - 1
        share = (s - self._place[before]) / (self._place[after] - self._place[before])
        left = self._moments[before] + max(float(share), 0.0) * (self._moments[after] - self._moments[before])
        return min(t, float(left))

    def error(self, t: float, q_real: Array, play: float) -> float | None:  # noqa: ARG002 - the match knows them
        """How far the real robot is beside the virtual one's path at a time [m]."""
        self.prepare()
        return None if self._match is None else float(np.interp(t, self._match.t, self._match.distance))
