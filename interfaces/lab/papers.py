"""The papers that can be reproduced, by name."""

from __future__ import annotations

from interfaces.lab.claims import Paper
from interfaces.lab.doulgeri import PAPER as DOULGERI
from interfaces.lab.han2001 import PAPER as HAN2001
from interfaces.lab.kim2002 import PAPER as KIM2002
from interfaces.lab.kim2006 import PAPER as KIM2006
from interfaces.lab.tipsuwan import PAPER as TIPSUWAN
from vrs.checks import one_of

PAPERS: dict[str, Paper] = {paper.name: paper for paper in (DOULGERI, HAN2001, KIM2002, KIM2006, TIPSUWAN)}
"""By the name that the command line uses."""

ALL = "all"
"""Stands for every paper there is."""


def papers(name: str) -> tuple[Paper, ...]:
    """The paper of a name, or all of them.

    Raises:
        InvalidValueError: If no paper has that name.
    """
    if name == ALL:
        return tuple(PAPERS.values())
    return (PAPERS[one_of("paper", name, (*PAPERS, ALL))],)
