"""What the delay, the model, the localization and the environment each do to path error and time difference.

Counterfactual runs of one case: causes are switched off one after the other, in the order of `CAUSES`. A cause's
part is what a figure falls by when it goes; what is left with all of them off is the residual. So parts add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from interfaces.lab.driving.operators import operator
from interfaces.lab.driving.run import run
from interfaces.runs.drive_run import DriveCase
from interfaces.teleop.architectures.compositions import SENSING
from robots.ipr.chassis import MobileReality
from robots.ipr.robot import place
from vrs.comparison import PathComparison

CAUSES: Final = ("delay", "model", "localization", "environment")
"""In the order in which they're switched off."""
FIGURES: Final = ("path_error_mean", "time_difference_mean")
"""What is taken apart."""


@dataclass(frozen=True, slots=True)
class DriveAttribution:
    """A figure of a case, taken apart."""

    figure: str
    total: float
    """With all causes on."""
    parts: tuple[float, ...]
    """Of each of `CAUSES`."""
    residual: float
    """With all causes off."""


def attributed(case: DriveCase, whole: PathComparison | None = None) -> tuple[DriveAttribution, ...]:
    """Run a case with ever fewer causes of error.

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
        parts = tuple(a - b for a, b in pairwise(values))
        made.append(DriveAttribution(figure, values[0], parts, values[-1]))
    return tuple(made)


def _variants(case: DriveCase) -> list[DriveCase]:
    prompt = replace(case, delay="none")
    step = 1 / 60 if case.robot == "bare" else 1 / 240
    alike = replace(prompt, reality=MobileReality.ideal(dt=step))
    placed = replace(alike, position="truth")
    if case.architecture not in SENSING:
        # It neither senses what's unknown nor avoids it.
        return [case, prompt, alike, placed, placed]
    room = case.room or operator(case.operator, case.seed, case.constants.period).room
    known = (place(room) if isinstance(room, str) else room).known() if room else ""
    return [case, prompt, alike, placed, replace(placed, room=known)]
