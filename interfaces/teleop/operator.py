"""The operator's site: the virtual robot, the log of what it was told, and what came back from the real one."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from interfaces.link.quantiles import SlidingQuantiles
from interfaces.teleop.listening import Correction, Deed, Listener
from interfaces.teleop.measured import Gathering, Sample
from interfaces.teleop.messages import Entry, Orders, PlanPart, Report
from vrs.checks import number_in
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
from vrs.model import Array, RobotModel
from vrs.receipt import Receipt, Status
from vrs.timeline import Timeline

NOT_FOLLOWING = "the robot doesn't follow"
"""How refusals begin while the real robot has stopped by itself."""
_SAME = 1e-9
"""Joints nearer than this [rad] are one."""
_UNDER_WAY_MOST = 4096
"""Most entries that may wait to be acknowledged."""


@dataclass(frozen=True, slots=True)
class OperatorSiteConfig:
    """How the operator's site sends."""

    beat: float = 0.05
    """Longest time between two messages [s], in [0.001, 10]."""
    repeat: int = 3
    """Entries sent before that each message repeats, in [0, 64]."""
    resent: int = 32
    """Most entries sent again in one message because they seem to be lost, in [1, 1000]."""

    def __post_init__(self) -> None:
        for name, low, high in (("beat", 1e-3, 10.0), ("repeat", 0, 64), ("resent", 1, 1000)):
            number_in(name, getattr(self, name), low, high)


