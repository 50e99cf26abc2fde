"""Numbers that wrap around: of 16 bits on the wire, stamps of 32, without end inside."""

from __future__ import annotations

MODULUS = 1 << 16
"""Numbers on the wire are counted modulo this."""
HALF = MODULUS // 2
STAMPS = 1 << 32
"""Stamps on the wire are counted modulo this."""


def unwrapped(number: int, near: int, modulus: int = MODULUS) -> int:
    """The number nearest to another one that is the same on the wire; of two as near, the later.

    Args:
        number: From the wire, 0 to `modulus` − 1.
        near: A number without end, not far from it.
        modulus: What numbers are counted modulo; even.
    """
    ahead = (number - near) % modulus
    return near + ahead if ahead <= modulus // 2 else near + ahead - modulus


def up_to(number: int, newest: int) -> int:
    """The latest number up to the newest one that is the same on the wire as another."""
    return newest - (newest - number) % MODULUS
