"""How much a row of the table of faults tries, and what it gives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from random import Random
from typing import Generic, TypeVar

from benchmarks.results import Bar, Cost, Result
from tests.stood_still import StallWatch

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is tried; the full run by default."""

    tries: int = 100
    """Instants at which each process is killed or stopped, and disks that fill."""
    seed: int = 1
    """Of everything random."""
    seconds: float = 600.0
    """How long each parser is fuzzed [s]."""
    load: float = 20.0
    """How long each load is on [s]."""
    hours: float = 24.0
    """Virtual operation [h]."""


def most(
    name: str, found: float, bar: float, unit: str = "", *, tries: int | None = None, note: str = ""
) -> Result:
    """A figure that is at most so large; the worst of all tries."""
    return Result(name, Cost(float(found)), unit, Bar(median=bar), tries=tries, note=note)


class Tries(Generic[T]):
    """Goes through tries at random instants, and keeps what each found.

    One that fails while the machine is held up is made once more, as tests are (`tests.stood_still`), and counted.
    """

    def __init__(self, effort: Effort, low: float = 0.0, high: float = 1.2) -> None:
        """Begin.

        Args:
            effort: How many.
            low: Earliest instant [s].
            high: Latest one [s].
        """
        self.count, self.again = effort.tries, 0
        self.found: list[T] = []
        self._random, self._span, self._stalls = Random(effort.seed), (low, high), StallWatch()

    def __iter__(self) -> Iterator[float]:
        """The instant of each try [s]."""
        while len(self.found) < self.count:
            self._stalls.reset()
            yield self._random.uniform(*self._span)

    def take(self, found: T, *, sound: bool) -> None:
        """Keep what a try found, unless it has to be made once more."""
        if sound or not self._stalls.found() or self.again >= self.count:
            self.found.append(found)
        else:
            self.again += 1

    @property
    def note(self) -> str:
        """How many were made again; empty for none."""
        return f"{self.again} made again, as the machine was held up" if self.again else ""
