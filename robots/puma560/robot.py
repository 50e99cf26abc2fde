"""The PUMA 560 as a value."""

from __future__ import annotations

from functools import partial
from typing import Final

from numpy.typing import ArrayLike

from robots.puma560.arm import model
from robots.puma560.body import RealArm
from robots.puma560.parameters import FLANGE
from robots.puma560.shapes import shapes
from robots.robot import Appearance, Gripper, Robot
from robots.simulated import WORLDS, Reality


def _body(world: str, q: ArrayLike, *, friction: bool = True, dt: float = 1e-3) -> RealArm:
    """Make its body; see `robots.robot.ArmMaker`."""
    return RealArm(Reality(friction=friction, dt=dt), q, world=world)


ROBOT: Final = Robot(
    "puma560",
    model(),
    Appearance(shapes, model().links),
    {world: partial(_body, world) for world in WORLDS},
    (Gripper((0.0, 0.0, FLANGE)),),
)
"""The arm with a hand at its flange."""
