"""A room in a PyBullet world: floor, things, people who walk."""

from __future__ import annotations

import math

import numpy as np

from robots.bullet.rooms import Block, Column, Room
from robots.bullet.world import World
from vrs.model import Array

RAY, THING, CHASSIS, WHEEL, FLOOR = 1, 2, 4, 8, 16
"""Collision groups: wheels meet the floor, chassis and rays meet things. PyBullet's rays are of group 1."""
_AWAY = -100.0


class RoomBodies:
    """Bodies of a room's things; `at` brings them to where they are at a time."""

    def __init__(self, world: World, room: Room) -> None:
        """Put a floor and the things of a room into a world, as they stand at time 0."""
        self._world = world
        bullet, client = world.bullet, world.client
        shape = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
        self.floor = floor = int(bullet.createMultiBody(0.0, shape, physicsClientId=client))
        """PyBullet's id of the floor."""
        bullet.changeDynamics(floor, -1, lateralFriction=1.0, physicsClientId=client)
        bullet.setCollisionFilterGroupMask(floor, -1, FLOOR, WHEEL, physicsClientId=client)
        self.names: dict[int, str] = {}
        """Names of things by PyBullet's body ids."""
        self._coming: list[tuple[int, Block | Column, list[float], list[float]]] = []
        for thing in room.things:
            position, turn = _pose(thing)
            shape = self._box(thing) if isinstance(thing, Block) else self._cylinder(thing.radius, thing.height)
            body = self._stand(shape, thing.name, position, turn)
            if thing.start > -math.inf or thing.end < math.inf:
                self._coming.append((body, thing, position, turn))
        self._walking = [
            (self._stand(self._cylinder(person.radius, person.height), person.name, [0.0, 0.0, _AWAY]), person)
            for person in room.people
        ]
        self._doors = [
            (self._stand(self._box(door.at(0.0)), door.name, *_pose(door.at(0.0))), door) for door in room.doors
        ]
        self._open = [door.share(0.0) for door in room.doors]
        self._there = [True] * len(self._coming)
        self._moved = math.nan
        self.at(0.0)

    @property
    def moving(self) -> bool:
        """Whether anything ever moves, comes or goes."""
        return bool(self._coming or self._walking or self._doors)

    def at(self, t: float) -> None:
        """Bring everything to where it is at a time [s]."""
        if t == self._moved:
            return
        self._moved = t
        put, client = self._world.bullet.resetBasePositionAndOrientation, self._world.client
        for body, person in self._walking:
            x, y = person.at(t)
            put(body, [x, y, person.height / 2], [0.0, 0.0, 0.0, 1.0], physicsClientId=client)
        for k, (body, door) in enumerate(self._doors):
            if (share := door.share(t)) != self._open[k]:
                self._open[k] = share
                put(body, *_pose(door.at(t)), physicsClientId=client)
        for k, (body, thing, (x, y, z), turn) in enumerate(self._coming):
            there = thing.stands(t)
            if there != self._there[k]:
                self._there[k] = there
                put(body, [x, y, z if there else _AWAY], turn, physicsClientId=client)

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
            physicsClientId=self._world.client,
        )
        return np.array([hit[2] * reach if hit[0] >= 0 else math.inf for hit in hits])

    def _box(self, block: Block) -> int:
        bullet = self._world.bullet
        half = [block.length / 2, block.width / 2, block.height / 2]
        return int(
            bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=self._world.client)
        )

    def _cylinder(self, radius: float, height: float) -> int:
        bullet = self._world.bullet
        return int(
            bullet.createCollisionShape(
                bullet.GEOM_CYLINDER, radius=radius, height=height, physicsClientId=self._world.client
            )
        )

    def _stand(self, shape: int, name: str, position: list[float], turn: list[float] | None = None) -> int:
        bullet, client = self._world.bullet, self._world.client
        body = bullet.createMultiBody(
            0.0, shape, -1, position, [0.0, 0.0, 0.0, 1.0] if turn is None else turn, physicsClientId=client
        )
        bullet.changeDynamics(body, -1, lateralFriction=0.5, physicsClientId=client)
        bullet.setCollisionFilterGroupMask(body, -1, THING, CHASSIS | RAY, physicsClientId=client)
        self.names[int(body)] = name
        return int(body)


def _pose(thing: Block | Column) -> tuple[list[float], list[float]]:
    """Where a thing's middle is [m], and how it's turned, a quaternion."""
    angle = thing.angle if isinstance(thing, Block) else 0.0
    return [thing.x, thing.y, thing.height / 2], [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
