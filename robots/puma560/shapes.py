"""What the PUMA 560 looks like: a pedestal and six links, built from θ with trimesh.

Every link is a union of overlapping convex or lathed closed bodies in its Denavit-Hartenberg frame. Along the
shoulder axis, counted from the waist, stand the shoulder drum, the forearm around D3, and the upper arm
outside it, as on Unimation's arm, so that the forearm folds past the upper arm.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np

from robots.puma560.parameters import A2, A3, D3, D4, FLANGE, PEDESTAL
from robots.solids import Builder, LinkShape, drum, hull, lathe, loft, slab

CREAM: Final = (0.90, 0.88, 0.80)
STEEL: Final = (0.62, 0.64, 0.67)
DARK: Final = (0.16, 0.18, 0.21)
BLUE: Final = (0.10, 0.25, 0.47)

NECK: Final = -0.20
"""Height where the pedestal ends and the turning shoulder begins, base frame [m]."""
UPPER_ARM_INNER: Final = D3 + 0.048
"""Inner face of the upper arm, along the shoulder axis from the waist axis [m]."""
UPPER_ARM_OUTER: Final = UPPER_ARM_INNER + 0.098
"""Outer face of the upper arm [m]."""
FOREARM_END: Final = D4 - 0.088
"""Where the forearm ends and the wrist's roll begins, along z of frame 3 [m]."""


def _pedestal() -> LinkShape:
    """Build the fixed column: base frame, z up from the shoulder."""
    floor = -PEDESTAL
    build = Builder("pedestal", CREAM)
    build.add(drum(0.185, floor, floor + 0.022, edge=0.004), DARK)
    build.add(lathe([(0.135, floor + 0.015), (0.135, floor + 0.045), (0.105, floor + 0.075), (0.105, NECK - 0.02)]))
    for k in range(8):
        angle = (k + 0.5) * math.pi / 4
        at = (0.162 * math.cos(angle), 0.162 * math.sin(angle), floor)
        build.add(lathe([(0.009, 0.018), (0.009, 0.030)], at=at, n=6), STEEL)
    build.add(drum(0.108, floor + 0.130, floor + 0.160, edge=0.002), BLUE)
    build.add(loft([(z, (-0.112, 0.0), 0.032, 0.062, 0.018) for z in (floor + 0.20, floor + 0.40)]))
    build.add(drum(0.112, NECK - 0.035, NECK, edge=0.003), DARK)
    return build.shape()


def _shoulder() -> LinkShape:
    """Build link 1: y1 points up, z1 along the shoulder axis, both from the shoulder."""
    build = Builder("shoulder", CREAM)
    build.add(lathe([(0.102, NECK - 0.01), (0.105, NECK + 0.004), (0.105, -0.115), (0.092, -0.04)], axis="y"))
    # The housing broadens from the neck to the drum.
    angle = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)
    ring = np.column_stack([0.100 * np.cos(angle), np.full(48, -0.135), 0.100 * np.sin(angle)])
    cradle = np.array([[x, y, z] for x in (-0.098, 0.098) for y in (-0.045, 0.02) for z in (-0.10, 0.13)])
    build.add(hull(np.concatenate([ring, cradle])))
    build.add(lathe([(0.085, -0.140), (0.108, -0.122), (0.115, -0.105), (0.115, 0.160), (0.108, 0.168)]))
    build.add(drum(0.060, -0.150, -0.120, edge=0.006), BLUE)
    build.add(drum(0.092, 0.150, UPPER_ARM_INNER - 0.006, edge=0.002), DARK)
    return build.shape()


def _upper_arm() -> LinkShape:
    """Build link 2: x2 from the shoulder, at x = −A2, to the elbow at the origin; z2 the joint axes."""
    low, high = UPPER_ARM_INNER, UPPER_ARM_OUTER
    build = Builder("upper arm", CREAM)
    body = [(-A2 - 0.120, 0.0, 0.082), (-A2, 0.0, 0.118), (0.0, 0.0, 0.070)]
    build.add(slab(body, low, high, edge=0.010))
    build.add(drum(0.086, low - 0.024, low + 0.02, at=(-A2, 0, 0), edge=0.002), STEEL)
    # Covers of the two motors in the tail, and of the shoulder and elbow gears.
    cover = [(-A2 - 0.112, 0.0, 0.058), (-A2 - 0.02, 0.0, 0.080)]
    build.add(slab(cover, high - 0.01, high + 0.016, edge=0.008))
    build.add(drum(0.060, high, high + 0.030, at=(-A2, 0, 0), edge=0.008), DARK)
    build.add(drum(0.046, high - 0.01, high + 0.012, edge=0.006), DARK)
    stripe = [(-A2 + 0.135, 0.0, 0.012), (-0.085, 0.0, 0.012)]
    build.add(slab(stripe, high - 0.006, high + 0.003, edge=0.001), BLUE)
    build.add(drum(0.050, D3 + 0.020, low + 0.02, edge=0.002), STEEL)
    return build.shape()


