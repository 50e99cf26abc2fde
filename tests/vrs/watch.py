"""An engine under watch: whatever it's told, every law is checked.

A `Scene` is before and after an edit: what it was allowed to change, by the rules of insertion.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from tests.vrs.laws import (
    Columns,
    Figures,
    LawBrokenError,
    changed,
    check_memory,
    check_moves,
    check_names,
    check_pace,
    check_past,
    check_receipts,
    check_rest,
    check_run,
    check_same,
    check_tail,
    check_way,
    columns,
)
from vrs.commands import (
    Cancel,
    Command,
    Insertion,
    InsertVia,
    Motion,
    MotionCommand,
    PlanEdit,
    PoseTarget,
    Position,
    Profile,
    Resume,
    Retime,
    ScaleTime,
    SteerCommand,
    Stop,
)
from vrs.engine import Engine
from vrs.errors import VrsError
from vrs.ledger import Receipt, Status
from vrs.notes import NoteCode, is_rough
from vrs.segment import HOLD
from vrs.timeline import Timeline


def kinds_of(command: Command) -> tuple[str, ...]:
    """What a command is counted as, the main thing first."""
    if isinstance(command, MotionCommand):
        kinds = [f"move: {command.insertion}", f"move: {command.profile}"]
        kinds += ["move: line"] if command.motion is Motion.LINE else []
        kinds += ["move: pose"] if isinstance(command.target, PoseTarget) else []
        kinds += ["move: rounded"] if 0 < command.deviation < inf else []
        kinds += ["move: continuous"] if command.deviation == inf else []
        kinds += ["move: pace"] if command.pace < 1 else []
        kinds += ["move: acceleration"] if command.acceleration < 1 else []
        kinds += ["move: tool"] if command.tool is not None else []
        return tuple(kinds)
    if isinstance(command, SteerCommand):
        return ("steer: rates" if command.twist is None else f"steer: twist in {command.frame}",)
    if isinstance(command, InsertVia):
        return ("via", "via: rounded") if command.deviation > 0 else ("via",)
    return (type(command).__name__.lower(),)


_ROUNDING = 1e-9
"""Receipts' times may differ from knots by so much [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Before and after an edit."""

    now: float | None
    """When it was made [s]; None offline."""
    before: Timeline
    """As it was."""
    old: Columns
    """Its segments."""
    receipts: dict[int, Receipt]
    """Before the edit, by command id."""
    after: Timeline
    """As it is."""
    new: Columns
    """Its segments."""
    now_receipts: dict[int, Receipt]
    """After the edit, by command id."""

    def moment(self, command: PlanEdit | SteerCommand, soonest: float) -> float:
        """When an edit acts [s]; offline at `soonest` unless it says when."""
        asked, now = command.execute_at, self.now
        if now is None:
            return soonest if asked is None else asked
        issued = now if command.issued_at is None else command.issued_at
        return max(now, issued if asked is None else asked)

    def nominal(self, command: MotionCommand) -> float:
        """When a move begins, unless it's rounded: as asked; if late, at the end of the segment now valid [s]."""
        now, asked, old = self.now, command.execute_at, self.old
        if now is None:
            t = old.end if asked is None else asked
        else:
            t = max(now, now if command.issued_at is None else command.issued_at) if asked is None else asked
            if t < now:
                i = old.index_at(now)
                t = old.start_of(i + 1) if 0 <= i < len(old) and old.owners[i] != HOLD else now
        return max(t, old.end) if command.insertion is Insertion.APPEND else t

    def earliest(self, command: Command, answer: Receipt) -> float:
        """The earliest time that an edit may change [s]."""
        start = given(answer.execute_at)
        if isinstance(command, SteerCommand):
            return self.moment(command, self.before.end)
        if isinstance(command, Retime):
            return min(self.begins(command), start)
        if isinstance(command, (Cancel, InsertVia)):
            moment, begins = self.moment(command, -np.inf), self.begins(command)
            if isinstance(command, Cancel) and moment <= given(self.receipts[command.command_id].execute_at):
                # What hasn't begun is taken out whole, from its knot on, but nothing that's past.
                return begins if self.now is None else max(begins, self.now)
            return max(begins, moment)
        return start

    def move_of(self, command: Retime | Cancel | InsertVia) -> int | None:
        """First segment of a move that's edited; None if it has none."""
        old, name = self.old, command.command_id
        start = given(self.receipts[name].execute_at)
        knots = np.flatnonzero(np.abs(old.starts - start) <= _ROUNDING).tolist()
        mine = [i for i in knots if old.owners[i] == name]
        if mine:
            return min(mine, key=lambda i: abs(old.start_of(i) - start))
        # It may begin with a rest; what it moved until a stop, before it began, isn't part of it.
        near = old.index_at(start + _ROUNDING)
        return next((i for i in (near, near + 1) if 0 <= i < len(old) and old.owners[i] == name), None)

    def begins(self, command: Retime | Cancel | InsertVia) -> float:
        """When a move that's edited begins [s]; receipts round."""
        start, first = given(self.receipts[command.command_id].execute_at), self.move_of(command)
        knot = start if first is None else self.old.start_of(first)
        return knot if abs(knot - start) <= _ROUNDING else start

    def first_that_stays(self, command: Retime | Cancel | InsertVia) -> int:
        """Index, in what was scheduled, of the first segment that the edit of a move must leave as it is."""
        old = self.old
        mine = self.move_of(command)
        if mine is None:
            return len(old)
        after = old.next_move(old.end_of_move(mine))
        if isinstance(command, InsertVia) or after >= len(old):
            return after
        last = old.next_move(old.end_of_move(after))
        if isinstance(command, Cancel):
            return last
        t = command.execute_at
        held = mine > 0 and old.owners[mine - 1] == HOLD
        if old.start_of(mine - held) <= t < old.start_of(after):
            return after
        there = old.index_at(t)
        if 0 <= there < len(old) and old.owners[there] != HOLD:
            there = old.end_of_move(there)
        return max(last, old.next_move(max(there, 0)))


