"""A recording as tables, and those of an arm's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np

from interfaces.recording.history import arm_timeline
from interfaces.recording.messages import Anchor, CommandEntry
from interfaces.recording.poses import quaternions
from interfaces.recording.recording import Recording
from interfaces.recording.track import REAL, VIRTUAL
from vrs.model import Array

RADIANS = "rad"
_POSE = (("x_m", "m"), ("y_m", "m"), ("z_m", "m"), ("qx", ""), ("qy", ""), ("qz", ""), ("qw", ""))
_STAMPS = ("issued_at", "asked_at", "execute_at", "end")


class TableColumn(NamedTuple):
    """A column of a table."""

    name: str
    """With its unit where it has one."""
    unit: str
    """Empty where there's none."""
    kind: type
    """`float`, `int`, `bool` or `str`."""
    values: Sequence[Any]
    """None where there's none."""


class RecordingTable(NamedTuple):
    """A table; its columns are of one length."""

    name: str
    columns: tuple[TableColumn, ...]


def arm_tables(recording: Recording) -> tuple[RecordingTable, ...]:
    """An arm's tables; see `tables`."""
    return (
        _virtual(recording),
        _real(recording),
        commands_table(recording),
        receipts_table(recording),
        _segments(recording),
        edits_table(recording),
        _packets(recording),
        link_table(recording),
        events_table(recording),
    )


def table(name: str, *columns: TableColumn | Sequence[TableColumn]) -> RecordingTable:
    """A table of columns, and of lists of them."""
    found: list[TableColumn] = []
    for column in columns:
        found += [column] if isinstance(column, TableColumn) else column
    return RecordingTable(name, tuple(found))


def seconds(name: str, values: Sequence[float | None]) -> TableColumn:
    """A column of times."""
    return TableColumn(f"{name}_s", "s", float, values)


def _joints(name: str, q: Array) -> list[TableColumn]:
    return [TableColumn(f"{name}{i}_rad", RADIANS, float, column.tolist()) for i, column in enumerate(q.T, start=1)]


def _pose(X: Array) -> list[TableColumn]:
    """Position and unit quaternion of poses, (k, 4, 4); NaN where they aren't known."""
    known = np.isfinite(X).all(axis=(1, 2))
    values = np.full((len(X), 7), np.nan)
    values[known, :3], values[known, 3:] = X[known, :3, 3], quaternions(X[known, :3, :3])
    return [
        TableColumn(name, unit, float, column.tolist())
        for (name, unit), column in zip(_POSE, values.T, strict=True)
    ]


def _tool(recording: Recording, q: Array) -> list[TableColumn]:
    X = np.full((len(q), 4, 4), np.nan)
    known = np.isfinite(q).all(axis=1)
    if known.any():
        X[known] = recording.model.forward(q[known])
    return _pose(X)


def _virtual(recording: Recording) -> RecordingTable:
    t = recording.track(VIRTUAL).t
    q = recording.virtual(t)
    return table("virtual", seconds("t", t.tolist()), _joints("q", q), _tool(recording, q))


def _real(recording: Recording) -> RecordingTable:
    track = recording.track(REAL)
    return table(
        "real",
        seconds("t", track.t.tolist()),
        seconds("play", track.play.tolist()),
        _joints("q", track.q),
        _joints("reference", track.reference),
        _tool(recording, track.q),
    )


def commands_table(recording: Recording) -> RecordingTable:
    """What the operator's engine was told."""
    entries = recording.commands
    receipts = [entry.receipt if isinstance(entry, CommandEntry) else None for entry in entries]

    def told(name: str) -> list[Any]:
        return [None if receipt is None else getattr(receipt, name) for receipt in receipts]

    # A drive command has no target.
    n = len(recording.session.q) if recording.kind.word == "arm" else 0
    q = np.array([[math.nan] * n if row is None or len(row) != n else row for row in told("q")]).reshape(
        len(entries), n
    )
    return table(
        "commands",
        TableColumn("number", "", int, [entry.number for entry in entries]),
        seconds("at", [entry.at for entry in entries]),
        TableColumn("command", "", str, [_kind(entry) for entry in entries]),
        TableColumn("command_id", "", int, told("command_id")),
        TableColumn("status", "", str, [None if status is None else str(status) for status in told("status")]),
        [seconds(name, told(name)) for name in _STAMPS],
        _joints("q", q),
        TableColumn("refused", "", bool, [isinstance(entry, CommandEntry) and entry.refused for entry in entries]),
        TableColumn("reason", "", str, [_reason(entry) for entry in entries]),
        TableColumn("content", "", str, [_content(entry) for entry in entries]),
    )


