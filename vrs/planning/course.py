"""The tool's course in space: a straight line with an even turn, and a blend onto it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vrs.model import Array


def rotation_vector(R: Array) -> Array:
    """Rotation vector of a rotation matrix, (3,) [rad], its length in [0, π]."""
    # The quaternion by its largest component, which keeps full precision at every angle.
    r = R.ravel()
    squares: Array = np.array(
        [1 + r[0] + r[4] + r[8], 1 + r[0] - r[4] - r[8], 1 - r[0] + r[4] - r[8], 1 - r[0] - r[4] + r[8]]
    )
    i = int(np.argmax(squares))
    w, x, y, z = (
        (squares[0], r[7] - r[5], r[2] - r[6], r[3] - r[1]),
        (r[7] - r[5], squares[1], r[1] + r[3], r[2] + r[6]),
        (r[2] - r[6], r[1] + r[3], squares[2], r[5] + r[7]),
        (r[3] - r[1], r[2] + r[6], r[5] + r[7], squares[3]),
    )[i]
    vector = np.array([x, y, z])
    length = float(np.sqrt(vector @ vector))
    if length == 0.0:
        return np.zeros(3)
    if w < 0:
        w, vector = -w, -vector
    turn: Array = vector * (2.0 * np.arctan2(length, w) / length)
    return turn


def rotations(r: Array) -> Array:
    """Rotation matrices, (k, 3, 3), of rotation vectors, (k, 3) [rad]."""
    angle = np.sqrt((r * r).sum(1))
    half = 0.5 * angle
    first, second = np.sinc(angle / np.pi), 0.5 * np.sinc(half / np.pi) ** 2
    R: Array = second[:, None, None] * (r[:, :, None] * r[:, None, :])
    a = first[:, None] * r
    trace = 1.0 - second * angle * angle
    R[:, 0, 0] += trace
    R[:, 1, 1] += trace
    R[:, 2, 2] += trace
    R[:, 0, 1] -= a[:, 2]
    R[:, 1, 0] += a[:, 2]
    R[:, 0, 2] += a[:, 1]
    R[:, 2, 0] -= a[:, 1]
    R[:, 1, 2] -= a[:, 0]
    R[:, 2, 1] += a[:, 0]
    return R


def turning(r: Array, rate: Array) -> Array:
    """Angular velocities, (k, 3), of rotation vectors, (k, 3), that change at a rate, (k, 3)."""
    angle2 = (r * r).sum(1)
    angle = np.sqrt(angle2)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    third = np.where(small, 1.0 / 6.0 - angle2 / 120.0, (safe - np.sin(safe)) / safe**3)
    across = np.cross(r, rate)
    result: Array = rate + second[:, None] * across + third[:, None] * np.cross(r, across)
    return result


def polynomial(rows: Array, x: Array) -> Array:
    """Values, (k, n), of ascending powers, (K, n), at x, (k,)."""
    value = np.broadcast_to(rows[-1], (len(x), rows.shape[1]))
    for row in rows[-2::-1]:
        value = value * x[:, None] + row
    return value


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A straight line of the tool, or a blend onto one; position and rotation vector in one vector y, (6,).

    The rotation vector is relative to the goal's orientation: R = exp(r) R_goal. The line runs from the corner
    to the goal, x = 0 to 1. A blend is a polynomial that leaves `start` and meets the line at x = meet. The
    parameter is λ in [0, 1] on the blend and goes on at the speed with which the blend ends.
    """

    start: Array
    """y at the beginning, (6,) [m, rad]."""
    corner: Array
    """y where the line begins, (6,) [m, rad]; `start` where there's no blend."""
    goal: Array
    """Pose at the end, (4, 4)."""
    meet: float = 0.0
    """x where the blend meets the line; 0 where there's none."""
    bend: Array | None = None
    """y on the blend, ascending powers of λ, (K, 6); None where there's none."""
    power: int = 1
    """Without a blend, x is the parameter to this power: 2 makes joints that go like the root of x smooth."""

    @property
    def along(self) -> Array:
        """Way from the corner to the goal, (6,) [m, rad]."""
        return np.concatenate([self.goal[:3, 3] - self.corner[:3], -self.corner[3:]])

    @property
    def length(self) -> float:
        """Of the line [m]."""
        way = self.along[:3]
        return float(np.sqrt(way @ way))

    @property
    def angle(self) -> float:
        """By which the tool turns on the line [rad]."""
        turn = self.corner[3:]
        return float(np.sqrt(turn @ turn))

    @property
    def edges(self) -> Array:
        """Parameters where the course begins, meets the line, ends."""
        if self.meet:
            return np.array([0.0, 1.0, 1.0 + (1.0 - self.meet) / (2.0 * self.meet)])
        return np.array([0.0, 1.0])

    def share(self, s: Array) -> Array:
        """Share x of the line, (k,); 0 on the blend."""
        if self.meet:
            return np.where(s < 1.0, 0.0, self.meet * (2.0 * s - 1.0))
        return s**self.power

    def value(self, s: Array) -> Array:
        """Vectors y at parameters (k,), (k, 6) [m, rad]."""
        y: Array = self.corner + self.share(s)[:, None] * self.along
        if self.bend is not None:
            on = s < 1.0
            y[on] = polynomial(self.bend, s[on])
        return y

    def rate(self, s: Array) -> Array:
        """Derivative of y by the parameter, (k, 6)."""
        if self.bend is None:
            return (self.power * s ** (self.power - 1))[:, None] * self.along
        return polynomial(self.bend[1:] * np.arange(1.0, len(self.bend))[:, None], np.minimum(s, 1.0))

    def poses(self, s: Array) -> Array:
        """Poses at parameters (k,), (k, 4, 4)."""
        y = self.value(s)
        X = np.zeros((len(s), 4, 4))
        X[:, :3, :3] = rotations(y[:, 3:]) @ self.goal[:3, :3]
        X[:, :3, 3] = y[:, :3]
        X[:, 3, 3] = 1.0
        return X

    def speeds(self, s: Array) -> tuple[Array, Array]:
        """Linear and angular speed of the tool by the parameter, (k,) each."""
        rate = self.rate(s)
        w = rate[:, 3:]
        if self.meet:
            w = turning(self.value(s)[:, 3:], w)
        return np.sqrt((rate[:, :3] ** 2).sum(1)), np.sqrt((w * w).sum(1))

    def place(self, s: float) -> str:
        """Name a place on the course."""
        if self.meet and s < 1.0:
            return f"{100.0 * s:.3g} % into the blend"
        x = float(self.share(np.array([s]))[0])
        if self.length > 0:
            return f"{x * self.length:.4g} m from the beginning of the line ({100.0 * x:.3g} % of it)"
        return f"{100.0 * x:.3g} % of the turn"
