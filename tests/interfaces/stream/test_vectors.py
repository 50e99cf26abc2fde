"""The golden vectors are what the code makes, and what another msgpack library reads."""

from __future__ import annotations

import base64
import json
import struct
from typing import Any

import numpy as np
import pytest
import umsgpack

from interfaces.clients.ports import RemotePort
from interfaces.clients.viewer_sources import SegmentSource
from interfaces.stream import Encoding, decode, encode
from interfaces.stream.codec import KINDS, TYPES
from tests.interfaces.stream import make_vectors
from tests.interfaces.stream.same import same
from vrs import PolynomialSegment
from vrs.commands import Command

VECTORS: dict[str, Any] = json.loads(make_vectors.PATH.read_text(encoding="utf-8"))
VALUES = make_vectors.values()
EVERYTHING: Any = None
for kind in KINDS:
    EVERYTHING = kind if EVERYTHING is None else EVERYTHING | kind


def test_the_file_is_what_the_script_makes() -> None:
    assert make_vectors.messages() == VECTORS["messages"]
    assert make_vectors.evaluations() == VECTORS["evaluations"]
    assert {type(value) for value in VALUES.values()} == set(KINDS)
    ordered = {type(command) for command in make_vectors.ordered().values()}
    assert ordered == {*Command.__args__, type(None)}


@pytest.mark.parametrize("vector", VECTORS["messages"], ids=lambda vector: vector["name"])
def test_both_forms_are_the_message(vector: dict[str, str]) -> None:
    value = VALUES[vector["name"]]
    packed = bytes.fromhex(vector["msgpack"])
    for data, encoding in ((vector["json"].encode(), Encoding.JSON), (packed, Encoding.MSGPACK)):
        assert same(decode(data, encoding, allowed=EVERYTHING), value)
        assert encode(value, encoding) == data
    plain, other = json.loads(vector["json"]), umsgpack.unpackb(packed)
    assert TYPES[plain["type"]] is type(value)
    _unpack(other)
    assert other == plain


def _unpack(message: Any) -> None:
    """Coefficients in bytes as rows, and compact frames as base64, by hand, in place."""
    if message["type"] == "compact":
        message["q"] = base64.b64encode(message["q"]).decode()
    for part in (message, message.get("plan") or {}):
        if isinstance(part.get("segments"), list | tuple):
            n = part["dof"]
            part["segments"] = [
                [*row[:2], [list(values) for values in struct.iter_unpack(f"<{n}d", row[2])], *row[3:]]
                for row in part["segments"]
            ]


def test_segments_are_worth_what_the_file_says() -> None:
    for vector in VECTORS["evaluations"]:
        segment = PolynomialSegment(0.0, 1.0, vector["coefficients"])
        for at in vector["at"]:
            value = segment.value(at["u"], derivative=at["derivative"])
            assert same(value.tolist(), at["value"])


def test_a_reader_of_the_stream_has_the_engines_joints() -> None:
    port = RemotePort()
    mirror = SegmentSource(port, resend=1.0)
    mirror.advance(now=0.0)
    asked = []
    for step in VECTORS["stream"]["steps"]:
        asked += [json.loads(encode(request, Encoding.JSON)) for request in port.advance(now=step["now"])]
        for message in step["messages"]:
            mirror.receive(decode(message.encode(), Encoding.JSON, allowed=EVERYTHING), now=step["now"])
    assert asked == [json.loads(request) for step in VECTORS["stream"]["steps"] for request in step["asked"]]
    assert mirror.timeline is not None
    for sample in VECTORS["stream"]["samples"]:
        value = mirror.timeline.sample(sample["t"], derivative=sample["derivative"])
        np.testing.assert_allclose(value, sample["value"], rtol=0, atol=1e-9)


def test_compact_frames_are_those_of_the_file() -> None:
    assert json.loads(json.dumps(make_vectors.compact())) == VECTORS["compact"]


def test_the_clocks_are_those_of_the_file() -> None:
    for made, vector in zip(make_vectors.clock(), VECTORS["clock"], strict=True):
        for name, value in made.items():
            np.testing.assert_allclose(vector[name], value, rtol=0, atol=1e-12)
