"""MeshCat's viewer, and triangle meshes as it takes them: smooth where a surface is, sharp at its edges."""

from __future__ import annotations

import math
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from robots.robot import Robot
from vrs.errors import FormatError
from vrs.model import Array, RobotModel

if TYPE_CHECKING:
    from robots.solids import LinkShape

CREASE = math.cos(math.radians(35.0))
"""Cosine of the angle between faces [rad] beyond which the edge between them stays sharp."""


@lru_cache(maxsize=1)
def viewer_bundle() -> tuple[str, str]:
    """Find MeshCat's viewer and its licence texts without importing MeshCat.

    Raises:
        FormatError: If it isn't installed or has no bundle.
    """
    spec = find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise FormatError("meshcat", "not installed; every 3D view is its viewer bundle")
    root = Path(spec.origin).parent / "viewer"
    bundle = root / "dist" / "main.min.js"
    if not bundle.is_file():
        raise FormatError(str(bundle), "missing; reinstall meshcat")
    texts = [root / "LICENSE", root / "dist" / "main.min.js.LICENSE.txt"]
    licences = "\n\n".join(text.read_text(encoding="utf-8").strip() for text in texts if text.is_file())
    return bundle.read_text(encoding="utf-8"), licences


class ShadedMesh(NamedTuple):
    """A triangle mesh with a normal and a colour for each vertex."""

    vertices: Array
    """[m], (n, 3)."""
    normals: Array
    """Unit vectors, (n, 3)."""
    colours: NDArray[np.uint8]
    """Red, green, blue, (n, 3)."""
    faces: NDArray[np.uint32]
    """Indices of vertices, (m, 3)."""


Bodies: TypeAlias = tuple[tuple[ShadedMesh, ...], float]
"""What a robot looks like: a mesh for the base and for each link, in its frame, and the lowest point of the base in
its frame [m]; none and 0 for a robot without shapes."""


def rod_of(model: RobotModel, i: int) -> Array | None:
    """Origin of link i − 1 in link i's frame [m], (3,); None where that isn't constant."""
    low, span = model.limits.q_min, model.limits.q_max - model.limits.q_min
    one, other = ((np.linalg.inv(X[i]) @ X[i - 1])[:3, 3] for X in model.links(low + np.outer((0.4, 0.6), span)))
    return one if np.allclose(one, other, atol=1e-9) else None


def bodies(robot: Robot) -> Bodies:
    """Make the meshes of a robot; the first time that takes a second, most of it to load trimesh."""
    shapes = robot.shapes()
    floor = min((float(shape.vertices[:, 2].min()) for shape in shapes[:1]), default=0.0)
    return tuple(shaded(shape) for shape in shapes), floor


def shaded(shape: LinkShape) -> ShadedMesh:
    """Give each corner of each face the mean normal of the faces around it that meet without a crease.

    Corners of equal place, normal and colour become one vertex.
    """
    triangles = shape.vertices[shape.faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    directions = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    corner_vertex = shape.faces.ravel()
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex, minlength=len(shape.vertices))
    first = np.cumsum(counts) - counts
    around = counts[corner_vertex]
    # Every corner with every face around its vertex.
    mine = np.repeat(np.arange(len(corner_vertex)), around)
    place = np.arange(len(mine)) - np.repeat(np.cumsum(around) - around, around)
    other = order[first[corner_vertex[mine]] + place] // 3
    smooth = np.einsum("ij,ij->i", directions[mine // 3], directions[other]) >= CREASE
    sums = np.zeros((len(corner_vertex), 3))
    np.add.at(sums, mine[smooth], normals[other[smooth]])
    sums /= np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-30)
    colours = np.repeat(np.rint(255.0 * shape.face_colours).astype(np.uint8), 3, axis=0)
    corners = np.column_stack([corner_vertex, np.rint(sums * 1e4), colours]).astype(np.int64)
    _, chosen, index = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    faces = index.reshape(-1, 3).astype(np.uint32)
    return ShadedMesh(shape.vertices[corner_vertex[chosen]], sums[chosen], colours[chosen], faces)


def tube(points: Array, radius: float, sides: int = 6) -> tuple[Array, NDArray[np.uint32]]:
    """Make an open tube along a polyline.

    Args:
        points: [m], (k, 3), k ≥ 2, no two in a row equal.
        radius: [m].
        sides: Sides of its cross section.

    Returns:
        Vertices [m], (k * sides, 3), and faces, (2 * (k - 1) * sides, 3), counter-clockwise from outside.
    """
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    along = np.vstack([steps[:1], steps[1:] + steps[:-1], steps[-1:]])
    # Where the line turns back on itself, the sum of both directions vanishes.
    back = np.linalg.norm(along, axis=1) < 1e-6
    along[back] = np.vstack([steps, steps[-1:]])[back]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.empty_like(along)
    side = np.eye(3)[np.argmin(np.abs(along[0]))]
    for k, direction in enumerate(along):
        flat = side - direction * float(side @ direction)
        length = float(np.linalg.norm(flat))
        side = flat / length if length > 1e-6 else _any_normal(direction)
        across[k] = side
    third = np.cross(along, across)
    angle = 2.0 * math.pi * np.arange(sides) / sides
    offsets = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * third[:, None]
    vertices = (points[:, None] + radius * offsets).reshape(-1, 3)
    ring = sides * np.arange(len(points) - 1)[:, None]
    here, there = ring + np.arange(sides), ring + (np.arange(sides) + 1) % sides
    faces = np.stack([here, there, there + sides, here, there + sides, here + sides], axis=-1)
    return vertices, faces.reshape(-1, 3).astype(np.uint32)


def _any_normal(direction: Array) -> Array:
    normal: Array = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    return normal / np.linalg.norm(normal)
