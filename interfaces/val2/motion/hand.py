"""The hand: how far it's open, and when it moves."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

OPEN: Final = 100.0
"""Opening of a hand that's open [mm]."""
HAND_TIME: Final = 0.05
"""What the hand takes unless the parameter HAND.TIME says otherwise [s]."""

REMEMBERED: Final = 10_000
"""Movements that can be looked back at."""

Gripped = Callable[[float, bool], None]
"""Is told when the hand takes hold of something (True) or lets go [s]."""
Moved = Callable[[float | None], None]
"""Is told to what opening the hand begins to move [mm]; None: it stays, without pressing."""


@dataclass(frozen=True, slots=True)
class _Order:
    """The hand is to move when a motion begins."""

    number: int
    """Of the motion."""
    to: float
    """Opening [mm]."""
    holds: bool


@dataclass(frozen=True, slots=True)
class _Movement:
    """An even movement of the hand; it stays where that ends."""

    start: float
    """[s]."""
    end: float
    """[s]."""
    before: float
    """Opening at the start [mm]."""
    to: float
    """Opening at the end [mm]."""

    def opening(self, t: float) -> float:
        """Opening at a time [s], [mm]."""
        if t >= self.end:
            return self.to
        share = max((t - self.start) / (self.end - self.start), 0.0)
        return self.before + share * (self.to - self.before)


class Hand:
    """A hand that opens and closes evenly in HAND.TIME. It remembers when it did."""

    def __init__(
        self, parameters: Mapping[str, float], gripped: Gripped | None, moved: Moved | None = None
    ) -> None:
        self._parameters, self._gripped, self._moved = parameters, gripped, moved
        self._movements = deque([_Movement(-math.inf, -math.inf, OPEN, OPEN)], maxlen=REMEMBERED)
        self._holds = False
        self._orders: list[_Order] = []

    @property
    def end(self) -> float:
        """When it's done with what it does now [s]."""
        return self._movements[-1].end

    @property
    def waits(self) -> bool:
        """Whether it's to move with a motion that hasn't begun."""
        return bool(self._orders)

    @property
    def _to(self) -> float:
        return self._movements[-1].to

    @property
    def goal(self) -> float:
        """Opening that it goes to in the end [mm]."""
        return self._orders[-1].to if self._orders else self._to

    def opening(self, t: float, started: Callable[[int], float | None] | None = None) -> float:
        """Opening at a time [s], [mm].

        Args:
            t: In the past, as far as that is remembered; or later.
            started: Says when a motion begins [s], None for unknown; with it, orders of motions to come count.
        """
        movement = self._movements[max(bisect_right(self._movements, t, key=lambda one: one.start) - 1, 0)]
        for order in self._orders:
            begins = None if started is None else started(order.number)
            if begins is None or begins > t:
                break
            movement = self._movement(order.to, begins, movement.opening(begins))
        return movement.opening(t)

    def ask(self, number: int, hand: float | bool | None) -> None:
        """Let it move, or relax (None), when a motion begins."""
        self._orders.append(_Order(number, *((self.goal, False) if hand is None else _meaning(hand))))

    def begin(self, started: Callable[[int], float | None], now: float) -> None:
        """Move for every motion that has begun; the callable says when it did [s], None for not yet."""
        while self._orders:
            t = started(self._orders[0].number)
            if t is None or t > now:
                return
            order = self._orders.pop(0)
            self._move(order.to, order.holds, t)

    def actuate(self, hand: float | bool | None, now: float) -> None:
        """Open (True), close (False) or relax (None) it now, or move it to an opening [mm]."""
        self._move(*((self._to, False) if hand is None else _meaning(hand)), now)

    def forget(self) -> None:
        """Drop what was asked for motions to come."""
        self._orders.clear()

    def _movement(self, to: float, t: float, before: float) -> _Movement:
        return _Movement(t, t + max(self._parameters.get("HAND.TIME", HAND_TIME), 0.0), before, to)

    def _move(self, to: float, holds: bool, t: float) -> None:
        t = max(t, self._movements[-1].start)
        self._movements.append(self._movement(to, t, self.opening(t)))
        if holds is not self._holds and self._gripped is not None:
            self._gripped(self.end if holds else t, holds)
        self._holds = holds
        if self._moved is not None:
            self._moved(None if to <= 0.0 and not holds else to)


def _meaning(hand: float | bool) -> tuple[float, bool]:
    """Opening [mm], and whether something is held then; closed is 0."""
    if isinstance(hand, bool):
        return (OPEN, False) if hand else (0.0, True)
    opening = min(max(hand, 0.0), OPEN)
    return opening, opening <= 0.0
