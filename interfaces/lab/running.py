"""Runs the parts of a paper's reproduction, in some processes at once."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from typing import Any

from interfaces.lab.claims import Findings, Paper, Reproduction, Study
from vrs.errors import InvalidValueError

MOST_WORKERS = 64
"""Processes at once, at most."""


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
    if not 1 <= workers <= MOST_WORKERS:
        raise InvalidValueError("workers", workers, f"1 to {MOST_WORKERS}")
    cases = [(i, k) for i, part in enumerate(paper.parts) for k in range(len(part.cases))]
    found: dict[tuple[int, int], Any] = {}
    if workers == 1:
        for i, k in cases:
            part = paper.parts[i]
            found[i, k] = part.work(study, part.cases[k])
            progress(part.title)
    else:
        # A fork would copy the threads of whoever shows the progress.
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, mp_context=context) as pool:
            try:
                waiting = {
                    pool.submit(paper.parts[i].work, study, paper.parts[i].cases[k]): (i, k) for i, k in cases
                }
                _collect(waiting, paper, found, progress)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for child in multiprocessing.active_children():
                    child.terminate()
                raise
    concluded = [
        part.conclude(study, tuple(found[i, k] for k in range(len(part.cases))))
        for i, part in enumerate(paper.parts)
    ]
    return Reproduction(paper, study, joined(concluded))


def _collect(
    waiting: dict[Future[Any], tuple[int, int]],
    paper: Paper,
    found: dict[tuple[int, int], Any],
    progress: Callable[[str], None],
) -> None:
    for future in as_completed(waiting):
        case = waiting[future]
        found[case] = future.result()
        progress(paper.parts[case[0]].title)


def joined(findings: Iterable[Findings]) -> Findings:
    """All findings as one, in their order."""
    parts = tuple(findings)
    return Findings(
        tuple(claim for part in parts for claim in part.claims),
        tuple(table for part in parts for table in part.tables),
        tuple(figure for part in parts for figure in part.figures),
        tuple(claim for part in parts for claim in part.timings),
    )
