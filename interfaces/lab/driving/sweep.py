"""Many runs: a table of all, intervals, paired tests between architectures, and what causes their errors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Final

import numpy as np

from interfaces.lab.driving.operators import operator
from interfaces.lab.driving.run import run
from interfaces.lab.statistics import Estimate, bootstrap, median
from interfaces.runs.drive_run import DriveCase, Row, row_of
from interfaces.runs.summary import Attribution
from interfaces.teleop.architectures import Transport, architecture
from robots.mobile.chassis import MobileReality
from robots.mobile.robot import place
from robots.robot import BARE
from vrs.comparison import PathComparison

LEAST_PROGRESS = 0.97
"""Below it the means of a run aren't compared: what a robot never reached has no delay."""
EQUAL = 0.10
"""Figures nearer than this share are called equal."""


def measure(case: DriveCase) -> Row:
    """Run a case and keep its figures."""
    return row_of(run(case))


def cases(
    architectures: Sequence[str],
    transports: Sequence[Transport],
    delays: Sequence[str],
    robots: Sequence[str],
    operators: Sequence[str],
    seeds: Iterable[int],
    length: float,
) -> list[DriveCase]:
    """All combinations, the seeds of one group side by side."""
    return [
        DriveCase(architecture, transport, delay, robot, who, seed, length)
        for delay, robot, who, architecture, transport, seed in product(
            delays, robots, operators, architectures, transports, seeds
        )
    ]


@dataclass(frozen=True, slots=True)
class Group:
    """All seeds of one combination."""

    key: tuple[str, ...]
    """Architecture, transport, delay, robot, operator."""
    rows: tuple[Row, ...]

    def values(self, metric: str) -> list[float]:
        """A metric of each run that has it."""
        found = (getattr(row.metrics, metric) for row in self.rows)
        return [value for value in found if value is not None]

    def mean(self, metric: str) -> Estimate | None:
        """Its mean over runs with its interval; None if no run has it."""
        values = self.values(metric)
        return bootstrap(values, 0) if values else None

    def median(self, metric: str) -> Estimate | None:
        """Its median over runs with its interval; None if no run has it."""
        values = self.values(metric)
        return bootstrap(values, 0, median) if values else None


def grouped(rows: Iterable[Row]) -> list[Group]:
    """The rows by combination, in the order of the first of each."""
    found: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(row.group, []).append(row)
    return [Group(key, tuple(members)) for key, members in found.items()]


def paired(first: Group, second: Group, metric: str) -> tuple[Estimate, str] | None:
    """Compare two combinations in a metric, seed by seed; None if they have no seeds in common that have it.

    Of runs with a progress below 97 % the time difference is taken by its bound, other means not at all.

    Returns:
        Mean of first − second with its interval, and a verdict: `below`, `above` (the interval doesn't touch zero),
        `equal` (within 10 %), `unclear`, as of few seeds.
    """
    one, other = ({row.seed: comparable(row.metrics, metric) for row in group.rows} for group in (first, second))
    pairs = [
        (a, b) for seed, a in one.items() if a is not None and (b := other.get(seed)) is not None
    ]  # fmt: skip
    if not pairs:
        return None
    a, b = np.array(pairs).T
    difference = bootstrap(a - b, 0)
    if difference.level is None:
        verdict = "unclear"
    elif difference.high < 0:
        verdict = "below"
    elif difference.low > 0:
        verdict = "above"
    else:
        verdict = "unclear"
    if abs(a.mean() - b.mean()) <= EQUAL * max(abs(a.mean()), abs(b.mean())):
        verdict = "equal"
    return difference, verdict


def comparable(metrics: PathComparison, metric: str) -> float | None:
    """A metric as it may be compared: below 97 % progress the bound of the time difference, and no other mean."""
    whole = metrics.progress is not None and metrics.progress >= LEAST_PROGRESS
    if metric == "time_difference_mean" and not whole:
        metric = "time_difference_bound"
    elif metric in ("path_error_mean", "speed_error") and not whole:
        return None
    value: float | None = getattr(metrics, metric)
    return value


CAUSES: Final = ("delay", "model", "localization", "environment")
"""In the order in which they're switched off."""
FIGURES: Final = ("path_error_mean", "time_difference_mean")
"""What is taken apart."""


def attributed(case: DriveCase, whole: PathComparison | None = None) -> tuple[Attribution, ...]:
    """Take apart a case's `FIGURES`: run it with ever fewer of its `CAUSES` of error.

    Args:
        case: With its own reality, position and network.
        whole: Its figures with all causes on, where they're known.

    Raises:
        InvalidValueError: If a name or a value isn't allowed.
    """
    found = [run(case).compare() if whole is None else whole]
    for before, variant in pairwise(_variants(case)):
        # A cause that there isn't is nothing to be switched off.
        found.append(found[-1] if variant == before else run(variant).compare())
    made = []
    for figure in FIGURES:
        values: Sequence[float] = [getattr(one, figure) or 0.0 for one in found]
        parts = tuple((cause, a - b) for cause, (a, b) in zip(CAUSES, pairwise(values), strict=True))
        made.append(Attribution(figure, values[0], parts, values[-1]))
    return tuple(made)


def _variants(case: DriveCase) -> list[DriveCase]:
    prompt = replace(case, delay="none")
    step = 1 / 60 if case.real[1] == BARE else 1 / 240
    alike = replace(prompt, reality=MobileReality.ideal(dt=step))
    placed = replace(alike, position="truth")
    if not architecture(case.architecture).senses:
        # It neither senses what's unknown nor avoids it.
        return [case, prompt, alike, placed, placed]
    room = case.room or operator(case.operator, case.seed, case.constants.period).room
    known = (place(room) if isinstance(room, str) else room).known() if room else ""
    return [case, prompt, alike, placed, replace(placed, room=known)]
