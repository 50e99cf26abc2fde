"""An arm of rigid links in a world of physics, with drives, friction and a servo on board.

A step applies one torque a joint for dt, semi-implicitly: speeds first, then positions with the new speeds. Links
have no collision shapes and joints no hard stops: the references keep the arm in its range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from operator import truediv
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from robots.bullet.chain import BulletChain
from robots.bullet.drives import Drives
from robots.bullet.serial_arm import Payload, Reality
from robots.bullet.world import LostError
from robots.chain import Chain, Inertia, servo_inertia
from robots.mujoco.chain import MujocoChain
from robots.onboard.servo import Servo, ServoGains
from robots.robot import Closing, Measured, Prepared
from vrs.checks import finite_array
from vrs.errors import InvalidValueError
from vrs.model import Array, Limits, frozen_array


class RigidChain(Protocol):
    """A chain in a world of physics: joints that take torques, and nothing else."""

    def place(self, q: Sequence[float], qd: Sequence[float]) -> None:
        """Put the joints into a state."""

    def dynamics(self) -> tuple[Sequence[Sequence[float]], Sequence[float]]:
        """Mass matrix without armatures, (n, n), and torques of gravity and speeds, (n,), in the present state."""

    def step(self, tau: Sequence[float]) -> tuple[list[float], list[float]]:
        """Apply torques for a step, (n,), and say where the joints are then, and how fast."""

    def close(self) -> None:
        """Give back what it holds."""


WORLDS: Final[dict[str, Callable[..., RigidChain]]] = {"bullet": BulletChain, "mujoco": MujocoChain}
"""Makers of chains, by the names of bodies."""
_BOUNDS: Final = (1e3, 1e3, 1e5)
_CREEP: Final = 0.01
"""Joint speed below which the Coulomb compensation fades out [rad/s]."""


class SimulatedArm(Closing):
    """An arm that follows references; see `robots.robot.ArmBody`. It's a context manager, or `close` it."""

    def __init__(
        self,
        world: str,
        chain: Chain,
        limits: Limits,
        q: ArrayLike,
        *,
        friction: bool = True,
        dt: float = 1e-3,
        gains: ServoGains | None = None,
    ) -> None:
        """Put the arm at rest.

        Args:
            world: One of `WORLDS`.
            chain: Its links.
            limits: Its servo's gains are made for the middle of them.
            q: Joint positions [rad], of prismatic joints [m], (n,).
            friction: Whether its joints have friction.
            dt: Step of physics, servo and references [s].
            gains: Of the servo.

        Raises:
            InvalidValueError: If q isn't n finite numbers within ±1000, or there's no such world here.
        """
        gains = ServoGains() if gains is None else gains
        self._world, self._chain, self._n = WORLDS[world], chain, len(chain.links)
        self.reality = reality = Reality(friction=friction, encoder_counts=None, dt=dt)
        scale = reality.friction_scale
        links = chain.links
        self._viscous = np.array([scale * link.viscous for link in links])
        self._coulomb = np.array([scale * link.coulomb for link in links])
        self._compensated = gains.friction
        self._drives = Drives(
            armature=[link.armature for link in links],
            viscous=self._viscous.tolist(),
            coulomb=[(c, -c) for c in self._coulomb.tolist()],
            dt=dt,
        )
        self._efforts = [link.effort for link in links]
        self._q, self._qd = self._row("q", q, _BOUNDS[0]), [0.0] * self._n
        self._steps = 0
        low, high = limits.q_min, limits.q_max
        poses = [low + share * (high - low) for share in (0.35, 0.5, 0.65)]
        self._servo = Servo(gains, inertia=servo_inertia(chain, poses), feedforward=self._nominal, q=self._q, dt=dt)
        self._bodies = self._load(None)

    @property
    def q(self) -> Array:
        """True joint positions, (n,)."""
        return frozen_array(self._q)

    @property
    def qd(self) -> Array:
        """True joint speeds, (n,)."""
        return frozen_array(self._qd)

    @property
    def time(self) -> float:
        """Time since the arm was made [s]."""
        return self._steps * self.reality.dt

    def prepare(self, q_ref: ArrayLike, qd_ref: ArrayLike, qdd_ref: ArrayLike) -> Prepared:
        """Work out beforehand what `follow` needs.

        For a single row it takes more time than the step itself, for a block next to none.

        Args:
            q_ref: Joint positions [rad], [m], (k, n), within ±1e3; reference i is for the end of step i.
            qd_ref: Joint speeds, (k, n), within ±1e3.
            qdd_ref: Joint accelerations, (k, n), within ±1e5.

        Raises:
            InvalidValueError: If a reference is of the wrong shape, not finite or out of range.
        """
        rows: list[Array] = []
        for name, value, bound in zip(
            ("q_ref", "qd_ref", "qdd_ref"), (q_ref, qd_ref, qdd_ref), _BOUNDS, strict=True
        ):
            allowed = f"of shape (k, {self._n}), one k for all, finite and within ±{bound:g}"
            array = finite_array(name, value, None, allowed)
            if array.ndim != 2 or array.shape[1] != self._n or (rows and len(array) != len(rows[0])):
                raise InvalidValueError(name, f"shape {array.shape}", allowed)
            if array.size and np.abs(array).max() > bound:
                raise InvalidValueError(name, float(np.abs(array).max()), allowed)
            rows.append(array)
        q, qd, qdd = rows
        return Prepared(q, qd, self._servo.feedforward(q, qd, qdd) if len(q) else np.empty((0, self._n)))

    def follow(self, prepared: Prepared) -> Measured:
        """Follow references that `prepare` has made ready.

        Blocks of any length give what one long block gives, to the last bit.

        Raises:
            WorldClosedError: If the arm is closed.
            LostError: If the arm's state explodes.
        """
        bodies, drives, servo, efforts = self._bodies, self._drives, self._servo, self._efforts
        passive = drives.passive
        # Flat lists of floats: a list kept for every step would call the garbage collector every 700 steps.
        positions: list[float] = []
        speeds: list[float] = []
        torques: list[float] = []
        saturated = [0] * self._n
        q, qd = self._q, self._qd
        for u, target in zip(prepared.feedforward.tolist(), prepared.q.tolist(), strict=True):
            tau = servo.torques(q, u, target)
            if max(map(truediv, map(abs, tau), efforts)) > 1.0:
                for j, limit in enumerate(efforts):
                    if not -limit <= tau[j] <= limit:
                        tau[j] = math.copysign(limit, tau[j])
                        saturated[j] += 1
            q, qd = bodies.step(tau if passive else drives.joint_torques(*bodies.dynamics(), qd, tau))
            self._keep(q, qd)
            positions.extend(q)
            speeds.extend(qd)
            torques.extend(tau)
        followed, rates, drawn = (frozen_array(flat).reshape(-1, self._n) for flat in (positions, speeds, torques))
        return Measured(followed, rates, drawn, np.array(saturated, dtype=np.int64))

    def apply(self, tau: ArrayLike) -> None:
        """Step once under drive torques [N m], forces [N], (n,), without the servo and its limits."""
        torques = self._row("tau", tau, math.inf)
        if not self._drives.passive:
            torques = self._drives.joint_torques(*self._bodies.dynamics(), self._qd, torques)
        self._keep(*self._bodies.step(torques))

    def place(self, q: ArrayLike, qd: ArrayLike) -> None:
        """Put the arm into a state, (n,) each; the servo holds that position."""
        self._q, self._qd = self._row("q", q, _BOUNDS[0]), self._row("qd", qd, _BOUNDS[1])
        self._servo.hold(self._q)
        self._bodies.place(self._q, self._qd)

    def attach(self, mass: float) -> None:
        """Take a load [kg] at the flange, in place of what was held; speeds stay, the servo isn't told."""
        self._exchange(Payload(mass))

    def release(self) -> None:
        """Drop the load."""
        self._exchange(None)

    @override
    def close(self) -> None:
        self._bodies.close()

    def _exchange(self, payload: Payload | None) -> None:
        self._bodies.close()
        self._bodies = self._load(payload)

    def _load(self, payload: Payload | None) -> RigidChain:
        load = None if payload is None else Inertia(payload.mass, payload.centre, payload.inertia)
        bodies = self._world(self._chain.holding(load), gravity=self.reality.gravity, dt=self.reality.dt)
        bodies.place(self._q, self._qd)
        return bodies

    def _keep(self, q: list[float], qd: list[float]) -> None:
        self._q, self._qd = q, qd
        self._steps += 1
        if not abs(sum(qd)) < 1e9:
            raise LostError("arm", self.time, "diverged", ": references or torques beyond its drives")

    def _nominal(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Torques of motions as the servo knows them: no load, and some of the friction."""
        rigid = self._chain.inverse_dynamics(q, qd, qdd, gravity=self.reality.gravity)
        sliding = self._coulomb * np.clip(qd / _CREEP, -1.0, 1.0)
        return np.asarray(rigid + self._compensated * (self._viscous * qd + sliding))

    def _row(self, name: str, value: ArrayLike, bound: float) -> list[float]:
        allowed = f"{self._n} finite numbers within ±{bound:g}"
        array = finite_array(name, value, (self._n,), allowed)
        if np.abs(array).max() > bound:
            raise InvalidValueError(name, value, allowed)
        row: list[float] = array.tolist()
        return row
