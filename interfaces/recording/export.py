"""A recording as tables, in memory, as CSV and as Parquet."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from msgspec import inspect as kinds

from interfaces.messages.description import described
from interfaces.messages.fields import plain
from interfaces.messages.recording import Anchor, ArcEntry, CommandPacket, CommandRecord, LinkEntry, RunEvent
from interfaces.recording.history import arm_timeline
from interfaces.recording.kinds import ARM
from interfaces.recording.poses import quaternions
from interfaces.recording.recording import Deed, Recording
from interfaces.recording.track import ESTIMATED, MEASURED
from interfaces.runs.summary import UNIT
from interfaces.system import written
from vrs.errors import InvalidValueError
from vrs.ledger import Receipt
from vrs.mobile import ArcTimeline
from vrs.model import Array, unit_of

_POSE = "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"
_POSTURE = "x_m", "y_m", "theta_rad"
_DRIVE = "v_m_per_s", "w_rad_per_s"
_STAMPS = "issued_at_s", "asked_at_s", "execute_at_s", "end_s"
_KINDS: dict[type, type] = {kinds.FloatType: float, kinds.IntType: int, kinds.BoolType: bool}


class TableColumn(NamedTuple):
    """A column of a table."""

    name: str
    """With its unit where it has one."""
    kind: type
    """`float`, `int`, `bool` or `str`."""
    values: Sequence[Any]
    """None where there's none."""

    @property
    def unit(self) -> str:
        """Empty where there's none."""
        found = UNIT.search(self.name)
        return found[1].replace("_per_", "/") if found else ""


class RecordingTable(NamedTuple):
    """A table; its columns are of one length."""

    name: str
    columns: tuple[TableColumn, ...]


def _table(name: str, *columns: Sequence[TableColumn]) -> RecordingTable:
    return RecordingTable(name, tuple(column for some in columns for column in some))


def _fields(kind: type, values: Sequence[Any], *names: str) -> list[TableColumn]:
    """Columns of fields of values, called as those and their units; None where a value is."""
    types = {field.name: field.type for field in described(kind).fields}
    found = []
    for name in names:
        field = UNIT.sub("", name)
        cells = [None if value is None else getattr(value, field) for value in values]
        found.append(TableColumn(name, _KINDS.get(type(types[field]), str), cells))
    return found


def _rows(rows: Sequence[Sequence[Any]], **columns: type) -> list[TableColumn]:
    """Columns of rows, by their names."""
    return [TableColumn(name, kind, [row[k] for row in rows]) for k, (name, kind) in enumerate(columns.items())]


def _numbers(names: Iterable[str], values: Array) -> list[TableColumn]:
    """Columns of an array (k, m)."""
    return [TableColumn(name, float, column.tolist()) for name, column in zip(names, values.T, strict=True)]


def _joints(recording: Recording, name: str, q: Array) -> list[TableColumn]:
    units = (unit_of(j, recording.prismatic) for j in range(q.shape[1]))
    return _numbers((f"{name}{i}_{unit}" for i, unit in enumerate(units, start=1)), q)


def _tool(recording: Recording, q: Array) -> list[TableColumn]:
    """Position and unit quaternion of an arm's tool; NaN where the joints aren't known."""
    if recording.kind is not ARM:
        return []
    values = np.full((len(q), len(_POSE)), np.nan)
    known = np.isfinite(q).all(axis=1)
    if known.any():
        X = recording.model.forward(q[known])
        values[known, :3], values[known, 3:] = X[:, :3, 3], quaternions(X[:, :3, :3])
    return _numbers(_POSE, values)


def _state(recording: Recording, q: Array) -> list[TableColumn]:
    return _joints(recording, "q", q) if recording.kind is ARM else _numbers(_POSTURE, q)


def _virtual(recording: Recording) -> RecordingTable:
    t = recording.track(recording.kind.virtual).t
    q = recording.virtual(t)
    return _table("virtual", _numbers(["t_s"], t[:, None]), _state(recording, q), _tool(recording, q))


