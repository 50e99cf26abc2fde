"""Timelines of arcs over the wire."""

from __future__ import annotations

import json

import pytest

from robots import ipr, puma560
from vrs import DriveCommand, Engine, codec
from vrs.errors import FormatError
from vrs.mobile import ArcTimeline

PAIRS = [(codec.to_json, codec.from_json), (codec.to_msgpack, codec.from_msgpack)]


def timeline():
    engine = Engine(ipr.model(), posture=(0.1, 1 / 3, 2.0))
    for k in range(20):
        engine.execute(DriveCommand(0.1 + k / 77, 0.3 - k / 31, 0.1 + k / 13, execute_at=k * 0.7))
    return engine.timeline


@pytest.mark.parametrize(("write", "read"), PAIRS)
def test_what_is_written_is_read_to_the_last_bit(write, read):
    for one in (timeline(), ArcTimeline((1, 2, 3), 4.0)):
        again = read(write(one), ArcTimeline)
        assert again == one
        assert again.version == one.version
        assert list(again.segments) == list(one.segments)
        assert write(again) == write(one)


def test_an_arms_timeline_is_none():
    joints = codec.to_json(Engine(puma560.model()).timeline)
    with pytest.raises(FormatError):
        codec.from_json(joints, ArcTimeline)
    with pytest.raises(FormatError):
        codec.from_json(codec.to_json(timeline()))


def broken(**change):
    return json.dumps({**json.loads(codec.to_json(timeline())), **change}).encode()


@pytest.mark.parametrize(
    "data",
    [b"", b"{}", b"\xff", broken(schema="else"), broken(schema_version=9), broken(initial=[1, 2]), broken(more=1),
     broken(initial=[9, 9, 9]), broken(start=1e400), broken(start=0.5)],
)  # fmt: skip
def test_anything_else_is_a_format_error(data):
    with pytest.raises(FormatError):
        codec.from_json(data, ArcTimeline)
