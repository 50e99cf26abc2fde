"""A vehicle in a PyBullet world of its own; see `robots.vehicle.RigidVehicle`.

The pose that PyBullet tells is that of the box's centre of mass along its principal axes.

Wheels collide as spheres: PyBullet's cylinders wander by centimetres on a circle at any step. Joints have a small
Coulomb friction, which PyBullet's own joint motors make at speed 0.
"""

from __future__ import annotations

import math

import numpy as np
from typing_extensions import override

from robots.bullet.world import CHASSIS, FLOOR, THING, WHEEL, RoomBodies, World
from robots.chain import quaternion
from robots.robot import Closing
from robots.rooms import Room
from robots.vehicle import (
    BODY_FRICTION,
    DRIVES,
    GAP,
    HOLD_TIME,
    LIMB_GAIN,
    Cargo,
    Pair,
    Point,
    Posture,
    Vehicle,
    Wheel,
)
from vrs.model import Array

_FREE_SPEED = 1e6
_FLAT = [0.0, 0.0, 0.0, 1.0]
_ITERATIONS = 30
"""Most of PyBullet's contact solver in a step; fewer do where it converges."""


class BulletVehicle(Closing):
    """Servos that turn wheels and limbs, and nothing else."""

    def __init__(self, vehicle: Vehicle, room: Room, posture: Posture, *, gravity: float, dt: float) -> None:
        """Put a vehicle into a room at a posture, with free fall along -z [m/s²] and a fixed step [s]."""
        self.world = World(gravity=gravity, dt=dt)
        """The PyBullet world of the vehicle and its room."""
        self.world.bullet.setPhysicsEngineParameter(
            numSolverIterations=_ITERATIONS, deterministicOverlappingPairs=1
        )
        self._room = RoomBodies(self.world, room)
        self._vehicle = vehicle
        self.body = self._load(posture)
        """PyBullet's id of the vehicle."""
        self._centre, self._R_CR = vehicle.rigid.centre, vehicle.rigid.principal()[1].T
        self._torques = [vehicle.torque] * len(DRIVES)
        self._gains = [-math.expm1(-dt / HOLD_TIME)] * len(DRIVES)
        first = len(vehicle.wheels)
        self._limbs = tuple(range(first, first + len(vehicle.limbs)))
        self._cargo: list[int] = []

    def _load(self, posture: Posture) -> int:
        bullet, vehicle, parts = self.world.bullet, self._vehicle, self._vehicle.parts
        diagonal, R_principal = vehicle.rigid.principal()
        box = bullet.createCollisionShape(
            bullet.GEOM_BOX,
            halfExtents=[length / 2 for length in vehicle.size],
            collisionFramePosition=list(vehicle.middle),
        )
        shapes = [
            bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=part.radius) if part.radius else -1
            for part in parts
        ]
        n = len(parts)
        x, y, theta = posture
        body = int(
            bullet.createMultiBody(
                baseMass=vehicle.rigid.mass,
                baseCollisionShapeIndex=box,
                basePosition=[x, y, 0.0],
                baseOrientation=[0.0, 0.0, float(np.sin(theta / 2)), float(np.cos(theta / 2))],
                baseInertialFramePosition=vehicle.rigid.centre.tolist(),
                baseInertialFrameOrientation=quaternion(R_principal),
                linkMasses=[part.mass for part in parts],
                linkCollisionShapeIndices=shapes,
                linkVisualShapeIndices=[-1] * n,
                linkPositions=[list(part.position) for part in parts],
                linkOrientations=[_FLAT] * n,
                linkInertialFramePositions=[list(part.centre) for part in parts],
                linkInertialFrameOrientations=[_FLAT] * n,
                linkParentIndices=[part.parent for part in parts],
                linkJointTypes=[
                    bullet.JOINT_FIXED if part.axis is None else bullet.JOINT_REVOLUTE for part in parts
                ],
                linkJointAxis=[[0.0, 0.0, 1.0] if part.axis is None else list(part.axis) for part in parts],
            )
        )
        bullet.changeDynamics(
            body,
            -1,
            linearDamping=0.0,
            angularDamping=0.0,
            activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        )
        bullet.changeDynamics(body, -1, maxJointVelocity=_FREE_SPEED)
        # Not in one call with linearDamping or maxJointVelocity: with either, PyBullet takes the base for the link.
        for j in range(-1, n):
            bullet.changeDynamics(
                body,
                j,
                jointDamping=0.0,
                lateralFriction=BODY_FRICTION if j < 0 else parts[j].friction,
                spinningFriction=0.0,
                rollingFriction=0.0,
                restitution=0.0,
                localInertiaDiagonal=diagonal if j < 0 else parts[j].inertia,
            )
            group, mask = (CHASSIS, THING) if j < 0 else (WHEEL, FLOOR)
            bullet.setCollisionFilterGroupMask(body, j, group, mask)
        turning = [j for j in range(n) if parts[j].axis is not None]
        bullet.setJointMotorControlArray(
            body, turning, bullet.VELOCITY_CONTROL, forces=[parts[j].resistance for j in turning]
        )
        return body

    def step(self, angles: Pair, speeds: Pair) -> None:
        """Go on by a step, the servos turning the wheels."""
        bullet = self.world.bullet
        bullet.setJointMotorControlArray(
            self.body,
            DRIVES,
            bullet.POSITION_CONTROL,
            targetPositions=angles,
            targetVelocities=speeds,
            positionGains=self._gains,
            velocityGains=(1.0, 1.0),
            forces=self._torques,
        )
        bullet.stepSimulation()

    def pose(self) -> tuple[Array, Array]:
        """Where the vehicle's frame is, and how it's turned."""
        bullet = self.world.bullet
        position, turn = bullet.getBasePositionAndOrientation(self.body)
        R = np.array(bullet.getMatrixFromQuaternion(turn)).reshape(3, 3) @ self._R_CR
        return np.array(position) - R @ self._centre, R

    def velocity(self) -> tuple[Array, Array]:
        """Velocity of the frame's origin, and angular velocity."""
        linear, angular = self.world.bullet.getBaseVelocity(self.body)
        _, R = self.pose()
        return np.array(linear) - np.cross(angular, R @ self._centre), np.array(angular)

    def angles(self) -> Pair:
        """What the driven wheels have turned by."""
        right, left = self.world.bullet.getJointStates(self.body, DRIVES)
        return right[0], left[0]

    def drives(self) -> tuple[Wheel, Wheel]:
        """What the right and the left wheel do."""
        bullet, body = self.world.bullet, self.body
        found: list[Wheel] = []
        for j in DRIVES:
            _, speed, _, torque = bullet.getJointState(body, j)
            points = bullet.getContactPoints(bodyA=body, linkIndexA=j)
            found.append(Wheel(speed, torque, sum(point[9] for point in points)))
        return found[0], found[1]

    def place(self, posture: Posture) -> None:
        """Turn the vehicle about the vertical and shift it to a posture, which takes its speed away."""
        (x, y, _), R = self.pose()
        bullet = self.world.bullet
        position, turn = bullet.getBasePositionAndOrientation(self.body)
        # A turn about the vertical through the robot's own reference point, then a shift.
        angle = math.remainder(posture[2] - math.atan2(R[1, 0], R[0, 0]), math.tau)
        c, s = math.cos(angle), math.sin(angle)
        dx, dy = position[0] - x, position[1] - y
        place = [posture[0] + c * dx - s * dy, posture[1] + s * dx + c * dy, position[2]]
        upright = [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
        _, turned = bullet.multiplyTransforms([0.0] * 3, upright, [0.0] * 3, turn)
        bullet.resetBasePositionAndOrientation(self.body, place, turned)

    def rewind(self) -> None:
        """Take the driven wheels' angles for 0, and stop them."""
        for j in DRIVES:
            self.world.bullet.resetJointState(self.body, j, 0.0)

    @property
    def changing(self) -> bool:
        """Whether anything in the room ever moves, comes or goes."""
        return self._room.changing

    def at(self, t: float) -> None:
        """Bring everything in the room to where it is at a time [s]."""
        self._room.at(t)

    def touched(self) -> set[str]:
        """What the box touches; what lies on top has no name in the room."""
        points, names = self.world.bullet.getContactPoints(bodyA=self.body, linkIndexA=-1), self._room.names
        return {names[point[2]] for point in points if point[8] <= 0.0 and point[2] in names}

    def cast(self, origins: Array, directions: Array, height: float, reach: float) -> Array:
        """How far level rays go to what's in the room."""
        return self._room.cast(origins, directions, height, reach)

    def load(self, cargo: Cargo, at: Point, heading: float) -> None:
        """Let a piece of cargo go above a place on the box's top."""
        bullet = self.world.bullet
        half = [cargo.length / 2, cargo.width / 2, cargo.height / 2]
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half)
        x, y, z = at
        turn = [0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2)]
        body = int(bullet.createMultiBody(cargo.mass, shape, -1, [x, y, z + half[2] + GAP], turn))
        bullet.changeDynamics(body, -1, lateralFriction=cargo.friction)
        bullet.setCollisionFilterGroupMask(body, -1, 0, 0)
        for other in (self.body, self._room.floor):
            bullet.setCollisionFilterPair(body, other, -1, -1, 1)
        self._cargo.append(body)

    def cargo(self) -> list[Array]:
        """Where the middle of each piece is."""
        bullet = self.world.bullet
        return [np.array(bullet.getBasePositionAndOrientation(one)[0]) for one in self._cargo]

    def swing(self, limb: int, angle: float, speed: float) -> None:
        """Let a limb's servo go to an angle, at most at a speed, from now on."""
        self.world.bullet.setJointMotorControl2(
            self.body,
            self._limbs[limb],
            self.world.bullet.POSITION_CONTROL,
            targetPosition=angle,
            positionGain=LIMB_GAIN,
            velocityGain=1.0,
            force=self._vehicle.limbs[limb].resistance,
            maxVelocity=speed,
        )

    def limbs(self) -> tuple[float, ...]:
        """Angles of the limbs."""
        states = self.world.bullet.getJointStates(self.body, self._limbs)
        return tuple(float(state[0]) for state in states)

    @override
    def close(self) -> None:
        self.world.close()
