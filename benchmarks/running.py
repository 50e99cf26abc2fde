"""Runs benchmarks, each in a fresh process: what one left in memory can't slow the next."""

from __future__ import annotations

import importlib
import statistics
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

from benchmarks import page
from benchmarks.results import Part
from benchmarks.timing import yardstick


def measured(name: str) -> Part:
    """What one benchmark finds."""
    before = yardstick()
    part: Part = importlib.import_module(f"benchmarks.{name}").part()
    return replace(part, pace=statistics.median(before + yardstick()))


def run(names: list[str]) -> dict[str, Part | str]:
    """Carry out benchmarks in turn and print each as it's done.

    Returns:
        What each found, or why it failed.
    """
    found: dict[str, Part | str] = {}
    for name in names:
        start = time.monotonic()
        with ProcessPoolExecutor(1, get_context("spawn")) as process:
            future = process.submit(measured, name)
            error = future.exception()
        if error is None:
            found[name] = part = future.result()
            print(page.terminal(part))
        else:
            found[name] = f"{type(error).__name__}: {error}"
            print(f"== {name} failed: {found[name]}")
        print(f"   {name}: {time.monotonic() - start:.0f} s\n", flush=True)
    return found
