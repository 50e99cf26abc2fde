"""The operator's site: the virtual robot, the log of what it was told, and what came back from the real one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, takewhile
from typing import Annotated, Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from interfaces.link.delivery import Outgoing
from interfaces.link.quantiles import LARGEST, SlidingQuantiles
from interfaces.messages import Refusal
from interfaces.messages.commands import check_crosses
from interfaces.messages.fields import Epoch
from interfaces.messages.recording import CommandRecord
from interfaces.messages.sites import LogEntry, Orders, PlanPart, Report, Sample
from interfaces.teleop.connection import SiteLine
from interfaces.teleop.halt import Halt, HaltCause, not_following, text_of
from interfaces.teleop.samples import Gathering
from vrs.checks import number_in, validated, within
from vrs.clock import ManualClock
from vrs.commands import (
    Cancel,
    Command,
    InsertVia,
    JointTarget,
    Lateness,
    Motion,
    MotionCommand,
    Position,
    PositionQuery,
    Resume,
    Retime,
    ScaleTime,
    SteerCommand,
    Stop,
)
from vrs.engine import Engine
from vrs.errors import PlanningError, VrsError
from vrs.ledger import Receipt, Status
from vrs.model import Array, RobotModel
from vrs.timeline import Timeline


class Correction(NamedTuple):
    """The virtual robot was put where the real one is going."""

    t: float
    """When, by the operator's clock [s]."""
    end: float
    """Until when it takes [s]."""
    error: Array
    """By how much it was off [rad], (n,)."""
    reason: str


class SiteObserver(Protocol):
    """Who is told of all that happens, at once: it must not take long, and changes nothing."""

    def commanded(self, deed: CommandRecord) -> None:
        """The engine was given a command. What raised isn't told: it changed nothing, and took no id."""

    def corrected(self, correction: Correction, truth: Timeline) -> None:
        """The engine's timeline has joined another one."""

    def answered(self, command_id: int, receipt: Receipt, *, now: float) -> None:
        """The robot's engine has answered a command of the operator's: its id there, and the answer."""

    def reported(self, report: Report, *, now: float) -> None:
        """A report has come that is newer than all before."""

    def measured(self, samples: Sequence[Sample], *, now: float) -> None:
        """Samples of the robot have come that weren't known: mostly the newest, some of them late."""

    def failed(self, error: Exception) -> None:
        """Being told raised this: nothing more is told."""


class LoggedEngine(Engine):
    """An engine that asks whether it may, and tells what it was given; if that raises, nothing has happened."""

    def __init__(
        self,
        refusal: Callable[[], Refusal | None],
        told: Callable[[CommandRecord, int], None],
        model: RobotModel,
        *,
        q: Array,
        clock: ManualClock,
        lateness: Lateness,
    ) -> None:
        """Make an engine.

        Args:
            refusal: Says why commands are refused now; None if they aren't.
            told: Is told what it was given, and the newest id before that.
            model: See `Engine`, as for the rest.
            q: Initial joints.
            clock: The operator's.
            lateness: What happens to late commands.
        """
        super().__init__(model, q=q, clock=clock, lateness=lateness)
        self._refusal, self._tell = refusal, told

    def execute(self, command: Command) -> Any:
        """Carry out a command; see `Engine.execute`."""
        if isinstance(command, PositionQuery):
            return super().execute(command)
        with self.atomic():
            refused, newest = self._refusal(), self.newest
            answer: Receipt | None = (
                super().execute(command) if refused is None else self.refuse(command, *refused)  # type: ignore[arg-type]
            )
            self._tell(CommandRecord(0, self.now(), command, answer, refused is not None), newest)
            return answer

    def undo(self) -> Receipt | None:
        """Take back the newest command; see `Engine.undo`."""
        if self._refusal() is not None:
            return None
        with self.atomic():
            newest = self.newest
            answer = super().undo()
            if answer is not None:
                self._tell(CommandRecord(0, self.now(), None, answer), newest)
            return answer

    def undo_refusal(self) -> str:
        """Why nothing is taken back now; see `Engine.undo_refusal`."""
        refused = self._refusal()
        return super().undo_refusal() if refused is None else refused.text


