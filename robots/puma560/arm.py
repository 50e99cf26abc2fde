"""The PUMA 560 as the engine sees it.

Its forward kinematics and Jacobian are worked out for many joint positions at once.

Source: Denavit-Hartenberg, standard form: A_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(α_i).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import dist, isfinite, sin, tau
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from robots.puma560.batch import inverse_along
from robots.puma560.branches import (
    NEARLY_SINGULAR,
    ORTHONORMAL,
    TIE,
    Asked,
    Branch,
    Joints,
    Pose,
    all_turns,
    branches,
    distance2,
    flipped,
    forward,
    limit_violation,
    nearest_joints,
    nearest_turns,
    reach,
    reaches,
    shortfall,
    signs,
    solve,
    spell,
)
from robots.puma560.parameters import (
    A2,
    DH_A,
    DH_ALPHA,
    DH_D,
    DOF,
    POSES,
    TOOL_SPEED,
    TOOL_TURN_SPEED,
    default_limits,
)
from vrs.checks import finite, finite_array
from vrs.errors import InvalidValueError, UnreachablePoseError
from vrs.model import Array, Limits, frozen_array

# What the cosine and the sine of a joint are multiplied by in the pose of its link, and what's beside that, each
# (6, 4, 4). Rounded: the twists are right angles, whose cosine is 0 and not 6e-17.
_BY_COSINE, _BY_SINE, _FIXED = (
    frozen_array(rows)
    for rows in zip(
        *(
            (
                ((1, 0, 0, a), (0, c, -s, 0), (0, 0, 0, 0), (0, 0, 0, 0)),
                ((0, -c, s, 0), (1, 0, 0, a), (0, 0, 0, 0), (0, 0, 0, 0)),
                ((0, 0, 0, 0), (0, 0, 0, 0), (0, s, c, d), (0, 0, 0, 1)),
            )
            for a, c, s, d in zip(
                DH_A, map(round, map(math.cos, DH_ALPHA)), map(round, map(math.sin, DH_ALPHA)), DH_D, strict=True
            )
        ),
        strict=True,
    )
)


def link_poses(q: Array) -> Array:
    """Return the poses of base and links in the base frame, (k, 7, 4, 4), for q of shape (k, 6) [rad]."""
    steps = np.cos(q)[..., None, None] * _BY_COSINE
    steps += np.sin(q)[..., None, None] * _BY_SINE
    steps += _FIXED
    poses = np.empty((len(q), DOF + 1, 4, 4))
    poses[:, 0] = np.eye(4)
    for i in range(DOF):
        np.matmul(poses[:, i], steps[:, i], out=poses[:, i + 1])
    return poses


def geometric_jacobian(q: Array) -> Array:
    """Return the Jacobian of the last link's origin in the base frame, (k, 6, 6), for q of shape (k, 6) [rad].

    Rows 0 to 2 are linear [m/rad], rows 3 to 5 angular.
    """
    poses = link_poses(q)
    z = poses[:, :-1, :3, 2].swapaxes(1, 2)
    p = (poses[:, -1:, :3, 3] - poses[:, :-1, :3, 3]).swapaxes(1, 2)
    jacobian = np.empty((len(q), 6, DOF))
    jacobian[:, 0] = z[:, 1] * p[:, 2] - z[:, 2] * p[:, 1]
    jacobian[:, 1] = z[:, 2] * p[:, 0] - z[:, 0] * p[:, 2]
    jacobian[:, 2] = z[:, 0] * p[:, 1] - z[:, 1] * p[:, 0]
    jacobian[:, 3:] = z
    return jacobian


STAY: Final = 1e-13
"""Distance from a pose below which an arm is there."""
WORDS: Final = (("RIGHTY", "LEFTY"), ("ABOVE", "BELOW"), ("NOFLIP", "FLIP"))
"""Words of a configuration, the tie's first."""
_BOTTOM: Final = [0.0, 0.0, 0.0, 1.0]
_FLOAT: Final = np.dtype(np.float64)
_TURNS_MAX: Final = 2 * tau
_X_ALLOWED: Final = f"a homogeneous transform, (4, 4), its rotation orthonormal to {ORTHONORMAL:g}"
_ROW_ALLOWED: Final = "finite homogeneous transforms, shape (k, 4, 4)"
_SIX_ALLOWED: Final = "finite joint values [rad], shape (6,)"
_Q_ALLOWED: Final = "finite joint values [rad], shape (6,) or (k, 6)"


