"""A live mobile robot: how it's set up, what is around it, and where it drives by itself."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from interfaces.messages.fields import text
from interfaces.messages.jobs import Doing
from interfaces.messages.recording import (
    OWN,
    DriveFacts,
    EstimatedPosture,
    RoomEntry,
    grid_facts,
    room_entry,
)
from interfaces.recording.capture import Capture
from interfaces.recording.history import placed
from interfaces.teleop import OperatorSite
from interfaces.teleop.virtual_base import VirtualBase
from robots.rooms import EMPTY, Room
from vrs.clock import ManualClock
from vrs.mobile import wrapped

LEARNED = 0.5
"""How often the virtual environment is looked at [s]."""
STEPS = 0.05, 0.1
"""A robot that drives by itself has the virtual one with it, in steps of so much [m, rad]."""
_SHIFTED = 0.05
"""A room's clock that has gone otherwise by so much [s] is noted anew."""


class LiveDrives:
    """Tells a capture what there is of a virtual base besides its commands."""

    def __init__(self, operator: OperatorSite[VirtualBase], room: Room | None, *, now: float) -> None:
        """Begin with a site.

        Args:
            operator: The site.
            room: Where the robot drives; None where that isn't known.
            now: Session time [s].
        """
        self._operator, self._newest = operator, operator.robot.engine.newest
        self._room = None if room is None or room is EMPTY else room_entry(room)
        self._shift = self._shift_told = 0.0
        """The session's time less the room's [s]."""
        self._due = now

    def facts(self, robot: str, architecture: str) -> DriveFacts:
        """How it's set up.

        Args:
            robot: Its name.
            architecture: By its name.
        """
        around = self._operator.robot.architecture.surroundings
        return DriveFacts(
            body=robot,
            architecture=text(architecture),
            transport="datagrams",
            operator="live",
            period=self._operator.robot.period,
            position=OWN,
            grid=None if around is None else grid_facts(around.environment.grid),
            newest=self._newest,
        )

    def rooms(self) -> tuple[RoomEntry, ...]:
        """The room, its people and doors by the session's clock as far as it's known; none where there's none."""
        self._shift_told = self._shift
        return () if self._room is None else (_shifted(self._room, self._shift),)

    def follow(self, capture: Capture, *, now: float) -> None:
        """Tell what is so now [s]."""
        robot, report = self._operator.robot, self._operator.report
        if report is None:
            return
        if report.world is not None:
            self._shift = report.measured_at - report.world
        if abs(self._shift - self._shift_told) > _SHIFTED:
            for entry in self.rooms():
                capture.add(now, entry)
        if report.doing is not Doing.NOTHING and robot.stands:
            x, y, theta = np.subtract(report.posture, capture.engine.timeline.sample(now)).tolist()
            if math.hypot(x, y) > STEPS[0] or abs(wrapped(theta)) > STEPS[1]:
                capture.place(placed(capture.engine, report.posture, ManualClock(now)), now, along=True)
        capture.add(now, EstimatedPosture(now, *robot.architecture.estimator.posture.tolist()))
        around = robot.architecture.surroundings
        if around is not None and now >= self._due:
            self._due = now + LEARNED
            capture.learn(now, around.environment.obstacles(robot.surrounded_at(now)))


def _shifted(room: RoomEntry, by: float) -> RoomEntry:
    """A room whose people, doors and things keep their times later by so much [s]."""

    def later(t: float | None) -> float | None:
        return None if t is None else t + by

    return replace(
        room,
        things=tuple(replace(one, start=later(one.start), end=later(one.end)) for one in room.things),
        people=tuple(replace(one, times=tuple(t + by for t in one.times)) for one in room.people),
        doors=tuple(replace(one, times=tuple(t + by for t in one.times)) for one in room.doors),
    )
