"""Objects of the scene, lowered by MeshCat's own classes. Loads those: import it where it's used."""

from __future__ import annotations

import importlib
import io
import sys
from collections.abc import Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from interfaces.stream.meshcat.meshes import ShadedMesh, tube
from vrs.errors import FormatError
from vrs.model import Array

if TYPE_CHECKING:
    from PIL import ImageFont

Json = dict[str, Any]

ALIAS = "_meshcat_without_its_door"
"""Name under which the package is known here; `import meshcat` stays what it is."""


@lru_cache(maxsize=8)
def module(name: str) -> Any:
    """Load a module of MeshCat: `geometry`, `commands` or `path`.

    Raises:
        FormatError: If MeshCat isn't installed.
    """
    spec = find_spec("meshcat")
    if spec is None or spec.submodule_search_locations is None:
        raise FormatError("meshcat", "not installed; the 3D view is its viewer")
    if ALIAS not in sys.modules:
        package = ModuleType(ALIAS)
        package.__path__ = list(spec.submodule_search_locations)
        sys.modules[ALIAS] = package
    return importlib.import_module(f"{ALIAS}.{name}")


SCREEN_PIXELS: Final = (448, 268)
"""Pixels across and down."""
SCREEN_PAPER: Final = (26, 60, 84)
SCREEN_INK: Final = (240, 246, 250)
LARGEST_LETTERS, SMALLEST_LETTERS = 72, 14
"""Height of the letters [pixels]."""
SCREEN_MARGIN: Final = 18
_LINE_SPACING: Final = 1.25


@lru_cache(maxsize=1)
def _font_file() -> Path:
    """The letters that matplotlib brings, found without loading it.

    Raises:
        FormatError: If they aren't there.
    """
    spec = find_spec("matplotlib")
    if spec is None or spec.origin is None:
        raise FormatError("matplotlib", "not installed; its letters are those of the robot's screen")
    return Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"


def text_picture(text: str) -> bytes:
    """Return a PNG with a text in its middle, its lines wrapped; what doesn't fit is left out."""
    from PIL import Image, ImageDraw, ImageFont

    for size in range(LARGEST_LETTERS, SMALLEST_LETTERS - 1, -2):
        font = ImageFont.truetype(_font_file(), size)
        lines = wrapped(text, font, SCREEN_PIXELS[0] - 2 * SCREEN_MARGIN, within=size == SMALLEST_LETTERS)
        if lines and len(lines) * size * _LINE_SPACING <= SCREEN_PIXELS[1] - 2 * SCREEN_MARGIN:
            break
    image = Image.new("RGB", SCREEN_PIXELS, SCREEN_PAPER)
    draw = ImageDraw.Draw(image)
    step = size * _LINE_SPACING
    top = max((SCREEN_PIXELS[1] - len(lines) * step) / 2, SCREEN_MARGIN)
    for k, line in enumerate(lines):
        draw.text((SCREEN_PIXELS[0] / 2, top + (k + 0.5) * step), line, SCREEN_INK, font, anchor="mm")
    file = io.BytesIO()
    image.save(file, "PNG", optimize=True)
    return file.getvalue()


def wrapped(text: str, font: ImageFont.FreeTypeFont, width: float, *, within: bool) -> list[str]:
    """Break a text into lines.

    Args:
        text: The text.
        font: Of its letters.
        width: Of a line at most [pixels].
        within: Whether words that are too long are wrapped as well; else there are no lines then.
    """
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and font.getlength(longer) <= width:
            lines[-1] = longer
        elif font.getlength(word) <= width:
            lines.append(word)
        elif within:
            lines += _word_pieces(word, font, width)
        else:
            return []
    return lines


def _word_pieces(word: str, font: ImageFont.FreeTypeFont, width: float) -> list[str]:
    pieces = [""]
    for letter in word:
        if pieces[-1] and font.getlength(pieces[-1] + letter) > width:
            pieces.append("")
        pieces[-1] += letter
    return pieces


g = module("geometry")

GHOST = 0x3D8BF2
"""The virtual robot's tint."""
COMMITTED = 0xF2721B
"""Colour of the committed path."""
FRONT = 0
"""Only faces that look at the camera are drawn."""
TUBE = 0.006
"""Radius of the committed path's line [m]."""
_CYLINDER = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""three.js's cylinders stand along y."""

