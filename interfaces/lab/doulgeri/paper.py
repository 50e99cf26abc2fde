"""The paper: its parts, in the order of its sections."""

from __future__ import annotations

from typing import Final

from interfaces.lab.claims import Paper, Part
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
        Part.single("Fig. 1: segments", segments.work),
        Part.single("Section II-C: causality", causality.work),
        Part("Figs 4 to 6: delays", delays.work, delays.conclude, delays.CASES),
        Part.single("Section VI-B: broadcasters", broadcasting.work),
        Part("(a) jitter", jitter.work, jitter.conclude, jitter.CASES),
        Part("(b) compact encoding", encoding.work, encoding.conclude, encoding.MOTIONS),
        Part("(c) dragging the tool", dragging.work, dragging.conclude, dragging.CASES),
        Part.single("(d) interactivity", interactivity.work),
        Part("(e) virtual and real", agreement.work, agreement.conclude, agreement.CASES),
    ),
)
