"""What a timeline is edited with: pieces to put in, states at a knot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vrs.model import Array

HOLD = 0
"""Command id, inside, of a hold; `PolynomialSegment.command_id` says None."""


class Piece(NamedTuple):
    """New polynomials for an edit, one after the other."""

    durations: Sequence[float]
    """Durations [s], (m,), positive."""
    coefficients: Sequence[Array]
    """m arrays of shape (degree + 1, n)."""
    command_id: int
    """Who made them; HOLD for a hold."""


class State(NamedTuple):
    """Where the arm is and how it moves, each (n,)."""

    q: Array
    """[rad]."""
    qd: Array
    """[rad/s]."""
    qdd: Array
    """[rad/s²]."""
