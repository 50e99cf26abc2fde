"""What a robot is asked to do, one after the other: jobs, named places, and the list of them, as frozen values.

Source: Kim, Han, Kim, Kim, section 4.1: MOVE, VOICE, MESSAGE and WAIT; ARM is ours.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar, Final, TypeAlias

from robots.onboard.journey import Goal
from robots.onboard.routes import Point
from vrs.checks import number_in
from vrs.errors import InvalidValueError

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


def _text(name: str, value: object, longest: int) -> str:
    allowed = f"1 to {longest} characters, not all blank"
    if not isinstance(value, str) or not 1 <= len(value) <= longest or not value.strip():
        raise InvalidValueError(name, value, allowed)
    return value


@dataclass(frozen=True, slots=True)
class MoveJob:
    """Go somewhere."""

    word: ClassVar[str] = "MOVE"
    to: Goal | str
    """Where: a goal, or the name of a place of the list."""

    def __post_init__(self) -> None:
        if not isinstance(self.to, Goal):
            _text("to", self.to, LONGEST_NAME)


@dataclass(frozen=True, slots=True)
class VoiceJob:
    """Say something."""

    word: ClassVar[str] = "VOICE"
    text: str
    """1 to 400 characters."""

    def __post_init__(self) -> None:
        _text("text", self.text, LONGEST_TEXT)


@dataclass(frozen=True, slots=True)
class MessageJob:
    """Show something on the robot's screen; it stays there until something else is shown."""

    word: ClassVar[str] = "MESSAGE"
    text: str
    """1 to 400 characters."""

    def __post_init__(self) -> None:
        _text("text", self.text, LONGEST_TEXT)


@dataclass(frozen=True, slots=True)
class WaitJob:
    """Wait."""

    word: ClassVar[str] = "WAIT"
    seconds: float | None = None
    """For so long, in [0, 86400]; None until the key is pressed."""

    def __post_init__(self) -> None:
        if self.seconds is not None:
            seconds = number_in("seconds", self.seconds, 0.0, LONGEST_WAIT, unit=" s")
            object.__setattr__(self, "seconds", seconds)


@dataclass(frozen=True, slots=True)
class ArmJob:
    """Let the arm carry out a VAL-II program."""

    word: ClassVar[str] = "ARM"
    program: str
    """Its name, 1 to 40 characters."""
    source: str = ""
    """The file in which it is, at most 16000 characters; empty for a program that the arm's site has."""

    def __post_init__(self) -> None:
        _text("program", self.program, LONGEST_NAME)
        if not isinstance(self.source, str) or len(self.source) > LONGEST_SOURCE:
            raise InvalidValueError("source", self.source, f"at most {LONGEST_SOURCE} characters")


Job: TypeAlias = MoveJob | VoiceJob | MessageJob | WaitJob | ArmJob
"""One thing to be done."""


@dataclass(frozen=True, slots=True)
class JobEntry:
    """A job of a list."""

    number: int
    """By which it's known, from 1; it stays the same where the job is put elsewhere."""
    job: Job

    def __post_init__(self) -> None:
        if isinstance(self.number, bool) or not isinstance(self.number, int) or not 1 <= self.number < 2**31:
            raise InvalidValueError("number", self.number, "an integer from 1")
        if not isinstance(self.job, Job):
            raise InvalidValueError("job", self.job, "a Move, Voice, Message, Wait or Arm")


