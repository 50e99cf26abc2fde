"""Messages of what a mobile robot does by itself, on the wire."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from interfaces.jobs import Forecast, JobForecast, ListCommand, Load, OperatorLoss
from interfaces.jobs.forms import GoalForm, JobListForm, ProgressForm
from interfaces.jobs.values import MOST_JOBS
from interfaces.stream import tasks
from interfaces.teleop.tasks import MOST_POINTS, Doing, Errand, Go, Halt, SensedPoints, Task, TaskReport
from interfaces.wire.fields import Count, Epoch, Message, Number, Stamp, Text, Wire, Word, digits, epoch, text
from robots.onboard.journey import JourneyState
from vrs.checks import one_of
from vrs.errors import InvalidValueError

MOST_THINGS = 1000
"""Outlines of a map."""
MOST_CORNERS = 64
"""Of an outline."""
Coordinate = Annotated[float, Meta(ge=-1e9, le=1e9)]
PointRow = tuple[Coordinate, Coordinate]
Points = Annotated[tuple[PointRow, ...], Meta(max_length=MOST_POINTS)]
Distance = Annotated[float, Meta(ge=0, le=1e9)]
Variance = Annotated[float, Meta(ge=-1e9, le=1e9)]
Doubt = tuple[Variance, Variance, Variance]


class TaskForm(Wire, frozen=True, omit_defaults=True, gc=False):
    """A task: one of its fields is there, of `jobs` perhaps with how far that list is."""

    go: GoalForm | None = None
    do: Word | None = None
    jobs: JobListForm | None = None
    progress: ProgressForm | None = None
    halt: Text | None = None

    @classmethod
    def of(cls, task: Task | tasks.Wanted) -> TaskForm:
        """The wire form."""
        match task:
            case Go(goal):
                return cls(go=GoalForm.of(goal))
            case Halt(reason):
                return cls(halt=text(reason))
            case Load(jobs, progress):
                form = None if progress is None else ProgressForm.of(progress)
                return cls(jobs=JobListForm.of(jobs), progress=form)
            case _:
                return cls(do=task.value)

    def read(self) -> Task | tasks.Trial:
        """The task.

        Raises:
            InvalidValueError: If it's none, or more than one.
        """
        given = [name for name in ("go", "do", "jobs", "halt") if getattr(self, name) is not None]
        if len(given) != 1:
            raise InvalidValueError("task", ", ".join(given), "one of go, do, jobs and halt")
        if self.go is not None:
            return Go(self.go.read())
        if self.do is not None:
            return _word(self.do)
        if self.jobs is not None:
            return Load(self.jobs.read(), None if self.progress is None else self.progress.read())
        assert self.halt is not None
        return Halt(self.halt)


def _word(do: str) -> ListCommand | tasks.Trial:
    """What is asked for in a word.

    Raises:
        InvalidValueError: If nothing has that word.
    """
    words: dict[str, ListCommand | tasks.Trial] = {word.value: word for word in (*ListCommand, *tasks.Trial)}
    return words[one_of("do", do, words)]


class ErrandForm(Wire, frozen=True, omit_defaults=True, gc=False):
    """`Errand`."""

    number: Number
    task: TaskForm

    @classmethod
    def of(cls, errand: Errand) -> ErrandForm:
        """The wire form."""
        return cls(errand.number, TaskForm.of(errand.task))

    def read(self) -> Errand:
        """The errand.

        Raises:
            InvalidValueError: If a robot can't be asked that.
        """
        task = self.task.read()
        if isinstance(task, tasks.Trial):
            raise InvalidValueError("task", task.value, "what a robot does")
        return Errand(self.number, task)


class TaskReportForm(Wire, frozen=True, omit_defaults=True, gc=False):
    """`TaskReport`."""

    journey: JourneyState = JourneyState.IDLE
    reason: Text = ""
    goal: GoalForm | None = None
    route: Points = ()
    digest: Word = ""
    progress: ProgressForm = ProgressForm()
    loss: OperatorLoss = OperatorLoss.STOP
    shows: Text = ""
    says: Text = ""

    @classmethod
    def of(cls, report: TaskReport) -> TaskReportForm:
        """The wire form."""
        goal = None if report.goal is None else GoalForm.of(report.goal)
        way = text(report.reason), goal, report.route[:MOST_POINTS]
        jobs = report.digest, ProgressForm.of(report.progress), report.loss
        return cls(report.journey, *way, *jobs, report.shows, report.says)

    def read(self) -> TaskReport:
        """The report."""
        goal = None if self.goal is None else self.goal.read()
        jobs = self.digest, self.progress.read(), self.loss
        return TaskReport(self.journey, self.reason, goal, self.route, *jobs, self.shows, self.says)


class SightForm(Wire, frozen=True, omit_defaults=True, gc=False):
    """`SensedPoints`."""

    time: Stamp
    points: Points = ()
    doubt: Doubt | None = None

    @classmethod
    def of(cls, sight: SensedPoints) -> SightForm:
        """The wire form."""
        return cls(sight.time, sight.points[:MOST_POINTS], sight.doubt)

    def read(self) -> SensedPoints:
        """What is seen."""
        return SensedPoints(self.time, self.points, self.doubt)


class TaskOrderWire(Message, frozen=True, omit_defaults=True, gc=False, tag="task"):
    """`TaskOrder`."""

    number: Number
    task: TaskForm
    epoch: Epoch | None = None

    @override
    @classmethod
    def of(cls, value: tasks.TaskOrder, packed: bool) -> TaskOrderWire:
        return cls(value.number, TaskForm.of(value.wanted), digits(value.epoch))

    def read(self) -> tasks.TaskOrder:
        """The order.

        Raises:
            InvalidValueError: If a client can't ask that.
        """
        wanted = self.task.read()
        if isinstance(wanted, Halt):
            raise InvalidValueError("task", "halt", "go, do or jobs: the order of a stop halts")
        return tasks.TaskOrder(self.number, epoch(self.epoch), wanted)


class JobForecastForm(Wire, frozen=True, omit_defaults=True, gc=False):
    """`JobForecast`."""

    number: Number
    begins: Distance
    lasts: Distance | None = None
    route: Points = ()
    problem: Text = ""

    def read(self) -> JobForecast:
        """What is likely."""
        return JobForecast(self.number, self.begins, self.lasts, self.route, self.problem)


class TasksWire(Message, frozen=True, omit_defaults=True, gc=False, tag="tasks"):
    """`Tasks`."""

    doing: Doing = Doing.NOTHING
    journey: JourneyState = JourneyState.IDLE
    reason: Text = ""
    goal: GoalForm | None = None
    route: Points = ()
    left: Distance | None = None
    jobs: JobListForm = JobListForm()
    progress: ProgressForm = ProgressForm()
    forecast: Annotated[tuple[JobForecastForm, ...], Meta(max_length=MOST_JOBS)] | None = None
    loss: OperatorLoss | None = None
    shows: Text = ""
    says: Text = ""
    problem: Text = ""
    answers: Count | None = None

    @override
    @classmethod
    def of(cls, value: tasks.Tasks, packed: bool) -> TasksWire:
        goal = None if value.goal is None else GoalForm.of(value.goal)
        way = text(value.reason), goal, value.route[:MOST_POINTS], value.left or None
        forms = None
        if value.forecast is not None:
            forms = tuple(
                JobForecastForm(job.number, job.begins, job.lasts, job.route[:MOST_POINTS], text(job.problem))
                for job in value.forecast.jobs
            )
        jobs = JobListForm.of(value.jobs), ProgressForm.of(value.progress), forms
        words = text(value.shows), text(value.says), text(value.problem)
        return cls(value.doing, value.journey, *way, *jobs, value.loss, *words, value.answers)

    def read(self) -> tasks.Tasks:
        """What the robot does."""
        goal = None if self.goal is None else self.goal.read()
        forecast = None if self.forecast is None else Forecast(tuple(form.read() for form in self.forecast))
        way = self.reason, goal, self.route, self.left or 0.0
        jobs = self.jobs.read(), self.progress.read(), forecast
        words = self.shows, self.says, self.problem
        return tasks.Tasks(self.doing, self.journey, *way, *jobs, self.loss, *words, self.answers)


class SeenWire(Message, frozen=True, omit_defaults=True, gc=False, tag="seen"):
    """`Seen`."""

    time: Stamp
    points: Points = ()
    doubt: Doubt | None = None

    def read(self) -> tasks.Seen:
        """What is seen."""
        return tasks.Seen(self.time, self.points, self.doubt)


class PlanWire(Message, frozen=True, omit_defaults=True, gc=False, tag="plan"):
    """`Plan`."""

    size: PointRow
    things: Annotated[
        tuple[Annotated[tuple[PointRow, ...], Meta(max_length=MOST_CORNERS)], ...], Meta(max_length=MOST_THINGS)
    ] = ()
    via: Points = ()
    robot: tuple[Distance, Distance, Distance] = (0.0, 0.0, 0.0)

    def read(self) -> tasks.Plan:
        """The map."""
        return tasks.Plan(self.size, self.things, self.via, self.robot)