def _real(recording: Recording) -> RecordingTable:
    track = recording.track(recording.kind.real)
    told = track.reference
    return _table(
        "real",
        _numbers(["t_s", "play_s"], np.stack((track.t, track.play), axis=1)),
        _state(recording, track.q),
        _joints(recording, "reference", told) if recording.kind is ARM else _numbers(_DRIVE, told),
        _tool(recording, track.q),
    )


def _commands(recording: Recording) -> RecordingTable:
    """What the operator's engine was told."""
    entries = recording.commands
    receipts = [entry.receipt if isinstance(entry, CommandRecord) else None for entry in entries]
    # A drive command has no target.
    n = len(recording.session.q) if recording.kind is ARM else 0
    goals = [None if receipt is None else receipt.q for receipt in receipts]
    q = np.array([[math.nan] * n if goal is None or len(goal) != n else goal for goal in goals])
    return _table(
        "commands",
        _fields(CommandRecord, entries, "number", "at_s"),
        [TableColumn("command", str, [_kind(entry) for entry in entries])],
        _fields(Receipt, receipts, "command_id", "status", *_STAMPS),
        _joints(recording, "q", q.reshape(len(entries), n)),
        [
            TableColumn("refused", bool, [isinstance(one, CommandRecord) and one.refused for one in entries]),
            TableColumn("reason", str, [_reason(entry) for entry in entries]),
            TableColumn("content", str, [_content(entry) for entry in entries]),
        ],
    )


def _kind(entry: Deed) -> str:
    if not isinstance(entry, CommandRecord):
        return "correction" if isinstance(entry, Anchor) else "placed"
    return "undo" if entry.command is None else str(entry.command.__struct_config__.tag)


def _reason(entry: Deed) -> str:
    if isinstance(entry, Anchor):
        return entry.reason
    receipt = entry.receipt if isinstance(entry, CommandRecord) else None
    return "" if receipt is None else receipt.reason


def _content(entry: Deed) -> str | None:
    """A command as JSON."""
    if not isinstance(entry, CommandRecord) or entry.command is None:
        return None
    return msgspec.json.encode(entry.command, enc_hook=plain).decode()


def _receipts(recording: Recording) -> RecordingTable:
    """The newest truth about each command at each site."""
    virtual, real = recording.receipts("virtual"), recording.receipts("real")
    told = "command_id", "status", *_STAMPS, "shift_s", "superseded_by", "undone", "reason"
    return _table(
        "receipts",
        [TableColumn("site", str, ["virtual"] * len(virtual) + ["real"] * len(real))],
        _fields(Receipt, (*virtual, *real), *told),
    )


def _segments(recording: Recording) -> RecordingTable:
    """The newest timeline, a row a segment and joint."""
    rows = [
        (number, segment.start, segment.duration, segment.command_id, joint, powers)
        for number, segment in enumerate(arm_timeline(recording.timeline).segments)
        for joint, powers in enumerate(segment.coefficients.T.tolist(), start=1)
    ]
    most = max((len(row[-1]) for row in rows), default=1)
    base = "rad_or_m" if recording.prismatic else "rad"
    names = [f"c{k}_{base}" + f"_per_s{k if k > 1 else ''}" * (k > 0) for k in range(most)]
    return _table(
        "segments",
        _rows(rows, segment=int, start_s=float, duration_s=float, command_id=int, joint=int),
        _rows([(row[-1] + [0.0] * most)[:most] for row in rows], **dict.fromkeys(names, float)),
    )


def _edits(recording: Recording) -> RecordingTable:
    """The timelines that the virtual robot had."""
    rows = [(e.number, e.at, e.timeline.version, e.command_id, e.timeline.end) for e in recording.edits]
    return _table("edits", _rows(rows, edit=int, at_s=float, version=int, command_id=int, end_s=float))


def _packets(recording: Recording) -> RecordingTable:
    told = "command_id", "real_id", "sent_s", "arrived_s", "lost"
    return _table("packets", _fields(CommandPacket, recording.packets, *told))


def _link(recording: Recording) -> RecordingTable:
    entries = recording.link
    sized = ["size_byte"] * any(entry.size for entry in entries)
    return _table(
        "link", _fields(LinkEntry, entries, "direction", "sent_s", "arrived_s", "lost", "attempts", *sized)
    )