def resolved(command: Command, answer: Receipt, now: float) -> Command:
    """The command with the stamps that it got, and joints for a pose."""
    issued = getattr(command, "issued_at", None)
    issued = now if issued is None else issued
    if isinstance(command, MotionCommand):
        target = command.target
        if command.motion is Motion.JOINT and answer.q is not None:
            target = JointTarget(answer.q)
        when = answer.execute_at if command.deviation == 0 else command.execute_at
        return replace(command, target=target, issued_at=issued, execute_at=when)
    if isinstance(command, (Cancel, InsertVia)) and command.execute_at is None:
        return replace(command, issued_at=issued, execute_at=max(now, issued))
    if isinstance(command, SteerCommand):
        return replace(command, issued_at=issued, execute_at=max(now, issued, command.execute_at or now))
    if isinstance(command, (ScaleTime, Stop, Resume)):
        return replace(command, issued_at=issued, execute_at=answer.execute_at)
    if isinstance(command, (Retime, Cancel, InsertVia)):
        return replace(command, issued_at=issued)
    return command


_SAME = 1e-9
"""Joints nearer than this [rad] are one."""
STUCK = 2.0
"""After so long at least [s] a robot counts as halted that hears what it's sent and doesn't carry it out."""
EPOCH_TIMEOUT = 10.0
"""The same of one that doesn't follow a new epoch [s]."""
RESENDS = 8
"""So often at least a command is sent again before that."""
LATEST = 9e8
"""A plan ends by then [session time, s]: what is postponed on its way still has a time that can be sent."""
_UNDER_WAY_MOST = 4096
"""Most entries that may wait to be acknowledged."""


@dataclass(frozen=True, slots=True)
@validated
class OperatorSiteConfig:
    """How the operator's site sends."""

    beat: Annotated[float, within(1e-3, 10.0)] = 0.05
    """Longest time between two messages [s], in [0.001, 10]."""
    repeat: Annotated[int, within(0, 64)] = 3
    """Entries sent before that each message repeats, in [0, 64]."""
    resent: Annotated[int, within(1, 1000)] = 32
    """Most entries sent again in one message because they seem to be lost, in [1, 1000]."""


