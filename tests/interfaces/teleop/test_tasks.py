"""A mobile robot that drives to goals and does jobs by itself, in virtual time: orders, stops, a lost operator."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from interfaces.jobs import RunnerConfig
from interfaces.link import Conditions, LinkConditions, delay_profile, loss_model
from interfaces.messages.fields import Epoch
from interfaces.messages.jobs import (
    HALT,
    ArmJob,
    Doing,
    Errand,
    Job,
    JobList,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    OperatorLoss,
    Progress,
    RobotTask,
    VoiceJob,
    WaitJob,
)
from interfaces.messages.sites import DriveOrders
from interfaces.teleop.operator import HaltCause
from robots.onboard.driving import IPR_LIMITS, STAND, Drive, Posture
from robots.onboard.journey import Goal, JourneyState
from tests.interfaces.teleop.rig import CONTROL, TURN, Rig
from vrs.errors import InvalidValueError

THERE = Goal(2.0, 4.0, math.pi / 2)
FAR = Goal(7.0, 1.0, 0.0)


def stands(rig: Rig) -> bool:
    """Whether the body stays where it is for a second."""
    before = rig.truth
    rig.run(1.0)
    return math.dist(before[:2], rig.truth[:2]) < 1e-3


def within_limits(rig: Rig) -> bool:
    most = IPR_LIMITS.a_max * CONTROL * TURN + 1e-9
    return all(abs(b[0] - a[0]) <= most for a, b in pairwise(rig.drives))


def report(rig: Rig) -> tuple[JourneyState, str]:
    tasks = rig.operator.robot.tasks
    assert tasks is not None
    return tasks.journey, tasks.reason


def test_a_goal_is_reached_and_the_next_drive_begins_there() -> None:
    rig = Rig()
    rig.begin()
    assert rig.operator.robot.order(RobotTask(go=THERE)) == ""
    rig.run(2.0)
    assert rig.operator.cause is HaltCause.BY_ITSELF
    assert rig.operator.robot.doing is Doing.GOAL
    assert rig.operator.robot.tasks is not None
    assert rig.operator.robot.tasks.route[-1] == (THERE.x, THERE.y)
    assert rig.operator.robot.virtual(rig.now) == rig.operator.report.posture  # type: ignore[union-attr]
    rig.run(25.0)
    assert report(rig) == (JourneyState.ARRIVED, "")
    assert math.dist(rig.truth[:2], (THERE.x, THERE.y)) < 0.05
    assert abs(math.remainder(rig.truth[2] - math.pi / 2, math.tau)) < math.radians(2)
    assert within_limits(rig)
    assert rig.operator.cause is HaltCause.STOPPED
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(2.0, rig.wish(-0.3, 0.0))
    assert rig.truth[1] < 3.9


def test_a_goal_behind_a_wall_is_driven_round_it_and_one_in_it_is_refused_with_a_reason() -> None:
    rig = Rig()
    rig.begin()
    rig.operator.robot.order(RobotTask(go=FAR))
    rig.run(60.0)
    assert report(rig)[0] is JourneyState.ARRIVED
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(0.5)
    rig.operator.robot.order(RobotTask(go=Goal(4.1, 1.0)))
    rig.run(1.0)
    state, reason = report(rig)
    assert state is JourneyState.FAILED
    assert "can't turn" in reason
    assert stands(rig)


def test_a_goal_given_while_driving_waits_until_the_robot_rests_and_the_wheel_takes_over() -> None:
    rig = Rig()
    rig.begin()
    rig.run(2.0, rig.wish(0.4, 0.3))
    rig.operator.robot.order(RobotTask(go=THERE))
    rig.run(4.0)
    assert rig.operator.robot.doing is Doing.GOAL
    assert within_limits(rig)
    # A wish to stand takes nothing over; one to drive does.
    rig.operator.robot.wish(0.0, 0.0, issued_at=rig.now, now=rig.now)
    assert rig.operator.robot.doing is Doing.GOAL
    assert HaltCause.STOPPED in rig.operator.robot.wish(0.2, 0.0, issued_at=rig.now, now=rig.now)
    rig.run(3.0)
    assert rig.autonomy.doing is Doing.NOTHING
    assert stands(rig)
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(1.0, rig.wish(0.2, 0.0))


def test_what_is_told_arrives_on_a_bad_link_once_each_and_in_its_order() -> None:
    rig = Rig(hold=True)
    way = Conditions(delay=delay_profile("mon"), loss=loss_model("0.3"))
    rig.begin()
    rig.line.change(LinkConditions.symmetric(way), now=rig.now)
    jobs = JobList((VoiceJob(1, "Hello!"), MoveJob(2, THERE), WaitJob(3, 1.0)))
    assert rig.operator.robot.order(RobotTask(jobs=jobs), RobotTask(do=ListCommand.RUN)) == ""
    rig.run(30.0)
    tasks = rig.operator.robot.tasks
    assert tasks is not None
    assert tasks.progress.stage is JobStage.DONE
    assert rig.operator.robot.doing is Doing.NOTHING


def test_a_stop_overrules_what_the_robot_hasnt_heard_yet_and_the_numbers_go_on() -> None:
    rig = Rig()
    rig.begin()
    rig.operator.robot.order(RobotTask(go=THERE), RobotTask(go=FAR))
    (told,) = rig.operator.advance(now=rig.now)
    rig.operator.robot.stop(now=rig.now)
    (stopped,) = rig.operator.advance(now=rig.now)
    assert [(errand.number, errand.task.go) for errand in told.errands] == [(1, THERE), (2, FAR)]
    assert [(errand.number, errand.task) for errand in stopped.errands] == [(3, HALT)]
    rig.run(1.0)
    assert rig.autonomy.doing is Doing.NOTHING
    assert stands(rig)


@pytest.mark.parametrize(
    "job", [MoveJob(2, THERE), VoiceJob(2, "A long text that takes a while. " * 6), WaitJob(2, 30.0), WaitJob(2)]
)
@pytest.mark.parametrize("stop", ["abort", "pause", "stop", "wheel", "touch"])
def test_stopping_in_the_middle_of_a_job_leaves_the_robot_standing_and_the_list_intact(job: Job, stop: str) -> None:
    rig = Rig()
    rig.begin()
    jobs = JobList((MessageJob(1, "Look"), job, MoveJob(3, FAR)))
    rig.operator.robot.order(RobotTask(jobs=jobs), RobotTask(do=ListCommand.RUN))
    rig.run(2.0)
    assert rig.operator.robot.doing is Doing.JOBS
    if stop in {"abort", "pause"}:
        rig.operator.robot.order(RobotTask(do=ListCommand(stop)))
    elif stop == "stop":
        rig.operator.robot.stop(now=rig.now)
    elif stop == "wheel":
        rig.operator.robot.wish(0.2, 0.0, issued_at=rig.now, now=rig.now)
    else:
        rig.host.halt("the robot touches something: chair", now=rig.now + rig.AHEAD)
    rig.run(1.5)
    assert stands(rig)
    assert within_limits(rig)
    tasks = rig.operator.robot.tasks
    assert tasks is not None
    assert tasks.progress.stage is (JobStage.ABORTED if stop == "abort" else JobStage.PAUSED)
    assert rig.autonomy.runner.jobs == jobs
    assert not rig.hands.speaker.is_speaking(now=rig.now)
    assert not tasks.says
    # And it goes on under a new drive.
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(0.5)
    assert rig.operator.robot.order(RobotTask(do=ListCommand.RESUME)) == ""
    rig.run(1.0)
    assert rig.operator.robot.doing is Doing.JOBS


def test_a_job_without_an_arm_fails_and_says_so() -> None:
    rig = Rig()
    rig.begin()
    rig.operator.robot.order(
        RobotTask(jobs=JobList((ArmJob(1, "pick"), MoveJob(2, THERE)))), RobotTask(do=ListCommand.RUN)
    )
    rig.run(1.0)
    tasks = rig.operator.robot.tasks
    assert tasks is not None
    assert (tasks.progress.stage, tasks.progress.jobs[0].stage) == (JobStage.FAILED, JobStage.FAILED)
    assert "no arm" in tasks.progress.reason
    assert stands(rig)


@pytest.mark.parametrize("hold", [False, True])
@pytest.mark.parametrize("loss", OperatorLoss)
@pytest.mark.parametrize("jobs", [True, False])
def test_losing_the_operator_follows_the_policy(hold: bool, loss: OperatorLoss, jobs: bool) -> None:
    rig = Rig(hold=hold, jobs=RunnerConfig(loss=loss))
    rig.begin()
    listed = JobList((MoveJob(1, THERE), WaitJob(2), VoiceJob(3, "Hi")))
    list_and_run = RobotTask(jobs=listed), RobotTask(do=ListCommand.RUN)
    rig.operator.robot.order(*(list_and_run if jobs else (RobotTask(go=THERE),)))
    rig.run(2.0)
    rig.line.connected = False
    rig.run(4.0)
    if loss is OperatorLoss.STOP:
        assert stands(rig)
        assert rig.autonomy.doing is Doing.NOTHING
        assert math.dist(rig.truth[:2], (THERE.x, THERE.y)) > 0.3
        rig.line.connected = True
        rig.run(2.0)
        assert stands(rig)
        if jobs:
            assert rig.operator.robot.tasks is not None
            assert rig.operator.robot.tasks.progress.stage is JobStage.PAUSED
    else:
        rig.run(20.0)
        assert math.dist(rig.truth[:2], (THERE.x, THERE.y)) < 0.05
        rig.line.connected = True
        rig.run(2.0)
        if jobs:
            # It's heard again, and may end its waiting.
            assert rig.operator.robot.doing is Doing.JOBS
            assert rig.operator.robot.order(RobotTask(do=ListCommand.KEY)) == ""
            rig.run(3.0)
            assert rig.operator.robot.tasks is not None
            assert rig.operator.robot.tasks.progress.stage is JobStage.DONE
        assert rig.autonomy.doing is Doing.NOTHING
    # Nothing moves any more before somebody says so.
    rig.run(1.0)
    assert stands(rig)
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(1.0)
    assert rig.operator.robot.order(RobotTask(go=FAR)) == ""
    rig.run(2.0)
    assert rig.operator.robot.doing is Doing.GOAL


def test_what_was_told_just_before_the_link_broke_doesnt_begin_when_it_is_back() -> None:
    rig = Rig()
    rig.begin()
    rig.line.connected = False
    rig.operator.robot.order(RobotTask(go=THERE))
    rig.run(3.0)
    rig.line.connected = True
    rig.run(3.0)
    assert stands(rig)
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(2.0)
    assert rig.autonomy.doing is Doing.NOTHING
    assert stands(rig)


def test_what_is_given_while_the_robot_comes_to_rest_begins_then_unless_that_takes_long() -> None:
    rig = Rig()
    rig.begin()
    rig.operator.robot.order(RobotTask(jobs=JobList((MoveJob(1, THERE),))), RobotTask(do=ListCommand.RUN))
    rig.run(4.0)
    rig.operator.robot.order(RobotTask(do=ListCommand.PAUSE))
    while rig.operator.cause is not HaltCause.STOPPED:
        rig.run(0.05)
    assert rig.operator.robot.order(RobotTask(do=ListCommand.RESUME)) == ""
    assert rig.operator.robot.doing is Doing.NOTHING
    rig.run(2.0)
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(1.0)
    assert rig.operator.robot.doing is Doing.JOBS
    rig.operator.robot.stop(now=rig.now)
    rig.operator.robot.order(RobotTask(go=FAR))
    rig.run(6.0)
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(1.0)
    assert rig.operator.robot.doing is Doing.NOTHING
    # A stop forgets it.
    rig.operator.robot.stop(now=rig.now)
    rig.operator.robot.order(RobotTask(go=FAR))
    rig.operator.robot.stop(now=rig.now)
    rig.run(1.0)
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(1.0)
    assert rig.operator.robot.doing is Doing.NOTHING


def test_what_stops_counts_however_old_it_is_and_nothing_else_does() -> None:
    rig = Rig(jobs=RunnerConfig(loss=OperatorLoss.CARRY_ON))
    rig.begin()
    rig.operator.robot.order(RobotTask(jobs=JobList((WaitJob(1), MoveJob(2, FAR)))), RobotTask(do=ListCommand.RUN))
    rig.run(1.0)
    rig.line.change(LinkConditions.symmetric(Conditions(delay=delay_profile("constant:1.0"))), now=rig.now)
    rig.run(4.0)
    assert rig.autonomy.doing is Doing.JOBS
    rig.operator.robot.order(RobotTask(do=ListCommand.KEY))
    rig.run(3.0)
    assert rig.autonomy.report().progress.jobs[0].stage is JobStage.RUNNING, "too old to move anything"
    rig.operator.robot.order(RobotTask(do=ListCommand.ABORT))
    rig.run(3.0)
    assert rig.autonomy.report().progress.stage is JobStage.ABORTED
    assert stands(rig)


def test_no_drive_begins_while_a_list_is_being_done_though_the_robot_rests() -> None:
    rig = Rig(hold=True)
    rig.begin()
    rig.operator.robot.order(RobotTask(jobs=JobList((WaitJob(1),))), RobotTask(do=ListCommand.RUN))
    rig.run(1.0)
    robot, (x, y, theta) = rig.robot, rig.truth
    epoch = robot.epoch
    start = Posture(x, y, theta)
    robot.receive(DriveOrders(Epoch(epoch + 1), 1, rig.now, rig.now, 0.0, start), now=rig.now)
    assert robot.epoch == epoch
    assert rig.autonomy.doing is Doing.JOBS


def test_another_operator_finds_the_list_paused() -> None:
    rig = Rig(jobs=RunnerConfig(loss=OperatorLoss.CARRY_ON))
    rig.begin()
    rig.operator.robot.order(RobotTask(jobs=JobList((MoveJob(1, THERE),))), RobotTask(do=ListCommand.RUN))
    rig.run(2.0)
    rig.line.connected = False
    rig.run(2.5)
    assert rig.autonomy.doing is Doing.JOBS
    assert rig.host.hello("another", now=rig.now + rig.AHEAD) == ""
    rig.run(3.0)
    assert rig.autonomy.doing is Doing.NOTHING
    assert rig.autonomy.report().progress.stage is JobStage.PAUSED
    assert stands(rig)


class Busy:
    """An arm whose programs never end by themselves."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def run(self, program: str, source: str, *, now: float) -> str:
        self.told.append(program)
        return ""

    def end(self, *, now: float) -> None:
        self.told.append("end")

    def outcome(self, *, now: float) -> str | None:
        return None


