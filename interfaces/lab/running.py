"""Runs the parts of a paper's reproduction, in some processes at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from interfaces.lab.claims import Findings, Paper, Reproduction, Study
from interfaces.lab.pool import pooled


def reproduce(
    paper: Paper, study: Study, *, workers: int = 1, progress: Callable[[str], None] = lambda _: None
) -> Reproduction:
    """Measure every claim of a paper.

    Args:
        paper: What to reproduce.
        study: How much to measure.
        workers: Processes at once, 1 to 64; what is found doesn't depend on it.
        progress: Told the title of the part each time a case of it is done.

    Raises:
        InvalidValueError: If there are too few or too many workers.
    """
    cases = [(i, k) for i, part in enumerate(paper.parts) for k in range(len(part.cases))]
    made = pooled(
        [(paper.parts[i].work, (study, paper.parts[i].cases[k])) for i, k in cases],
        workers=workers,
        progress=lambda place: progress(paper.parts[cases[place][0]].title),
    )
    found = dict(zip(cases, made, strict=True))
    concluded = [
        part.conclude(study, tuple(found[i, k] for k in range(len(part.cases))))
        for i, part in enumerate(paper.parts)
    ]
    return Reproduction(paper, study, joined(concluded))


def joined(findings: Iterable[Findings]) -> Findings:
    """All findings as one, in their order."""
    parts = tuple(findings)
    return Findings(
        tuple(claim for part in parts for claim in part.claims),
        tuple(table for part in parts for table in part.tables),
        tuple(figure for part in parts for figure in part.figures),
        tuple(claim for part in parts for claim in part.timings),
    )
