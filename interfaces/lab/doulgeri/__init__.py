"""Doulgeri, Zikos, Delopoulos: *Modelling and Interfacing Remote Virtual Robots*, reproduced."""

from __future__ import annotations

from typing import Final

from interfaces.lab.claims import Paper, PaperPart
from interfaces.lab.doulgeri import (
    agreement,
    broadcasting,
    causality,
    delays,
    dragging,
    encoding,
    interactivity,
    jitter,
    segments,
)

PAPER: Final = Paper(
    "doulgeri",
    "Zoe Doulgeri, Nikos Zikos, Anastasios Delopoulos: Modelling and Interfacing Remote Virtual Robots",
    (
        PaperPart("Fig. 1: segments", segments.work),
        PaperPart("Section II-C: causality", causality.work),
        PaperPart("Figs 4 to 6: delays", delays.work, delays.conclude, delays.CASES),
        PaperPart("Section VI-B: broadcasters", broadcasting.work),
        PaperPart("(a) jitter", jitter.work, jitter.conclude, jitter.CASES),
        PaperPart("(b) compact encoding", encoding.work, encoding.conclude, encoding.MOTIONS),
        PaperPart("(c) dragging the tool", dragging.work, dragging.conclude, dragging.CASES),
        PaperPart("(d) interactivity", interactivity.work),
        PaperPart("(e) virtual and real", agreement.work, agreement.conclude, agreement.CASES),
    ),
)

__all__ = ["PAPER"]
