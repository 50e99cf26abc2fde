"""A recording as tables, in memory, as CSV and as Parquet."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from interfaces.messages.fields import plain
from interfaces.recording.history import arm_timeline
from interfaces.recording.messages import Anchor, CommandEntry
from interfaces.recording.poses import quaternions
from interfaces.recording.recording import ARM, Recording
from interfaces.recording.track import ESTIMATED, MEASURED, REAL, REAL_POSTURE, VIRTUAL, VIRTUAL_POSTURE
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import ArcTimeline
from vrs.model import Array, unit_of

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


def _joints(recording: Recording, name: str, q: Array) -> list[TableColumn]:
    units = [unit_of(j, recording.prismatic) for j in range(q.shape[1])]
    return [
        TableColumn(f"{name}{i}_{unit}", unit, float, column.tolist())
        for i, (column, unit) in enumerate(zip(q.T, units, strict=True), start=1)
    ]


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
    return table("virtual", seconds("t", t.tolist()), _joints(recording, "q", q), _tool(recording, q))


def _real(recording: Recording) -> RecordingTable:
    track = recording.track(REAL)
    return table(
        "real",
        seconds("t", track.t.tolist()),
        seconds("play", track.play.tolist()),
        _joints(recording, "q", track.q),
        _joints(recording, "reference", track.reference),
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
        _joints(recording, "q", q),
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
    return msgspec.json.encode(entry.command, enc_hook=plain).decode()


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
    base = f"{RADIANS}_or_m" if recording.prismatic else RADIANS
    return table(
        "segments",
        TableColumn("segment", "", int, [row[0] for row in rows]),
        seconds("start", [row[1] for row in rows]),
        seconds("duration", [row[2] for row in rows]),
        TableColumn("command_id", "", int, [row[3] for row in rows]),
        TableColumn("joint", "", int, [row[4] for row in rows]),
        [
            TableColumn(
                f"c{k}_{_power(base, k, '_per_')}",
                _power(base, k, "/"),
                float,
                [(row[5] + [0.0] * most)[k] for row in rows],
            )
            for k in range(most)
        ],
    )


def _power(base: str, k: int, per: str) -> str:
    """Unit of a coefficient of a power."""
    return base if k == 0 else f"{base}{per}s{k if k > 1 else ''}"


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


_POSTURE = (("x_m", "m"), ("y_m", "m"), ("theta_rad", "rad"))
_DRIVE = (("v_m_per_s", "m/s"), ("w_rad_per_s", "rad/s"))


def mobile_tables(recording: Recording) -> tuple[RecordingTable, ...]:
    """All tables of a recording: `docs/recording.md` describes their columns.

    Raises:
        FormatError: If a message in it makes no sense.
    """
    return (
        _virtual_postures(recording),
        _real_postures(recording),
        _postures(recording, "measured", MEASURED),
        _postures(recording, "estimated", ESTIMATED),
        commands_table(recording),
        receipts_table(recording),
        _arcs(recording),
        edits_table(recording),
        link_table(recording),
        events_table(recording),
        _environment(recording),
    )


def _columns(names: tuple[tuple[str, str], ...], values: Array) -> list[TableColumn]:
    pairs = zip(names, values.T, strict=True)
    return [TableColumn(name, unit, float, column.tolist()) for (name, unit), column in pairs]


def _virtual_postures(recording: Recording) -> RecordingTable:
    t = recording.track(VIRTUAL_POSTURE).t
    return table("virtual", seconds("t", t.tolist()), _columns(_POSTURE, recording.virtual(t)))


def _real_postures(recording: Recording) -> RecordingTable:
    track = recording.track(REAL_POSTURE)
    return table(
        "real",
        seconds("t", track.t.tolist()),
        seconds("play", track.play.tolist()),
        _columns(_POSTURE, track.q),
        _columns(_DRIVE, track.reference),
    )


def _postures(recording: Recording, name: str, topic: str) -> RecordingTable:
    track = recording.track(topic)
    return table(name, seconds("t", track.t.tolist()), _columns(_POSTURE, track.q))


def _arcs(recording: Recording) -> RecordingTable:
    """The newest timeline, a row an arc."""
    timeline = recording.timeline
    arcs = timeline.segments if isinstance(timeline, ArcTimeline) else ()
    return table(
        "segments",
        TableColumn("segment", "", int, list(range(len(arcs)))),
        seconds("start", [arc.start for arc in arcs]),
        seconds("duration", [arc.duration for arc in arcs]),
        TableColumn("command_id", "", int, [arc.command_id for arc in arcs]),
        _columns(_POSTURE, np.array([arc.posture for arc in arcs]).reshape(-1, 3)),
        _columns(_DRIVE, np.array([(arc.v, arc.w) for arc in arcs]).reshape(-1, 2)),
    )


def _environment(recording: Recording) -> RecordingTable:
    """Cells of the virtual environment that came and went, a row a cell and time."""
    rows = [
        (entry.t, came, i, j)
        for entry in recording.learned
        for came, flat in ((True, entry.added), (False, entry.gone))
        for i, j in zip(flat[::2], flat[1::2], strict=False)
    ]
    return table(
        "environment",
        seconds("t", [row[0] for row in rows]),
        TableColumn("came", "", bool, [row[1] for row in rows]),
        TableColumn("i", "", int, [row[2] for row in rows]),
        TableColumn("j", "", int, [row[3] for row in rows]),
    )


def tables(recording: Recording) -> tuple[RecordingTable, ...]:
    """A recording's tables: `docs/recording.md` describes their columns.

    Raises:
        FormatError: If the recording's robot isn't known.
    """
    return arm_tables(recording) if recording.kind is ARM else mobile_tables(recording)


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
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write(path, table)
    except OSError as error:
        raise FormatError(str(path), f"can't be written: {error.strerror or error}") from None
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
