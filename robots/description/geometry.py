"""Joints in a row with fixed poses between them: where links are, and how they move, for many joint values at once.

A joint's pose is X + f(q) Y + g(q) Z, with constant matrices: of one that turns about a unit vector k, with its
skew matrix K, f is sin q, g is 1 - cos q, and Y, Z are X K, X K² (Rodrigues); of one that slides, f is q, Z 0.
"""

from __future__ import annotations

import atexit
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from robots.description.description import Description, Joint, JointKind
from robots.description.rigid import at_rest
from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array

_STEPS: Final = 30
_CLOSE: Final = 1e-12
"""Half of the squared error at which the Toolbox's solver ends [m², rad²]."""
_DAMPING: Final = 0.1
"""As a share of half of the squared error that's left."""


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """N joints in a row, of which n have values of their own; the others follow them."""

    axes: Array
    """Unit vectors in the joints' frames, (N, 3)."""
    slides: tuple[bool, ...]
    """Which of the N are prismatic."""
    tip: Array
    """Pose of the tip in the last joint's frame, (4, 4)."""
    own: tuple[int, ...]
    """Which of the N have values of their own, in order."""
    gains: Array
    """(N, n): joints' values are gains q + offsets."""
    offsets: Array
    """(N,)."""
    X: Array
    """Pose of each joint's frame at 0 in the one before, (N, 4, 4)."""
    Y: Array
    """What f adds to it, (N, 4, 4)."""
    Z: Array
    """What g adds to it, (N, 4, 4)."""

    @property
    def follows(self) -> bool:
        """Whether some joint follows another."""
        return len(self.own) < len(self.slides)

    def frames(self, q: Array) -> Array:
        """Poses of the joints' frames and of the tip, (k, N + 1, 4, 4), at q, (k, n)."""
        v = q @ self.gains.T + self.offsets
        straight = np.array(self.slides)
        f, g = np.where(straight, v, np.sin(v)), np.where(straight, 0.0, 1.0 - np.cos(v))
        steps = self.X + f[..., None, None] * self.Y + g[..., None, None] * self.Z
        found = np.empty((len(q), len(self.slides) + 1, 4, 4))
        X: Array = steps[:, 0]
        found[:, 0] = X
        for k in range(1, len(self.slides)):
            X = X @ steps[:, k]
            found[:, k] = X
        found[:, -1] = X @ self.tip
        return found

    def jacobian(self, q: Array) -> Array:
        """Geometric Jacobian of the tip in the base frame, (k, 6, n), at q, (k, n)."""
        X = self.frames(q)
        axes = np.einsum("kjab,jb->kja", X[:, :-1, :3, :3], self.axes)
        straight = np.array(self.slides)[:, None]
        linear = np.where(straight, axes, np.cross(axes, X[:, -1:, :3, 3] - X[:, :-1, :3, 3]))
        J = np.concatenate([linear, np.where(straight, 0.0, axes)], axis=2).swapaxes(1, 2)
        return np.asarray(J @ self.gains)


