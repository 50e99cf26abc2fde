"""Messages of a mobile robot's clients and site, besides those of any robot."""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec
from msgspec import Meta

from interfaces.messages.control import MOST_MESSAGES, Lease, Role
from interfaces.messages.drive_sites import NONE_LEFT, Doing, RobotTask, SensedPoints
from interfaces.messages.fields import (
    Count,
    Distance,
    Epoch,
    Leased,
    Message,
    Number,
    Party,
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
from vrs.record import set_field

MOST_THINGS = 1000
"""Outlines of a map."""
MOST_CORNERS = 64
"""Of an outline."""
Outline = Annotated[tuple[PointRow, ...], Meta(max_length=MOST_CORNERS)]
Positive = Annotated[float, Meta(gt=0, le=1e9)]


class MobileWelcome(Message, frozen=True, omit_defaults=True, gc=False, tag="mobile-welcome"):
    """The client may go on; what there is."""

    sender: ClassVar[Party] = Party.SERVER
    secrets: ClassVar[tuple[str, ...]] = ("session",)
    protocol: Number
    """Version of the protocol that is spoken."""

    session: Word
    """Secret: names this session, for a later `Hello`."""
    role: Role
    """What the client may do."""
    robot: Word
    """Name of the robot's model."""
    limits: DriveLimits
    """`v_max` [m/s], `w_max` [rad/s], `a_max` [m/s²], `alpha_max` [rad/s²]."""
    period: Positive
    """T: the virtual robot takes a command so often [s]."""
    holds: Positive
    """A `drive` order counts for so long after it was issued [s]."""
    now: Time
    """Session time [s]."""
    lease: Lease
    """As it is now."""
    lease_timeout: Timeout
    """It expires so long after the last beat or order [s]."""
    resumed: bool = False
    """Whether the session that was asked for goes on."""
    instance: Word = ""
    """Names this run of the server; with another one forget all."""
    server: Word = ""
    """Name and version of the program."""
    room: Word = ""
    """Name of the room."""


class Postures(Leased, frozen=True, omit_defaults=True, gc=False, tag="postures"):
    """Where both robots are; the newest one counts."""

    sender: ClassVar[Party] = Party.SERVER
    number: Number
    """Counts up."""
    now: Time
    """Session time when it was made [s]."""
    virtual: Posture
    """Of the virtual robot, now [m, m, rad]."""
    command: Drive
    """What it drives [m/s, rad/s]."""
    estimate: Posture
    """Where the real robot is thought to come to with all commands so far (the posture estimator). Source: Han et
    al., eq. (8)–(10)."""
    t: Time | None = None
    """Session time of the newest measurement [s]; absent before the first, as the next two."""
    real: Posture | None = None
    """Where the real robot took itself to be."""
    drive: Drive | None = None
    """What its motors are told."""
    D: Time | None = None
    """The time of the path that it's to play less session time, by the clock as the robot has it, without what
    braking needs [s]; absent where its architecture has none."""
    starved: bool = False
    """Whether it's slower than it should be, as it knows nothing newer."""
    path_error: Distance | None = None
    """Distance from the nearest place of the virtual robot's path near the one before [m]; absent while it doesn't
    follow."""
    time_difference: Distance | None = None
    """How much later it is there [s]; 0 where both stand."""
    epoch: Epoch | None = None
    """Of the drive that it follows; absent: none."""
    connected: bool = True
    """Whether the robot is heard of."""
    halted: Text = ""
    """As in `state`."""
    drives: Count = 0
    """How often the virtual robot was put where the real one stood: a drive begins with each lease and `Resume`,
    and after a stop."""
    round_trip: Value | None = None
    """As in `state`."""
    messages: Annotated[tuple[tuple[Time, Time | None], ...], Meta(max_length=MOST_MESSAGES)] = ()
    """As in `state`."""
    drawn: Posture | None = None
    """Where the virtual robot is drawn, where the posture estimator has it now; absent where that's `virtual`, as
    in architectures without one."""


class TaskOrder(Leased, frozen=True, omit_defaults=True, gc=False, tag="task"):
    """Let the robot do something by itself. The answer is a `Tasks` or a `Problem`."""

    sender: ClassVar[Party] = Party.HOLDER
    number: Number
    """The client's own; the answer has it, too."""
    task: RobotTask
    """What."""
    epoch: Epoch | None = None
    """Of the control lease."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.task.halt is not None:
            raise InvalidValueError("task", "halt", "go, do or jobs: the order of a stop halts")


class Tasks(Message, frozen=True, omit_defaults=True, gc=False, tag="tasks"):
    """What the robot does by itself, and the list of jobs; the newest one counts."""

    sender: ClassVar[Party] = Party.SERVER
    doing: Doing = Doing.NOTHING
    """What that is."""
    journey: JourneyState = JourneyState.IDLE
    reason: Text = ""
    """Why it waits or couldn't get there."""
    goal: Goal | None = None
    """Where to."""
    route: Points = ()
    """The way there [m]."""
    left: Distance = NONE_LEFT
    """How much of it is left [m]."""
    jobs: JobList = msgspec.field(default_factory=JobList)
    """The list."""
    progress: Progress = msgspec.field(default_factory=Progress)
    """How far that is."""
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
            set_field(self, "left", NONE_LEFT)


class Seen(Message, SensedPoints, frozen=True, omit_defaults=True, gc=False, tag="seen"):
    """What the robot sees of its surroundings; the newest one counts."""

    sender: ClassVar[Party] = Party.SERVER


class Plan(Message, frozen=True, omit_defaults=True, gc=False, tag="plan"):
    """The known map of where the robot drives."""

    sender: ClassVar[Party] = Party.SERVER
    size: PointRow
    """Length and width of the floor [m]."""
    things: Annotated[tuple[Outline, ...], Meta(max_length=MOST_THINGS)] = ()
    """Outlines of what the map knows [m]."""
    via: Points = ()
    """Via points [m]."""
    robot: tuple[Distance, Distance, Distance] = msgspec.field(default_factory=lambda: (0.0, 0.0, 0.0))
    """What it reaches ahead and back from its axle, and its width [m]."""
