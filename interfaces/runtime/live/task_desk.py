"""The operator's desk for what a mobile robot does by itself: goals, the list of jobs and its file, the dry run."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from msgspec.structs import replace
from typing_extensions import override

from interfaces.jobs import JobFile, JobRunner, carried_over, digest, dry_run, written_jobs
from interfaces.jobs.runner import EMPTY, RUNS
from interfaces.messages.control import Plan, Seen, SensedPoints
from interfaces.messages.jobs import (
    LONGEST_NAME,
    MOST_PLACES,
    ArmJob,
    Doing,
    Forecast,
    JobList,
    JobStage,
    ListCommand,
    MoveJob,
    OperatorLoss,
    Progress,
    RobotTask,
    TaskReport,
    Tasks,
)
from interfaces.runtime.live.devices import OperatorDevice
from interfaces.stream.codec import News
from interfaces.teleop.operator import HaltCause, OperatorSite
from interfaces.teleop.virtual_base import VirtualBase
from robots.base import MobileBase
from robots.mobile.navigation import outline_of, route_map
from robots.onboard.driving import Posture
from robots.onboard.journey import Goal
from robots.onboard.routes import NoRoute, RouteProblem
from robots.rooms import Room
from vrs.errors import FormatError

LARGEST: Final = 24_000
"""A list that's longer, as a file has it, doesn't go over the link [byte]."""
TOO_LONG: Final = "the list is too long to go over the link: shorten its programs and texts"
"""Why a list isn't taken."""
_LEFT: Final = 0.05
"""The way left is told anew when it's another by so much [m]."""

_log = logging.getLogger(__name__)


