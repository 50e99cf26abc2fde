"""What a timeline is made of: chunks of segments that move together, pieces to put in, states at a knot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vrs.model import Array

HOLD = 0
"""Command id, inside, of a hold; `PolynomialSegment.command_id` says None."""

CAPACITY = 128
"""Segments that a chunk holds at most: larger ones cost more to cut, smaller ones more to shift."""


class Piece(NamedTuple):
    """New polynomials for an edit, one after the other."""

    durations: Sequence[float]
    """Durations [s], (m,), positive."""
    coefficients: Sequence[Array]
    """m arrays of shape (degree + 1, n)."""
    command_id: int
    """Who made them; HOLD for a hold."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Where the arm is and how it moves, each (n,)."""

    q: Array
    """[rad]."""
    qd: Array
    """[rad/s]."""
    qdd: Array
    """[rad/s²]."""


class Chunk:
    """Up to CAPACITY segments that move together. Never changed once it's made."""

    __slots__ = ("_stack", "_times", "coefficients", "durations", "ids", "starts")

    def __init__(
        self, starts: list[float], durations: list[float], coefficients: list[Array], ids: list[int]
    ) -> None:
        self.starts = starts
        self.durations = durations
        self.coefficients = coefficients
        self.ids = ids
        self._stack: Array | None = None
        self._times: Array | None = None

    def part(self, low: int, high: int) -> Chunk:
        """Segments low to high − 1."""
        cut = slice(low, high)
        return Chunk(self.starts[cut], self.durations[cut], self.coefficients[cut], self.ids[cut])

    @property
    def times(self) -> Array:
        """The starts as an array, (m,), made once."""
        if self._times is None:
            self._times = np.asarray(self.starts)
        return self._times

    @property
    def stacked(self) -> Array:
        """All coefficients, padded to the chunk's highest degree: (m, K, n), made once."""
        if self._stack is None:
            order = max(len(a) for a in self.coefficients)
            stack = np.zeros((len(self.starts), order, self.coefficients[0].shape[1]))
            for row, a in zip(stack, self.coefficients, strict=True):
                row[: len(a)] = a
            self._stack = stack
        return self._stack
