"""Numbers that wrap around: of 16 bits on the wire, without end inside."""

from __future__ import annotations

MODULUS = 1 << 16
"""Numbers on the wire are counted modulo this."""
HALF = MODULUS // 2


def unwrapped(number: int, near: int) -> int:
    """The number nearest to another one that is the same on the wire; of two as near, the later.

    Args:
        number: From the wire, 0 to 65535.
        near: A number without end, not far from it.
    """
    ahead = (number - near) % MODULUS
    return near + ahead if ahead <= HALF else near + ahead - MODULUS


def up_to(number: int, newest: int) -> int:
    """The latest number up to the newest one that is the same on the wire as another."""
    return newest - (newest - number) % MODULUS
