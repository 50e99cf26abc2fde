"""A reader of segments that knows `docs/protocol.md` alone: lists and floats, nothing of the house."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Any

Message = dict[str, Any]
Row = tuple[float, float, "int | None", list[list[float]]]
"""Start, duration, command, coefficients by ascending power."""


def rows_of(message: Message) -> list[Row]:
    """The segments of a message: each starts where the one before ends, unless it says otherwise."""
    start, found = message.get("start", 0.0), []
    for duration, command, coefficients, *own in message.get("segments", ()):
        start = own[0] if own and own[0] is not None else start
        found.append((start, duration, command, coefficients))
        start += duration
    return found


@dataclass
class DocumentReader:
    """Takes decoded JSON, tells what to send, and keeps the timeline."""

    rows: list[Row] | None = None
    edit: int = 0
    past: float = float("-inf")
    misfits: int = 0
    applied: int = 0
    scene: Message | None = None
    outbox: list[Message] = field(default_factory=list)
    _fetched: list[Row] = field(default_factory=list)
    held: dict[int, Message] = field(default_factory=dict)

    def begin(self, number: int = 1) -> None:
        """Follow."""
        self.rows = self.scene = None
        self.outbox.append({"type": "follow", "number": number, "form": "segments"})

    def receive(self, message: Message) -> None:
        """Take a message of the server."""
        match message["type"]:
            case "scene":
                self.scene, self._fetched = message, []
                self._next()
            case "history" if self.rows is None and message["index"] == len(self._fetched):
                self._fetched += rows_of(message)
                if len(self._fetched) % 256 == 0 or len(self._fetched) == self.scene["segments"]:
                    self._next()
            case "change":
                self.held[message.get("base", message["edit"] - 1)] = message
                while self.rows is not None and self.edit in self.held:
                    self._apply(self.held.pop(self.edit))
            case "pulse":
                if message["edit"] == self.edit:
                    past = message.get("past", message["now"])
                    self.past = max(self.past, past if past is not None else self.past)

    def _next(self) -> None:
        if len(self._fetched) < self.scene["segments"]:
            self.outbox.append({"type": "want", "edit": self.scene["edit"], "index": len(self._fetched)})
        else:
            self.rows, self.edit = self._fetched, self.scene["edit"]
            self.outbox.append({"type": "want", "edit": self.edit})

    def _apply(self, change: Message) -> None:
        base, tail, end = self.rows, change.get("tail"), change["end"]
        rows = base[: change["first"]] + rows_of(change)
        if tail is not None:
            at = change.get("tail_start", end)
            old = base[tail][0] if tail < len(base) else at
            rows += [(at + (start - old), *rest) for start, *rest in base[tail:]]
        found = rows[-1][0] + rows[-1][1] if rows else self.scene["start"]
        self.misfits += abs(found - end) > 1e-9 * max(1.0, abs(end))
        self.rows, self.edit = rows, change["edit"]
        self.applied += 1

    def joints(self, t: float) -> list[float]:
        """By Horner's rule, at a knot by the later segment."""
        index = bisect_right(self.rows, t, key=lambda row: row[0]) - 1
        if index < 0:
            return list(self.scene["initial"])
        start, duration, _, coefficients = self.rows[index]
        u = min(t - start, duration) if index == len(self.rows) - 1 else t - start
        value = [0.0] * len(coefficients[0])
        for row in reversed(coefficients):
            value = [x * u + a for x, a in zip(value, row, strict=True)]
        return value
