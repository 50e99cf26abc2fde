"""Runs the calls of a sweep in some processes at once, here or elsewhere, in an order that doesn't show."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from typing import Any, TypeAlias, TypeVar

from interfaces.lab.claims import Findings, Paper, PaperPart, Reproduction, Study
from interfaces.lab.executors import WorkersLostError, make
from interfaces.lab.finished import FinishedRows, KeptRow, versions
from vrs.errors import InvalidValueError

MOST_WORKERS = 64
"""Processes at once, at most."""
Made = TypeVar("Made")
"""What is made of a call."""
Calls: TypeAlias = Sequence[tuple[Callable[..., Made], tuple[Any, ...]]]
"""Functions, and the arguments of each."""


Workers: TypeAlias = int | Executor
"""Processes at once, 1 to 64, of which one is this one; or an executor, on other machines perhaps."""


def _as_made(
    calls: Calls[Made], workers: Workers, finished: FinishedRows | None = None
) -> Iterator[tuple[int, KeptRow, bool]]:
    """Make calls, some at once; yield the place of each, what came of it, and whether it was made now.

    Args:
        calls: Functions of modules, and their arguments.
        workers: Who makes them.
        finished: Where calls are kept; what is there already comes first.

    Raises:
        InvalidValueError: If there are too few or too many workers.
        WorkersLostError: If whoever makes them is gone.
        WorkerVersionError: If somebody else's worker has another version of this program, or none.
    """
    if isinstance(workers, int) and not 1 <= workers <= MOST_WORKERS:
        raise InvalidValueError("workers", workers, f"1 to {MOST_WORKERS}")
    left = []
    for k, call in enumerate(calls):
        row = None if finished is None else finished.find(*call)
        if finished is None or row is None:
            left.append(k)
        else:
            finished.note(call[0], k, row)
            yield k, row, False
    for k, row in _made({k: calls[k] for k in left}, workers):
        if finished is not None:
            finished.keep(*calls[k], row)
            finished.note(calls[k][0], k, row)
        yield k, row, True


def _made(
    calls: dict[int, tuple[Callable[..., Any], tuple[Any, ...]]], workers: Workers
) -> Iterator[tuple[int, KeptRow]]:
    """Make calls; yield what comes of each, by its place, when it's done."""
    if workers == 1:
        for k, call in calls.items():
            yield k, make({}, *call)
    elif isinstance(workers, Executor):
        yield from _submitted(calls, workers, versions())
    elif calls:
        # A fork would copy the threads of whoever shows the progress.
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent) as pool:
            try:
                yield from _submitted(calls, pool, {})
            except BrokenProcessPool:
                raise WorkersLostError("a worker process was killed") from None
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for child in multiprocessing.active_children():
                    child.terminate()
                raise


def _submitted(
    calls: dict[int, tuple[Callable[..., Any], tuple[Any, ...]]], pool: Executor, expected: dict[str, str]
) -> Iterator[tuple[int, KeptRow]]:
    waiting = {pool.submit(make, expected, *call): k for k, call in calls.items()}
    for future in as_completed(waiting):
        yield waiting.pop(future), future.result()


def pooled(
    calls: Calls[Made],
    *,
    workers: Workers = 1,
    finished: FinishedRows | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> list[Made]:
    """Make calls, some at once; return what they return, in the order of the calls.

    Args:
        calls: Functions of modules, and their arguments.
        workers: Who makes them; what they return doesn't depend on it.
        finished: Where finished ones are kept, and looked for first.
        progress: Told the place of each call that is made now.

    Raises:
        InvalidValueError: If there are too few or too many workers.
        WorkersLostError: If whoever makes them is gone.
        WorkerVersionError: If somebody else's worker has another version of this program, or none.
    """
    return [row.value for row in pooled_rows(calls, workers=workers, finished=finished, progress=progress)]


def pooled_rows(
    calls: Calls[Any],
    *,
    workers: Workers = 1,
    finished: FinishedRows | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> list[KeptRow]:
    """The same as `pooled`, with the machine on which each was made."""
    made: dict[int, KeptRow] = {}
    for place, row, is_new in _as_made(calls, workers, finished):
        made[place] = row
        if is_new:
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
    paper: Paper, study: Study, *, workers: Workers = 1, progress: Callable[[str], None] = lambda _: None
) -> Reproduction:
    """Measure every claim of a paper.

    Args:
        paper: What to reproduce.
        study: How much to measure.
        workers: Who measures; what is found doesn't depend on it.
        progress: Told the title of the part each time a case of it is done.

    Raises:
        InvalidValueError: If there are too few or too many workers.
    """
    (made,) = reproductions([(paper, study)], workers=workers, progress=lambda part: progress(part.title))
    return made


def calls_of(part: PaperPart, study: Study) -> list[tuple[Callable[..., Any], tuple[Any, ...]]]:
    """The calls that measure a part of a paper, a case each."""
    return [(part.work, (study, case)) for case in part.cases]


def reproductions(
    chosen: Sequence[tuple[Paper, Study]],
    *,
    workers: Workers = 1,
    finished: FinishedRows | None = None,
    progress: Callable[[PaperPart], None],
) -> Iterator[Reproduction]:
    """Measure every claim of some papers; yield each of them, in their order, when all of its cases are done.

    All cases are in one queue: while one paper's last cases are measured, and while it's concluded, written and
    shown, the other workers go on with the next paper.

    Args:
        chosen: What to reproduce, and how much to measure.
        workers: Who measures; what is found doesn't depend on it, but for the machine's speed.
        finished: Where finished cases are kept, and looked for first.
        progress: Told the part each time a case of it is done now.

    Raises:
        InvalidValueError: If there are too few or too many workers.
        WorkersLostError: If whoever measures is gone.
        WorkerVersionError: If somebody else's worker has another version of this program, or none.
    """
    cases = [(part, call) for paper, study in chosen for part in paper.parts for call in calls_of(part, study)]
    results = _as_made([call for _, call in cases], workers, finished)
    made: dict[int, Any] = {}
    first = 0
    for paper, study in chosen:
        end = first + sum(len(part.cases) for part in paper.parts)
        places, first = range(first, end), end
        while not made.keys() >= set(places):
            place, row, is_new = next(results)
            made[place] = row.value
            if is_new:
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
