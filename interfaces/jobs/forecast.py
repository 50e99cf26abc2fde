"""A dry run: how long the jobs of a list are likely to take, on a robot that drives exactly as it's told.

The virtual robot drives over the known map, within its limits, and nothing stands in its way. Speaking takes as
long as `speaking_time` says, an arm's program isn't known here, and nobody knows when a key is pressed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from interfaces.jobs.runner import speaking_time
from interfaces.messages.fields import MOST_POINTS
from interfaces.messages.jobs import (
    ArmJob,
    Forecast,
    Job,
    JobForecast,
    JobList,
    MessageJob,
    MoveJob,
    VoiceJob,
    WaitJob,
)
from robots.onboard.driving import STAND, Drive, Posture, kept
from robots.onboard.journey import GOING, Journey, JourneyState
from robots.onboard.routes import RouteMap
from vrs.mobile import DriveLimits
from vrs.mobile.model import advanced

PERIOD: Final = 0.05
"""Between two drives [s]."""
LONGEST: Final = 1800.0
"""A move isn't followed for longer [s]."""


def dry_run(
    jobs: JobList,
    posture: Posture,
    roads: RouteMap,
    limits: DriveLimits,
    *,
    arm: Callable[[ArmJob], float | str | None] = lambda _: None,
) -> Forecast:
    """Do a list on the virtual robot.

    Args:
        jobs: The list.
        posture: Where the robot stands when it begins.
        roads: The known ways.
        limits: Of the robot.
        arm: Says how long a program takes [s], why it'd fail, or None where nobody knows.
    """
    found: list[JobForecast] = []
    t = 0.0
    for job in jobs.jobs:
        if isinstance(job, MoveJob):
            moved, posture = _moved(job, jobs, t, posture, roads, limits)
            found.append(moved)
        else:
            lasts = _lasts(job, arm)
            why = lasts if isinstance(lasts, str) else ""
            found.append(JobForecast(job.number, t, None if isinstance(lasts, str) else lasts, problem=why))
        if found[-1].problem:
            break
        t += found[-1].lasts or 0.0
    return tuple(found)


def _lasts(job: Job, arm: Callable[[ArmJob], float | str | None]) -> float | str | None:
    match job:
        case VoiceJob():
            return speaking_time(job.text)
        case WaitJob():
            return job.seconds
        case ArmJob():
            return arm(job)
        case MessageJob() | MoveJob():
            return 0.0


def _moved(
    move: MoveJob, jobs: JobList, begins: float, posture: Posture, roads: RouteMap, limits: DriveLimits
) -> tuple[JobForecast, Posture]:
    """Drive to a goal; what became of it, and where the robot stands then."""
    journey, drive, t = Journey(roads), STAND, 0.0
    journey.go(jobs.goal(move), posture, now=0.0)
    route = () if journey.route is None else journey.route.points
    while journey.state in GOING and t < LONGEST:
        wanted = journey.control(posture, now=t, v_before=drive.v)
        drive = Drive(*kept(wanted.v, wanted.w, drive.v, PERIOD, limits))
        posture = Posture(*advanced(posture, drive.v, drive.w, PERIOD))
        t += PERIOD
    arrived = journey.state is JourneyState.ARRIVED
    problem = "" if arrived else journey.reason or f"it'd take longer than {LONGEST:g} s"
    return JobForecast(move.number, begins, t if arrived else None, route[:MOST_POINTS], problem), posture