class OperatorSite:
    """What runs beside the operator, all but the page.

    It answers commands at once, on its own engine, and sends them on.
    """

    def __init__(
        self,
        model: RobotModel,
        q: Array,
        *,
        now: float,
        config: OperatorSiteConfig | None = None,
        lateness: Lateness = Lateness.POSTPONE,
        halted: Halt | None = None,
    ) -> None:
        """Start with both robots at rest at q.

        Args:
            model: The robot.
            q: Joints [rad], (n,).
            now: By the operator's clock [s].
            config: How to send.
            lateness: What happens to commands whose execution time has passed.
            halted: Why the robot can't be commanded yet, where it's yet to be met; its report says where it is.
        """
        self.config = OperatorSiteConfig() if config is None else config
        self._model, self._lateness = model, lateness
        self.clock = ManualClock(now)
        """The engine's; calls here set it."""
        self.listener: SiteObserver | None = None
        """Who is told of all that happens here."""
        self.engine = LoggedEngine(self._refusal, self._told, model, q=q, clock=self.clock, lateness=lateness)
        """The virtual robot; what it's told goes to the real one, whoever tells it."""
        self.epoch, self._began = 1, now
        self.halted = halted
        """Why the robot doesn't follow; None while it does."""
        self.gone = ""
        """Why there's no robot any more, whatever anybody does; empty while there may be one."""
        self.corrections: list[Correction] = []
        self.report: Report | None = None
        """The newest one."""
        self.receipts: dict[int, Receipt] = {}
        """What the robot's engine answered, by command id."""
        self.log: Outgoing[tuple[LogEntry, float]] = Outgoing()
        """Entries since the robot began anew, and when they were sent last [s]; they wait in that order."""
        self.newest_sent = 0
        """Number of the newest that was sent at all."""
        self.command_ids: dict[int, int] = {}
        """By entry's number, where its answer hasn't come."""
        self._packets = 0
        self._due = now
        self.round_trip: float | None = None
        """How long the newest message that was answered, and the answer, were under way [s]."""
        self.round_trips = SlidingQuantiles(1000, 120.0)
        """Between the sites, of the newest messages [s]."""
        self._measured_since = -np.inf
        self._patience = 2.0 * self.config.beat + 1.0
        """After how long without an answer an entry counts as lost [s]."""
        self.gathering = Gathering()
        """Where the robot was measured."""
        self._waits: tuple[float, float, float] | None = None
        """Of the reports that say that the same entry is still to be carried out: when the first came [s], when
        what the newest has heard was sent [s], and for how long the robot has been hearing meanwhile [s]."""
        self._of_earlier: tuple[float, float] | None = None
        """When reports of an earlier epoch began to come [s] since the newest resume or silence, and the newest."""
        self._compared: tuple[int, ...] = ()
        """Versions of the plans, and entries under way, that were found to lead the same way."""

    def execute(self, command: Command, *, now: float) -> Receipt | Position | None:
        """Carry out a command on the virtual robot, and send it on if it's accepted; the engine does so, too.

        Raises:
            InvalidValueError: If the command's form doesn't fit the robot.
            UnknownCommandError: If it names a command that isn't known.
        """
        self.clock.set(now)
        answer: Receipt | Position | None = self.engine.execute(command)
        return answer

    def undo(self, *, now: float) -> Receipt | None:
        """Take back the newest command, as far as it lies in the future; see `vrs.Engine.undo`."""
        self.clock.set(now)
        return self.engine.undo()

    def _refusal(self) -> Refusal | None:
        """Why the robot can't be commanded; None if it can."""
        if self.gone:
            return not_following(self.gone)
        if self.halted is not None:
            return not_following(f"{self.halted.text}; resume first")
        if len(self.log.waiting) >= _UNDER_WAY_MOST:
            return Refusal(f"{_UNDER_WAY_MOST} commands wait to be acknowledged")
        return None

    def _told(self, deed: CommandRecord, newest: int) -> None:
        """Write what the engine carried out into the log, to be sent.

        Raises:
            InvalidValueError: If it can't be sent, or the plan goes on for too long; nothing is written then.
        """
        number, now, command, answer = self.log.count + 1, deed.at, deed.command, deed.receipt
        if answer is None or answer.status is not Status.REJECTED:
            number_in("end of the plan", self.engine.timeline.end, -LATEST, LATEST, "a session time", " s")
            if command is not None and answer is not None:
                command = resolved(command, answer, now)
            if command is not None:
                check_crosses(command)
            entry = LogEntry(number, now, newest, command)
            # From here on nothing may raise.
            self.log.add((entry, now))
            if command is not None and answer is not None:
                self.command_ids[number] = answer.command_id
        self.inform(lambda listener: listener.commanded(deed))

    def inform(self, tell: Callable[[SiteObserver], None]) -> None:
        """Tell who listens, if anybody does; one that fails hears no more, and what it was told of stands."""
        listener = self.listener
        if listener is None:
            return
        try:
            tell(listener)
        except Exception as error:  # noqa: BLE001 - whatever it is, the robot goes on
            self.listener = None
            listener.failed(error)

    def advance(self, *, now: float) -> tuple[Orders, ...]:
        """Do what is due by now [s], and say what is to be sent."""
        if now < self._due and self.newest_sent == self.log.count:
            return ()
        self._due = now + self.config.beat
        self._packets += 1
        waiting, patience = self.log.waiting, self._patience
        # In the order of their sending: what seems to be lost stands in front.
        overdue = takewhile(lambda number: now - waiting[number][1] > patience, waiting)
        lost = list(islice(overdue, self.config.resent))
        for number in lost:
            waiting[number] = waiting.pop(number)[0], now
        chosen = {*range(self.newest_sent + 1 - self.config.repeat, self.log.count + 1), *lost}
        entries = tuple(waiting[number][0] for number in sorted(chosen) if number in waiting)
        self.newest_sent = self.log.count
        heard = 0 if self.report is None else self.report.number
        wanted = self.gathering.wanted(now=now, patience=patience)
        # A robot that knows that it has halted isn't told.
        halted = "" if self.report is None or self.report.halted else text_of(self.halted)
        facts = self.log.count, now, self._began, heard, entries, wanted, halted
        return (Orders(Epoch(self.epoch), self._packets, now, *facts),)

    def next_deadline(self) -> float:
        """When there's something to send, by the operator's clock [s]."""
        return self.clock.now() if self.newest_sent < self.log.count else self._due

    def receive(self, report: Report, *, now: float) -> None:
        """Take in a report of the robot; where it was measured counts whatever the epoch, and however late."""
        self.clock.set(now)
        alone = Sample(0, report.measured_at, report.q_at, report.q, report.reference)
        found = self.gathering.take(report.samples if report.oldest else (alone,), report.oldest, now=now)
        if found:
            self.inform(lambda listener: listener.measured(found, now=now))
        if report.epoch != self.epoch:
            self._watch_begin(report, now)
            return
        answered: list[tuple[int, Receipt]] = []
        for number, receipt in report.receipts:
            known = self.log.waiting.pop(number, None)
            if known is not None or number in self.command_ids:
                answered.append((self.command_ids.pop(number, receipt.command_id), receipt))
        self.receipts.update(answered)
        for command_id, receipt in answered:
            self.inform(partial(_tell_answer, command_id=command_id, receipt=receipt, now=now))
        if self.report is not None and report.number <= self.report.number:
            return
        self.report = report
        self.inform(lambda listener: listener.reported(report, now=now))
        self._measure(report, now)
        self._watch_progress(report, now)
        new = bool(report.halted) and not self.halted
        if new:
            self._give_up(Halt(HaltCause.REPORTED, report.halted))
        correcting = bool(self.corrections) and now < self.corrections[-1].end
        # One at a time: what the correction under way leaves over is corrected after it.
        if report.plan is not None and (new or not correcting):
            self._follow(report.plan, report.halted or "a command was late at the robot")

    def _measure(self, report: Report, now: float) -> None:
        """Learn from a report how long messages are under way."""
        if report.echo is None:
            return
        _, sent, arrived = report.echo
        round_trip = now - sent - (report.sent_at - arrived)
        if abs(round_trip) > LARGEST:
            # No clock that we sent says so.
            return
        self.round_trip = round_trip
        if sent >= self._measured_since:
            self.round_trips.add(round_trip, now=now)
        usual = self.round_trips.quantile(0.95)
        if usual is not None:
            self._patience = 2.0 * self.config.beat + 1.2 * usual

    def _watch_progress(self, report: Report, now: float) -> None:
        """Count a robot as halted that hears what is sent and yet carries nothing out."""
        had = self.log.acknowledged
        self.log.acknowledge(report.executed)
        if self.halted or self.log.acknowledged == self.log.count:
            self._waits = None
        elif self.log.acknowledged > had or self._waits is None:
            self._waits = now, now, 0.0
        elif report.echo is not None and report.echo[1] > self._waits[1]:
            (since, before, hearing), heard = self._waits, report.echo[1]
            # What got lost in an outage wasn't heard.
            self._waits = since, heard, hearing + min(heard - before, self._patience)
            if self._waits[2] > self._stuck_after(STUCK):
                waited = f"{heard - since:.1f} s before"
                why = f"it hears the operator, but hasn't carried out a command that it was sent {waited}"
                self._give_up(Halt(HaltCause.STUCK, why))

    def _watch_begin(self, report: Report, now: float) -> None:
        """Count a robot as halted that goes on saying that it follows an earlier epoch."""
        longest, known = self.round_trips.maximum, self.report
        if (
            report.epoch > self.epoch
            or self.halted
            or longest is None
            or known is None
            or report.number <= known.number
        ):
            return
        since, heard = self._of_earlier or (now, now)
        if now - heard > self._stuck_after(STUCK):
            # Nothing came meanwhile: the link was down, and it may not have heard anything either.
            since = now
        self._of_earlier = since, now
        if now > since + self._stuck_after(EPOCH_TIMEOUT) + 2.0 * longest:
            self._give_up(Halt(HaltCause.STUCK, "it hears nothing of being resumed, or can't take it up"))

    def _stuck_after(self, least: float) -> float:
        """How long a robot may make nothing of what it's sent [s]: it has been sent again often by then."""
        return max(least, RESENDS * self._patience)

    def _give_up(self, halt: Halt) -> None:
        """Command the robot no more until somebody resumes; it's told so."""
        self.halted = halt
        self.log.waiting.clear()
        self.newest_sent = self.log.count
        self._waits = None
        self._due = self.clock.now()

    def measure_anew(self, *, now: float) -> None:
        """Forget the round trips of messages that were sent before now [s]: the way is another one."""
        self.round_trips.clear()
        self._measured_since = now

    def _follow(self, part: PlanPart, reason: str) -> None:
        """Let the virtual robot follow the real one's plan, and what is still under way to it."""
        now = self.clock.now()
        compared = part.version, self.log.count, len(self.log.waiting), self.engine.timeline.version
        if compared == self._compared:
            return
        plan = Timeline(part.initial, part.since, part.segments, part.version)
        clock = ManualClock(part.since)
        expected = Engine(self._model, timeline=plan, clock=clock, lateness=self._lateness)
        for _, (entry, _) in sorted(self.log.waiting.items()):
            clock.set(max(entry.at, clock.now()))
            try:
                if entry.command is not None:
                    expected.execute(entry.command)  # type: ignore[arg-type]
            except VrsError:
                continue
        if _differs(self.engine.timeline, expected.timeline, now):
            found = expected.timeline
            # Made of its segments alone, as a recording keeps them: whoever reads that joins the very same.
            truth = Timeline(found.initial, found.start, found.segments, found.version)
            try:
                made = self.engine.anchor(truth)
            except PlanningError:
                # No way keeps the limits from here; the next report finds the arm elsewhere.
                return
            self.corrections.append(Correction(now, made.end, made.error, reason))
            self.inform(lambda listener: listener.corrected(self.corrections[-1], truth))
        else:
            self._compared = compared

    def resume(self, *, now: float) -> str:
        """Begin a new epoch after the robot stopped by itself.

        Returns:
            Why it can't be yet; empty if it's done.
        """
        self.clock.set(now)
        if self.gone:
            return self.gone
        if not self.halted:
            return "the robot follows: there's nothing to resume"
        if self.report is None or not self.report.halted:
            return "the robot hasn't said yet where it stands"
        if now < self.engine.timeline.end:
            left = self.engine.timeline.end - now
            return f"the virtual robot is being put where the real one is for another {left:.2f} s"
        self.epoch, self._began, self.halted = self.epoch + 1, now, None
        self.log, self.newest_sent, self._due = Outgoing(), 0, now
        self.command_ids.clear()
        self._waits = self._of_earlier = None
        return ""


def _tell_answer(listener: SiteObserver, *, command_id: int, receipt: Receipt, now: float) -> None:
    listener.answered(command_id, receipt, now=now)


def _differs(mine: Timeline, other: Timeline, t: float) -> bool:
    """Whether two timelines lead the arm differently from t on."""
    ends = [mine.end, other.end, t + 1.0]
    knots = [
        timeline.start_of(i) for timeline in (mine, other) for i in range(timeline.index_at(t) + 1, len(timeline))
    ]
    moments = np.unique([t, *knots, *(e for e in ends if e >= t)])
    middle = 0.5 * (moments[1:] + moments[:-1])
    moments = np.concatenate([moments, middle])
    return bool(np.abs(mine.sample(moments) - other.sample(moments)).max() > _SAME)


RobotLine: TypeAlias = SiteLine[OperatorSite, Orders, Report]
"""To an arm."""
