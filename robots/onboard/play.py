"""Where a robot's play time is, and was."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from vrs.model import Array


class PlayState(NamedTuple):
    """Where play is, at times (k,)."""

    p: Array
    """Play time, on the timeline [s]."""
    pace: Array
    """dp/dt."""
    rate: Array
    """d²p/dt² [1/s]."""


def play_of(newest_first: Iterable[tuple[float, Callable[[Array], PlayState]]], t: Array) -> PlayState:
    """Where play is at ascending times [s], (k,), k ≥ 1.

    Args:
        newest_first: Since when each course counts [s], and what says where play is on it; the oldest counts before
            that, too. No more are taken than are needed.
        t: The times.
    """
    states: list[PlayState] = []
    high = len(t)
    for since, at in newest_first:
        low = min(int(np.searchsorted(t, since)), high)
        if high > low:
            states.append(at(t[low:high]))
        high = low
        if high == 0:
            break
    if high > 0:
        states.append(at(t[:high]))
    states.reverse()
    return PlayState(*(np.concatenate([state[i] for state in states]) for i in range(3)))


class EvenPlay:
    """Play at an even pace, 1 or none: p = pace · t + D, up to an end."""

    def __init__(self, D: float, pace: float = 1.0, end: float = math.inf) -> None:
        self.D, self.pace, self.end = D, pace, end

    def at(self, t: Array) -> PlayState:
        """Where play is at times [s], (k,)."""
        p = self.pace * np.asarray(t, float) + self.D
        return PlayState(np.minimum(p, self.end), np.where(p < self.end, self.pace, 0.0), np.zeros_like(p))

    foreseen = at
