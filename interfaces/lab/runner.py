"""Runs the parts of a paper's reproduction in some processes at once, in an order that doesn't show."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import islice
from typing import Any, TypeAlias, TypeVar

from interfaces.lab.claims import Findings, Paper, PaperPart, Reproduction, Study
from vrs.errors import InvalidValueError

MOST_WORKERS = 64
"""Processes at once, at most."""
Made = TypeVar("Made")
"""What is made of a call."""
Calls: TypeAlias = Sequence[tuple[Callable[..., Made], tuple[Any, ...]]]
"""Functions, and the arguments of each."""


def _as_made(calls: Calls[Made], workers: int) -> Iterator[tuple[int, Made]]:
    """Make calls, some at once; yield the place of each, and what it returns, when it's done.

    Args:
        calls: Functions of modules, and their arguments.
        workers: Processes at once, 1 to 64; with one, this one.

    Raises:
        InvalidValueError: If there are too few or too many workers.
    """
    if not 1 <= workers <= MOST_WORKERS:
        raise InvalidValueError("workers", workers, f"1 to {MOST_WORKERS}")
    if workers == 1:
        for k, (work, given) in enumerate(calls):
            yield k, work(*given)
        return
    # A fork would copy the threads of whoever shows the progress.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent) as pool:
        try:
            waiting = {pool.submit(work, *given): k for k, (work, given) in enumerate(calls)}
            for future in as_completed(waiting):
                yield waiting.pop(future), future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise


def pooled(calls: Calls[Made], *, workers: int = 1, progress: Callable[[int], None] = lambda _: None) -> list[Made]:
    """Make calls, some at once; return what they return, in the order of the calls.

    Args:
        calls: Functions of modules, and their arguments.
        workers: Processes at once, 1 to 64; with one, this one.
        progress: Told the place of each call that is done.

    Raises:
        InvalidValueError: If there are too few or too many workers.
    """
    made: dict[int, Made] = {}
    for place, one in _as_made(calls, workers):
        made[place] = one
        progress(place)
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
    (made,) = reproductions([(paper, study)], workers=workers, progress=lambda part: progress(part.title))
    return made


def reproductions(
    chosen: Sequence[tuple[Paper, Study]], *, workers: int = 1, progress: Callable[[PaperPart], None]
) -> Iterator[Reproduction]:
    """Measure every claim of some papers; yield each of them, in their order, when all of its cases are done.

    All cases are in one queue: while one paper's last cases are measured, and while it's concluded, written and
    shown, the other workers go on with the next paper.

    Args:
        chosen: What to reproduce, and how much to measure.
        workers: Processes at once, 1 to 64; what is found doesn't depend on it.
        progress: Told the part each time a case of it is done.

    Raises:
        InvalidValueError: If there are too few or too many workers.
    """
    cases = [(part, (study, case)) for paper, study in chosen for part in paper.parts for case in part.cases]
    results = _as_made([(part.work, given) for part, given in cases], workers)
    made: dict[int, Any] = {}
    first = 0
    for paper, study in chosen:
        end = first + sum(len(part.cases) for part in paper.parts)
        places, first = range(first, end), end
        while not made.keys() >= set(places):
            place, one = next(results)
            made[place] = one
            progress(cases[place][0])
        found = map(made.pop, places)
        concluded = [part.conclude(study, tuple(islice(found, len(part.cases)))) for part in paper.parts]
        yield Reproduction(paper, study, joined(concluded))


def joined(findings: Iterable[Findings]) -> Findings:
    """All findings as one, in their order."""
    parts = tuple(findings)
    return Findings(
        tuple(claim for part in parts for claim in part.claims),
        tuple(table for part in parts for table in part.tables),
        tuple(figure for part in parts for figure in part.figures),
        tuple(claim for part in parts for claim in part.timings),
    )
