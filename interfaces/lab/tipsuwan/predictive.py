"""A model-predictive path tracker of today, beside the paper's: it knows what it has sent, and plans ahead.

The posture is carried on by the very commands that are on their way, not by the one that was driven last. From
there the errors against a reference that moves along the path are linear in what the drives differ from the
reference's, and the best ones whose changes keep their limits are a bounded linear least-squares problem, which
SciPy solves at each step.

Source: Klančar, Škrjanc, Tracking-error model-based predictive control for mobile robots in real time, Robotics and
Autonomous Systems 55, 2007.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from typing import Final

import numpy as np

from interfaces.link import Echo, Probe, ProbeConfig, RoundTripEstimator
from interfaces.middleware import DriveFeedback, DriveSetpoint
from robots.onboard.curve import Curve, CurvePoint
from robots.onboard.driving import STAND, Drive, Posture
from vrs.checks import number_in
from vrs.mobile import advanced, clipped, wrapped
from vrs.model import Array

STEP: Final = 0.1
"""Of the horizon [s]."""
HORIZON: Final = 10
"""Steps."""
PERIOD: Final = 0.05
"""Between two plans [s], no longer than a step."""
CRUISE: Final = 1.5
"""Speed of the reference on a straight line [m/s]."""
LATERAL: Final = 1.5
"""Its largest acceleration across the path [m/s²]."""
ALONG: Final = 1.5
"""Its largest acceleration along the path [m/s²]: it brakes for bends, and for the end."""
TURNING: Final = 8.0
"""Largest change of ω [rad/s²]."""
SLOWEST: Final = 0.1
"""Speed at the path's end [m/s]."""
V_MAX, W_MAX = 2.0, 4.0
"""Largest |v| [m/s] and |ω| [rad/s]: the tracker's α and 2α."""
WEIGHTS: Final = (1.0, 4.0, 0.5)
"""Of the errors along and across the path [1/m] and of the heading [1/rad]."""
EFFORT: Final = (0.1, 0.06)
"""Of the changes of v and ω from step to step [s/m, s/rad]."""


