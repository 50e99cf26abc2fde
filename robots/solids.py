"""Closed bodies to build robots' looks from, with trimesh, which is imported when one is made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array

ROUNDNESS: Final = 0.0015
"""How far the sides of what is round may lie inside it [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class LinkShape:
    """The surface of one link, a closed triangle mesh in the link's frame."""

    name: str
    """Name of the link."""
    vertices: Array
    """Corners [m], (n, 3), in the link's frame."""
    faces: NDArray[np.int64]
    """Vertex indices of triangles, (m, 3), counter-clockwise from outside."""
    colour: Array
    """Main colour, (3,), red, green, blue in [0, 1]."""
    face_colours: Array
    """Colour of each triangle, (m, 3), in [0, 1]."""

    def __post_init__(self) -> None:
        faces = np.array(self.faces, dtype=np.int64)
        faces.flags.writeable = False
        object.__setattr__(self, "faces", faces)
        for name in ("vertices", "colour", "face_colours"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or not np.isfinite(self.vertices).all():
            raise InvalidValueError("vertices", self.vertices.shape, "finite, of shape (n, 3)")
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.min() < 0 or faces.max() >= len(self.vertices):
            raise InvalidValueError("faces", faces.shape, "indices of vertices, of shape (m, 3)")
        if self.face_colours.shape != faces.shape:
            raise InvalidValueError("face_colours", self.face_colours.shape, f"of shape {faces.shape}")


def together(shapes: Sequence[tuple[LinkShape, Array]]) -> LinkShape:
    """Return shapes, one at least, each at a pose, (4, 4), as one; it's called and coloured as the first."""
    starts = np.cumsum([0, *(len(shape.vertices) for shape, _ in shapes)])
    return LinkShape(
        shapes[0][0].name,
        np.concatenate([shape.vertices @ X[:3, :3].T + X[:3, 3] for shape, X in shapes]),
        np.concatenate([shape.faces + start for (shape, _), start in zip(shapes, starts, strict=False)]),
        shapes[0][0].colour,
        np.concatenate([shape.face_colours for shape, _ in shapes]),
    )


class Builder:
    """Collects the bodies of one link and joins them."""

    def __init__(self, name: str, colour: tuple[float, float, float]) -> None:
        self._name, self._colour = name, colour
        self._bodies: list[tuple[Any, tuple[float, float, float]]] = []

    def add(self, body: Any, colour: tuple[float, float, float] | None = None) -> None:
        """Add a closed trimesh body, in the link's main colour unless another is given."""
        self._bodies.append((body, colour or self._colour))

    def shape(self) -> LinkShape:
        """Join what was added."""
        import trimesh

        mesh = trimesh.util.concatenate([body for body, _ in self._bodies])
        colours = np.concatenate([np.tile(colour, (len(body.faces), 1)) for body, colour in self._bodies])
        return LinkShape(self._name, mesh.vertices, mesh.faces, np.array(self._colour), colours)


def frame(origin: ArrayLike, axis: str) -> Array:
    """Pose of a body whose own z points along the named axis of the link, as `x` or `-y`."""
    turns = {
        "z": np.eye(3),
        "-z": np.diag((1.0, -1.0, -1.0)),
        "x": np.array([[0, 0, 1.0], [0, 1.0, 0], [-1.0, 0, 0]]),
        "-x": np.array([[0, 0, -1.0], [0, 1.0, 0], [1.0, 0, 0]]),
        "y": np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]),
        "-y": np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]),
    }
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turns[axis], origin
    return pose


def sides(radius: float) -> int:
    """Sides of a circle: enough for `ROUNDNESS`, and for edges that are drawn smooth."""
    return 4 * math.ceil(max(math.pi / math.acos(1.0 - min(ROUNDNESS / radius, 1.0)), 12.0) / 4)


def lathe(
    profile: Sequence[tuple[float, float]],
    *,
    at: ArrayLike = (0, 0, 0),
    axis: str = "z",
    n: int | None = None,
) -> Any:
    """Turn a profile of (radius, height) pairs, heights ascending, into a closed body."""
    import trimesh

    n = sides(max(radius for radius, _ in profile)) if n is None else n
    line = [(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])]
    return trimesh.creation.revolve(np.array(line), sections=n, transform=frame(at, axis))


def drum(
    radius: float, low: float, high: float, *, at: ArrayLike = (0, 0, 0), axis: str = "z", edge: float = 0.005
) -> Any:
    """Make a cylinder from low to high along an axis, its edges broken."""
    r, e = radius, edge
    return lathe([(r - e, low), (r, low + e), (r, high - e), (r - e, high)], at=at, axis=axis)


def hull(points: ArrayLike) -> Any:
    """Make the convex hull of points (n, 3)."""
    import trimesh

    return trimesh.convex.convex_hull(np.asarray(points, dtype=np.float64))


def outline(circles: Sequence[tuple[float, float, float]], inset: float = 0.0) -> Array:
    """Points of circles (u, v, radius), (n, 2)."""
    rings = []
    for u, v, r in circles:
        angle = np.linspace(0.0, 2.0 * math.pi, sides(r), endpoint=False)
        rings.append(np.array([u, v]) + (r - inset) * np.column_stack([np.cos(angle), np.sin(angle)]))
    return np.concatenate(rings)


def slab(circles: Sequence[tuple[float, float, float]], low: float, high: float, *, edge: float = 0.008) -> Any:
    """Make a plate in the xy plane around circles, from low to high along z, its edges broken."""
    layers = [(low, edge), (low + edge, 0.0), (high - edge, 0.0), (high, edge)]
    points = [
        np.column_stack([flat, np.full(len(flat), z)]) for z, inset in layers for flat in (outline(circles, inset),)
    ]
    return hull(np.concatenate(points))


def loft(sections: Sequence[tuple[float, tuple[float, float], float, float, float]]) -> Any:
    """Make a convex body through rounded rectangles across z: (z, centre, half width, half depth, corner)."""
    points = []
    for z, (x, y), half_x, half_y, corner in sections:
        u, v = half_x - corner, half_y - corner
        flat = outline([(x + i * u, y + j * v, corner) for i in (-1, 1) for j in (-1, 1)])
        points.append(np.column_stack([flat, np.full(len(flat), z)]))
    return hull(np.concatenate(points))
