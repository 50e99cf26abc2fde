"""Pictures of coloured shapes as a camera sees them, by NumPy alone: no display, graphics card or world of physics.

Triangles are flat, lit from one side; of those that cover a pixel's middle the nearest is seen.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from robots.solids import LinkShape
from vrs.model import Array

Picture = NDArray[np.uint8]
"""Red, green, blue, (height, width, 3)."""
SKY: Final = (214, 226, 235)
"""Colour where nothing is."""
_LIGHT: Final = np.array([-2.0, -3.0, 5.0]) / math.sqrt(38.0)
"""Towards where the light comes from."""
_AMBIENT, _DIFFUSE = 0.62, 0.42
"""Shares of the light that come from everywhere, and from there."""


class Renderer:
    """Shapes that stand somewhere, and pictures of them."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._shapes: list[tuple[Array, Array, Array]] = []
        """Corners (m, 3, 3), normals (m, 3) and colours (m, 3) of triangles, in the frames of shapes."""
        self._placed: list[tuple[Array, Array] | None] = []
        """Corners and shades (m, 3) in the world; None of a shape that's away."""

    def add(self, shape: LinkShape) -> int:
        """Take a shape, as it stands in the world's frame; the number by which it's moved."""
        corners = shape.vertices[shape.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        self._shapes.append((corners, normals, 255.0 * shape.face_colours))
        self._placed.append(None)
        self.place(len(self._shapes) - 1, np.eye(4))
        return len(self._shapes) - 1

    def place(self, figure: int, X: Array | None) -> None:
        """Put a shape at a pose in the world, (4, 4); None takes it away."""
        if X is None:
            self._placed[figure] = None
            return
        corners, normals, colours = self._shapes[figure]
        light = _AMBIENT + _DIFFUSE * np.maximum(normals @ (_LIGHT @ X[:3, :3]), 0.0)
        shades = np.minimum(light[:, None] * colours, 255.0)
        self._placed[figure] = corners @ X[:3, :3].T + X[:3, 3], shades

    def draw(self, X_WC: Array, *, width: int, height: int, view: float, near: float, far: float) -> Picture:
        """Draw what a camera sees.

        Args:
            X_WC: Its pose, (4, 4): x along the line of sight, y to the left, z up.
            width: Pixels across.
            height: Pixels down.
            view: Horizontal angle of view [rad].
            near: Nothing nearer is drawn [m].
            far: Nothing farther is drawn [m].
        """
        picture = np.full((height * width, 3), SKY, dtype=np.uint8)
        there = [placed for placed in self._placed if placed is not None]
        if there:
            corners = (np.concatenate([part for part, _ in there]) - X_WC[:3, 3]) @ X_WC[:3, :3]
            focus = 0.5 * width / math.tan(0.5 * view)
            corners, of = _before(corners, near, far, 0.5 * width / focus, 0.5 * height / focus)
            inverse = 1.0 / corners[..., 0]
            u = 0.5 * width - focus * corners[..., 1] * inverse
            v = 0.5 * height - focus * corners[..., 2] * inverse
            pixels, triangles = _covered(u, v, inverse, 1.0 / far, width, height)
            picture[pixels] = np.concatenate([shades for _, shades in there])[of[triangles]]
        return picture.reshape(height, width, 3)


def _before(corners: Array, near: float, far: float, across: float, up: float) -> tuple[Array, NDArray[np.int64]]:
    """Return what of triangles is before a camera, and may be in its picture.

    Args:
        corners: (m, 3, 3), in the camera's frame; what is turned away isn't seen.
        near: See `Renderer.draw`.
        far: So.
        across: Tangent of half the horizontal angle of view.
        up: The same of the vertical one.

    Returns:
        Corners (k, 3, 3), none nearer than `near`, and of which triangle each is, (k,).
    """
    x, y, z = (corners[..., k] for k in range(3))
    outside = (x < near).all(axis=1) | (x > far).all(axis=1)
    for beside, tangent in ((y, across), (z, up)):
        outside |= (beside > tangent * x).all(axis=1) | (-beside > tangent * x).all(axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    of = np.flatnonzero(~outside & (np.einsum("ij,ij->i", normals, corners[:, 0]) < 0.0))
    corners = corners[of]
    inside = corners[..., 0] >= near
    count = inside.sum(axis=1)
    parts, owners = [corners[count == 3]], [of[count == 3]]
    for many in (1, 2):
        chosen = count == many
        # The corner that is alone on its side comes first.
        alone = np.argmax(inside[chosen] == (many == 1), axis=1)
        one, two, three = (corners[chosen, (alone + k) % 3] for k in range(3))
        second, third = (_cut(one, other, near) for other in (two, three))
        if many == 1:
            parts.append(np.stack([one, second, third], axis=1))
        else:
            parts += [np.stack([second, two, three], axis=1), np.stack([second, three, third], axis=1)]
            owners.append(of[chosen])
        owners.append(of[chosen])
    return np.concatenate(parts), np.concatenate(owners)


def _cut(a: Array, b: Array, near: float) -> Array:
    """Where edges from a to b, (k, 3) each, cross the plane of `near`."""
    share = (near - a[:, :1]) / (b[:, :1] - a[:, :1])
    return a + share * (b - a)


def _covered(
    u: Array, v: Array, inverse: Array, least: float, width: int, height: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pixels that triangles cover, and which triangle each shows.

    Args:
        u: Columns of corners, (k, 3); a pixel's middle is at a half.
        v: Rows of corners, (k, 3).
        inverse: Of the distances of corners along the line of sight [1/m], (k, 3); it's linear in u and v.
        least: Smallest inverse that is drawn [1/m].
        width: Pixels across.
        height: Pixels down.
    """
    first = np.clip(np.ceil(v.min(axis=1) - 0.5), 0, height).astype(np.int64)
    last = np.clip(np.ceil(v.max(axis=1) - 0.5), 0, height).astype(np.int64)
    of, row = _runs(first, last)
    middle = row + 0.5
    low, high = np.full(len(of), np.inf), np.full(len(of), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        # From the upper end to the lower one, so that neighbours find the same place on what they share.
        swap = v[:, i] > v[:, j]
        u0, v0 = np.where(swap, u[:, j], u[:, i])[of], np.where(swap, v[:, j], v[:, i])[of]
        u1, v1 = np.where(swap, u[:, i], u[:, j])[of], np.where(swap, v[:, i], v[:, j])[of]
        crosses = (v0 <= middle) & (middle < v1)
        at = u0 + (middle - v0) / np.where(crosses, v1 - v0, 1.0) * (u1 - u0)
        low = np.where(crosses, np.minimum(low, at), low)
        high = np.where(crosses, np.maximum(high, at), high)
    left = np.clip(np.ceil(low - 0.5), 0, width).astype(np.int64)
    right = np.clip(np.ceil(high - 0.5), 0, width).astype(np.int64)
    span, column = _runs(left, right)
    triangle, pixel = of[span], row[span] * width + column
    slope = _planes(u, v, inverse)[triangle]
    depth = slope[:, 0] * (column + 0.5) + slope[:, 1] * middle[span] + slope[:, 2]
    seen = np.flatnonzero(depth >= least)
    # The nearest is written last.
    order = seen[np.argsort(depth[seen], kind="stable")]
    return pixel[order], triangle[order]


def _runs(first: NDArray[np.int64], last: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers in [first, last) of each pair, one after the other, and of which pair each is."""
    count = np.maximum(last - first, 0)
    of = np.repeat(np.arange(len(count)), count)
    return of, np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + first[of]


def _planes(u: Array, v: Array, w: Array) -> Array:
    """Coefficients a, b, c of w = a u + b v + c through three points each, (k, 3); 0, 0, w of those in line."""
    du, dv, dw = (part[:, 1:] - part[:, :1] for part in (u, v, w))
    area = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
    scale = np.where(np.abs(area) > 1e-12, area, np.inf)
    a = (dw[:, 0] * dv[:, 1] - dw[:, 1] * dv[:, 0]) / scale
    b = (du[:, 0] * dw[:, 1] - du[:, 1] * dw[:, 0]) / scale
    return np.column_stack([a, b, w[:, 0] - a * u[:, 0] - b * v[:, 0]])
