"""A chain of revolute joints as a PyBullet multibody, straight from its Denavit-Hartenberg parameters.

A link's PyBullet frame sits at its joint and turns with it; the link's Denavit-Hartenberg frame is fixed in
it, at Trans_z(d) Trans_x(a) Rot_x(α). No URDF is read: the loader zeroes inertias that break the triangle
inequality, as Armstrong's links 1 and 3 do.

How real the arm is, and what it may carry, are its `Reality` and `Payload`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from robots.bullet.world import World
from vrs.checks import finite, finite_array, number_in, validated, within
from vrs.errors import InvalidValueError
from vrs.model import Array

_FREE_SPEED = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class RigidLink:
    """One link: its joint's geometry, and its mass in its own Denavit-Hartenberg frame."""

    d: float
    """Joint offset [m]."""
    a: float
    """Link length [m]."""
    alpha: float
    """Link twist [rad]."""
    mass: float
    """Mass [kg], positive: PyBullet's inverse dynamics fail on zero."""
    centre: Array
    """Centre of mass [m], (3,)."""
    inertia: Array
    """Inertia about the centre of mass [kg m²], (3, 3)."""

    def with_body(self, mass: float, centre: Array, inertia: Array) -> RigidLink:
        """Return the link with a body rigidly added: mass [kg], centre [m], inertia about it [kg m²]."""
        total = self.mass + mass
        middle = (self.mass * self.centre + mass * centre) / total
        tensor = self.inertia + inertia
        for m, p in ((self.mass, self.centre - middle), (mass, centre - middle)):
            tensor = tensor + m * (p @ p * np.eye(3) - np.outer(p, p))
        return RigidLink(self.d, self.a, self.alpha, total, middle, tensor)

    def principal(self) -> tuple[list[float], Array]:
        """Return the principal inertias [kg m²] and the rotation from their axes to the link's frame."""
        if np.count_nonzero(self.inertia - np.diag(np.diag(self.inertia))) == 0:
            return np.diag(self.inertia).tolist(), np.eye(3)
        values, axes = np.linalg.eigh(self.inertia)
        if np.linalg.det(axes) < 0:
            axes[:, 0] *= -1
        return values.tolist(), axes


def quaternion(R: Array) -> list[float]:
    """Return a rotation matrix as PyBullet's quaternion (x, y, z, w), by the largest of its four squares."""
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


def load_arm(world: World, links: Sequence[RigidLink]) -> int:
    """Make a fixed-base arm of revolute joints in a world, without motors, damping, sleep or contact.

    Args:
        world: The world; the arm's base frame is its origin.
        links: Links from the base outwards.

    Returns:
        PyBullet's body id.
    """
    bullet, n = world.bullet, len(links)
    positions: list[list[float]] = [[0.0, 0.0, 0.0]]
    turns: list[list[float]] = [[0.0, 0.0, 0.0, 1.0]]
    centres, axes, diagonals = [], [], []
    for link in links:
        c, s = math.cos(link.alpha), math.sin(link.alpha)
        R = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        p = np.array([link.a, 0.0, link.d])
        diagonal, R_principal = link.principal()
        positions.append(p.tolist())
        turns.append([math.sin(link.alpha / 2), 0.0, 0.0, math.cos(link.alpha / 2)])
        centres.append((p + R @ link.centre).tolist())
        axes.append(quaternion(R @ R_principal))
        diagonals.append(diagonal)
    body = bullet.createMultiBody(
        baseMass=0.0,
        linkMasses=[1.0] * n,
        linkCollisionShapeIndices=[-1] * n,
        linkVisualShapeIndices=[-1] * n,
        linkPositions=positions[:n],
        linkOrientations=turns[:n],
        linkInertialFramePositions=centres,
        linkInertialFrameOrientations=axes,
        linkParentIndices=list(range(n)),
        linkJointTypes=[bullet.JOINT_REVOLUTE] * n,
        linkJointAxis=[[0.0, 0.0, 1.0]] * n,
    )
    # Damping first, mass and inertia after it, and all before the first inverse-dynamics or mass-matrix call:
    # PyBullet caches the tree that answers those and never looks at the masses again.
    for j in range(n):
        bullet.changeDynamics(
            body, j, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, maxJointVelocity=_FREE_SPEED
        )
    bullet.changeDynamics(body, -1, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING)
    for j, link in enumerate(links):
        bullet.changeDynamics(body, j, mass=link.mass, localInertiaDiagonal=diagonals[j])
    bullet.setJointMotorControlArray(body, list(range(n)), bullet.VELOCITY_CONTROL, forces=[0.0] * n)
    return int(body)


