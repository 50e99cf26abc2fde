"""CUBO as a value."""

from __future__ import annotations

from functools import partial
from typing import Final

from robots.base import PERIOD, Footprint, MobileBase
from robots.cubo.body import MOVES, CuboBody
from robots.cubo.parameters import CUBO, LIMITS, MASS, MODEL_FILE, WHEEL_BASE, WHEEL_RADIUS
from robots.cubo.shapes import EYE, shapes
from robots.mobile.shapes import links
from robots.robot import Appearance, Robot, ThinClient
from robots.simulated import WORLDS
from vrs.mobile import Wheels

ROBOT: Final = Robot(
    "cubo",
    MobileBase(
        LIMITS,
        Wheels(WHEEL_BASE, WHEEL_RADIUS),
        Footprint(CUBO.length, CUBO.width, CUBO.height, MASS, -CUBO.centre_x),
        PERIOD,
        "cubo",
    ),
    Appearance(shapes, partial(links, CUBO)),
    {world: partial(CuboBody, world=world) for world in WORLDS},
    (ThinClient(MODEL_FILE, MOVES), EYE),
)
"""The thin client: it plans nothing, RSP drives it."""
