"""What each architecture does with the operator's commands on board: five controllers with one interface.

Source: Han, Kim, Kim, Kim, 2001, section 3.1, for I, II and III; `TimelineController` is ours.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from typing_extensions import override

from interfaces.messages.sites import ArcPacket, arcs_of
from interfaces.teleop.architectures.sites import DriveController
from interfaces.teleop.robot import AdaptiveOffset, OffsetConfig
from robots.onboard.command_filter import CommandFilter, CommandFilterConfig
from robots.onboard.driving import STAND, Drive, Posture
from robots.onboard.path import MovingPath
from robots.onboard.path_following import FieldLaw, PathFollowingConfig, PathFollowingController
from robots.onboard.trajectory_tracking import Reference, TrajectoryTracker
from vrs.segment import ArcSegment

STARVED = 0.5
"""Architecture I holds a command until the next, but no longer than this [s]: the robot's watchdog."""
_OFFSET = OffsetConfig(share=0.6)
"""Of D, one set for every delay. What comes later than that share makes the robot slow down and catch up, but not
leave the path: so D needn't cover the longest delays."""
_ROUNDING = 1e-9
"""Times nearer than this [s] are one."""


class Immediate(DriveController):
    """Architecture I: what comes is driven at once. Of commands that come together all but the last are lost."""

    def __init__(self) -> None:
        """Stand until the first command."""
        self._drive, self._until = STAND, -math.inf
        self.executed = 0

    @override
    def receive(self, arcs: Sequence[ArcSegment], packet: ArcPacket, *, now: float) -> None:
        """Take the newest command."""
        if arcs:
            self._drive, self._until = Drive(arcs[-1].v, arcs[-1].w), now + STARVED
            self.executed += len(arcs)

    @override
    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Hold it until the next, for a while."""
        return self._drive if now < self._until - _ROUNDING else STAND


class Filtered(DriveController):
    """Architecture II: the command filter gives late commands back their spacing T, eq. (11)–(13)."""

    def __init__(self, period: float) -> None:
        """Take T [s]."""
        self._filter: CommandFilter[ArcSegment] = CommandFilter(CommandFilterConfig(period))
        self._drive, self._until = STAND, -math.inf
        self.executed = 0

    @override
    def receive(self, arcs: Sequence[ArcSegment], packet: ArcPacket, *, now: float) -> None:
        """Queue the commands."""
        for arc in arcs:
            self._filter.receive(arc, now=now)

    @override
    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Drive what the filter gave out last, for as long as the operator did."""
        for t, arc in self._filter.advance(now=now + _ROUNDING):
            self._drive, self._until = Drive(arc.v, arc.w), t + arc.duration
            self.executed += 1
        return self._drive if now < self._until - _ROUNDING else STAND


class FollowingController(DriveController):
    """Architecture III: the filter at T_p feeds the path generator; the uni-vector field follows the path."""

    def __init__(self, posture: Posture, law: FieldLaw, config: PathFollowingConfig, *, processing: float) -> None:
        """Begin a path.

        Args:
            posture: Where it begins.
            law: Eq. (14)–(15) literally, or capped.
            config: Of the field.
            processing: T_p, what one takes to become a piece of the path [s].
        """
        self._filter: CommandFilter[ArcSegment] = CommandFilter(CommandFilterConfig(processing))
        self._path = MovingPath(posture)
        self._controller = PathFollowingController(self._path, config, law=law)
        self._arrival = config.arrival
        self._ends: deque[float] = deque()
        """Where on the path each command ends [m], of those that aren't executed."""
        self.executed = 0

    @override
    def receive(self, arcs: Sequence[ArcSegment], packet: ArcPacket, *, now: float) -> None:
        """Queue the commands."""
        for arc in arcs:
            self._filter.receive(arc, now=now)

    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Lengthen the path, and follow it."""
        for _, arc in self._filter.advance(now=now + _ROUNDING):
            self._path.drive(arc.v, arc.w, duration=arc.duration)
            self._ends.append(self._path.length)
        drive = self._controller.control(posture, v_before=v_before)
        place = self._controller.projection
        # The last piece is left where the controller takes it as driven.
        while place is not None and self._ends and self._ends[0] <= place.s + self._arrival:
            self._ends.popleft()
            self.executed += 1
        return drive

    def aim(self) -> tuple[float, float, tuple[float, float] | None]:
        """Tell where it wanted to get at the last call.

        Returns:
            Where the field pointed [rad]; the way on the known path to where the robot is to stand [m]; and where
            on the path it should be [m], None before the first call.
        """
        place = self._controller.projection
        if place is None:
            return self._controller.direction, 0.0, None
        return self._controller.direction, place.to_stop, (place.x, place.y)


class TimelineController:
    """Architecture `timeline`: plays the operator's path D behind him, D adaptive, and tracks it."""

    def __init__(self, posture: Posture, *, now: float) -> None:
        """Begin where the operator's path does, by the robot's clock at `now` [s]."""
        self._tracker = TrajectoryTracker(posture, 0.0, now=now)
        self._offset = AdaptiveOffset(_OFFSET)
        self.D: float | None = None
        """How far behind the robot's clock it plays, D ≤ 0 [s]; None before the first packet."""
        self._ends: deque[float] = deque()
        """When each command ends [s], of those that aren't executed."""
        self.executed = 0

    @property
    def reference(self) -> Reference:
        """What it aimed at last."""
        return self._tracker.reference

    def receive(self, arcs: Sequence[ArcSegment], packet: ArcPacket, *, now: float) -> None:
        """Lengthen the known path, and learn how late it is."""
        self._offset.heard(self._tracker.complete_until, now=now)
        self.D = self._offset.D
        if arcs:
            known = arcs[-1].end
            tail = arcs_of(packet.tail) if abs(known - packet.complete_until) < _ROUNDING else ()
            self._tracker.receive((*arcs, *tail), complete_until=known)
            self._ends.extend(arc.end for arc in arcs)

    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Play on."""
        if self.D is not None:
            self._tracker.aim(self.D - self._tracker.reserve)
        drive = self._tracker.advance(posture, now=now, v_before=v_before)
        while self._ends and self._ends[0] <= self._tracker.reference.t_play + _ROUNDING:
            self._ends.popleft()
            self.executed += 1
        return drive
