"""What a robot is asked to do, one after the other: jobs, named places, the list of them, and how far it is.

Source: Kim, Han, Kim, Kim, section 4.1: MOVE, VOICE, MESSAGE and WAIT; ARM is ours.
"""

from __future__ import annotations

import enum
from typing import Annotated, Final, TypeAlias

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from interfaces.messages.fields import Number, Points, Span, Text
from robots.onboard.journey import Goal
from vrs.checks import number_in
from vrs.errors import InvalidValueError
from vrs.record import Record, set_field

MOST_JOBS: Final = 64
"""Jobs of a list."""
MOST_PLACES: Final = 64
"""Places with a name."""
LONGEST_NAME: Final = 40
"""Characters of a name."""
LONGEST_TEXT: Final = 400
"""Characters that are spoken or shown."""
LONGEST_SOURCE: Final = 16_000
"""Characters of a VAL-II program."""
LONGEST_WAIT: Final = 86_400.0
"""[s]."""
LONGEST_REASON: Final = 500
"""Of a reason more characters aren't kept."""
JobNumber = Annotated[int, Meta(ge=1, lt=2**31)]
JobName = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
"""Of a place or a program."""
JobText = Annotated[str, Meta(min_length=1, max_length=LONGEST_TEXT)]
WaitTime = Annotated[float, Meta(ge=0, le=LONGEST_WAIT)]
"""[s]."""
Reason = Annotated[str, Meta(max_length=LONGEST_REASON)]


def _check_text(name: str, value: object, longest: int) -> None:
    if not isinstance(value, str) or not 1 <= len(value) <= longest or not value.strip():
        raise InvalidValueError(name, value, f"1 to {longest} characters, not all blank")


class NumberedJob(Record, frozen=True, omit_defaults=True, gc=False, tag_field="do"):
    """A job of a list."""

    number: JobNumber
    """By which it's known; it stays the same where the job is put elsewhere."""

    def __post_init__(self) -> None:
        if isinstance(self.number, bool) or not isinstance(self.number, int) or not 1 <= self.number < 2**31:
            raise InvalidValueError("number", self.number, "an integer from 1")

    @property
    def word(self) -> str:
        """What people call its kind."""
        return str(self.__struct_config__.tag).upper()


class MoveJob(NumberedJob, frozen=True, omit_defaults=True, gc=False, tag="move"):
    """Go to a goal, or to the place of the list that has that name."""

    to: Goal | JobName
    """Where: a goal, or the name of a place of the list."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.to, Goal):
            _check_text("to", self.to, LONGEST_NAME)


class VoiceJob(NumberedJob, frozen=True, omit_defaults=True, gc=False, tag="voice"):
    """Say something."""

    text: JobText

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_text("text", self.text, LONGEST_TEXT)


class MessageJob(NumberedJob, frozen=True, omit_defaults=True, gc=False, tag="message"):
    """Show something on the robot's screen; it stays there until something else is shown."""

    text: JobText

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_text("text", self.text, LONGEST_TEXT)


class WaitJob(NumberedJob, frozen=True, omit_defaults=True, gc=False, tag="wait"):
    """Wait so many seconds; without a number until the key is pressed."""

    seconds: WaitTime | None = None
    """For so long [s]; None: until the key is pressed."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.seconds is not None:
            set_field(self, "seconds", number_in("seconds", self.seconds, 0.0, LONGEST_WAIT, unit=" s"))


class ArmJob(NumberedJob, frozen=True, omit_defaults=True, gc=False, tag="arm"):
    """Let the arm carry out a VAL-II program of that name: the `source`'s, or one that the arm's site has."""

    program: JobName
    """Its name."""
    source: Annotated[str, Meta(max_length=LONGEST_SOURCE)] = ""
    """The file in which it is; empty for a program that the arm's site has."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_text("program", self.program, LONGEST_NAME)
        if not isinstance(self.source, str) or len(self.source) > LONGEST_SOURCE:
            raise InvalidValueError("source", self.source, f"at most {LONGEST_SOURCE} characters")


Job: TypeAlias = MoveJob | VoiceJob | MessageJob | WaitJob | ArmJob
"""One thing to be done."""


