"""Timelines as JSON and msgpack: exact floats, a schema name and a version in every document."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Final, Generic, TypeAlias, TypeVar

import msgspec

from vrs.errors import FormatError, InvalidValueError
from vrs.mobile.timeline import ArcTimeline
from vrs.model import frozen_array
from vrs.segment import ArcSegment, PolynomialSegment, Segment
from vrs.timeline import Timeline

SCHEMA = "vrs.timeline"
ARC_SCHEMA = "vrs.arc_timeline"
SCHEMA_VERSION = 1

_Row = Annotated[list[float], msgspec.Meta(min_length=1, max_length=64)]
AnyTimeline: TypeAlias = Timeline | ArcTimeline
_KindT = TypeVar("_KindT", Timeline, ArcTimeline)
_SegmentT = TypeVar("_SegmentT")


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


class TimelineWire(msgspec.Struct, Generic[_SegmentT], forbid_unknown_fields=True, frozen=True):
    """A timeline as it's written."""

    schema: str
    schema_version: int
    version: int
    start: float
    initial: _Row
    segments: list[_SegmentT]


_FORMS: Final[dict[Any, tuple[str, Any]]] = {
    Timeline: (SCHEMA, TimelineWire[PolynomialWire]),
    ArcTimeline: (ARC_SCHEMA, TimelineWire[ArcWire]),
}
"""Schema and form of each kind of timeline."""


def segment_to_wire(segment: Segment) -> SegmentWire:
    """The wire form of a segment."""
    if isinstance(segment, ArcSegment):
        return ArcWire(segment.start, segment.duration, segment.posture, segment.v, segment.w, segment.command_id)
    rows = segment.coefficients.tolist()
    return PolynomialWire(segment.start, segment.duration, rows, segment.command_id)


def segment_from_wire(wire: SegmentWire) -> Segment:
    """The segment that a wire form stands for.

    Raises:
        FormatError: If it's none.
    """
    try:
        if isinstance(wire, ArcWire):
            return ArcSegment(wire.start, wire.duration, wire.posture, wire.v, wire.w, wire.command_id)
        if len({len(row) for row in wire.coefficients}) != 1:
            raise FormatError("segment", "its coefficients must be rows of one length")
        return PolynomialSegment(wire.start, wire.duration, frozen_array(wire.coefficients), wire.command_id)
    except InvalidValueError as error:
        raise FormatError("segment", str(error)) from None


def _to_wire(timeline: AnyTimeline) -> TimelineWire[SegmentWire]:
    schema, _ = _FORMS[type(timeline)]
    segments = [segment_to_wire(segment) for segment in timeline.segments]
    initial: list[float] = timeline.initial.tolist()
    return TimelineWire(schema, SCHEMA_VERSION, timeline.version, timeline.start, initial, segments)


def to_json(timeline: AnyTimeline) -> bytes:
    """Write a timeline as JSON; floats are exact."""
    return msgspec.json.encode(_to_wire(timeline))


def to_msgpack(timeline: AnyTimeline) -> bytes:
    """Write a timeline as msgpack; floats are exact."""
    return msgspec.msgpack.encode(_to_wire(timeline))


def from_json(data: bytes, kind: type[_KindT] = Timeline) -> _KindT:  # type: ignore[assignment]
    """Read a timeline that `to_json` wrote.

    Args:
        data: The document.
        kind: `Timeline`, or `ArcTimeline`.

    Raises:
        FormatError: If the bytes are anything else.
    """
    return _read(data, msgspec.json.decode, kind)


def from_msgpack(data: bytes, kind: type[_KindT] = Timeline) -> _KindT:  # type: ignore[assignment]
    """Read a timeline that `to_msgpack` wrote; see `from_json`."""
    return _read(data, msgspec.msgpack.decode, kind)


def _read(data: bytes, decode: Callable[..., Any], kind: type[_KindT]) -> _KindT:
    make: Callable[..., _KindT] = kind
    schema, form = _FORMS[kind]
    try:
        wire = decode(data, type=form)
        if (wire.schema, wire.schema_version) != (schema, SCHEMA_VERSION):
            found = f"{wire.schema} {wire.schema_version}"
            raise FormatError("timeline", f"must be of schema {schema} {SCHEMA_VERSION}, not {found}")
        return make(wire.initial, wire.start, [segment_from_wire(one) for one in wire.segments], wire.version)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, InvalidValueError) as error:
        raise FormatError("timeline", str(error)) from None
