"""Where the robot was measured: what its site keeps of that, and what the operator's has and asks for.

Samples are numbered. A report carries the new ones; what a lost or late report leaves out, the operator's site asks
for, and gets with later reports, after a long outage too.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Iterable
from itertools import islice
from operator import attrgetter
from typing import Final

import numpy as np

from interfaces.messages.sites import AGAIN, NEW, RANGES, Ranges, Sample
from vrs.model import Array, frozen_array

PERIOD: Final = 0.01
"""Time between two samples [s], as between two measurements of the body."""
KEPT: Final = 600.0
"""For so long the robot's site keeps samples [s]: an outage as long as that leaves no gap."""
WANTED: Final = 128
"""Samples that are asked for in one message, at most."""
LATE: Final = 128
"""Late samples that are told to who looks on, at most; one of six is, which is often enough to look at."""
_MOST: Final = round(KEPT / PERIOD)
_ASKED: Final = 4096
"""Samples that wait to be sent again, at most."""


class SampleLog:
    """The robot's side: keeps the samples of the last ten minutes, and says which go with a report."""

    def __init__(self, dof: int, last: int = 0) -> None:
        """Begin without any.

        Args:
            dof: Joints.
            last: Number of the last sample of an earlier life, which the operator may know.
        """
        self._dof = dof
        self._rows: Array = np.empty((_MOST, 2 + 2 * dof))
        self._first = last + 1
        self.newest = self._told = last
        """Number of the newest one."""
        self._t = -np.inf
        self._asked: dict[int, None] = {}

    @property
    def oldest(self) -> int:
        """Number of the oldest that is kept, or of the next one."""
        return max(self._first, self.newest + 1 - _MOST)

    def add(self, t: float, play: float, q: Array, reference: Array) -> None:
        """Take a measurement, if it's time for the next sample; see `Sample`."""
        if t - self._t < PERIOD - 1e-6:
            return
        self._t = t
        self.newest += 1
        self._rows[self.newest % _MOST] = (t, play, *q, *reference)

    def ask(self, wanted: Ranges) -> None:
        """Let samples be sent again."""
        for first, last in wanted:
            for number in range(max(first, self.oldest), min(last, self.newest) + 1):
                if len(self._asked) >= _ASKED and number not in self._asked:
                    return
                self._asked[number] = None

    def take(self) -> tuple[Sample, ...]:
        """What goes with the next report."""
        first = max(self._told + 1, self.newest + 1 - NEW)
        again = list(islice(self._asked, AGAIN))
        for number in again:
            del self._asked[number]
        self._told = self.newest
        chosen = [*(number for number in again if number >= self.oldest), *range(first, self.newest + 1)]
        return tuple(self._sample(number) for number in chosen)

    def _sample(self, number: int) -> Sample:
        row = self._rows[number % _MOST]
        q, reference = row[2:].reshape(2, self._dof)
        return Sample(number, float(row[0]), float(row[1]), frozen_array(q), frozen_array(reference))


class Gathering:
    """The operator's side: takes each sample once, in whatever order they come, and asks for what is missing."""

    def __init__(self) -> None:
        """Begin without any."""
        self._newest = self._oldest = 0
        self._missing: OrderedDict[int, float] = OrderedDict()
        """Numbers, and since when each has been missing or was asked for last [s], in that order."""
        self._t = -np.inf
        self._late: deque[tuple[float, Sample]] = deque(maxlen=LATE)

    def late(self, *, since: float) -> tuple[Sample, ...]:
        """Samples that have come since a time [s] although later ones had come before; one of six."""
        return tuple(sample for came, sample in self._late if came >= since)

    def take(self, samples: Iterable[Sample], oldest: int, *, now: float) -> list[Sample]:
        """Those of a report that weren't known.

        Args:
            samples: What came with it.
            oldest: Number of the oldest sample that the robot keeps; 0 of a robot that doesn't number them: its
                samples are taken where they're newer than all before.
            now: By the operator's clock [s].
        """
        found = []
        self._oldest = max(self._oldest, oldest)
        for sample in sorted(samples, key=attrgetter("number")):
            number = sample.number
            if not oldest:
                new = sample.t > self._t
            elif new := number > self._newest:
                since = max(self._newest + 1, oldest, number - _MOST)
                self._missing.update((left, now) for left in range(since, number))
                self._newest = number
            else:
                new = self._missing.pop(number, None) is not None
                if new and number % 6 == 0:
                    self._late.append((now, sample))
            if new:
                self._t = max(self._t, sample.t)
                found.append(sample)
        while len(self._missing) > _MOST:
            self._missing.popitem(last=False)
        return found

    def wanted(self, *, now: float, patience: float) -> Ranges:
        """What to ask for now [s]: what has been missing, or was asked for in vain, for longer than that [s]."""
        ranges: list[tuple[int, int]] = []
        for number, since in list(islice(self._missing.items(), WANTED)):
            if now - since <= patience:
                break
            if number < self._oldest:
                del self._missing[number]
                continue
            if ranges and ranges[-1][1] + 1 == number:
                ranges[-1] = ranges[-1][0], number
            elif len(ranges) < RANGES:
                ranges.append((number, number))
            else:
                break
            self._missing[number] = now
            self._missing.move_to_end(number)
        return tuple(ranges)
