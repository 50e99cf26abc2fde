"""Messages to bytes and back, in two encodings."""

from __future__ import annotations

import enum
from collections import OrderedDict
from collections.abc import Callable
from functools import cache, reduce
from operator import or_
from types import UnionType
from typing import Any, TypeAlias, TypeVar, get_args

import msgspec

from interfaces import messages
from interfaces.messages import Reply, Request, control
from interfaces.messages.control import (
    MobileWelcome,
    Notice,
    Plan,
    Pong,
    Postures,
    ProblemCode,
    ProtocolError,
    Question,
    Role,
    Seen,
    may_send,
)
from interfaces.messages.fields import Message, Party, check_normal, plain, rich, writer
from interfaces.messages.jobs import TaskOrder, Tasks
from interfaces.messages.sites import DriveOrders, DriveReport, Orders, Report
from vrs.errors import InvalidValueError

LARGEST = 65_536
"""Longest message that is read unless told otherwise [B]."""

Welcomed: TypeAlias = control.Welcome | MobileWelcome
"""What greets a client: of an arm's server, of a mobile robot's."""
News: TypeAlias = (
    control.State | Postures | control.Network | Tasks | Seen | Plan | control.Present | control.Relays
)
"""What is told of the robot and the way to it: of each kind the newest counts."""
Value: TypeAlias = (
    Request | Reply | Question | Notice | Welcomed | Postures | TaskOrder | News
    | Orders | Report | DriveOrders | DriveReport
)  # fmt: skip
"""What crosses, in the order in which documents and fuzzers go through it."""
T = TypeVar("T")

KINDS: tuple[type[Message], ...] = get_args(Value)
"""Classes of what crosses."""
KNOWN = frozenset(KINDS)
"""The same, for a look at every message that's written."""
ASKED = frozenset(kind for kind in KINDS if kind.sender not in {Party.SERVER, Party.ROBOT})
"""What clients and the operator's site send: their numbers may move a robot, and none may be subnormal."""
TYPES = {kind.__struct_config__.tag: kind for kind in KINDS}
"""Messages by the type that stands in them."""


def sent_by(role: Role) -> Any:
    """The messages that a client of a role may send after `Hello`, as a union."""
    return reduce(or_, (kind for kind in KINDS if may_send(role, kind.sender) and kind is not control.Hello))


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


_PLAIN: dict[Encoding, Callable[[bytes], Any]] = {
    Encoding.MSGPACK: msgspec.msgpack.Decoder().decode,
    Encoding.JSON: msgspec.json.Decoder().decode,
}
_WRITERS: dict[Encoding, tuple[Callable[[Message], bytes], bool]] = {
    Encoding.MSGPACK: (writer(msgspec.msgpack.Encoder(enc_hook=plain).encode), True),
    Encoding.JSON: (writer(msgspec.json.Encoder(enc_hook=plain).encode), False),
}
"""What writes, and whether coefficients are bytes."""


def encode(message: Value, encoding: Encoding) -> bytes:
    """A message as one frame.

    Raises:
        InvalidValueError: If it's no message.
    """
    if type(message) not in KNOWN:
        raise InvalidValueError("message", message, f"one of {', '.join(kind.__name__ for kind in KINDS)}")
    write, packed = _WRITERS[encoding]
    return write(message.as_written(packed))


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
        message = _reader(encoding, allowed)(data)
        if type(message) in ASKED:
            check_normal(_PLAIN[encoding](data), message, message.kind)
        return message
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
def _reader(encoding: Encoding, allowed: Any) -> Callable[[bytes], Message]:
    kinds = reduce(or_, _classes(allowed))
    read: Callable[[bytes], Message] = (
        msgspec.msgpack.Decoder(kinds, dec_hook=rich).decode
        if encoding is Encoding.MSGPACK
        else msgspec.json.Decoder(kinds, dec_hook=rich).decode
    )
    return read


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
