"""The PUMA 560 as a value."""

from __future__ import annotations

from functools import partial
from typing import Final

from numpy.typing import ArrayLike

from robots.puma560.arm import model
from robots.puma560.body import RealArm
from robots.puma560.parameters import FLANGE
from robots.puma560.shapes import shapes
from robots.robot import Appearance, Fingers, Gripper, Robot
from robots.simulated import WORLDS, Reality


def _body(world: str, q: ArrayLike, *, friction: bool = True, dt: float = 1e-3) -> RealArm:
    """Make its body; see `robots.robot.ArmMaker`."""
    return RealArm(Reality(friction=friction, dt=dt), q, world=world)


HAND: Final = Gripper(
    (0.0, 0.0, FLANGE),
    Fingers(stroke=0.1, force=40.0, speed=0.5, thickness=0.012, width=0.025, length=0.08),
)
"""At the flange; its sizes are ours: the arm came with many a hand."""
ROBOT: Final = Robot(
    "puma560",
    model(),
    Appearance(shapes, model().links),
    {world: partial(_body, world) for world in WORLDS},
    (HAND,),
)
"""The arm with its hand."""
