"""The operator's desk: who may ask for what, the list and its file, a restart, the dry run."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from interfaces.jobs import JobFile
from interfaces.messages.control import Plan
from interfaces.messages.jobs import (
    Doing,
    JobList,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    RobotTask,
    Tasks,
    VoiceJob,
    WaitJob,
)
from interfaces.runtime.live.base_twins import ROUTE_SPEED, route_timeline
from interfaces.runtime.live.task_desk import TOO_LONG, TaskDesk
from interfaces.stream.codec import News
from interfaces.teleop.operator import HaltCause
from robots.onboard.journey import Goal, JourneyState
from robots.rooms import Block, Place, Room
from tests.interfaces.teleop.rig import MODEL, Rig

ROOM = Room("Test", 8.0, 6.0, places=(Place("A", 1.0, 2.0, 0.5), Place("B", 2.5, 3.0)), via=((2.0, 2.0),))
JOBS = JobList(
    (VoiceJob(1, "Hello!"), MoveJob(2, "B"), WaitJob(3)), places={"B": Goal(2.5, 3.0), "A": Goal(1.0, 2.0, 0.5)}
)


class Office:
    """A desk, its robot, and what it has told everybody."""

    def __init__(self, path: Path | None = None, room: Room = ROOM) -> None:
        self.rig = Rig(hold=True)
        self.told: list[News] = []
        file = None if path is None else JobFile(path)
        self.desk = TaskDesk(self.rig.operator, room, MODEL, self.told.append, file)

    def run(self, seconds: float) -> None:
        self.rig.run(seconds, lambda _: self.desk.turn())

    def order(self, task: RobotTask) -> str:
        return self.desk.order(task)

    @property
    def tasks(self) -> Tasks:
        return next(news for news in reversed(self.told) if isinstance(news, Tasks))


def test_everybody_is_told_the_map_and_its_places() -> None:
    office = Office()
    plan = office.told[0]
    assert isinstance(plan, Plan)
    assert (plan.size, plan.via) == ((8.0, 6.0), ((2.0, 2.0),))
    assert dict(office.desk.jobs.places) == {"A": Goal(1.0, 2.0, 0.5), "B": Goal(2.5, 3.0)}
    assert office.order(RobotTask(go=Goal(1.0, 1.0))) == HaltCause.NOT_MET


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (Goal(1.0, 9.0), "outside the map: x is 0 to 8 m, y 0 to 6 m"),
        (Goal(4.0, 1.0), "inside a wall or a thing"),
        (Goal(4.0, 2.3), "too near to something"),
        (Goal(7.0, 5.2), "no way from"),
    ],
)
def test_a_bad_goal_says_why_and_leaves_a_good_one_under_way(goal: Goal, why: str) -> None:
    boxes = ((4.0, 1.0, 2.0, 2.0), (6.9, 4.0, 2.2, 0.2), (5.9, 5.0, 0.2, 2.2))
    walls = tuple(Block("wall", *box, angle=0.0, height=1.0) for box in boxes)
    office = Office(room=replace(ROOM, blocks=walls))
    office.rig.begin()
    good = Goal(2.5, 4.0)
    assert office.order(RobotTask(go=good)) == ""
    office.run(1.5)
    assert why in office.order(RobotTask(go=goal))
    # A list of several points is refused as a whole, by the first that can't be reached.
    jobs = JobList((WaitJob(1, 1.0), MoveJob(2, Goal(1.0, 2.0)), MoveJob(5, goal)))
    assert office.order(RobotTask(jobs=jobs)) == ""
    refusal = office.order(RobotTask(do=ListCommand.RUN))
    assert refusal.startswith("job 3: ")
    assert why in refusal
    office.run(1.0)
    assert (office.tasks.doing, office.tasks.goal) == (Doing.GOAL, good)
    office.run(30.0)
    assert office.tasks.journey is JourneyState.ARRIVED


def test_a_bad_goal_leaves_a_list_that_is_being_done_alone() -> None:
    office = Office()
    office.rig.begin()
    office.order(RobotTask(jobs=JOBS))
    office.order(RobotTask(do=ListCommand.RUN))
    office.run(2.5)
    assert "outside the map" in office.order(RobotTask(go=Goal(-1.0, 1.0)))
    office.run(1.0)
    assert office.tasks.doing is Doing.JOBS
    assert office.tasks.progress.stage is JobStage.RUNNING


def test_a_list_is_done_and_saved_at_each_step(tmp_path: Path) -> None:
    path = tmp_path / "jobs.json"
    office = Office(path)
    office.rig.begin()
    assert "no job" in office.order(RobotTask(do=ListCommand.RUN))
    assert office.order(RobotTask(jobs=JOBS)) == ""
    assert JobFile(path).load()[0] == JOBS
    assert office.order(RobotTask(do=ListCommand.RUN)) == ""
    office.run(1.5)
    assert office.desk.progress.jobs[1].stage is JobStage.RUNNING
    assert JobFile(path).load()[1] == office.desk.progress
    assert "pause or abort" in office.order(RobotTask(jobs=JobList(JOBS.jobs[:2], JOBS.places)))
    assert "being done" in office.order(RobotTask(do=ListCommand.RUN))
    office.run(20.0)
    assert office.tasks.doing is Doing.JOBS
    assert "isn't being done" not in office.order(RobotTask(do=ListCommand.KEY))
    office.run(1.0)
    assert office.tasks.progress.stage is JobStage.DONE
    assert JobFile(path).load()[1].stage is JobStage.DONE
    count = len(office.told)
    office.run(3.0)
    assert len(office.told) == count, "nothing new is told"


def test_a_station_that_is_started_anew_has_the_list_and_goes_on_with_it(tmp_path: Path) -> None:
    path = tmp_path / "jobs.json"
    office = Office(path)
    office.rig.begin()
    office.order(RobotTask(jobs=JOBS))
    office.order(RobotTask(do=ListCommand.RUN))
    office.run(2.5)
    assert office.desk.progress.jobs[1].stage is JobStage.RUNNING
    again = Office(path)
    assert again.desk.jobs == JOBS
    assert again.desk.progress.stage is JobStage.PAUSED
    assert "anew" in again.desk.progress.reason
    again.rig.begin()
    again.run(1.0)
    assert again.tasks.doing is Doing.NOTHING
    assert again.order(RobotTask(do=ListCommand.RESUME)) == ""
    again.run(1.0)
    assert [job.stage for job in again.desk.progress.jobs] == [JobStage.DONE, JobStage.RUNNING, JobStage.PLANNED]


def test_a_damaged_file_is_told_of_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "jobs.json"
    path.write_text("{")
    office = Office(path)
    assert "is no list of jobs" in office.tasks.problem
    assert path.read_text() == "{"
    office.order(RobotTask(jobs=JOBS))
    assert office.tasks.problem == ""
    assert (tmp_path / "jobs.json.damaged").read_text() == "{"


def test_a_list_that_is_too_long_for_the_link_is_refused() -> None:
    assert (
        Office().order(RobotTask(jobs=JobList(tuple(MessageJob(k, "x" * 400) for k in range(1, 65))))) == TOO_LONG
    )


def test_an_aborted_list_can_be_aborted_after_a_restart_too(tmp_path: Path) -> None:
    path = tmp_path / "jobs.json"
    office = Office(path)
    office.rig.begin()
    office.order(RobotTask(jobs=JOBS))
    office.order(RobotTask(do=ListCommand.RUN))
    office.run(2.5)
    again = Office(path)
    again.rig.begin()
    assert again.order(RobotTask(do=ListCommand.ABORT)) == ""
    again.run(1.0)
    assert again.desk.progress.stage is JobStage.ABORTED
    assert again.desk.jobs == JOBS


def test_a_dry_run_says_how_long_it_takes_and_what_would_fail() -> None:
    async def tried(jobs: JobList) -> Tasks:
        office = Office()
        office.rig.begin()
        assert "no job" in office.order(RobotTask(do=ListCommand.DRY_RUN))
        office.order(RobotTask(jobs=jobs))
        assert office.order(RobotTask(do=ListCommand.DRY_RUN)) == ""
        while office.tasks.forecast is None:
            await asyncio.sleep(0.01)
        return office.tasks

    forecast = asyncio.run(tried(JOBS)).forecast
    assert forecast is not None
    voice, move, wait = forecast
    assert voice.lasts == pytest.approx(0.69)
    # 1.8 m at 0.5 m/s, with turning, and speeding up and down.
    assert move.lasts is not None
    assert 3.6 < move.lasts < 12.0
    assert move.begins == voice.lasts
    assert wait.lasts is None
    failing = asyncio.run(tried(JobList((MoveJob(1, Goal(-3.0, 0.0)), WaitJob(2, 1.0))))).forecast
    assert failing is not None
    assert "can't turn" in failing[-1].problem
    assert len(failing) == 1


def test_a_route_is_drawn_as_a_path_through_its_points() -> None:
    route = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (2.0, 1.0), (0.0, 1.0))
    drawn = route_timeline(route)
    assert drawn.end == pytest.approx(5.0 / ROUTE_SPEED, abs=0.01)
    for way, place in ((0.0, (0.0, 0.0)), (1.0, (1.0, 0.0)), (2.5, (2.0, 0.5)), (5.0, (0.0, 1.0))):
        assert drawn.sample(way / ROUTE_SPEED)[:2] == pytest.approx(place, abs=0.01)
