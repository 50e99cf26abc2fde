"""A recording as tables, for spreadsheets and data frames: CSV or Parquet, a file a table."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from interfaces.recording.driving.tables import mobile_tables
from interfaces.recording.kinds import ARM
from interfaces.recording.recording import Recording
from interfaces.recording.tables import RecordingTable, arm_tables
from vrs.errors import FormatError, InvalidValueError


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
