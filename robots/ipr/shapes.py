"""What the IPR and the micro-robot look like: five closed shapes each, in the order and frames of `links`."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from robots.ipr.model import IPR_AXLE_OFFSET
from robots.ipr.parameters import IPR, MICRO
from robots.mobile.chassis import Chassis
from robots.mobile.shapes import (
    BLUE,
    BOARD,
    DARK,
    GLASS,
    NEW,
    SCREEN,
    STEEL,
    WHITE,
    add_sonars,
    box,
    on_wheels,
    rounded,
)
from robots.solids import Builder, LinkShape, drum, lathe, loft
from vrs.model import Array

NECK: Final = (-IPR_AXLE_OFFSET - 0.03, 0.0, 0.712)
"""Where the axes of the IPR's head cross, in the robot's frame [m]: the head's middle."""
REACH: Final = 0.066
"""How far its camera's lens is before that [m]: as far as the head's glass."""
SCREEN_SIZE: Final = (0.224, 0.134)
"""Width and height of the IPR's display [m]; less than the paper's 12.1 inches, so that it fits the front."""


def _ipr_body(*, head: bool = True) -> LinkShape:
    """Build the 75 kg robot: skirt, housing with 16 sonars, sloping display, perhaps its head with two cameras."""
    body = IPR
    back, front = body.centre_x - body.length / 2, body.centre_x + body.length / 2
    half = body.width / 2
    build = Builder("body", WHITE)
    arch = body.wheel_base / 2 - body.wheel_width / 2 - 0.004
    build.add(rounded((back + 0.012, front - 0.012, -arch, arch), 0.050, 0.215, 0.03, 0.006), DARK)
    build.add(rounded((back, front, -half, half), 0.205, 0.385, 0.06, 0.008))
    build.add(rounded((back + 0.006, front - 0.006, -half + 0.006, half - 0.006), 0.380, 0.400, 0.055, 0.002), BLUE)
    build.add(rounded((back, front, -half, half), 0.395, 0.500, 0.06, 0.010))
    middle = body.centre_x
    build.add(
        loft(
            [
                (0.495, (middle, 0.0), 0.235, 0.200, 0.055),
                (0.560, (middle - 0.015, 0.0), 0.200, 0.185, 0.050),
                (0.640, (middle - 0.055, 0.0), 0.120, 0.160, 0.045),
                (0.648, (middle - 0.055, 0.0), 0.112, 0.152, 0.040),
            ]
        )
    )
    width, height = SCREEN_SIZE[0] / 2, SCREEN_SIZE[1] / 2
    screen = box((-0.006, -width - 0.013, -height - 0.013), (0.006, width + 0.013, height + 0.013))
    glass = box((0.005, -width, -height), (0.009, width, height))
    pose = screen_pose()
    for part, colour in ((screen, DARK), (glass, SCREEN)):
        part.apply_transform(pose)
        build.add(part, colour)
    build.add(lathe([(0.040, 0.640), (0.034, 0.675)], at=(middle - 0.03, 0, 0)), DARK)
    if head:
        _add_head(build, body, middle - 0.03)
    add_sonars(build, body, radius=0.020)
    return build.shape()


def screen_pose() -> Array:
    """Pose of the IPR's display in the robot's frame, (4, 4): x out of its leaning glass, y to its left."""
    X = np.eye(4)
    lean = np.array([[0.78, 0.0, -0.626], [0.0, 1.0, 0.0], [0.626, 0.0, 0.78]])
    X[:3, :3], X[:3, 3] = lean / np.linalg.norm(lean, axis=0), (IPR.centre_x + 0.150, 0.0, 0.601)
    return X


def _add_head(build: Builder, body: Chassis, x: float) -> None:
    """Set the head with its two cameras on the neck."""
    build.add(rounded((x - 0.050, x + 0.050, -0.105, 0.105), 0.670, body.height, 0.030, 0.008))
    for side in (-1, 1):
        eye = (x + 0.046, side * 0.058, 0.712)
        build.add(drum(0.024, 0.0, 0.016, at=eye, axis="x", edge=0.003), DARK)
        build.add(drum(0.015, 0.012, 0.020, at=eye, axis="x", edge=0.003), GLASS)


def headless() -> LinkShape:
    """Build the IPR's body without its head: what the camera in the head may see of it, in the robot's frame."""
    return _ipr_body(head=False)


def _micro_body() -> LinkShape:
    """Build the 430 g robot: a cube with boards, a battery and the coloured patch that the camera looks for."""
    side = MICRO.length / 2
    build = Builder("body", DARK)
    inner = MICRO.wheel_base / 2 - MICRO.wheel_width / 2 - 0.001
    build.add(rounded((-side, side, -inner, inner), MICRO.ground_clearance, 0.046, 0.004, 0.001), STEEL)
    build.add(
        rounded((-side + 0.002, side - 0.002, -side + 0.002, side - 0.002), 0.045, 0.050, 0.003, 0.001), BOARD
    )
    build.add(rounded((-0.025, 0.025, -0.025, 0.025), 0.049, 0.060, 0.003, 0.001), DARK)
    build.add(rounded((-side, side, -side, side), 0.059, MICRO.height - 0.0015, 0.004, 0.001), WHITE)
    build.add(rounded((-0.006, side - 0.004, -0.010, 0.010), 0.070, MICRO.height, 0.003, 0.0005), BLUE)
    build.add(rounded((-side + 0.004, -0.012, -0.028, 0.028), 0.070, MICRO.height, 0.003, 0.0005), NEW)
    for x in (-1, 1):
        for y in (-1, 1):
            build.add(drum(0.0025, 0.048, 0.062, at=(x * 0.029, y * 0.029, 0), edge=0.0003), STEEL)
    return build.shape()


@lru_cache(maxsize=1)
def ipr_shapes() -> tuple[LinkShape, ...]:
    """Build the IPR, in the order and frames of `links`."""
    return on_wheels(_ipr_body(), IPR)


@lru_cache(maxsize=1)
def micro_shapes() -> tuple[LinkShape, ...]:
    """Build the micro-robot, in the order and frames of `links`."""
    return on_wheels(_micro_body(), MICRO)
