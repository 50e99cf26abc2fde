"""The real mobile robots as simulated bodies in PyBullet: the IPR and the micro-robot.

The pose that PyBullet tells is that of the base's centre of mass along its principal axes; postures here are of the
middle of the driving axle.

A chassis is a PyBullet multibody: a box, two driven wheels, casters. Wheels collide as spheres: PyBullet's
cylinders wander by centimetres on a circle at any step. Casters with a trail are a swivelling fork and a wheel;
without, a ball that slides. All joints but the drives' have a small Coulomb friction, which PyBullet's own joint
motors make at speed 0.

Cargo lies on a robot and is held by friction alone: a book that somebody puts there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from typing_extensions import override

from robots.bullet.world import CHASSIS, FLOOR, THING, WHEEL, LostError, RoomBodies, World
from robots.chain import Inertia, quaternion, together
from robots.mobile.chassis import Chassis, MobileReality
from robots.mobile.robot import MobileRobot
from vrs.checks import finite, validated, within
from vrs.errors import InvalidValueError
from vrs.model import Array

DRIVES = (0, 1)
"""Joints of the driven wheels, right and left."""
_FREE_SPEED = 1e6
_BALL_FRICTION = 0.02
_BODY_FRICTION = 0.3
_FLAT = [0.0, 0.0, 0.0, 1.0]


@dataclass(slots=True)
class _Link:
    """One link, in PyBullet's terms."""

    mass: float
    radius: float
    """Of its sphere; 0 for none."""
    position: tuple[float, float, float]
    parent: int
    """0 is the base."""
    axis: tuple[float, float, float] | None
    """None is a fixed joint."""
    inertia: list[float]
    friction: float
    resistance: float
    """Coulomb friction of the joint [N m]."""
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre of mass, from the joint [m]."""


def _disc(mass: float, radius: float, width: float, rotor: float = 0.0) -> list[float]:
    """Principal inertias of a wheel that turns about y, with what a rotor adds to its spin [kg m²]."""
    across = mass * (3 * radius * radius + width * width) / 12
    return [across, mass * radius * radius / 2 + rotor, across]


def _links(chassis: Chassis, reality: MobileReality, radii: tuple[float, float], base: float) -> list[_Link]:
    rotor = chassis.gear**2 * chassis.rotor
    links = [
        _Link(
            chassis.wheel_mass,
            radius,
            (0.0, y, radius),
            0,
            (0.0, 1.0, 0.0),
            _disc(chassis.wheel_mass, radius, chassis.wheel_width, rotor),
            reality.friction,
            0.0,
        )
        for radius, y in zip(radii, (-base / 2, base / 2), strict=True)
    ]
    r, trail, half = chassis.caster_radius, chassis.caster_trail, chassis.caster_mass / 2
    resistance = reality.rolling * chassis.caster_rolling
    for x, y in chassis.casters:
        if trail == 0.0:
            sphere = [0.4 * chassis.caster_mass * r * r] * 3
            place = (x, y, r + chassis.caster_lift)
            links.append(_Link(chassis.caster_mass, r, place, 0, None, sphere, _BALL_FRICTION, 0.0))
            continue
        fork = [half * r * r] * 3
        links.append(_Link(half, 0.0, (x, y, 2 * r), 0, (0.0, 0.0, 1.0), fork, 0.0, resistance))
        place = (-trail, 0.0, chassis.caster_lift - r)
        axle = (0.0, 1.0, 0.0)
        links.append(_Link(half, r, place, len(links), axle, _disc(half, r, r), reality.friction, resistance))
    links += [
        # Held by its servo until somebody moves it.
        _Link(limb.mass, 0.0, limb.joint, 0, limb.axis, limb.inertia(), 0.0, limb.torque, limb.centre)
        for limb in chassis.limbs
    ]
    return links


def load_chassis(
    world: World,
    chassis: Chassis,
    reality: MobileReality,
    posture: tuple[float, float, float],
    radii: tuple[float, float],
    base: float,
) -> tuple[int, Array, Array]:
    """Put a chassis into a world, standing on the floor.

    Args:
        world: The world, with its floor.
        chassis: What to load.
        reality: Friction, payload and the casters' resistance.
        posture: Where, (x, y, θ).
        radii: True radii of the right and the left wheel [m].
        base: True wheel base [m].
    """
    bullet = world.bullet
    load = reality.payload
    loads = () if load is None else (Inertia(load.mass, load.centre, load.inertia),)
    rigid = together((Inertia(*chassis.rigid()), *loads))
    diagonal, R_principal = rigid.principal()
    height = chassis.height - chassis.ground_clearance
    box = bullet.createCollisionShape(
        bullet.GEOM_BOX,
        halfExtents=[chassis.length / 2, chassis.width / 2, height / 2],
        collisionFramePosition=[chassis.centre_x, 0.0, chassis.ground_clearance + height / 2],
    )
    links = _links(chassis, reality, radii, base)
    shapes = [
        bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=link.radius) if link.radius else -1 for link in links
    ]
    n = len(links)
    x, y, theta = posture
    body = bullet.createMultiBody(
        baseMass=rigid.mass,
        baseCollisionShapeIndex=box,
        basePosition=[x, y, 0.0],
        baseOrientation=[0.0, 0.0, float(np.sin(theta / 2)), float(np.cos(theta / 2))],
        baseInertialFramePosition=rigid.centre.tolist(),
        baseInertialFrameOrientation=quaternion(R_principal),
        linkMasses=[link.mass for link in links],
        linkCollisionShapeIndices=shapes,
        linkVisualShapeIndices=[-1] * n,
        linkPositions=[list(link.position) for link in links],
        linkOrientations=[_FLAT] * n,
        linkInertialFramePositions=[list(link.centre) for link in links],
        linkInertialFrameOrientations=[_FLAT] * n,
        linkParentIndices=[link.parent for link in links],
        linkJointTypes=[bullet.JOINT_FIXED if link.axis is None else bullet.JOINT_REVOLUTE for link in links],
        linkJointAxis=[[0.0, 0.0, 1.0] if link.axis is None else list(link.axis) for link in links],
    )
    bullet.changeDynamics(
        body, -1, linearDamping=0.0, angularDamping=0.0, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING
    )
    bullet.changeDynamics(body, -1, maxJointVelocity=_FREE_SPEED)
    # Not in one call with linearDamping or maxJointVelocity: with either, PyBullet takes the base for the link.
    for j in range(-1, n):
        bullet.changeDynamics(
            body,
            j,
            jointDamping=0.0,
            lateralFriction=_BODY_FRICTION if j < 0 else links[j].friction,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            localInertiaDiagonal=diagonal if j < 0 else links[j].inertia,
        )
        group, mask = (CHASSIS, THING) if j < 0 else (WHEEL, FLOOR)
        bullet.setCollisionFilterGroupMask(body, j, group, mask)
    turning = [j for j in range(n) if links[j].axis is not None]
    bullet.setJointMotorControlArray(
        body, turning, bullet.VELOCITY_CONTROL, forces=[links[j].resistance for j in turning]
    )
    return int(body), rigid.centre, R_principal.T


_GAP = 0.002
"""It's let go so high above the robot [m]."""