def _forearm() -> LinkShape:
    """Build link 3: z3 along the forearm, the elbow's axis parallel to y3 through x = −A3."""
    build = Builder("forearm", CREAM)
    build.add(
        loft(
            [
                (-0.128, (-A3, 0.0), 0.048, 0.034, 0.014),
                (-0.112, (-A3, 0.0), 0.060, 0.042, 0.016),
                (0.020, (-A3, 0.0), 0.074, 0.042, 0.020),
                (0.070, (-A3 * 0.8, 0.0), 0.068, 0.042, 0.022),
            ]
        )
    )
    build.add(
        loft(
            [
                (0.030, (-A3 * 0.9, 0.0), 0.066, 0.040, 0.024),
                (FOREARM_END - 0.02, (0.0, 0.0), 0.043, 0.038, 0.030),
                (FOREARM_END - 0.008, (0.0, 0.0), 0.036, 0.034, 0.030),
            ]
        )
    )
    build.add(drum(0.058, -0.046, 0.046, at=(-A3, 0, 0), axis="y", edge=0.004), CREAM)
    build.add(drum(0.040, 0.040, 0.052, at=(-A3, 0, 0), axis="y", edge=0.004), DARK)
    build.add(loft([(z, (-A3, 0.0), 0.040, 0.030, 0.012) for z in (-0.142, -0.120)]), DARK)
    build.add(drum(0.037, FOREARM_END - 0.02, FOREARM_END, edge=0.002), BLUE)
    return build.shape()


def _wrist_fork() -> LinkShape:
    """Build link 4: y4 along the forearm, z4 the axis of joint 5, from the wrist centre."""
    build = Builder("wrist fork", CREAM)
    start = FOREARM_END - D4
    build.add(lathe([(0.034, start - 0.006), (0.039, start + 0.004), (0.041, -0.046), (0.036, -0.042)], axis="y"))
    for side in (-1, 1):
        low, high = sorted((side * 0.0265, side * 0.0415))
        build.add(slab([(0.0, 0.0, 0.033), (0.0, -0.052, 0.027)], low, high, edge=0.003))
        cap = sorted((side * 0.038, side * 0.0455))
        build.add(drum(0.022, cap[0], cap[1], edge=0.002), DARK)
    return build.shape()


def _wrist_ball() -> LinkShape:
    """Build link 5: z5 towards the flange, y5 the axis of joint 5."""
    import trimesh

    build = Builder("wrist ball", STEEL)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.0335).vertices.copy()
    ball[:, 1] = np.clip(ball[:, 1], -0.0260, 0.0260)
    build.add(hull(ball))
    build.add(drum(0.015, -0.032, 0.032, axis="y", edge=0.001), DARK)
    build.add(drum(0.024, 0.010, FLANGE - 0.011, edge=0.002), STEEL)
    return build.shape()


def _flange() -> LinkShape:
    """Build link 6: the mounting flange, its face at z6 = FLANGE, with a blue mark on its x6 side."""
    build = Builder("flange", DARK)
    build.add(drum(0.0315, FLANGE - 0.014, FLANGE, edge=0.0015))
    for k in range(4):
        angle = (k + 0.5) * math.pi / 2
        at = (0.022 * math.cos(angle), 0.022 * math.sin(angle), FLANGE)
        build.add(lathe([(0.0032, -0.004), (0.0032, 0.002)], at=at, n=12), STEEL)
    build.add(loft([(z, (0.030, 0.0), 0.0045, 0.004, 0.001) for z in (FLANGE - 0.012, FLANGE + 0.001)]), BLUE)
    return build.shape()


@lru_cache(maxsize=1)
def shapes() -> tuple[LinkShape, ...]:
    """Build the pedestal and the six links, (7,), in the order and frames of `model().links(q)`.

    Lengths come from θ, the rest is drawn after Unimation's arm.
    """
    return (_pedestal(), _shoulder(), _upper_arm(), _forearm(), _wrist_fork(), _wrist_ball(), _flange())
