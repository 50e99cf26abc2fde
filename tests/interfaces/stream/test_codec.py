"""The codec: every message comes back to the bit, in both encodings; anything else is refused, quickly."""

from __future__ import annotations

import contextlib
import json
import math
import time
import tracemalloc
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from interfaces import messages as m
from interfaces.messages import control as c
from interfaces.messages.control import MobileWelcome, Plan, Postures, ProblemCode, ProtocolError, Seen
from interfaces.messages.fields import LONGEST_TEXT, MOST_NAMES, Epoch
from interfaces.messages.jobs import Errand, JobForecast, RobotTask, TaskOrder, Tasks
from interfaces.messages.requests import portable
from interfaces.messages.sites import DriveOrders, DriveReport, Orders, Report
from interfaces.stream import LARGEST, Encoding, SharedEncoder, decode, encode
from interfaces.stream.codec import KINDS, TYPES
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal
from tests.interfaces.stream.drawn import frozen, messages
from tests.interfaces.stream.same import same
from vrs import JointTarget, MotionCommand, PolynomialSegment
from vrs.errors import InvalidValueError
from vrs.ledger import Receipt, Status

PHASES = (Phase.explicit, Phase.reuse, Phase.generate)
QUICK = settings(max_examples=25, deadline=None, phases=PHASES, database=None, derandomize=True)
Q = frozen(np.linspace(-1, 1, 6) / 3)
PACKED, PLAIN = Encoding
BROADCAST = m.Broadcast.showing(m.Frame(7, 2.5, 2.0, Q, m.FrameStatus.PREDICTED), m.Verdicts(1, 5, ((2, 3, 4),)))


MOBILE = {MobileWelcome, Postures, TaskOrder, Tasks, Seen, Plan, DriveOrders, DriveReport}
"""Of mobile robots."""


def write(encoding: Encoding, message: Any) -> bytes:
    """Plain data as a frame."""
    return msgspec.msgpack.encode(message) if encoding is PACKED else json.dumps(message).encode()


def code(data: bytes, encoding: Encoding, allowed: Any) -> ProblemCode:
    with pytest.raises(ProtocolError) as caught:
        decode(data, encoding, allowed=allowed)
    assert caught.value.text
    return caught.value.code


def test_every_message_has_a_wire_form_and_is_drawn() -> None:
    unions = (m.Request, m.Reply, c.Question, c.Notice)
    kinds = {kind for union in unions for kind in union.__args__} | MOBILE | {Orders, Report}
    assert set(KINDS) == set(messages) == kinds
    assert set(TYPES.values()) == kinds


@pytest.mark.parametrize("encoding", Encoding)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@QUICK
@given(data=st.data())
def test_messages_come_back_to_the_bit(kind: type, encoding: Encoding, data: st.DataObject) -> None:
    message = data.draw(messages[kind])
    frame = encode(message, encoding)
    back = decode(frame, encoding, allowed=kind)
    assert same(back, message)
    assert encode(back, encoding) == frame
    plain = msgspec.msgpack.decode(frame) if encoding is PACKED else json.loads(frame)
    assert TYPES[plain["type"]] is kind


@pytest.mark.parametrize("encoding", Encoding)
def test_numpys_numbers_cross(encoding: Encoding) -> None:
    message = m.Ask(3, np.float64(1.5))
    assert decode(encode(message, encoding), encoding, allowed=m.Ask).t == 1.5


def test_a_receipt_names_no_more_than_may_cross() -> None:
    names = tuple(range(1, 3001))
    receipt = Receipt(1, Status.ACCEPTED, 0.0, None, shifted_names=names, superseded_names=lambda: names)
    data = encode(m.Outcome(1, 0.0, portable(receipt, MOST_NAMES)), Encoding.JSON)
    back = decode(data, Encoding.JSON, allowed=m.Outcome).receipt
    assert back.shifted == back.superseded == names[:MOST_NAMES]


@pytest.mark.parametrize("encoding", Encoding)
def test_what_newer_peers_add_is_passed_over(encoding: Encoding) -> None:
    frame = write(encoding, {"new": [[{"a": 1}]], "type": "ask", "number": 3, "t": 1, "newer": None})
    assert decode(frame, encoding, allowed=m.Ask) == m.Ask(3, 1.0)


