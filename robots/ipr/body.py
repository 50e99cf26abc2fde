"""The real mobile robots as simulated bodies in PyBullet: the IPR and the micro-robot.

The pose that PyBullet tells is that of the base's centre of mass along its principal axes; postures here are of the
middle of the driving axle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robots.bullet.room_bodies import RoomBodies
from robots.bullet.world import World
from robots.ipr.cargo import Cargo, CargoBody
from robots.ipr.robot import MobileRobot
from robots.ipr.wheeled import DRIVES, load_chassis
from vrs.errors import InvalidValueError, VrsError
from vrs.model import Array

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


class LostError(VrsError):
    """The robot's state left every sensible range, or it fell over; the robot is of no more use."""

    def __init__(self, time: float, problem: str) -> None:
        self.time, self.problem = time, problem
        super().__init__(f"the simulated robot {problem} at {time:.3f} s")


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
        self._world = World(gravity=self.reality.gravity, dt=self.reality.dt)
        self._world.bullet.setPhysicsEngineParameter(
            numSolverIterations=_ITERATIONS, deterministicOverlappingPairs=1, physicsClientId=self._world.client
        )
        self._room_bodies = RoomBodies(self._world, self.room)
        self._cargo: list[CargoBody] = []
        train, dt = self._train, self.reality.dt
        start = self._truth
        loaded = load_chassis(self._world, self.chassis, self.reality, start, train.radii, train.base)
        self._body, self._centre, self._R_CR = loaded.body, loaded.centre, loaded.R_CR
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
        linear, angular = self._world.bullet.getBaseVelocity(self._body, physicsClientId=self._world.client)
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
        bullet, client, body = self._world.bullet, self._world.client, self._body
        found: list[Wheel] = []
        for j in DRIVES:
            _, speed, _, torque = bullet.getJointState(body, j, physicsClientId=client)
            points = bullet.getContactPoints(bodyA=body, linkIndexA=j, physicsClientId=client)
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
        there = float(top[0]), float(top[1]), float(top[2]), self._truth[2]
        self._cargo.append(CargoBody(self._world, cargo, self._body, self._room_bodies.floor, there))

    @property
    def cargo(self) -> tuple[tuple[float, float, float], ...]:
        """Where the middle of each thing that was put on top is now, in the robot's frame, x, y, z [m]."""
        at, R = self._pose()
        places = (R.T @ (one.pose()[0] - at) for one in self._cargo)
        return tuple((float(x), float(y), float(z)) for x, y, z in places)

    @property
    def closed(self) -> bool:
        """Whether the robot's world is closed."""
        return self._world.closed

    def close(self) -> None:
        """Disconnect the world; a second call does nothing."""
        self._world.close()

    def _ready(self) -> None:
        _ = self._world.client

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
        bullet, client = self._world.bullet, self._world.client
        bullet.setJointMotorControlArray(
            self._body,
            DRIVES,
            bullet.POSITION_CONTROL,
            targetPositions=(self._target_right, self._target_left),
            targetVelocities=(right, left),
            positionGains=self._gains,
            velocityGains=(1.0, 1.0),
            forces=self._torques,
            physicsClientId=client,
        )
        bullet.stepSimulation(physicsClientId=client)
        dt = self.reality.dt
        self._target_right += right * dt
        self._target_left += left * dt

    def _observe(self) -> None:
        """Read the truth; and, where the encoders are due, the shafts' angles at the slips that held."""
        (x, y, _), R = self._pose()
        if not math.isfinite(x + y):
            raise LostError(self.time, "diverged")
        if R[2, 2] < _UPRIGHT:
            raise LostError(self.time, "fell over")
        heading = math.atan2(R[1, 0], R[0, 0])
        turns = round((self._truth[2] - heading) / math.tau)
        self._truth = float(x), float(y), heading + turns * math.tau
        if self._steps % self._every_encoder:
            return
        states = self._world.bullet.getJointStates(self._body, DRIVES, physicsClientId=self._world.client)
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
        points = self._world.bullet.getContactPoints(
            bodyA=self._body, linkIndexA=-1, physicsClientId=self._world.client
        )
        names = self._room_bodies.names
        # What lies on top has no name in the room.
        touched = sorted({names[point[2]] for point in points if point[8] <= 0.0 and point[2] in names})
        # One that's touched on counts as the same collision.
        self._touch(self._touches if self._touches in touched else touched[0] if touched else "")

    def _pose(self) -> tuple[Array, Array]:
        """Where the robot's frame is, (3,), and how it's turned, (3, 3)."""
        bullet = self._world.bullet
        position, turn = bullet.getBasePositionAndOrientation(self._body, physicsClientId=self._world.client)
        R = np.array(bullet.getMatrixFromQuaternion(turn)).reshape(3, 3) @ self._R_CR
        return np.array(position) - R @ self._centre, R

    def _put_back(self, start: tuple[float, float, float]) -> None:
        """Shift what settling moved, so that the robot begins at its start; wheels count from there."""
        self._move(start)
        for j in DRIVES:
            self._world.bullet.resetJointState(self._body, j, 0.0, physicsClientId=self._world.client)
        self._target_right = self._target_left = 0.0

    def _move(self, start: tuple[float, float, float]) -> None:
        """Turn the robot about the vertical and shift it, so that it stands at a posture."""
        (x, y, _), R = self._pose()
        bullet, client = self._world.bullet, self._world.client
        position, turn = bullet.getBasePositionAndOrientation(self._body, physicsClientId=client)
        # A turn about the vertical through the robot's own reference point, then a shift.
        angle = math.remainder(start[2] - math.atan2(R[1, 0], R[0, 0]), math.tau)
        c, s = math.cos(angle), math.sin(angle)
        dx, dy = position[0] - x, position[1] - y
        place = [start[0] + c * dx - s * dy, start[1] + s * dx + c * dy, position[2]]
        upright = [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
        _, turned = bullet.multiplyTransforms([0.0] * 3, upright, [0.0] * 3, turn)
        bullet.resetBasePositionAndOrientation(self._body, place, turned, physicsClientId=client)

    def _shafts(self) -> tuple[float, float]:
        return self._angles

    def _put(self, posture: tuple[float, float, float]) -> None:
        # With it PyBullet takes the base's speed away.
        self._move(posture)
        self._truth = posture

    def _distances(self, origins: Array, directions: Array, reach: float, height: float) -> Array:
        return self._room_bodies.cast(origins, directions, height, reach)