def given(value: float | None) -> float:
    """A time of a receipt that isn't rejected."""
    assert value is not None, "a receipt of something that isn't rejected has all its times"
    return value


_FIGURES = re.compile(r"-?\d[\d.,e+-]*|\[.*?\]", re.DOTALL)


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """What was there before an edit that can be taken back."""

    command_id: int
    at: float
    """Earliest time that it changed [s]."""
    timeline: Timeline
    receipts: dict[int, Receipt]


class Watch:
    """Passes commands on to an engine, and raises LawBrokenError as soon as an answer breaks a law.

    Rounding apart, the laws are: the past stays bit-identical; nothing jumps; limits hold at every instant; what
    stays of the future stays bit-identical and is shifted by one Δ ≥ 0; receipts are true; what's rejected changes
    nothing; undo restores; the plan ends at rest. The engine must have been asked for nothing else meanwhile.
    """

    def __init__(
        self,
        engine: Engine,
        figures: Figures | None = None,
        answers: Counter[tuple[str, str]] | None = None,
        reasons: Counter[tuple[str, str]] | None = None,
    ) -> None:
        """Watch an engine from now on.

        Args:
            engine: What to watch.
            figures: Where the worst figures are kept.
            answers: Where it's counted how often a kind of command had an outcome.
            reasons: Where it's counted why kinds of commands were rejected, figures left out.
        """
        self.engine = engine
        self.figures = Figures() if figures is None else figures
        self.answers: Counter[tuple[str, str]] = Counter() if answers is None else answers
        self.reasons: Counter[tuple[str, str]] = Counter() if reasons is None else reasons
        self._columns = columns(engine.timeline)
        self._receipts = {r.command_id: r for r in engine.receipts}
        self._commands: dict[int, MotionCommand] = {}
        self._smooth: set[int] = set()
        self._steps: list[_Step] = []
        self._stopped: tuple[Columns, float] | None = None
        self._left: Columns | None = None

    @property
    def moves(self) -> Mapping[int, MotionCommand]:
        """The motion commands that the engine has accepted, by command id."""
        return self._commands

    @property
    def receipts(self) -> dict[int, Receipt]:
        """The engine's receipts, by command id."""
        return self._receipts

    def execute(self, command: Command) -> Receipt | Position | None:
        """Let the engine carry out a command.

        Raises:
            LawBrokenError: If a law is broken.
            VrsError: If the engine refuses the command's form.
        """
        before, now = self.engine.timeline, self._now()
        kinds = kinds_of(command)
        try:
            answer: Receipt | Position | None = self.engine.execute(command)  # type: ignore[arg-type]
        except VrsError as error:
            self._count(kinds, "misuse", str(error))
            self._untouched(before, None)
            raise
        if not isinstance(answer, Receipt):
            self._untouched(before, None)
            if isinstance(answer, Position) and not np.array_equal(answer.q, self.engine.joints(answer.t)):
                raise LawBrokenError("query", f"the arm isn't at {answer.q} at {answer.t!r} s")
            self._count(kinds, "answered")
            return answer
        self._count(kinds, answer.status.value, answer.reason if answer.status is Status.REJECTED else "")
        if answer.status is Status.REJECTED:
            if not answer.reason:
                raise LawBrokenError("receipts", "rejected without a reason")
            fresh = answer.command_id not in self._receipts
            self._untouched(before, answer.command_id if fresh else None)
            return answer
        scene = self._look(now, before)
        at = scene.earliest(command, answer)
        self._remember(command, answer, at, scene)
        self._check(command, answer, at, scene)
        self._settle(scene)
        return answer

    def undo(self) -> Receipt | None:
        """Let the engine take back the newest edit.

        Raises:
            LawBrokenError: If a law is broken.
        """
        before, now = self.engine.timeline, self._now()
        step = self._steps[-1] if self._steps else None
        answer = self.engine.undo()
        self._count(("undo",), "nothing" if answer is None else "accepted")
        if answer is None:
            if step is not None and (now is None or now <= step.at or now < before.end):
                raise LawBrokenError("undo", f"the edit of command {step.command_id} could have been taken back")
            self._untouched(before, None)
            return None
        if step is None:
            raise LawBrokenError("undo", "there was nothing to take back")
        scene = self._look(now, before)
        self._steps.pop()
        self._stopped = None
        whole = now is None or now <= step.at
        if whole:
            self._check_restored(step, scene)
        else:
            self._steps.clear()
            if not answer.undone or answer.command_id != step.command_id:
                raise LawBrokenError("undo", "the receipt doesn't say that its command is undone")
            smooth = self._smooth_before(given(now), scene) and not self._is_rough(answer.command_id)
            self._smooth.add(step.command_id) if smooth else self._smooth.discard(step.command_id)
        at = step.at if now is None else max(now, step.at) if whole else now
        # Knots that were cut at a receipt's time, which is rounded, move back by as much.
        back = columns(step.timeline) if whole else None
        self._check_edit(scene, at - 1e-12 * max(1.0, abs(at)) if whole else at, back)
        self._settle(scene)
        return answer

    def _now(self) -> float | None:
        return None if self.engine.clock is None else self.engine.clock.now()

    def _count(self, kinds: tuple[str, ...], outcome: str, reason: str = "") -> None:
        for kind in kinds:
            self.answers[kind, outcome] += 1
        if reason:
            self.reasons[kinds[0], _FIGURES.sub("#", reason)] += 1

    def _look(self, now: float | None, before: Timeline) -> Scene:
        receipts = {r.command_id: r for r in self.engine.receipts}
        after = self.engine.timeline
        return Scene(now, before, self._columns, self._receipts, after, columns(after), receipts)

    def _settle(self, scene: Scene) -> None:
        self._columns, self._receipts = scene.new, scene.now_receipts

    def _untouched(self, before: Timeline, rejected: int | None) -> None:
        """Nothing was changed, but for the receipt of a new command that was rejected."""
        if self.engine.timeline is not before:
            raise LawBrokenError("nothing changed", "the timeline is another")
        receipts = {r.command_id: r for r in self.engine.receipts}
        if rejected is not None:
            self._receipts[rejected] = receipts[rejected]
        check_same(self._receipts, receipts, "nothing changed")

    def _remember(self, command: Command, answer: Receipt, at: float, scene: Scene) -> None:
        """Keep what later edits are judged by."""
        mine = answer.command_id
        rough = self._is_rough(mine)
        smooth = not rough
        if isinstance(command, MotionCommand):
            self._commands[mine] = command
            smooth = smooth and command.profile is Profile.JERK_LIMITED
        elif isinstance(command, Stop):
            smooth = smooth and self._smooth_before(at, scene)
        elif not isinstance(command, SteerCommand) or mine in scene.receipts:
            smooth = smooth and mine in self._smooth
        self._smooth.add(mine) if smooth else self._smooth.discard(mine)
        for i, receipt in scene.now_receipts.items():
            if receipt.version > scene.before.version and self._is_rough(i):
                self._smooth.discard(i)
        if rough:
            low, high = changed(scene.old, scene.new, at)
            self._smooth.difference_update(scene.new.owners[low:high])
        goes_on = isinstance(command, SteerCommand) and mine in scene.receipts
        if not goes_on:
            self._steps.append(_Step(mine, at, scene.before, scene.receipts))
        elif self._steps:
            self._steps[-1] = replace(self._steps[-1], at=min(at, self._steps[-1].at))
        stopped = isinstance(command, Stop)
        paused = self._stopped
        self._left = paused[0] if isinstance(command, Resume) and paused is not None else None
        self._stopped = (scene.old, at) if stopped else None
        if isinstance(command, Resume):
            if paused is None:
                raise LawBrokenError("resume", "nothing was stopped, or something was commanded since")
            old, then = paused
            i = old.index_at(then)
            first = max(i, 0)
            if 0 <= i < len(old) and old.owners[i] != HOLD:
                # All that's left of the interrupted command is planned anew.
                first = 1 + max(j for j, owner in enumerate(old.owners) if owner == old.owners[i])
                first = max(first, old.end_of_move(i))
            first = old.next_move(first)
            check_tail(old, scene.new, first, answer.shift, self.figures)

    def _is_rough(self, command_id: int) -> bool:
        """Whether jerk limits don't hold throughout, by what the receipt of a command says."""
        return is_rough(self.engine.notes(command_id))

    def _says(self, command_id: int, code: NoteCode) -> bool:
        return any(note.code is code for note in self.engine.notes(command_id))

    def _replanned(self, scene: Scene) -> set[int]:
        """Commands that go from elsewhere, as the one before them was cancelled."""
        return {i for i in scene.now_receipts if self._says(i, NoteCode.REPLANNED)}

    def _smooth_before(self, t: float, scene: Scene) -> bool:
        """Whether what moved just before a time keeps jerk limits."""
        i = int(np.searchsorted(scene.old.starts, t)) - 1
        return i >= 0 and scene.old.owners[i] in self._smooth

    def _check(self, command: Command, answer: Receipt, at: float, scene: Scene) -> None:
        if scene.now is not None and at < scene.now:
            raise LawBrokenError("the past", f"an edit at {at!r} s, {scene.now - at:.3g} s ago")
        self._check_edit(scene, at, self._left)
        if not isinstance(command, Resume):
            moves = {*self._commands, *scene.old.owners}
            planned = {i for i, r in scene.now_receipts.items() if r.version > scene.before.version}
            check_names(answer, scene.receipts, scene.now_receipts, moves, planned & self._replanned(scene))
        old, new = scene.old, scene.new
        if isinstance(command, MotionCommand):
            self._check_move(command, answer, at, scene)
        elif isinstance(command, ScaleTime):
            self._check_pace(command.factor, answer, at, scene)
        elif isinstance(command, Stop):
            if self._says(answer.command_id, NoteCode.STOPPED_ON_WAY):
                check_way(scene.before, scene.after, (at, new.end), None, 0.0, self.figures)
            self._ends(answer, at, scene)
        elif isinstance(command, SteerCommand):
            self._ends(answer, at, scene)
        elif isinstance(command, (Retime, Cancel, InsertVia)):
            first = scene.first_that_stays(command)
            if isinstance(command, Retime):
                # Taking the move out and putting it in again may each shift what comes after it.
                stand = {i for i in self._commands if scene.now_receipts[i].stands}
                check_moves(old, new, first, stand - self._replanned(scene) - {command.command_id}, self.figures)
            else:
                check_tail(old, new, first, answer.shift, self.figures)

    def _check_edit(self, scene: Scene, at: float, back: Columns | None = None) -> None:
        """The laws of all edits; `back` is an earlier plan of which parts may come back as they were."""
        check_past(scene.old, scene.new, at)
        check_memory(scene.before, scene.after, at)
        low, high = changed(scene.old, scene.new, at)
        known = scene.old.known()
        for row, duration in (back.known() if back is not None else {}).items():
            known[row] = max(duration, known.get(row, 0.0))
        check_run(scene.new, low, high, self.engine.limits, self._smooth, self.figures, known)
        check_rest(scene.after, scene.new, self.figures)
        check_receipts(scene.after, scene.new, scene.now_receipts, self._commands, self.figures)

    def _check_move(self, command: MotionCommand, answer: Receipt, at: float, scene: Scene) -> None:
        old, t = scene.old, scene.nominal(command)
        if command.deviation == 0 and at != t:
            raise LawBrokenError("receipts", f"to be executed at {t!r} s, planned for {at!r} s")
        if at > t:
            raise LawBrokenError("receipts", f"to be rounded from {t!r} s back, planned for {at!r} s")
        punctual = t == (t if command.execute_at is None else command.execute_at)
        if punctual != (answer.status is Status.ACCEPTED):
            raise LawBrokenError("receipts", f"{answer.status} for {t!r} s, asked for {command.execute_at!r} s")
        first = len(old)
        if command.insertion is Insertion.APPEND:
            if t < old.end:
                raise LawBrokenError("append", f"begins at {t!r} s, before the end at {old.end!r} s")
        elif command.insertion is Insertion.SPLICE and t < old.end:
            i = old.index_at(t)
            first = old.next_move(old.end_of_move(i) if i >= 0 and old.owners[i] != HOLD else max(i, 0))
        if first < len(old):
            check_tail(old, scene.new, first, answer.shift, self.figures)
        else:
            self._ends(answer, at, scene)

    def _check_pace(self, factor: float, answer: Receipt, at: float, scene: Scene) -> None:
        old, new, changes = scene.old, scene.new, given(answer.end)
        first = int(np.searchsorted(new.starts, changes + 1e-12 * max(1.0, abs(changes))))
        pair = check_pace(old, new, first, factor, self.figures)
        there = None
        if pair is not None:
            # From there on the pace is steady, so that places on the way are known.
            s, t = old.start_of(pair[0]), new.start_of(pair[1])
            there = s - factor * (t - changes)
            for moment in np.linspace(changes, t, 4):
                away = scene.after.sample(moment) - scene.before.sample(s - factor * (t - moment))
                self.figures.see("off the way [rad]", np.abs(away).max(), f"at {moment!r} s")
        if at < old.end:
            check_way(scene.before, scene.after, (at, changes), there, factor, self.figures)

    def _ends(self, answer: Receipt, at: float, scene: Scene) -> None:
        """Nothing follows what was planned."""
        if at < scene.old.end and abs(scene.new.end - given(answer.end)) > 1e-9:
            raise LawBrokenError("receipts", f"ends at {answer.end!r} s, the plan at {scene.new.end!r} s")

    def _check_restored(self, step: _Step, scene: Scene) -> None:
        if scene.after != step.timeline:
            raise LawBrokenError("undo", f"the timeline isn't what it was before command {step.command_id}")
        now = {i: r for i, r in scene.now_receipts.items() if i in step.receipts}
        check_same(step.receipts, now, "undo")