@lru_cache(maxsize=256)
def parse_configuration(text: str) -> Asked:
    """Return the signs that the words of a configuration ask for; case doesn't matter, any may be missing.

    Raises:
        InvalidValueError: If a word is unknown or contradicts another.
    """
    asked: list[bool | None] = [None, None, None]
    allowed = "words out of " + ", ".join(" or ".join(pair) for pair in WORDS) + ", at most one of each pair"
    for word in text.upper().replace(",", " ").split():
        for i, pair in enumerate(WORDS):
            if word in pair:
                sign = word == pair[0]
                if asked[i] not in (None, sign):
                    raise InvalidValueError("configuration", text, allowed)
                asked[i] = sign
                break
        else:
            raise InvalidValueError("configuration", text, allowed)
    return asked[0], asked[1], asked[2]


def pose_rows(X: ArrayLike) -> Pose:
    """Check a pose and return its rows with the nearest orthonormal rotation.

    Raises:
        InvalidValueError: If X isn't a homogeneous transform of shape (4, 4), or holds NaN or infinity.
    """
    try:
        array = np.asarray(X)
    except ValueError:
        raise InvalidValueError("X", X, _X_ALLOWED) from None
    if array.shape != (4, 4) or array.dtype.kind not in "iuf":
        raise InvalidValueError("X", X, _X_ALLOWED)
    (nx, ox, ax, px), (ny, oy, ay, py), (nz, oz, az, pz), bottom = array.astype(np.float64).tolist()
    skew = max(
        abs(nx * nx + ny * ny + nz * nz - 1),
        abs(ox * ox + oy * oy + oz * oz - 1),
        abs(ax * ax + ay * ay + az * az - 1),
        abs(nx * ox + ny * oy + nz * oz),
        abs(nx * ax + ny * ay + nz * az),
        abs(ox * ax + oy * ay + oz * az),
        dist(bottom, _BOTTOM),
    )
    right_handed = ax * (ny * oz - nz * oy) + ay * (nz * ox - nx * oz) + az * (nx * oy - ny * ox) > 0
    # A NaN makes skew NaN or is passed over by max, depending on its place; sums can't hide it.
    total = px + py + pz + nx + ny + nz + ox + oy + oz + ax + ay + az + sum(bottom)
    if not (skew <= ORTHONORMAL and right_handed and isfinite(total)):
        raise InvalidValueError("X", X, _X_ALLOWED)
    if skew > 1e-14:
        U, _, Vt = np.linalg.svd(((nx, ox, ax), (ny, oy, ay), (nz, oz, az)))
        (nx, ox, ax), (ny, oy, ay), (nz, oz, az) = (U @ Vt).tolist()
    return nx, ox, ax, px, ny, oy, ay, py, nz, oz, az, pz


def _six(q: ArrayLike) -> Joints:
    """Return q, shape (6,), as floats."""
    try:
        array = np.asarray(q)
    except ValueError:
        raise InvalidValueError("q", q, _SIX_ALLOWED) from None
    if array.shape == (DOF,) and (array.dtype is _FLOAT or array.dtype.kind in "iuf"):
        q1, q2, q3, q4, q5, q6 = array.tolist()
        if isfinite(q1 + q2 + q3 + q4 + q5 + q6):
            return q1, q2, q3, q4, q5, q6
    raise InvalidValueError("q", q, _SIX_ALLOWED)


def _joints(q: ArrayLike) -> Array:
    """Return q as an array of shape (6,) or (k, 6)."""
    array = finite_array("q", q, None, _Q_ALLOWED)
    if array.ndim not in (1, 2) or array.shape[-1] != DOF:
        raise InvalidValueError("q", q, _Q_ALLOWED)
    return array


