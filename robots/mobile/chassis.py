"""What a mobile robot's body is made of, how it senses, and how real its simulation is.

The robot's frame stands on the floor in the middle of the driving axle, x forward, y left, z up.

The robot's centre C is D ahead of the middle M of its driving axle, eq. (2). Everything else here counts from M.
Eq. (1) is `vrs.mobile.speeds`.

How real a simulation is is `MobileReality`.

Source: Kim, Han, Kim, Kim 2002, section 2.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from robots.base import Footprint
from robots.onboard.driving import drive_limits
from robots.onboard.laser import LaserModel
from robots.simulated import Payload
from vrs.checks import number_in, validated, within
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits
from vrs.model import Array, frozen_array


def centre_rates(theta: float, D: float) -> Array:
    """What speeds (v, ω) of M make of C's posture: (x, y, θ)' = this times (v, ω), (3, 2).

    Args:
        theta: Heading [rad].
        D: How far C is ahead of M [m].

    Source: eq. (2).
    """
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -D * s], [s, D * c], [0.0, 1.0]])


def centre_of(posture: tuple[float, float, float], D: float) -> tuple[float, float, float]:
    """The posture of C where M is at a posture (x, y, θ) [m, m, rad]; with −D the other way round."""
    x, y, theta = posture
    return x + D * math.cos(theta), y + D * math.sin(theta), theta


Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Lump:
    """A homogeneous box, one of those that make up a chassis."""

    name: str
    size: Point
    """Lengths along x, y, z [m]."""
    centre: Point
    """In the robot's frame [m]."""
    mass: float
    """[kg]."""

    def inertia(self) -> Array:
        """Inertia about the lump's own centre [kg m²], (3, 3)."""
        x, y, z = (s * s for s in self.size)
        return np.diag((y + z, x + z, x + y)) * self.mass / 12


@dataclass(frozen=True, slots=True)
class Limb:
    """A homogeneous box on a revolute joint of the chassis, with a servo: an arm, a head that tilts."""

    name: str
    joint: Point
    """Where its axis is, in the robot's frame [m]."""
    axis: Point
    """Of the joint, a unit vector in the robot's frame."""
    size: Point
    """Lengths along x, y, z at angle 0 [m]."""
    centre: Point
    """Of the box, from the joint at angle 0 [m]."""
    mass: float
    """[kg]."""
    low: float
    """Least angle [rad]."""
    high: float
    """Greatest angle [rad]."""
    speed: float
    """Of its servo at most [rad/s]."""
    torque: float
    """Of its servo at most [N m]."""

    def inertia(self) -> list[float]:
        """Principal inertias about the box's centre [kg m²]."""
        x, y, z = (s * s for s in self.size)
        return [self.mass * sums / 12 for sums in (y + z, x + z, x + y)]


