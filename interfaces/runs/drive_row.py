"""A run of the mobile robot's laboratory as a row of figures, and how that's written."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from interfaces.runs.drive_run import DriveRun
from vrs.comparison import PathComparison

DIGITS = 6
"""Significant digits of what was measured."""
METRICS = tuple(item.name for item in fields(PathComparison))
"""Names of the metrics, as in files."""
KEYS = ("architecture", "transport", "delay", "robot", "operator")
COLUMNS = (*KEYS, "seed", *METRICS, "collisions", "limits_passed", "sent_bytes", "longest_delay")
"""Of runs.csv; lengths in metres, times in seconds, speeds in m/s. An empty cell is undefined."""


@dataclass(frozen=True, slots=True)
class Row:
    """A run, in figures."""

    architecture: str
    transport: str
    delay: str
    robot: str
    operator: str
    seed: int
    metrics: PathComparison
    collisions: int
    limits_passed: int
    """Drives beyond a limit."""
    sent_bytes: int
    longest_delay: float
    """Of a packet that was sent while the operator drove [s]."""

    @property
    def group(self) -> tuple[str, ...]:
        """What it's one of several seeds of."""
        return self.architecture, self.transport, self.delay, self.robot, self.operator


def row_of(drive: DriveRun) -> Row:
    """The figures of a run."""
    case = drive.case
    return Row(
        *case.group, case.seed, drive.compare(), drive.collisions, drive.limits_passed(), drive.sent_bytes,
        float(drive.delays[:, 1].max(initial=0.0)),
    )  # fmt: skip


def cell(value: float | int | str | None) -> str:
    """A value as it stands in a table: six significant digits, nothing where it's undefined."""
    if value is None:
        return ""
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)


def values_of(row: Row) -> list[Any]:
    """What stands in the `COLUMNS`."""
    metrics = (getattr(row.metrics, name) for name in METRICS)
    rest = row.collisions, row.limits_passed, row.sent_bytes, row.longest_delay
    return [*row.group, row.seed, *metrics, *rest]


def facts_of(row: Row) -> dict[str, Any]:
    """A row of runs.csv as JSON takes it, by the names of its columns: the very digits that stand there."""
    shown = [float(cell(value)) if isinstance(value, float) else value for value in values_of(row)]
    return dict(zip(COLUMNS, shown, strict=True))
