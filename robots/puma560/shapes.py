"""What the PUMA 560 looks like: a pedestal and six links, built from θ with trimesh.

Every link is a union of overlapping convex or lathed closed bodies in its Denavit-Hartenberg frame. Along the
shoulder axis, counted from the waist, stand the shoulder drum, the forearm around D3, and the upper arm
outside it, as on Unimation's arm, so that the forearm folds past the upper arm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robots.puma560.parameters import A2, A3, D3, D4, FLANGE, PEDESTAL
from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array

CREAM: Final = (0.90, 0.88, 0.80)
STEEL: Final = (0.62, 0.64, 0.67)
DARK: Final = (0.16, 0.18, 0.21)
BLUE: Final = (0.10, 0.25, 0.47)

ROUNDNESS: Final = 0.0015
"""How far the sides of what is round may lie inside it [m]."""
NECK: Final = -0.20
"""Height where the pedestal ends and the turning shoulder begins, base frame [m]."""
UPPER_ARM_INNER: Final = D3 + 0.048
"""Inner face of the upper arm, along the shoulder axis from the waist axis [m]."""
UPPER_ARM_OUTER: Final = UPPER_ARM_INNER + 0.098
"""Outer face of the upper arm [m]."""
FOREARM_END: Final = D4 - 0.088
"""Where the forearm ends and the wrist's roll begins, along z of frame 3 [m]."""


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


class _Builder:
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


def _frame(origin: ArrayLike, axis: str) -> Array:
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


def _sides(radius: float) -> int:
    """Sides of a circle: enough for `ROUNDNESS`, and for edges that are drawn smooth."""
    return 4 * math.ceil(max(math.pi / math.acos(1.0 - min(ROUNDNESS / radius, 1.0)), 12.0) / 4)


def _lathe(
    profile: Sequence[tuple[float, float]],
    *,
    at: ArrayLike = (0, 0, 0),
    axis: str = "z",
    n: int | None = None,
) -> Any:
    """Turn a profile of (radius, height) pairs, heights ascending, into a closed body."""
    import trimesh

    n = _sides(max(radius for radius, _ in profile)) if n is None else n
    line = [(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])]
    return trimesh.creation.revolve(np.array(line), sections=n, transform=_frame(at, axis))


def _drum(
    radius: float, low: float, high: float, *, at: ArrayLike = (0, 0, 0), axis: str = "z", edge: float = 0.005
) -> Any:
    """Make a cylinder from low to high along an axis, its edges broken."""
    r, e = radius, edge
    return _lathe([(r - e, low), (r, low + e), (r, high - e), (r - e, high)], at=at, axis=axis)


def _hull(points: ArrayLike) -> Any:
    """Make the convex hull of points (n, 3)."""
    import trimesh

    return trimesh.convex.convex_hull(np.asarray(points, dtype=np.float64))


def _outline(circles: Sequence[tuple[float, float, float]], inset: float = 0.0) -> Array:
    """Points of circles (u, v, radius), (n, 2)."""
    rings = []
    for u, v, r in circles:
        angle = np.linspace(0.0, 2.0 * math.pi, _sides(r), endpoint=False)
        rings.append(np.array([u, v]) + (r - inset) * np.column_stack([np.cos(angle), np.sin(angle)]))
    return np.concatenate(rings)


def _slab(circles: Sequence[tuple[float, float, float]], low: float, high: float, *, edge: float = 0.008) -> Any:
    """Make a plate in the xy plane around circles, from low to high along z, its edges broken."""
    layers = [(low, edge), (low + edge, 0.0), (high - edge, 0.0), (high, edge)]
    points = [
        np.column_stack([flat, np.full(len(flat), z)])
        for z, inset in layers
        for flat in (_outline(circles, inset),)
    ]
    return _hull(np.concatenate(points))


