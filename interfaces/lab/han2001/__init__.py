"""Han, Kim, Kim, Kim: *Internet Control Architecture for Internet-Based Personal Robot*, reproduced."""

from __future__ import annotations

from typing import Final

from interfaces.lab.claims import Paper, PaperPart
from interfaces.lab.han2001 import architectures, delays, environment, information, operator_view

PAPER: Final = Paper(
    "han2001",
    "Han, Kim, Kim, Kim: Internet Control Architecture for Internet-Based Personal Robot, "
    "Autonomous Robots 10, 2001",
    (
        PaperPart("Delays", delays.work),
        PaperPart("Information loss", information.work),
        PaperPart("Command filter", information.work_filter),
        PaperPart("Architectures", architectures.work, architectures.conclude, architectures.CASES, physical=True),
        PaperPart("Posture estimator", operator_view.work, operator_view.conclude, operator_view.CASES),
        PaperPart("Virtual environment", environment.work, environment.conclude, tuple(environment.CASES)),
    ),
    length=120.0,
)
"""As `vrs reproduce han2001` runs it."""

__all__ = ["PAPER"]
