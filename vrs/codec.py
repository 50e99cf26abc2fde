"""Timelines as JSON and msgpack: exact floats, a schema name and a version in every document."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, TypeAlias, TypeVar, overload

import msgspec

from vrs.errors import FormatError, InvalidValueError
from vrs.mobile.timeline import ArcTimeline
from vrs.model import Array, frozen_array
from vrs.segment import ArcSegment, PolynomialSegment, Segment
from vrs.timeline import Timeline

SCHEMA = "vrs.timeline"
ARC_SCHEMA = "vrs.arc_timeline"
SCHEMA_VERSION = 1

_Row = Annotated[list[float], msgspec.Meta(min_length=1, max_length=64)]
AnyTimeline: TypeAlias = Timeline | ArcTimeline
_KindT = TypeVar("_KindT", Timeline, ArcTimeline)


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


class ArcTimelineWire(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A timeline of arcs as it's written."""

    schema: str
    schema_version: int
    version: int
    start: float
    initial: tuple[float, float, float]
    segments: list[ArcWire]


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


def _to_wire(timeline: AnyTimeline) -> TimelineWire | ArcTimelineWire:
    if isinstance(timeline, ArcTimeline):
        x, y, theta = timeline.initial.tolist()
        arcs = [arc_to_wire(arc) for arc in timeline.segments]
        return ArcTimelineWire(ARC_SCHEMA, SCHEMA_VERSION, timeline.version, timeline.start, (x, y, theta), arcs)
    segments = [PolynomialWire(s.start, s.duration, _rows(s.coefficients), s.command_id) for s in timeline.segments]
    initial: list[float] = timeline.initial.tolist()
    return TimelineWire(SCHEMA, SCHEMA_VERSION, timeline.version, timeline.start, initial, segments)


def to_json(timeline: AnyTimeline) -> bytes:
    """Write a timeline as JSON; floats are exact."""
    return msgspec.json.encode(_to_wire(timeline))


def to_msgpack(timeline: AnyTimeline) -> bytes:
    """Write a timeline as msgpack; floats are exact."""
    return msgspec.msgpack.encode(_to_wire(timeline))


@overload
def from_json(data: bytes) -> Timeline: ...
@overload
def from_json(data: bytes, kind: type[_KindT]) -> _KindT: ...
def from_json(data: bytes, kind: Any = Timeline) -> Any:
    """Read a timeline that `to_json` wrote.

    Args:
        data: The document.
        kind: `Timeline`, or `ArcTimeline`.

    Raises:
        FormatError: If the bytes are anything else.
    """
    return _read(data, msgspec.json.decode, kind)


@overload
def from_msgpack(data: bytes) -> Timeline: ...
@overload
def from_msgpack(data: bytes, kind: type[_KindT]) -> _KindT: ...
def from_msgpack(data: bytes, kind: Any = Timeline) -> Any:
    """Read a timeline that `to_msgpack` wrote.

    Args:
        data: The document.
        kind: `Timeline`, or `ArcTimeline`.

    Raises:
        FormatError: If the bytes are anything else.
    """
    return _read(data, msgspec.msgpack.decode, kind)


def _read(data: bytes, decode: Callable[..., Any], kind: Any) -> Any:
    of_arcs = issubclass(kind, ArcTimeline)
    form, schema = (ArcTimelineWire, ARC_SCHEMA) if of_arcs else (TimelineWire, SCHEMA)
    try:
        wire = decode(data, type=form)
        if (wire.schema, wire.schema_version) != (schema, SCHEMA_VERSION):
            found = f"{wire.schema} {wire.schema_version}"
            raise FormatError("timeline", f"must be of schema {schema} {SCHEMA_VERSION}, not {found}")
        make: Callable[[Any], Segment] = arc_from_wire if of_arcs else _polynomial
        return kind(wire.initial, wire.start, [make(one) for one in wire.segments], wire.version)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, InvalidValueError) as error:
        raise FormatError("timeline", str(error)) from None
