"""Shapes of links: meshes of files, simplified where they're heavy, primitives, and convex hulls of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robots.description.files import parsed
from robots.solids import LinkShape
from vrs.checks import bounded_text
from vrs.errors import FormatError
from vrs.model import Array

KINDS: Final = (".stl", ".obj", ".dae")
"""Kinds of files that meshes are read from."""
LARGEST: Final = 64 * 2**20
"""Of a file with a mesh [B]."""
MOST_TRIANGLES: Final = 6000
"""Of a shape; a page with twelve heavy links still opens at once."""
_PICTURES, _PIXELS = (".png", ".jpg", ".jpeg"), 2**24
"""Kinds and size of pictures."""
GREY: Final = (0.72, 0.74, 0.76)
"""Colour of what says none."""
Faces: TypeAlias = NDArray[np.int64]
_FINEST, _TRIES = 1024.0, 8
"""Cells a side of the finest grid that a heavy mesh is put on, and how many grids are tried."""
_PLACES: Final = np.array([1, 2**12, 2**24])
_THIN: Final = 1e-4
"""Least thickness of a convex piece [m]."""


class _LocalFiles:
    """What a mesh's file names beside it: materials, and pictures that its colours are taken from."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)

    def get(self, name: str) -> bytes:
        path = self._folder / Path(name.replace("\\", "/")).name
        if path.suffix.lower() == ".mtl":
            return bounded_text(path, LARGEST).encode()
        if path.suffix.lower() not in _PICTURES or path.stat().st_size > LARGEST:
            raise FileNotFoundError(name)
        from PIL import Image

        with Image.open(path) as picture:
            if picture.width * picture.height > _PIXELS:
                raise FileNotFoundError(name)
        return path.read_bytes()

    def keys(self) -> list[str]:
        return []


class Surface(NamedTuple):
    """A triangle mesh with its colours, if it has any of its own."""

    mesh: Any
    """trimesh.Trimesh [m]."""
    colours: Array | None
    """Of its faces, (m, 3), in [0, 1]."""


def read_mesh(path: Path, scale: ArrayLike = (1.0, 1.0, 1.0)) -> Surface:
    """Read a mesh.

    Args:
        path: An STL, OBJ or DAE file.
        scale: What its corners are multiplied by, (3,).

    Raises:
        FormatError: If it isn't one, or too large.
    """
    import trimesh

    kind = path.suffix.lower()
    if kind not in KINDS:
        raise FormatError(path.name, f"a mesh must be {', '.join(KINDS)}")
    if path.stat().st_size > LARGEST:
        raise FormatError(path.name, f"longer than {LARGEST} bytes")
    if kind == ".dae":
        parsed(bounded_text(path, LARGEST, "utf-8-sig"), path.name)
    try:
        with path.open("rb") as file:
            scene = trimesh.load_scene(file, file_type=kind[1:], resolver=_LocalFiles(path.parent))
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    except Exception as error:
        raise FormatError(path.name, f"can't be read as a mesh: {type(error).__name__}: {error}") from error
    if not meshes:
        raise FormatError(path.name, "has no triangles")
    own = [_own_colours(mesh) for mesh in meshes]
    mesh = trimesh.Trimesh(
        np.concatenate([one.vertices for one in meshes]),
        np.concatenate(
            [
                one.faces + before
                for one, before in zip(meshes, np.cumsum([0, *(len(m.vertices) for m in meshes)]), strict=False)
            ]
        ),
        process=False,
    )
    factors = np.asarray(scale, dtype=np.float64) * _metres(scene.units)
    mesh.vertices = mesh.vertices * factors
    if np.prod(factors) < 0:
        mesh.invert()
    if not np.isfinite(mesh.vertices).all():
        raise FormatError(path.name, "has corners that aren't finite")
    if all(colours is None for colours in own):
        return Surface(mesh, None)
    filled = [
        np.tile(GREY, (len(one.faces), 1)) if colours is None else colours
        for one, colours in zip(meshes, own, strict=True)
    ]
    return Surface(mesh, np.concatenate(filled))


def _metres(units: str | None) -> float:
    """How many metres the unit is that a DAE file says, as in `0.0254 * meters`; 1 where it says none."""
    factor, _, unit = (units or "").partition(" * ")
    return float(factor) if unit == "meters" else 1.0


