"""Messages of a mobile robot's clients and of its site on the wire."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from interfaces.jobs.file import GoalForm, JobListForm, ProgressForm
from interfaces.messages import mobile
from interfaces.messages.drive_sites import (
    MOST_POINTS,
    MOST_REPEATED,
    ArchitectureReport,
    ArcPacket,
    CellChanges,
    Doing,
    DriveOrders,
    DriveReport,
    Errand,
    Go,
    Halt,
    SensedPoints,
    Task,
    TaskReport,
)
from interfaces.messages.fields import (
    Count,
    Digits,
    Message,
    Number,
    Seconds,
    Stamp,
    Text,
    Time,
    Wire,
    Word,
    digits,
    epoch,
    text,
)
from interfaces.messages.jobs import MOST_JOBS, Forecast, JobForecast, ListCommand, Load, OperatorLoss
from interfaces.messages.mobile import Distance, Doubt, Points
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import JourneyState
from robots.onboard.supervisor import CellChange
from vrs.checks import normal, one_of
from vrs.errors import InvalidValueError
from vrs.segment import ArcSegment


class TaskForm(Wire, frozen=True, omit_defaults=True, gc=False):
    """A task: one of its fields is there, of `jobs` perhaps with how far that list is."""

    go: GoalForm | None = None
    do: Word | None = None
    jobs: JobListForm | None = None
    progress: ProgressForm | None = None
    halt: Text | None = None

    @classmethod
    def of(cls, task: Task | mobile.Wanted) -> TaskForm:
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

    def read(self) -> Task | mobile.Trial:
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


def _word(do: str) -> ListCommand | mobile.Trial:
    """What is asked for in a word.

    Raises:
        InvalidValueError: If nothing has that word.
    """
    words: dict[str, ListCommand | mobile.Trial] = {word.value: word for word in (*ListCommand, *mobile.Trial)}
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
        if isinstance(task, mobile.Trial):
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
    epoch: Digits | None = None

    @override
    @classmethod
    def of(cls, value: mobile.TaskOrder, packed: bool) -> TaskOrderWire:
        return cls(value.number, TaskForm.of(value.wanted), digits(value.epoch))

    def read(self) -> mobile.TaskOrder:
        """The order.

        Raises:
            InvalidValueError: If a client can't ask that.
        """
        wanted = self.task.read()
        if isinstance(wanted, Halt):
            raise InvalidValueError("task", "halt", "go, do or jobs: the order of a stop halts")
        return mobile.TaskOrder(self.number, epoch(self.epoch), wanted)


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
    def of(cls, value: mobile.Tasks, packed: bool) -> TasksWire:
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

    def read(self) -> mobile.Tasks:
        """What the robot does."""
        goal = None if self.goal is None else self.goal.read()
        forecast = None if self.forecast is None else Forecast(tuple(form.read() for form in self.forecast))
        way = self.reason, goal, self.route, self.left or 0.0
        jobs = self.jobs.read(), self.progress.read(), forecast
        words = self.shows, self.says, self.problem
        return mobile.Tasks(self.doing, self.journey, *way, *jobs, self.loss, *words, self.answers)


MOST_CELLS = 10_000
"""Cells that a report tells of, at most."""
Metres = Annotated[float, Meta(ge=-1e9, le=1e9)]
Angle = Annotated[float, Meta(ge=-1e9, le=1e9)]
PostureRow = tuple[Metres, Metres, Angle]
"""x, y, θ."""
Speed = Annotated[float, Meta(ge=-1e6, le=1e6)]
DriveRow = tuple[Speed, Speed]
"""v, ω."""
ArcRow = tuple[Time, Metres, Metres, Angle, Speed, Speed, Seconds]
"""Start, posture there, v, ω, duration."""
Arcs = Annotated[tuple[ArcRow, ...], Meta(max_length=MOST_REPEATED)]
Runs = Annotated[tuple[tuple[Count, Arcs], ...], Meta(max_length=8)]


class DriveOrdersWire(Message, frozen=True, omit_defaults=True, gc=False, tag="drive-orders"):
    """`DriveOrders`."""

    epoch: Digits
    number: Number
    sent_at: Stamp
    began: Time
    complete_until: Time
    start: PostureRow | None = None
    runs: Runs = ()
    tail: Arcs = ()
    errands: Annotated[tuple[ErrandForm, ...], Meta(max_length=16)] = ()

    @override
    @classmethod
    def of(cls, value: DriveOrders, packed: bool) -> DriveOrdersWire:
        packet = value.packet
        runs = tuple((first, _rows(arcs)) for first, arcs in packet.runs)
        errands = tuple(ErrandForm.of(errand) for errand in value.errands)
        stamps = str(value.epoch), value.number, value.sent_at, value.began
        start = None if value.start is None else Posture(*map(normal, value.start))
        return cls(*stamps, packet.complete_until, start, runs, _rows(packet.tail), errands)

    def read(self) -> DriveOrders:
        """The orders."""
        runs = tuple((first, _arcs(rows)) for first, rows in self.runs)
        packet = ArcPacket(runs, self.complete_until, _arcs(self.tail))
        start = None if self.start is None else Posture(*self.start)
        errands = tuple(form.read() for form in self.errands)
        return DriveOrders(epoch(self.epoch), self.number, self.sent_at, self.began, start, packet, errands)


class FollowedWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`ArchitectureReport` of an architecture."""

    number: Number
    executed: Count
    posture: PostureRow
    received: Count
    seen_at: Time | None = None
    cells: Annotated[tuple[tuple[tuple[Count, Count], Time, bool], ...], Meta(max_length=MOST_CELLS)] = ()

    @classmethod
    def of(cls, value: ArchitectureReport) -> FollowedWire:
        """The wire form."""
        changes = value.changes
        cells = () if changes is None else tuple((c.cell, c.seen, c.occupied) for c in changes.cells)
        seen_at = None if changes is None else changes.time
        return cls(value.number, value.executed, value.posture, value.received, seen_at, cells)

    def read(self) -> ArchitectureReport:
        """The report."""
        cells = tuple(CellChange(*row) for row in self.cells)
        changes = None if self.seen_at is None else CellChanges(self.seen_at, cells)
        return ArchitectureReport(self.number, self.executed, Posture(*self.posture), self.received, changes)


