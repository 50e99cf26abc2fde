"""Laws of receipts: they are true, they name what they should, and nothing else changes them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields

import numpy as np

from vrs.receipt import Receipt, Status
from vrs.testing.laws import Columns, Figures, LawBrokenError
from vrs.timeline import Timeline

_KEPT = tuple(item.name for item in fields(Receipt) if item.name not in {"q", "shifted_names", "superseded_names"})
_ROUNDING = 1.001e-9
"""Times that differ by less [s] may be the same."""
_SHORT = 1e-6
"""Moves up to this long [s] aren't looked for at their receipts' times, which are rounded."""


def check_receipts(
    timeline: Timeline, run: Columns, receipts: dict[int, Receipt], moves: Collection[int], figures: Figures
) -> None:
    """Every receipt that stands says where the arm is at its end, and its move is under way when it says so.

    Args:
        timeline: What is scheduled.
        run: Its segments.
        receipts: All receipts, by command id.
        moves: Commands that have moves of their own, under way from beginning to end.
        figures: Where the worst figures are kept.

    Raises:
        LawBrokenError: If one doesn't.
    """
    for r in receipts.values():
        if r.status is Status.REJECTED and (r.stands or r.execute_at is not None or not r.reason):
            raise LawBrokenError(
                "receipts", f"command {r.command_id} was rejected, and its receipt says other things"
            )
        if r.stands and r.command_id in moves and r.execute_at is not None and r.end is not None:
            if r.end - r.execute_at <= _SHORT:
                continue
            middle = run.index_at(0.5 * (r.execute_at + r.end))
            if not 0 <= middle < len(run) or run.owners[middle] != r.command_id:
                raise LawBrokenError("receipts", f"command {r.command_id} isn't under way when its receipt says so")
    standing = [r for r in receipts.values() if r.stands and r.q is not None]
    if standing:
        away = np.abs(timeline.sample([r.end for r in standing]) - [r.q for r in standing]).max(1)  # type: ignore[arg-type]
        worst = standing[int(away.argmax())]
        figures.see("receipt's q [rad]", away.max(), f"in the receipt of command {worst.command_id}")


def check_names(
    answer: Receipt, version: int, before: dict[int, Receipt], after: dict[int, Receipt], moves: Collection[int]
) -> None:
    """A receipt names what it shifted and superseded, and no other.

    Args:
        answer: The receipt.
        version: Of the timeline before the edit.
        before: All receipts before the edit, by command id.
        after: After it.
        moves: Commands that have moves of their own.

    Raises:
        LawBrokenError: If it doesn't.
    """
    mine, shifted, superseded = answer.command_id, set(answer.shifted), set(answer.superseded)
    gone: set[int] = set()
    moved: dict[int, float] = {}
    for i, was in before.items():
        r = after[i]
        if i == mine or not was.stands:
            continue
        if not r.stands:
            if r.superseded_by != mine:
                raise LawBrokenError("receipts", f"command {i} stands no more, and doesn't name command {mine}")
            if i in moves:
                gone.add(i)
        elif "elsewhere" in r.reason and r.version > version:
            shifted.discard(i)
        elif was.execute_at != was.end:
            times = zip((was.execute_at, was.end), (r.execute_at, r.end), strict=True)
            moved[i] = max(abs(x - y) for x, y in times if x is not None and y is not None)
    # What stood no more, has no move or belongs to the engine that this one branched from may be named too.
    stands = {i for i in superseded if i != mine and i in after and after[i].stands}
    if not gone <= superseded or stands:
        raise LawBrokenError("receipts", f"superseded {sorted(gone)}, says {sorted(superseded)}")
    shifted = {i for i in shifted if i in moves and i in after and after[i].stands and i != mine}
    far = {i for i, away in moved.items() if away > _ROUNDING and i in moves}
    if not far <= shifted or not all(moved.get(i, 1.0) for i in shifted):
        raise LawBrokenError("receipts", f"shifted {sorted(far)}, says {sorted(shifted)}")


def check_same(was: dict[int, Receipt], now: dict[int, Receipt], law: str) -> None:
    """Receipts say the same.

    Args:
        was: Receipts by command id.
        now: The same ones, later.
        law: What's broken if they don't.

    Raises:
        LawBrokenError: If one doesn't.
    """
    if was.keys() != now.keys():
        raise LawBrokenError(law, f"receipts {sorted(was.keys() ^ now.keys())} came or went")
    for i, r in was.items():
        other = now[i]
        if other is r:
            continue
        for name in _KEPT:
            if getattr(r, name) != getattr(other, name):
                detail = f"receipt {i}: {name} was {getattr(r, name)!r}, is {getattr(other, name)!r}"
                raise LawBrokenError(law, detail)
        if not np.array_equal(r.q, other.q):  # type: ignore[arg-type]
            raise LawBrokenError(law, f"receipt {i}: q was {r.q}, is {other.q}")