_STANDING = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""three.js's planes lie: x to the right, y up, z to who looks."""


class ObjectPart(NamedTuple):
    """A child of an object: a geometry in a material."""

    geometry: Any
    material: Any
    kind: str = "Mesh"
    matrix: Sequence[float] | None = None
    """Column-major, (16,); None for the identity."""
    order: int = 0
    """Order of drawing."""


def group(path: str, parts: Sequence[ObjectPart], data: Json | None = None) -> Json:
    """Lower several parts as one object.

    Args:
        path: Where it'll be; names its parts, so that equal objects give equal bytes.
        parts: Its children; they may share geometries and materials.
        data: What the page finds in the object's `userData`.
    """
    lowered: Json = {"metadata": {"version": 4.5, "type": "Object"}, "geometries": [], "materials": []}
    known: dict[int, str] = {}
    children: list[Json] = []
    for part in parts:
        for element in (part.geometry, part.material):
            if id(element) not in known:
                known[id(element)] = element.uuid = f"{path}:{len(known)}"
                element.lower_in_object(lowered)
        child: Json = {
            "uuid": f"{path}:part{len(children)}",
            "type": part.kind,
            "geometry": part.geometry.uuid,
            "material": part.material.uuid,
            "renderOrder": part.order,
        }
        if part.matrix is not None:
            child["matrix"] = list(part.matrix)
        children.append(child)
    lowered["object"] = {"uuid": path, "type": "Group", "children": children, "userData": data or {}}
    return lowered


class Lowered:
    """A geometry as three.js describes it, for what MeshCat has no class for."""

    def __init__(self, described: Json) -> None:
        self._described = described
        self.uuid = ""

    def lower_in_object(self, data: Json) -> None:
        """Add itself to the object's geometries."""
        data["geometries"].append(self._described | {"uuid": self.uuid})


def _shaded(mesh: ShadedMesh, *, coloured: bool) -> Lowered:
    """A mesh with normals."""
    described = g.TriangularMeshGeometry(mesh.vertices, mesh.faces).lower({})
    attributes = described["data"]["attributes"]
    attributes["normal"] = g.pack_numpy_array(mesh.normals.T)
    if coloured:
        attributes["color"] = {**g.pack_numpy_array(mesh.colours.T), "normalized": True}
    return Lowered(described)


def solid(path: str, mesh: ShadedMesh) -> Json:
    """Lower a link of the real robot, in its own colours."""
    material = g.MeshPhongMaterial(vertexColors=True, side=FRONT, shininess=25, specular=0x222222, reflectivity=1.0)
    return group(path, [ObjectPart(_shaded(mesh, coloured=True), material)])


def plain(path: str, mesh: ShadedMesh, colour: int) -> Json:
    """Lower what has one colour, whatever light falls on it."""
    return group(path, [ObjectPart(_shaded(mesh, coloured=False), g.MeshBasicMaterial(color=colour, side=FRONT))])


def ghost(path: str, mesh: ShadedMesh) -> Json:
    """Lower a link of the virtual robot: translucent.

    Depth comes first, so that only the nearest surface shows; both are pushed back, so that the ghost yields to the
    solid robot where the two coincide.
    """
    shape = _shaded(mesh, coloured=False)
    back = {"polygonOffset": True, "polygonOffsetFactor": 1.5, "polygonOffsetUnits": 6}
    depth = g.MeshBasicMaterial(side=FRONT, transparent=True, colorWrite=False, **back)
    skin = g.MeshPhongMaterial(color=GHOST, opacity=0.46, side=FRONT, depthWrite=False, **back)
    return group(path, [ObjectPart(shape, depth, order=1), ObjectPart(shape, skin, order=2)])


def frame(path: str, previous: Array | None, colour: int, opacity: float) -> Json:
    """Lower a link that has no shape: its axes, and a rod to the link before it.

    Args:
        path: See `group`.
        previous: Origin of the link before, in this link's frame [m], (3,); None without a rod.
        colour: Of the rod.
        opacity: Of the rod.
    """
    triad = g.triad(0.08)
    parts = [ObjectPart(triad.geometry, triad.material, "LineSegments")]
    if previous is not None and np.linalg.norm(previous) > 1e-6:
        rod = g.MeshBasicMaterial(color=colour, opacity=opacity)
        parts.append(ObjectPart(_tube(np.array([previous, np.zeros(3)]), 0.012), rod))
    return group(path, parts)