@pytest.mark.parametrize("encoding", Encoding)
def test_texts_too_long_within_lists_are_cut_and_what_utf_8_cant_say_is_a_question_mark(encoding: Encoding) -> None:
    halt = RobotTask(halt="x" * (LONGEST_TEXT + 1))
    orders = DriveOrders(
        Epoch(1), 1, 0.0, 0.0, 0.0, errands=(Errand(1, RobotTask(go=Goal(1.0, 2.0))), Errand(2, halt))
    )
    back = decode(encode(orders, encoding), encoding, allowed=DriveOrders)
    assert back.errands == (orders.errands[0], Errand(2, RobotTask(halt="x" * LONGEST_TEXT)))
    tasks = Tasks(forecast=(JobForecast(1, 0.0, 1.0), JobForecast(2, 1.0, problem="no \udc80")))
    back = decode(encode(tasks, encoding), encoding, allowed=Tasks)
    assert [job.problem for job in back.forecast] == ["", "no ?"]


@pytest.mark.parametrize("kind", [Tasks, DriveReport])
@pytest.mark.parametrize("encoding", Encoding)
def test_no_way_left_isnt_written(kind: type, encoding: Encoding) -> None:
    given = {} if kind is Tasks else {
        "epoch": None, "number": 1, "sent_at": 0.0, "measured_at": 0.0, "posture": Posture(0.0, 0.0, 0.0),
        "drive": Drive(0.0, 0.0),
    }  # fmt: skip
    for left in (float("0"), float("-0")):
        assert b"left" not in encode(kind(**given, left=left), encoding)
    assert decode(encode(kind(**given, left=1.5), encoding), encoding, allowed=kind).left == 1.5


@pytest.mark.parametrize("encoding", Encoding)
def test_arrays_that_come_are_read_only(encoding: Encoding) -> None:
    change = m.Change(1, 0, 1.0, 1, 0, None, 1.0, segments=(PolynomialSegment(0.0, 1.0, np.ones((2, 6)), 1),))
    for message in (BROADCAST, change):
        back = decode(encode(message, encoding), encoding, allowed=type(message))
        array = back.frame.q if isinstance(back, m.Broadcast) else back.segments[0].coefficients
        assert not array.flags.writeable
        assert array.dtype == np.float64


HUGE = [[1e300] * 4] * 4
BAD: dict[str, tuple[Any, ProblemCode]] = {
    "no map": ([1, 2], ProblemCode.MALFORMED),
    "no type": ({"number": 1}, ProblemCode.MALFORMED),
    "type of a wrong kind": ({"type": 5, "number": 1}, ProblemCode.MALFORMED),
    "unknown type": ({"type": "warp", "number": 1}, ProblemCode.UNKNOWN_TYPE),
    "not here": ({"type": "pulse", "edit": 1, "now": 0.0}, ProblemCode.NOT_ALLOWED),
    "number 0": ({"type": "ask", "number": 0}, ProblemCode.OUT_OF_RANGE),
    "number missing": ({"type": "ask"}, ProblemCode.OUT_OF_RANGE),
    "number too large": ({"type": "ask", "number": 2**63}, ProblemCode.OUT_OF_RANGE),
    "number true": ({"type": "ask", "number": True}, ProblemCode.OUT_OF_RANGE),
    "number a text": ({"type": "ask", "number": "1"}, ProblemCode.OUT_OF_RANGE),
    "time too large": ({"type": "ask", "number": 1, "t": 1.1e9}, ProblemCode.OUT_OF_RANGE),
    "epoch a number": ({"type": "beat", "epoch": 5}, ProblemCode.OUT_OF_RANGE),
    "epoch of 65 bits": ({"type": "beat", "epoch": str(2**64)}, ProblemCode.OUT_OF_RANGE),
    "epoch with a newline": ({"type": "beat", "epoch": "5\n"}, ProblemCode.OUT_OF_RANGE),
    "epoch in other digits": ({"type": "beat", "epoch": "٣"}, ProblemCode.OUT_OF_RANGE),
    "unknown command": ({"type": "order", "number": 1, "command": {"type": "fly"}}, ProblemCode.OUT_OF_RANGE),
    "command without a type": ({"type": "order", "number": 1, "command": {}}, ProblemCode.OUT_OF_RANGE),
    "two kinds of steering": (
        {"type": "order", "number": 1, "command": {"type": "steer", "rates": [1.0], "twist": [0.0] * 6}},
        ProblemCode.OUT_OF_RANGE,
    ),
    "no rotation": (
        {
            "type": "order",
            "number": 1,
            "command": {"type": "move", "target": {"type": "pose", "X": [[1.0] * 4] * 4}},
        },
        ProblemCode.OUT_OF_RANGE,
    ),
    "a rotation that overflows": (
        {"type": "order", "number": 1, "command": {"type": "move", "target": {"type": "pose", "X": HUGE}}},
        ProblemCode.OUT_OF_RANGE,
    ),
    "65 joints": (
        {"type": "order", "number": 1, "command": {"type": "steer", "rates": [0.0] * 65}},
        ProblemCode.OUT_OF_RANGE,
    ),
}