class TaskDesk(OperatorDevice):
    """Takes what clients want of a robot, keeps the list, and tells everybody how it is."""

    name = "jobs"

    def __init__(
        self,
        operator: OperatorSite[VirtualBase],
        room: Room,
        base: MobileBase,
        tell: Callable[[News], None],
        file: JobFile | None = None,
        arm: Callable[[ArmJob], float | str | None] = lambda _: None,
    ) -> None:
        """Take up the list as it was saved.

        Args:
            operator: Has the robot do it.
            room: Where the robot drives.
            base: What it is.
            tell: Lets every client know.
            file: Where the list is kept; nowhere unless given.
            arm: Says how long a program takes [s], why it'd fail, or None where nobody knows; see `dry_run`.
        """
        self._operator, self._room, self._base, self._tell = operator, room, base, tell
        self._file, self._arm = file, arm
        self.problem = ""
        """What is wrong with the file; empty if nothing is."""
        jobs, progress = self._loaded()
        for place in room.places:
            room_left = len(jobs.places) < MOST_PLACES and len(place.name) <= LONGEST_NAME
            if place.name not in jobs.places and room_left:
                jobs = jobs.with_place(place.name, Goal(place.x, place.y, place.heading))
        self.jobs = jobs
        self.progress = carried_over(jobs, progress, jobs, progress)
        self._digest = digest(jobs)
        self._forecast: Forecast | None = None
        self._roads = route_map(room, base.body)
        # The first search works all ways out, 0.3 s: not while somebody drives.
        self._roads.route(room.start[:2], room.start[:2])
        self._trying: asyncio.Task[None] | None = None
        self._report: TaskReport | None = None
        self._sight: SensedPoints | None = None
        self._told = Tasks()
        self._tell(self.plan())
        self.turn()

    def _loaded(self) -> tuple[JobList, Progress]:
        if self._file is None:
            return JobList(), Progress()
        try:
            return self._file.load()
        except FormatError as error:
            self.problem = str(error)
            _log.warning("%s", error)
            return JobList(), Progress()

    def plan(self) -> Plan:
        """The known map."""
        room, outline = self._room, outline_of(self._base.body)
        rings = tuple(tuple((round(x, 3), round(y, 3)) for x, y in ring) for ring in known_outlines(room))
        robot = outline.front, outline.rear, 2 * outline.half_width
        return Plan((room.length, room.width), rings, room.via, robot)

    def order(self, task: RobotTask) -> str:
        """Do what somebody wants; why not, empty if it's done."""
        if task.jobs is not None:
            return self._edit(task.jobs)
        if task.do is ListCommand.DRY_RUN:
            return self._try()
        if task.do is not None:
            return self._command(task, task.do)
        refusal = "" if task.go is None else self._unreachable([("", task.go)])
        return refusal or self._operator.robot.order(task)

    def _unreachable(self, goals: Sequence[tuple[str, Goal]]) -> str:
        """Why the known map has no way to goals, one after the other, from where the robot is; empty if it has.

        Args:
            goals: What each is called in front of the reason, and where it is.
        """
        report = self._operator.report
        if report is None:
            return ""
        roads, here = self._roads, (report.posture.x, report.posture.y)
        for name, goal in goals:
            there, (length, width) = (goal.x, goal.y), (self._room.length, self._room.width)
            place = f"({goal.x:.2f}, {goal.y:.2f})"
            if not (0 <= goal.x <= length and 0 <= goal.y <= width):
                return f"{name}{place} is outside the map: x is 0 to {length:g} m, y 0 to {width:g} m"
            if roads.knows(np.array([there]), 0.0)[0]:
                return f"{name}{place} is inside a wall or a thing on the map"
            found = roads.route(here, there)
            # Where it can't turn now, the robot first drives to where it can.
            if isinstance(found, NoRoute) and found.problem is not RouteProblem.START:
                return name + found.reason
            here = there
        return ""

    def _edit(self, jobs: JobList) -> str:
        """Take another list, and keep it."""
        if self._doing is Doing.JOBS:
            return RUNS
        progress = carried_over(self.jobs, self.progress, jobs)
        if len(written_jobs(jobs, progress)) > LARGEST:
            return TOO_LONG
        self.jobs, self.progress, self._digest, self._forecast = jobs, progress, digest(jobs), None
        self._keep()
        self.turn()
        return ""

    def _command(self, task: RobotTask, command: ListCommand) -> str:
        """Let the robot do something with the list, which it's given if it hasn't it."""
        refusal = JobRunner.at(self.jobs, self.progress).receive(command, now=0.0)
        # A list does what comes before the goal that can't be reached; it isn't to end one that can.
        if not refusal and command in (ListCommand.RUN, ListCommand.RESUME) and self._doing is Doing.GOAL:
            refusal = self._unreachable(self._moves(command))
        if refusal:
            return refusal
        has = self._report is not None and self._report.digest == self._digest
        if has:
            return self._operator.robot.order(task)
        return self._operator.robot.order(RobotTask(jobs=self.jobs, progress=self.progress), task)

    def _moves(self, command: ListCommand) -> list[tuple[str, Goal]]:
        """Goals of the moves that a command would begin, with the jobs' places in the list."""
        done = {job.number for job in self.progress.jobs if job.stage is JobStage.DONE}
        return [
            (f"job {k}: ", self.jobs.goal(job))
            for k, job in enumerate(self.jobs.jobs, 1)
            if isinstance(job, MoveJob) and (command is ListCommand.RUN or job.number not in done)
        ]

    def _try(self) -> str:
        """Begin a dry run of the list, from where the robot is."""
        if not self.jobs.jobs:
            return EMPTY
        report = self._operator.report
        if report is None:
            return HaltCause.NOT_MET.value
        if self._trying is None or self._trying.done():
            self._trying = asyncio.get_running_loop().create_task(self._forecasts(self.jobs))
        return ""

    async def _forecasts(self, jobs: JobList) -> None:
        """Work out how long a list takes; if it's another one by then, nobody is told."""
        report = self._operator.report
        assert report is not None
        forecast = await asyncio.to_thread(self._forecast_of, jobs, report.posture)
        if jobs == self.jobs:
            self._forecast = forecast
            self.turn()

    def _forecast_of(self, jobs: JobList, posture: Posture) -> Forecast:
        return dry_run(jobs, posture, self._roads, self._base.limits, arm=self._arm)

    @property
    def _doing(self) -> Doing:
        return self._operator.robot.doing

    @override
    def turn(self) -> None:
        """Take in what the robot has said, and tell everybody what is new."""
        report, sight = self._operator.robot.tasks, self._operator.robot.sight
        if report is not None and report is not self._report:
            self._report = report
            if report.digest == self._digest and self.jobs.jobs and report.progress != self.progress:
                self.progress = report.progress
                self._keep()
        if sight is not None and sight is not self._sight:
            self._sight = sight
            self._tell(Seen(sight.time, sight.points, sight.doubt))
        tasks = self.tasks()
        told = self._told.left
        if tasks.left and told and abs(tasks.left - told) < _LEFT:
            tasks = replace(tasks, left=told)
        if tasks != self._told:
            self._told = tasks
            self._tell(tasks)

    def tasks(self, answers: int | None = None) -> Tasks:
        """How everything is, perhaps as an answer to the order of that number."""
        report, drive = self._report or TaskReport(), self._operator.report
        left = 0.0 if drive is None else round(drive.left, 2)
        loss = None if self._report is None else report.loss
        way = report.journey, report.reason, report.goal, report.route, left
        listed = self.jobs, self.progress, self._forecast
        return Tasks(self._doing, *way, *listed, loss, report.shows, report.says, self.problem, answers)

    @property
    def carries_on(self) -> bool:
        """Whether the real robot goes on with what it does by itself where nobody has control."""
        tasks = self._operator.robot.tasks
        return self._doing is not Doing.NOTHING and tasks is not None and tasks.loss is OperatorLoss.CARRY_ON

    @override
    def health(self) -> dict[str, Any]:
        return {"stage": self.progress.stage, "problem": self.problem}

    def _keep(self) -> None:
        """Save the list."""
        if self._file is None:
            return
        try:
            self._file.save(self.jobs, self.progress)
            self.problem = ""
        except FormatError as error:
            if str(error) != self.problem:
                _log.warning("%s", error)
            self.problem = str(error)


def known_outlines(room: Room) -> list[list[tuple[float, float]]]:
    """Outlines of what the map knows of a room [m]: rectangles, and columns as polygons."""
    known, rings = room.known(), []
    for b in known.blocks:
        c, s, half = math.cos(b.angle), math.sin(b.angle), (b.length / 2, b.width / 2)
        corners = [(half[0] * i, half[1] * j) for i, j in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
        rings.append([(b.x + c * u - s * v, b.y + s * u + c * v) for u, v in corners])
    for column in known.columns:
        turns = [k * math.tau / 16 for k in range(16)]
        rings.append(
            [(column.x + column.radius * math.cos(a), column.y + column.radius * math.sin(a)) for a in turns]
        )
    return rings
