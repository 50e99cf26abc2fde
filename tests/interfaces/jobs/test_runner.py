"""The machine that does a list of jobs: what it asks for, what it's told, and laws for whatever comes."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from msgspec.structs import replace

from interfaces.jobs import (
    CarryOut,
    EndJob,
    JobRunner,
    RunnerConfig,
    Show,
)
from interfaces.messages.jobs import (
    ArmJob,
    Job,
    JobList,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    OperatorLoss,
    Progress,
    VoiceJob,
    WaitJob,
)
from robots.onboard.journey import Goal
from vrs.errors import InvalidValueError

A, B = Goal(1.0, 1.0, 0.0), Goal(4.0, 2.0)
SCENARIO = JobList(
    (
        MoveJob(1, "B"),
        VoiceJob(2, "Hello!"),
        MessageJob(3, "Please put the book on my top side!"),
        WaitJob(4),
        MoveJob(5, "A"),
    ),
    places={"A": A, "B": B},
)


TROUBLES = (JobRunner.interrupt, JobRunner.lose_operator)


def stages(runner: JobRunner) -> list[str]:
    return [job.stage.value for job in runner.progress.jobs]


def asked(runner: JobRunner, kind: type[Job], now: float) -> Any:
    """The one request that's due now, for a job of a kind."""
    (request,) = runner.advance(now=now)
    assert isinstance(request, CarryOut)
    assert isinstance(request.job, kind)
    return request


def test_the_papers_scenario() -> None:
    runner = JobRunner(SCENARIO)
    assert runner.receive(ListCommand.RUN, now=0.0) == ""
    there = asked(runner, MoveJob, 0.0)
    assert there.job.to == B
    runner.answer(there.attempt, now=9.0)
    said = asked(runner, VoiceJob, 9.0)
    assert said.job.text == "Hello!"
    runner.answer(said.attempt, now=10.0)
    assert runner.advance(now=10.0) == (Show("Please put the book on my top side!"),)
    assert stages(runner) == ["done", "done", "done", "running", "planned"]
    assert runner.waits_for_key
    assert runner.next_deadline() is None
    assert runner.advance(now=5000.0) == ()
    assert runner.receive(ListCommand.KEY, now=5000.0) == ""
    back = asked(runner, MoveJob, 5000.0)
    assert back.job.to == A
    runner.answer(back.attempt, now=5010.0)
    assert runner.progress.stage is JobStage.DONE
    assert set(stages(runner)) == {"done"}
    assert "done: run it" in runner.receive(ListCommand.RESUME, now=5011.0)


@pytest.mark.parametrize(
    "job", [MoveJob(2, A), VoiceJob(2, "Hello!"), WaitJob(2, 5.0), WaitJob(2), ArmJob(2, "pick")]
)
@pytest.mark.parametrize("how", [ListCommand.ABORT, ListCommand.PAUSE, *TROUBLES])
def test_ending_any_job_in_its_middle_stops_it_and_keeps_the_list(job: Job, how: Any) -> None:
    jobs = JobList((MessageJob(1, "Hm"), job, MoveJob(3, B)))
    runner = JobRunner(jobs)
    runner.receive(ListCommand.RUN, now=0.0)
    begun = [request for request in runner.advance(now=0.0) if not isinstance(request, Show)]
    assert not (how(runner, "trouble", now=1.0) if how in TROUBLES else runner.receive(how, now=1.0))
    ended = [request for request in runner.advance(now=1.0) if not isinstance(request, Show)]
    assert ended == [EndJob(request.attempt) for request in begun]
    stage = "aborted" if how is ListCommand.ABORT else "paused"
    assert stages(runner) == ["done", stage, "planned"]
    assert runner.progress.stage == stage
    assert runner.jobs == jobs
    # Late answers count for nothing.
    for request in begun:
        runner.answer(request.attempt, now=2.0)
    assert runner.advance(now=100.0) == ()
    assert stages(runner) == ["done", stage, "planned"]
    # And it can go on.
    assert runner.receive(ListCommand.RESUME, now=100.0) == ""
    assert stages(runner) == ["done", "running", "planned"]
    again = runner.advance(now=100.0)
    assert [type(request.job) for request in again] == [type(request.job) for request in begun]