def geometry(description: Description, tip: str) -> Geometry:
    """Return the joints that lead to a tip; what follows a joint beside them stands where that rests.

    Raises:
        InvalidValueError: If there's no such tip.
    """
    chain = description.chain(tip)
    rest = [joint for joint in chain if joint.kind is not JointKind.FIXED]
    number = {joint.name: k for k, joint in enumerate(joint for joint in rest if joint.moves)}
    fixed, X = [], np.eye(4)
    for joint in chain:
        X = X @ joint.X
        if joint.kind is not JointKind.FIXED:
            fixed.append(X)
            X = np.eye(4)
    gains, offsets = np.zeros((len(rest), len(number))), np.zeros(len(rest))
    for k, joint in enumerate(rest):
        source, gain, offsets[k] = followed(description, joint)
        if source in number:
            gains[k, number[source]] = gain
        else:
            offsets[k] += gain * at_rest(_named(description, source))
    before, axes = np.array(fixed).reshape(-1, 4, 4), np.array([joint.axis for joint in rest]).reshape(-1, 3)
    slides = tuple(joint.kind is JointKind.PRISMATIC for joint in rest)
    Y, Z = np.zeros((2, len(rest), 4, 4))
    for k, (x, y, z) in enumerate(axes.tolist()):
        if slides[k]:
            Y[k, :3, 3] = x, y, z
        else:
            Y[k, :3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
            Z[k] = Y[k] @ Y[k]
    own = tuple(k for k, joint in enumerate(rest) if joint.moves)
    return Geometry(
        frozen_array(axes), slides, frozen_array(X), own, frozen_array(gains), frozen_array(offsets),
        frozen_array(before), frozen_array(before @ Y), frozen_array(before @ Z),
    )  # fmt: skip


def followed(description: Description, joint: Joint) -> tuple[str, float, float]:
    """Return the joint whose value a joint's is a multiple of, by how much, and what is added to it.

    Raises:
        InvalidValueError: If a joint follows one that there isn't, or itself.
    """
    gain, offset, seen = 1.0, 0.0, [joint.name]
    while joint.mimic is not None:
        offset += gain * joint.mimic.offset
        gain *= joint.mimic.multiplier
        joint = _named(description, joint.mimic.joint)
        if joint.name in seen:
            raise InvalidValueError("mimic", " of ".join((*seen, joint.name)), "a joint that doesn't follow itself")
        seen.append(joint.name)
    return joint.name, gain, offset


def _named(description: Description, name: str) -> Joint:
    found = next((joint for joint in description.joints if joint.name == name), None)
    if found is None:
        raise InvalidValueError("mimic", name, f"a joint of {description.name}")
    return found


class Compiled:
    """The same joints as the Robotics Toolbox's elementary transforms, by its compiled functions."""

    def __init__(self, chain: Geometry) -> None:
        """Compile them."""
        import roboticstoolbox as rtb
        from roboticstoolbox import _fknm_c as functions

        X, parts = np.eye(4), []
        for before, axis, slides in zip(chain.X, chain.axes, chain.slides, strict=True):
            align = _aligned(axis)
            parts += [rtb.ET.SE3(X @ before @ align), rtb.ET.tz() if slides else rtb.ET.Rz()]
            X = align.T
        self._library = functions
        self._whole = rtb.ETS([*parts, rtb.ET.SE3(X @ chain.tip)])
        self._ets = self._whole._fknm
        self._gains = chain.gains if chain.follows else None
        self._offsets = chain.offsets

    def forward(self, q: Array) -> Array:
        """Return the pose of the tip, (4, 4), at q, (n,)."""
        return np.asarray(self._library.ETS_fkine(self._ets, self._values(q), None, None, 1))

    def jacobian(self, q: Array) -> Array:
        """Return its geometric Jacobian, (6, n)."""
        J: Array = self._library.ETS_jacob0(self._ets, self._values(q), None)
        return J if self._gains is None else J @ self._gains

    def curvature(self, q: Array, weights: Array) -> Array:
        """Return the derivative of the Jacobian's rows, weighted by (6,) and summed, (n, n), made symmetric."""
        bend: Array = weights @ self._library.ETS_hessian0(self._ets, self._values(q), None, None)
        if self._gains is not None:
            bend = self._gains.T @ bend @ self._gains
        return 0.5 * (bend + bend.T)

    def solve(self, X: Array, start: Array, mask: Array) -> Array | None:
        """Return joint values of a pose, (n,), by Levenberg-Marquardt's method, or None; not where joints follow.

        Args:
            X: The pose, (4, 4).
            start: Joint values to start from, (n,).
            mask: What each row of a pose counts, (6,).
        """
        q, found, *_ = self._library.IK_LM_c(
            self._ets, X, np.array(start), _STEPS, 1, _CLOSE, False, mask, _DAMPING, "chan"
        )
        return np.asarray(q) if found else None

    def _values(self, q: Array) -> Array:
        """Values of all joints, (N,), in a row and writeable, as the library asks."""
        if self._gains is not None:
            return np.asarray(self._gains @ q + self._offsets)
        return q if q.flags.carray else q.copy()


@lru_cache(maxsize=16)
def compiled(chain: Geometry) -> Compiled:
    """Return compiled joints; it takes a second to load the Toolbox."""
    return Compiled(chain)


# The compiled library reports what lives on when the interpreter ends.
atexit.register(compiled.cache_clear)


def _aligned(axis: Array) -> Array:
    """A pose at the origin whose z axis is a unit vector, (4, 4)."""
    x = np.cross(np.eye(3)[int(np.abs(axis).argmin())], axis)
    x /= np.sqrt(x @ x)
    X = np.eye(4)
    X[:3, :3] = np.stack([x, np.cross(axis, x), axis], axis=1)
    return X