@dataclass(frozen=True, slots=True, eq=False)
class Puma560:
    """A PUMA 560; satisfies `vrs.model.RobotModel`.

    The base frame is at the shoulder, on the waist axis; the last link's origin is the wrist centre. Joint
    values have the signs and the zero of the Robotics Toolbox's Puma560.
    """

    limits: Limits = field(default_factory=default_limits)
    """Joint limits, n = 6; positions within ±4π rad."""
    tool_speed: float = TOOL_SPEED
    """Nominal linear speed of the tool [m/s], positive."""
    tool_turn_speed: float = TOOL_TURN_SPEED
    """Nominal angular speed of the tool [rad/s], positive."""
    _low: Joints = field(init=False, repr=False)
    _high: Joints = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.limits, Limits) or self.limits.dof != DOF:
            raise InvalidValueError("limits", self.limits, "Limits of six joints")
        low, high = _six(self.limits.q_min), _six(self.limits.q_max)
        if max(map(abs, low + high)) > _TURNS_MAX:
            raise InvalidValueError("limits", self.limits, "position limits within ±4π rad")
        for name, unit in (("tool_speed", "m/s"), ("tool_turn_speed", "rad/s")):
            given, allowed = getattr(self, name), f"a positive number [{unit}]"
            speed = finite(name, given, allowed)
            if speed <= 0:
                raise InvalidValueError(name, given, allowed)
            object.__setattr__(self, name, speed)
        object.__setattr__(self, "_low", low)
        object.__setattr__(self, "_high", high)

    @property
    def name(self) -> str:
        """`puma560`."""
        return "puma560"

    @property
    def prismatic(self) -> tuple[int, ...]:
        """None of its joints."""
        return ()

    @property
    def poses(self) -> Mapping[str, Array]:
        """Joint values of `ready`, `zero`, `nominal` and `stretch`, each (6,) [rad]."""
        return POSES

    @property
    def characteristic_length(self) -> float:
        """Length of the upper arm, and of the forearm but for its offset [m]."""
        return A2

    def forward(self, q: ArrayLike) -> Array:
        """Return the pose of the last link in the base frame.

        Args:
            q: Joint values [rad], shape (6,) or (k, 6), inside the limits or not.

        Returns:
            Homogeneous transform, (4, 4) or (k, 4, 4).

        Raises:
            InvalidValueError: If q has another shape, or holds NaN or infinity.
        """
        array = _joints(q)
        if array.ndim == 2:
            return np.ascontiguousarray(link_poses(array)[:, -1])
        return np.array((*forward(_six(array)), 0.0, 0.0, 0.0, 1.0)).reshape(4, 4)

    def links(self, q: ArrayLike) -> Array:
        """Return the poses of base and links in the base frame, (7, 4, 4), or (k, 7, 4, 4) for (k, 6).

        Raises:
            InvalidValueError: If q has another shape, or holds NaN or infinity.
        """
        array = _joints(q)
        return link_poses(array) if array.ndim == 2 else link_poses(array[None])[0]

    def jacobian(self, q: ArrayLike) -> Array:
        """Return the geometric Jacobian of the last link in the base frame, (6, 6), or (k, 6, 6) for (k, 6).

        Rows 0 to 2 are linear [m/rad], rows 3 to 5 angular.

        Raises:
            InvalidValueError: If q has another shape, or holds NaN or infinity.
        """
        array = _joints(q)
        return geometric_jacobian(array) if array.ndim == 2 else geometric_jacobian(array[None])[0]

    def inverse(self, X: ArrayLike, within_limits: bool = True) -> Array:
        """Return every joint solution of one pose, each checked forward to 1e-9.

        Where joints 4 and 6 share an axis, one solution stands for all that share q4 + q6 (q6 − q4 at
        q5 = π): that with q4 nearest to 0. Where two branches meet, they are one.

        Args:
            X: Pose of the last link in the base frame, (4, 4).
            within_limits: Keep what the limits admit, with every turn of ±2π that they admit; otherwise the
                principal solutions, in (−π, π], at most eight.

        Returns:
            Joint values [rad], (m, 6); m is 0 where there is none.

        Raises:
            InvalidValueError: If X isn't a homogeneous transform, or holds NaN or infinity.
        """
        found: list[Joints] = []
        for branch in branches(pose_rows(X)):
            if within_limits:
                found += all_turns(branch, self._low, self._high)
            else:
                found.append(branch.q)
        return np.array(found).reshape(-1, DOF)

    def inverse_near(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """Return the joint solution of a pose that is nearest to q, within the limits.

        Args:
            X: Pose of the last link in the base frame, (4, 4).
            q: Joint values to be near to, (6,) [rad]; nearness is the Euclidean distance.
            configuration: Words such as `LEFTY BELOW FLIP`, or some of them, that the solution must bear.
                None prefers q's own configuration, and takes the nearest other where that has none.

        Returns:
            Joint values [rad], (6,). Where joints 4 and 6 share an axis, both move by the same amount.

        Raises:
            InvalidValueError: If an argument has the wrong shape, holds NaN or infinity, or an unknown word.
            UnreachablePoseError: If no such solution lies within the limits.
        """
        near = _six(q)
        if configuration is None:
            asked: Asked = signs(near)
        elif isinstance(configuration, str):
            asked = parse_configuration(configuration)
        else:
            raise InvalidValueError("configuration", configuration, "None or a string of words")
        if isinstance(X, np.ndarray) and X.shape == (4, 4) and X.dtype is _FLOAT:
            quick = self._one(X, near, asked)
            if quick is not None:
                return np.array(quick)
        return np.array(self._best(pose_rows(X), near, asked, strict=configuration is not None))

    def follow(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """Return the joint solutions of poses in a row that go on from q, in q's own configuration.

        A straight wrist is in both NOFLIP and FLIP; the one whose joint 4 is nearer to q's is taken.

        Args:
            X: Poses of the last link in the base frame, (k, 4, 4), so close together that no joint turns by π
                from one to the next.
            q: Joint values to go on from, (6,) [rad].
            configuration: Words such as `LEFTY BELOW FLIP`, or some of them, that go before q's own.

        Returns:
            Joint values [rad], (k, 6), within the limits or not, turns counted on from q; NaN from the first
            pose on that the arm doesn't reach to 1e-9. Where joints 4 and 6 share an axis, joint 4 stays where
            it was.

        Raises:
            InvalidValueError: If an argument has the wrong shape, holds NaN or infinity, or an unknown word.
        """
        near = _six(q)
        poses = finite_array("X", X, None, _ROW_ALLOWED)
        if poses.ndim != 3 or poses.shape[1:] != (4, 4):
            raise InvalidValueError("X", X, _ROW_ALLOWED)
        righty, above, noflip = signs(near)
        own: Asked = righty, above, (None if abs(sin(near[4])) <= TIE else noflip)
        asked = (None, None, None) if configuration is None else parse_configuration(configuration)
        first, second, third = (b if a is None else a for a, b in zip(asked, own, strict=True))
        return inverse_along(poses, np.array(near), (first, second, third))

    def _one(self, X: Array, near: Joints, asked: Asked) -> Joints | None:
        """Solve one branch; None where anything is out of the ordinary.

        X isn't checked beforehand: a solution that reaches it proves it sound.
        """
        righty, above, noflip = asked
        (nx, ox, ax, px), (ny, oy, ay, py), (nz, oz, az, pz), bottom = X.tolist()
        rows = (nx, ox, ax, px, ny, oy, ay, py, nz, oz, az, pz)
        triangle = reach(rows)
        if righty is None or above is None or noflip is None or triangle is None or bottom != _BOTTOM:
            return None
        p, sin5 = solve(rows, triangle, righty, above)
        if not sin5 >= NEARLY_SINGULAR:
            return None
        if not noflip:
            p = flipped(p)
        if not reaches(p, rows):
            return None
        return nearest_turns(p, near, self._low, self._high)

    def _best(self, X: Pose, near: Joints, asked: Asked, *, strict: bool) -> Joints:
        """Search all branches; if strict, only those that match what was asked.

        Where two singularities meet, rounding makes joints 4 and 6 arbitrary; an arm that is there stays.
        """
        if dist(forward(near), X) <= STAY and self._admits(near, asked):
            return near
        every = list(branches(X))
        wanted = [branch for branch in every if branch.matches(asked)]
        for choice in (wanted,) if strict else (wanted, every):
            solutions = [nearest_joints(branch, near, self._low, self._high) for branch in choice]
            found = [solution for solution in solutions if solution is not None]
            if found:
                return min(found, key=lambda solution: distance2(solution, near))
        raise UnreachablePoseError(shortfall(X) or self._obstacle(wanted if strict else every))

    def _admits(self, q: Joints, asked: Asked) -> bool:
        """Say whether q is within the limits and in the configuration asked for."""
        inside = all(a <= v <= b for a, v, b in zip(self._low, q, self._high, strict=True))
        return inside and all(a is None or a == b for a, b in zip(asked, signs(q), strict=True))

    def _obstacle(self, tried: list[Branch]) -> str:
        """Say which joint's limits the branch that comes closest to obeying them breaks."""
        if not tried:
            return "no arm solution reaches it to 1e-9"
        misses = [(*limit_violation(branch, self._low, self._high), branch.words) for branch in tried]
        miss, joint, value, words = min(misses)
        low, high, given, over = np.degrees((self._low[joint], self._high[joint], value, miss)).tolist()
        return (
            f"joint {joint + 1} would be at {given:.6g} deg, {over:.3g} deg outside its limits "
            f"[{low:.6g}, {high:.6g}] deg, in the nearest possible configuration, {words}"
        )

    def configuration(self, q: ArrayLike) -> str:
        """Name the arm configuration at q, (6,) [rad]; see `robots.puma560.branches` for what the words mean.

        Raises:
            InvalidValueError: If q has another shape, or holds NaN or infinity.
        """
        return spell(*signs(_six(q)))


def model(
    limits: Limits | None = None, tool_speed: float | None = None, tool_turn_speed: float | None = None
) -> Puma560:
    """Return a PUMA 560.

    Args:
        limits: Joint limits; None means the documented ones of `robots.puma560.parameters`.
        tool_speed: Nominal linear speed of the tool [m/s]; None means 0.5.
        tool_turn_speed: Nominal angular speed of the tool [rad/s]; None means π/2.

    Raises:
        InvalidValueError: If the limits aren't of six joints within ±4π rad, or a speed isn't positive.
    """
    return Puma560(
        limits=default_limits() if limits is None else limits,
        tool_speed=TOOL_SPEED if tool_speed is None else tool_speed,
        tool_turn_speed=TOOL_TURN_SPEED if tool_turn_speed is None else tool_turn_speed,
    )
