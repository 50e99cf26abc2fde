"""Lists of jobs for a personal robot: what is to be done, how far it is, and the machine that gets it done."""

from interfaces.jobs.devices import (
    ArmControl,
    NoArm,
    Screen,
    SilentSpeaker,
    Speaker,
    TextScreen,
    speaking_time,
)
from interfaces.jobs.file import JobFile, digest, read_jobs, written_jobs
from interfaces.jobs.forecast import dry_run, time_needed
from interfaces.jobs.runner import (
    CarryOut,
    Done,
    EndJob,
    Input,
    Interrupted,
    JobFailed,
    JobRunner,
    OperatorLost,
    Request,
    RunnerConfig,
    Show,
    carried_over,
)

__all__ = [
    "ArmControl",
    "CarryOut",
    "Done",
    "EndJob",
    "Input",
    "Interrupted",
    "JobFailed",
    "JobFile",
    "JobRunner",
    "NoArm",
    "OperatorLost",
    "Request",
    "RunnerConfig",
    "Screen",
    "Show",
    "SilentSpeaker",
    "Speaker",
    "TextScreen",
    "carried_over",
    "digest",
    "dry_run",
    "read_jobs",
    "speaking_time",
    "time_needed",
    "written_jobs",
]
