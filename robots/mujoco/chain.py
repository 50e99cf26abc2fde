"""A chain of rigid links in MuJoCo; see `robots.simulated.RigidChain`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from typing_extensions import override

from robots.chain import Chain, quaternion
from robots.robot import Closing
from vrs.errors import InvalidValueError


def load_mujoco() -> Any:
    """Import MuJoCo.

    Raises:
        InvalidValueError: If it isn't installed.
    """
    try:
        import mujoco
    except ImportError:
        raise InvalidValueError(
            "body", "mujoco", "with MuJoCo installed: pip install 'vrs-teleop[mujoco]'"
        ) from None
    return mujoco


class MujocoChain(Closing):
    """Joints that take torques, and nothing else: no actuators, damping, limits or contacts."""

    def __init__(self, chain: Chain, *, gravity: float, dt: float) -> None:
        """Make the chain at q = 0, with free fall along -z of the base [m/s²] and a fixed step [s]."""
        mujoco = load_mujoco()
        spec = mujoco.MjSpec()
        spec.option.timestep, spec.option.gravity = dt, [0.0, 0.0, -gravity]
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        body = spec.worldbody
        for link in chain.links:
            body = body.add_body(pos=link.place, quat=w_first(link.turn))
            # Where the weight lies decides how the body is compiled.
            body.ipos, body.iquat = link.centre, w_first(quaternion(link.principal()[1]))
            # Its own check refuses inertias that break the triangle inequality, as measured ones do.
            body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
            kind = mujoco.mjtJoint.mjJNT_SLIDE if link.prismatic else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(type=kind, axis=link.axis)
        model = spec.compile()
        for j, link in enumerate(chain.links, start=1):
            model.body_mass[j], model.body_inertia[j] = link.inertia.mass, link.principal()[0]
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        self._mujoco, self._model, self._data = mujoco, model, data
        # Views of its memory: asking for one costs as much as a step of two joints.
        self._q, self._qd = data.qpos, data.qvel
        self._tau, self._bias = data.qfrc_applied, data.qfrc_bias
        self._mass = np.zeros((model.nv, model.nv))
        mujoco.mj_step1(model, data)

    def place(self, q: Sequence[float], qd: Sequence[float]) -> None:
        """Put the joints into a state."""
        self._q[:], self._qd[:] = q, qd
        self._mujoco.mj_step1(self._model, self._data)

    def dynamics(self) -> tuple[Sequence[Sequence[float]], Sequence[float]]:
        """Mass matrix without armatures, and torques of gravity and speeds, in the present state."""
        self._mujoco.mj_fullM(self._model, self._data, self._mass)
        return self._mass.tolist(), self._bias.tolist()

    def step(self, tau: Sequence[float]) -> tuple[list[float], list[float]]:
        """Apply torques for a step, and say where the joints are then, and how fast."""
        data = self._data
        self._tau[:] = tau
        self._mujoco.mj_step2(self._model, data)
        self._mujoco.mj_step1(self._model, data)
        return self._q.tolist(), self._qd.tolist()

    @override
    def close(self) -> None:
        """Nothing is held."""


def w_first(turn: Sequence[float]) -> list[float]:
    """A quaternion (x, y, z, w) as MuJoCo has it."""
    x, y, z, w = turn
    return [w, x, y, z]
