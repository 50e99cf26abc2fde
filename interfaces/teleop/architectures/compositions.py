"""The architectures by name, with one set of constants for every network, and what they take from a real robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np

from interfaces.system import checked, is_own, own
from interfaces.teleop.architectures.controllers import (
    Filtered,
    FollowingController,
    Immediate,
    TimelineController,
)
from interfaces.teleop.architectures.sites import DriveController
from interfaces.teleop.architectures.surroundings import OperatorSurroundings, RobotSurroundings
from robots.base import MobileBase
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.navigation import mounts_of, outline_of
from robots.mobile.position import FusedPosition, LaserPosition, OdometryPosition, TruePosition
from robots.mobile.robot import MobileRobot
from robots.onboard.avoidance import AvoidanceConfig, ObstacleAvoidance
from robots.onboard.driving import Posture
from robots.onboard.following import PositionSource
from robots.onboard.movers import MoversConfig, MoverTracker, Yielding, YieldingConfig
from robots.onboard.path_following import FieldLaw, PathFollowingConfig
from robots.onboard.supervisor import EnvironmentSupervisor, SupervisorConfig
from robots.rooms import EMPTY, Room
from vrs.checks import number_in, one_of, validated, within
from vrs.mobile import Avoidance, Grid, VirtualEnvironment


@dataclass(frozen=True, slots=True)
@validated
class Constants:
    """Of all architectures; none is chosen by the network."""

    period: Annotated[float, within(0.01, 1.0, "s")] = 0.1
    """T: between the operator's commands [s]."""
    processing: float = 0.01
    """T_p: to make a piece of the path of one command [s], shorter than T."""
    following: PathFollowingConfig = field(default_factory=PathFollowingConfig)
    """Of the uni-vector field, III."""

    def __post_init__(self) -> None:
        number_in("processing", self.processing, 1e-4, self.period, unit=" s")


@dataclass(frozen=True, slots=True)
class Architecture:
    """What the real robot does with the operator's commands, and what both sites have for it."""

    make: Callable[[Constants, Posture], DriveController]
    """Makes a controller for a robot that begins at a posture at time 0."""
    estimates: bool = True
    """Whether the virtual robot is drawn where the posture estimator has it, as the paper's are."""
    senses: bool = False
    """Whether the robot has sonars and avoids what they see, and the operator's site has the map of the room."""


def _following(law: FieldLaw, *, senses: bool = False) -> Architecture:
    return Architecture(
        lambda c, posture: FollowingController(posture, law, c.following, processing=c.processing), senses=senses
    )


ARCHITECTURES: Final[dict[str, Architecture]] = {
    "I": Architecture(lambda _, __: Immediate()),
    "II": Architecture(lambda c, _: Filtered(c.period)),
    "III": _following(FieldLaw.LITERAL),
    "III-capped": _following(FieldLaw.CAPPED),
    "extended": _following(FieldLaw.CAPPED, senses=True),
    # The real robot plays the operator's path: where his commands lead is where it comes to.
    "timeline": Architecture(lambda _, posture: TimelineController(posture, now=0.0), estimates=False),
}
"""The architectures by name."""


def architecture(name: str) -> Architecture:
    """Find an architecture; what makes the controllers of one's own may say `estimates` and `senses` of it.

    Args:
        name: One of `ARCHITECTURES`, or `module:name` of one's own.

    Raises:
        InvalidValueError: If there's none of that name.
        FormatError: If the module can't be imported.
    """
    if is_own(name):
        made = own("architecture", name, ("constants", "posture"))
        return Architecture(made, bool(getattr(made, "estimates", True)), bool(getattr(made, "senses", False)))
    return ARCHITECTURES[one_of("architecture", name, ARCHITECTURES, "or MODULE:NAME of your own")]


def controller(name: str, posture: Posture, constants: Constants) -> DriveController:
    """Make an architecture's controller.

    Args:
        name: As of `architecture`.
        posture: Where both robots begin.
        constants: Of all architectures.

    Raises:
        InvalidValueError: If there's none of that name, or it makes something else.
        FormatError: If the module can't be imported.
    """
    made = architecture(name).make(constants, posture)
    checked("architecture", name, made, ("receive", "control", "executed"))
    return made


