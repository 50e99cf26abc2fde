"""Before and after an edit: what it was allowed to change, by the rules of insertion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vrs.chunk import HOLD
from vrs.commands import (
    Cancel,
    Command,
    Insertion,
    InsertVia,
    MotionCommand,
    PlanEdit,
    Retime,
    SteerCommand,
)
from vrs.receipt import Receipt
from vrs.testing.laws import Columns
from vrs.timeline import Timeline

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
