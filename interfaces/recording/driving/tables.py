"""A mobile robot's recording as tables; see `interfaces.recording.tables`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interfaces.recording.tables import (
    RecordingTable,
    TableColumn,
    commands_table,
    edits_table,
    events_table,
    link_table,
    receipts_table,
    seconds,
    table,
)
from interfaces.recording.track import ESTIMATED, MEASURED, REAL_POSTURE, VIRTUAL_POSTURE
from vrs.mobile import ArcTimeline
from vrs.model import Array

if TYPE_CHECKING:
    from interfaces.recording.recording import Recording

_POSTURE = (("x_m", "m"), ("y_m", "m"), ("theta_rad", "rad"))
_DRIVE = (("v_m_per_s", "m/s"), ("w_rad_per_s", "rad/s"))


def mobile_tables(recording: Recording) -> tuple[RecordingTable, ...]:
    """All tables of a recording: `docs/recording.md` describes their columns.

    Raises:
        FormatError: If a message in it makes no sense.
    """
    return (
        _virtual(recording),
        _real(recording),
        _postures(recording, "measured", MEASURED),
        _postures(recording, "estimated", ESTIMATED),
        commands_table(recording),
        receipts_table(recording),
        _segments(recording),
        edits_table(recording),
        link_table(recording),
        events_table(recording),
        _environment(recording),
    )


def _columns(names: tuple[tuple[str, str], ...], values: Array) -> list[TableColumn]:
    pairs = zip(names, values.T, strict=True)
    return [TableColumn(name, unit, float, column.tolist()) for (name, unit), column in pairs]


def _virtual(recording: Recording) -> RecordingTable:
    t = recording.track(VIRTUAL_POSTURE).t
    return table("virtual", seconds("t", t.tolist()), _columns(_POSTURE, recording.virtual(t)))


def _real(recording: Recording) -> RecordingTable:
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


def _segments(recording: Recording) -> RecordingTable:
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
