"""The real PUMA 560: a PyBullet body with drives, friction, encoders and a servo on board.

A step applies one torque for dt, semi-implicitly as PyBullet does: speeds first, then positions with the new
speeds. Links have no collision shapes and joints no hard stops: the references keep the arm in its range.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import truediv

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from robots.bullet.drives import Drives
from robots.bullet.serial_arm import Payload, Reality, RigidLink, load_arm
from robots.bullet.world import LostError, World
from robots.onboard.servo import Servo, ServoGains
from robots.puma560 import dynamics
from robots.puma560.dynamics import nominal_torques
from robots.puma560.parameters import DH_A, DH_ALPHA, DH_D, DOF, FLANGE, POSES
from robots.robot import Closing, Measured, Prepared
from vrs.checks import finite_array
from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array

_BOUNDS = (1e3, 1e3, 1e5)
_JOINTS = tuple(range(DOF))
_ZERO = (0.0,) * DOF


def puma_links(payload: Payload | None = None) -> tuple[RigidLink, ...]:
    """Return Armstrong's links, with a payload at the flange if one is given.

    Link 1 is a placeholder, 1 kg on its axis with 0.35 kg m² three times: it turns about that axis only, and
    PyBullet's inverse dynamics need a mass.
    """
    masses = (1.0, *dynamics.MASS[1:])
    inertias = ((0.35,) * 3, *dynamics.INERTIA[1:])
    links = [
        RigidLink(
            d=DH_D[j],
            a=DH_A[j],
            alpha=DH_ALPHA[j],
            mass=masses[j],
            centre=np.array(dynamics.CENTRE[j]),
            inertia=np.diag(inertias[j]),
        )
        for j in range(DOF)
    ]
    if payload is not None:
        centre = payload.centre + np.array([0.0, 0.0, FLANGE])
        links[-1] = links[-1].with_body(payload.mass, centre, payload.inertia)
    return tuple(links)


class RealArm(Closing):
    """A simulated PUMA 560 in a PyBullet world of its own; use it as a context manager, or `close` it."""

    def __init__(
        self,
        reality: Reality | None = None,
        q: ArrayLike | None = None,
        payload: Payload | None = None,
        gains: ServoGains | None = None,
    ) -> None:
        """Put the arm at rest.

        Args:
            reality: How real it is; everything, unless given.
            q: Joint positions [rad], (6,); the pose `ready` unless given.
            payload: What it holds at the start; the servo isn't told.
            gains: Of the servo.

        Raises:
            InvalidValueError: If q isn't six finite numbers within ±1000.
        """
        self.reality = reality = Reality() if reality is None else reality
        gains = ServoGains() if gains is None else gains
        scale = reality.friction_scale
        self._armature = dynamics.ARMATURE if reality.rotor_inertia else _ZERO
        self._drives = Drives(
            armature=self._armature,
            viscous=[scale * b for b in dynamics.JOINT_VISCOUS],
            coulomb=[(scale * high, scale * low) for high, low in dynamics.JOINT_COULOMB],
            dt=reality.dt,
        )
        nominal = nominal_torques(
            gravity=reality.gravity,
            rotor_inertia=reality.rotor_inertia,
            friction=gains.friction if scale > 0 else 0.0,
        )
        self._steps = 0
        self._q = _row("q", POSES["ready"] if q is None else q, _BOUNDS[0])
        self._qd = [0.0] * DOF
        self._counts = None
        if reality.encoder_counts is not None:
            self._counts = [abs(g) * reality.encoder_counts / (2 * math.pi) for g in dynamics.GEAR]
        self._servo = Servo(
            gains,
            inertia=dynamics.SERVO_INERTIA,
            feedforward=nominal,
            q=self._q,
            dt=reality.dt,
        )
        self._payload = payload
        self.world = World(gravity=reality.gravity, dt=reality.dt)
        """The PyBullet world that it's alone in."""
        self._body = self._load()

    @property
    def q(self) -> Array:
        """True joint positions [rad], (6,)."""
        return frozen_array(self._q)

    @property
    def qd(self) -> Array:
        """True joint speeds [rad/s], (6,)."""
        return frozen_array(self._qd)

    @property
    def time(self) -> float:
        """Time since the arm was made [s]."""
        return self._steps * self.reality.dt

    @property
    def payload(self) -> Payload | None:
        """What the arm holds."""
        return self._payload

    def run(self, q_ref: ArrayLike, qd_ref: ArrayLike, qdd_ref: ArrayLike) -> Measured:
        """Follow k references, dt apart; reference i is for the end of step i.

        Blocks of any length give what one long block gives, to the last bit.

        Args:
            q_ref: Joint positions [rad], (k, 6), within ±1e3.
            qd_ref: Joint speeds [rad/s], (k, 6), within ±1e3.
            qdd_ref: Joint accelerations [rad/s²], (k, 6), within ±1e5.

        Returns:
            What happened.

        Raises:
            InvalidValueError: If a reference is of the wrong shape, not finite or out of range; the arm
                hasn't moved then.
            WorldClosedError: If the arm is closed.
            LostError: If the arm's state explodes.
        """
        return self.follow(self.prepare(q_ref, qd_ref, qdd_ref))

    def prepare(self, q_ref: ArrayLike, qd_ref: ArrayLike, qdd_ref: ArrayLike) -> Prepared:
        """Work out beforehand what `follow` needs; arguments and errors as of `run`.

        For a single row it takes more time than the step itself, for a block next to none.
        """
        q, qd, qdd = _references(q_ref, qd_ref, qdd_ref)
        return Prepared(q, qd, self._servo.feedforward(q, qd, qdd) if len(q) else np.empty((0, DOF)))

    def follow(self, prepared: Prepared) -> Measured:
        """Follow references that `prepare` has made ready; returns and raises as `run`."""
        bullet = self.world.bullet
        if self.reality.ideal:
            return self._follow(prepared)
        body, drives, servo = self._body, self._drives, self._servo
        control, step, read = bullet.setJointMotorControlArray, bullet.stepSimulation, bullet.getJointStates
        mass_matrix, inverse_dynamics = bullet.calculateMassMatrix, bullet.calculateInverseDynamics
        torque_mode, passive, limited = bullet.TORQUE_CONTROL, drives.passive, self.reality.torque_limits
        # Flat lists of floats: a list kept for every step would call the garbage collector every 700 steps.
        positions: list[float] = []
        speeds: list[float] = []
        torques: list[float] = []
        saturated = [0] * DOF
        q, qd = self._q, self._qd
        reading = self._read(q)
        for u, target in zip(prepared.feedforward.tolist(), prepared.q.tolist(), strict=True):
            tau = servo.torques(reading, u, target)
            if limited and max(map(truediv, map(abs, tau), dynamics.TORQUE_MAX)) > 1.0:
                for j, limit in enumerate(dynamics.TORQUE_MAX):
                    if not -limit <= tau[j] <= limit:
                        tau[j] = math.copysign(limit, tau[j])
                        saturated[j] += 1
            applied = tau
            if not passive:
                M = mass_matrix(body, q)
                bias = inverse_dynamics(body, q, qd, _ZERO)
                applied = drives.joint_torques(M, bias, qd, tau)
            control(body, _JOINTS, torque_mode, forces=applied)
            step()
            states = read(body, _JOINTS)
            q, qd = [s[0] for s in states], [s[1] for s in states]
            self._keep(q, qd)
            reading = self._read(q)
            positions.extend(reading)
            speeds.extend(qd)
            torques.extend(tau)
        return Measured(_rows(positions), _rows(speeds), _rows(torques), np.array(saturated, dtype=np.int64))

    def apply(self, tau: ArrayLike) -> None:
        """Step once under drive torques [N m], (6,), without the servo and its limits.

        Raises:
            InvalidValueError: If tau isn't six finite numbers.
            WorldClosedError: If the arm is closed.
            LostError: If the arm's state explodes.
        """
        torques = finite_array("tau", tau, (DOF,), "six finite joint torques [N m]").tolist()
        bullet, body = self.world.bullet, self._body
        if not self._drives.passive:
            M = bullet.calculateMassMatrix(body, self._q)
            bias = bullet.calculateInverseDynamics(body, self._q, self._qd, _ZERO)
            torques = self._drives.joint_torques(M, bias, self._qd, torques)
        bullet.setJointMotorControlArray(body, _JOINTS, bullet.TORQUE_CONTROL, forces=torques)
        bullet.stepSimulation()
        states = bullet.getJointStates(body, _JOINTS)
        self._keep([s[0] for s in states], [s[1] for s in states])

    def place(self, q: ArrayLike, qd: ArrayLike = _ZERO) -> None:
        """Put the arm into a state: positions [rad] and speeds [rad/s], (6,); the servo holds that position.

        Raises:
            InvalidValueError: If a value isn't finite, within ±1000, or the shape is wrong.
        """
        position, speed = _row("q", q, _BOUNDS[0]), _row("qd", qd, _BOUNDS[1])
        self._q, self._qd = position, speed
        self._servo.hold(self._q)
        self._set_state()

    def attach(self, payload: Payload | float) -> None:
        """Hold a payload, or a mass [kg], in place of what was held; speeds stay, the servo isn't told."""
        self._exchange(payload if isinstance(payload, Payload) else Payload(payload))

    def release(self) -> None:
        """Let the payload go; without one nothing changes."""
        self._exchange(None)

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Return the frictionless drive torques of a motion [N m], (6,): true payload, rotors if it has any.

        Args:
            q: Joint positions [rad], (6,).
            qd: Joint speeds [rad/s], (6,).
            qdd: Joint accelerations [rad/s²], (6,).
        """
        rows = [_row(*item) for item in zip(("q", "qd", "qdd"), (q, qd, qdd), _BOUNDS, strict=True)]
        tau = self.world.bullet.calculateInverseDynamics(self._body, *rows)
        return frozen_array(np.array(tau) + np.array(self._armature) * rows[2])

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return the joint-space inertia at q [rad], (6, 6) [kg m²]: true payload, rotors if it has any."""
        row = _row("q", q, _BOUNDS[0])
        M = self.world.bullet.calculateMassMatrix(self._body, row)
        return frozen_array(np.array(M) + np.diag(self._armature))

    @override
    def close(self) -> None:
        self.world.close()

    def _follow(self, prepared: Prepared) -> Measured:
        q, qd, feedforward = prepared
        if len(q):
            self._q, self._qd = q[-1].tolist(), qd[-1].tolist()
            self._steps += len(q)
            self._servo.hold(self._q)
            self._set_state()
        return Measured(q, qd, frozen_array(feedforward), np.zeros(DOF, dtype=np.int64))

    def _keep(self, q: list[float], qd: list[float]) -> None:
        self._q, self._qd = q, qd
        self._steps += 1
        if not abs(sum(qd)) < 1e9:
            raise LostError("arm", self.time, "diverged", ": references or torques beyond its drives")

    def _read(self, q: list[float]) -> list[float]:
        if self._counts is None:
            return q
        return [round(x * c) / c for x, c in zip(q, self._counts, strict=True)]

    def _exchange(self, payload: Payload | None) -> None:
        if payload != self._payload:
            self._payload = payload
            self.world.clear()
            self._body = self._load()

    def _load(self) -> int:
        body = load_arm(self.world, puma_links(self._payload))
        self._body = body
        self._set_state()
        return body

    def _set_state(self) -> None:
        for j, (x, v) in enumerate(zip(self._q, self._qd, strict=True)):
            self.world.bullet.resetJointState(self._body, j, x, targetVelocity=v)


def _references(q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> tuple[Array, Array, Array]:
    rows: list[Array] = []
    for name, value, bound in zip(("q_ref", "qd_ref", "qdd_ref"), (q, qd, qdd), _BOUNDS, strict=True):
        allowed = f"of shape (k, {DOF}), one k for all, finite and within ±{bound:g}"
        array = finite_array(name, value, None, allowed)
        if array.ndim != 2 or array.shape[1] != DOF or (rows and len(array) != len(rows[0])):
            raise InvalidValueError(name, f"shape {array.shape}", allowed)
        if array.size and np.abs(array).max() > bound:
            raise InvalidValueError(name, float(np.abs(array).max()), allowed)
        rows.append(array)
    return rows[0], rows[1], rows[2]


def _row(name: str, value: ArrayLike, bound: float) -> list[float]:
    allowed = f"{DOF} finite numbers within ±{bound:g}"
    array = finite_array(name, value, (DOF,), allowed)
    if np.abs(array).max() > bound:
        raise InvalidValueError(name, value, allowed)
    row: list[float] = array.tolist()
    return row


def _rows(flat: Sequence[float]) -> Array:
    return frozen_array(np.array(flat, dtype=np.float64).reshape(-1, DOF))
