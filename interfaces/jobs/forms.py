"""How lists of jobs are written, in files and in messages: a map each, with the kind of job in `do`."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

from interfaces.jobs.progress import JobProgress, JobStage, Progress
from interfaces.jobs.values import (
    LONGEST_NAME,
    LONGEST_SOURCE,
    LONGEST_TEXT,
    LONGEST_WAIT,
    MOST_JOBS,
    MOST_PLACES,
    ArmJob,
    Job,
    JobEntry,
    JobList,
    MessageJob,
    MoveJob,
    VoiceJob,
    WaitJob,
)
from robots.onboard.journey import Goal

LONGEST_REASON = 500
"""Of a reason more characters aren't written."""
_Number = Annotated[int, Meta(ge=1, lt=2**31)]
_Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
_Text = Annotated[str, Meta(min_length=1, max_length=LONGEST_TEXT)]
_Seconds = Annotated[float, Meta(ge=0, le=LONGEST_WAIT)]
_Reason = Annotated[str, Meta(max_length=LONGEST_REASON)]
_Value = Annotated[float, Meta(ge=-1000, le=1000)]


class GoalForm(msgspec.Struct, frozen=True, omit_defaults=True):
    """`Goal`."""

    x: _Value
    y: _Value
    heading: _Value | None = None

    @classmethod
    def of(cls, goal: Goal) -> GoalForm:
        """As it's written."""
        return cls(goal.x, goal.y, goal.heading)

    def read(self) -> Goal:
        """What is meant."""
        return Goal(self.x, self.y, self.heading)


class _JobForm(msgspec.Struct, frozen=True, omit_defaults=True, tag_field="do"):
    number: _Number


class MoveForm(_JobForm, frozen=True, omit_defaults=True, tag="move"):
    """`MoveJob`."""

    to: GoalForm | _Name

    def read(self) -> Job:
        """What is meant."""
        return MoveJob(self.to.read() if isinstance(self.to, GoalForm) else self.to)


class VoiceForm(_JobForm, frozen=True, omit_defaults=True, tag="voice"):
    """`VoiceJob`."""

    text: _Text

    def read(self) -> Job:
        """What is meant."""
        return VoiceJob(self.text)


class MessageForm(_JobForm, frozen=True, omit_defaults=True, tag="message"):
    """`MessageJob`."""

    text: _Text

    def read(self) -> Job:
        """What is meant."""
        return MessageJob(self.text)


class WaitForm(_JobForm, frozen=True, omit_defaults=True, tag="wait"):
    """`WaitJob`."""

    seconds: _Seconds | None = None

    def read(self) -> Job:
        """What is meant."""
        return WaitJob(self.seconds)


class ArmForm(_JobForm, frozen=True, omit_defaults=True, tag="arm"):
    """`ArmJob`."""

    program: _Name
    source: Annotated[str, Meta(max_length=LONGEST_SOURCE)] = ""

    def read(self) -> Job:
        """What is meant."""
        return ArmJob(self.program, self.source)


JobForm: TypeAlias = MoveForm | VoiceForm | MessageForm | WaitForm | ArmForm
"""A job, as it's written."""


def job_form(entry: JobEntry) -> JobForm:
    """A job of a list, as it's written."""
    number, job = entry.number, entry.job
    match job:
        case MoveJob(to):
            return MoveForm(number, GoalForm.of(to) if isinstance(to, Goal) else to)
        case VoiceJob(text):
            return VoiceForm(number, text)
        case MessageJob(text):
            return MessageForm(number, text)
        case WaitJob(seconds):
            return WaitForm(number, seconds)
        case ArmJob(program, source):
            return ArmForm(number, program, source)


class JobListForm(msgspec.Struct, frozen=True, omit_defaults=True):
    """`JobList`."""

    jobs: Annotated[tuple[JobForm, ...], Meta(max_length=MOST_JOBS)] = ()
    places: Annotated[dict[_Name, GoalForm], Meta(max_length=MOST_PLACES)] = {}

    @classmethod
    def of(cls, jobs: JobList) -> JobListForm:
        """As it's written."""
        places = {name: GoalForm.of(goal) for name, goal in jobs.places.items()}
        return cls(tuple(job_form(entry) for entry in jobs.entries), places)

    def read(self) -> JobList:
        """What is meant.

        Raises:
            InvalidValueError: If a move goes to a place that isn't there, or a number is there twice.
        """
        entries = tuple(JobEntry(form.number, form.read()) for form in self.jobs)
        return JobList(entries, {name: form.read() for name, form in self.places.items()})


class JobProgressForm(msgspec.Struct, frozen=True, omit_defaults=True):
    """`JobProgress`."""

    number: _Number
    stage: JobStage = JobStage.PLANNED
    reason: _Reason = ""
    left: _Seconds | None = None


class ProgressForm(msgspec.Struct, frozen=True, omit_defaults=True):
    """`Progress`."""

    stage: JobStage = JobStage.PLANNED
    jobs: Annotated[tuple[JobProgressForm, ...], Meta(max_length=MOST_JOBS)] = ()
    reason: _Reason = ""

    @classmethod
    def of(cls, progress: Progress) -> ProgressForm:
        """As it's written."""
        jobs = tuple(JobProgressForm(j.number, j.stage, j.reason[:LONGEST_REASON], j.left) for j in progress.jobs)
        return cls(progress.stage, jobs, progress.reason[:LONGEST_REASON])

    def read(self) -> Progress:
        """What is meant."""
        jobs = tuple(JobProgress(form.number, form.stage, form.reason, form.left) for form in self.jobs)
        return Progress(self.stage, jobs, self.reason)
