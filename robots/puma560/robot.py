"""The PUMA 560 as a value."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Final

from numpy.typing import ArrayLike

from robots.bullet.serial_arm import Reality
from robots.puma560.arm import model
from robots.puma560.body import RealArm
from robots.puma560.parameters import FLANGE
from robots.puma560.shapes import shapes
from robots.robot import Appearance, ArmBody, Gripper, Robot


def bullet(q: ArrayLike, *, friction: bool = True, dt: float = 1e-3) -> AbstractContextManager[ArmBody]:
    """Make its body in PyBullet; see `robots.robot.ArmMaker`."""
    return RealArm(Reality(friction=friction, dt=dt), q)


ROBOT: Final = Robot(
    "puma560", model(), Appearance(shapes, model().links), {"bullet": bullet}, (Gripper((0.0, 0.0, FLANGE)),)
)
"""The arm with a hand at its flange."""
