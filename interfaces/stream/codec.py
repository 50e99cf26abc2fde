"""Messages to bytes and back, in two encodings."""

from __future__ import annotations

import enum
from collections import OrderedDict
from collections.abc import Callable
from functools import cache
from types import UnionType
from typing import Any, Generic, TypeAlias, TypeVar, get_args

import msgspec

from interfaces import messages
from interfaces.messages import Reply, Request, control
from interfaces.messages.control import Notice, Ping, Pong, ProblemCode, ProtocolError, Question
from interfaces.messages.fields import LONGEST_TEXT, check_normal, cut, plain, rich
from interfaces.messages.fields import Message as Wire
from interfaces.messages.segments import Packed, Plain
from interfaces.messages.sites import Orders, Report
from interfaces.stream import mobile
from interfaces.stream.wire import messages as message_wires
from interfaces.stream.wire import mobile as mobile_wires
from interfaces.stream.wire import sites
from interfaces.teleop.driving.messages import DriveOrders, DriveReport
from vrs.errors import InvalidValueError

LARGEST = 65_536
"""Longest message that is read unless told otherwise [B]."""

Value: TypeAlias = (
    Request
    | Reply
    | Question
    | Notice
    | mobile.MobileWelcome
    | mobile.Postures
    | mobile.TaskOrder
    | mobile.Tasks
    | mobile.Seen
    | mobile.Plan
    | Orders
    | Report
    | DriveOrders
    | DriveReport
)
"""What crosses."""
T = TypeVar("T")

WIRES: dict[type, type[Wire]] = {
    messages.Order: message_wires.OrderWire,
    messages.Ask: messages.Ask,
    messages.Follow: messages.Follow,
    messages.Want: messages.Want,
    messages.Outcome: message_wires.OutcomeWire,
    messages.Answer: message_wires.AnswerWire,
    messages.Broadcast: message_wires.BroadcastWire,
    messages.Compact: messages.Compact,
    messages.Scene: messages.Scene,
    messages.History: message_wires.HistoryWire,
    messages.Change: message_wires.ChangeWire,
    messages.Pulse: message_wires.PulseWire,
    control.Hello: control.Hello,
    control.Welcome: control.Welcome,
    control.Attached: control.Attached,
    Ping: Ping,
    Pong: Pong,
    control.Acquire: control.Acquire,
    control.TakeOver: control.TakeOver,
    control.Share: control.Share,
    control.Release: control.Release,
    control.Resume: control.Resume,
    control.Beat: control.Beat,
    control.Lease: control.Lease,
    control.Problem: control.Problem,
    control.State: control.State,
    control.Survey: control.Survey,
    control.Impair: control.Impair,
    control.Network: control.Network,
    Orders: sites.OrdersWire,
    Report: sites.ReportWire,
    mobile.MobileWelcome: mobile.MobileWelcome,
    mobile.Postures: mobile.Postures,
    mobile.TaskOrder: mobile_wires.TaskOrderWire,
    mobile.Tasks: mobile_wires.TasksWire,
    mobile.Seen: mobile.Seen,
    mobile.Plan: mobile.Plan,
    DriveOrders: mobile_wires.DriveOrdersWire,
    DriveReport: mobile_wires.DriveReportWire,
}
"""The wire form of each message."""
ASKED = frozenset(
    WIRES[kind] for kind in (*get_args(Request), *get_args(Question), mobile.TaskOrder, Pong, Orders, DriveOrders)
)
"""What clients and the operator's site send: their numbers may move a robot, and none may be subnormal."""
TYPES = {kind.__struct_config__.tag: value for value, kind in WIRES.items()}
"""Messages by the type that stands in them."""


class Encoding(enum.StrEnum):
    """How messages are written; the value is the WebSocket subprotocol."""

    MSGPACK = "vrs.1.msgpack"
    """Binary frames."""
    JSON = "vrs.1.json"
    """Text frames."""


class _MessageHead(msgspec.Struct, frozen=True):
    type: str


_HEADS: dict[Encoding, Callable[[bytes], _MessageHead]] = {
    Encoding.MSGPACK: msgspec.msgpack.Decoder(_MessageHead).decode,
    Encoding.JSON: msgspec.json.Decoder(_MessageHead).decode,
}


