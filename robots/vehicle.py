"""A box on wheels as rigid parts, and what a world of physics does for one; the same for every world.

The vehicle's frame stands on the floor in the middle of the driving axle, x forward, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, NamedTuple, Protocol

from robots.chain import Inertia
from vrs.checks import validated, within
from vrs.model import Array

Point = tuple[float, float, float]
Pair = tuple[float, float]
"""Of the right and of the left wheel."""
Posture = tuple[float, float, float]
"""x, y [m], heading [rad]."""
HOLD_TIME: Final = 0.03
"""How fast wheels' servos make up for the angle that a load took from them [s]; the LM629 regulates angles, too."""
LIMB_GAIN: Final = 0.2
"""Share of the way to its angle that a limb's servo goes in a step."""
BODY_FRICTION: Final = 0.3
"""Of the box; two things that touch have the product of their coefficients."""
FLOOR_FRICTION, THING_FRICTION = 1.0, 0.5
"""Of the floor, and of what stands on it."""


@dataclass(frozen=True, slots=True)
class VehiclePart:
    """A wheel, a ball, a caster's fork or a limb, on a joint."""

    mass: float
    """[kg]."""
    radius: float
    """Of the sphere with which it touches the floor [m]; 0 for none."""
    position: Point
    """Of its joint in its parent's frame, where all joints are at 0 [m]."""
    parent: int
    """0 is the box, 1 the first part."""
    axis: Point | None
    """Of its joint; None if it's fixed."""
    inertia: list[float]
    """Principal inertias, along its frame's axes [kg m²]."""
    friction: float
    """Coulomb friction of its sphere."""
    resistance: float
    """Coulomb friction of its joint; of a limb, the most that its servo holds it with [N m]."""
    centre: Point = (0.0, 0.0, 0.0)
    """Centre of mass, from the joint [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Vehicle:
    """A box with all that's fixed to it, on wheels."""

    rigid: Inertia
    """Of the box, in the vehicle's frame."""
    size: Point
    """Of the box that touches things, along x, y and z [m]."""
    middle: Point
    """Of that box [m]."""
    wheels: tuple[VehiclePart, ...]
    """The driven ones first, right and left; then casters."""
    limbs: tuple[VehiclePart, ...]
    """What its servos turn; without friction, and nothing touches them."""
    torque: float
    """Largest torque of one drive at its wheel [N m]."""

    @property
    def parts(self) -> tuple[VehiclePart, ...]:
        """Wheels, then limbs."""
        return *self.wheels, *self.limbs


DRIVES: Final = (0, 1)
"""The driven ones of a vehicle's parts, right and left."""


class Wheel(NamedTuple):
    """What a driven wheel does."""

    speed: float
    """Of the tyre [rad/s]."""
    torque: float
    """Of the drive in the last step [N m]."""
    load: float
    """Weight that the floor bears under it [N]."""


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
    """Of its sides, in [0, 2]; times the robot's, `BODY_FRICTION`, where it lies on that."""


GAP: Final = 0.002
"""Cargo is let go so high above the robot [m]."""


class RigidVehicle(Protocol):
    """A vehicle in a room, in a world of physics: servos that turn its wheels and limbs, and nothing else."""

    def step(self, angles: Pair, speeds: Pair) -> None:
        """Go on by a step: the servos turn the wheels at speeds [rad/s], and make up for what angles [rad] lack."""

    def pose(self) -> tuple[Array, Array]:
        """Where the vehicle's frame is [m], (3,), and how it's turned, (3, 3)."""

    def velocity(self) -> tuple[Array, Array]:
        """Velocity of the frame's origin [m/s], and angular velocity [rad/s], (3,) each, in the world's frame."""

    def angles(self) -> Pair:
        """What the driven wheels have turned by since `rewind` [rad]."""

    def drives(self) -> tuple[Wheel, Wheel]:
        """What the right and the left wheel do."""

    def place(self, posture: Posture) -> None:
        """Turn the vehicle about the vertical and shift it to a posture, where it's at rest."""

    def rewind(self) -> None:
        """Take the driven wheels' angles for 0."""

    @property
    def changing(self) -> bool:
        """Whether anything in the room ever moves, comes or goes."""

    def at(self, t: float) -> None:
        """Bring everything in the room to where it is at a time [s]."""

    def touched(self) -> set[str]:
        """What the box touches, by its names in the room."""

    def cast(self, origins: Array, directions: Array, height: float, reach: float) -> Array:
        """How far level rays go to what's in the room [m], (k,), inf where nothing is within reach.

        Args:
            origins: Where they begin [m], (k, 2); nothing is met from inside of it.
            directions: Unit vectors, (k, 2).
            height: Above the floor [m].
            reach: Longest that counts [m].
        """

    def load(self, cargo: Cargo, at: Point, heading: float) -> None:
        """Let a piece of cargo go above a place on the box's top [m], turned by a heading [rad].

        Only the box and the floor touch it.
        """

    def cargo(self) -> list[Array]:
        """Where the middle of each piece is [m], (3,)."""

    def swing(self, limb: int, angle: float, speed: float) -> None:
        """Let a limb's servo go to an angle [rad], at most at a speed [rad/s], from now on."""

    def limbs(self) -> tuple[float, ...]:
        """Angles of the limbs [rad]."""

    def close(self) -> None:
        """Give back what it holds."""