class PredictiveController:
    """Stands where the middleware and its tracker do; sans I/O."""

    def __init__(self, curve: Curve, probing: ProbeConfig, lag: float = 0.0) -> None:
        """Take the path, and how to probe the network.

        Args:
            curve: The path.
            probing: How the network is probed.
            lag: Of the robot's motors, after which a drive takes effect [s], in [0, 1].
        """
        self._curve = curve
        self._lag = number_in("lag", lag, 0.0, 1.0)
        self._traffic = RoundTripEstimator(0, probing)
        self._on_the_way: deque[tuple[float, Drive]] = deque([(-math.inf, STAND)])
        """When each command was sent [s], and what it was."""
        self._heard, self._sent = -1, 0
        self._due = -math.inf
        self._s: float | None = None
        self._ways, self._allowed = _speeds(curve)

    def next_deadline(self) -> float:
        """When the next probe is due [s]."""
        return self._traffic.next_deadline()

    def to_send(self, *, now: float) -> Probe | None:
        """Give it if it's due."""
        return self._traffic.to_send(now=now)

    def receive(self, message: Echo | DriveFeedback, *, now: float) -> DriveSetpoint | None:
        """Take what the robot sent; once a period a plan's first drive goes back."""
        if isinstance(message, Echo):
            self._traffic.receive(message, now=now)
            return None
        tau = self._traffic.delays.median
        if message.number <= self._heard or tau is None:
            return None
        self._heard = message.number
        if now < self._due:
            return None
        self._due = now + PERIOD
        drive = self._planned(self._carried_on(message.posture, now, tau))
        self._on_the_way.append((now, drive))
        self._sent += 1
        return DriveSetpoint(self._sent - 1, drive)

    def _carried_on(self, posture: Posture, now: float, tau: float) -> Posture:
        """Where the robot will be when what is sent now takes effect: what was sent since then moves it."""
        sent, since = self._on_the_way, now - tau - self._lag
        while len(sent) > 1 and sent[1][0] <= since:
            sent.popleft()
        at: tuple[float, float, float] = posture
        ends = [*(t for t, _ in sent), now][1:]
        for (start, drive), end in zip(sent, ends, strict=True):
            at = advanced(at, drive.v, drive.w, end - max(start, since))
        return Posture(*at)

    def _planned(self, posture: Posture) -> Drive:
        from scipy.optimize import lsq_linear

        n = HORIZON
        places, speeds = self._reference(posture)
        free, driven, wanted = self._predicted(posture, places, speeds)
        before = self._on_the_way[-1][1]
        # What is looked for are changes: drive k is the one before plus all changes up to k.
        summed = np.kron(np.tril(np.ones((n, n))), np.eye(2))
        weights = np.tile(WEIGHTS, n)[:, None]
        rows = np.concatenate([weights * (driven @ summed), np.diag(np.tile(EFFORT, n))])
        missed = free + driven @ (np.tile(before, n) - wanted)
        right = np.concatenate([-weights[:, 0] * missed, np.zeros(2 * n)])
        most = STEP * np.tile((ALONG, TURNING), n)
        most[:2] *= PERIOD / STEP
        change = lsq_linear(rows, right, (-most, most), method="bvls").x
        v, w = before.v + float(change[0]), before.w + float(change[1])
        return Drive(clipped(v, V_MAX), clipped(w, W_MAX))

    def _reference(self, posture: Posture) -> tuple[list[CurvePoint], list[float]]:
        """Where the robot should be at each step, and how fast on the way to the next one."""
        curve = self._curve
        self._s = s = curve.nearest(posture.x, posture.y, around=self._s, window=1.0)
        places, speeds = [curve.at(s)], []
        speed = max(self._on_the_way[-1][1].v, 0.0)
        for _ in range(HORIZON):
            speed = min(speed + ALONG * STEP, self._allowed[bisect_right(self._ways, s) - 1])
            ahead = min(s + speed * STEP, curve.length)
            speeds.append((ahead - s) / STEP)
            s = ahead
            places.append(curve.at(s))
        return places, speeds

    def _predicted(
        self, posture: Posture, places: list[CurvePoint], speeds: list[float]
    ) -> tuple[Array, Array, Array]:
        """Errors (3 n,) with the reference's drives, what drives add to them (3 n, 2 n), and those drives (2 n,).

        An error is along and across the reference's heading, and in heading.
        """
        n, dt = HORIZON, STEP
        free, driven, wanted = np.zeros((n, 3)), np.zeros((n, 3, 2 * n)), np.zeros(2 * n)
        error, by = _error(posture, places[0]), np.zeros((3, 2 * n))
        for k, (place, after, v) in enumerate(zip(places, places[1:], speeds, strict=False)):
            turn = wrapped(after.theta - place.theta)
            wanted[2 * k : 2 * k + 2] = v, turn / dt
            c, s = math.cos(turn), math.sin(turn)
            turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            step = turned @ np.array([[1.0, 0.0, 0.0], [0.0, 1.0, v * dt], [0.0, 0.0, 1.0]])
            error, by = step @ error, step @ by
            by[:, 2 * k] += turned @ (dt, 0.0, 0.0)
            by[:, 2 * k + 1] += turned @ (0.0, 0.5 * v * dt * dt, dt)
            free[k], driven[k] = error, by
        return free.ravel(), driven.reshape(3 * n, 2 * n), wanted


def _speeds(curve: Curve) -> tuple[list[float], list[float]]:
    """Ways along the path [m], and how fast the reference may be there [m/s], from the end backwards."""
    s, _, bend = curve.table
    allowed = np.minimum(CRUISE, np.sqrt(LATERAL / np.maximum(bend, 1e-9))).tolist()
    allowed[-1] = SLOWEST
    ways = s.tolist()
    for k in range(len(ways) - 2, -1, -1):
        before = math.sqrt(allowed[k + 1] ** 2 + 2 * ALONG * (ways[k + 1] - ways[k]))
        allowed[k] = max(min(allowed[k], before), SLOWEST)
    return ways, allowed


def _error(posture: Posture, place: CurvePoint) -> Array:
    c, s = math.cos(place.theta), math.sin(place.theta)
    dx, dy = posture.x - place.x, posture.y - place.y
    return np.array([c * dx + s * dy, c * dy - s * dx, wrapped(posture.theta - place.theta)])
