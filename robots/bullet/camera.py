"""Pictures of coloured shapes, drawn by PyBullet's own renderer in a world of their own, without a display."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from robots.bullet.world import World
from robots.solids import LinkShape
from vrs.model import Array

Picture = NDArray[np.uint8]
"""Red, green, blue, (height, width, 3)."""
SKY: Final = (214, 226, 235)
"""Colour where nothing is."""
_LIGHT: Final = (-2.0, -3.0, 5.0)
"""Where the light comes from."""
_AMBIENT, _DIFFUSE = 0.62, 0.42
"""Shares of the light that come from everywhere, and from there."""
_AWAY = (0.0, 0.0, -1000.0)
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
        bullet, client = self._world.bullet, self._world.client
        shape = bullet.createVisualShape(
            bullet.GEOM_MESH,
            vertices=triangles.reshape(-1, 3).tolist(),
            indices=list(range(3 * len(triangles))),
            normals=np.repeat(normals, 3, axis=0).tolist(),
            rgbaColor=[*colour, 1.0],
            specularColor=[0.0, 0.0, 0.0],
            physicsClientId=client,
        )
        return int(bullet.createMultiBody(0.0, -1, shape, physicsClientId=client))

    def place(self, figure: int, X: Array | None) -> None:
        """Put a shape at a pose in the world, (4, 4); None takes it away."""
        position, turn = (_AWAY, _UPRIGHT) if X is None else (X[:3, 3].tolist(), _quaternion(X[:3, :3]))
        put, client = self._world.bullet.resetBasePositionAndOrientation, self._world.client
        for body in self._figures[figure]:
            put(body, position, turn, physicsClientId=client)

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
        bullet, client = self._world.bullet, self._world.client
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
            physicsClientId=client,
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