class JobList(Record, frozen=True, omit_defaults=True, gc=False):
    """Jobs in their order, and the places that they name. Every edit makes another list."""

    jobs: Annotated[tuple[Job, ...], Meta(max_length=MOST_JOBS)] = ()
    """Each number once."""
    places: Annotated[dict[JobName, Goal], Meta(max_length=MOST_PLACES)] = msgspec.field(default_factory=dict)
    """By name."""

    def __post_init__(self) -> None:
        set_field(self, "jobs", tuple(self.jobs))
        set_field(self, "places", dict(self.places))
        if len(self.jobs) > MOST_JOBS:
            raise InvalidValueError("jobs", f"{len(self.jobs)} jobs", f"at most {MOST_JOBS}")
        if len({job.number for job in self.jobs}) < len(self.jobs):
            raise InvalidValueError("jobs", "a number twice", "each number once")
        if len(self.places) > MOST_PLACES:
            raise InvalidValueError("places", f"{len(self.places)} places", f"at most {MOST_PLACES}")
        for name in self.places:
            _check_text("place", name, LONGEST_NAME)
        for job in self.jobs:
            if isinstance(job, MoveJob):
                self.goal(job)

    def goal(self, move: MoveJob) -> Goal:
        """Where a move goes.

        Raises:
            InvalidValueError: If no place has that name.
        """
        if isinstance(move.to, Goal):
            return move.to
        if move.to not in self.places:
            known = ", ".join(self.places) or "none"
            raise InvalidValueError("to", move.to, f"a goal, or a place of this list ({known})")
        return self.places[move.to]

    def with_place(self, name: str, goal: Goal) -> JobList:
        """With a place of that name, in place of any other that has it."""
        return replace(self, places={**self.places, name: goal})

    def index(self, number: int) -> int:
        """Where a job is in the list.

        Raises:
            InvalidValueError: If there's none of that number.
        """
        for k, job in enumerate(self.jobs):
            if job.number == number:
                return k
        raise InvalidValueError("number", number, "that of a job of this list")


class JobStage(enum.StrEnum):
    """How far a job, or a list, is."""

    PLANNED = "planned"
    """It hasn't begun."""
    RUNNING = "running"
    PAUSED = "paused"
    """It has begun, and is to go on."""
    DONE = "done"
    FAILED = "failed"
    """It couldn't be done; the reason says why."""
    ABORTED = "aborted"
    """Somebody ended it."""


class OperatorLoss(enum.StrEnum):
    """What becomes of a list when nobody is heard any more who could stop it."""

    STOP = "stop"
    """The robot stops, and the list is paused until somebody resumes it."""
    CARRY_ON = "carry-on"
    """The robot goes on with the list to its end; a WAIT for the key waits."""


POLICY_SAYS: Final = {
    OperatorLoss.STOP: "when the operator is lost, the robot stops and the list of jobs is paused",
    OperatorLoss.CARRY_ON: "when the operator is lost, the robot carries on with the list of jobs",
}
"""What is printed of a policy."""


def _cut_reason(progress: JobProgress | Progress) -> None:
    if len(progress.reason) > LONGEST_REASON:
        set_field(progress, "reason", progress.reason[:LONGEST_REASON])


class JobProgress(Record, frozen=True, omit_defaults=True, gc=False):
    """How far a job is."""

    number: JobNumber
    """Of the job."""
    stage: JobStage = JobStage.PLANNED
    reason: Reason = ""
    """Why it's paused or has failed."""
    left: WaitTime | None = None
    """Of a WAIT that's paused, what is left of it [s]."""

    def __post_init__(self) -> None:
        _cut_reason(self)


class Progress(Record, frozen=True, omit_defaults=True, gc=False):
    """How far a list is."""

    stage: JobStage = JobStage.PLANNED
    jobs: Annotated[tuple[JobProgress, ...], Meta(max_length=MOST_JOBS)] = ()
    """In the list's order."""
    reason: Reason = ""
    """Why it's paused, has failed, or was aborted."""

    def __post_init__(self) -> None:
        _cut_reason(self)

    @classmethod
    def of(cls, jobs: JobList) -> Progress:
        """Nothing is done yet."""
        return cls(jobs=tuple(JobProgress(job.number) for job in jobs.jobs))

    @property
    def running(self) -> JobProgress | None:
        """The job that is being done."""
        return next((job for job in self.jobs if job.stage is JobStage.RUNNING), None)


class ListCommand(enum.StrEnum):
    """What a person asks of a list."""

    RUN = "run"
    """Begin with the first job."""
    PAUSE = "pause"
    RESUME = "resume"
    """Go on with the first job that isn't done; one that was interrupted begins anew, a WAIT goes on."""
    ABORT = "abort"
    KEY = "key"
    """End a WAIT for the key."""
    DRY_RUN = "dry-run"
    """Say how long the list is likely to take: that's asked of the virtual robot alone."""


class JobForecast(Record, frozen=True, omit_defaults=True, gc=False):
    """What is likely to become of a job."""

    number: Number
    begins: Span
    """After so long [s], times that nobody knows left out."""
    lasts: Span | None = None
    """For so long [s]; None where nobody knows."""
    route: Points = ()
    """Of a move [m]."""
    problem: Text = ""
    """Why it'd fail; the list ends there."""


Forecast = Annotated[tuple[JobForecast, ...], Meta(max_length=MOST_JOBS)]
"""What is likely to become of a list: of its jobs in their order, up to the first that'd fail."""
