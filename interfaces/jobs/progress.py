"""How far a list of jobs is, as frozen values."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final

from interfaces.jobs.values import JobList


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
