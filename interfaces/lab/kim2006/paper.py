"""The parts of the reproduction, in the paper's order."""

from __future__ import annotations

from typing import Final

from interfaces.lab.claims import Paper, PaperPart
from interfaces.lab.kim2006 import links, narrow, packets

PAPER: Final = Paper(
    "kim2006",
    "Kim, Suh, Kim, Oh: A novel real-time control architecture for Internet-based Thin-client robot; "
    "Simulacrum-based approach",
    (
        PaperPart.single("Variable packet size", packets.work),
        PaperPart("Path following", links.work, links.conclude, links.CASES),
        PaperPart("Narrow links", narrow.work, narrow.conclude, narrow.CASES),
    ),
    length=30.0,
)
"""As `vrs reproduce kim2006` runs it."""
