"""A recording's commands, run again: on engines that stand as the recorded ones did when it began."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from interfaces.messages.fields import plain
from interfaces.messages.recording import Anchor, CommandRecord, Late, Placement
from interfaces.recording.history import AnyEdit, AnyTimeline, edit_entries, placed
from interfaces.recording.kinds import MOBILE
from interfaces.recording.recording import Deed, Recording
from vrs.clock import ManualClock
from vrs.commands import Cancel, InsertVia, Lateness, Redo, Resume, Retime
from vrs.engine import Engine
from vrs.errors import FormatError, VrsError
from vrs.ledger import Receipt, Standing, Status


def begun(recording: Recording) -> tuple[Engine, ManualClock]:
    """An engine that stands as the recorded one did when the recording began, and its clock.

    Raises:
        FormatError: If it can't stand so, or what it needs for that is missing from the file.
    """
    begin, where, model = recording.session, str(recording.path), recording.model
    if begin.late is not None and recording.kind is MOBILE:
        raise FormatError(where, "it begins in the middle of a session, which isn't known of mobile robots")
    try:
        clock, lateness = ManualClock(begin.t), Lateness(begin.lateness)
        newest = 0 if begin.drive is None else begin.drive.newest
        if begin.late is None and not newest:
            start: dict[str, Any] = {recording.kind.state: begin.q}
            return Engine(model, **start, clock=clock, lateness=lateness), clock
        edits = recording.edits
        if not edits or edits[0].number:
            raise FormatError(where, "the timeline that it begins with is destroyed")
        begun_with: Any = edits[0].timeline
        engine = Engine(model, timeline=begun_with, clock=clock, lateness=lateness)
        if begin.late is None:
            engine.count_from(newest)
        else:
            engine.take_up(_stand(recording, begin.late, engine))
    except FormatError:
        raise
    except ValueError as error:
        raise FormatError(where, f"its beginning: {error}") from None
    return engine, clock


def _stand(recording: Recording, late: Late, engine: Engine) -> Standing:
    limits = replace(
        engine.limits, **{name: np.array(getattr(late, name)) for name in ("qd_max", "qdd_max", "qddd_max")}
    )
    steered = None if late.steered is None else (late.steered, late.steered_at)
    lateness = Lateness(recording.session.lateness)
    return Standing(
        late.newest, lateness, limits, steered, recording.given, late.grips[0][1] if late.grips else math.inf
    )


def rerun(recording: Recording) -> Rerun:
    """Run the recorded commands again, up to the first that's missing or that makes something else.

    Raises:
        FormatError: If the recording is of a robot that isn't known, or holds no commands that can be.
    """
    again = Rerun(*begun(recording), recording.changes, recording.session.late)
    for entry in recording.commands:
        if entry.number <= again.commands:
            again.missing = f"command {entry.number} is there twice: what follows can't be run again"
            break
        if entry.number != again.commands + 1:
            some = f"command {again.commands + 1} is" if entry.number == again.commands + 2 else (
                f"commands {again.commands + 1} to {entry.number - 1} are"
            )  # fmt: skip
            again.missing = f"{some} missing: what follows can't be run again"
            break
        again.run(entry)
        if again.difference or again.missing:
            break
    else:
        again.finish()
    return again


class Rerun:
    """What became of recorded commands on a fresh engine."""

    def __init__(self, engine: Engine, clock: ManualClock, changes: Sequence[AnyEdit], late: Late | None) -> None:
        self._clock, self._late = clock, late
        self._engines = [engine]
        """Of each drive; of an arm there's one."""
        self._recorded: dict[int, list[AnyEdit]] = {}
        for change in changes:
            self._recorded.setdefault(change.edit, []).append(change)
        first = self._recorded.pop(0, [])
        self.commands = 0
        """Commands, corrections and placements that were run again."""
        self.versions = 0
        """Timelines that were compared."""
        self.difference = ""
        """The first that differs; empty where none does."""
        self.missing = ""
        """Why some couldn't be run or compared; empty where all could."""
        if first and first[0].version != engine.timeline.version:
            self.difference = "the recording begins with a timeline that commands before it had made"
        self._edit = 0
        self._taken_up = {receipt.command_id for receipt in engine.receipts}
        self._unseen: list[int] = []

    @property
    def identical(self) -> bool:
        """Whether every timeline and receipt that could be compared is the same to the last digit."""
        return not self.difference

    @property
    def is_void(self) -> bool:
        """Whether there was something to compare, and nothing of it could be."""
        return bool(self.missing) and not self.versions

    @property
    def timeline(self) -> AnyTimeline:
        """What they made."""
        return self._engines[-1].timeline

    @property
    def drives(self) -> tuple[AnyTimeline, ...]:
        """The timeline that they made of each drive; of an arm there's one."""
        return tuple(engine.timeline for engine in self._engines)

    @property
    def receipts(self) -> tuple[Receipt, ...]:
        """The newest truth about each command."""
        return tuple(receipt for engine in self._engines for receipt in engine.receipts)

    def run(self, entry: Deed) -> None:
        """Run one entry, and compare what it makes."""
        self.commands += 1
        before = self._engines[-1].timeline
        try:
            self._clock.set(max(entry.at, self._clock.now()))
            if isinstance(entry, Placement):
                self._engines.append(placed(self._engines[-1], entry.posture, self._clock))
            engine, receipt, command_id, problem = self._engines[-1], None, None, ""
            if isinstance(entry, Anchor):
                made = engine.anchor(entry.truth)
                same = made.end == entry.end and np.array_equal(made.error, entry.error)
                problem = "" if same else "joins the real robot's plan otherwise"
            elif isinstance(entry, CommandRecord):
                receipt = self._carry_out(entry)
                command_id = None if receipt is None else receipt.command_id
                problem = _unlike(receipt, entry.receipt)
        except (VrsError, ValueError) as error:
            if not self._goes_back(entry, None):
                self.difference = f"{_named(entry)} can't be carried out: {error}"
            return
        if problem and self._goes_back(entry, receipt):
            return
        if problem:
            self.difference = f"{_named(entry)} {problem}"
        elif engine.timeline is not before:
            self._edit += 1
            after = engine.timeline
            self._compare(edit_entries(before, after, self._edit, entry.at, command_id), entry)

    def _goes_back(self, entry: Deed, made: Receipt | None) -> bool:
        """Whether a command needs what only an engine from before the recording knows."""
        late = self._late
        if late is None or not isinstance(entry, CommandRecord):
            return False
        command, answer = entry.command, entry.receipt
        undone = command is None and made is None and answer is not None and answer.command_id <= late.newest
        resumed = isinstance(command, Resume | Redo) and made is not None and made.status is Status.REJECTED
        of = command.command_id if isinstance(command, Retime | Cancel | InsertVia) else None
        unknown = of is not None and of <= late.newest and of not in self._taken_up
        # What was rejected changed nothing.
        if (undone or resumed or unknown) and (answer is None or answer.status is not Status.REJECTED):
            self.missing = (
                f"{_named(entry)} goes back to before the recording began: it and what follows can't be run again"
            )
        return undone or resumed or unknown

    def _carry_out(self, entry: CommandRecord) -> Receipt | None:
        command = entry.command
        if entry.refused and command is not None:
            return self._engines[-1].refuse(command, "" if entry.receipt is None else entry.receipt.reason)
        if command is None:
            return self._engines[-1].undo()
        answer: object = self._engines[-1].execute(command)
        return answer if isinstance(answer, Receipt) else None

    def _compare(self, made: tuple[AnyEdit, ...], entry: Deed) -> None:
        recorded = self._recorded.pop(self._edit, None)
        if recorded is None:
            self._unseen.append(self._edit)
            return
        self.versions += 1
        # The newest timeline stands in the file once more, as a whole.
        for mine, theirs in zip(made, recorded, strict=False):
            if unlike := _first(mine.as_written(), theirs.as_written()):
                self.difference = f"{_named(entry)} makes another timeline: {unlike}"
                return
        if len(made) > len(recorded):
            self.difference = f"{_named(entry)} makes another timeline: {len(made)} parts, not {len(recorded)}"

    def finish(self) -> None:
        """All entries were run."""
        if self._unseen:
            self.missing = f"{len(self._unseen)} edits aren't in the recording, from edit {self._unseen[0]} on"
        elif self._recorded:
            self.missing = f"what made edit {min(self._recorded)} isn't in the recording"


