"""A crane, made up: it turns, lifts and turns its hook. A robot of one's own."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from math import acos, atan2, cos, hypot, sin

import numpy as np

from robots import Robot
from robots.robot import ExactArm, Gripper
from vrs.errors import UnreachablePoseError
from vrs.model import Limits

BOOM, HOOK = 0.6, 0.3


class Crane:
    """Turns about z, lifts along z, turns about z at the end of its boom."""

    name, prismatic, tool_speed, tool_turn_speed, characteristic_length = "crane", (1,), 0.3, 1.0, BOOM
    limits = Limits([-2.5, 0.0, -2.8], [2.5, 0.5, 2.8], [1.0, 0.3, 2.0], [4.0, 1.5, 8.0])
    poses = {"nominal": np.array([0.0, 0.2, 1.0]), "low": np.array([0.5, 0.05, -1.0])}  # noqa: RUF012

    def links(self, q):
        q = np.asarray(q, float)
        X = np.zeros((*q.shape[:-1], 4, 4, 4)) + np.eye(4)
        for link, (turn, reach) in enumerate(((0, 0), (0, BOOM), (q[..., 2], HOOK)), start=1):
            yaw, X[..., link, 2, 3] = q[..., 0] + turn, q[..., 1] * (link > 1)
            X[..., link, 0, 0], X[..., link, 1, 0] = np.cos(yaw), np.sin(yaw)
            X[..., link, 0, 1], X[..., link, 1, 1] = -np.sin(yaw), np.cos(yaw)
            X[..., link, :2, 3] = X[..., link - 1, :2, 3] + reach * X[..., link, :2, 0] if reach else 0.0
        return X

    def forward(self, q):
        return self.links(q)[..., -1, :, :]

    def jacobian(self, q):
        X, J = self.links(q), np.zeros((*np.shape(q)[:-1], 6, 3))
        for j, elbow in ((0, 0), (2, 2)):
            away = X[..., 3, :2, 3] - X[..., elbow, :2, 3]
            J[..., 0, j], J[..., 1, j], J[..., 5, j] = -away[..., 1], away[..., 0], 1.0
        J[..., 2, 1] = 1.0
        return J

    def inverse(self, X, within_limits=True):
        x, y, z, found = *X[:3, 3], []
        bend = (hypot(x, y) ** 2 - BOOM**2 - HOOK**2) / (2 * BOOM * HOOK)
        for q3 in (acos(bend), -acos(bend)) if abs(bend) <= 1 else ():
            q = np.array([atan2(y, x) - atan2(HOOK * sin(q3), BOOM + HOOK * cos(q3)), z, q3])
            inside = not within_limits or ((q >= self.limits.q_min) & (q <= self.limits.q_max)).all()
            found += [q] if inside and np.allclose(self.forward(q), X, atol=1e-6) else []
        return np.array(found).reshape(-1, 3)

    def inverse_near(self, X, q, configuration=None):
        found = self.inverse(X)
        if not len(found):
            raise UnreachablePoseError("no way of the crane leads there")
        return min(found, key=lambda one: np.abs(one - q).max())

    def follow(self, X, q, configuration=None):
        return np.array([q := self.inverse_near(one, q) for one in X])

    def configuration(self, q):
        return "LEFT" if q[2] > 0 else "RIGHT"


class Swaying(ExactArm):
    """Follows a little late, and sags under its load."""

    sag = 0.0

    def attach(self, mass):
        self.sag = 0.001 * mass

    def release(self):
        self.sag = 0.0

    def follow(self, prepared):
        measured = super().follow(prepared)
        return replace(measured, q=prepared.q - 0.004 * prepared.qd - self.sag * np.array([0.0, 1.0, 0.0]))


@contextmanager
def swaying(q, *, friction=True, dt=1e-3):
    yield Swaying()


ROBOT = Robot("crane", Crane(), bodies={"swaying": swaying}, devices=(Gripper((0.0, 0.0, -0.1)),))
