"""Sweeps on a Dask scheduler: overhead, what a second worker is worth, and what the scheduler costs a run.

A scheduler and its workers are processes here, on loopback, and share this machine's cores with the client. Blocks
of runs are made in turn by this process, by one worker and by two, so that whatever else the machine does is in all
of them; what counts are ratios within a block.
"""

from __future__ import annotations

import os
import pickle
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np

from interfaces.lab.driving.sweep import measure
from interfaces.lab.executors import executor, make
from interfaces.lab.finished import FinishedRows
from interfaces.lab.runner import Workers, pooled_rows
from interfaces.runs.drive_run import DriveCase
from tests.interfaces.lab.cluster import Cluster, cluster

BLOCKS, EACH, LENGTH = 10, 20, 8.0
"""Blocks, runs a block, and for how long the operator drives in each [s]."""
COUNTS: Final = (500, 1000, 2000, 4000)
"""Calls that do nothing, to see what each costs."""
MANY: Final = 1000
"""Workers that there might be."""
TICK: Final = os.sysconf("SC_CLK_TCK")


def nothing(_: int) -> None:
    """Cost nothing but being asked for."""


def _cases(block: int) -> list[tuple[Callable[..., Any], tuple[Any, ...]]]:
    seeds = range(block * EACH, (block + 1) * EACH)
    return [(measure, (DriveCase("timeline", delay="thu", robot="bare", seed=k, length=LENGTH),)) for k in seeds]


def _seconds(calls: Sequence[Any], workers: Workers, folder: Path) -> float:
    begun = time.perf_counter()
    pooled_rows(calls, workers=workers, finished=FinishedRows(folder, resume=False))
    return time.perf_counter() - begun


def _processor_time(pid: int) -> float:
    """Of a process so far [s]."""
    words = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / TICK


def _slopes(made: Cluster, who: Workers, folder: Path) -> dict[str, float]:
    """What a call costs, by who pays [s]: a line through runs of several sizes."""
    found: dict[str, list[float]] = {"wall": [], "scheduler": [], "client": [], "client, kept": []}
    for count in COUNTS:
        calls = [(nothing, (k,)) for k in range(count)]
        before = _processor_time(made.scheduler.pid), time.process_time(), time.perf_counter()
        pooled_rows(calls, workers=who)
        after = _processor_time(made.scheduler.pid), time.process_time(), time.perf_counter()
        for name, a, b in zip(("scheduler", "client", "wall"), before, after, strict=True):
            found[name].append(b - a)
        begun = time.process_time()
        pooled_rows(calls, workers=who, finished=FinishedRows(folder, resume=False))
        found["client, kept"].append(time.process_time() - begun)
    return {name: float(np.polyfit(COUNTS, values, 1)[0]) for name, values in found.items()}


def main() -> None:
    """Measure and print."""
    print(f"load {os.getloadavg()[0]:.1f} at the start, {len(os.sched_getaffinity(0))} cores")
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        place = Path(name)
        who: dict[str, Workers] = {"here": 1}
        clusters = []
        for count in (1, 2):
            (place / str(count)).mkdir()
            clusters.append(stack.enter_context(cluster(place / str(count), count)))
            begun = time.perf_counter()
            pool = stack.enter_context(executor(clusters[-1].address))
            who[str(count)] = pool
            print(f"connected and compared with {count}: {time.perf_counter() - begun:.1f} s")
            # What loads late is loaded, before anything is measured.
            pooled_rows(_cases(0)[: 4 * count], workers=pool)
        pooled_rows(_cases(0)[:4])
        took: dict[str, list[float]] = {key: [] for key in who}
        for block in range(BLOCKS):
            for key, workers in who.items():
                took[key].append(_seconds(_cases(block), workers, place / f"rows-{key}"))
        here, one, two = (np.array(took[key]) for key in who)
        whole = 100 * (one.sum() / here.sum() - 1)
        print(f"{BLOCKS * EACH} runs of {here.sum() / BLOCKS / EACH * 1e3:.0f} ms each here")
        print(f"one worker's overhead: {100 * median(one / here - 1):.1f} % by block, {whole:.1f} % of the whole")
        print(f"two workers are {median(one / two):.2f} × one by block, {one.sum() / two.sum():.2f} × of the whole")
        row = make({}, *_cases(0)[0])
        size = len(pickle.dumps(row))
        slopes = _slopes(clusters[1], who["2"], place / "nothing")
        for payer, cost in slopes.items():
            print(f"a call costs {1e3 * cost:.2f} ms: {payer}")
        busiest = max(slopes["scheduler"], slopes["client, kept"])
        print(f"{MANY} workers are kept busy by runs of {MANY * busiest:.1f} s or more, one core for who pays most")
        print(f"a result has {size} bytes: {size / busiest / 1e6:.2f} MB/s then")
    print(f"load {os.getloadavg()[0]:.1f} at the end")
