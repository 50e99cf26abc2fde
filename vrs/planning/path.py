"""The tool's course in space, and the joints along it as Chebyshev series of its parameter.

A course is a straight line with an even turn, or a blend onto it. A robot is seen through its tool: its poses are
those of a frame fixed to the last link.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from vrs.errors import PlanningError, UnresolvedError
from vrs.model import Array, Limits, RobotModel, frozen_array
from vrs.planning.redundancy import TASK


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


@dataclass(frozen=True, slots=True, eq=False)
class Tooled:
    """A robot model whose `forward`, `jacobian` and inverses are of the tool; joints and links stay what they are.

    Attributes of the arm itself, such as how near it is to a singularity, are asked of `arm`.
    """

    arm: RobotModel
    """The robot."""
    tool: Array
    """Pose of the tool in the frame of the last link, (4, 4)."""
    to_link: Array
    """Pose of the last link in the tool's frame, (4, 4)."""
    name: str
    """This and what follows are the arm's."""
    limits: Limits
    prismatic: Collection[int]
    poses: Mapping[str, Array]
    """Named joint positions, each (n,) [rad]."""
    tool_speed: float
    """Nominal linear speed of the tool [m/s]."""
    tool_turn_speed: float
    """Nominal angular speed of the tool [rad/s]."""
    characteristic_length: float
    """[m]."""

    def forward(self, q: ArrayLike) -> Array:
        """Pose of the tool in the base frame, (4, 4), or (k, 4, 4) for q of shape (k, n)."""
        return self.arm.forward(q) @ self.tool

    def links(self, q: ArrayLike) -> Array:
        """Poses of base and links: of the arm alone."""
        return self.arm.links(q)

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobian of the tool in the base frame, (6, n) or (k, 6, n)."""
        J = np.array(self.arm.jacobian(q))
        arm = self.arm.forward(q)[..., :3, :3] @ self.tool[:3, 3]
        J[..., :3, :] += np.cross(J[..., 3:, :], arm[..., :, None], axis=-2)
        return J

    def inverse(self, X: ArrayLike, within_limits: bool = True) -> Array:
        """Every joint solution of one pose of the tool, (m, n); m is 0 where none exists."""
        return self.arm.inverse(np.asarray(X) @ self.to_link, within_limits)

    def inverse_near(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """The solution of a pose of the tool that is nearest to q."""
        return self.arm.inverse_near(np.asarray(X) @ self.to_link, q, configuration)

    def follow(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """Solutions of poses of the tool in a row, (k, 4, 4), that go on from q."""
        return self.arm.follow(np.asarray(X) @ self.to_link, q, configuration)

    def configuration(self, q: ArrayLike) -> str:
        """The arm's at q."""
        return self.arm.configuration(q)


def tooled(model: RobotModel, tool: Array | None) -> RobotModel:
    """The model seen through a tool, (4, 4); itself where there's none."""
    if tool is None:
        return model
    # Its own rotation may be orthonormal to 1e-6 only, which would show at the end of a line.
    U, _, Vt = np.linalg.svd(tool[:3, :3])
    R, p = U @ Vt, tool[:3, 3]
    there, back = np.eye(4), np.eye(4)
    there[:3, :3], there[:3, 3] = R, p
    back[:3, :3], back[:3, 3] = R.T, -R.T @ p
    return Tooled(
        model, there, back, model.name, model.limits, model.prismatic, model.poses, model.tool_speed,
        model.tool_turn_speed, model.characteristic_length,
    )  # fmt: skip


def bare(model: RobotModel) -> RobotModel:
    """The robot itself, without a tool that it may be seen through."""
    return model.arm if isinstance(model, Tooled) else model


ORDER: Final = 16
"""Degree of the series."""
NODES: Final = frozen_array(-np.cos(np.pi * np.arange(ORDER + 1) / ORDER))
"""Where a piece is sampled, on [-1, 1], ends and middle included."""


def _polynomials(x: Array) -> Array:
    """Chebyshev polynomials at x in [-1, 1], (k,): (k, 17)."""
    values: Array = np.cos(np.arccos(x)[:, None] * np.arange(ORDER + 1))
    return values