def _loft(sections: Sequence[tuple[float, tuple[float, float], float, float, float]]) -> Any:
    """Make a convex body through rounded rectangles across z: (z, centre, half width, half depth, corner)."""
    points = []
    for z, (x, y), half_x, half_y, corner in sections:
        u, v = half_x - corner, half_y - corner
        flat = _outline([(x + i * u, y + j * v, corner) for i in (-1, 1) for j in (-1, 1)])
        points.append(np.column_stack([flat, np.full(len(flat), z)]))
    return _hull(np.concatenate(points))


def _pedestal() -> LinkShape:
    """Build the fixed column: base frame, z up from the shoulder."""
    floor = -PEDESTAL
    build = _Builder("pedestal", CREAM)
    build.add(_drum(0.185, floor, floor + 0.022, edge=0.004), DARK)
    build.add(
        _lathe([(0.135, floor + 0.015), (0.135, floor + 0.045), (0.105, floor + 0.075), (0.105, NECK - 0.02)])
    )
    for k in range(8):
        angle = (k + 0.5) * math.pi / 4
        at = (0.162 * math.cos(angle), 0.162 * math.sin(angle), floor)
        build.add(_lathe([(0.009, 0.018), (0.009, 0.030)], at=at, n=6), STEEL)
    build.add(_drum(0.108, floor + 0.130, floor + 0.160, edge=0.002), BLUE)
    build.add(_loft([(z, (-0.112, 0.0), 0.032, 0.062, 0.018) for z in (floor + 0.20, floor + 0.40)]))
    build.add(_drum(0.112, NECK - 0.035, NECK, edge=0.003), DARK)
    return build.shape()


def _shoulder() -> LinkShape:
    """Build link 1: y1 points up, z1 along the shoulder axis, both from the shoulder."""
    build = _Builder("shoulder", CREAM)
    build.add(_lathe([(0.102, NECK - 0.01), (0.105, NECK + 0.004), (0.105, -0.115), (0.092, -0.04)], axis="y"))
    # The housing broadens from the neck to the drum.
    angle = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)
    ring = np.column_stack([0.100 * np.cos(angle), np.full(48, -0.135), 0.100 * np.sin(angle)])
    cradle = np.array([[x, y, z] for x in (-0.098, 0.098) for y in (-0.045, 0.02) for z in (-0.10, 0.13)])
    build.add(_hull(np.concatenate([ring, cradle])))
    build.add(_lathe([(0.085, -0.140), (0.108, -0.122), (0.115, -0.105), (0.115, 0.160), (0.108, 0.168)]))
    build.add(_drum(0.060, -0.150, -0.120, edge=0.006), BLUE)
    build.add(_drum(0.092, 0.150, UPPER_ARM_INNER - 0.006, edge=0.002), DARK)
    return build.shape()


def _upper_arm() -> LinkShape:
    """Build link 2: x2 from the shoulder, at x = −A2, to the elbow at the origin; z2 the joint axes."""
    low, high = UPPER_ARM_INNER, UPPER_ARM_OUTER
    build = _Builder("upper arm", CREAM)
    body = [(-A2 - 0.120, 0.0, 0.082), (-A2, 0.0, 0.118), (0.0, 0.0, 0.070)]
    build.add(_slab(body, low, high, edge=0.010))
    build.add(_drum(0.086, low - 0.024, low + 0.02, at=(-A2, 0, 0), edge=0.002), STEEL)
    # Covers of the two motors in the tail, and of the shoulder and elbow gears.
    cover = [(-A2 - 0.112, 0.0, 0.058), (-A2 - 0.02, 0.0, 0.080)]
    build.add(_slab(cover, high - 0.01, high + 0.016, edge=0.008))
    build.add(_drum(0.060, high, high + 0.030, at=(-A2, 0, 0), edge=0.008), DARK)
    build.add(_drum(0.046, high - 0.01, high + 0.012, edge=0.006), DARK)
    stripe = [(-A2 + 0.135, 0.0, 0.012), (-0.085, 0.0, 0.012)]
    build.add(_slab(stripe, high - 0.006, high + 0.003, edge=0.001), BLUE)
    build.add(_drum(0.050, D3 + 0.020, low + 0.02, edge=0.002), STEEL)
    return build.shape()