@dataclass(frozen=True, slots=True)
class Chassis:
    """One robot's body; lengths [m], masses [kg]."""

    kind: str
    """`ipr` or `micro`, or what somebody calls a chassis of his own."""
    length: float
    """Along x."""
    width: float
    """Along y."""
    height: float
    centre_x: float
    """Where the middle of the outer box is before the driving axle."""
    ground_clearance: float
    lumps: tuple[Lump, ...]
    """All but wheels and casters."""
    wheel_radius: float
    wheel_base: float
    """L, between the middles of the driven wheels."""
    wheel_width: float
    wheel_mass: float
    casters: tuple[tuple[float, float], ...]
    """Where the casters' swivel axes meet the floor, (x, y)."""
    caster_radius: float
    caster_trail: float
    """How far the wheel's middle is behind the swivel axis; 0 is a ball that turns any way."""
    caster_mass: float
    """Of wheel and fork together."""
    caster_lift: float
    """How far casters end above the floor that the driven wheels stand on."""
    caster_rolling: float
    """Torque that a rolling or swivelling caster takes [N m]."""
    torque: float
    """Largest torque of one drive at the wheel [N m]."""
    gear: float
    """Motor turns a wheel turn."""
    rotor: float
    """Inertia of one motor's rotor, at the motor [kg m²]; at the wheel it counts gear² times."""
    encoder_counts: int
    """Counts a motor turn, four edges a line."""
    servo_time: float
    """Time constant of the closed speed loop [s]."""
    sonars: int
    """How many, evenly around the body."""
    sonar_height: float
    sonar_reach: tuple[float, float] = (0.1, 3.0)
    """Nearest and farthest distance that a sonar tells [m]."""
    limbs: tuple[Limb, ...] = ()
    """What turns on it, beside wheels and casters; their joints come after those."""

    @property
    def mass(self) -> float:
        """All of it [kg]."""
        moving = 2 * self.wheel_mass + len(self.casters) * self.caster_mass + sum(limb.mass for limb in self.limbs)
        return sum(lump.mass for lump in self.lumps) + moving

    @property
    def footprint(self) -> Footprint:
        """The box that it fills."""
        return Footprint(self.length, self.width, self.height, self.mass, -self.centre_x)

    @property
    def reach(self) -> float:
        """Radius of the circle about the box's middle that the body stays within [m]."""
        return math.hypot(self.length, self.width) / 2

    @property
    def limits(self) -> DriveLimits:
        """How fast the body lets itself be driven."""
        return drive_limits(self.wheel_base)

    def rigid(self) -> tuple[float, Array, Array]:
        """Return mass [kg], centre (3,) [m] and inertia about it (3, 3) [kg m²] of all lumps together."""
        mass = sum(lump.mass for lump in self.lumps)
        centre = sum((lump.mass * np.array(lump.centre) for lump in self.lumps), np.zeros(3)) / mass
        inertia = np.zeros((3, 3))
        for lump in self.lumps:
            arm = np.array(lump.centre) - centre
            inertia += lump.inertia() + lump.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return mass, frozen_array(centre), frozen_array(inertia)


@dataclass(frozen=True, slots=True)
@validated
class SonarModel:
    """How the sonars see. A Polaroid sensor's cone, thinned to a few rays."""

    rate: Annotated[float, within(0.1, 100.0)] = 10.0
    """Scans a second [Hz], in [0.1, 100]."""
    rays: Annotated[int, within(1, 31)] = 5
    """Rays a cone, in [1, 31]."""
    half_angle: Annotated[float, within(0.0, 0.8)] = math.radians(12.5)
    """Half the cone's opening [rad], in [0, 0.8]."""
    noise: Annotated[float, within(0.0, 1.0)] = 0.005
    """Standard deviation of every range [m], in [0, 1]."""
    noise_share: Annotated[float, within(0.0, 0.2)] = 0.005
    """Standard deviation that grows with the range, as a share of it, in [0, 0.2]."""
    misses: Annotated[float, within(0.0, 1.0)] = 0.01
    """Probability that an echo is lost, in [0, 1]."""


@dataclass(frozen=True, slots=True)
@validated
class CameraModel:
    """The overhead camera of section 4.2. Source: NTSC frames; noise and latency chosen."""

    rate: Annotated[float, within(0.1, 240.0)] = 30.0
    """Frames a second [Hz], in [0.1, 240]."""
    latency: Annotated[float, within(0.0, 2.0)] = 0.08
    """From the picture to the posture [s], in [0, 2]."""
    noise: Annotated[float, within(0.0, 1.0)] = 0.003
    """Standard deviation of x and of y [m], in [0, 1]."""
    noise_angle: Annotated[float, within(0.0, 1.0)] = math.radians(0.5)
    """Standard deviation of the heading [rad], in [0, 1]."""


@dataclass(frozen=True, slots=True)
@validated
class Senses:
    """All that a body senses with."""

    sonar: SonarModel | None = field(default_factory=SonarModel)
    """None switches the sonars off."""
    camera: CameraModel | None = field(default_factory=CameraModel)
    """None switches the camera off."""
    laser: LaserModel | None = None
    """None, which it is unless given, is a robot without a laser scanner."""
    encoder_rate: Annotated[float, within(1.0, 240.0)] = 20.0
    """How often encoders are read [Hz], in [1, 240]."""


Pair = tuple[float, float]
"""Of the right and of the left wheel."""


