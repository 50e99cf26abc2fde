"""A PyBullet world of its own: one client in DIRECT mode, closed when its context ends.

In it a room's bodies: floor, things, people who walk.
"""

from __future__ import annotations

import math
import os
import sys
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
from typing_extensions import override

from robots.robot import Closing
from robots.rooms import Block, Room, Standing, moves, pose_at, solid
from robots.vehicle import FLOOR_FRICTION, THING_FRICTION
from vrs.errors import InvalidValueError, VrsError
from vrs.model import Array


class WorldClosedError(VrsError):
    """A world of physics used after it was closed."""

    def __init__(self) -> None:
        super().__init__("this world of physics is closed: make a new one")


class LostError(VrsError):
    """A simulated robot whose state left every sensible range, or that fell over; it's of no more use."""

    def __init__(self, what: str, time: float, problem: str, cause: str = "") -> None:
        self.time, self.problem = time, problem
        super().__init__(f"the simulated {what} {problem} at {time:.3f} s{cause}")


def load_pybullet() -> Any:
    """Import PyBullet without the build date that its C++ part writes to descriptor 2."""
    if isinstance(loaded := sys.modules.get("pybullet"), ModuleType):
        return loaded
    sys.stderr.flush()
    saved = os.dup(2)
    try:
        with open(os.devnull, "wb") as sink:
            os.dup2(sink.fileno(), 2)
        import pybullet
    except ImportError:
        raise InvalidValueError("body", "bullet", "with PyBullet installed: pip install pybullet") from None
    finally:
        os.dup2(saved, 2)
        os.close(saved)
    return pybullet


class BulletClient:
    """PyBullet's functions and constants, each function of one world alone."""

    def __init__(self, number: int) -> None:
        """Take PyBullet's id of the world."""
        self._number = number

    def __getattr__(self, name: str) -> Any:
        found = getattr(load_pybullet(), name)
        if callable(found):
            found = partial(found, physicsClientId=self._number)
        setattr(self, name, found)
        return found


class World(Closing):
    """A PyBullet client, empty but for gravity and a time step. Several live side by side in a process."""

    def __init__(self, *, gravity: float, dt: float) -> None:
        """Connect a client with free fall along -z [m/s²] and a fixed step [s]."""
        bullet = load_pybullet()
        self._gravity, self._dt = gravity, dt
        self._client: BulletClient | None = BulletClient(bullet.connect(bullet.DIRECT))
        self.clear()

    @property
    def bullet(self) -> BulletClient:
        """PyBullet, as of this world.

        Raises:
            WorldClosedError: If it is closed.
        """
        if self._client is None:
            raise WorldClosedError
        return self._client

    @property
    def closed(self) -> bool:
        """Whether the client is disconnected."""
        return self._client is None

    def clear(self) -> None:
        """Remove every body, and with them PyBullet's cached trees, which never see a changed mass."""
        self.bullet.resetSimulation()
        self.bullet.setGravity(0.0, 0.0, -self._gravity)
        self.bullet.setTimeStep(self._dt)

    @override
    def close(self) -> None:
        if self._client is not None:
            self._client.disconnect()
            self._client = None


RAY, THING, CHASSIS, WHEEL, FLOOR = 1, 2, 4, 8, 16
"""Collision groups: wheels meet the floor, chassis and rays meet things. PyBullet's rays are of group 1."""


class RoomBodies:
    """Bodies of a room's things; `at` brings them to where they are at a time."""

    def __init__(self, world: World, room: Room) -> None:
        """Put a floor and the things of a room into a world, as they stand at time 0."""
        self._world = world
        bullet = world.bullet
        shape = bullet.createCollisionShape(bullet.GEOM_PLANE)
        self.floor = floor = int(bullet.createMultiBody(0.0, shape))
        """PyBullet's id of the floor."""
        bullet.changeDynamics(floor, -1, lateralFriction=FLOOR_FRICTION)
        bullet.setCollisionFilterGroupMask(floor, -1, FLOOR, WHEEL)
        self.names: dict[int, str] = {}
        """Names of things by PyBullet's body ids."""
        self._moving: list[tuple[int, Standing]] = []
        self._poses: dict[int, tuple[float, float, float, float]] = {}
        for thing in room.standing:
            body = self._stand(thing)
            self.names[body] = thing.name
            if moves(thing):
                self._moving.append((body, thing))

    @property
    def changing(self) -> bool:
        """Whether anything ever moves, comes or goes."""
        return bool(self._moving)

    def at(self, t: float) -> None:
        """Bring everything to where it is at a time [s]."""
        for body, thing in self._moving:
            pose = pose_at(thing, t)
            if pose != self._poses[body]:
                self._poses[body] = pose
                self._world.bullet.resetBasePositionAndOrientation(body, *_transform(pose))

    def cast(self, origins: Array, directions: Array, height: float, reach: float) -> Array:
        """Return how far level rays go, as `FloorPlan.cast` does, but nothing from inside of a thing.

        Args:
            origins: Where they begin [m], (k, 2).
            directions: Unit vectors, (k, 2).
            height: Above the floor [m].
            reach: Longest that counts [m].
        """
        level = np.full((len(origins), 1), height)
        hits = self._world.bullet.rayTestBatch(
            np.hstack([origins, level]).tolist(),
            np.hstack([origins + reach * directions, level]).tolist(),
            numThreads=1,
            collisionFilterMask=THING,
        )
        return np.array([hit[2] * reach if hit[0] >= 0 else math.inf for hit in hits])

    def _stand(self, thing: Standing) -> int:
        bullet, block, pose = self._world.bullet, solid(thing), pose_at(thing, 0.0)
        if isinstance(block, Block):
            half = [block.length / 2, block.width / 2, block.height / 2]
            shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half)
        else:
            shape = bullet.createCollisionShape(bullet.GEOM_CYLINDER, radius=block.radius, height=block.height)
        body = int(bullet.createMultiBody(0.0, shape, -1, *_transform(pose)))
        bullet.changeDynamics(body, -1, lateralFriction=THING_FRICTION)
        bullet.setCollisionFilterGroupMask(body, -1, THING, CHASSIS | RAY)
        self._poses[body] = pose
        return body


def _transform(pose: tuple[float, float, float, float]) -> tuple[list[float], list[float]]:
    """A place [m], and a turn about the vertical as a quaternion."""
    x, y, z, angle = pose
    return [x, y, z], [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
