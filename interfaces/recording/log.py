"""The messages of one channel, decoded once, in the order of the file."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import Any

import msgspec

from interfaces.recording.channels import CHANNELS
from interfaces.recording.scan import NUMBERS, Blocks
from vrs.errors import FormatError

DECODERS = {number: msgspec.json.Decoder(reduce(or_, channel.kinds)) for number, channel in enumerate(CHANNELS, 1)}
"""By number of the channel."""
DECODING = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
"""What decoders raise."""


class Log:
    """All messages of a channel: read when they're asked for first, and those that have come since."""

    def __init__(self, blocks: Blocks, topic: str, where: str) -> None:
        self._blocks, self._where = blocks, where
        self._number = NUMBERS[topic]
        self._seen = 0
        self._found: list[Any] = []

    def entries(self) -> list[Any]:
        """The messages.

        Raises:
            FormatError: If one isn't what the channel's schema says.
        """
        count = len(self._blocks)
        if self._seen < count:
            for index in self._blocks.having(self._number):
                if index >= self._seen:
                    self._found += self.of(index)
            self._seen = count
        return self._found

    def of(self, index: int) -> list[Any]:
        """The messages in one block.

        Raises:
            FormatError: See `entries`.
        """
        return [self._decoded(data) for data in self._blocks.read(index, self._number)]

    def _decoded(self, data: bytes) -> Any:
        try:
            return DECODERS[self._number].decode(data)
        except DECODING as error:
            raise unreadable(self._where, self._number, error) from None


def unreadable(where: str, number: int, error: Exception) -> FormatError:
    """A message that isn't what its channel's schema says."""
    return FormatError(where, f"a message on {CHANNELS[number - 1].topic}: {error}")
