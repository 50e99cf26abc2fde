"""The real PUMA 560: its links, drives, encoders and servo, for any world of physics."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from robots.chain import Chain, ChainLink, Inertia
from robots.onboard.servo import ServoGains
from robots.puma560 import dynamics
from robots.puma560.parameters import DH_A, DH_ALPHA, DH_D, DOF, FLANGE, POSES
from robots.simulated import USUAL_WORLD, Payload, Reality, SimulatedArm

_MASS: Final = (1.0, *dynamics.MASS[1:])
_INERTIA: Final = ((0.35,) * 3, *dynamics.INERTIA[1:])
"""Link 1 is a placeholder: it turns about its own axis only, and PyBullet's inverse dynamics need a mass."""


def chain() -> Chain:
    """Armstrong's links on their drives.

    A joint's frame turns with the link; the link's Denavit-Hartenberg frame is fixed in it, at
    Trans_z(d) Trans_x(a) Rot_x(α).
    """
    links = []
    place, turn = np.zeros(3), [0.0, 0.0, 0.0, 1.0]
    for j in range(DOF):
        c, s = math.cos(DH_ALPHA[j]), math.sin(DH_ALPHA[j])
        X = np.array([[1.0, 0.0, 0.0, DH_A[j]], [0.0, c, -s, 0.0], [0.0, s, c, DH_D[j]], [0.0, 0.0, 0.0, 1.0]])
        links.append(
            ChainLink(
                place,
                turn,
                Inertia(_MASS[j], np.array(dynamics.CENTRE[j]), np.diag(_INERTIA[j])),
                X,
                effort=dynamics.TORQUE_MAX[j],
                armature=dynamics.ARMATURE[j],
                viscous=dynamics.JOINT_VISCOUS[j],
                coulomb=dynamics.JOINT_COULOMB[j],
                gear=dynamics.GEAR[j],
            )
        )
        place, turn = X[:3, 3], [math.sin(DH_ALPHA[j] / 2), 0.0, 0.0, math.cos(DH_ALPHA[j] / 2)]
    flange = np.eye(4)
    flange[2, 3] = FLANGE
    return Chain(tuple(links), flange)


class RealArm(SimulatedArm):
    """A simulated PUMA 560; its servo knows it by the Robotics Toolbox."""

    def __init__(
        self,
        reality: Reality | None = None,
        q: ArrayLike | None = None,
        payload: Payload | None = None,
        gains: ServoGains | None = None,
        world: str = USUAL_WORLD,
    ) -> None:
        """Put the arm at rest; see `SimulatedArm`.

        Args:
            reality: How real it is.
            q: Joint positions [rad], (6,); the pose `ready` unless given.
            payload: What it holds at the start.
            gains: Of the servo.
            world: One of `robots.simulated.WORLDS`.
        """
        reality = Reality() if reality is None else reality
        gains = ServoGains() if gains is None else gains
        super().__init__(
            chain(),
            POSES["ready"] if q is None else q,
            inertia=dynamics.SERVO_INERTIA,
            world=world,
            reality=reality,
            payload=payload,
            gains=gains,
            feedforward=dynamics.nominal_torques(
                gravity=reality.gravity,
                rotor_inertia=reality.rotor_inertia,
                friction=gains.friction if reality.friction_scale > 0 else 0.0,
            ),
        )
