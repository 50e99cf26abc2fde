"""Pieces of random polynomials for timelines."""

from __future__ import annotations

import numpy as np

from vrs.segment import Piece

N = 3


def piece(rng: np.random.Generator, owner: int, count: int, orders: int = 5) -> Piece:
    durations = (rng.uniform(0.01, 1.0, count) * 10.0 ** rng.integers(-3, 1)).tolist()
    a = [rng.normal(size=(int(rng.integers(1, orders)), N)) for _ in range(count)]
    return Piece(durations, a, owner)
