"""Messages of a mobile robot's clients and site, besides those of any robot."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

from interfaces.jobs import Forecast, JobList, ListCommand, Load, OperatorLoss, Progress
from interfaces.messages.control import PROTOCOL, Lease, Role
from interfaces.teleop.driving.messages import Doing, Go, Point
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal, JourneyState
from vrs.mobile import DriveLimits


@dataclass(frozen=True, slots=True)
class MobileWelcome:
    """Server: the client may go on; what there is."""

    kind: ClassVar[str] = "mobile-welcome"
    version: ClassVar[int] = 1
    session: str = field(repr=False)
    """Names this session, for a later `Hello`; nobody else may know it."""
    role: Role
    robot: str
    """Name of the robot's model."""
    limits: DriveLimits
    """Of what it may be asked."""
    period: float
    """T: time between two commands of the virtual robot [s]."""
    holds: float
    """A drive order counts for so long after it was issued [s]."""
    now: float
    """Session time [s]."""
    lease: Lease
    resumed: bool = False
    """Whether the session that was asked for goes on."""
    instance: str = ""
    """Names this run of the server."""
    server: str = ""
    """Name and version of the program."""
    lease_timeout: float = 2.0
    """A lease expires so long after the last beat [s]."""
    room: str = ""
    """Where it drives, for people."""
    protocol: int = PROTOCOL


@dataclass(frozen=True, slots=True)
class Postures:
    """Server: where both robots are; the newest one counts."""

    kind: ClassVar[str] = "postures"
    version: ClassVar[int] = 1
    number: int
    now: float
    """Session time when it was made [s]."""
    virtual: Posture
    """Of the virtual robot, now."""
    command: Drive
    """What it drives."""
    estimate: Posture
    """Where the real robot is thought to come to with all commands so far. Source: Han et al., eq. (8)–(10)."""
    t: float | None = None
    """When the real robot was measured [s]; None before the first report, as all that follows."""
    real: Posture | None = None
    """Where it took itself to be."""
    drive: Drive | None = None
    """What its motors are told."""
    D: float | None = None
    """The time of the operator's path that it's to play less his clock, as the robot takes it to be, without what
    braking needs: negative [s]; None where its architecture has none."""
    starved: bool = False
    """Whether it's slower than it should be, as nothing newer is known there."""
    path_error: float | None = None
    """How far it is from the virtual robot's path [m]."""
    time_difference: float | None = None
    """How much later than the virtual robot it is there [s]."""
    epoch: int = 0
    """Epoch that it follows; 0 for none."""
    connected: bool = True
    """Whether the robot's site is heard of."""
    halted: str = ""
    """Why it doesn't follow; empty while it does."""
    drives: int = 0
    """How often the virtual robot was put where the real one stood, to begin a drive."""
    round_trip: float | None = None
    """Newest time that a message to the robot and the answer were under way [s]; None before the first."""
    messages: tuple[tuple[float, float | None], ...] = ()
    """Messages to the robot of which the emulated link told since the one before: when each was sent, and when it
    arrived [s]; None for one that was lost."""


class Trial(enum.StrEnum):
    """What is asked of the virtual robot alone."""

    DRY_RUN = "dry-run"
    """Say how long the list is likely to take."""


Wanted: TypeAlias = Go | Load | ListCommand | Trial
"""What a client asks for: a goal; a list in the place of the one before; that something is done with it."""


@dataclass(frozen=True, slots=True)
class TaskOrder:
    """Holder: let the robot do something by itself. The answer is a `Tasks` or a `Problem`."""

    kind: ClassVar[str] = "task"
    version: ClassVar[int] = 1
    number: int
    epoch: int
    wanted: Wanted


@dataclass(frozen=True, slots=True)
class Tasks:
    """Server: what the robot does by itself, and the list of jobs; the newest one counts."""

    kind: ClassVar[str] = "tasks"
    version: ClassVar[int] = 1
    doing: Doing = Doing.NOTHING
    journey: JourneyState = JourneyState.IDLE
    reason: str = ""
    """Why it waits or couldn't get there."""
    goal: Goal | None = None
    route: tuple[Point, ...] = ()
    """The way that's being driven [m]."""
    left: float = 0.0
    """Of that way [m]."""
    jobs: JobList = field(default_factory=JobList)
    progress: Progress = field(default_factory=Progress)
    forecast: Forecast | None = None
    """What the dry run said of this list; None where there was none since it was changed."""
    loss: OperatorLoss | None = None
    """What follows when the operator is lost; None before the robot is met."""
    shows: str = ""
    """What stands on its screen."""
    says: str = ""
    """What it's saying."""
    problem: str = ""
    """What is wrong with the file of the list; empty if nothing is."""
    answers: int | None = None
    """Number of the receiver's order that this answers."""


@dataclass(frozen=True, slots=True)
class Seen:
    """Server: what the robot sees of its surroundings; the newest one counts."""

    kind: ClassVar[str] = "seen"
    version: ClassVar[int] = 1
    time: float
    """By the robot's own clock [s]."""
    points: tuple[Point, ...]
    """Where its laser's beams ended, on the map [m]."""
    doubt: tuple[float, float, float] | None = None
    """Of its place: variance of x, covariance, variance of y [m²]; None where nobody knows."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Server: the known map of where the robot drives."""

    kind: ClassVar[str] = "plan"
    version: ClassVar[int] = 1
    size: Point
    """Of the floor, 0 ≤ x ≤ length and 0 ≤ y ≤ width [m]."""
    things: tuple[tuple[Point, ...], ...] = ()
    """Outlines of what stands there [m]."""
    via: tuple[Point, ...] = ()
    """Via points [m]."""
    robot: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """What the robot's rectangle reaches ahead and back from its driving axle, and its width [m]."""
