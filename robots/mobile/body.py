"""The real mobile robots as simulated bodies, in any world of physics: the IPR, the micro-robot, and their like.

A chassis is a vehicle there: a box, two driven wheels, casters. Casters with a trail are a swivelling fork and a
wheel; without, a ball that slides. What slips, lags and is measured is the same in all worlds.

Cargo lies on a robot and is held by friction alone: a book that somebody puts there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from robots.base import PERIOD
from robots.bullet.world import LostError, WorldClosedError
from robots.chain import Inertia, together
from robots.mobile.chassis import Chassis, MobileReality, Senses
from robots.mobile.robot import BareBody, MobileRobot
from robots.robot import BARE
from robots.rooms import Room
from robots.simulated import USUAL_WORLD, WORLDS
from robots.vehicle import Cargo, RigidVehicle, Vehicle, VehiclePart, Wheel
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits
from vrs.model import Array

_BALL_FRICTION = 0.02
_BEHIND = 0.2
"""By how much a shaft's reference may run ahead of a wheel that can't follow [rad]."""
_LOOKS = 60.0
"""How often people go on and touches are looked for [Hz]."""
_SETTLING = 0.5
"""How long the robot stands before its time begins, so that its contacts bear its weight [s]."""
_FREE_TORQUE = 1e6
_UPRIGHT = 0.7
"""Cosine of the tilt beyond which a robot has fallen."""


def _disc(mass: float, radius: float, width: float, rotor: float = 0.0) -> list[float]:
    """Principal inertias of a wheel that turns about y, with what a rotor adds to its spin [kg m²]."""
    across = mass * (3 * radius * radius + width * width) / 12
    return [across, mass * radius * radius / 2 + rotor, across]


def vehicle_of(chassis: Chassis, reality: MobileReality, radii: tuple[float, float], base: float) -> Vehicle:
    """Return a chassis as a vehicle.

    Args:
        chassis: Of what it's made.
        reality: Friction, payload, the casters' resistance, whether torques are limited.
        radii: True radii of the right and the left wheel [m].
        base: True wheel base [m].
    """
    load = reality.payload
    loads = () if load is None else (Inertia(load.mass, load.centre, load.inertia),)
    height = chassis.height - chassis.ground_clearance
    return Vehicle(
        together((Inertia(*chassis.rigid()), *loads)),
        (chassis.length, chassis.width, height),
        (chassis.centre_x, 0.0, chassis.ground_clearance + height / 2),
        tuple(_wheels(chassis, reality, radii, base)),
        tuple(
            # Held by its servo until somebody moves it.
            VehiclePart(limb.mass, 0.0, limb.joint, 0, limb.axis, limb.inertia(), 0.0, limb.torque, limb.centre)
            for limb in chassis.limbs
        ),
        chassis.torque if reality.torque_limits else _FREE_TORQUE,
    )


def _wheels(chassis: Chassis, reality: MobileReality, radii: tuple[float, float], base: float) -> list[VehiclePart]:
    rotor = chassis.gear**2 * chassis.rotor
    parts = [
        VehiclePart(
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
            parts.append(VehiclePart(chassis.caster_mass, r, place, 0, None, sphere, _BALL_FRICTION, 0.0))
            continue
        fork = [half * r * r] * 3
        parts.append(VehiclePart(half, 0.0, (x, y, 2 * r), 0, (0.0, 0.0, 1.0), fork, 0.0, resistance))
        place = (-trail, 0.0, chassis.caster_lift - r)
        axle = (0.0, 1.0, 0.0)
        parts.append(VehiclePart(half, r, place, len(parts), axle, _disc(half, r, r), reality.friction, resistance))
    return parts


def bodies_of(chassis: Chassis, **given: Any) -> dict[str, Callable[..., MobileRobot]]:
    """Return what can be real of a robot, by name: its body in each world of physics, and the bare one.

    Args:
        chassis: What it is.
        **given: What else both bodies take, as limits.
    """
    simulated = {world: partial(MobileBody, chassis, world=world, **given) for world in WORLDS}
    return {**simulated, BARE: partial(BareBody, chassis, **given)}


class MobileBody(MobileRobot):
    """A robot with mass, tyres and casters in a world of its own; use it as a context manager."""

    _STEP = 1 / 240

    def __init__(
        self,
        chassis: Chassis,
        posture: ArrayLike | None = None,
        *,
        world: str = USUAL_WORLD,
        room: Room | str | None = None,
        reality: MobileReality | None = None,
        rng: np.random.Generator | int = 0,
        limits: DriveLimits | None = None,
        senses: Senses | None = None,
        period: float = PERIOD,
        since: float = 0.0,
    ) -> None:
        """Put a robot into a room, at rest; the other arguments and errors are those of `MobileRobot`.

        Args:
            chassis: What it is.
            posture: Where.
            world: One of `robots.simulated.WORLDS`.
            room: Of the robot.
            reality: How real it is.
            rng: What slips and noise are drawn from, or a seed.
            limits: What commands must keep to.
            senses: What it senses with.
            period: What `follow` goes on by [s].
            since: Time in the room when it's put there [s].

        Raises:
            InvalidValueError: If the world isn't installed, too.
            LostError: If it falls over where it stands.
        """
        self._make = WORLDS[world].vehicle
        self._vehicle: RigidVehicle | None = None
        super().__init__(
            chassis, posture, room=room, reality=reality, rng=rng, limits=limits, senses=senses, period=period,
            since=since,
        )  # fmt: skip

    def _begin(self) -> None:
        reality, start, train = self.reality, self.truth, self._train
        vehicle = vehicle_of(self.chassis, reality, train.radii, train.base)
        self._vehicle = self._make(vehicle, self.room, start, gravity=reality.gravity, dt=reality.dt)
        self._target_right = self._target_left = 0.0
        self._tyres = (0.0, 0.0)
        self._angles = (0.0, 0.0)
        self._every_look = self._every(_LOOKS)
        for _ in range(round(_SETTLING / reality.dt)):
            self._turn(0.0, 0.0)
        # Back from where settling moved it; wheels count from there.
        self.vehicle.place(start)
        self.vehicle.rewind()
        self._target_right = self._target_left = 0.0
        try:
            self._observe()
        except LostError:
            self.close()
            raise

    @property
    def vehicle(self) -> RigidVehicle:
        """Its parts in their world.

        Raises:
            WorldClosedError: If the robot is closed.
        """
        if self._vehicle is None:
            raise WorldClosedError
        return self._vehicle

    @property
    def motion(self) -> tuple[float, float]:
        """True speed v of the middle of the axle, forward [m/s], and ω [rad/s]."""
        velocity, angular = self.vehicle.velocity()
        return float(velocity @ self.vehicle.pose()[1][:, 0]), float(angular[2])

    @property
    def tilt(self) -> float:
        """Angle between the robot's axis and the vertical [rad]."""
        return math.acos(min(1.0, float(self.vehicle.pose()[1][2, 2])))

    @property
    def wheels(self) -> tuple[Wheel, Wheel]:
        """What the right and the left wheel do."""
        return self.vehicle.drives()

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
        at, R = self.vehicle.pose()
        top = at + R @ np.array([x, y, chassis.height])
        self.vehicle.load(cargo, (float(top[0]), float(top[1]), float(top[2])), self.truth[2])

    @property
    def cargo(self) -> tuple[tuple[float, float, float], ...]:
        """Where the middle of each thing that was put on top is now, in the robot's frame, x, y, z [m]."""
        at, R = self.vehicle.pose()
        places = (R.T @ (place - at) for place in self.vehicle.cargo())
        return tuple((float(x), float(y), float(z)) for x, y, z in places)

    @override
    def close(self) -> None:
        if self._vehicle is not None:
            self._vehicle.close()
            self._vehicle = None

    def _ready(self) -> None:
        _ = self.vehicle

    def _advance(self, n: int) -> None:
        train, vehicle = self._train, self.vehicle
        changing = vehicle.changing
        slip_right, slip_left = train.slips
        keep_right, keep_left = 1 - slip_right, 1 - slip_left
        for _ in range(n):
            right, left = train.step()
            self._turn(right * keep_right, left * keep_left)
            self._steps += 1
            if self._steps % self._every_look == 0:
                self._look()
                if changing:
                    vehicle.at(self.time)
        self._observe()

    def _turn(self, right: float, left: float) -> None:
        """Step once with the tyres' wanted speeds [rad/s]."""
        self.vehicle.step((self._target_right, self._target_left), (right, left))
        dt = self.reality.dt
        self._target_right += right * dt
        self._target_left += left * dt

    def _observe(self) -> None:
        """Read the truth; and, where the encoders are due, the shafts' angles at the slips that held."""
        (x, y, _), R = self.vehicle.pose()
        if not math.isfinite(x + y):
            raise LostError("robot", self.time, "diverged")
        if R[2, 2] < _UPRIGHT:
            raise LostError("robot", self.time, "fell over")
        heading = math.atan2(R[1, 0], R[0, 0])
        turns = round((self.truth[2] - heading) / math.tau)
        self.truth = float(x), float(y), heading + turns * math.tau
        if self._steps % self._every_encoder:
            return
        right, left = self.vehicle.angles()
        slip_right, slip_left = self._train.slips
        self._angles = (
            self._angles[0] + (right - self._tyres[0]) / (1 - slip_right),
            self._angles[1] + (left - self._tyres[1]) / (1 - slip_left),
        )
        self._tyres = right, left
        self._target_right = min(max(self._target_right, right - _BEHIND), right + _BEHIND)
        self._target_left = min(max(self._target_left, left - _BEHIND), left + _BEHIND)

    def _look(self) -> None:
        """Note what the chassis touches; one that's touched on counts as the same collision."""
        touched = self.vehicle.touched()
        self._touch(self.touching if self.touching in touched else min(touched, default=""))

    @override
    def shafts(self) -> tuple[float, float]:
        return self._angles

    def _put(self, posture: tuple[float, float, float]) -> None:
        self.vehicle.place(posture)
        self.truth = posture

    @override
    def distances(self, origins: Array, directions: Array, reach: float, height: float) -> Array:
        return self.vehicle.cast(origins, directions, height, reach)