class LoggedEngine(Engine):
    """An engine that asks whether it may, and tells what it was given."""

    def __init__(
        self,
        refusal: Callable[[], str],
        told: Callable[[Deed, int], None],
        model: RobotModel,
        *,
        q: Array,
        clock: ManualClock,
        lateness: Lateness,
    ) -> None:
        """Make an engine.

        Args:
            refusal: Says why commands are refused now; empty if they aren't.
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
        reason, newest = self._refusal(), self.newest
        answer: Receipt | None = self.refuse(command, reason) if reason else super().execute(command)  # type: ignore[arg-type]
        self._tell(Deed(self.now(), command, answer, bool(reason)), newest)
        return answer

    def undo(self) -> Receipt | None:
        """Take back the newest command; see `Engine.undo`."""
        if self._refusal():
            return None
        newest = self.newest
        answer = super().undo()
        if answer is not None:
            self._tell(Deed(self.now(), None, answer, False), newest)
        return answer

    def undo_refusal(self) -> str:
        """Why nothing is taken back now; see `Engine.undo_refusal`."""
        return self._refusal() or super().undo_refusal()


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
        halted: str = "",
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
        self._clock = ManualClock(now)
        self.listener: Listener | None = None
        """Who is told of all that happens here."""
        self.engine = LoggedEngine(self._refusal, self._told, model, q=q, clock=self._clock, lateness=lateness)
        """The virtual robot; what it's told goes to the real one, whoever tells it."""
        self.epoch, self._began = 1, now
        self.halted = halted
        """Why the robot stopped by itself; empty while it follows."""
        self.corrections: list[Correction] = []
        self.report: Report | None = None
        """The newest one."""
        self.receipts: dict[int, Receipt] = {}
        """What the robot's engine answered, by command id."""
        self._entries = 0
        self._under_way: OrderedDict[int, tuple[Entry, float]] = OrderedDict()
        """Entries that aren't acknowledged, and when they were sent last [s], in that order."""
        self._acknowledged = 0
        self._new: list[int] = []
        self._recent: deque[int] = deque(maxlen=self.config.repeat)
        self._ids: dict[int, int] = {}
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
        self._compared: tuple[int, ...] = ()
        """Versions of the plans, and entries under way, that were found to lead the same way."""

    def execute(self, command: Command, *, now: float) -> Receipt | Position | None:
        """Carry out a command on the virtual robot, and send it on if it's accepted; the engine does so, too.

        Raises:
            InvalidValueError: If the command's form doesn't fit the robot.
            UnknownCommandError: If it names a command that isn't known.
        """
        self._clock.set(now)
        answer: Receipt | Position | None = self.engine.execute(command)
        return answer

    def undo(self, *, now: float) -> Receipt | None:
        """Take back the newest command, as far as it lies in the future; see `vrs.Engine.undo`."""
        self._clock.set(now)
        return self.engine.undo()

    def _refusal(self) -> str:
        """Why the robot can't be commanded; empty if it can."""
        if self.halted:
            return f"{NOT_FOLLOWING}: {self.halted}; resume first"
        if len(self._under_way) >= _UNDER_WAY_MOST:
            return f"{_UNDER_WAY_MOST} commands wait to be acknowledged"
        return ""

    def _told(self, deed: Deed, newest: int) -> None:
        """Write what the engine carried out into the log, to be sent."""
        if self.listener is not None:
            self.listener.commanded(deed)
        now, command, answer, _ = deed
        if answer is not None and answer.status is Status.REJECTED:
            return
        self._entries += 1
        if command is not None and answer is not None:
            command = _resolved(command, answer, now)
            self._ids[self._entries] = answer.command_id
        self._under_way[self._entries] = Entry(self._entries, now, command, newest), now
        self._new.append(self._entries)

    def advance(self, *, now: float) -> tuple[Orders, ...]:
        """Do what is due by now [s], and say what is to be sent."""
        if now < self._due and not self._new:
            return ()
        self._due = now + self.config.beat
        self._packets += 1
        chosen = self._new + [n for n in self._recent if n in self._under_way]
        self._recent.extend(self._new)
        self._new = []
        # In the order of their sending: what seems to be lost stands in front.
        patience, under_way = self._patience, self._under_way
        lost: list[int] = []
        for number, (_, sent) in under_way.items():
            if now - sent <= patience or len(lost) == self.config.resent:
                break
            lost.append(number)
        for number in lost:
            under_way[number] = under_way[number][0], now
            under_way.move_to_end(number)
        entries = tuple(under_way[n][0] for n in sorted({*chosen, *lost}) if n in under_way)
        heard = 0 if self.report is None else self.report.number
        wanted = self.gathering.wanted(now=now, patience=patience)
        return (Orders(self.epoch, self._packets, now, self._entries, now, self._began, heard, entries, wanted),)

    def next_deadline(self) -> float:
        """When there's something to send, by the operator's clock [s]."""
        return self._clock.now() if self._new else self._due

    def receive(self, report: Report, *, now: float) -> None:
        """Take in a report of the robot; where it was measured counts whatever the epoch, and however late."""
        self._clock.set(now)
        samples = report.samples if report.oldest else (Sample(0, report.measured_at, report.q_at, report.q),)
        found = self.gathering.take(samples, report.oldest, now=now)
        if found and self.listener is not None:
            self.listener.measured(found, now=now)
        if report.epoch != self.epoch:
            return
        for number, receipt in report.receipts:
            known = self._under_way.pop(number, None)
            if known is not None or number in self._ids:
                command_id = self._ids.pop(number, receipt.command_id)
                self.receipts[command_id] = receipt
                if self.listener is not None:
                    self.listener.answered(command_id, receipt, now=now)
        if self.report is not None and report.number <= self.report.number:
            return
        self.report = report
        if self.listener is not None:
            self.listener.reported(report, now=now)
        for number in range(self._acknowledged + 1, report.executed + 1):
            self._under_way.pop(number, None)
        self._acknowledged = max(self._acknowledged, report.executed)
        if report.echo is not None:
            _, sent, arrived = report.echo
            self.round_trip = now - sent - (report.sent_at - arrived)
            if sent >= self._measured_since:
                self.round_trips.add(self.round_trip, now=now)
        usual = self.round_trips.quantile(0.95)
        if usual is not None:
            self._patience = 2.0 * self.config.beat + 1.2 * usual
        new = bool(report.halted) and not self.halted
        if new:
            self.halted = report.halted
            self._under_way.clear()
        correcting = bool(self.corrections) and now < self.corrections[-1].end
        # One at a time: what the correction under way leaves over is corrected after it.
        if report.plan is not None and (new or not correcting):
            self._follow(report.plan, report.halted or "a command was late at the robot")

    def measure_anew(self, *, now: float) -> None:
        """Forget the round trips of messages that were sent before now [s]: the way is another one."""
        self.round_trips.clear()
        self._measured_since = now

    def _follow(self, part: PlanPart, reason: str) -> None:
        """Let the virtual robot follow the real one's plan, and what is still under way to it."""
        now = self._clock.now()
        compared = part.version, self._entries, len(self._under_way), self.engine.timeline.version
        if compared == self._compared:
            return
        plan = Timeline(part.initial, part.since, part.segments, part.version)
        clock = ManualClock(part.since)
        expected = Engine(self._model, timeline=plan, clock=clock, lateness=self._lateness)
        for entry, _ in sorted(self._under_way.values(), key=lambda waiting: waiting[0].number):
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
            if self.listener is not None:
                self.listener.corrected(self.corrections[-1], truth)
        else:
            self._compared = compared

    def resume(self, *, now: float) -> str:
        """Begin a new epoch after the robot stopped by itself.

        Returns:
            Why it can't be yet; empty if it's done.
        """
        self._clock.set(now)
        if not self.halted:
            return "the robot follows: there's nothing to resume"
        if self.report is None or not self.report.halted:
            return "the robot hasn't said yet where it stands"
        if now < self.engine.timeline.end:
            left = self.engine.timeline.end - now
            return f"the virtual robot is being put where the real one is for another {left:.2f} s"
        self.epoch, self._began, self.halted = self.epoch + 1, now, ""
        self._entries, self._acknowledged, self._due = 0, 0, now
        self._new = []
        self._recent.clear()
        self._under_way.clear()
        self._ids.clear()
        return ""


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


def _resolved(command: Command, answer: Receipt, now: float) -> Command:
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
