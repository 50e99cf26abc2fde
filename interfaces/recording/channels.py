"""The channels of a recording: topic, kinds of message, JSON schema.

Schemas keep to what Foxglove's reader knows: objects with listed properties, lists of numbers, texts or objects.
What can't be said so (a pose's rows, a parameter's value) stands in the messages, and in no schema.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Final, TypeAlias

import msgspec

from interfaces.messages import recording as m
from interfaces.messages.fields import json_schema
from interfaces.recording.poses import FrameTransforms, RealPose, VirtualPose
from vrs.record import Record

_ENDLESS = 2**63 - 1
"""A range up to here is none."""
_SIMPLE = ("boolean", "string", "number", "integer")
_RANGES = ("minimum", "maximum", "exclusiveMinimum", "minItems", "maxItems", "minLength", "maxLength")


Kinds: TypeAlias = tuple[type[msgspec.Struct], ...]


@dataclass(frozen=True, slots=True)
class RecordingChannel:
    """A channel; its number in a file is its place in `CHANNELS`, from 1."""

    topic: str
    schema: str
    """Name of the schema: Foxglove's know what to draw."""
    arm: Kinds
    """Messages in an arm's recordings; none where those don't have the channel."""
    mobile: Kinds
    """Messages in a mobile robot's recordings."""
    file: str | None = None
    """Foxglove's own schema; None where it's made from the kinds."""
    many: bool = True
    """Whether it has many messages; those of the others stand together, in blocks of their own."""
    rare: bool = False
    """Whether a file has it only from its first message on."""

    @property
    def kinds(self) -> Kinds:
        """All messages that it may have."""
        return tuple(dict.fromkeys((*self.arm, *self.mobile)))

    def json_schema(self, kinds: Kinds) -> bytes:
        """The schema as it stands in a file that has these kinds."""
        if self.file is not None:
            path = resources.files("interfaces.recording").joinpath("foxglove", self.file)
            return msgspec.json.format(path.read_bytes(), indent=-1)
        return _schema(self.schema, kinds)


_SESSION = m.Begin, m.Dropped, m.End
_COMMANDS = m.CommandRecord, m.Anchor, m.ReceiptEntry, m.CommandPacket, m.GivenEntry
CHANNELS: Final = (
    RecordingChannel("/session", "vrs.Session", _SESSION, (*_SESSION, m.RoomEntry), many=False),
    RecordingChannel("/commands", "vrs.Command", _COMMANDS, (*_COMMANDS, m.Placement), many=False),
    RecordingChannel(
        "/timeline",
        "vrs.Timeline",
        (m.HistoryEntry, m.ChangeEntry),
        (m.ArcHistory, m.ArcChange),
        many=False,
    ),
    RecordingChannel("/virtual/joints", "vrs.VirtualJoints", (m.VirtualSample,), ()),
    RecordingChannel("/real/joints", "vrs.RealJoints", (m.RealSample,), ()),
    RecordingChannel("/virtual/pose", "foxglove.PoseInFrame", (VirtualPose,), (VirtualPose,), "PoseInFrame.json"),
    RecordingChannel("/real/pose", "foxglove.PoseInFrame", (RealPose,), (RealPose,), "PoseInFrame.json"),
    RecordingChannel(
        "/tf", "foxglove.FrameTransforms", (FrameTransforms,), (FrameTransforms,), "FrameTransforms.json"
    ),
    RecordingChannel("/link", "vrs.Packet", (m.LinkEntry,), (m.LinkEntry,)),
    RecordingChannel("/events", "vrs.Event", (m.RunEvent,), (m.RunEvent,), many=False),
    RecordingChannel("/virtual/posture", "vrs.VirtualPosture", (), (m.VirtualPosture,)),
    RecordingChannel("/real/posture", "vrs.RealPosture", (), (m.RealPosture,)),
    RecordingChannel("/real/measured", "vrs.MeasuredPosture", (), (m.MeasuredPosture,)),
    RecordingChannel("/virtual/estimated", "vrs.EstimatedPosture", (), (m.EstimatedPosture,)),
    RecordingChannel("/environment", "vrs.Cells", (), (m.CellsEntry,), many=False),
    RecordingChannel("/hand", "vrs.Hand", (m.SceneEntry, m.HandEntry), (), rare=True),
)
"""Every channel of a recording."""

NUMBER_OF: Final = {kind: number for number, channel in enumerate(CHANNELS, 1) for kind in channel.kinds}
"""Number of the channel of a kind of message."""

Message: TypeAlias = Record
"""What can be recorded: one of the channels' kinds."""


@cache
def _schema(name: str, kinds: Kinds) -> bytes:
    found, parts = msgspec.json.schema_components(kinds, ref_template="{name}", schema_hook=json_schema)
    merged = _merged([_plain(schema, parts) for schema in found])
    return msgspec.json.encode({"title": name, **_sayable(merged or {})})


def _sayable(schema: dict[str, Any]) -> dict[str, Any]:
    """A schema without what can't be said."""
    if schema.get("type") == "array":
        return {**schema, "items": _sayable(schema["items"])}
    if schema.get("type") != "object":
        return schema
    properties = {name: _sayable(one) for name, one in schema["properties"].items() if one is not None}
    return {**schema, "properties": properties}


def _plain(schema: dict[str, Any], parts: dict[str, Any]) -> dict[str, Any] | None:
    """A schema in Foxglove's terms; None where it can't be said in them."""
    if "$ref" in schema:
        return _plain(parts[schema["$ref"]], parts)
    if "anyOf" in schema:
        return _merged([_plain(one, parts) for one in schema["anyOf"] if one.get("type") != "null"])
    if "enum" in schema:
        return {"type": "string"} if all(isinstance(one, str) for one in schema["enum"]) else None
    kept = {key: schema[key] for key in ("type", *_RANGES) if key in schema}
    if schema.get("type") == "number":
        # Of 0 and 0.0 in two equal types, typing knows the one that was written first.
        kept |= {key: float(kept[key]) for key in _RANGES if key in kept}
    if abs(kept.get("maximum", 0)) >= _ENDLESS:
        kept = {"type": schema["type"]}
    kind = schema.get("type")
    if kind == "object":
        if "properties" not in schema:
            return None
        kept["properties"] = {name: _plain(one, parts) for name, one in schema["properties"].items()}
        kept["required"] = schema.get("required", [])
    elif kind == "array":
        item = _plain(schema["items"], parts) if isinstance(schema.get("items"), dict) else None
        if item is None or item["type"] == "array":
            return None
        kept["items"] = item
    elif kind not in _SIMPLE:
        return None
    return kept


def _merged(schemas: list[dict[str, Any] | None]) -> dict[str, Any] | None:
    """One schema for what may be either; None where they have nothing in common."""
    known = [schema for schema in schemas if schema is not None]
    if len(known) != len(schemas) or not known or len({schema["type"] for schema in known}) != 1:
        return None
    if all(schema == known[0] for schema in known):
        return known[0]
    if known[0]["type"] != "object":
        return {"type": known[0]["type"]} if known[0]["type"] in _SIMPLE else None
    properties: dict[str, dict[str, Any] | None] = {}
    for schema in known:
        for name, one in schema["properties"].items():
            properties[name] = _merged([properties[name], one]) if name in properties else one
    first, *others = (schema["required"] for schema in known)
    return {
        "type": "object",
        "properties": properties,
        "required": [name for name in first if all(name in other for other in others)],
    }
