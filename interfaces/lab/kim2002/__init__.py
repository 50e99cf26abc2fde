"""Kim, Han, Kim, Kim: *Internet-Based Personal Robot System using Map-Based Localization*, reproduced."""

from __future__ import annotations

from typing import Final

from interfaces.lab.claims import Paper, PaperPart
from interfaces.lab.kim2002 import scenario
from interfaces.lab.localization.accuracy import conclude_rooms, measure_room

ROOMS: Final = ("0", "1")
"""Of the localization."""

PAPER: Final = Paper(
    "kim2002",
    "Kim, Han, Kim, Kim: Internet-Based Personal Robot System using Map-Based Localization",
    (
        PaperPart(
            "The scenario",
            scenario.measure,
            scenario.conclude,
            tuple(str(k) for k in range(scenario.TOGETHER)),
            physical=True,
        ),
        PaperPart("Localization", measure_room, conclude_rooms, ROOMS),
    ),
    runs=5,
)
"""As `vrs reproduce kim2002` runs it."""

__all__ = ["PAPER"]