@pytest.mark.parametrize("encoding", Encoding)
@pytest.mark.parametrize("name", BAD)
def test_what_is_no_message_is_refused_with_a_code(name: str, encoding: Encoding) -> None:
    message, expected = BAD[name]
    assert code(write(encoding, message), encoding, m.Order | m.Ask | c.Beat) is expected


SEGMENTS: dict[str, tuple[Any, Any]] = {
    "too short": (b"\0" * 40, [[0.0] * 5]),
    "rows of two lengths": (b"\0" * 104, [[0.0] * 6, [0.0] * 7]),
    "33 powers": (b"\0" * 8 * 6 * 33, [[0.0] * 6] * 33),
    "none": (b"", []),
    "NaN": (np.full(6, math.nan).tobytes(), [[None] * 6]),
    "infinite": (np.full(6, math.inf).tobytes(), [["Infinity"] * 6]),
    "texts": ("0" * 48, [["0"] * 6]),
}


@pytest.mark.parametrize("encoding", Encoding)
@pytest.mark.parametrize("name", SEGMENTS)
def test_coefficients_that_dont_fit_are_refused(name: str, encoding: Encoding) -> None:
    coefficients = SEGMENTS[name][encoding is PLAIN]
    history = {"type": "history", "edit": 1, "index": 0, "dof": 6, "start": 0.0}
    frame = write(encoding, {**history, "segments": [[1.0, None, coefficients]]})
    assert code(frame, encoding, m.History) is ProblemCode.OUT_OF_RANGE


@pytest.mark.parametrize("duration", [0.0, -1.0, 1e10])
def test_durations_are_positive(duration: float) -> None:
    history = {"type": "history", "edit": 1, "index": 0, "dof": 1, "start": 0.0}
    frame = write(PLAIN, {**history, "segments": [[duration, None, [[0.0]]]]})
    assert code(frame, PLAIN, m.History) is ProblemCode.OUT_OF_RANGE


BOMBS: dict[str, tuple[Encoding, bytes]] = {
    "four billion entries": (PACKED, b"\x82\xa4type\xa7history\xa8segments\xdd\xff\xff\xff\xff"),
    "four billion keys": (PACKED, b"\xdf\xff\xff\xff\xff\xa4type\xa3ask"),
    "four billion bytes": (PACKED, b"\x82\xa4type\xa7history\xa1x\xc6\xff\xff\xff\xff"),
    "nested deeply": (PACKED, b"\x82\xa4type\xa3ask\xa1x" + b"\x91" * 60_000),
    "nested maps": (PACKED, b"\x82\xa4type\xa3ask\xa1x" + b"\x81\xa1x" * 20_000),
    "deep JSON": (PLAIN, b'{"type":"ask","x":' + b"[" * 60_000),
    "deep maps": (PLAIN, b'{"type":"ask","x":' + b'{"a":' * 12_000),
    "deep where a list is": (PLAIN, b'{"type":"history","edit":1,"index":0,"segments":' + b"[" * 60_000),
    "long digits": (PLAIN, b'{"type":"ask","number":' + b"9" * 60_000 + b"}"),
    "long text": (PLAIN, b'{"type":"hello","name":"' + b"a" * 60_000 + b'"}'),
    "long escapes": (PLAIN, b'{"type":"hello","name":"' + b"\\u0041" * 10_000 + b'"}'),
    "long fraction": (PLAIN, b'{"type":"ask","number":0.' + b"7" * 60_000 + b"}"),
    "no UTF-8": (PLAIN, b'{"type":"\xff"}'),
    "no UTF-8 in a text": (PACKED, b"\x82\xa4type\xa5hello\xa4name\xa1\xff"),
    "nothing": (PLAIN, b""),
}


