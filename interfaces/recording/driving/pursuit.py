"""How a real mobile robot follows the virtual one's path: at which place it is when, and how far beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vrs.comparison import PathMatch, match_paths, measured_rows
from vrs.model import Array

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
        self._beside = self._reached = np.empty(0), np.empty(0)
        """Of what was measured: times and distances; when places along the path were reached, and those."""
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
        # A row without a measurement in each gap: nothing is known on either side of it.
        moments = np.union1d(track.t, track.gaps.mean(axis=1))
        real = track.on(moments, "q")
        real[~np.isin(moments, track.t)] = np.nan
        virtual = self._recording.virtual(moments)
        known = measured_rows(virtual)
        if not 2 <= np.count_nonzero(known) <= MOST or not matchable(virtual[known]):
            return
        t, leader = moments[known], virtual[known, :2]
        match = self._match = match_paths(t, leader, real[known, :2])
        seen, there = np.isfinite(match.distance), np.isfinite(match.t_follower)
        self._beside = match.t[seen], match.distance[seen]
        self._reached = match.t_follower[there], match.s[: len(there)][there]
        self._moments = t
        self._place = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(leader, axis=0), axis=1))))

    def play(self, t: float) -> float | None:
        """When the virtual robot was last where the real one is at a time [s]; that time if it still is there."""
        self.prepare()
        match = self._match
        if match is None:
            return None
        reached, places = self._reached
        whole = len(match.t_follower) == len(match.s) and t >= match.t_follower[-1]
        s = self._place[-1] if whole or not len(reached) else float(np.interp(t, reached, places))
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
        return None if self._match is None else float(np.interp(t, *self._beside))
