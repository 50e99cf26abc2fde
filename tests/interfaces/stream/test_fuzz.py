"""Mutated messages, with the decoder watched: typed errors only. The fuzzer finds faults that are planted."""

from __future__ import annotations

import inspect
import json
import os
from random import Random
from typing import Any

import pytest

from interfaces.messages import fields, segments
from interfaces.stream import Encoding, codec
from interfaces.stream.codec import KINDS
from tests.interfaces.stream.fuzzer import Fuzzer
from tests.interfaces.stream.make_vectors import PATH

RUNS = int(os.environ.get("VRS_FUZZ_RUNS", "4000"))
"""Frames in each encoding."""
MESSAGES = json.loads(PATH.read_text(encoding="utf-8"))["messages"]
EVERYTHING: Any = None
for kind in KINDS:
    EVERYTHING = kind if EVERYTHING is None else EVERYTHING | kind


def fuzzer(encoding: Encoding, seed: int = 2) -> Fuzzer:
    if encoding is Encoding.JSON:
        corpus = [message["json"].encode() for message in MESSAGES]
    else:
        corpus = [bytes.fromhex(message["msgpack"]) for message in MESSAGES]
    return Fuzzer(encoding, EVERYTHING, corpus, Random(seed))


@pytest.mark.parametrize("encoding", Encoding)
def test_no_frame_brings_anything_but_a_message_or_a_typed_error(encoding: Encoding) -> None:
    fuzz = fuzzer(encoding)
    finding = fuzz.run(RUNS)
    assert finding is None, finding
    assert RUNS / 20 < fuzz.accepted < RUNS
    assert fuzz.kept > 3


PLANTED: dict[str, tuple[Any, str, str, str]] = {
    "bytes that can be written to": (
        segments,
        "coefficients_from_bytes",
        "frombuffer(data",
        "frombuffer(bytearray(data)",
    ),
    "no joints": (segments, "coefficients_from_bytes", "not row or ", ""),
    "NaN comes in": (segments, "segments_of", "if found and not", "if False and not"),
    "lists that can be written to": (segments, "coefficients_from_lists", "writeable = False", "writeable = True"),
    "epochs of 65 bits": (fields, "epoch_of", "return Epoch(int(digits))", "return int.__new__(Epoch, digits)"),
    "a corner of a corner": (
        segments,
        "coefficients_from_bytes",
        "row = 8 * dof\n",
        "row = 8 * dof\n    if dof == 5:\n        if len(data) > 3 * row:\n            return data[len(data)]\n",
    ),
}
"""Where, which function, what stands there, what is put in its place."""


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_fault_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module, function, sound, faulty = PLANTED[name]
    source = inspect.getsource(getattr(module, function))
    assert source.count(sound) == 1
    space = dict(vars(inspect.getmodule(getattr(module, function))))
    exec(compile(source.replace(sound, faulty), "<planted>", "exec", dont_inherit=True, flags=1 << 24), space)
    for user in (segments, fields, codec):
        if hasattr(user, function):
            monkeypatch.setattr(user, function, space[function])
    plain = function == "coefficients_from_lists"
    finding = fuzzer(Encoding.JSON if plain else Encoding.MSGPACK).run(50_000)
    assert finding is not None
    assert "ProtocolError" not in finding.error
