"""The virtual arm: an engine that answers at once, and the log of what it was told, for the real one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, takewhile
from typing import Annotated, Any, TypeAlias

import numpy as np
from typing_extensions import override

from interfaces.link.delivery import Outgoing
from interfaces.messages import Refusal
from interfaces.messages.control import HandReport
from interfaces.messages.recording import CommandRecord
from interfaces.messages.requests import check_crosses
from interfaces.messages.sites import LogEntry, Orders, PlanPart, Report, Sample
from interfaces.teleop.connection import SiteLine
from interfaces.teleop.operator import (
    Correction,
    Halt,
    HaltCause,
    OperatorSite,
    SiteObserver,
    VirtualRobot,
    not_following,
    text_of,
)
from interfaces.teleop.samples import Gathering
from robots.things import ThingPose
from vrs.checks import number_in, validated, within
from vrs.clock import ManualClock
from vrs.commands import (
    Alter,
    Cancel,
    Command,
    Grip,
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
            answer: Receipt | None = super().execute(command) if refused is None else self.refuse(command, *refused)
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
    if isinstance(command, Alter):
        return replace(command, issued_at=issued, execute_at=max(now, command.execute_at or now))
    if isinstance(command, SteerCommand):
        return replace(command, issued_at=issued, execute_at=max(now, issued, command.execute_at or now))
    if isinstance(command, (ScaleTime, Stop, Resume, Grip)):
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


class VirtualArm(VirtualRobot[Orders, Report]):
    """An arm that answers commands at once, on an engine of its own, and sends them on."""

    engine: LoggedEngine
    site: OperatorSite[VirtualArm]

    def __init__(
        self,
        model: RobotModel,
        q: Array,
        *,
        now: float,
        config: OperatorSiteConfig | None = None,
        lateness: Lateness = Lateness.POSTPONE,
        stroke: float = math.inf,
    ) -> None:
        """Start at rest at q.

        Args:
            model: The robot.
            q: Joints [rad], (n,).
            now: By the operator's clock [s].
            config: How to send.
            lateness: What happens to commands whose execution time has passed.
            stroke: How far the hand opens [m].
        """
        self._stroke = stroke
        self.hand: HandReport | None = None
        """The real hand as it was told of last; None where it's in no scene."""
        self.hand_at = -math.inf
        """The time on the robot's timeline that it played then [s]."""
        self._hand_number = 0
        self.things: dict[int, ThingPose] = {}
        """Where things were measured last, by number."""
        self.config = OperatorSiteConfig() if config is None else config
        self._model, self._lateness = model, lateness
        self.clock = ManualClock(now)
        """The engine's; calls here set it."""
        self.engine = LoggedEngine(self._refusal, self._told, model, q=q, clock=self.clock, lateness=lateness)
        """What it's told goes to the real robot, whoever tells it."""
        self._began = now
        self.corrections: list[Correction] = []
        self.receipts: dict[int, Receipt] = {}
        """What the robot's engine answered, by command id."""
        self.log: Outgoing[tuple[LogEntry, float]] = Outgoing()
        """Entries since the robot began anew, and when they were sent last [s]; they wait in that order."""
        self.newest_sent = 0
        """Number of the newest that was sent at all."""
        self.command_ids: dict[int, int] = {}
        """By entry's number, where its answer hasn't come."""
        self._due = now
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
        site = self.site
        if site.gone:
            return not_following(site.gone)
        if site.halted is not None:
            return not_following(f"{site.halted.text}; resume first")
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
        self.site.inform(lambda listener: listener.commanded(deed))

    @override
    def stop(self, *, now: float) -> None:
        self.execute(Stop(), now=now)

    @override
    def rests(self, *, now: float) -> bool:
        return now >= self.engine.timeline.end

    @property
    @override
    def done(self) -> bool:
        report = self.site.report
        if report is None or report.halted:
            return True
        return report.epoch == self.site.epoch and report.play >= self.engine.timeline.end

    @override
    def shown(self, *, now: float) -> Array:
        return self.engine.timeline.sample(now)

    @override
    def orders(self, number: int, *, now: float) -> Orders | None:
        if now < self._due and self.newest_sent == self.log.count:
            return None
        self._due = now + self.config.beat
        waiting, patience = self.log.waiting, self._patience
        # In the order of their sending: what seems to be lost stands in front.
        overdue = takewhile(lambda number: now - waiting[number][1] > patience, waiting)
        lost = list(islice(overdue, self.config.resent))
        for entry in lost:
            waiting[entry] = waiting.pop(entry)[0], now
        chosen = {*range(self.newest_sent + 1 - self.config.repeat, self.log.count + 1), *lost}
        entries = tuple(waiting[entry][0] for entry in sorted(chosen) if entry in waiting)
        self.newest_sent = self.log.count
        site, report = self.site, self.site.report
        heard = 0 if report is None else report.number
        wanted = self.gathering.wanted(now=now, patience=patience)
        # A robot that knows that it has halted isn't told.
        halted = "" if report is None or report.halted else text_of(site.halted)
        facts = self.log.count, now, self._began, heard, entries, wanted, halted
        return Orders(site.epoch, number, now, *facts)

    @override
    def next_deadline(self) -> float:
        return self.clock.now() if self.newest_sent < self.log.count else self._due

    @override
    def hear(self, report: Report, *, new: bool, now: float) -> bool:
        self.clock.set(now)
        site = self.site
        alone = Sample(0, report.measured_at, report.q_at, report.q, report.reference)
        found = self.gathering.take(report.samples if report.oldest else (alone,), report.oldest, now=now)
        if found:
            site.inform(lambda listener: listener.measured(found, now=now))
        if report.hand is not None and report.number > self._hand_number:
            self.hand, self.hand_at, self._hand_number = report.hand, report.q_at, report.number
            self.things.update(report.hand.things)
            site.inform(lambda listener: listener.grasped(report, now=now))
        if report.epoch != site.epoch:
            self._watch_begin(report, now)
            return False
        answered: list[tuple[int, Receipt]] = []
        for number, receipt in report.receipts:
            known = self.log.waiting.pop(number, None)
            if known is not None or number in self.command_ids:
                answered.append((self.command_ids.pop(number, receipt.command_id), receipt))
        self.receipts.update(answered)
        for command_id, receipt in answered:
            site.inform(partial(_tell_answer, command_id=command_id, receipt=receipt, now=now))
        return new

    @override
    def take(self, report: Report, *, now: float) -> None:
        site = self.site
        usual = site.round_trips.quantile(0.95)
        if usual is not None:
            self._patience = 2.0 * self.config.beat + 1.2 * usual
        self._watch_progress(report, now)
        new = bool(report.halted) and not site.halted
        if new:
            site.halt(Halt(HaltCause.REPORTED, report.halted))
        correcting = bool(self.corrections) and now < self.corrections[-1].end
        # One at a time: what the correction under way leaves over is corrected after it.
        if report.plan is not None and (new or not correcting):
            self._follow(report.plan, report.halted or "a command was late at the robot")

    def _watch_progress(self, report: Report, now: float) -> None:
        """Count a robot as halted that hears what is sent and yet carries nothing out."""
        had = self.log.acknowledged
        self.log.acknowledge(report.executed)
        if self.site.halted or self.log.acknowledged == self.log.count:
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
                self.site.halt(Halt(HaltCause.STUCK, why))

    def _watch_begin(self, report: Report, now: float) -> None:
        """Count a robot as halted that goes on saying that it follows an earlier epoch."""
        site = self.site
        longest, known = site.round_trips.maximum, site.report
        if (
            report.epoch > site.epoch
            or site.halted
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
            site.halt(Halt(HaltCause.STUCK, "it hears nothing of being resumed, or can't take it up"))

    def _stuck_after(self, least: float) -> float:
        """How long a robot may make nothing of what it's sent [s]: it has been sent again often by then."""
        return max(least, RESENDS * self._patience)

    @override
    def give_up(self) -> None:
        self.log.waiting.clear()
        self.newest_sent = self.log.count
        self._waits = None
        self._due = self.clock.now()

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
                    expected.execute(entry.command)
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
            self.site.inform(lambda listener: listener.corrected(self.corrections[-1], truth))
        else:
            self._compared = compared

    @override
    def restart(self, *, now: float) -> str:
        self.clock.set(now)
        site, report = self.site, self.site.report
        if not site.halted:
            return "the robot follows: there's nothing to resume"
        if report is None or not report.halted:
            return "the robot hasn't said yet where it stands"
        if now < self.engine.timeline.end:
            left = self.engine.timeline.end - now
            return f"the virtual robot is being put where the real one is for another {left:.2f} s"
        site.begin()
        self._began, self.log, self.newest_sent, self._due = now, Outgoing(), 0, now
        self.command_ids.clear()
        self._waits = self._of_earlier = None
        # The real hand keeps what it holds: the virtual one is as it is.
        if report.hand is not None and min(float(self.engine.opening(now)), self._stroke) != report.hand.goal:
            self.execute(Grip(report.hand.goal), now=now)
        return ""


def _tell_answer(
    listener: SiteObserver[Report, Timeline], *, command_id: int, receipt: Receipt, now: float
) -> None:
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


RobotLine: TypeAlias = SiteLine[VirtualArm, Orders, Report]
"""To an arm."""