@pytest.mark.parametrize("name", BOMBS)
def test_t09_bombs_are_refused_in_little_time_and_memory(name: str) -> None:
    encoding, frame = BOMBS[name]
    everything = m.Request | m.Reply | c.Question | c.Notice
    tracemalloc.start()
    with pytest.raises(ProtocolError):
        decode(frame, encoding, allowed=everything)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000


def test_too_long_a_frame_isnt_looked_at() -> None:
    assert code(b"\0" * (LARGEST + 1), PACKED, m.Ask) is ProblemCode.TOO_LARGE


def heaviest() -> dict[str, tuple[type, bytes]]:
    """Messages of 64 KiB that make the most work."""
    segment = PolynomialSegment(0.0, 0.25, np.ones((1, 1)), 1)
    history = m.History(
        1, 0, segments=tuple(PolynomialSegment(k * 0.25, 0.25, np.ones((1, 1)), 1) for k in range(256))
    )
    wide = m.History(
        1, 0, segments=tuple(PolynomialSegment(k * 0.25, 0.25, np.ones((4, 6)), 1) for k in range(256))
    )
    many = {"type": "history", "edit": 1, "index": 0, "dof": 1, "segments": [[1.0, None, [[0.0]]]] * 2900}
    unknown = {"type": "ask", "number": 1, "more": [[1, 2, 3]] * 5900}
    assert segment in history.segments
    return {
        "history": (m.History, encode(history, PACKED)),
        "history in JSON": (m.History, encode(history, PLAIN)),
        "wide history": (m.History, encode(wide, PACKED)),
        "too many segments": (m.History, write(PLAIN, many)),
        "unknown fields": (m.Ask, write(PLAIN, unknown)),
    }


@pytest.mark.parametrize("name", heaviest())
def test_a_frame_takes_little_time(name: str) -> None:
    kind, frame = heaviest()[name]
    assert 4_000 < len(frame) <= LARGEST
    encoding = PLAIN if frame[:1] == b"{" else PACKED
    best = yardstick = math.inf
    for _ in range(60):
        begin = time.thread_time()
        with contextlib.suppress(ProtocolError):
            decode(frame, encoding, allowed=kind)
        between = time.thread_time()
        sum(range(30_000))
        best, yardstick = min(best, between - begin), min(yardstick, time.thread_time() - between)
    # The yardstick takes 0.5 ms where nothing else runs; asked for is 1 ms.
    assert best < 8 * yardstick


def test_a_shared_frame_is_encoded_once_and_few_are_kept() -> None:
    shared = SharedEncoder(size=4)
    first = shared.encode(BROADCAST, PACKED)
    assert shared.encode(BROADCAST, PACKED) is first
    assert shared.encode(BROADCAST, PLAIN) == encode(BROADCAST, PLAIN)
    for k in range(10):
        message = m.Ask(k + 1, None)
        assert decode(shared.encode(message, PACKED), PACKED, allowed=m.Ask) == message
    again = shared.encode(BROADCAST, PACKED)
    assert again == first
    assert again is not first


def test_what_isnt_a_message_cant_be_encoded() -> None:
    with pytest.raises(InvalidValueError):
        encode("hello", PACKED)  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError):
        encode(m.Order(1, "stop"), PACKED)  # type: ignore[arg-type]


@pytest.mark.parametrize("epoch", [-1, 2**64, True, "1"])
def test_an_orders_epoch_has_64_bits(epoch: Any) -> None:
    with pytest.raises(InvalidValueError):
        m.Order(1, MotionCommand(JointTarget(Q)), epoch)
