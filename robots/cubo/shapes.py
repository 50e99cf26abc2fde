"""What CUBO looks like: closed bodies, built with trimesh from its parameters.

Seven shapes in frames of their own: the body in the robot's frame (middle of the driving axle, on the floor, x
forward), the wheels about their middles, the caster about the floor point under it, arms and head about their
joints at angle 0.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from robots.cubo import parameters as p
from robots.mobile.shapes import DARK, GLASS, STEEL, WHITE, box, caster, links, rounded, wheel
from robots.robot import HeadCamera
from robots.solids import Builder, LinkShape, drum, loft, slab, together

ORANGE: Final = (0.93, 0.48, 0.16)
SCREEN: Final = (0.09, 0.16, 0.22)
LIGHT: Final = (0.55, 0.90, 0.95)


def _body() -> LinkShape:
    """Build the lower cube: skirt between the wheels, shell, belt, grille of the loudspeaker, two buttons."""
    middle, half_x = p.CUBO.centre_x, p.LENGTH / 2
    front = middle + half_x
    build = Builder("body", WHITE)
    inner = p.WHEEL_BASE / 2 - 0.013
    build.add(rounded((middle - half_x + 0.012, front - 0.014, -inner, inner), 0.012, 0.078, 0.016, 0.003), DARK)
    build.add(
        loft(
            [
                (0.070, (middle, 0.0), half_x - 0.008, 0.082, 0.030),
                (0.078, (middle, 0.0), half_x, 0.088, 0.034),
                (0.150, (middle, 0.0), half_x, 0.088, 0.034),
                (0.190, (middle, 0.0), half_x - 0.016, 0.078, 0.034),
                (0.197, (middle, 0.0), half_x - 0.026, 0.070, 0.030),
            ]
        )
    )
    build.add(rounded((middle - half_x + 0.001, front - 0.001, -0.087, 0.087), 0.069, 0.076, 0.032, 0.002), ORANGE)
    for row in range(4):
        for column in range(5):
            at = (front - 0.003, 0.012 * (column - 2), 0.098 + 0.012 * row)
            build.add(drum(0.0035, 0.0, 0.0036, at=at, axis="x", edge=0.0006), DARK)
    for side, colour in ((-1, ORANGE), (1, LIGHT)):
        at = (front - 0.007, side * 0.052, 0.116)
        build.add(drum(0.009, 0.0, 0.007, at=at, axis="x", edge=0.001), colour)
    build.add(drum(0.030, 0.190, 0.212, at=(*p.NECK[:2], 0.0), edge=0.002), STEEL)
    return build.shape()


def _arm(name: str, side: int) -> LinkShape:
    """Build an arm: shoulder, upper arm in the shell's colour, a round hand."""
    low, high = sorted((0.0, side * 0.010))
    build = Builder(name, WHITE)
    inside, outside = sorted((-side * 0.012, side * 0.010))
    build.add(drum(0.016, inside, outside, axis="y", edge=0.002), DARK)
    arm = slab([(0.0, 0.0, 0.015), (0.0, -0.062, 0.012)], -high, -low, edge=0.002)
    turned = np.eye(4)
    turned[:3, :3] = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    arm.apply_transform(turned)
    build.add(arm)
    near, far = sorted((-side * 0.005, side * 0.010))
    hand = drum(0.014, near, far, at=(0.0, 0.0, -0.066), axis="y", edge=0.003)
    build.add(hand, ORANGE)
    return build.shape()


def _head() -> LinkShape:
    """Build the head: a rounded box, the 3 inch screen with eyes and mouth, camera, microphone, wireless aerial."""
    top = p.HEIGHT - p.NECK[2]
    build = Builder("head", WHITE)
    build.add(
        loft(
            [
                (0.004, (-0.010, 0.0), 0.062, 0.068, 0.026),
                (0.012, (-0.010, 0.0), 0.074, 0.080, 0.030),
                (0.082, (-0.010, 0.0), 0.074, 0.080, 0.030),
                (0.096, (-0.012, 0.0), 0.062, 0.068, 0.026),
            ]
        )
    )
    face = 0.064
    build.add(box((face - 0.004, -0.046, 0.017), (face + 0.002, 0.046, 0.080)), DARK)
    build.add(box((face, -0.040, 0.021), (face + 0.003, 0.040, 0.067)), SCREEN)
    for side in (-1, 1):
        build.add(drum(0.0085, 0.0, 0.0042, at=(face, side * 0.019, 0.052), axis="x", edge=0.0008), LIGHT)
    build.add(box((face, -0.016, 0.030), (face + 0.0042, 0.016, 0.034)), LIGHT)
    build.add(drum(0.0055, 0.0, 0.006, at=(face, 0.0, 0.0735), axis="x", edge=0.001), GLASS)
    build.add(drum(0.0025, 0.0, 0.004, at=(face, 0.030, 0.0735), axis="x", edge=0.0005), STEEL)
    for side in (-1, 1):
        build.add(
            drum(0.013, 0.0, 0.009, at=(-0.012, side * 0.079, 0.048), axis="y" if side > 0 else "-y", edge=0.002),
            ORANGE,
        )
    build.add(drum(0.004, 0.090, top, at=(-0.045, 0.0, 0.0), edge=0.001), DARK)
    return build.shape()


@lru_cache(maxsize=1)
def shapes() -> tuple[LinkShape, ...]:
    """Build the robot: body, right wheel, left wheel, caster, right arm, left arm, head, as `links` has them."""
    return (
        _body(),
        wheel("right wheel", p.CUBO, -1),
        wheel("left wheel", p.CUBO, 1),
        caster("caster", p.CUBO),
        _arm("right arm", -1),
        _arm("left arm", 1),
        _head(),
    )


def headless() -> LinkShape:
    """Build the robot without its head: what the camera in the head may see of it, in the robot's frame."""
    return together(list(zip(shapes()[:-1], links(p.CUBO, (0.0, 0.0, 0.0)), strict=False)))


EYE: Final = HeadCamera((0.0, 0.0, p.NECK[2] + 0.0735), 0.072, headless)
"""Its camera; taken to tilt about the middle of the head at its own height, some cm above the head's axis."""