def test_a_wait_that_was_paused_goes_on_with_what_was_left() -> None:
    runner = JobRunner(JobList((WaitJob(1, 10.0), VoiceJob(2, "Now"))))
    runner.receive(ListCommand.RUN, now=0.0)
    assert runner.next_deadline() == 10.0
    runner.receive(ListCommand.PAUSE, now=4.0)
    assert runner.next_deadline() is None
    runner.receive(ListCommand.RESUME, now=100.0)
    assert runner.next_deadline() == 106.0
    assert runner.advance(now=105.9) == ()
    assert asked(runner, VoiceJob, 106.0).job.text == "Now"


def test_waits_end_when_they_were_to_however_late_somebody_looks() -> None:
    runner = JobRunner(JobList((WaitJob(1, 1.0), WaitJob(2, 2.0), WaitJob(3, 4.0))))
    runner.receive(ListCommand.RUN, now=0.0)
    runner.advance(now=3.5)
    assert stages(runner) == ["done", "done", "running"]
    assert runner.next_deadline() == 7.0


def test_what_takes_too_long_has_failed_and_is_ended() -> None:
    runner = JobRunner(JobList((VoiceJob(1, "Hello!"),)), RunnerConfig(longest_voice=30.0))
    runner.receive(ListCommand.RUN, now=0.0)
    said = asked(runner, VoiceJob, 0.0)
    assert runner.advance(now=30.0) == (EndJob(said.attempt),)
    assert runner.progress.stage is JobStage.FAILED
    assert "longer" in runner.progress.reason


def test_a_job_that_fails_says_why_and_can_be_tried_again() -> None:
    runner = JobRunner(SCENARIO)
    runner.receive(ListCommand.RUN, now=0.0)
    first = asked(runner, MoveJob, 0.0)
    runner.answer(first.attempt, "there's no way", now=3.0)
    assert runner.progress.stage is JobStage.FAILED
    assert runner.progress.reason == "there's no way"
    assert runner.advance(now=4.0) == ()
    runner.receive(ListCommand.RESUME, now=5.0)
    assert asked(runner, MoveJob, 5.0).attempt > first.attempt


@pytest.mark.parametrize("loss", OperatorLoss)
def test_losing_the_operator_follows_the_policy(loss: OperatorLoss) -> None:
    runner = JobRunner(SCENARIO, RunnerConfig(loss=loss))
    runner.receive(ListCommand.RUN, now=0.0)
    first = asked(runner, MoveJob, 0.0)
    runner.lose_operator("the link is lost", now=1.0)
    if loss is OperatorLoss.STOP:
        assert runner.advance(now=1.0) == (EndJob(first.attempt),)
        assert (runner.progress.stage, runner.progress.reason) == (JobStage.PAUSED, "the link is lost")
    else:
        assert runner.advance(now=1.0) == ()
        runner.answer(first.attempt, now=2.0)
        assert asked(runner, VoiceJob, 2.0)


def shorter(jobs: JobList, number: int) -> JobList:
    """The list without a job."""
    return replace(jobs, jobs=tuple(job for job in jobs.jobs if job.number != number))


