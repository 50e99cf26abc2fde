"""Kim, Suh, Kim, Oh: *Internet-based Thin-client robot; Simulacrum-based approach*, reproduced."""

from __future__ import annotations

from typing import Final

from interfaces.lab.claims import Paper, PaperPart
from interfaces.lab.kim2006 import causes, links, packets

PAPER: Final = Paper(
    "kim2006",
    "Kim, Suh, Kim, Oh: A novel real-time control architecture for Internet-based Thin-client robot; "
    "Simulacrum-based approach",
    (
        PaperPart("Variable packet size", packets.work),
        PaperPart("Path following", links.work, links.conclude, links.CASES),
        PaperPart("Causes", causes.work, causes.conclude, causes.CASES),
        PaperPart("Size alone", links.work_sizes, links.conclude_sizes, links.SIZE_CASES),
        PaperPart("Narrow links", links.work_narrow, links.conclude_narrow, links.NARROW_CASES),
    ),
    length=30.0,
)
"""As `vrs reproduce kim2006` runs it."""

__all__ = ["PAPER"]
