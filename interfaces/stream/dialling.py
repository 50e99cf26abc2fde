"""How a WebSocket of ours is dialled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interfaces.stream.codec import Encoding

if TYPE_CHECKING:
    from websockets.asyncio.client import connect


def dial(url: str, encoding: Encoding, *, largest: int, opening: float, closing: float) -> connect:
    """A connection to enter: not compressed, not by a proxy, and without WebSocket's own pings.

    Args:
        url: `ws://HOST:PORT/…`.
        encoding: What the server is asked for.
        largest: Longest message that is received [B].
        opening: Longest that it may take to be made [s].
        closing: Longest that a farewell may take [s].
    """
    from websockets.asyncio.client import connect
    from websockets.typing import Subprotocol

    return connect(
        url,
        subprotocols=[Subprotocol(encoding.value)],
        compression=None,
        max_size=largest,
        open_timeout=opening,
        close_timeout=closing,
        ping_interval=None,
        proxy=None,
    )
