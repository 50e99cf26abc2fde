"""Runs the parts of a paper's reproduction in some processes at once, in an order that doesn't show."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import islice
from typing import Any, TypeAlias, TypeVar

from interfaces.lab.claims import Findings, Paper, Reproduction, Study
from vrs.errors import InvalidValueError

MOST_WORKERS = 64
"""Processes at once, at most."""
Made = TypeVar("Made")
"""What is made of a call."""
Calls: TypeAlias = Sequence[tuple[Callable[..., Made], tuple[Any, ...]]]
"""Functions, and the arguments of each."""


def pooled(
    calls: Calls[Made],
    *,
    workers: int = 1,
    progress: Callable[[int], None] = lambda _: None,
) -> list[Made]:
    """Make calls, some at once.

    Args:
        calls: Functions of modules, and their arguments.
        workers: Processes at once, 1 to 64; with one, this one.
        progress: Told the place of each call that is done.

    Returns:
        What they return, in the order of the calls.

    Raises:
        InvalidValueError: If there are too few or too many workers.
    """
    if not 1 <= workers <= MOST_WORKERS:
        raise InvalidValueError("workers", workers, f"1 to {MOST_WORKERS}")
    made: dict[int, Made] = {}
    if workers == 1:
        for k, (work, given) in enumerate(calls):
            made[k] = work(*given)
            progress(k)
        return list(made.values())
    # A fork would copy the threads of whoever shows the progress.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent) as pool:
        try:
            waiting = {pool.submit(work, *given): k for k, (work, given) in enumerate(calls)}
            for future in as_completed(waiting):
                made[waiting[future]] = future.result()
                progress(waiting[future])
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise
    return [made[k] for k in range(len(calls))]


def _end_with_parent() -> None:
    """Let a worker not outlive who began it, who tells nobody when he is killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:

        def watch() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()


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
    cases = [(part, case) for part in paper.parts for case in part.cases]
    calls = [(part.work, (study, case)) for part, case in cases]
    found = iter(pooled(calls, workers=workers, progress=lambda place: progress(cases[place][0].title)))
    concluded = [part.conclude(study, tuple(islice(found, len(part.cases)))) for part in paper.parts]
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