def trace(path: str, points: Array, colour: int) -> Json:
    """Lower where a tool has been: a thin line through points [m], (k, 3)."""
    line = g.PointsGeometry(points.T.astype(np.float32))
    return group(path, [ObjectPart(line, g.LineBasicMaterial(color=colour), "Line")])


def committed_piece(
    path: str, points: Array, marks: Sequence[tuple[Array, float]], data: Json, *, scale: float = 1.0
) -> Json:
    """Lower a piece of the committed path, seen faintly through what stands before it.

    Args:
        path: See `group`.
        points: Of the line [m], (k, 3); none, or at least two of which no two in a row are equal.
        marks: Pose of each mark, (4, 4), its z along the path, and its size: a disc of that radius [m], or for a
            negative one a ball.
        data: See `group`.
        scale: What all thicknesses are multiplied by.
    """
    clear = g.MeshBasicMaterial(color=COMMITTED)
    hidden = g.MeshBasicMaterial(color=COMMITTED, opacity=0.3, depthTest=False, depthWrite=False)
    shapes: list[tuple[Any, Sequence[float] | None]] = []
    if len(points):
        shapes.append((_tube(points, scale * TUBE), None))
    for X, size in marks:
        shape = g.Cylinder(scale * 0.008, scale * size) if size > 0 else g.Sphere(-scale * size)
        shapes.append((shape, (X @ _CYLINDER).T.ravel().tolist()))
    parts = [ObjectPart(shape, clear, matrix=matrix) for shape, matrix in shapes]
    parts += [ObjectPart(shape, hidden, matrix=matrix, order=3) for shape, matrix in shapes]
    return group(path, parts, data)


def band(path: str, points: Array, width: float, colour: int) -> Json:
    """Lower where a robot has driven: a flat band on the floor along points [m], (k, 3), k ≥ 2, so wide [m]."""
    along = np.gradient(points[:, :2], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    aside = 0.5 * width * np.column_stack([-along[:, 1], along[:, 0], np.zeros(len(points))])
    vertices = np.stack([points + aside, points - aside], axis=1).reshape(-1, 3)
    k = 2 * np.arange(len(points) - 1)[:, None, None]
    faces = (k + np.array([[0, 1, 2], [2, 1, 3]])).reshape(-1, 3)
    return group(path, [ObjectPart(g.TriangularMeshGeometry(vertices, faces), g.MeshBasicMaterial(color=colour))])


def sign(path: str, png: bytes, size: tuple[float, float], X: Array) -> Json:
    """Lower a picture on a rectangle that shines by itself.

    Args:
        path: See `group`.
        png: The picture.
        size: Width and height of the rectangle [m].
        X: Its pose, (4, 4): x out of the picture, y to the right of who looks at it, z up.
    """
    image = g.PngImage(png)
    texture = g.ImageTexture(image)
    image.uuid, texture.uuid = f"{path}:image", f"{path}:texture"
    turned = X @ _STANDING
    sheet = Lowered({"uuid": "", "type": "PlaneGeometry", "width": size[0], "height": size[1]})
    part = ObjectPart(sheet, g.MeshBasicMaterial(map=texture, side=FRONT), matrix=turned.T.ravel().tolist())
    return group(path, [part])


def tiles(path: str, places: Array, side: float, colour: int) -> Json:
    """Lower square tiles on the floor: their middles [m], (k, 3), k ≥ 1, and their side [m]."""
    h = 0.5 * side
    corners = np.array([[-h, -h, 0.0], [h, -h, 0.0], [h, h, 0.0], [-h, h, 0.0]])
    vertices = (places[:, None] + corners).reshape(-1, 3)
    faces = (4 * np.arange(len(places))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    material = g.MeshBasicMaterial(color=colour, opacity=0.6, transparent=True)
    return group(path, [ObjectPart(g.TriangularMeshGeometry(vertices, faces), material)])


def _tube(points: Array, radius: float) -> Any:
    return g.TriangularMeshGeometry(*tube(points, radius))