class DriveReportWire(Message, frozen=True, omit_defaults=True, gc=False, tag="drive-report"):
    """`DriveReport`."""

    epoch: Digits | None
    number: Number
    sent_at: Stamp
    measured_at: Stamp
    posture: PostureRow
    drive: DriveRow
    echo: tuple[Number, Stamp, Stamp] | None = None
    halted: Text = ""
    refused: Text = ""
    report: FollowedWire | None = None
    play: Time | None = None
    D: Time | None = None
    starved: bool = False
    uncertainty: Annotated[float, Meta(ge=0, le=1e12)] | None = None
    world: Time | None = None
    errand: Count = 0
    doing: Doing = Doing.NOTHING
    left: Annotated[float, Meta(ge=0, le=1e9)] | None = None
    tasks: TaskReportForm | None = None
    sight: SightForm | None = None

    @override
    @classmethod
    def of(cls, value: DriveReport, packed: bool) -> DriveReportWire:
        report = None if value.report is None else FollowedWire.of(value.report)
        where = value.sent_at, value.measured_at, value.posture, value.drive, value.echo
        why = text(value.halted), text(value.refused)
        return cls(
            digits(value.epoch), value.number, *where, *why, report, value.play, value.D, value.starved,
            value.uncertainty, value.world, value.errand, value.doing, value.left or None,
            None if value.tasks is None else TaskReportForm.of(value.tasks),
            None if value.sight is None else SightForm.of(value.sight),
        )  # fmt: skip

    def read(self) -> DriveReport:
        """The report."""
        report = None if self.report is None else self.report.read()
        where = self.sent_at, self.measured_at, Posture(*self.posture), Drive(*self.drive), self.echo
        return DriveReport(
            epoch(self.epoch), self.number, *where, self.halted, self.refused, report, self.play, self.D,
            self.starved, self.uncertainty, self.world, self.errand, self.doing, self.left or 0.0,
            None if self.tasks is None else self.tasks.read(), None if self.sight is None else self.sight.read(),
        )  # fmt: skip


def _rows(arcs: tuple[ArcSegment, ...]) -> tuple[ArcRow, ...]:
    rows = ((arc.start, *arc.posture, arc.v, arc.w, arc.duration) for arc in arcs)
    # What is computed of ordinary numbers may be subnormal, which a robot refuses.
    return tuple(tuple(map(normal, row)) for row in rows)  # type: ignore[misc]


def _arcs(rows: tuple[ArcRow, ...]) -> tuple[ArcSegment, ...]:
    return tuple(ArcSegment(start, T, (x, y, theta), v, w) for start, x, y, theta, v, w, T in rows)