def _kind(entry: CommandEntry | Anchor) -> str:
    if isinstance(entry, Anchor):
        return "correction"
    return "undo" if entry.command is None else str(entry.command.__struct_config__.tag)


def _reason(entry: CommandEntry | Anchor) -> str:
    if isinstance(entry, Anchor):
        return entry.reason
    return "" if entry.receipt is None else entry.receipt.reason


def _content(entry: CommandEntry | Anchor) -> str | None:
    """A command as JSON."""
    if isinstance(entry, Anchor) or entry.command is None:
        return None
    return msgspec.json.encode(entry.command).decode()


def receipts_table(recording: Recording) -> RecordingTable:
    """The newest truth about each command at each site."""
    rows = [("virtual", receipt) for receipt in recording.receipts("virtual")]
    rows += [("real", receipt) for receipt in recording.receipts("real")]

    def told(name: str) -> list[Any]:
        return [getattr(receipt, name) for _, receipt in rows]

    return table(
        "receipts",
        TableColumn("site", "", str, [site for site, _ in rows]),
        TableColumn("command_id", "", int, told("command_id")),
        TableColumn("status", "", str, [str(status) for status in told("status")]),
        [seconds(name, told(name)) for name in _STAMPS],
        seconds("shift", told("shift")),
        TableColumn("superseded_by", "", int, told("superseded_by")),
        TableColumn("undone", "", bool, told("undone")),
        TableColumn("reason", "", str, told("reason")),
    )


def _segments(recording: Recording) -> RecordingTable:
    """The newest timeline, a row a segment and joint."""
    rows: list[tuple[int, float, float, int | None, int, list[float]]] = []
    for number, segment in enumerate(arm_timeline(recording.timeline).segments):
        for joint, powers in enumerate(segment.coefficients.T.tolist(), start=1):
            rows.append((number, segment.start, segment.duration, segment.command_id, joint, powers))
    most = max((len(row[-1]) for row in rows), default=1)
    return table(
        "segments",
        TableColumn("segment", "", int, [row[0] for row in rows]),
        seconds("start", [row[1] for row in rows]),
        seconds("duration", [row[2] for row in rows]),
        TableColumn("command_id", "", int, [row[3] for row in rows]),
        TableColumn("joint", "", int, [row[4] for row in rows]),
        [
            TableColumn(
                f"c{k}_{_power(k, '_per_')}", _power(k, "/"), float, [(row[5] + [0.0] * most)[k] for row in rows]
            )
            for k in range(most)
        ],
    )


def _power(k: int, per: str) -> str:
    """Unit of a coefficient of a power."""
    return RADIANS if k == 0 else f"{RADIANS}{per}s{k if k > 1 else ''}"


def edits_table(recording: Recording) -> RecordingTable:
    """The timelines that the virtual robot had."""
    edits = recording.edits
    return table(
        "edits",
        TableColumn("edit", "", int, [edit.number for edit in edits]),
        seconds("at", [edit.at for edit in edits]),
        TableColumn("version", "", int, [edit.timeline.version for edit in edits]),
        TableColumn("command_id", "", int, [edit.command_id for edit in edits]),
        seconds("end", [edit.timeline.end for edit in edits]),
    )


def _packets(recording: Recording) -> RecordingTable:
    packets = recording.packets
    return table(
        "packets",
        TableColumn("command_id", "", int, [packet.command_id for packet in packets]),
        TableColumn("real_id", "", int, [packet.real_id for packet in packets]),
        seconds("sent", [packet.sent for packet in packets]),
        seconds("arrived", [packet.arrived for packet in packets]),
        TableColumn("lost", "", bool, [packet.lost for packet in packets]),
    )


def link_table(recording: Recording) -> RecordingTable:
    """Packets of the link."""
    entries = recording.link
    sized = any(entry.size for entry in entries)
    return table(
        "link",
        TableColumn("direction", "", str, [entry.direction for entry in entries]),
        seconds("sent", [entry.sent for entry in entries]),
        seconds("arrived", [entry.arrived for entry in entries]),
        TableColumn("lost", "", bool, [entry.lost for entry in entries]),
        TableColumn("attempts", "", int, [entry.attempts for entry in entries]),
        [TableColumn("size_byte", "byte", int, [entry.size for entry in entries])] if sized else [],
    )


def events_table(recording: Recording) -> RecordingTable:
    """What else happened."""
    events = recording.events
    return table(
        "events",
        seconds("t", [event.t for event in events]),
        TableColumn("kind", "", str, [event.kind for event in events]),
        TableColumn("text", "", str, [event.text for event in events]),
    )
