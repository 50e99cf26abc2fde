"""Parts of a play time: a change of pace, then a steady pace."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robots.onboard.play import PlayState
from vrs.model import Array
from vrs.pacing import TimeScaling

STEADY = TimeScaling((), ())
"""No change of pace."""


class Leg(NamedTuple):
    """A change of pace, then a steady pace."""

    begin: float
    """By the robot's clock [s]."""
    law: TimeScaling
    p: float
    """Where the law ends [s]."""
    pace: float
    """The steady pace."""


def along(leg: Leg, t: Array) -> PlayState:
    """Where play is at times on a leg, (k,)."""
    u = t - leg.begin
    pace, rate = np.empty(len(u)), np.zeros(len(u))
    pace.fill(leg.pace)
    if not leg.law.durations:
        return PlayState(leg.p + leg.pace * u, pace, rate)
    late = u - leg.law.duration
    p = leg.p + leg.pace * late
    changing = late < 0
    if changing.any():
        p[changing], pace[changing], rate[changing], _ = leg.law(u[changing])
    return PlayState(p, pace, rate)


def braking(p: float, pace: float, duration: float) -> TimeScaling:
    """Slow down evenly to a stop."""
    return TimeScaling((duration,), ((p, pace, -0.5 * pace / duration),))