def _differentiate() -> Array:
    """From coefficients of a series to those of its derivative, (17, 17)."""
    k, n = np.indices((ORDER + 1, ORDER + 1))
    # 2 n T_(n-1), 2 n T_(n-3), ... make the derivative of T_n, its constant term counted half.
    matrix: Array = np.where((n > k) & ((n - k) % 2 == 1), 2.0 * n, 0.0)
    matrix[0] *= 0.5
    return matrix


def _analyse() -> Array:
    """From values at NODES to the coefficients of their series, (17, 17)."""
    ends = np.where(np.arange(ORDER + 1) % ORDER == 0, 0.5, 1.0)
    matrix: Array = _polynomials(NODES).T * (2.0 / ORDER * ends[:, None] * ends)
    return matrix


_SERIES: Final = frozen_array(_analyse())
_DERIVE: Final = frozen_array(_differentiate())
_EXTRAPOLATE: Final = frozen_array(
    [
        np.prod([(NODES[0] - NODES[j]) / (NODES[i] - NODES[j]) for j in range(1, ORDER + 1) if j != i])
        for i in range(1, ORDER + 1)
    ]
)
"""Weights of the other nodes that give the value at the first."""

DERIVATIVES: Final = frozen_array(
    [_polynomials(NODES) @ np.linalg.matrix_power(_DERIVE, k) @ _SERIES for k in (1, 2, 3)]
)
"""From values at NODES to the first three derivatives there, (3, 17, 17)."""

RESOLVED: Final = 1e-12
"""Largest of the last coefficients of a series that has converged [rad]."""
ROUNDING: Final = 1e-2
"""Share of the tolerance below which the last coefficients are dropped."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Joints along a course: a Chebyshev series a piece."""

    course: Course
    edges: Array
    """Parameters where pieces meet, (m + 1,)."""
    series: Array
    """Coefficients of q and of its first three derivatives by the parameter, (m, 17, 4, n)."""
    tolerance: float
    """At which the series have converged [rad]."""

    def sample(self, x: Array) -> tuple[Array, Array]:
        """The same places of every piece.

        Args:
            x: Places on [-1, 1], (k,).

        Returns:
            Parameters, (m, k), and q and its derivatives there, (m, k, 4, n).
        """
        m, _, orders, n = self.series.shape
        V = _polynomials(x)
        values = (V @ self.series.reshape(m, ORDER + 1, orders * n)).reshape(m, len(x), orders, n)
        low, high = self.edges[:-1, None], self.edges[1:, None]
        return low + (high - low) * (0.5 + 0.5 * x), values

    def value(self, s: Array, low: Array | None = None, high: Array | None = None) -> Array:
        """Joints at parameters.

        Args:
            s: Parameters, (k,); what lies beyond the ends counts as the ends.
            low: First piece that may be taken, (k,).
            high: Last piece that may be taken, (k,).

        Returns:
            q and its first three derivatives by the parameter, (k, 4, n).
        """
        m, _, orders, n = self.series.shape
        i = np.searchsorted(self.edges, s, side="right") - 1
        i = np.clip(i, 0 if low is None else low, m - 1 if high is None else high)
        begin, end = self.edges[i], self.edges[i + 1]
        x = np.clip((2.0 * s - begin - end) / (end - begin), -1.0, 1.0)
        V = _polynomials(x)
        joints = np.empty((len(s), orders * n))
        for piece in np.unique(i):
            own = i == piece
            joints[own] = V[own] @ self.series[piece].reshape(ORDER + 1, orders * n)
        return joints.reshape(len(s), orders, n)


