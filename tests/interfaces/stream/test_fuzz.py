"""Mutated messages, with the decoder watched: typed errors only. The fuzzer finds faults that are planted."""

from __future__ import annotations

import inspect
import json
import os
from random import Random
from typing import Any

import pytest

from interfaces.messages import fields, segments
from interfaces.stream import Encoding, codec, encode
from interfaces.stream.codec import KINDS
from tests.interfaces.stream.drawn import value
from tests.interfaces.stream.fuzzer import Fuzzer
from tests.interfaces.stream.make_vectors import PATH

RUNS = int(os.environ.get("VRS_FUZZ_RUNS", "4000"))
"""Frames in each encoding."""
MESSAGES = json.loads(PATH.read_text(encoding="utf-8"))["messages"]
EVERYTHING: Any = None
for kind in KINDS:
    EVERYTHING = kind if EVERYTHING is None else EVERYTHING | kind


def vectors(encoding: Encoding) -> list[bytes]:
    if encoding is Encoding.JSON:
        return [message["json"].encode() for message in MESSAGES]
    return [bytes.fromhex(message["msgpack"]) for message in MESSAGES]


def drawn(encoding: Encoding) -> list[bytes]:
    """Two messages of each kind, by the definitions alone."""
    return [encode(value(kind, seed), encoding) for kind in KINDS for seed in range(2)]


def fuzzer(encoding: Encoding, seed: int = 2) -> Fuzzer:
    return Fuzzer(encoding, EVERYTHING, vectors(encoding) + drawn(encoding), Random(seed))


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
    encoding = Encoding.JSON if function == "coefficients_from_lists" else Encoding.MSGPACK
    # The definitions are enough: no vector is at hand for a message that has just been added.
    for corpus in (vectors(encoding), drawn(encoding)):
        # Which of some 50,000 frames it needs hangs on the seed, and on each line that decoders have.
        found = (Fuzzer(encoding, EVERYTHING, list(corpus), Random(seed)).run(50_000) for seed in (4, 2, 3, 5))
        finding = next(filter(None, found), None)
        assert finding is not None
        assert "ProtocolError" not in finding.error
