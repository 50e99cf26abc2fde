"""The arm of a description as the engine sees it: a chain of 1 to 12 moving joints up to a tip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from robots.description.description import MOST_JOINTS, Description, Joint, JointKind
from robots.description.geometry import Geometry, geometry
from robots.description.inverse import Inverse
from robots.description.rigid import at_rest
from vrs.checks import finite_array
from vrs.errors import InvalidValueError
from vrs.model import Array, Limits, frozen_array

_POSE: Final = "a homogeneous transform, (4, 4), its rotation orthonormal to 1e-6"
_POSES: Final = "finite homogeneous transforms, shape (k, 4, 4)"
_STANDING: Final = ("ready", "home")
"""Named poses that an arm stands in, where none is called `nominal`."""
_TRIED, _BENT, _PLAIN = 256, 0.5, 3.0
"""Poses among which one to stand in is found, how far joints are off the middle there, as a share of half a range
and at most 1 rad, and how many condition numbers a joint at its middle is worth."""
_EYE: Final = frozen_array(np.eye(3))
_LIMITS: Final = ("q_min", "q_max", "qd_max", "qdd_max", "qddd_max")


@dataclass(frozen=True, slots=True, eq=False)
class DescribedArm:
    """An arm of a description; satisfies `vrs.model.RobotModel`.

    The base frame is that of the description's root; the last link's frame is that of the tip. It has no names of
    configurations.
    """

    name: str
    limits: Limits
    prismatic: tuple[int, ...]
    """Joints that slide, counted from 0."""
    joints: tuple[str, ...]
    """Names of the joints, n of them."""
    poses: Mapping[str, Array]
    """Named joint positions within the limits, each (n,) [rad], [m]."""
    tool_speed: float
    """Nominal linear speed of the tool [m/s]."""
    tool_turn_speed: float
    """Nominal angular speed of the tool [rad/s]."""
    characteristic_length: float
    """Half of how far the tip is from the first joint where the arm is straight [m]."""
    description: Description
    tip: str
    """The link at the end."""
    _geometry: Geometry = field(repr=False)
    _inverse: Inverse = field(repr=False)

    @property
    def follows(self) -> str:
        """What the tool follows of a pose: position and orientation, or less with fewer joints than that takes."""
        rank, position = self._inverse.rank, self._inverse.position
        angles = rank - position
        parts = ["position" if position == 3 else f"{position} of 3 coordinates"] if position else []
        parts += ["orientation" if angles == 3 else f"{angles} of 3 angles"] if angles else []
        return " and ".join(parts)

    def forward(self, q: ArrayLike) -> Array:
        """Return the pose of the tip in the base frame, (4, 4), or (k, 4, 4) for q of shape (k, n).

        Raises:
            InvalidValueError: If q has another shape, or holds NaN or infinity.
        """
        array = self._checked(q)
        X = self._geometry.frames(array.reshape(-1, self.limits.dof))[:, -1]
        return np.ascontiguousarray(X) if array.ndim == 2 else np.array(X[0])

    def links(self, q: ArrayLike) -> Array:
        """Return the poses of the base, of the links after each joint but the last, and of the tip.

        Returns:
            (n + 1, 4, 4), or (k, n + 1, 4, 4) for q of shape (k, n).

        Raises:
            InvalidValueError: If q has another shape, or holds NaN or infinity.
        """
        array = self._checked(q)
        frames = self._geometry.frames(array.reshape(-1, self.limits.dof))
        base = np.broadcast_to(np.eye(4), (len(frames), 1, 4, 4))
        found = np.concatenate([base, frames[:, self._geometry.own[:-1]], frames[:, -1:]], axis=1)
        return found if array.ndim == 2 else found[0]

    def jacobian(self, q: ArrayLike) -> Array:
        """Return the geometric Jacobian of the tip in the base frame, (6, n), or (k, 6, n) for q of shape (k, n).

        Rows 0 to 2 are linear, rows 3 to 5 angular.

        Raises:
            InvalidValueError: If q has another shape, or holds NaN or infinity.
        """
        array = self._checked(q)
        J = self._geometry.jacobian(array.reshape(-1, self.limits.dof))
        return J if array.ndim == 2 else J[0]

    def inverse(self, X: ArrayLike, within_limits: bool = True) -> Array:
        """Return joint solutions of one pose: those that are found from `inverse.STARTS` places, not every one.

        Of a redundant arm there's no end of them. See `inverse_near` for arms that don't follow orientations.

        Raises:
            InvalidValueError: If X isn't a homogeneous transform.
        """
        return self._inverse.some(_pose(X), within_limits=within_limits)

    def inverse_near(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """Return the joint solution of a pose within the limits that is found nearest to q, (n,).

        Where `follows` says less than position and orientation, the position is reached, and the orientation that
        is nearest of those that the arm can give there.

        Raises:
            InvalidValueError: If an argument has the wrong shape or isn't finite, or a configuration is asked for.
            UnreachablePoseError: If none is found; it says why.
        """
        _unnamed(configuration)
        return self._inverse.near(_pose(X), self._row(q))

    def follow(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """Return the joint solutions of poses in a row, (k, n), that go on from q, (n,).

        A redundant arm's are as near to q as the poses allow, on a scale that stretches towards the limits; so they
        don't depend on the poses between. Of q of shape (2, n), the second row are joint values to arrive at.

        Args:
            X: Poses of the tip in the base frame, (k, 4, 4).
            q: Joint values, (n,) or (2, n).
            configuration: None; the arm has no names of configurations.

        Returns:
            Within the limits or not; NaN from the first pose on that isn't reached.

        Raises:
            InvalidValueError: If an argument has the wrong shape or isn't finite, or a configuration is asked for.
        """
        _unnamed(configuration)
        poses = finite_array("X", X, None, _POSES)
        if poses.ndim != 3 or poses.shape[1:] != (4, 4):
            raise InvalidValueError("X", X, _POSES)
        array = self._checked(q)
        if array.ndim == 1:
            return self._inverse.along(poses, array, None)
        return self._inverse.along(poses, array[0], array[1])

    def configuration(self, _q: ArrayLike) -> str:
        """Empty: it has no names of configurations."""
        return ""

    def _checked(self, q: ArrayLike) -> Array:
        n = self.limits.dof
        allowed = f"finite joint values, shape ({n},) or (k, {n})"
        array = finite_array("q", q, None, allowed)
        if array.ndim not in (1, 2) or array.shape[-1] != n:
            raise InvalidValueError("q", q, allowed)
        return np.ascontiguousarray(array)

    def _row(self, q: ArrayLike) -> Array:
        n = self.limits.dof
        return np.ascontiguousarray(finite_array("q", q, (n,), f"finite joint values, shape ({n},)"))


def arm_model(description: Description, tip: str) -> DescribedArm:
    """Return the model of the arm that ends at a link.

    Args:
        description: Of the robot, with the limits of the joints on the way and the tool's speeds; continuous joints
            too have limits of position, as plans need them.
        tip: The link.

    Raises:
        InvalidValueError: If there's no such link, there are no joints on the way that move, or more than
            `MOST_JOINTS`, or something isn't stated.
    """
    own = [joint for joint in description.chain(tip) if joint.moves]
    if not 1 <= len(own) <= MOST_JOINTS:
        raise InvalidValueError(
            "tip", tip, f"a link behind 1 to {MOST_JOINTS} joints that move; this one: {len(own)}"
        )
    for joint in own:
        for name in _LIMITS:
            if getattr(joint, name) is None:
                raise InvalidValueError(f"{name} of {joint.name}", None, "stated")
    for name in ("tool_speed", "tool_turn_speed"):
        if getattr(description, name) is None:
            raise InvalidValueError(name, None, "stated")
    limits = Limits(*(np.array([getattr(joint, name) for joint in own]) for name in _LIMITS))
    prismatic = tuple(k for k, joint in enumerate(own) if joint.kind is JointKind.PRISMATIC)
    chain = geometry(description, tip)
    length = _length(chain, limits, prismatic)
    return DescribedArm(
        description.name,
        limits,
        prismatic,
        tuple(joint.name for joint in own),
        _poses(description, own, limits, chain, length),
        float(description.tool_speed or 0.0),
        float(description.tool_turn_speed or 0.0),
        length,
        description,
        tip,
        chain,
        Inverse(chain, limits, prismatic, length),
    )


def _poses(
    description: Description, own: list[Joint], limits: Limits, chain: Geometry, length: float
) -> dict[str, Array]:
    """Named poses of these joints, within their limits, `nominal` among them: where arms stand."""
    found = {}
    for name, pose in description.poses.items():
        if any(joint.name in pose for joint in own):
            q = np.array([pose.get(joint.name, at_rest(joint)) for joint in own])
            found[name] = frozen_array(np.clip(q, limits.q_min, limits.q_max))
    if "nominal" not in found:
        stated = next((found[name] for name in _STANDING if name in found), None)
        found["nominal"] = _dexterous(limits, chain, length) if stated is None else stated
    return found


def _dexterous(limits: Limits, chain: Geometry, length: float) -> Array:
    """Joint values from which the tool goes every way: near the middles of the ranges, few joints off them."""
    n = limits.dof
    middle, half = 0.5 * (limits.q_min + limits.q_max), 0.5 * (limits.q_max - limits.q_min)
    bends = np.random.default_rng(0).choice([-1.0, 0.0, 0.0, 1.0], (_TRIED, n))
    bends[0] = 0.0
    q = middle + bends * np.minimum(_BENT * half, 1.0)
    J = chain.jacobian(q)
    J[:, :3] /= length
    S = np.linalg.svd(J, compute_uv=False)
    rank = int(np.linalg.matrix_rank(J, rtol=1e-6).max())
    best = (S[:, 0] / np.maximum(S[:, rank - 1], 1e-9) + _PLAIN * np.abs(bends).sum(1)).argmin()
    return frozen_array(q[best])


def _length(chain: Geometry, limits: Limits, prismatic: tuple[int, ...]) -> float:
    steps = np.concatenate([chain.X[1:, :3, 3], chain.tip[None, :3, 3]])
    straight = float(np.sqrt((steps**2).sum(1)).sum())
    far = np.maximum(np.abs(limits.q_min), np.abs(limits.q_max))
    return 0.5 * (straight + float(far[list(prismatic)].sum())) or 1.0


def _pose(X: ArrayLike) -> Array:
    """A pose, its rotation made orthonormal."""
    array = finite_array("X", X, (4, 4), _POSE)
    R = array[:3, :3]
    skew = float(np.abs(R @ R.T - _EYE).max())
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    right_handed = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0
    if skew > 1e-6 or not right_handed or array[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise InvalidValueError("X", X, _POSE)
    if skew > 1e-14:
        U, _, Vt = np.linalg.svd(R)
        array = np.array(array)
        array[:3, :3] = U @ Vt
    return array


def _unnamed(configuration: str | None) -> None:
    if configuration:
        raise InvalidValueError("configuration", configuration, "none: the arm has no names of configurations")
