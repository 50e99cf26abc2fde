"""Masses, inertias, drives and friction of the PUMA 560, and its inverse dynamics.

The values are those of the Robotics Toolbox's `Puma560`, each link's in its own standard Denavit-Hartenberg
frame; a test compares the tables with the Toolbox.

Source: Armstrong, Khatib, Burdick, "The explicit dynamic model and inertial parameters of the PUMA 560 arm",
ICRA 1986; Corke, Armstrong-Hélouvry, ICRA 1994.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from robots.puma560.parameters import DH_A, DH_ALPHA, DH_D, DOF
from vrs.model import Array

MASS: Final = (0.0, 17.4, 4.8, 0.82, 0.34, 0.09)
"""Link masses [kg]; link 1's doesn't matter, it turns about a fixed axis through its inertia's frame."""
CENTRE: Final = (
    (0.0, 0.0, 0.0),
    (-0.3638, 0.006, 0.2275),
    (-0.0203, -0.0141, 0.070),
    (0.0, 0.019, 0.0),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.032),
)
"""Centres of mass [m], in the link's frame."""
INERTIA: Final = (
    (0.0, 0.35, 0.0),
    (0.13, 0.524, 0.539),
    (0.066, 0.086, 0.0125),
    (1.8e-3, 1.3e-3, 1.8e-3),
    (0.3e-3, 0.4e-3, 0.3e-3),
    (0.15e-3, 0.15e-3, 0.04e-3),
)
"""Principal inertias about the centre of mass, along the link frame's axes [kg m²]."""
GEAR: Final = (-62.6111, 107.815, -53.7063, 76.0364, 71.923, 76.686)
"""Gear ratios, motor speed over joint speed; a sign says that the motor turns the other way."""
ROTOR_INERTIA: Final = (200e-6, 200e-6, 200e-6, 33e-6, 33e-6, 33e-6)
"""Rotor inertias, motor side [kg m²]."""
VISCOUS: Final = (1.48e-3, 0.817e-3, 1.38e-3, 71.2e-6, 82.6e-6, 36.7e-6)
"""Viscous friction, motor side [N m s/rad]."""
COULOMB: Final = (
    (0.395, -0.435),
    (0.126, -0.071),
    (0.132, -0.105),
    (11.2e-3, -16.9e-3),
    (9.26e-3, -14.5e-3),
    (3.96e-3, -10.5e-3),
)
"""Coulomb friction, motor side [N m]: opposes positive joint speed, opposes negative joint speed."""
TORQUE_MAX: Final = (97.6, 186.4, 89.4, 24.2, 20.1, 21.3)
"""Largest joint torques [N m] (Armstrong, Khatib, Burdick 1986, table of motor and drive parameters)."""

_G: Final = np.array(GEAR)

ARMATURE: Final[Sequence[float]] = tuple(float(x) for x in _G**2 * np.array(ROTOR_INERTIA))
"""Rotor inertias at the joint, G² J_m [kg m²]."""
JOINT_VISCOUS: Final[Sequence[float]] = tuple(float(x) for x in _G**2 * np.array(VISCOUS))
"""Viscous friction at the joint, G² B [N m s/rad]."""
JOINT_COULOMB: Final[Sequence[tuple[float, float]]] = tuple(
    (abs(g) * high, abs(g) * low) for g, (high, low) in zip(GEAR, COULOMB, strict=True)
)
"""Coulomb friction at the joint, |G| T_c [N m], for positive and for negative joint speed."""
SERVO_INERTIA: Final = (4.0, 5.0, 1.2, 0.20, 0.18, 0.195)
"""Joint inertias that the servo's fixed gains are made for, rotors included [kg m²]: about mid-range."""

_CREEP: Final = 0.01
"""Joint speed below which the Coulomb compensation fades out [rad/s]."""


def toolbox_arm(*, gravity: float = 9.81, rotor_inertia: bool = True) -> Any:
    """Build the arm as a Robotics Toolbox DHRobot with the base at the shoulder, frictionless.

    Args:
        gravity: Acceleration of free fall along -z of the base [m/s²].
        rotor_inertia: Whether `rne` and `inertia` see the rotors.

    Returns:
        A `roboticstoolbox.DHRobot` of its own: changing it changes nobody else's.
    """
    from roboticstoolbox import DHRobot, RevoluteDH

    links = [
        RevoluteDH(
            d=DH_D[j],
            a=DH_A[j],
            alpha=DH_ALPHA[j],
            m=MASS[j],
            r=list(CENTRE[j]),
            I=[*INERTIA[j], 0.0, 0.0, 0.0],
            Jm=ROTOR_INERTIA[j] if rotor_inertia else 0.0,
            G=GEAR[j],
        )
        for j in range(DOF)
    ]
    return DHRobot(links, name="puma560", gravity=[0.0, 0.0, -gravity])


def nominal_torques(
    *, gravity: float = 9.81, rotor_inertia: bool = True, friction: float = 0.0
) -> Callable[[Array, Array, Array], Array]:
    """Return the inverse dynamics of the arm as its servo knows it: no payload, true rotors, some of the friction.

    Args:
        gravity: Acceleration of free fall along -z of the base [m/s²].
        rotor_inertia: Whether there are rotors.
        friction: How much friction to make good, 1 is nominal.
    """
    arm = toolbox_arm(gravity=gravity, rotor_inertia=rotor_inertia)
    viscous = friction * np.array(JOINT_VISCOUS)
    forward, backward = friction * np.array(JOINT_COULOMB).T

    def torques(q: Array, qd: Array, qdd: Array) -> Array:
        """Return the torques of motions, a row each, by the Toolbox's recursive Newton-Euler in C.

        Args:
            q: Joint positions [rad], (k, 6).
            qd: Joint speeds [rad/s], (k, 6).
            qdd: Joint accelerations [rad/s²], (k, 6).

        Returns:
            Torques [N m], (k, 6). A row depends on nothing but its own row of the arguments. The Coulomb part
            fades out linearly below 0.01 rad/s.
        """
        # The Toolbox's C code refuses read-only arrays, and rne then falls back to Python, 1000 times slower.
        rows = (np.array(x, dtype=np.float64) for x in (q, qd, qdd))
        rigid = np.asarray(arm.rne(*rows)).reshape(len(q), DOF)
        share = np.clip(qd / _CREEP, -1.0, 1.0)
        coulomb = share * np.where(share > 0, forward, -backward)
        return np.asarray(rigid + viscous * qd + coulomb, dtype=np.float64)

    return torques
