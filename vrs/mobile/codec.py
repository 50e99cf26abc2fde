"""Timelines of arcs as JSON and msgpack: exact floats, a schema name and a version in every document."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from vrs.codec import ArcWire, arc_from_wire, arc_to_wire, read
from vrs.mobile.timeline import ArcTimeline

SCHEMA = "vrs.arc_timeline"
SCHEMA_VERSION = 1


class ArcTimelineWire(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A timeline of arcs as it's written."""

    schema: str
    schema_version: int
    version: int
    start: float
    initial: tuple[float, float, float]
    segments: list[ArcWire]


def _to_wire(timeline: ArcTimeline) -> ArcTimelineWire:
    segments = [arc_to_wire(arc) for arc in timeline.segments]
    x, y, theta = timeline.initial.tolist()
    return ArcTimelineWire(SCHEMA, SCHEMA_VERSION, timeline.version, timeline.start, (x, y, theta), segments)


def to_json(timeline: ArcTimeline) -> bytes:
    """Write a timeline as JSON; floats are exact."""
    return msgspec.json.encode(_to_wire(timeline))


def to_msgpack(timeline: ArcTimeline) -> bytes:
    """Write a timeline as msgpack; floats are exact."""
    return msgspec.msgpack.encode(_to_wire(timeline))


def from_json(data: bytes) -> ArcTimeline:
    """Read a timeline that `to_json` wrote.

    Raises:
        FormatError: If the bytes are anything else.
    """
    return _read(data, msgspec.json.decode)


def from_msgpack(data: bytes) -> ArcTimeline:
    """Read a timeline that `to_msgpack` wrote.

    Raises:
        FormatError: If the bytes are anything else.
    """
    return _read(data, msgspec.msgpack.decode)


def _read(data: bytes, decode: Callable[..., Any]) -> ArcTimeline:
    return read(data, decode, ArcTimelineWire, (SCHEMA, SCHEMA_VERSION), _timeline)


def _timeline(wire: ArcTimelineWire) -> ArcTimeline:
    return ArcTimeline(wire.initial, wire.start, [arc_from_wire(arc) for arc in wire.segments], wire.version)
