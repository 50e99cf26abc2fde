"""What VAL-II's numbers mean on an arm: world, hand, zeros of joints, READY and NEST, words of configurations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from interfaces.val2.values import PrecisionPoint, Transformation
from robots.puma560 import Puma560, parameters
from robots.robot import Robot
from vrs.model import Array, Limits, frozen_array, home


@dataclass(frozen=True, slots=True, eq=False)
class ArmConventions:
    """How VAL-II speaks of an arm of six joints that turn."""

    X_BW: Array
    """VAL's world in the arm's base frame: a turn, (4, 4)."""
    X_LH: Array
    """Its hand in the last link's frame: a turn, (4, 4)."""
    flange: Array
    """Where its hand is, from the last link's origin along the hand's axes [mm], (3,)."""
    offsets: tuple[float, ...]
    """VAL's joint values less the model's [deg]."""
    ready: PrecisionPoint
    nest: PrecisionPoint
    words: tuple[tuple[str, str], ...] = ()
    """Pairs of words of its configurations; none where it has no names of them."""
    names: tuple[str, ...] = ()
    """Of its joints, where they have any beside their numbers."""

    def point(self, q: Array, limits: Limits) -> PrecisionPoint:
        """VAL's joint values [deg] of joints [rad], (6,), on the turn on which they stand within the limits."""
        turned = zip(np.degrees(q).tolist(), self._shifts(limits), strict=True)
        return PrecisionPoint(tuple(value + offset - turn for value, (offset, turn) in turned))

    def joints(self, point: PrecisionPoint, limits: Limits) -> Array:
        """Joints [rad], (6,), of VAL's joint values [deg]; within the limits or not."""
        turned = zip(point.joints, self._shifts(limits), strict=True)
        return np.array([math.radians(value - offset + turn) for value, (offset, turn) in turned])

    def _shifts(self, limits: Limits) -> list[tuple[float, float]]:
        """Of each joint what VAL's value is more than the model's, and a turn that it's less by [deg]."""
        lows = np.degrees(limits.q_min).tolist()
        return [
            (offset, 360.0 if offset and low + offset > 0.0 else 0.0)
            for low, offset in zip(lows, self.offsets, strict=True)
        ]

    def flange_at(self, X: Array) -> Transformation:
        """The hand in VAL's world, of the pose of the last link in the base frame, (4, 4) [m]."""
        pose = self.X_BW.T @ X @ self.X_LH
        pose[:3, 3] *= 1000.0
        pose[:3, 3] += pose[:3, :3] @ self.flange
        return Transformation(pose)

    def link_at(self, flange: Transformation) -> Array:
        """The pose of the last link in the base frame, (4, 4) [m], of the hand in VAL's world."""
        pose = np.array(flange.X)
        pose[:3, 3] -= pose[:3, :3] @ self.flange
        pose[:3, 3] /= 1000.0
        X: Array = self.X_BW @ pose @ self.X_LH.T
        return X

    def tip(self, tool: Transformation) -> Array:
        """A tool's tip in the frame of the last link, (4, 4) [m]."""
        X = np.eye(4)
        X[:3, :3] = self.X_LH[:3, :3] @ tool.X[:3, :3]
        X[:3, 3] = self.X_LH[:3, :3] @ (tool.X[:3, 3] + self.flange) / 1000.0
        return X


WORDS: Final = (("RIGHTY", "LEFTY"), ("ABOVE", "BELOW"), ("FLIP", "NOFLIP"))
_HALF_TURN: Final = frozen_array(np.diag([-1.0, -1.0, 1.0, 1.0]))
PUMA: Final = ArmConventions(
    X_BW=_HALF_TURN,
    X_LH=_HALF_TURN,
    flange=frozen_array([0.0, 0.0, 1000.0 * parameters.FLANGE]),
    offsets=(0.0, 180.0, 180.0, 0.0, 0.0, 0.0),
    ready=PrecisionPoint((0.0, -90.0, 90.0, 0.0, 0.0, 0.0)),
    nest=PrecisionPoint((0.0, -135.0, 180.0, 0.0, 45.0, 0.0)),
    words=WORDS,
)
"""The PUMA 560's: the base frame turned by 180 degrees about the waist, the last link by as much about its own axis
and at the flange, Lee's joints against the Robotics Toolbox's. NEST is ours: the arm folded over its shoulder."""


def conventions_of(robot: Robot) -> ArmConventions:
    """Those of an arm of six joints that turn.

    But for the PUMA's own they're those of its description: the world is its base frame, joints are as they're
    described, the hand has the axes of the last link and is where a gripper holds. READY is its pose `ready`, or
    where it stands at first; NEST its pose `nest`, or READY. It has no words of configurations.
    """
    if isinstance(robot.model, Puma560):
        return PUMA
    poses, eye = robot.arm.poses, frozen_array(np.eye(4))
    ready = poses.get("ready", home(robot.arm))
    nest = poses.get("nest", ready)
    flange = frozen_array(1000.0 * np.asarray(robot.tool))
    return ArmConventions(
        eye, eye, flange, (0.0,) * robot.arm.limits.dof, _degrees(ready), _degrees(nest), names=robot.joints
    )


def _degrees(q: Array) -> PrecisionPoint:
    return PrecisionPoint(tuple(np.degrees(q).tolist()))
