"""The dry run against the body: what it predicts is about what happens."""

from __future__ import annotations

import math

import pytest

from interfaces.jobs import dry_run
from interfaces.messages.drive_sites import Doing, RobotTask
from interfaces.messages.jobs import (
    ArmJob,
    Forecast,
    JobList,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    VoiceJob,
    WaitJob,
)
from robots.onboard.driving import Posture
from robots.onboard.journey import Goal
from robots.onboard.routes import RouteConfig, RouteMap
from tests.interfaces.teleop.rig import MODEL, Rig


def end(forecast: Forecast) -> float:
    """When a list is likely to be done [s]."""
    return forecast[-1].begins + (forecast[-1].lasts or 0.0)


OPEN = RouteMap((10.0, 8.0), [], RouteConfig(0.4, 0.25))


def test_a_move_takes_what_the_limits_say() -> None:
    forecast = dry_run(JobList((MoveJob(1, Goal(6.0, 2.0)),)), Posture(1.0, 2.0, 0.0), OPEN, MODEL.limits)
    # 5 m straight ahead can't take less than at 0.5 m/s, with what speeding up and braking need.
    fastest = 5.0 / 0.5 + 0.5 / 0.52
    (move,) = forecast
    assert move.lasts is not None
    assert fastest <= move.lasts <= 1.6 * fastest
    assert move.route == ((1.0, 2.0), (6.0, 2.0))


def test_each_move_begins_where_the_one_before_ended() -> None:
    jobs = JobList(
        (MoveJob(1, Goal(3.0, 2.0, math.pi)), WaitJob(2, 2.0), WaitJob(3), MoveJob(4, Goal(1.0, 2.0, math.pi)))
    )
    there, wait, key, back = dry_run(jobs, Posture(1.0, 2.0, 0.0), OPEN, MODEL.limits)
    assert there.lasts is not None
    assert (wait.begins, wait.lasts) == (there.lasts, 2.0)
    assert (key.begins, key.lasts, back.begins) == (there.lasts + 2.0, None, there.lasts + 2.0)
    # Back it needn't turn any more.
    assert back.lasts is not None
    assert back.lasts < there.lasts


def test_a_program_takes_what_somebody_says_or_fails() -> None:
    jobs = JobList((ArmJob(1, "pick"), WaitJob(2, 1.0)))
    here = Posture(1.0, 2.0, 0.0)
    assert end(dry_run(jobs, here, OPEN, MODEL.limits, arm=lambda _: 7.5)) == 8.5
    failing = dry_run(jobs, here, OPEN, MODEL.limits, arm=lambda job: f"no program {job.program}")
    assert (failing[-1].problem, len(failing)) == ("no program pick", 1)


def test_the_prediction_is_about_what_happens() -> None:
    rig = Rig()
    rig.begin()
    jobs = JobList((VoiceJob(1, "Good morning"), MoveJob(2, Goal(7.0, 1.0, 0.0)), MoveJob(3, Goal(2.0, 2.0))))
    predicted = end(dry_run(jobs, Posture(*rig.truth), rig.roads, MODEL.limits))
    rig.operator.robot.order(RobotTask(jobs=jobs), RobotTask(do=ListCommand.RUN))
    rig.run(1.0)
    began = rig.now - 1.0
    while rig.operator.robot.doing is not Doing.NOTHING:
        rig.run(0.2)
        assert rig.now < began + 3 * predicted
    assert rig.operator.robot.tasks is not None
    assert rig.operator.robot.tasks.progress.stage is JobStage.DONE
    assert rig.now - began == pytest.approx(predicted, rel=0.15)


def test_a_message_takes_no_time() -> None:
    look, key = dry_run(
        JobList((MessageJob(1, "Look"), WaitJob(2, 2.0))), Posture(1.0, 2.0, 0.0), OPEN, MODEL.limits
    )
    assert (look.lasts, key.begins) == (0.0, 0.0)
