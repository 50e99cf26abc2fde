"""Keeps a list of jobs, and how far it is, in a file that people can read and mend."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias

import msgspec
from msgspec import Meta

from interfaces.messages.jobs import (
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
    JobProgress,
    JobStage,
    MessageJob,
    MoveJob,
    Progress,
    VoiceJob,
    WaitJob,
)
from interfaces.system import read_within, write_whole
from robots.onboard.journey import Goal
from vrs.errors import FormatError, InvalidValueError

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


SCHEMA: Final = "vrs.jobs"
LARGEST: Final = 4_000_000
"""Longest file that is read [byte]."""
DAMAGED: Final = ".damaged"
"""What is put behind the name of a file that can't be read, before another is written in its place."""


class _FileHead(msgspec.Struct, frozen=True):
    schema: Literal["vrs.jobs"]
    version: int


class _JobsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    schema: Literal["vrs.jobs"]
    version: Literal[1]
    list: JobListForm
    progress: ProgressForm = ProgressForm()


class JobFile:
    """A list's file. What can't be read is kept beside it, never written over."""

    def __init__(self, path: Path) -> None:
        """Take the file, which needn't be there yet."""
        self.path = path
        self._damaged = False

    def load(self) -> tuple[JobList, Progress]:
        """The list, and how far it is; an empty one where there's no file yet.

        Raises:
            FormatError: If it can't be read, or isn't what it should be.
        """
        if not self.path.exists():
            return JobList(), Progress()
        try:
            return read_jobs(read_within(self.path, LARGEST), str(self.path))
        except FormatError:
            self._damaged = True
            raise

    def save(self, jobs: JobList, progress: Progress) -> None:
        """Write the list, whole or not at all.

        Raises:
            FormatError: If it can't be written.
        """
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self._damaged and self.path.is_file():
                self.path.rename(self._beside())
            write_whole(self.path, written_jobs(jobs, progress))
        except OSError as error:
            raise FormatError(str(self.path), f"can't be written: {error.strerror}") from None
        self._damaged = False

    def _beside(self) -> Path:
        """A name that no file has, for what can't be read."""
        k, beside = 1, self.path.with_name(self.path.name + DAMAGED)
        while beside.exists():
            k += 1
            beside = self.path.with_name(f"{self.path.name}{DAMAGED}{k}")
        return beside


def written_jobs(jobs: JobList, progress: Progress) -> bytes:
    """A list as a file has it: JSON, indented."""
    form = _JobsFile(SCHEMA, 1, JobListForm.of(jobs), ProgressForm.of(progress))
    return msgspec.json.format(msgspec.json.encode(form), indent=2) + b"\n"


def read_jobs(data: bytes, name: str) -> tuple[JobList, Progress]:
    """The list in a file's bytes.

    Args:
        data: The bytes.
        name: Of the file, for the message.

    Raises:
        FormatError: If it isn't one.
    """
    try:
        head = msgspec.json.decode(data, type=_FileHead)
        if head.version != 1:
            raise FormatError(name, f"has version {head.version}; version 1 is read")
        form = msgspec.json.decode(data, type=_JobsFile)
        return form.list.read(), form.progress.read()
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, InvalidValueError) as error:
        raise FormatError(name, f"is no list of jobs: {error}") from None


def digest(jobs: JobList) -> str:
    """What two lists have in common only if they're the same."""
    return hashlib.sha256(msgspec.json.encode(JobListForm.of(jobs))).hexdigest()[:16]
