"""Rigid links on joints in a row: masses, drives and inverse dynamics, the same for every world of physics.

Source: recursive Newton-Euler in the links' own frames; Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 5.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from vrs.model import Array


class Inertia(NamedTuple):
    """Mass and how it lies, in some frame."""

    mass: float
    """[kg]."""
    centre: Array
    """[m], (3,)."""
    tensor: Array
    """About the centre, along the frame's axes [kg m²], (3, 3)."""

    def moved(self, X: Array) -> Inertia:
        """The same in a frame in which this one's is at X, (4, 4)."""
        R = X[:3, :3]
        return Inertia(self.mass, R @ self.centre + X[:3, 3], R @ self.tensor @ R.T)

    def principal(self) -> tuple[list[float], Array]:
        """Principal inertias [kg m²], and the rotation from their axes to the frame."""
        if np.count_nonzero(self.tensor - np.diag(np.diag(self.tensor))) == 0:
            return np.diag(self.tensor).tolist(), np.eye(3)
        values, axes = np.linalg.eigh(self.tensor)
        if np.linalg.det(axes) < 0:
            axes[:, 0] *= -1
        return values.tolist(), axes


def together(parts: Iterable[Inertia]) -> Inertia:
    """What bodies that are fixed to each other have, all in one frame."""
    found = [part for part in parts if part.mass > 0.0]
    mass = sum(part.mass for part in found)
    if not found:
        return Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
    centre = sum((part.mass * part.centre for part in found), np.zeros(3)) / mass
    tensor = sum((part.tensor for part in found), np.zeros((3, 3)))
    for part in found:
        p = part.centre - centre
        tensor = tensor + part.mass * (p @ p * np.eye(3) - np.outer(p, p))
    return Inertia(mass, centre, tensor)


def rotation(turn: Sequence[float]) -> Array:
    """Rotation matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = turn
    return np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ])  # fmt: skip


def quaternion(R: Array) -> list[float]:
    """A rotation matrix as a quaternion (x, y, z, w), by the largest of its four squares."""
    t = np.trace(R)
    squares = np.array([*(1 + 2 * np.diag(R) - t), 1 + t])
    k = int(np.argmax(squares))
    if k == 3:
        q = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], squares[3]])
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q = np.empty(4)
        q[k], q[i], q[j] = squares[k], R[i, k] + R[k, i], R[j, k] + R[k, j]
        q[3] = R[j, i] - R[i, j]
    return [float(x) for x in q / np.linalg.norm(q)]


def about(axis: Array, angle: Array) -> Array:
    """Rotations about a unit vector by angles [rad] of any shape, (…, 3, 3), by Rodrigues' formula."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.asarray(np.eye(3) + s * K + (1.0 - c) * (K @ K))


