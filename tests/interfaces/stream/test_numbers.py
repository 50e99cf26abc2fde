"""No number that a robot can't bear comes through the door: refused with a code, and nothing has changed."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from interfaces.messages.control import ProblemCode, ProtocolError, Role
from interfaces.stream import Encoding, decode
from interfaces.stream.codec import TYPES
from interfaces.stream.limits import ClientLimits
from tests.interfaces.stream.served import make_hub
from tests.interfaces.stream.test_session import Peer
from vrs import DriveCommand, JointTarget, PoseTarget, SteerCommand
from vrs.errors import InvalidValueError

NUMBERS = [float("nan"), float("inf"), -float("inf"), 1e300, -1e300, 1e18, -1e18, 5e-324, -5e-324, 2e-308]
SHAPES = [[1.0], [], {}, "1", True, [[1.0]]]
CODES = {ProblemCode.OUT_OF_RANGE, ProblemCode.MALFORMED}
SENT = {
    "hello", "ping", "pong", "acquire", "share", "release", "resume", "beat", "order", "ask", "follow", "want",
    "survey", "impair", "task",
}  # fmt: skip
"""What an operator may send."""
POSE = np.eye(4).tolist()
MORE = [
    {"type": "order", "number": 1, "command": {"type": "parameter", "name": "qd_max", "value": 2.0}},
    {"type": "order", "number": 1, "command": {"type": "parameter", "name": "qd_max", "value": [2.0] * 6}},
    {
        "type": "order", "number": 1,
        "command": {
            "type": "move", "target": {"type": "pose", "X": POSE}, "tool": POSE, "deviation": 0.1, "pace": 0.5,
            "acceleration": 0.5, "speed": 0.5, "issued_at": 0.0, "execute_at": 0.0,
        },
    },
    {"type": "task", "number": 1, "task": {"jobs": {"jobs": [{"do": "wait", "number": 1, "seconds": 1.0}]}}},
]  # fmt: skip


def vectors() -> list[dict[str, Any]]:
    known = json.loads((Path(__file__).parent / "vectors.json").read_text())["messages"]
    return [*(message if isinstance(message := v["json"], dict) else json.loads(message) for v in known), *MORE]


def sites() -> list[dict[str, Any]]:
    return [message for message in vectors() if message["type"] in ("orders", "drive-orders", "pong")]


def clients() -> list[dict[str, Any]]:
    return [message for message in vectors() if message["type"] in SENT]


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The ways to all numbers of a message."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, (*path, key))
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from leaves(item, (*path, i))
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield path


def put(message: dict[str, Any], path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    changed: Any = copy.deepcopy(message)
    part = changed
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    return changed


def bad(message: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for path in leaves(message):
        # A parameter may also be a text, a truth value or several numbers.
        shapes = [{}, [[1.0]]] if "value" in path else SHAPES
        for value in NUMBERS + shapes:
            yield put(message, path, value)


def frame(message: dict[str, Any], encoding: Encoding) -> bytes | str:
    return json.dumps(message) if encoding is Encoding.JSON else msgspec.msgpack.encode(message)


def state(hub: Any, peer: Peer) -> tuple[Any, ...]:
    """All that a message may change."""
    engine, seat = hub.site.engine, peer.session.seat
    orders = None if seat is None else len(seat.servlet.orders.outcomes)
    parameters = {name: np.array(value).tolist() for name, value in engine.parameters.items()}
    lease = hub.lease_state, hub.leasing.version, tuple(hub.robot.log)
    return engine.timeline.version, engine.receipts, hub.site.journal.number, parameters, lease, orders, hub.seats


@pytest.mark.parametrize("encoding", Encoding)
@pytest.mark.parametrize("message", clients(), ids=lambda m: m["type"])
def test_t09_a_bad_number_of_a_client_changes_nothing(message: dict[str, Any], encoding: Encoding) -> None:
    hub = make_hub(limits=ClientLimits(bad=1000, burst=100_000))
    peer = Peer(hub, role=Role.OPERATOR, encoding=encoding, greet=message["type"] != "hello")
    if message["type"] != "hello":
        peer.raw(frame({"type": "acquire", "number": 1}, encoding), now=0.0)
    before = state(hub, peer)
    for wrong in bad(message):
        if peer.session.seat is None:
            peer = Peer(hub, role=Role.OPERATOR, encoding=encoding, greet=False)
        found = peer.raw(frame(wrong, encoding), now=0.0)
        assert [(reply.kind, reply.code in CODES) for reply in found] == [("problem", True)], wrong
        assert state(hub, peer) == before, wrong


@pytest.mark.parametrize("encoding", Encoding)
@pytest.mark.parametrize("message", sites(), ids=lambda m: m["type"])
def test_a_bad_number_of_a_site_is_refused(message: dict[str, Any], encoding: Encoding) -> None:
    known = TYPES[message["type"]]
    raw = frame(message, encoding)
    assert decode(raw.encode() if isinstance(raw, str) else raw, encoding, allowed=known)
    for wrong in bad(message):
        data = frame(wrong, encoding)
        with pytest.raises(ProtocolError) as caught:
            decode(data.encode() if isinstance(data, str) else data, encoding, allowed=known)
        assert caught.value.code in CODES, wrong


@pytest.mark.parametrize("small", [0.0, -0.0, 1e-12, -1e-12, 3e-308])
@pytest.mark.parametrize("encoding", Encoding)
def test_zero_and_small_numbers_are_ordinary(encoding: Encoding, small: float) -> None:
    hub = make_hub()
    peer = Peer(hub, role=Role.OPERATOR, encoding=encoding)
    (lease,) = peer.raw(frame({"type": "acquire", "number": 1}, encoding), now=0.0)
    commands = [
        {"type": "move", "target": {"type": "joints", "q": [small] * 3 + [0.1] * 3}, "execute_at": abs(small)},
        {"type": "steer", "rates": [small] * 6, "issued_at": 0.0},
        {"type": "steer", "twist": [0.0, small, 0.0, 0.0, 0.0, small]},
    ]
    for number, command in enumerate(commands, 1):
        order = {"type": "order", "number": number, "epoch": str(lease.epoch), "command": command}
        replies = peer.raw(frame(order, encoding), now=0.0)
        assert [reply.refusal for reply in replies if reply.kind == "outcome" and reply.number == number] == [""]


@pytest.mark.parametrize("number", [1e18, -1e18, 1e300, 1.1e9])
def test_what_the_wire_refuses_cant_be_commanded(number: float) -> None:
    X = np.eye(4)
    X[0, 3] = number
    for make in (
        lambda: JointTarget([number, 0.0]),
        lambda: SteerCommand(rates=[0.0, number]),
        lambda: SteerCommand(twist=[number, 0.0, 0.0, 0.0, 0.0, 0.0]),
        lambda: DriveCommand(number, 0.0, 1.0),
        lambda: DriveCommand(0.0, number, 1.0),
        lambda: PoseTarget(X),
    ):
        with pytest.raises(InvalidValueError):
            make()


def test_a_subnormal_number_of_a_program_is_zero() -> None:
    assert JointTarget([5e-324, 0.1]).q.tolist() == [0.0, 0.1]
    assert SteerCommand(rates=[-5e-324, 0.1]).rates.tolist() == [0.0, 0.1]
    command = DriveCommand(5e-324, -5e-324, 1.0, execute_at=5e-324)
    assert (command.v, command.w, command.execute_at) == (0.0, 0.0, 0.0)
