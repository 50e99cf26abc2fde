"""What the virtual hand does with things: they're where they were measured, but for one that it has closed on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from robots.bullet.grasping import moving
from robots.robot import Fingers, Gripper
from robots.things import Scene, ThingPose, pose_matrix
from vrs.model import Array
from vrs.scheduler import HandGoal

_LOOSE = 1e-4
"""A hand that's wider open than what it holds by this [m] lets go."""


class Hands(NamedTuple):
    """Both hands, and the things, as they're drawn."""

    virtual: float
    """Opening of the virtual hand [m]."""
    real: float | None = None
    """Of the real one [m]; None where it isn't measured."""
    poses: Mapping[int, ThingPose] = {}
    """Where things were measured, by number."""
    predicted: tuple[int, Array] | None = None
    """Which of them the virtual hand has taken along, and where to, (4, 4); None for none."""


@dataclass(slots=True)
class PredictedGrasp:
    """Follows a virtual hand; whoever draws it tells where it is, in the order of time."""

    gripper: Gripper
    """It has fingers."""
    scene: Scene = field(default_factory=lambda: Scene(0.0))
    _held: tuple[int, Array] | None = None
    """What it holds, and where that is in the hand's frame, (4, 4)."""

    @property
    def fingers(self) -> Fingers:
        """The hand's."""
        assert self.gripper.fingers is not None
        return self.gripper.fingers

    def advance(
        self, X: Array, goals: Sequence[HandGoal], poses: Mapping[int, ThingPose], *, now: float
    ) -> tuple[float, tuple[int, Array] | None]:
        """See what the hand does.

        Args:
            X: Pose of the last link, (4, 4).
            goals: What the hand was told, by time.
            poses: Where things were measured.
            now: [s].

        Returns:
            Its opening [m]; and which thing it has taken along, and where to, (4, 4), None for none.
        """
        fingers = self.fingers
        opening = fingers.opening(goals, now)
        hand = X @ self.gripper.X_LH
        things = moving(self.scene)
        if self._held is not None and self._held[0] < len(things):
            k, place = self._held
            width = 2.0 * things[k].reach(place[0, :3])
            if opening <= width + _LOOSE:
                return width, (k, hand @ place)
        self._held = None
        closes = bool(goals) and fingers.goal(goals, now) < opening + _LOOSE < fingers.stroke
        for k, thing in enumerate(things) if closes else ():
            if k in poses:
                place = np.linalg.inv(hand) @ pose_matrix(poses[k])
                x, y, z = np.abs(place[:3, 3]) - [thing.reach(place[row, :3]) for row in range(3)]
                width = 2.0 * thing.reach(place[0, :3])
                between = x < 0.0 and y < fingers.width / 2 and z < fingers.length and place[2, 3] > 0.0
                if between and opening <= width + _LOOSE:
                    self._held = k, place
                    return width, (k, hand @ place)
        return opening, None