@dataclass(frozen=True, slots=True)
@validated
class MobileReality:
    """What the simulated robot has of a real one. The default is all of it; `MobileReality.ideal()` none.

    Natural slip hardly exists in PyBullet between friction 0.3 and 0.1, so slip is said here.
    """

    slip: Pair = (0.004, 0.006)
    """Share of the way that each wheel loses against the floor, right and left, in [-0.5, 0.5]."""
    slip_spread: Annotated[float, within(0.0, 0.2)] = 0.004
    """Standard deviation of what each slip wanders by, in [0, 0.2]."""
    slip_time: Annotated[float, within(0.01, 1000.0)] = 1.0
    """Correlation time of the wandering [s], in [0.01, 1000]."""
    radius_error: Pair = (0.002, -0.001)
    """By how much the wheels' radii, right and left, are greater than nominal, as shares, in [-0.2, 0.2]."""
    base_error: Annotated[float, within(-0.2, 0.2)] = 0.005
    """By how much the wheel base is greater than nominal, as a share, in [-0.2, 0.2]."""
    friction: Annotated[float, within(0.02, 2.0)] = 0.7
    """Coulomb friction between tyres and floor, in [0.02, 2]."""
    rolling: Annotated[float, within(0.0, 20.0)] = 1.0
    """Resistance of the casters as a multiple of the nominal, in [0, 20]."""
    servo_lag: bool = True
    """Whether wheels follow with their servos' time constant."""
    ramps: bool = True
    """Whether speeds change within a_max and the turning acceleration; without, they jump."""
    torque_limits: bool = True
    """Whether the drives' torques end at their limits."""
    encoder_counts: int | None = -1
    """Counts a motor turn, 1 to 10,000,000; -1 takes the chassis's, None reads angles exactly."""
    encoder_noise: Annotated[float, within(0.0, 1000.0)] = 0.5
    """Standard deviation of a reading [counts], in [0, 1000]."""
    payload: Payload | None = None
    """What the robot carries; its centre counts in the robot's frame, and nobody tells the servos."""
    gravity: Annotated[float, within(0.1, 100.0)] = 9.81
    """Acceleration of free fall [m/s²], in [0.1, 100]."""
    dt: Annotated[float, within(0.0001, 0.02)] = 1 / 240
    """Step of physics and servos [s], in [1e-4, 0.02]."""

    def __post_init__(self) -> None:
        for name, most in (("slip", 0.5), ("radius_error", 0.2)):
            object.__setattr__(self, name, _pair(name, getattr(self, name), most))
        counts = self.encoder_counts
        if counts is not None and (
            isinstance(counts, bool)
            or not isinstance(counts, int)
            or not (counts == -1 or 1 <= counts <= 10_000_000)
        ):
            raise InvalidValueError("encoder_counts", counts, "None, -1 or an integer in [1, 10000000]")
        if self.payload is not None and not isinstance(self.payload, Payload):
            raise InvalidValueError("payload", self.payload, "a Payload or None")

    @classmethod
    def ideal(cls, *, dt: float = 1 / 240) -> MobileReality:
        """Wheels that are as they should be, roll and turn at once as told: the virtual robot's model."""
        return cls(
            slip=(0.0, 0.0),
            slip_spread=0.0,
            radius_error=(0.0, 0.0),
            base_error=0.0,
            rolling=0.0,
            servo_lag=False,
            ramps=False,
            torque_limits=False,
            encoder_counts=None,
            encoder_noise=0.0,
            dt=dt,
        )

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> MobileReality:
        """Return a robot of its own from a workshop, for runs over many robots.

        Radii within 0.3 %, the base within 1 % and mean slips of 0.5 % ± 0.3 % (standard deviations, cut off at
        three): what Borenstein and Feng 1996 report of robots that nobody calibrated is of this size.
        """
        right, left, base, slip_right, slip_left = np.clip(rng.standard_normal(5), -3.0, 3.0).tolist()
        return cls(
            radius_error=(0.003 * right, 0.003 * left),
            base_error=0.01 * base,
            slip=(0.005 + 0.003 * slip_right, 0.005 + 0.003 * slip_left),
        )


def _pair(name: str, value: object, most: float) -> Pair:
    allowed = f"two numbers, right and left, in [{-most:g}, {most:g}]"
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise InvalidValueError(name, value, allowed)
    return number_in(name, value[0], -most, most), number_in(name, value[1], -most, most)