@pytest.mark.parametrize("stop", [*(RobotTask(do=word) for word in (ListCommand.ABORT, ListCommand.PAUSE)), HALT])
def test_an_arm_that_works_is_stopped_with_its_list(stop: RobotTask) -> None:
    arm = Busy()
    autonomy = Rig(arm=arm).autonomy
    autonomy.receive(RobotTask(jobs=JobList((ArmJob(1, "pick"),))), now=0.0)
    autonomy.receive(RobotTask(do=ListCommand.RUN), now=0.0)
    assert arm.told == ["pick"]
    autonomy.receive(stop, now=1.0)
    assert arm.told == ["pick", "end"]


def test_a_task_is_one_thing_and_a_robot_makes_no_dry_run() -> None:
    for given in ({}, {"go": THERE, "do": ListCommand.RUN}, {"progress": Progress()}):
        with pytest.raises(InvalidValueError, match="one of go, do, jobs and halt"):
            RobotTask(**given)  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="what a robot does"):
        Errand(1, RobotTask(do=ListCommand.DRY_RUN))


def test_it_sets_out_from_rest() -> None:
    rig = Rig()
    here = Posture(1.0, 2.0, 0.5)
    rig.autonomy.receive(RobotTask(go=THERE), now=0.0)
    assert rig.autonomy.drive(here, Drive(0.3, 0.0), now=0.0) is None
    assert rig.autonomy.doing is Doing.GOAL
    assert rig.autonomy.drive(here, STAND, now=0.05) is not None