@dataclass(frozen=True, slots=True)
@validated
class Reality:
    """What the simulated arm has of a real one. The default is all of it."""

    friction: bool | float = True
    """Joint friction, Coulomb and viscous: True is nominal, False none, a number in [0, 10] scales it."""
    rotor_inertia: bool = True
    """Whether the joints feel the motors' rotors, G² J_m."""
    torque_limits: bool = True
    """Whether the drives' torques end at their limits."""
    encoder_counts: Annotated[int, within(1, 10_000_000)] | None = 1000
    """Encoder counts a motor turn, after quadrature, 1 to 10,000,000; None reads positions exactly."""
    gravity: Annotated[float, within(0.0, 100.0)] = 9.81
    """Acceleration of free fall [m/s²], along -z of the base, 0 to 100; the servo knows it."""
    dt: Annotated[float, within(1e-05, 0.01)] = 1e-3
    """Step of physics, servo and references [s], 1e-5 to 0.01."""
    ideal: bool = False
    """Kinematic following: positions and speeds are the references', without physics (counterfactuals)."""

    def __post_init__(self) -> None:
        if not isinstance(self.friction, bool):
            object.__setattr__(self, "friction", number_in("friction", self.friction, 0.0, 10.0))

    @property
    def friction_scale(self) -> float:
        """Friction as a multiple of the nominal."""
        return float(self.friction)


@dataclass(frozen=True, slots=True, eq=False)
class Payload:
    """A rigid body held at the flange."""

    mass: float
    """Mass [kg], in (0, 50]."""
    centre: Array
    """Centre of mass in the flange's frame [m], (3,), each within ±1."""
    inertia: Array
    """Inertia about the centre of mass along the flange's axes [kg m²], (3, 3), one that a body can have."""

    def __init__(self, mass: float, centre: ArrayLike = (0.0, 0.0, 0.0), inertia: ArrayLike | None = None) -> None:
        """Take mass [kg], centre [m], inertia [kg m²], (3, 3) or the (3,) diagonal; without it a point mass.

        Raises:
            InvalidValueError: If a value isn't finite or out of range, or no body has such an inertia.
        """
        allowed = "a mass in (0, 50] kg"
        value = finite("mass", mass, allowed)
        if not 0 < value <= 50:
            raise InvalidValueError("mass", mass, allowed)
        allowed = "three numbers within ±1 m"
        point = finite_array("centre", centre, (3,), allowed)
        if np.abs(point).max() > 1:
            raise InvalidValueError("centre", centre, allowed)
        allowed = "a (3,) diagonal or a symmetric (3, 3) whose principal values are those of a body [kg m²]"
        tensor = finite_array("inertia", np.zeros((3, 3)) if inertia is None else inertia, None, allowed)
        if tensor.shape == (3,):
            tensor = finite_array("inertia", np.diag(tensor), (3, 3), allowed)
        if tensor.shape != (3, 3) or not np.allclose(tensor, tensor.T, rtol=1e-9, atol=1e-15):
            raise InvalidValueError("inertia", inertia, allowed)
        small, middle, large = np.linalg.eigvalsh(tensor)
        tolerance = 1e-9 * max(abs(small), abs(large))
        if small < -tolerance or small + middle < large - tolerance:
            raise InvalidValueError("inertia", inertia, allowed)
        object.__setattr__(self, "mass", value)
        object.__setattr__(self, "centre", point)
        object.__setattr__(self, "inertia", tensor)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Payload):
            return False
        same = self.mass == other.mass and np.array_equal(self.centre, other.centre)
        return same and np.array_equal(self.inertia, other.inertia)

    def __hash__(self) -> int:
        return hash((self.mass, self.centre.tobytes(), self.inertia.tobytes()))
