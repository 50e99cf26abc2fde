"""What a runner is told, and what it asks of those who carry jobs out, as frozen values."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TypeAlias

from interfaces.jobs.progress import Progress
from interfaces.jobs.values import JobList
from robots.onboard.journey import Goal


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
class OperatorLost:
    """Nobody is heard any more who could stop the robot: the policy says what follows."""

    reason: str


@dataclass(frozen=True, slots=True)
class Interrupted:
    """The robot has to stop, whatever the policy: it touches something, or is told to."""

    reason: str


@dataclass(frozen=True, slots=True)
class Done:
    """What was asked for has been done."""

    attempt: int


@dataclass(frozen=True, slots=True)
class JobFailed:
    """What was asked for can't be done."""

    attempt: int
    reason: str


Input: TypeAlias = ListCommand | Load | OperatorLost | Interrupted | Done | JobFailed
"""What a runner is told."""


@dataclass(frozen=True, slots=True)
class MoveTo:
    """Go to a goal; answer with `Done` or `JobFailed`."""

    attempt: int
    goal: Goal


@dataclass(frozen=True, slots=True)
class Speak:
    """Say something; answer when it's over."""

    attempt: int
    text: str


@dataclass(frozen=True, slots=True)
class Show:
    """Show a text, nothing if it's empty; it's done as soon as it's asked for."""

    text: str


@dataclass(frozen=True, slots=True)
class RunArm:
    """Carry out a VAL-II program; answer when it has ended."""

    attempt: int
    program: str
    source: str


@dataclass(frozen=True, slots=True)
class EndJob:
    """Stop with what was asked for, at once; no answer is expected, and none counts."""

    attempt: int


Request: TypeAlias = MoveTo | Speak | Show | RunArm | EndJob
"""What a runner asks for."""
