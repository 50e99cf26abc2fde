"""What crosses the link between the operator's site of a mobile robot and the robot's, as frozen values.

An epoch is a drive that begins where the real robot stands: both sites make their parts anew for it. Times of its
arcs count from when it began.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from interfaces.teleop.architectures.segments import ArcPacket
from interfaces.teleop.architectures.sites import ArchitectureReport
from interfaces.teleop.tasks import Doing, Errand, SensedPoints, TaskReport
from robots.onboard.driving import Drive, Posture

STILL: Final = Drive(0.02, 0.05)
"""A robot that's told to move slower than this stands: it only keeps its place [m/s, rad/s]."""


def is_still(drive: Drive) -> bool:
    """Whether a robot that's told that is at rest."""
    return abs(drive.v) <= STILL.v and abs(drive.w) <= STILL.w


@dataclass(frozen=True, slots=True)
class DriveOrders:
    """From the operator's site: arcs of the virtual robot's path, or a heartbeat without any."""

    epoch: int
    """Of the operator's site, from 1."""
    number: int
    """Of the packet, from 1."""
    sent_at: float
    """By the operator's clock [s]."""
    began: float
    """When the epoch began, by the operator's clock [s]: time 0 of its arcs."""
    start: Posture | None
    """Where it began; None while nobody drives."""
    packet: ArcPacket
    """What the robot may lack."""
    errands: tuple[Errand, ...] = ()
    """Tasks that it isn't known to have, in their order."""


@dataclass(frozen=True, slots=True)
class DriveReport:
    """From the robot's site: where it takes itself to be, and what it does."""

    epoch: int
    """Epoch that it follows."""
    number: int
    """Of the packet, from 1."""
    sent_at: float
    """By the robot's clock, as it takes the operator's to be [s]."""
    measured_at: float
    """When it was there, by the same clock [s]."""
    posture: Posture
    """Where it takes itself to be."""
    drive: Drive
    """What its motors are told."""
    echo: tuple[int, float, float] | None = None
    """The newest orders heard: their number, their sent_at, and when they arrived by the robot's clock [s]."""
    halted: str = ""
    """Why it stopped by itself and waits for a new epoch; empty while it doesn't."""
    refused: str = ""
    """Why the newest orders didn't count; empty if they did."""
    report: ArchitectureReport | None = None
    """The architecture's own; None while it's halted."""
    play: float | None = None
    """Time of the operator's path that it's at, from the epoch's beginning [s]; None: the architecture has none."""
    D: float | None = None
    """The time of the path that it's to play less the operator's clock, without what braking needs [s]; None: the
    architecture has none."""
    starved: bool = False
    """Whether it's slower than it should be, as nothing newer is known."""
    uncertainty: float | None = None
    """Bound on the error of what it takes for the operator's clock [s]; None where that isn't known."""
    world: float | None = None
    """Time of a simulated room when it was measured [s]: where people walk then; None of a real one."""
    errand: int = 0
    """Number of the newest errand that it has done, or left; 0 for none."""
    doing: Doing = Doing.NOTHING
    """What it does by itself."""
    left: float = 0.0
    """Way to the goal of that [m]."""
    tasks: TaskReport | None = None
    """How far it is with that; None where that was told a moment ago."""
    sight: SensedPoints | None = None
    """What it sees; None where there's nothing new."""
