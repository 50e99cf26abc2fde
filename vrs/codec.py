"""Timelines as JSON and msgpack: exact floats, a schema name and a version in every document."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, TypeVar

import msgspec

from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array, frozen_array
from vrs.segment import ArcSegment, PolynomialSegment, Segment
from vrs.timeline import Timeline

SCHEMA = "vrs.timeline"
SCHEMA_VERSION = 1

_Row = Annotated[list[float], msgspec.Meta(min_length=1, max_length=64)]
_Made = TypeVar("_Made")


class PolynomialWire(msgspec.Struct, tag="polynomial", tag_field="type", forbid_unknown_fields=True, frozen=True):
    """A polynomial segment as it's written."""

    start: float
    duration: float
    coefficients: Annotated[list[_Row], msgspec.Meta(min_length=1, max_length=32)]
    command_id: int | None = None


class ArcWire(msgspec.Struct, tag="arc", tag_field="type", forbid_unknown_fields=True, frozen=True):
    """An arc as it's written."""

    start: float
    duration: float
    posture: tuple[float, float, float]
    v: float
    w: float
    command_id: int | None = None


SegmentWire = PolynomialWire | ArcWire


class TimelineWire(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A timeline as it's written."""

    schema: str
    schema_version: int
    version: int
    start: float
    initial: _Row
    segments: list[PolynomialWire]


def _rows(a: Array) -> list[list[float]]:
    rows: list[list[float]] = a.tolist()
    return rows


def arc_to_wire(arc: ArcSegment) -> ArcWire:
    """The wire form of an arc."""
    return ArcWire(arc.start, arc.duration, arc.posture, arc.v, arc.w, arc.command_id)


def arc_from_wire(wire: ArcWire) -> ArcSegment:
    """The arc that a wire form stands for.

    Raises:
        InvalidValueError: If it's none.
    """
    return ArcSegment(wire.start, wire.duration, wire.posture, wire.v, wire.w, wire.command_id)


def segment_to_wire(segment: Segment) -> SegmentWire:
    """The wire form of a segment."""
    if isinstance(segment, ArcSegment):
        return arc_to_wire(segment)
    return PolynomialWire(segment.start, segment.duration, _rows(segment.coefficients), segment.command_id)


def segment_from_wire(wire: SegmentWire) -> Segment:
    """The segment that a wire form stands for.

    Raises:
        FormatError: If it's none.
    """
    try:
        return arc_from_wire(wire) if isinstance(wire, ArcWire) else _polynomial(wire)
    except InvalidValueError as error:
        raise FormatError("segment", str(error)) from None


def _polynomial(wire: PolynomialWire) -> PolynomialSegment:
    if len({len(row) for row in wire.coefficients}) != 1:
        raise FormatError("segment", "its coefficients must be rows of one length")
    return PolynomialSegment(wire.start, wire.duration, frozen_array(wire.coefficients), wire.command_id)


def _to_wire(timeline: Timeline) -> TimelineWire:
    segments = [PolynomialWire(s.start, s.duration, _rows(s.coefficients), s.command_id) for s in timeline.segments]
    initial: list[float] = timeline.initial.tolist()
    return TimelineWire(SCHEMA, SCHEMA_VERSION, timeline.version, timeline.start, initial, segments)


def to_json(timeline: Timeline) -> bytes:
    """Write a timeline as JSON; floats are exact."""
    return msgspec.json.encode(_to_wire(timeline))


def to_msgpack(timeline: Timeline) -> bytes:
    """Write a timeline as msgpack; floats are exact."""
    return msgspec.msgpack.encode(_to_wire(timeline))


def from_json(data: bytes) -> Timeline:
    """Read a timeline that `to_json` wrote.

    Raises:
        FormatError: If the bytes are anything else.
    """
    return _read(data, msgspec.json.decode)


def from_msgpack(data: bytes) -> Timeline:
    """Read a timeline that `to_msgpack` wrote.

    Raises:
        FormatError: If the bytes are anything else.
    """
    return _read(data, msgspec.msgpack.decode)


def _read(data: bytes, decode: Callable[..., Any]) -> Timeline:
    return read(data, decode, TimelineWire, (SCHEMA, SCHEMA_VERSION), _timeline)


def _timeline(wire: TimelineWire) -> Timeline:
    return Timeline(wire.initial, wire.start, [_polynomial(one) for one in wire.segments], wire.version)


def read(
    data: bytes, decode: Callable[..., Any], form: type[Any], schema: tuple[str, int], make: Callable[[Any], _Made]
) -> _Made:
    """Read a timeline of any kind from a document.

    Args:
        data: The document.
        decode: Of JSON or msgpack.
        form: What the document must be.
        schema: Its name and version.
        make: Makes the timeline of it; what isn't sound raises an `InvalidValueError`.

    Raises:
        FormatError: If the bytes are anything else.
    """
    try:
        wire = decode(data, type=form)
        if (wire.schema, wire.schema_version) != schema:
            found = f"{wire.schema} {wire.schema_version}"
            raise FormatError("timeline", f"must be of schema {schema[0]} {schema[1]}, not {found}")
        return make(wire)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, InvalidValueError) as error:
        raise FormatError("timeline", str(error)) from None
