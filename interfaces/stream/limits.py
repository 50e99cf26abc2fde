"""How much a client may send, and how much may wait for it."""

from __future__ import annotations

from dataclasses import dataclass

from vrs.checks import number_in


@dataclass(frozen=True, slots=True)
class ClientLimits:
    """Bounds of one client, and of all."""

    clients: int = 1024
    """Most clients at once, 1 to 100,000."""
    size: int = 65536
    """Largest message of a client [bytes], 256 to 1,048,576."""
    rate: float = 500.0
    """Messages a second that a client may send for long, 1 to 100,000."""
    burst: float = 1000.0
    """Messages that it may send at once, 1 to 100,000."""
    excess: float = 100.0
    """Messages beyond that, passed over, before it's closed, 1 to 100,000; a tenth is forgiven a second."""
    bad: float = 20.0
    """Messages that can't be taken before it's closed, 1 to 1000; one a second is forgiven."""
    hello: float = 2.0
    """Time for the first message [s], 0.1 to 60."""
    waiting: int = 131072
    """Bytes that may wait for a client before what's for it is dropped, 1024 to 16,777,216."""
    absence: float = 30.0
    """How long after its connection was lost an operator's session can be continued [s], 0 to 3600."""
    sharers: int = 8
    """Most sessions that share one lease with its holder, 0 to 1000."""
    absent: int = 64
    """Most sessions that are kept so; the oldest goes first, 0 to 100,000."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("clients", 1, 100_000),
            ("size", 256, 1 << 20),
            ("rate", 1, 1e5),
            ("burst", 1, 1e5),
            ("excess", 1, 1e5),
            ("bad", 1, 1000),
            ("hello", 0.1, 60),
            ("waiting", 1024, 1 << 24),
            ("sharers", 0, 1000),
            ("absence", 0, 3600),
            ("absent", 0, 100_000),
        ):
            number_in(name, getattr(self, name), low, high)


class Bucket:
    """Tokens that come at a rate, up to so many: who takes one may go on."""

    __slots__ = ("_at", "_most", "_rate", "_tokens")

    def __init__(self, rate: float, most: float, now: float) -> None:
        """Begin full.

        Args:
            rate: Tokens a second.
            most: Most tokens that are kept.
            now: [s].
        """
        self._rate, self._most, self._tokens, self._at = rate, most, most, now

    def take(self, now: float) -> bool:
        """Take a token at now [s]; whether there was one."""
        if now > self._at:
            self._tokens = min(self._most, self._tokens + self._rate * (now - self._at))
            self._at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
