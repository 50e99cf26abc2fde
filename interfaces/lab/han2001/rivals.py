"""What stands in the place of an architecture's mechanism, to see whether that is what does it."""

from __future__ import annotations

from collections.abc import Sequence

from typing_extensions import override

from interfaces.messages.sites import ArcPacket
from interfaces.teleop.architectures import FollowingController, TimelineController
from interfaces.teleop.architectures.compositions import CONTROL, Constants
from interfaces.teleop.robot import AdaptiveOffset, OffsetConfig
from robots.onboard.driving import STAND, Drive, Posture
from robots.onboard.path_following import FieldLaw
from vrs.mobile.model import advanced
from vrs.segment import ArcSegment


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


class Patient(TimelineController):
    """`timeline` that waits for all packets but one in ten thousand, and never has to catch up."""

    def __init__(self, _constants: Constants, posture: Posture) -> None:
        """Begin where the operator's path does."""
        super().__init__(posture, now=0.0)
        self._offset = AdaptiveOffset(OffsetConfig(share=0.9999))


class _Third(FollowingController):
    """Architecture III, to be made otherwise."""

    def __init__(self, constants: Constants, posture: Posture) -> None:
        """Begin a path."""
        super().__init__(posture, FieldLaw.LITERAL, constants.following, processing=constants.processing)


class Unqueued(_Third):
    """III without a command queue: of commands that come together all but the last are lost, as under I."""

    _newest: ArcSegment | None = None

    @override
    def receive(self, arcs: Sequence[ArcSegment], packet: ArcPacket, *, now: float) -> None:
        """Keep the newest command."""
        self._newest = arcs[-1] if arcs else self._newest

    @override
    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Lengthen the path by it, and follow that."""
        if self._newest is not None:
            super().receive((self._newest,), ArcPacket(), now=now)
            self._newest = None
        return super().control(posture, now=now, v_before=v_before)


class Blind(_Third):
    """III without the robot's posture: it follows the path as if the robot were where its speeds should lead."""

    _told = STAND
    _reckoned: Posture | None = None

    @override
    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Follow the path from where the robot should be."""
        before = posture if self._reckoned is None else self._reckoned
        self._reckoned = Posture(*advanced(before, v_before, self._told.w, CONTROL))
        self._told = super().control(self._reckoned, now=now, v_before=v_before)
        return self._told
