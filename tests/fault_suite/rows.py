"""The table of faults: a row each, by its name on the command line."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from benchmarks import availability
from benchmarks.page import verdict
from benchmarks.results import Result, number
from tests.fault_suite import clocks, day, disks, kills, loads, parsers
from tests.fault_suite.effort import Effort


@dataclass(frozen=True, slots=True)
class Row:
    """A fault, and what tries it."""

    title: str
    text: str
    """How it's tried."""
    figures: Callable[[Effort], tuple[Result, ...]]
    """What was promised and what was seen."""
    effort: tuple[str, ...]
    """What of the effort counts."""


def _of(figures: Callable[[Effort], tuple[Result, ...]], *effort: str) -> Row:
    """A row whose function's docstring says what it is."""
    title, _, text = inspect.getdoc(figures).partition("\n\n")  # type: ignore[union-attr]
    return Row(title, " ".join(text.split()), figures, effort)


_FUNCTIONS = (
    kills.operator_killed, kills.operator_stopped, kills.client_killed, kills.client_stopped, kills.robot_killed,
    kills.robot_stopped, kills.body_killed, kills.body_stopped, kills.camera_killed, kills.recorder_killed,
    disks.recording_cut_short, disks.recording_full, disks.recording_slow, disks.files_full, disks.audit_full,
    clocks.clock_steps_and_drifts, clocks.calendar_steps,
)  # fmt: skip
_FUZZED = (
    "Mutated by bytes, numbers and lines; what reaches a new block of the parser, or is refused for a new reason, "
    "is varied further."
)
_LOADED = "`vrs serve` and its robot, and who steers every 50 ms by a WebSocket: alone, then with this beside."


def _word(name: str) -> str:
    return "_".join("".join(c if c.isalnum() else " " for c in name.lower()).split())


_BY_TIME = parsers.wire_fuzzed, parsers.rsp_fuzzed, parsers.recordings_flipped


def _rows() -> Iterator[tuple[str, Row]]:
    for figures in _FUNCTIONS:
        yield figures.__name__, _of(figures, "tries", "seed")
    for figures in _BY_TIME:
        yield figures.__name__, _of(figures, "seconds", "seed")
    for name in parsers.PARSERS:
        title, fuzzed = f"{name[0].upper()}{name[1:]} that are damaged", partial(parsers.parser_fuzzed, name)
        yield f"{_word(name)}_fuzzed", Row(title, _FUZZED, fuzzed, ("seconds", "seed"))
    for name, kind in availability.SCENARIOS.items():
        if kind:
            loaded = partial(loads.under_load, name)
            yield f"load_{_word(kind)}", Row(f"{name[0].upper()}{name[1:]}", _LOADED, loaded, ("load",))
    yield "day_of_faults", _of(day.day_of_faults, "hours", "seed")


ROWS = dict(_rows())


def tried(name: str, effort: Effort) -> dict[str, Any]:
    """A row, as JSON has it."""
    begun = time.monotonic()
    results = ROWS[name].figures(effort)
    return {"took": round(time.monotonic() - begun, 1), "results": [_fact(result) for result in results]}


def _fact(result: Result) -> dict[str, Any]:
    seen = "" if result.ours is None else f"{number(result.ours.median)} {result.unit}".rstrip()
    return {"name": result.name, "tries": result.tries, "promised": result.asked, "seen": seen,
            "holds": verdict(result), "note": result.note}  # fmt: skip
