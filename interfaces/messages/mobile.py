"""Messages of a mobile robot's clients and site, besides those of any robot."""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec
from msgspec import Meta
from msgspec.structs import force_setattr

from interfaces.messages.control import MOST_MESSAGES, Lease, Role
from interfaces.messages.drive_sites import NONE_LEFT, Doing, RobotTask, SensedPoints
from interfaces.messages.fields import (
    Count,
    Distance,
    Epoch,
    Leased,
    Message,
    Number,
    PointRow,
    Points,
    Text,
    Time,
    Timeout,
    Value,
    Word,
)
from interfaces.messages.jobs import Forecast, JobList, OperatorLoss, Progress
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal, JourneyState
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits

MOST_THINGS = 1000
"""Outlines of a map."""
MOST_CORNERS = 64
"""Of an outline."""
Outline = Annotated[tuple[PointRow, ...], Meta(max_length=MOST_CORNERS)]
Positive = Annotated[float, Meta(gt=0, le=1e9)]


class MobileWelcome(Message, frozen=True, omit_defaults=True, gc=False, tag="mobile-welcome"):
    """Server: the client may go on; what there is."""

    secrets: ClassVar[tuple[str, ...]] = ("session",)
    protocol: Number
    """Version of the protocol that is spoken."""

    session: Word
    """Names this session, for a later `Hello`; nobody else may know it."""
    role: Role
    robot: Word
    """Name of the robot's model."""
    limits: DriveLimits
    """Of what it may be asked."""
    period: Positive
    """T: time between two commands of the virtual robot [s]."""
    holds: Positive
    """A drive order counts for so long after it was issued [s]."""
    now: Time
    """Session time [s]."""
    lease: Lease
    lease_timeout: Timeout
    """A lease expires so long after the last beat [s]."""
    resumed: bool = False
    """Whether the session that was asked for goes on."""
    instance: Word = ""
    """Names this run of the server."""
    server: Word = ""
    """Name and version of the program."""
    room: Word = ""
    """Where it drives, for people."""


class Postures(Leased, frozen=True, omit_defaults=True, gc=False, tag="postures"):
    """Server: where both robots are; the newest one counts."""

    number: Number
    now: Time
    """Session time when it was made [s]."""
    virtual: Posture
    """Of the virtual robot, now."""
    command: Drive
    """What it drives."""
    estimate: Posture
    """Where the real robot is thought to come to with all commands so far. Source: Han et al., eq. (8)–(10)."""
    t: Time | None = None
    """When the real robot was measured [s]; None before the first report, as all that follows."""
    real: Posture | None = None
    """Where it took itself to be."""
    drive: Drive | None = None
    """What its motors are told."""
    D: Time | None = None
    """The time of the operator's path that it's to play less his clock, as the robot takes it to be, without what
    braking needs: negative [s]; None where its architecture has none."""
    starved: bool = False
    """Whether it's slower than it should be, as nothing newer is known there."""
    path_error: Distance | None = None
    """How far it is from the virtual robot's path [m]."""
    time_difference: Distance | None = None
    """How much later than the virtual robot it is there [s]."""
    epoch: Epoch | None = None
    """That it follows; None for none."""
    connected: bool = True
    """Whether the robot's site is heard of."""
    halted: Text = ""
    """Why it doesn't follow; empty while it does."""
    drives: Count = 0
    """How often the virtual robot was put where the real one stood, to begin a drive."""
    round_trip: Value | None = None
    """Newest time that a message to the robot and the answer were under way [s]; None before the first."""
    messages: Annotated[tuple[tuple[Time, Time | None], ...], Meta(max_length=MOST_MESSAGES)] = ()
    """Messages to the robot of which the emulated link told since the one before: when each was sent, and when it
    arrived [s]; None for one that was lost."""


class TaskOrder(Leased, frozen=True, omit_defaults=True, gc=False, tag="task"):
    """Holder: let the robot do something by itself. The answer is a `Tasks` or a `Problem`."""

    number: Number
    task: RobotTask
    epoch: Epoch | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.task.halt is not None:
            raise InvalidValueError("task", "halt", "go, do or jobs: the order of a stop halts")


class Tasks(Message, frozen=True, omit_defaults=True, gc=False, tag="tasks"):
    """Server: what the robot does by itself, and the list of jobs; the newest one counts."""

    doing: Doing = Doing.NOTHING
    journey: JourneyState = JourneyState.IDLE
    reason: Text = ""
    """Why it waits or couldn't get there."""
    goal: Goal | None = None
    route: Points = ()
    """The way that's being driven [m]."""
    left: Distance = NONE_LEFT
    """Of that way [m]."""
    jobs: JobList = msgspec.field(default_factory=JobList)
    progress: Progress = msgspec.field(default_factory=Progress)
    forecast: Forecast | None = None
    """What the dry run said of this list; None where there was none since it was changed."""
    loss: OperatorLoss | None = None
    """What follows when the operator is lost; None before the robot is met."""
    shows: Text = ""
    """What stands on its screen."""
    says: Text = ""
    """What it's saying."""
    problem: Text = ""
    """What is wrong with the file of the list; empty if nothing is."""
    answers: Count | None = None
    """Number of the receiver's order that this answers."""

    def __post_init__(self) -> None:
        if not self.left:
            force_setattr(self, "left", NONE_LEFT)


class Seen(Message, SensedPoints, frozen=True, omit_defaults=True, gc=False, tag="seen"):
    """Server: what the robot sees of its surroundings; the newest one counts."""


class Plan(Message, frozen=True, omit_defaults=True, gc=False, tag="plan"):
    """Server: the known map of where the robot drives."""

    size: PointRow
    """Of the floor, 0 ≤ x ≤ length and 0 ≤ y ≤ width [m]."""
    things: Annotated[tuple[Outline, ...], Meta(max_length=MOST_THINGS)] = ()
    """Outlines of what stands there [m]."""
    via: Points = ()
    """Via points [m]."""
    robot: tuple[Distance, Distance, Distance] = msgspec.field(default_factory=lambda: (0.0, 0.0, 0.0))
    """What the robot's rectangle reaches ahead and back from its driving axle, and its width [m]."""