def _forearm() -> LinkShape:
    """Build link 3: z3 along the forearm, the elbow's axis parallel to y3 through x = −A3."""
    build = _Builder("forearm", CREAM)
    build.add(
        _loft(
            [
                (-0.128, (-A3, 0.0), 0.048, 0.034, 0.014),
                (-0.112, (-A3, 0.0), 0.060, 0.042, 0.016),
                (0.020, (-A3, 0.0), 0.074, 0.042, 0.020),
                (0.070, (-A3 * 0.8, 0.0), 0.068, 0.042, 0.022),
            ]
        )
    )
    build.add(
        _loft(
            [
                (0.030, (-A3 * 0.9, 0.0), 0.066, 0.040, 0.024),
                (FOREARM_END - 0.02, (0.0, 0.0), 0.043, 0.038, 0.030),
                (FOREARM_END - 0.008, (0.0, 0.0), 0.036, 0.034, 0.030),
            ]
        )
    )
    build.add(_drum(0.058, -0.046, 0.046, at=(-A3, 0, 0), axis="y", edge=0.004), CREAM)
    build.add(_drum(0.040, 0.040, 0.052, at=(-A3, 0, 0), axis="y", edge=0.004), DARK)
    build.add(_loft([(z, (-A3, 0.0), 0.040, 0.030, 0.012) for z in (-0.142, -0.120)]), DARK)
    build.add(_drum(0.037, FOREARM_END - 0.02, FOREARM_END, edge=0.002), BLUE)
    return build.shape()


def _wrist_fork() -> LinkShape:
    """Build link 4: y4 along the forearm, z4 the axis of joint 5, from the wrist centre."""
    build = _Builder("wrist fork", CREAM)
    start = FOREARM_END - D4
    build.add(_lathe([(0.034, start - 0.006), (0.039, start + 0.004), (0.041, -0.046), (0.036, -0.042)], axis="y"))
    for side in (-1, 1):
        low, high = sorted((side * 0.0265, side * 0.0415))
        build.add(_slab([(0.0, 0.0, 0.033), (0.0, -0.052, 0.027)], low, high, edge=0.003))
        cap = sorted((side * 0.038, side * 0.0455))
        build.add(_drum(0.022, cap[0], cap[1], edge=0.002), DARK)
    return build.shape()


def _wrist_ball() -> LinkShape:
    """Build link 5: z5 towards the flange, y5 the axis of joint 5."""
    import trimesh

    build = _Builder("wrist ball", STEEL)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.0335).vertices.copy()
    ball[:, 1] = np.clip(ball[:, 1], -0.0260, 0.0260)
    build.add(_hull(ball))
    build.add(_drum(0.015, -0.032, 0.032, axis="y", edge=0.001), DARK)
    build.add(_drum(0.024, 0.010, FLANGE - 0.011, edge=0.002), STEEL)
    return build.shape()


def _flange() -> LinkShape:
    """Build link 6: the mounting flange, its face at z6 = FLANGE, with a blue mark on its x6 side."""
    build = _Builder("flange", DARK)
    build.add(_drum(0.0315, FLANGE - 0.014, FLANGE, edge=0.0015))
    for k in range(4):
        angle = (k + 0.5) * math.pi / 2
        at = (0.022 * math.cos(angle), 0.022 * math.sin(angle), FLANGE)
        build.add(_lathe([(0.0032, -0.004), (0.0032, 0.002)], at=at, n=12), STEEL)
    build.add(_loft([(z, (0.030, 0.0), 0.0045, 0.004, 0.001) for z in (FLANGE - 0.012, FLANGE + 0.001)]), BLUE)
    return build.shape()


@lru_cache(maxsize=1)
def shapes() -> tuple[LinkShape, ...]:
    """Build the pedestal and the six links, (7,), in the order and frames of `model().links(q)`.

    Lengths come from θ, the rest is drawn after Unimation's arm.
    """
    return (_pedestal(), _shoulder(), _upper_arm(), _forearm(), _wrist_fork(), _wrist_ball(), _flange())