def trace(
    course: Course,
    q: Array,
    model: RobotModel,
    configuration: str | None,
    *,
    pieces: int,
    halvings: int,
    free: bool,
    tolerance: float,
    q_goal: Array | None = None,
) -> Path:
    """Follow a course with the joints.

    Args:
        course: What the tool does.
        q: Joint values to go on from, (n,) [rad].
        model: The robot.
        configuration: As in RobotModel.follow.
        pieces: Into which each part of the course is divided at first.
        halvings: How often a piece may be halved.
        free: Whether the pose at the beginning leaves joints free: they're then what the path needs.
        tolerance: At which a series has converged [rad].
        q_goal: Joint values that a redundant arm is to arrive at, (n,) [rad]; None leaves them to the arm.

    Raises:
        UnresolvedError: If the joints aren't smooth.
        PlanningError: If the course leaves the workspace.
    """
    marks = course.edges
    edges = np.concatenate([np.linspace(a, b, pieces + 1)[:-1] for a, b in pairwise(marks)] + [marks[-1:]])
    low, high = edges[:-1], edges[1:]
    redundant = len(q) > TASK
    known, near = q[None], np.stack([q, q_goal]) if redundant and q_goal is not None else q
    done: list[tuple[Array, Array]] = []
    for level in range(halvings + 1):
        m = len(low)
        s = (0.5 * (low + high))[:, None] + (0.5 * (high - low))[:, None] * NODES
        found = model.follow(course.poses(s.ravel()), near, configuration)
        if np.isnan(found).any():
            raise _beyond(course, s.ravel(), found, model, near, configuration)
        values = found.reshape(m, ORDER + 1, -1)
        first = low[0] == marks[0]
        if free and first:
            values[0, 0] = np.tensordot(_EXTRAPOLATE, values[0, 1:], 1)
        if level:
            # Turns go on from what the piece before the halving knew.
            values -= 2.0 * np.pi * np.round((values[:, ORDER // 2] - known) / (2.0 * np.pi))[:, None]
        c = _SERIES @ values
        good = np.abs(c[:, -3:]).max((1, 2)) <= tolerance
        done.append((low[good], c[good]))
        bad = ~good
        if good.all():
            break
        middle = 0.5 * (low + high)[bad]
        quarters = _polynomials(np.array([-0.5, 0.5])) @ c[bad]
        known = quarters.reshape(-1, values.shape[2])
        if not redundant:
            # A redundant arm's joints are those nearest to where it began.
            near = values[bad][0, ORDER // 2]
        low, high = np.stack([low[bad], middle], 1).ravel(), np.stack([middle, high[bad]], 1).ravel()
    else:
        raise UnresolvedError(stuck(model, known[0]), course.place(float(low[0])))
    starts, c = (np.concatenate(values) for values in zip(*done, strict=True))
    order = np.argsort(starts)
    edges = np.append(starts[order], marks[-1])
    c = c[order]
    # Rounding in the joints grows with each derivative: what's no more than that isn't part of a series.
    tail = np.maximum.accumulate(np.abs(c)[:, ::-1], axis=1)[:, ::-1]
    c[tail <= ROUNDING * tolerance] = 0.0
    scale = (2.0 / np.diff(edges))[:, None, None]
    derivatives = [c]
    for _ in range(3):
        derivatives.append(scale * (_DERIVE @ derivatives[-1]))
    return Path(course, edges, np.stack(derivatives, axis=2), tolerance)


def _beyond(
    course: Course, s: Array, found: Array, model: RobotModel, near: Array, configuration: str | None
) -> PlanningError:
    """Say where the arm can't follow any more, and which joint gives out."""
    order = np.argsort(s, kind="stable")
    lost = np.isnan(found[order]).any(1)
    i = int(np.argmax(lost))
    beyond = float(s[order][i])
    inside = float(s[order][i - 1]) if i else beyond
    at = found[order][i - 1] if i else near if near.ndim == 1 else near[0]
    for _ in range(40):
        middle = 0.5 * (inside + beyond)
        q = model.follow(course.poses(np.array([middle])), at, configuration)[0]
        if np.isnan(q).any():
            beyond = middle
        else:
            inside, at = middle, q
    joint = stuck(model, at)
    return PlanningError(
        f"no straight line: it leaves the workspace at {course.place(inside)}: joint {joint + 1} can't go further"
    )


def stuck(model: RobotModel, q: Array) -> int:
    """Return the joint, from 0, that the singularity at or near q, (n,), makes turn fast; of several the first."""
    J = bare(model).jacobian(q) / np.repeat([model.characteristic_length, 1.0], 3)[:, None]
    turning_fast = np.abs(np.linalg.svd(J)[2][min(J.shape) - 1])
    return int(np.argmax(turning_fast > 0.7 * turning_fast.max()))
