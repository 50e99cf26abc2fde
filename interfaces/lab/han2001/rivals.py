"""What stands in the place of an architecture's mechanism, to see whether that is what does it."""

from __future__ import annotations

from typing_extensions import override

from interfaces.teleop.architectures import TimelineController
from interfaces.teleop.architectures.compositions import Constants
from robots.onboard.driving import Drive, Posture


class OpenLoop(TimelineController):
    """`timeline` without its tracker: the operator's speeds are played D behind him, wherever the robot is."""

    def __init__(self, _constants: Constants, posture: Posture) -> None:
        """Begin where the operator's path does."""
        super().__init__(posture, now=0.0)

    @override
    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Play on."""
        super().control(self.reference.posture, now=now, v_before=v_before)
        return self.reference.drive