_WRITERS: dict[Encoding, Callable[[Wire], bytes]] = {
    Encoding.MSGPACK: msgspec.msgpack.Encoder(enc_hook=plain).encode,
    Encoding.JSON: msgspec.json.Encoder(enc_hook=plain).encode,
}


def encode(message: Value, encoding: Encoding) -> bytes:
    """A message as one frame.

    Raises:
        InvalidValueError: If it's no message.
    """
    kind = WIRES.get(type(message))
    if kind is None:
        raise InvalidValueError("message", message, f"one of {', '.join(known.__name__ for known in WIRES)}")
    wire: Any = message if kind is type(message) else kind.of(message, encoding is Encoding.MSGPACK)
    write = _WRITERS[encoding]
    try:
        data = write(wire)
    except UnicodeEncodeError:
        return write(cut(wire))
    return data if len(data) <= LONGEST_TEXT else write(cut(wire))


def decode(data: bytes, encoding: Encoding, *, allowed: Any, largest: int = LARGEST) -> Any:
    """The message in a frame.

    Args:
        data: The frame.
        encoding: How it's written.
        allowed: Class of the messages that may come here, or a union of such.
        largest: Longest frame [B].

    Raises:
        ProtocolError: If it's anything else.
    """
    if len(data) > largest:
        raise ProtocolError(ProblemCode.TOO_LARGE, f"{len(data)} bytes; at most {largest} are read")
    try:
        wire = _reader(encoding, allowed)(data)
        if type(wire) in ASKED:
            check_normal(wire, str(wire.__struct_config__.tag))
        return wire if type(wire) in WIRES else wire.read()
    except msgspec.ValidationError as error:
        raise _invalid(data, encoding, allowed, str(error)) from None
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ProtocolError(ProblemCode.MALFORMED, str(error)) from None
    except (InvalidValueError, OverflowError) as error:
        raise ProtocolError(ProblemCode.OUT_OF_RANGE, str(error)) from None


def _invalid(data: bytes, encoding: Encoding, allowed: Any, problem: str) -> ProtocolError:
    try:
        kind = _HEADS[encoding](data).type
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        return ProtocolError(ProblemCode.MALFORMED, str(error))
    if kind not in TYPES:
        return ProtocolError(ProblemCode.UNKNOWN_TYPE, f"no type {kind[:40]!r}")
    if TYPES[kind] not in _classes(allowed):
        return ProtocolError(ProblemCode.NOT_ALLOWED, f"{kind} can't come here")
    return ProtocolError(ProblemCode.OUT_OF_RANGE, f"{kind}: {problem}")


def _classes(allowed: Any) -> tuple[type, ...]:
    return get_args(allowed) if isinstance(allowed, UnionType) or get_args(allowed) else (allowed,)


@cache
def _reader(encoding: Encoding, allowed: Any) -> Callable[[bytes], Wire]:
    packed = encoding is Encoding.MSGPACK
    union: Any = None
    for value in _classes(allowed):
        kind: Any = WIRES[value]
        if issubclass(kind, Generic):
            kind = kind[Packed if packed else Plain]
        union = kind if union is None else union | kind
    reader: Callable[[bytes], Wire] = (
        (msgspec.msgpack if packed else msgspec.json).Decoder(union, dec_hook=rich).decode
    )
    return reader


FOR_ONE = (
    messages.Outcome,
    messages.Answer,
    messages.Compact,
    messages.Scene,
    messages.Pulse,
    Pong,
    control.Problem,
)
"""What one client alone gets: remembering it would push out what others are still to get."""


class SharedEncoder:
    """Encodes the same message for many receivers once: of what many get it remembers the newest, by identity."""

    def __init__(self, size: int = 64) -> None:
        """Remember so many."""
        self._size = size
        self._known: OrderedDict[tuple[int, Encoding], tuple[Value, bytes]] = OrderedDict()

    def encode(self, message: Value, encoding: Encoding) -> bytes:
        """Return the bytes of a message, the same object for all who get it."""
        if isinstance(message, FOR_ONE):
            return encode(message, encoding)
        key = id(message), encoding
        known = self._known.get(key)
        # An id is free again once its object is gone; what is remembered isn't gone.
        if known is not None:
            return known[1]
        data = encode(message, encoding)
        self._known[key] = message, data
        if len(self._known) > self._size:
            self._known.popitem(last=False)
        return data