@dataclass(frozen=True, slots=True)
@validated
class Cargo:
    """A box that can be put on a robot."""

    name: str = "book"
    length: Annotated[float, within(0.01, 2.0)] = 0.24
    """[m], in [0.01, 2]."""
    width: Annotated[float, within(0.01, 2.0)] = 0.17
    """[m], in [0.01, 2]."""
    height: Annotated[float, within(0.005, 2.0)] = 0.03
    """[m], in [0.005, 2]."""
    mass: Annotated[float, within(0.01, 100.0)] = 0.9
    """[kg], in [0.01, 100]."""
    friction: Annotated[float, within(0.0, 2.0)] = 0.5
    """Of its sides, in [0, 2]; the robot's top has 0.5, and PyBullet takes the product of both."""


def put_cargo(world: World, cargo: Cargo, robot: int, floor: int, place: tuple[float, float, float, float]) -> int:
    """Let a piece of cargo go just above a robot's top; it meets that robot and the floor.

    Args:
        world: Where.
        cargo: What.
        robot: PyBullet's id of the robot.
        floor: And of the floor.
        place: Of its middle on the robot's top, x, y, z [m] and heading [rad], in the world.

    Returns:
        PyBullet's id of the cargo.
    """
    bullet = world.bullet
    half = [cargo.length / 2, cargo.width / 2, cargo.height / 2]
    shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half)
    x, y, z, angle = (finite("place", value) for value in place)
    turn = [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
    body = int(bullet.createMultiBody(cargo.mass, shape, -1, [x, y, z + half[2] + _GAP], turn))
    bullet.changeDynamics(body, -1, lateralFriction=cargo.friction)
    bullet.setCollisionFilterGroupMask(body, -1, 0, 0)
    for other in (robot, floor):
        bullet.setCollisionFilterPair(body, other, -1, -1, 1)
    return body


_HOLD_TIME = 0.03
"""How fast the servos make up for the angle that a load took from them [s]; the LM629 regulates angles, too."""
_BEHIND = 0.2
"""By how much a shaft's reference may run ahead of a wheel that can't follow [rad]."""
_LOOKS = 60.0
"""How often people go on and touches are looked for [Hz]."""
_SETTLING = 0.5
"""How long the robot stands before its time begins, so that its contacts bear its weight [s]."""
_ITERATIONS = 30
"""Most of PyBullet's contact solver in a step; fewer do where it converges."""
_FREE_TORQUE = 1e6
_UPRIGHT = 0.7
"""Cosine of the tilt beyond which a robot has fallen."""


class Wheel(NamedTuple):
    """What a driven wheel does."""

    speed: float
    """Of the tyre [rad/s]."""
    torque: float
    """Of the drive in the last step [N m]."""
    load: float
    """Weight that the floor bears under it [N]."""


class MobileBody(MobileRobot):
    """A robot with mass, tyres and casters in a PyBullet world of its own; use it as a context manager."""

    _STEP = 1 / 240

    def _begin(self) -> None:
        self.world = World(gravity=self.reality.gravity, dt=self.reality.dt)
        """The PyBullet world of the robot and its room."""
        self.world.bullet.setPhysicsEngineParameter(
            numSolverIterations=_ITERATIONS, deterministicOverlappingPairs=1
        )
        self._room_bodies = RoomBodies(self.world, self.room)
        self._cargo: list[int] = []
        train, dt = self._train, self.reality.dt
        start = self.truth
        self.body_id, self._centre, self._R_CR = load_chassis(
            self.world, self.chassis, self.reality, start, train.radii, train.base
        )
        limited = self.reality.torque_limits
        self._torques = [self.chassis.torque if limited else _FREE_TORQUE] * len(DRIVES)
        self._gains = [-math.expm1(-dt / _HOLD_TIME)] * len(DRIVES)
        self._target_right = self._target_left = 0.0
        self._tyres = (0.0, 0.0)
        self._angles = (0.0, 0.0)
        self._every_look = self._every(_LOOKS)
        for _ in range(round(_SETTLING / dt)):
            self._turn(0.0, 0.0)
        self._put_back(start)
        try:
            self._observe()
        except LostError:
            self.close()
            raise

    @property
    def motion(self) -> tuple[float, float]:
        """True speed v of the middle of the axle, forward [m/s], and ω [rad/s]."""
        linear, angular = self.world.bullet.getBaseVelocity(self.body_id)
        _, R = self._pose()
        velocity = np.array(linear) - np.cross(angular, R @ self._centre)
        return float(velocity @ R[:, 0]), float(angular[2])

    @property
    def tilt(self) -> float:
        """Angle between the robot's axis and the vertical [rad]."""
        return math.acos(min(1.0, float(self._pose()[1][2, 2])))

    @property
    def wheels(self) -> tuple[Wheel, Wheel]:
        """What the right and the left wheel do."""
        bullet, body = self.world.bullet, self.body_id
        found: list[Wheel] = []
        for j in DRIVES:
            _, speed, _, torque = bullet.getJointState(body, j)
            points = bullet.getContactPoints(bodyA=body, linkIndexA=j)
            found.append(Wheel(speed, torque, sum(point[9] for point in points)))
        return found[0], found[1]

    def load(self, cargo: Cargo, place: tuple[float, float] | None = None) -> None:
        """Put something on top; friction alone holds it there.

        Args:
            cargo: What.
            place: Where its middle is to lie, x forward and y left of the driving axle's middle [m]; the middle of
                the robot's top unless given.

        Raises:
            InvalidValueError: If the place isn't on the robot's top.
            WorldClosedError: If the robot is closed.
        """
        self._ready()
        chassis = self.chassis
        x, y = (chassis.centre_x, 0.0) if place is None else place
        if not (abs(x - chassis.centre_x) <= chassis.length / 2 and abs(y) <= chassis.width / 2):
            raise InvalidValueError("place", place, "one on the robot's top")
        at, R = self._pose()
        top = at + R @ np.array([x, y, chassis.height])
        there = float(top[0]), float(top[1]), float(top[2]), self.truth[2]
        self._cargo.append(put_cargo(self.world, cargo, self.body_id, self._room_bodies.floor, there))

    @property
    def cargo(self) -> tuple[tuple[float, float, float], ...]:
        """Where the middle of each thing that was put on top is now, in the robot's frame, x, y, z [m]."""
        at, R = self._pose()
        bullet = self.world.bullet
        found = (bullet.getBasePositionAndOrientation(one)[0] for one in self._cargo)
        places = (R.T @ (np.array(place) - at) for place in found)
        return tuple((float(x), float(y), float(z)) for x, y, z in places)

    @override
    def close(self) -> None:
        self.world.close()

    def _ready(self) -> None:
        _ = self.world.bullet

    def _advance(self, n: int) -> None:
        train, dt, moving = self._train, self.reality.dt, self._room_bodies.moving
        slip_right, slip_left = train.slips
        keep_right, keep_left = 1 - slip_right, 1 - slip_left
        for _ in range(n):
            right, left = train.step()
            self._turn(right * keep_right, left * keep_left)
            self._steps += 1
            if self._steps % self._every_look == 0:
                self._look()
                if moving:
                    self._room_bodies.at(self._steps * dt)
        self._observe()

    def _turn(self, right: float, left: float) -> None:
        """Step once with the tyres' wanted speeds [rad/s]."""
        bullet = self.world.bullet
        bullet.setJointMotorControlArray(
            self.body_id,
            DRIVES,
            bullet.POSITION_CONTROL,
            targetPositions=(self._target_right, self._target_left),
            targetVelocities=(right, left),
            positionGains=self._gains,
            velocityGains=(1.0, 1.0),
            forces=self._torques,
        )
        bullet.stepSimulation()
        dt = self.reality.dt
        self._target_right += right * dt
        self._target_left += left * dt

    def _observe(self) -> None:
        """Read the truth; and, where the encoders are due, the shafts' angles at the slips that held."""
        (x, y, _), R = self._pose()
        if not math.isfinite(x + y):
            raise LostError("robot", self.time, "diverged")
        if R[2, 2] < _UPRIGHT:
            raise LostError("robot", self.time, "fell over")
        heading = math.atan2(R[1, 0], R[0, 0])
        turns = round((self.truth[2] - heading) / math.tau)
        self.truth = float(x), float(y), heading + turns * math.tau
        if self._steps % self._every_encoder:
            return
        states = self.world.bullet.getJointStates(self.body_id, DRIVES)
        right, left = states[0][0], states[1][0]
        slip_right, slip_left = self._train.slips
        self._angles = (
            self._angles[0] + (right - self._tyres[0]) / (1 - slip_right),
            self._angles[1] + (left - self._tyres[1]) / (1 - slip_left),
        )
        self._tyres = right, left
        self._target_right = min(max(self._target_right, right - _BEHIND), right + _BEHIND)
        self._target_left = min(max(self._target_left, left - _BEHIND), left + _BEHIND)

    def _look(self) -> None:
        """Note what the chassis touches."""
        points = self.world.bullet.getContactPoints(bodyA=self.body_id, linkIndexA=-1)
        names = self._room_bodies.names
        # What lies on top has no name in the room.
        touched = sorted({names[point[2]] for point in points if point[8] <= 0.0 and point[2] in names})
        # One that's touched on counts as the same collision.
        self._touch(self.touching if self.touching in touched else touched[0] if touched else "")

    def _pose(self) -> tuple[Array, Array]:
        """Where the robot's frame is, (3,), and how it's turned, (3, 3)."""
        bullet = self.world.bullet
        position, turn = bullet.getBasePositionAndOrientation(self.body_id)
        R = np.array(bullet.getMatrixFromQuaternion(turn)).reshape(3, 3) @ self._R_CR
        return np.array(position) - R @ self._centre, R

    def _put_back(self, start: tuple[float, float, float]) -> None:
        """Shift what settling moved, so that the robot begins at its start; wheels count from there."""
        self._move(start)
        for j in DRIVES:
            self.world.bullet.resetJointState(self.body_id, j, 0.0)
        self._target_right = self._target_left = 0.0

    def _move(self, start: tuple[float, float, float]) -> None:
        """Turn the robot about the vertical and shift it, so that it stands at a posture."""
        (x, y, _), R = self._pose()
        bullet = self.world.bullet
        position, turn = bullet.getBasePositionAndOrientation(self.body_id)
        # A turn about the vertical through the robot's own reference point, then a shift.
        angle = math.remainder(start[2] - math.atan2(R[1, 0], R[0, 0]), math.tau)
        c, s = math.cos(angle), math.sin(angle)
        dx, dy = position[0] - x, position[1] - y
        place = [start[0] + c * dx - s * dy, start[1] + s * dx + c * dy, position[2]]
        upright = [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
        _, turned = bullet.multiplyTransforms([0.0] * 3, upright, [0.0] * 3, turn)
        bullet.resetBasePositionAndOrientation(self.body_id, place, turned)

    @override
    def shafts(self) -> tuple[float, float]:
        return self._angles

    def _put(self, posture: tuple[float, float, float]) -> None:
        # With it PyBullet takes the base's speed away.
        self._move(posture)
        self.truth = posture

    @override
    def distances(self, origins: Array, directions: Array, reach: float, height: float) -> Array:
        return self._room_bodies.cast(origins, directions, height, reach)
