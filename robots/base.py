"""What a mobile robot on two driven wheels is: its limits, wheels and footprint, as a value."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import cos, hypot, sin
from typing import Annotated, Final

import numpy as np

from robots.solids import Builder, LinkShape, hull
from vrs.checks import positive, validated
from vrs.mobile import DriveLimits, Wheels
from vrs.model import Array

PERIOD: Final = 0.1
"""T: time between a mobile robot's commands unless said otherwise [s], an assumption: Han, Kim, Kim, Kim, 2001 has
'every sampling time T' without a figure."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """A box on wheels; its reference point is the middle of the driving axle."""

    length: float
    """Along the direction of travel [m]."""
    width: float
    """Across it [m]."""
    height: float
    """[m]."""
    mass: float
    """[kg]."""
    axle_offset: float
    """How far the driving axle is ahead of the body's centre [m]."""

    @property
    def radius(self) -> float:
        """Of the circle about the reference point that holds the whole body [m]."""
        return hypot(0.5 * self.length + abs(self.axle_offset), 0.5 * self.width)


@dataclass(frozen=True, slots=True)
@validated
class MobileBase:
    """A mobile robot; satisfies `vrs.mobile.MobileModel`."""

    limits: DriveLimits
    wheels: Wheels
    body: Footprint
    period: Annotated[float, positive("positive seconds")]
    """T: time between commands [s], positive."""
    name: str

    @property
    def radius(self) -> float:
        """Of the circle about the reference point that holds the whole robot [m]."""
        return self.body.radius


def upright(x: float, y: float, angle: float) -> Array:
    """Return the pose of a frame on the floor at (x, y) [m] that is turned by an angle [rad], (4, 4)."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def box_shape(body: Footprint) -> LinkShape:
    """What a mobile robot without an appearance looks like: its box, with a notch of colour in front."""
    build = Builder("body", (0.78, 0.78, 0.76))
    front = body.length / 2 - body.axle_offset
    low = (front - body.length, -body.width / 2, 0.1 * body.height)
    high = (front, body.width / 2, body.height)
    build.add(hull(list(product(*zip(low, high, strict=True)))))
    nose = (0.9 * front, 0.2 * body.width, 1.02 * body.height)
    build.add(
        hull(list(product(*zip((0.6 * front, -nose[1], body.height), nose, strict=True)))), (0.12, 0.30, 0.55)
    )
    return build.shape()