def _events(recording: Recording) -> RecordingTable:
    return _table("events", _fields(RunEvent, recording.events, "t_s", "kind", "text"))


def _postures(recording: Recording, name: str, topic: str) -> RecordingTable:
    track = recording.track(topic)
    return _table(name, _numbers(["t_s", *_POSTURE], np.column_stack((track.t, track.q))))


def _arcs(recording: Recording) -> RecordingTable:
    """The newest timeline of each drive, a row an arc."""
    arcs = [arc for drive in recording.drives if isinstance(drive, ArcTimeline) for arc in drive.segments]
    return _table(
        "segments",
        _rows([(number,) for number in range(len(arcs))], segment=int),
        _fields(ArcEntry, arcs, "start_s", "duration_s", "command_id"),
        _numbers(_POSTURE, np.array([arc.posture for arc in arcs]).reshape(-1, 3)),
        _fields(ArcEntry, arcs, *_DRIVE),
    )


def _environment(recording: Recording) -> RecordingTable:
    """Cells of the virtual environment that came and went, a row a cell and time."""
    rows = [
        (entry.t, came, i, j)
        for entry in recording.learned
        for came, flat in ((True, entry.added), (False, entry.gone))
        for i, j in zip(flat[::2], flat[1::2], strict=False)
    ]
    return _table("environment", _rows(rows, t_s=float, came=bool, i=int, j=int))


def tables(recording: Recording) -> tuple[RecordingTable, ...]:
    """A recording's tables: `docs/recording.md` describes their columns.

    Raises:
        FormatError: If the recording's robot isn't known, or a message in it makes no sense.
    """
    arm = recording.kind is ARM
    thought = () if arm else (("measured", MEASURED), ("estimated", ESTIMATED))
    return (
        _virtual(recording),
        _real(recording),
        *(_postures(recording, name, topic) for name, topic in thought),
        _commands(recording),
        _receipts(recording),
        (_segments if arm else _arcs)(recording),
        _edits(recording),
        *((_packets(recording),) if arm else ()),
        _link(recording),
        _events(recording),
        *(() if arm else (_environment(recording),)),
    )


def write_csv(found: Iterable[RecordingTable], folder: Path) -> tuple[Path, ...]:
    """Write tables as CSV: commas, a head, floats to the last digit, nothing where there's no value.

    Args:
        found: The tables.
        folder: Made if it's missing; files of the same names are replaced.

    Returns:
        The files.

    Raises:
        FormatError: If they can't be written.
    """
    return tuple(_written(folder, "csv", table, _csv) for table in found)


def write_parquet(found: Iterable[RecordingTable], folder: Path) -> tuple[Path, ...]:
    """Write tables as Parquet, the columns' units in their metadata; see `write_csv`.

    Raises:
        FormatError: If they can't be written.
        InvalidValueError: If pyarrow isn't installed.
    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        allowed = "with pyarrow installed: pip install 'vrs-teleop[parquet]'"
        raise InvalidValueError("--parquet", str(folder), allowed) from None
    kinds = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string()}

    def write(path: Path, table: RecordingTable) -> None:
        fields, arrays = [], []
        for column in table.columns:
            kind = kinds[column.kind]
            fields.append(pa.field(column.name, kind, metadata={"unit": column.unit} if column.unit else None))
            arrays.append(pa.array([_cell(value) for value in column.values], type=kind))
        parquet.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), path)

    return tuple(_written(folder, "parquet", table, write) for table in found)


def _written(folder: Path, kind: str, table: RecordingTable, write: Callable[[Path, RecordingTable], None]) -> Path:
    path = folder / f"{table.name}.{kind}"
    with written(path):
        folder.mkdir(parents=True, exist_ok=True)
        write(path, table)
    return path


def _csv(path: Path, table: RecordingTable) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([column.name for column in table.columns])
        for row in zip(*(column.values for column in table.columns), strict=True):
            writer.writerow([_text(_cell(value)) for value in row])


def _cell(value: Any) -> Any:
    """A value, None where it's none of a number."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(float(value)) if isinstance(value, float) else str(value)