@dataclass(frozen=True, slots=True, eq=False)
class ChainLink:
    """A joint and the link that it moves.

    The joint's frame moves with the link; the link's own frame, in which its inertia is, is fixed in it.
    """

    place: Array
    """Origin of the joint's frame in that of the joint before at q = 0 [m], (3,)."""
    turn: Sequence[float]
    """How the joint's frame is turned in it, a unit quaternion (x, y, z, w)."""
    inertia: Inertia
    """In the link's frame."""
    X: Array = field(default_factory=lambda: np.eye(4))
    """Pose of the link's frame in the joint's, (4, 4)."""
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    """Unit vector of the joint, in its frame, (3,)."""
    prismatic: bool = False
    effort: float = np.inf
    """Largest torque of the drive [N m], force [N]."""
    armature: float = 0.0
    """Inertia of the drive at the joint [kg m²], mass [kg]."""
    viscous: float = 0.0
    """Viscous friction [N m s/rad], [N s/m]."""
    coulomb: tuple[float, float] = (0.0, 0.0)
    """Coulomb friction for positive and for negative speed [N m], [N], (≥ 0, ≤ 0)."""
    gear: float = 0.0
    """Turns of the encoder a turn of the joint; 0 where positions are read exactly."""

    def principal(self) -> tuple[list[float], Array]:
        """Principal inertias [kg m²], and the rotation from their axes to the joint's frame."""
        values, axes = self.inertia.principal()
        return values, self.X[:3, :3] @ axes

    @property
    def centre(self) -> Array:
        """Centre of mass in the joint's frame [m], (3,)."""
        return self.X[:3, 3] + self.X[:3, :3] @ self.inertia.centre


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Links from the base outwards."""

    links: tuple[ChainLink, ...]
    flange: Array = field(default_factory=lambda: np.eye(4))
    """Pose of what holds loads in the last link's frame, (4, 4)."""

    def holding(self, load: Inertia | None) -> Chain:
        """The chain with a load, in the flange's frame, fixed to its last link."""
        if load is None:
            return self
        last = self.links[-1]
        held = replace(last, inertia=together((last.inertia, load.moved(self.flange))))
        return replace(self, links=(*self.links[:-1], held))

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array, *, gravity: float) -> Array:
        """Torques [N m] and forces [N] of motions without friction, armatures included.

        Args:
            q: Joint values [rad], [m], (k, n).
            qd: Speeds [rad/s], [m/s], (k, n).
            qdd: Accelerations [rad/s²], [m/s²], (k, n).
            gravity: Free fall along -z of the base [m/s²].

        Returns:
            (k, n); a row depends on its own row of the arguments alone.
        """
        k, n = q.shape
        w, wd, a = np.zeros((k, 3)), np.zeros((k, 3)), np.zeros((k, 3))
        a[:, 2] = gravity
        turns, places, forces, moments = [], [], [], []
        for j, link in enumerate(self.links):
            R, p = _motion(link, q[:, j])
            a = _turned(a + _cross(wd, p) + _cross(w, _cross(w, p)), R)
            w, wd = _turned(w, R), _turned(wd, R)
            speed, rate = qd[:, j, None] * link.axis, qdd[:, j, None] * link.axis
            if link.prismatic:
                a = a + 2.0 * _cross(w, speed) + rate
            else:
                wd = wd + _cross(w, speed) + rate
                w = w + speed
            mass, centre, tensor = link.inertia.moved(link.X)
            force = mass * (a + _cross(wd, centre) + _cross(w, _cross(w, centre)))
            moments.append(_turned(wd, tensor) + _cross(w, _turned(w, tensor)) + _cross(centre, force))
            turns.append(R)
            places.append(p)
            forces.append(force)
        tau = np.empty((k, n))
        force, moment = np.zeros((k, 3)), np.zeros((k, 3))
        for j in reversed(range(n)):
            link = self.links[j]
            force, moment = forces[j] + force, moments[j] + moment
            along = link.axis * (force if link.prismatic else moment)
            tau[:, j] = along[:, 0] + along[:, 1] + along[:, 2] + link.armature * qdd[:, j]
            back = turns[j].swapaxes(-1, -2)
            force = _turned(force, back)
            moment = _turned(moment, back) + _cross(places[j], force)
        return tau

    def mass_matrix(self, q: Array) -> Array:
        """Joint-space inertia at q, (n,), armatures included, (n, n) [kg m²], of prismatic joints [kg]."""
        n = len(self.links)
        rows, zero = np.tile(q, (n, 1)), np.zeros((n, n))
        return self.inverse_dynamics(rows, zero, np.eye(n), gravity=0.0)


def _motion(link: ChainLink, q: Array) -> tuple[Array, Array]:
    """How a link's frame stands in the one before, for joint values (k,): (k, 3, 3) and (k, 3)."""
    R, p = rotation(link.turn), link.place
    if link.prismatic:
        return np.broadcast_to(R, (len(q), 3, 3)), p + q[:, None] * (R @ link.axis)
    return R @ about(link.axis, q), np.broadcast_to(p, (len(q), 3))


def _turned(v: Array, R: Array) -> Array:
    """Products v R of rows v, (k, 3), and matrices, (k, 3, 3) or one. BLAS would add a single row otherwise."""
    return np.asarray(v[:, 0:1] * R[..., 0, :] + v[:, 1:2] * R[..., 1, :] + v[:, 2:3] * R[..., 2, :])


def _cross(a: Array, b: Array) -> Array:
    """Cross products of rows."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
