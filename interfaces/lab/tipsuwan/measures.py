"""What is said of a run: its mean error, how much of the path was made, and why the rest wasn't."""

from __future__ import annotations

import enum
import math
from typing import Final, NamedTuple

import numpy as np

from interfaces.lab.tipsuwan.run import DriveTrace
from vrs.model import Array

EVERY: Final = 0.05
"""Between postures that are measured [s]."""
LAST: Final = 5.0
"""Of a run that failed, what its reason is read from [s]."""
WINDOW: Final = 0.2
"""How far along the path a robot is looked for from where it was [m]: twice what it goes in 0.05 s at 2 m/s."""
_SWINGS: Final = 4
"""Changes of side or of direction in the last seconds that make a cycle."""


class Reason(enum.StrEnum):
    """Why a robot didn't arrive."""

    ARRIVED = "arrived"
    """It did."""
    CIRCLING = "circling"
    """It turned round and round, one way: by a full turn or more in the last 5 s."""
    LIMIT_CYCLE = "limit cycle"
    """It swung from side to side of the path, or to and fro, four times or more in the last 5 s."""
    STUCK = "stuck"
    """It made less than 1 cm/s in the last 5 s."""
    SLOW = "slow"
    """It was on its way."""


def beside(track: DriveTrace) -> tuple[Array, Array]:
    """Distances to the path's nearest point, left positive [m], and ways along it [m], every 0.05 s, (k,) each.

    The way is looked for about where the robot was, so that none is made by a robot that comes across a later part;
    the distance is that to the whole path.
    """
    curve, away, ways, at = track.curve, [], [], 0.0
    for x, y, _ in _sampled(track).tolist():
        place = curve.at(curve.nearest(x, y))
        left = math.cos(place.theta) * (y - place.y) - math.sin(place.theta) * (x - place.x)
        away.append(math.copysign(math.hypot(x - place.x, y - place.y), left))
        at = curve.nearest(x, y, around=at, window=WINDOW)
        ways.append(at)
    return np.array(away), np.array(ways)


class PathMeasures(NamedTuple):
    """What is said of a run."""

    error: float
    """Mean distance of the robot from the path until it arrived, or the run was over [m]."""
    progress: float
    """Share of the path that was made, in [0, 1]."""
    reason: Reason
    """Why it didn't arrive."""


def measured(track: DriveTrace) -> PathMeasures:
    """Measure a run."""
    away, ways = beside(track)
    progress = 1.0 if track.arrived else float(ways.max()) / track.curve.length
    return PathMeasures(float(np.abs(away).mean()), progress, _reason(track, away, ways))


def _reason(track: DriveTrace, away: Array, ways: Array) -> Reason:
    """Why the robot didn't arrive, read from its last 5 s."""
    if track.arrived:
        return Reason.ARRIVED
    count = round(LAST / EVERY)
    heading = _sampled(track)[-count:, 2]
    if abs(heading[-1] - heading[0]) >= math.tau:
        return Reason.CIRCLING
    since = track.t >= track.t[-1] - LAST
    if max(_changes(away[-count:]), _changes(track.drives[since, 0])) >= _SWINGS:
        return Reason.LIMIT_CYCLE
    return Reason.STUCK if ways[-1] - ways[-count:][0] < 0.01 * LAST else Reason.SLOW


def _sampled(track: DriveTrace) -> Array:
    period = float(track.t[1] - track.t[0]) if len(track.t) > 1 else EVERY
    return track.postures[:: max(round(EVERY / period), 1)]


def _changes(values: Array) -> int:
    """How often values change their sign."""
    signs = np.sign(values[values != 0])
    return int(np.count_nonzero(signs[1:] != signs[:-1]))