CONTROL = 0.05
"""Period of the real robot's control [s]."""
CELLS: Final = (125, 61)
"""Cells of the virtual environment along x and y where there's no room; Han, Kim, Kim, Kim, 2001, section 3.2."""
CELL: Final = 0.1
"""Side of a cell [m], an assumption: a room of 12.5 m × 6.1 m, and a robot of about five cells across."""
POSITIONS: Final[dict[str, Callable[[MobileRobot], PositionSource]]] = {
    "fused": FusedPosition,
    "laser": LaserPosition,
    "odometry": OdometryPosition,
    "truth": TruePosition,
}
"""What can tell a robot where it is."""
_ROUNDING = 1e-9
MARGIN = 0.02
"""Of the virtual robot's circle round the real one's outline [m]."""


def echoes_of(body: MobileRobot, since: float) -> tuple[float, Sequence[float]] | None:
    """When a robot's newest sonar scan was taken, from `since` on [s], and its ranges [m]; None without one."""
    scan = body.sonar
    return None if scan is None else (scan.time - since, scan.ranges.tolist())


def grid_of(room: Room, start: Posture) -> Grid:
    """Cells of a room; where there's none, the paper's number of them around the start."""
    if room is EMPTY:
        return Grid(CELLS, CELL, (start.x - CELLS[0] * CELL / 2, start.y - CELLS[1] * CELL / 2))
    m, n = (math.ceil(size / CELL - _ROUNDING) for size in (room.length, room.width))
    return Grid((m, n), CELL)


def operator_surroundings(
    room: Room, start: Posture, model: MobileBase, *, learns: bool = True
) -> OperatorSurroundings:
    """The virtual environment with the room's known map, and what keeps the virtual robot out of it.

    Args:
        room: Where the real robot drives.
        start: Where both robots begin.
        model: The virtual robot.
        learns: Whether what the real robot senses is added.
    """
    grid = grid_of(room, start)
    known = _known(room, grid, 0.0)
    environment = VirtualEnvironment(grid.shape, cell=grid.cell, origin=grid.origin, walls=known)
    outline = outline_of(model.body)
    radius = math.hypot(max(outline.front, outline.rear), model.body.width / 2) + MARGIN
    avoidance = Avoidance(model.limits, radius, period=model.period)
    return OperatorSurroundings(environment, avoidance, learns=learns)


def robot_surroundings(
    body: MobileRobot, start: Posture, controller: DriveController, period: float, *, since: float = 0.0
) -> RobotSurroundings:
    """What the real robot has on board of it.

    Args:
        body: The real robot, with sonars.
        start: Where it begins.
        controller: What drives it.
        period: Between two drives [s].
        since: The body's time that is 0 of the drive's [s].
    """
    near, far = body.chassis.sonar_reach
    mounts = mounts_of(body)
    sonar = body.senses.sonar
    half_cone = 0.0 if sonar is None else sonar.half_angle
    grid = grid_of(body.room, start)
    seen = SupervisorConfig(mounts, half_cone=half_cone, range_min=near, range_max=far)
    outline = outline_of(body.chassis.footprint)
    careful = AvoidanceConfig(outline, mounts, half_cone=half_cone, range_min=near, range_max=far, period=period)
    avoidance = ObstacleAvoidance(careful)
    return RobotSurroundings(
        lambda: echoes_of(body, since),
        EnvironmentSupervisor(grid, _known(body.room, grid, body.chassis.sonar_height), seen),
        avoidance,
        MoverTracker(MoversConfig(mounts, half_cone=half_cone)),
        Yielding(YieldingConfig(outline), avoidance),
        controller.aim if isinstance(controller, FollowingController) else None,
    )


def _known(room: Room, grid: Grid, height: float) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Cells of the known map's things that are at least so high [m]; none where there's no room."""
    if room is EMPTY:
        return np.zeros(grid.shape, bool)
    return FloorPlan(room.known(), height).grid(grid.cell, grid.shape, 0.0)