def _named(entry: Deed) -> str:
    if not isinstance(entry, CommandRecord):
        what = "correction" if isinstance(entry, Anchor) else "placement"
        return f"the {what} at {entry.at:.6f} s"
    if entry.command is None:
        return f"the undo at {entry.at:.6f} s"
    given = "" if entry.receipt is None else f" {entry.receipt.command_id}"
    return f"command{given} at {entry.at:.6f} s"


def _unlike(made: Receipt | None, recorded: Receipt | None) -> str:
    """How a receipt differs from the recorded one, names of others aside; empty where it doesn't."""
    if made is None or recorded is None:
        return "" if made is None and recorded is None else "has a receipt in one of the runs alone"
    for name, a, b in _differing(made, recorded):
        if name not in {"shifted_names", "superseded_names"}:
            return f"is answered with {name} {a!r}, not {b!r}"
    return ""


def _first(mine: msgspec.Struct, theirs: msgspec.Struct) -> str:
    """Where two messages first differ, as they're written; empty where they don't."""
    if type(mine) is not type(theirs):
        return "it begins elsewhere"
    for name, a, b in _differing(mine, theirs):
        if name != "segments":
            return f"{name} {a!r}, not {b!r}"
        if len(a) != len(b):
            return f"{len(a)} new segments, not {len(b)}"
        for number, (segment, other) in enumerate(zip(a, b, strict=True)):
            if segment != other:
                return f"of new segment {number}, {_first(segment, other)}"
    return ""


def _differing(mine: msgspec.Struct, theirs: msgspec.Struct) -> Iterator[tuple[str, Any, Any]]:
    """Fields that two values of a kind don't have in common, and what is in them; arrays as lists."""
    for name in mine.__struct_fields__:
        a, b = (plain(v) if isinstance(v, np.ndarray) else v for v in (getattr(mine, name), getattr(theirs, name)))
        if a != b:
            yield name, a, b
