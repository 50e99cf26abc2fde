"""An arm of rigid links in a world of physics, with drives, friction, encoders and a servo on board.

How real the arm is, and what it may carry, are its `Reality` and `Payload`. A step applies one torque a joint for
dt, semi-implicitly: speeds first, then positions with the new speeds. Links have no collision shapes and joints no
hard stops: the references keep the arm in its range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from operator import truediv
from typing import Annotated, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from robots.bullet.chain import BulletChain
from robots.bullet.vehicle import BulletVehicle
from robots.bullet.world import LostError, WorldClosedError
from robots.chain import Chain, Inertia
from robots.drives import Drives
from robots.mujoco.chain import MujocoChain
from robots.mujoco.vehicle import MujocoVehicle
from robots.onboard.servo import FeedForward, Servo, ServoGains
from robots.robot import Closing, Measured, Prepared
from robots.vehicle import RigidVehicle
from vrs.checks import finite, finite_array, number_in, validated, within
from vrs.errors import InvalidValueError
from vrs.model import Array, Limits, frozen_array


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
    """Counts an encoder's turn, after quadrature, 1 to 10,000,000; None reads positions exactly."""
    gravity: Annotated[float, within(0.0, 100.0)] = 9.81
    """Acceleration of free fall [m/s²], along -z of the base, 0 to 100; the servo knows it."""
    dt: Annotated[float, within(1e-05, 0.01)] = 1e-3
    """Step of physics, servo and references [s], 1e-5 to 0.01."""

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


class Makers(NamedTuple):
    """What a world of physics makes of what a robot consists of."""

    chain: Callable[..., RigidChain]
    """Of a `Chain`."""
    vehicle: Callable[..., RigidVehicle]
    """Of a `robots.vehicle.Vehicle` in a room."""


WORLDS: Final = {"bullet": Makers(BulletChain, BulletVehicle), "mujoco": Makers(MujocoChain, MujocoVehicle)}
"""Worlds of physics by the names of bodies; the usual one first, PyBullet where it's installed."""
_NEEDED: Final = {"bullet": "pybullet", "mujoco": "mujoco"}
"""Packages that worlds need."""


def missing_for(body: str) -> str:
    """Return the package that a body needs and that isn't installed; empty where it can be made here."""
    needed = _NEEDED.get(body, "")
    return needed if needed and find_spec(needed) is None else ""


if missing_for("bullet"):
    WORLDS["bullet"] = WORLDS.pop("bullet")
USUAL_WORLD: Final = next(iter(WORLDS))
"""The world of a body unless another is asked for."""
_BOUNDS: Final = (1e3, 1e3, 1e5)
_CREEP: Final = 0.01
"""Joint speed below which the Coulomb compensation fades out [rad/s], [m/s]."""


