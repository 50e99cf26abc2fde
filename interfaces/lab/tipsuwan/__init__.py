"""Tipsuwan, Chow: *Model Predictive Path Tracking via Middleware for Networked Mobile Robot over IP Network*."""

from __future__ import annotations

from typing import Final

from interfaces.lab.claims import Paper, PaperPart
from interfaces.lab.tipsuwan import extent, gain, success, wrapping

PAPER: Final = Paper(
    "tipsuwan",
    "Tipsuwan, Chow: Model Predictive Path Tracking via Middleware for Networked Mobile Robot over IP Network",
    (
        PaperPart("Gain", gain.work),
        PaperPart("Controllers", wrapping.work, wrapping.conclude, wrapping.CASES, physical=True),
        PaperPart("Success", success.work, success.conclude, success.CASES, physical=True),
        PaperPart("Shorter paths", success.work_shorter, success.conclude_shorter, success.SHORTER_CASES),
        PaperPart("Where it stops", extent.work, extent.conclude, extent.CASES),
    ),
    length=15.0,
)
"""As `vrs reproduce tipsuwan` runs it."""

__all__ = ["PAPER"]
