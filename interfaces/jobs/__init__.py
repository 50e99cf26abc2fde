"""Lists of jobs for a personal robot: what is to be done, how far it is, and the machine that gets it done."""

from interfaces.jobs.file import JobFile, digest, read_jobs, written_jobs
from interfaces.jobs.forecast import dry_run
from interfaces.jobs.runner import (
    ArmControl,
    CarryOut,
    EndJob,
    JobRunner,
    Request,
    RunnerConfig,
    Show,
    SilentSpeaker,
    Speaker,
    carried_over,
    speaking_time,
)

__all__ = [
    "ArmControl",
    "CarryOut",
    "EndJob",
    "JobFile",
    "JobRunner",
    "Request",
    "RunnerConfig",
    "Show",
    "SilentSpeaker",
    "Speaker",
    "carried_over",
    "digest",
    "dry_run",
    "read_jobs",
    "speaking_time",
    "written_jobs",
]
