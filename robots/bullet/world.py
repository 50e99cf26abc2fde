"""A PyBullet world of its own: one client in DIRECT mode, closed when its context ends.

In it a room's bodies (floor, things, people who walk), or coloured shapes of which PyBullet's own renderer makes
pictures without a display.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Sequence
from functools import partial
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from robots.robot import Closing
from robots.rooms import Block, Room, Standing, moves, pose_at, solid
from robots.solids import LinkShape
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


Picture = NDArray[np.uint8]
"""Red, green, blue, (height, width, 3)."""
SKY: Final = (214, 226, 235)
"""Colour where nothing is."""
_LIGHT: Final = (-2.0, -3.0, 5.0)
"""Where the light comes from."""
_AMBIENT, _DIFFUSE = 0.62, 0.42
"""Shares of the light that come from everywhere, and from there."""
_OUT_OF_SIGHT = (0.0, 0.0, -1000.0)
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)
_NOTHING = 0.999_999
"""Depth from which on nothing was drawn."""


class Studio:
    """Shapes that stand somewhere, and pictures of them. Nothing collides, and no time passes."""

    def __init__(self) -> None:
        """Begin with nothing; `close` it in the end."""
        self._world = World(gravity=0.0, dt=1.0)
        self._figures: list[tuple[int, ...]] = []

    def close(self) -> None:
        """Disconnect the world; a second call does nothing."""
        self._world.close()

    def add(self, shape: LinkShape) -> int:
        """Take a shape, as it stands in the world's frame; the number by which it's moved."""
        colours, of = np.unique(shape.face_colours, axis=0, return_inverse=True)
        bodies = [
            self._body(shape.vertices[shape.faces[of.ravel() == k]], colour.tolist())
            for k, colour in enumerate(colours)
        ]
        self._figures.append(tuple(bodies))
        return len(self._figures) - 1

    def _body(self, triangles: Array, colour: Sequence[float]) -> int:
        """Make a body of triangles, (m, 3, 3), each flat in its own plane."""
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        bullet = self._world.bullet
        shape = bullet.createVisualShape(
            bullet.GEOM_MESH,
            vertices=triangles.reshape(-1, 3).tolist(),
            indices=list(range(3 * len(triangles))),
            normals=np.repeat(normals, 3, axis=0).tolist(),
            rgbaColor=[*colour, 1.0],
            specularColor=[0.0, 0.0, 0.0],
        )
        return int(bullet.createMultiBody(0.0, -1, shape))

    def place(self, figure: int, X: Array | None) -> None:
        """Put a shape at a pose in the world, (4, 4); None takes it away."""
        position, turn = (_OUT_OF_SIGHT, _UPRIGHT) if X is None else (X[:3, 3].tolist(), _quaternion(X[:3, :3]))
        put = self._world.bullet.resetBasePositionAndOrientation
        for body in self._figures[figure]:
            put(body, position, turn)

    def draw(self, X_WC: Array, *, width: int, height: int, view: float, near: float, far: float) -> Picture:
        """Draw what a camera sees.

        Args:
            X_WC: Its pose, (4, 4): x along the line of sight, z up.
            width: Pixels across.
            height: Pixels down.
            view: Horizontal angle of view [rad].
            near: Nothing nearer is drawn [m].
            far: Nothing farther is drawn [m].
        """
        bullet = self._world.bullet
        eye, ahead, up = X_WC[:3, 3], X_WC[:3, 0], X_WC[:3, 2]
        vertical = 2.0 * math.atan(math.tan(view / 2) * height / width)
        image: tuple[Any, ...] = bullet.getCameraImage(
            width,
            height,
            bullet.computeViewMatrix(eye.tolist(), (eye + ahead).tolist(), up.tolist()),
            bullet.computeProjectionMatrixFOV(math.degrees(vertical), width / height, near, far),
            lightDirection=_LIGHT,
            lightColor=(1.0, 1.0, 1.0),
            lightAmbientCoeff=_AMBIENT,
            lightDiffuseCoeff=_DIFFUSE,
            lightSpecularCoeff=0.0,
            shadow=0,
            renderer=bullet.ER_TINY_RENDERER,
            flags=bullet.ER_NO_SEGMENTATION_MASK,
        )
        colours = np.reshape(np.asarray(image[2], dtype=np.uint8), (height, width, 4))
        depth = np.reshape(np.asarray(image[3]), (height, width))
        picture = np.ascontiguousarray(colours[..., :3])
        picture[depth >= _NOTHING] = SKY
        return picture


def _quaternion(R: Array) -> tuple[float, float, float, float]:
    """A turn about the vertical as PyBullet takes it, (x, y, z, w)."""
    half = 0.5 * math.atan2(R[1, 0], R[0, 0])
    return 0.0, 0.0, math.sin(half), math.cos(half)
