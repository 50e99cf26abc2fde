"""Requests that are sent again until they are answered, at growing intervals."""

from __future__ import annotations

import math
from itertools import islice
from typing import Generic, TypeVar

from vrs.commands import finite
from vrs.errors import InvalidValueError

T = TypeVar("T")

GROWTH = 1.5
"""Each interval is so many times as long as the one before."""

LONGEST = 5.0
"""The longest interval [s]."""


def interval_of(value: object) -> float:
    """Return the first interval [s].

    Raises:
        InvalidValueError: If it isn't 0.001 to 5.
    """
    interval = finite("resend", value, "0.001 to 5 s")
    if not 1e-3 <= interval <= LONGEST:
        raise InvalidValueError("resend", value, "0.001 to 5 s")
    return interval


class Resending(Generic[T]):
    """What waits for an answer, by number."""

    def __init__(self, interval: float) -> None:
        """Wait for nothing.

        Args:
            interval: The first interval [s], 0.001 to 5.

        Raises:
            InvalidValueError: If it's out of range.
        """
        self._interval = interval_of(interval)
        self._waiting: dict[int, tuple[T, float, float]] = {}
        self._soonest = math.inf

    def __len__(self) -> int:
        return len(self._waiting)

    def __contains__(self, number: object) -> bool:
        return number in self._waiting

    def add(self, number: int, request: T, now: float, *, first: float | None = None) -> None:
        """Wait for the answer to a request.

        Args:
            number: Its number.
            request: What is sent again.
            now: When it was sent [s].
            first: When it's sent again at first [s]; after the first interval unless given.
        """
        at = now + self._interval if first is None else first
        self._waiting[number] = request, at, self._interval
        self._soonest = min(self._soonest, at)

    def drop(self, number: int) -> None:
        """Wait no more for an answer; one that nobody waits for is none."""
        self._waiting.pop(number, None)
        if not self._waiting:
            self._soonest = math.inf

    def due(self, now: float) -> tuple[T, ...]:
        """What is to be sent again now, in the order of adding."""
        if now < self._soonest:
            return ()
        found = []
        for number, (request, at, interval) in self._waiting.items():
            if at <= now:
                found.append(request)
                longer = min(GROWTH * interval, LONGEST)
                self._waiting[number] = request, now + longer, longer
        self._soonest = min((at for _, at, _ in self._waiting.values()), default=math.inf)
        return tuple(found)

    def next_deadline(self) -> float | None:
        """When to look again what is due [s]; None for never."""
        return self._soonest if self._waiting else None

    def newest(self, count: int) -> tuple[T, ...]:
        """The requests that were added last, at most so many, in the order of adding."""
        found = [request for request, _, _ in islice(reversed(self._waiting.values()), count)]
        return tuple(reversed(found))

    def numbers(self) -> tuple[int, ...]:
        """The numbers, in the order of adding."""
        return tuple(self._waiting)