def _own_colours(mesh: Any) -> Array | None:
    """Colours of a mesh's faces, (m, 3); None where its file says none."""
    import trimesh

    visual = mesh.visual
    if isinstance(visual, trimesh.visual.TextureVisuals):
        material = visual.material
        if visual.uv is None or not (
            getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
        ):
            return np.tile(np.asarray(material.main_color[:3], dtype=np.float64) / 255.0, (len(mesh.faces), 1))
        visual = visual.to_color()
        visual.mesh = mesh
    if visual.kind in {"face", "vertex"}:
        return np.asarray(visual.face_colors[:, :3], dtype=np.float64) / 255.0
    return None


def box(size: ArrayLike) -> Surface:
    """Make a box of a size (3,) [m] about its middle."""
    import trimesh

    return Surface(trimesh.creation.box(extents=np.asarray(size)), None)


def cylinder(radius: float, length: float) -> Surface:
    """Make a cylinder [m] along z about its middle."""
    import trimesh

    return Surface(trimesh.creation.cylinder(radius=radius, height=length, sections=48), None)


def capsule(radius: float, length: float) -> Surface:
    """Make a cylinder with round ends [m] along z about its middle; its length is without those."""
    import trimesh

    made = trimesh.creation.capsule(height=length, radius=radius, count=(24, 24))
    made.apply_translation(-made.bounds.mean(axis=0))
    return Surface(made, None)


def ellipsoid(radii: ArrayLike) -> Surface:
    """Make an ellipsoid of half-axes (3,) [m] about its middle."""
    import trimesh

    made = trimesh.creation.icosphere(subdivisions=3)
    made.vertices = made.vertices * np.asarray(radii)
    return Surface(made, None)


def shape(
    name: str,
    surface: Surface,
    X: Array,
    colour: ArrayLike | None = None,
    heavy: Callable[[], None] | None = None,
) -> LinkShape:
    """Place a surface in a link's frame.

    Args:
        name: Of the link.
        surface: In its own frame.
        X: Its pose in the link's, (4, 4).
        colour: What the description says; several colours of the mesh's own count more.
        heavy: Called where it has too many triangles, and is simplified.
    """
    mesh = surface.mesh
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    colours = surface.colours
    several = colours is not None and len(np.unique(np.round(colours, 3), axis=0)) > 1
    if colours is None or (colour is not None and not several):
        colours = np.tile(GREY if colour is None else np.asarray(colour, dtype=np.float64)[:3], (len(faces), 1))
    if len(faces) > MOST_TRIANGLES:
        if heavy is not None:
            heavy()
        vertices, faces, colours = simplified(vertices, faces, colours, MOST_TRIANGLES)
    main = np.median(colours, axis=0)
    return LinkShape(name, vertices @ X[:3, :3].T + X[:3, 3], faces, np.clip(main, 0, 1), np.clip(colours, 0, 1))


def simplified(vertices: Array, faces: Faces, colours: Array, most: int) -> tuple[Array, Faces, Array]:
    """Join corners that share a cell of a grid, as fine as leaves at most so many triangles.

    Args:
        vertices: (n, 3).
        faces: (m, 3).
        colours: Of the faces, (m, 3).
        most: Triangles that may be left.

    Returns:
        The same of what is left, in which no triangle occurs twice.
    """
    low, extent = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    few, many, best = 2.0, _FINEST, None
    for _ in range(_TRIES):
        cells = np.sqrt(few * many)
        grid = np.floor((vertices - low) * (cells / max(extent, 1e-12))).astype(np.int64)
        _, inverse, counts = np.unique(grid @ _PLACES, return_inverse=True, return_counts=True)
        joined = inverse[faces]
        distinct = (joined[:, 0] != joined[:, 1]) & (joined[:, 1] != joined[:, 2]) & (joined[:, 2] != joined[:, 0])
        corners = np.sort(joined[distinct], axis=1)
        _, first = np.unique(
            (corners[:, 0] * len(counts) + corners[:, 1]) * len(counts) + corners[:, 2], return_index=True
        )
        if len(first) > most:
            many = cells
        else:
            few, best = cells, (inverse, counts, joined[distinct][first], colours[distinct][first])
    assert best is not None, "a coarse grid leaves a handful of triangles"
    inverse, counts, left, coloured = best
    middles = np.stack([np.bincount(inverse, vertices[:, k]) for k in range(3)], axis=1) / counts[:, None]
    return middles, left, coloured


def hull(name: str, surface: Surface, X: Array) -> LinkShape | None:
    """Make the convex hull of a surface, in a link's frame; None where it's flat.

    Args:
        name: Of the link.
        surface: In its own frame.
        X: Its pose in the link's, (4, 4).
    """
    from scipy.spatial import QhullError

    if np.ptp(surface.mesh.vertices, axis=0).min() < _THIN:
        return None
    try:
        return shape(name, Surface(surface.mesh.convex_hull, None), X)
    except QhullError:
        return None