@dataclass(frozen=True, slots=True)
class JobList:
    """Jobs in their order, and the places that they name. Every edit makes another list."""

    entries: tuple[JobEntry, ...] = ()
    """At most 64, each number once."""
    places: Mapping[str, Goal] = field(default_factory=dict)
    """By name, at most 64."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "entries", tuple(self.entries))
        object.__setattr__(self, "places", MappingProxyType(dict(self.places)))
        if len(self.entries) > MOST_JOBS:
            raise InvalidValueError("jobs", f"{len(self.entries)} jobs", f"at most {MOST_JOBS}")
        if len({entry.number for entry in self.entries}) < len(self.entries):
            raise InvalidValueError("jobs", "a number twice", "each number once")
        if len(self.places) > MOST_PLACES:
            raise InvalidValueError("places", f"{len(self.places)} places", f"at most {MOST_PLACES}")
        for name in self.places:
            _text("place", name, LONGEST_NAME)
        for entry in self.entries:
            if isinstance(entry.job, MoveJob):
                self.goal(entry.job)

    @classmethod
    def of(cls, *jobs: Job, places: Mapping[str, Goal] | None = None) -> JobList:
        """A list of jobs, numbered from 1."""
        return cls(tuple(JobEntry(k, job) for k, job in enumerate(jobs, 1)), {} if places is None else places)

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

    def added(self, job: Job, at: int | None = None) -> JobList:
        """With one more job, before the one at an index; at the end unless given."""
        number = max((entry.number for entry in self.entries), default=0) + 1
        place = len(self.entries) if at is None else self._index(at, len(self.entries))
        return replace(self, entries=(*self.entries[:place], JobEntry(number, job), *self.entries[place:]))

    def removed(self, number: int) -> JobList:
        """Without a job."""
        k = self.index(number)
        return replace(self, entries=self.entries[:k] + self.entries[k + 1 :])

    def changed(self, number: int, job: Job) -> JobList:
        """With another job in the place of one; it gets a number of its own."""
        k = self.index(number)
        return self.removed(number).added(job, k) if k < len(self.entries) - 1 else self.removed(number).added(job)

    def moved(self, number: int, to: int) -> JobList:
        """With a job at another index."""
        k = self.index(number)
        rest = self.entries[:k] + self.entries[k + 1 :]
        place = self._index(to, len(rest))
        return replace(self, entries=(*rest[:place], self.entries[k], *rest[place:]))

    def with_place(self, name: str, goal: Goal) -> JobList:
        """With a place of that name, in place of any other that has it."""
        return replace(self, places={**self.places, name: goal})

    def index(self, number: int) -> int:
        """Where a job is in the list.

        Raises:
            InvalidValueError: If there's none of that number.
        """
        for k, entry in enumerate(self.entries):
            if entry.number == number:
                return k
        raise InvalidValueError("number", number, "that of a job of this list")

    @staticmethod
    def _index(value: int, most: int) -> int:
        return int(number_in("index", value, 0, most))


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


@dataclass(frozen=True, slots=True)
class JobProgress:
    """How far a job is."""

    number: int
    stage: JobStage = JobStage.PLANNED
    reason: str = ""
    """Why it's paused or has failed."""
    left: float | None = None
    """Of a WAIT that's paused, what is left of it [s]."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a list is."""

    stage: JobStage = JobStage.PLANNED
    jobs: tuple[JobProgress, ...] = ()
    """In the list's order."""
    reason: str = ""
    """Why it's paused, has failed, or was aborted."""

    @classmethod
    def of(cls, jobs: JobList) -> Progress:
        """Nothing is done yet."""
        return cls(jobs=tuple(JobProgress(entry.number) for entry in jobs.entries))

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


@dataclass(frozen=True, slots=True)
class Load:
    """Take a list in place of the one before; not while that runs."""

    jobs: JobList
    progress: Progress | None = None
    """How far it is already; None keeps what's known of jobs with the same number that are unchanged."""


@dataclass(frozen=True, slots=True)
class JobForecast:
    """What is likely to become of a job."""

    number: int
    begins: float
    """After so long [s], times that nobody knows left out."""
    lasts: float | None
    """For so long [s]; None where nobody knows."""
    route: tuple[Point, ...] = ()
    """Of a move [m]."""
    problem: str = ""
    """Why it'd fail; the list ends there."""


@dataclass(frozen=True, slots=True)
class Forecast:
    """What is likely to become of a list."""

    jobs: tuple[JobForecast, ...] = ()
    """In their order, up to the first that'd fail."""

    @property
    def lasts(self) -> float:
        """For how long it'd take, times that nobody knows left out [s]."""
        return self.jobs[-1].begins + (self.jobs[-1].lasts or 0.0) if self.jobs else 0.0

    @property
    def problem(self) -> str:
        """Why it'd fail; empty if it wouldn't."""
        return self.jobs[-1].problem if self.jobs else ""