def test_a_list_is_edited_where_it_stands_still() -> None:
    runner = JobRunner(SCENARIO)
    runner.receive(ListCommand.RUN, now=0.0)
    first = asked(runner, MoveJob, 0.0)
    assert "pause or abort" in runner.load(shorter(SCENARIO, 3), now=0.5)
    runner.answer(first.attempt, now=1.0)
    runner.receive(ListCommand.PAUSE, now=1.5)
    one, _, three, four, five = SCENARIO.jobs
    edited = JobList((five, one, VoiceJob(6, "Good day!"), three, four), SCENARIO.places)
    assert runner.load(edited, now=2.0) == ""
    # The job that was paused is another one now: the list has nothing that's half done.
    assert runner.progress.stage is JobStage.PLANNED
    runner.receive(ListCommand.RESUME, now=3.0)
    runner.advance(now=3.0)
    # What is done stays done, wherever it was put; what was put before it comes first.
    assert [(job.number, known.stage) for job, known in zip(edited.jobs, runner.progress.jobs, strict=True)] == [
        (5, JobStage.RUNNING), (1, JobStage.DONE), (6, JobStage.PLANNED), (3, JobStage.PLANNED),
        (4, JobStage.PLANNED)
    ]  # fmt: skip


def test_a_list_that_was_being_done_when_it_was_saved_is_paused() -> None:
    runner = JobRunner(SCENARIO)
    runner.receive(ListCommand.RUN, now=0.0)
    other = JobRunner()
    assert other.load(runner.jobs, runner.progress, now=0.0) == ""
    assert other.progress.stage is JobStage.PAUSED
    assert "anew" in other.progress.reason
    assert other.advance(now=1.0) == ()
    assert other.receive(ListCommand.RESUME, now=2.0) == ""
    assert asked(other, MoveJob, 2.0).job.to == B


@pytest.mark.parametrize(
    ("command", "says"),
    [(ListCommand.RUN, "no job"), (ListCommand.PAUSE, "isn't being done"), (ListCommand.RESUME, "no job"),
     (ListCommand.ABORT, "isn't being done"), (ListCommand.KEY, "waits for the key"),
     (ListCommand.DRY_RUN, "virtual robot")],
)  # fmt: skip
def test_what_cant_be_done_now_says_why(command: ListCommand, says: str) -> None:
    assert says in JobRunner().receive(command, now=0.0)


def test_lists_are_whole() -> None:
    with pytest.raises(InvalidValueError, match="place of this list"):
        replace(SCENARIO, jobs=(*SCENARIO.jobs, MoveJob(7, "C")))
    with pytest.raises(InvalidValueError, match="of this list"):
        SCENARIO.index(77)
    with pytest.raises(InvalidValueError, match="each number once"):
        replace(SCENARIO, jobs=(*SCENARIO.jobs, WaitJob(5, 1.0)))
    with pytest.raises(InvalidValueError, match="at most 64"):
        JobList(tuple(WaitJob(k, 1.0) for k in range(1, 66)))


JOBS = st.sampled_from(
    [
        MoveJob(1, A),
        MoveJob(1, "A"),
        VoiceJob(1, "Hi"),
        MessageJob(1, "Look"),
        WaitJob(1),
        WaitJob(1, 0.0),
        WaitJob(1, 3.0),
        ArmJob(1, "p"),
    ]
)


