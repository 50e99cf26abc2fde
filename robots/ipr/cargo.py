"""What lies on a robot in PyBullet and is held by friction alone: a book that somebody puts there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robots.bullet.world import World
from vrs.checks import finite, number_in
from vrs.model import Array

_GAP = 0.002
"""It's let go so high above the robot [m]."""


@dataclass(frozen=True, slots=True)
class Cargo:
    """A box that can be put on a robot."""

    name: str = "book"
    length: float = 0.24
    """[m], in [0.01, 2]."""
    width: float = 0.17
    """[m], in [0.01, 2]."""
    height: float = 0.03
    """[m], in [0.005, 2]."""
    mass: float = 0.9
    """[kg], in [0.01, 100]."""
    friction: float = 0.5
    """Of its sides, in [0, 2]; the robot's top has 0.5, and PyBullet takes the product of both."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("length", 0.01, 2.0), ("width", 0.01, 2.0), ("height", 0.005, 2.0), ("mass", 0.01, 100.0),
            ("friction", 0.0, 2.0),
        ):  # fmt: skip
            number_in(name, getattr(self, name), low, high)


class CargoBody:
    """A piece of cargo in a world: it meets the robot that it was put on, and the floor."""

    def __init__(
        self, world: World, cargo: Cargo, robot: int, floor: int, place: tuple[float, float, float, float]
    ) -> None:
        """Let it go just above the robot's top.

        Args:
            world: Where.
            cargo: What.
            robot: PyBullet's id of the robot.
            floor: And of the floor.
            place: Of its middle on the robot's top, x, y, z [m] and heading [rad], in the world.
        """
        self.cargo = cargo
        self._world = world
        bullet, client = world.bullet, world.client
        half = [cargo.length / 2, cargo.width / 2, cargo.height / 2]
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
        x, y, z, angle = (finite("place", value) for value in place)
        turn = [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
        self.body = int(
            bullet.createMultiBody(cargo.mass, shape, -1, [x, y, z + half[2] + _GAP], turn, physicsClientId=client)
        )
        """PyBullet's id."""
        bullet.changeDynamics(self.body, -1, lateralFriction=cargo.friction, physicsClientId=client)
        bullet.setCollisionFilterGroupMask(self.body, -1, 0, 0, physicsClientId=client)
        for other in (robot, floor):
            bullet.setCollisionFilterPair(self.body, other, -1, -1, 1, physicsClientId=client)

    def pose(self) -> tuple[Array, Array]:
        """Where its middle is [m], (3,), and how it's turned, (3, 3), in the world."""
        bullet, client = self._world.bullet, self._world.client
        position, turn = bullet.getBasePositionAndOrientation(self.body, physicsClientId=client)
        return np.array(position), np.array(bullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
