"""Messages as they cross: typed, with ranges; `interfaces.stream.codec` reads and writes them."""

from interfaces.stream.wire.fields import Message

__all__ = ["Message"]
