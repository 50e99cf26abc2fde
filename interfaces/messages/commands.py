"""Commands and receipts that cross a connection or are stored."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import get_args

import msgspec

from interfaces.messages.fields import check_normal, cut, plain, rich
from vrs.commands import Command
from vrs.errors import InvalidValueError
from vrs.ledger import Receipt

_KINDS: tuple[type, ...] = get_args(Command)
_encode = msgspec.msgpack.Encoder(enc_hook=plain).encode


def check_command(command: object) -> None:
    """Check that it's a command.

    Raises:
        InvalidValueError: If it isn't.
    """
    if not isinstance(command, _KINDS):
        raise InvalidValueError("command", command, f"one of {', '.join(kind.__name__ for kind in _KINDS)}")


def portable(receipt: Receipt, most: int | None = None) -> Receipt:
    """Return a receipt that holds nothing of the engine: names found, texts as long as they're read.

    Args:
        receipt: As an engine gave it.
        most: Names of each kind, the first ones; None for all.
    """
    found: Receipt = cut(receipt.named(most))
    return found


def check_crosses(command: Command) -> None:
    """Check that whoever gets a command over a connection can read it.

    Raises:
        InvalidValueError: If it can't be written, or a reader would refuse it.
    """
    check_command(command)
    try:
        data = _encode(command)
        check_normal(msgspec.msgpack.decode(data), _reader()(data), "command")
    except (msgspec.MsgspecError, OverflowError, TypeError) as error:
        raise InvalidValueError("command", command, f"one that can cross a connection: {error}") from None


@cache
def _reader() -> Callable[[bytes], Command]:
    return msgspec.msgpack.Decoder(Command, dec_hook=rich).decode
