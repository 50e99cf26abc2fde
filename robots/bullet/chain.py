"""A chain of rigid links in a PyBullet world of its own; see `robots.simulated.RigidChain`."""

from __future__ import annotations

from collections.abc import Sequence

from typing_extensions import override

from robots.bullet.world import World
from robots.chain import Chain, quaternion
from robots.robot import Closing

_FREE_SPEED = 1e9
_LEAST_MASS = 1e-9
"""PyBullet's inverse dynamics fail on zero [kg]."""


class BulletChain(Closing):
    """Joints that take torques, and nothing else: no motors, damping, limits or contacts."""

    def __init__(self, chain: Chain, *, gravity: float, dt: float) -> None:
        """Make the chain at q = 0, with free fall along -z of the base [m/s²] and a fixed step [s]."""
        self.world = World(gravity=gravity, dt=dt)
        """The PyBullet world that it's alone in."""
        bullet, links = self.world.bullet, chain.links
        n = len(links)
        self._joints, self._zero = tuple(range(n)), (0.0,) * n
        turned = [link.principal() for link in links]
        self.body = body = int(
            bullet.createMultiBody(
                baseMass=0.0,
                linkMasses=[1.0] * n,
                linkCollisionShapeIndices=[-1] * n,
                linkVisualShapeIndices=[-1] * n,
                linkPositions=[link.place.tolist() for link in links],
                linkOrientations=[list(link.turn) for link in links],
                linkInertialFramePositions=[link.centre.tolist() for link in links],
                linkInertialFrameOrientations=[quaternion(axes) for _, axes in turned],
                linkParentIndices=list(range(n)),
                linkJointTypes=[
                    bullet.JOINT_PRISMATIC if link.prismatic else bullet.JOINT_REVOLUTE for link in links
                ],
                linkJointAxis=[link.axis.tolist() for link in links],
            )
        )
        """PyBullet's id of the chain."""
        # Damping first, mass and inertia after it, and all before the first inverse-dynamics or mass-matrix call:
        # PyBullet caches the tree that answers those and never looks at the masses again.
        for j in self._joints:
            bullet.changeDynamics(
                body, j, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, maxJointVelocity=_FREE_SPEED
            )
        bullet.changeDynamics(body, -1, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING)
        for j, (link, (diagonal, _)) in enumerate(zip(links, turned, strict=True)):
            bullet.changeDynamics(body, j, mass=max(link.inertia.mass, _LEAST_MASS), localInertiaDiagonal=diagonal)
        bullet.setJointMotorControlArray(body, self._joints, bullet.VELOCITY_CONTROL, forces=[0.0] * n)
        self._q, self._qd = [0.0] * n, [0.0] * n

    def place(self, q: Sequence[float], qd: Sequence[float]) -> None:
        """Put the joints into a state."""
        self._q, self._qd = list(q), list(qd)
        for j in self._joints:
            self.world.bullet.resetJointState(self.body, j, q[j], targetVelocity=qd[j])

    def dynamics(self) -> tuple[Sequence[Sequence[float]], Sequence[float]]:
        """Mass matrix without armatures, and torques of gravity and speeds, in the present state."""
        bullet = self.world.bullet
        M = bullet.calculateMassMatrix(self.body, self._q)
        return M, bullet.calculateInverseDynamics(self.body, self._q, self._qd, self._zero)

    def step(self, tau: Sequence[float]) -> tuple[list[float], list[float]]:
        """Apply torques for a step, and say where the joints are then, and how fast."""
        bullet = self.world.bullet
        bullet.setJointMotorControlArray(self.body, self._joints, bullet.TORQUE_CONTROL, forces=tau)
        bullet.stepSimulation()
        states = bullet.getJointStates(self.body, self._joints)
        self._q, self._qd = [s[0] for s in states], [s[1] for s in states]
        return self._q, self._qd

    @override
    def close(self) -> None:
        self.world.close()