class Doing(RuleBasedStateMachine):
    """Whatever is asked and answered, in whatever order, what is asked for is ended, answered or running."""

    @initialize(jobs=st.lists(JOBS, max_size=5), loss=st.sampled_from(OperatorLoss))
    def begin(self, jobs: list[Job], loss: OperatorLoss) -> None:
        numbered = tuple(replace(job, number=k) for k, job in enumerate(jobs, 1))
        self.runner = JobRunner(JobList(numbered, {"A": A}), RunnerConfig(loss=loss, longest_move=20.0))
        self.now = 0.0
        self.open: set[int] = set()
        self.over: set[int] = set()

    def take(self) -> None:
        for request in self.runner.advance(now=self.now):
            if isinstance(request, EndJob):
                assert request.attempt in self.open
                self.open.remove(request.attempt)
                self.over.add(request.attempt)
            elif not isinstance(request, Show):
                assert request.attempt not in self.open | self.over
                self.open.add(request.attempt)

    @rule(command=st.sampled_from(ListCommand))
    def command(self, command: ListCommand) -> None:
        before = self.runner.progress
        refused = self.runner.receive(command, now=self.now)
        if refused:
            assert self.runner.progress == before
        elif command is ListCommand.ABORT:
            assert self.runner.progress.stage is JobStage.ABORTED
        self.take()

    @precondition(lambda self: self.open)
    @rule(well=st.booleans())
    def answer(self, well: bool) -> None:
        attempt = self.open.pop()
        self.over.add(attempt)
        self.runner.answer(attempt, None if well else "so", now=self.now)
        self.take()

    @precondition(lambda self: self.over)
    @rule(data=st.data(), well=st.booleans())
    def answer_late(self, data: st.DataObject, well: bool) -> None:
        before = self.runner.progress
        attempt = data.draw(st.sampled_from(sorted(self.over)))
        self.runner.answer(attempt, None if well else "so", now=self.now)
        assert self.runner.progress == before

    @rule(how=st.sampled_from(TROUBLES))
    def trouble(self, how: Any) -> None:
        how(self.runner, "trouble", now=self.now)
        self.take()
        if how is JobRunner.interrupt or self.runner.config.loss is OperatorLoss.STOP:
            assert not self.open

    @rule(dt=st.sampled_from([0.1, 1.0, 10.0]))
    def wait(self, dt: float) -> None:
        self.now += dt
        self.take()

    @precondition(lambda self: not self.runner.running)
    @rule(job=JOBS)
    def add(self, job: Job) -> None:
        jobs = self.runner.jobs
        number = max((one.number for one in jobs.jobs), default=0) + 1
        longer = replace(jobs, jobs=(*jobs.jobs, replace(job, number=number)))
        assert not self.runner.load(longer, now=self.now)

    @precondition(lambda self: not self.runner.running)
    @rule()
    def restart(self) -> None:
        progress = self.runner.progress
        assert not self.runner.load(self.runner.jobs, progress, now=self.now)
        assert self.runner.progress == progress

    @invariant()
    def whole(self) -> None:
        if not hasattr(self, "runner"):
            return
        progress: Progress = self.runner.progress
        assert [job.number for job in progress.jobs] == [job.number for job in self.runner.jobs.jobs]
        running = [job for job in progress.jobs if job.stage is JobStage.RUNNING]
        assert len(running) == (1 if self.runner.running else 0)
        assert len(self.open) <= len(running)
        deadline = self.runner.next_deadline()
        assert deadline is None or deadline > self.now or deadline == -math.inf


TestDoing = Doing.TestCase
TestDoing.settings = settings(max_examples=60, stateful_step_count=25, deadline=None)


def test_only_a_wait_has_time_left_when_it_is_paused() -> None:
    for job, left in (
        (MoveJob(1, "B"), None),
        (VoiceJob(1, "Hello!"), None),
        (WaitJob(1), None),
        (WaitJob(1, 9.0), 7.0),
    ):
        runner = JobRunner(JobList((job,), places={"B": B}))
        runner.receive(ListCommand.RUN, now=0.0)
        runner.receive(ListCommand.PAUSE, now=2.0)
        assert runner.progress.jobs[0].left == left


def test_a_list_that_was_done_isnt_when_a_job_is_added() -> None:
    jobs = JobList((MessageJob(1, "Look"),))
    runner = JobRunner(jobs)
    runner.receive(ListCommand.RUN, now=0.0)
    assert runner.progress.stage is JobStage.DONE
    longer = JobList((*jobs.jobs, MessageJob(2, "Look again")))
    assert runner.load(longer, now=1.0) == ""
    assert (runner.progress.stage, stages(runner)) == (JobStage.PLANNED, ["done", "planned"])


def test_a_list_that_was_aborted_leaves_an_empty_screen() -> None:
    runner = JobRunner(JobList((MessageJob(1, "Look"), WaitJob(2))))
    runner.receive(ListCommand.RUN, now=0.0)
    runner.receive(ListCommand.ABORT, now=1.0)
    assert runner.advance(now=1.0)[-1] == Show("")