class SimulatedArm(Closing):
    """An arm that follows references; see `robots.robot.ArmBody`. It's a context manager, or `close` it."""

    def __init__(
        self,
        chain: Chain,
        q: ArrayLike,
        *,
        inertia: Sequence[float],
        world: str = USUAL_WORLD,
        reality: Reality | None = None,
        payload: Payload | None = None,
        gains: ServoGains | None = None,
        feedforward: FeedForward | None = None,
    ) -> None:
        """Put the arm at rest.

        Args:
            chain: Its links.
            q: Joint positions [rad], of prismatic joints [m], (n,).
            inertia: Joint inertias that the servo's gains are made for [kg m²], [kg], n of them.
            world: One of `WORLDS`.
            reality: How real it is; everything, unless given.
            payload: What it holds at the start; the servo isn't told.
            gains: Of the servo.
            feedforward: The arm's inverse dynamics as the servo knows them; the chain's own unless given.

        Raises:
            InvalidValueError: If q isn't n finite numbers within ±1000, or the world isn't installed.
        """
        self.reality = reality = Reality() if reality is None else reality
        gains = ServoGains() if gains is None else gains
        self._world, self._n, links = WORLDS[world].chain, len(chain.links), chain.links
        if not reality.rotor_inertia:
            links = tuple(replace(link, armature=0.0) for link in links)
        self._chain = replace(chain, links=links)
        scale = reality.friction_scale
        self._drives = Drives(
            armature=[link.armature for link in links],
            viscous=[scale * link.viscous for link in links],
            coulomb=[(scale * high, scale * low) for high, low in (link.coulomb for link in links)],
            dt=reality.dt,
        )
        self._compensated = gains.friction if scale > 0 else 0.0
        self._efforts = [link.effort for link in links] if reality.torque_limits else None
        self._steps = 0
        self._q, self._qd = self._row("q", q, _BOUNDS[0]), [0.0] * self._n
        counts = reality.encoder_counts
        read = [abs(link.gear) * (counts or 0) / (2 * math.pi) for link in links]
        self._counts = read if any(read) else None
        self._servo = Servo(
            gains,
            inertia=inertia,
            feedforward=self._nominal if feedforward is None else feedforward,
            q=self._q,
            dt=reality.dt,
        )
        self._payload = payload
        self._held = self._holding(payload)
        self._bodies: RigidChain | None = self._load()

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

    @property
    def payload(self) -> Payload | None:
        """What the arm holds."""
        return self._payload

    @property
    def bodies(self) -> RigidChain:
        """Its links in their world.

        Raises:
            WorldClosedError: If the arm is closed.
        """
        if self._bodies is None:
            raise WorldClosedError
        return self._bodies

    def run(self, q_ref: ArrayLike, qd_ref: ArrayLike, qdd_ref: ArrayLike) -> Measured:
        """Follow k references, dt apart; reference i is for the end of step i.

        Blocks of any length give what one long block gives, to the last bit.

        Args:
            q_ref: Joint positions [rad], [m], (k, n), within ±1e3.
            qd_ref: Joint speeds [rad/s], [m/s], (k, n), within ±1e3.
            qdd_ref: Joint accelerations [rad/s²], [m/s²], (k, n), within ±1e5.

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
        """Follow references that `prepare` has made ready; returns and raises as `run`."""
        drives, servo, efforts = self._drives, self._servo, self._efforts
        step, dynamics, passive = self.bodies.step, self.bodies.dynamics, drives.passive
        # Flat lists of floats: a list kept for every step would call the garbage collector every 700 steps.
        positions: list[float] = []
        speeds: list[float] = []
        torques: list[float] = []
        saturated = [0] * self._n
        q, qd = self._q, self._qd
        reading = self._read(q)
        for u, target in zip(prepared.feedforward.tolist(), prepared.q.tolist(), strict=True):
            tau = servo.torques(reading, u, target)
            if efforts is not None and max(map(truediv, map(abs, tau), efforts)) > 1.0:
                for j, limit in enumerate(efforts):
                    if not -limit <= tau[j] <= limit:
                        tau[j] = math.copysign(limit, tau[j])
                        saturated[j] += 1
            q, qd = step(tau if passive else drives.joint_torques(*dynamics(), qd, tau))
            self._keep(q, qd)
            reading = self._read(q)
            positions.extend(reading)
            speeds.extend(qd)
            torques.extend(tau)
        rows = [frozen_array(flat).reshape(-1, self._n) for flat in (positions, speeds, torques)]
        return Measured(rows[0], rows[1], rows[2], np.array(saturated, dtype=np.int64))

    def apply(self, tau: ArrayLike) -> None:
        """Step once under drive torques [N m], forces [N], (n,), without the servo and its limits.

        Raises:
            InvalidValueError: If tau isn't n finite numbers.
            WorldClosedError: If the arm is closed.
            LostError: If the arm's state explodes.
        """
        torques = self._row("tau", tau, math.inf)
        if not self._drives.passive:
            torques = self._drives.joint_torques(*self.bodies.dynamics(), self._qd, torques)
        self._keep(*self.bodies.step(torques))

    def place(self, q: ArrayLike, qd: ArrayLike | None = None) -> None:
        """Put the arm into a state: positions and speeds, (n,), at rest unless given; the servo holds it.

        Raises:
            InvalidValueError: If a value isn't finite, within ±1000, or the shape is wrong.
        """
        position = self._row("q", q, _BOUNDS[0])
        speed = [0.0] * self._n if qd is None else self._row("qd", qd, _BOUNDS[1])
        self._q, self._qd = position, speed
        self._servo.hold(position)
        self.bodies.place(position, speed)

    def attach(self, payload: Payload | float) -> None:
        """Hold a payload, or a mass [kg], in place of what was held; speeds stay, the servo isn't told."""
        self._exchange(payload if isinstance(payload, Payload) else Payload(payload))

    def release(self) -> None:
        """Let the payload go; without one nothing changes."""
        self._exchange(None)

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Return the frictionless drive torques of a motion, (n,): true payload, rotors if it has any.

        Args:
            q: Joint positions [rad], [m], (n,).
            qd: Joint speeds [rad/s], [m/s], (n,).
            qdd: Joint accelerations [rad/s²], [m/s²], (n,).
        """
        given = zip(("q", "qd", "qdd"), (q, qd, qdd), _BOUNDS, strict=True)
        rows = [np.array([self._row(*item)]) for item in given]
        return frozen_array(self._held.inverse_dynamics(rows[0], rows[1], rows[2], gravity=self.reality.gravity)[0])

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return the joint-space inertia at q, (n, n): true payload, rotors if it has any."""
        return frozen_array(self._held.mass_matrix(np.array(self._row("q", q, _BOUNDS[0]))))

    @override
    def close(self) -> None:
        if self._bodies is not None:
            self._bodies.close()
            self._bodies = None

    def _exchange(self, payload: Payload | None) -> None:
        if payload != self._payload:
            self._payload, self._held = payload, self._holding(payload)
            self.bodies.close()
            self._bodies = self._load()

    def _holding(self, payload: Payload | None) -> Chain:
        load = None if payload is None else Inertia(payload.mass, payload.centre, payload.inertia)
        return self._chain.holding(load)

    def _load(self) -> RigidChain:
        bodies = self._world(self._held, gravity=self.reality.gravity, dt=self.reality.dt)
        bodies.place(self._q, self._qd)
        return bodies

    def _keep(self, q: list[float], qd: list[float]) -> None:
        self._q, self._qd = q, qd
        self._steps += 1
        if not abs(sum(qd)) < 1e9:
            raise LostError("arm", self.time, "diverged", ": references or torques beyond its drives")

    def _read(self, q: list[float]) -> list[float]:
        if self._counts is None:
            return q
        return [round(x * c) / c for x, c in zip(q, self._counts, strict=True)]

    def _nominal(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Torques of motions as the servo knows them: no load, and some of the friction."""
        rigid = self._chain.inverse_dynamics(q, qd, qdd, gravity=self.reality.gravity)
        return rigid + self._compensated * friction_torques(self._chain, qd)

    def _row(self, name: str, value: ArrayLike, bound: float) -> list[float]:
        allowed = f"{self._n} finite numbers within ±{bound:g}"
        array = finite_array(name, value, (self._n,), allowed)
        if np.abs(array).max() > bound:
            raise InvalidValueError(name, value, allowed)
        row: list[float] = array.tolist()
        return row


def friction_torques(chain: Chain, qd: Array) -> Array:
    """Nominal friction at joint speeds [rad/s], [m/s], (k, n); the Coulomb part fades out linearly below 0.01."""
    links = chain.links
    share = np.clip(qd / _CREEP, -1.0, 1.0)
    forward, backward = np.array([link.coulomb for link in links]).T
    coulomb = share * np.where(share > 0, forward, -backward)
    return np.asarray(np.array([link.viscous for link in links]) * qd + coulomb)


def chain_arm(
    world: str,
    chain: Chain,
    limits: Limits,
    gravity: float,
    q: ArrayLike,
    *,
    friction: bool = True,
    dt: float = 1e-3,
) -> SimulatedArm:
    """Make the body of a chain of which no more is known: see `robots.robot.ArmMaker`.

    The servo's gains are made for its joints' inertias amid their limits.

    Args:
        world: One of `WORLDS`.
        chain: Its links.
        limits: Of its joints.
        gravity: Free fall along -z of its base [m/s²].
        q: Joint positions [rad], of prismatic joints [m], (n,).
        friction: Whether its joints have friction.
        dt: Its step [s].
    """
    amid = [limits.q_min + share * (limits.q_max - limits.q_min) for share in (0.35, 0.5, 0.65)]
    inertia = np.mean([np.diag(chain.mass_matrix(one)) for one in amid], axis=0).tolist()
    return SimulatedArm(
        chain, q, inertia=inertia, world=world, reality=Reality(friction=friction, gravity=gravity, dt=dt)
    )
