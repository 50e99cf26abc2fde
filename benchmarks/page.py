"""A run as a page, as JSON and on the terminal."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path

from benchmarks.plots import draw
from benchmarks.results import NOT_INSTALLED, Cost, Part, Result, number

PAGE = "RESULTS.md"
DATA = "results.json"
VERDICTS = {True: "yes", False: "**no**", None: ""}
HEAD = ("what", "unit", "asked", "vrs median", "vrs p99", "peer", "its median", "its p99", "ratio", "holds")
RIGHT = {3, 4, 6, 7, 8}
TIMES = {"µs", "ms"}

Run = Mapping[str, Part | str]
"""What each benchmark found, by its name; where it failed, why."""


def verdict(result: Result) -> str:
    """Whether a result holds, in a word."""
    if result.holds is None and result.asked:
        return "can't say"
    return VERDICTS[result.holds]


def cells(result: Result) -> list[str]:
    """A row of the table."""
    missing = bool(result.peer) and result.theirs is None
    return [
        result.name,
        result.unit,
        result.asked,
        *_figures(result.ours),
        result.peer,
        *((NOT_INSTALLED, "") if missing else _figures(result.theirs)),
        "" if result.ratio is None else f"{result.ratio:.2f}",
        verdict(result),
    ]


def _figures(cost: Cost | None) -> tuple[str, str]:
    if cost is None:
        return "", ""
    return number(cost.median), "" if cost.p99 is None else number(cost.p99)


def terminal(part: Part) -> str:
    """A part for the terminal."""
    rows = [list(HEAD), *(cells(result) for result in part.results)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEAD))]
    lines = [f"== {part.title}"]
    for row, result in zip(rows, (None, *part.results), strict=True):
        padded = [
            cell.rjust(width) if i in RIGHT else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        note = f"  ({result.note})" if result is not None and result.note else ""
        lines.append("  ".join(padded).rstrip() + note)
    return "\n".join([*lines, f"   the yardstick took {part.pace:.0f} µs"])


def write(run: Run, facts: Mapping[str, str], minutes: float, folder: Path) -> Path:
    """Write the page, its plots and its JSON twin; return the page's path."""
    page = folder / PAGE
    quietest = min((part.pace for part in run.values() if isinstance(part, Part)), default=1.0)
    lines = [
        "# What things cost",
        "",
        "Written by `make bench` (`python -m benchmarks --write`); don't edit it. Ours and the peers take turns in "
        "one run, on one machine, so the ratios count and not the times. Times are processor time of the one "
        "thread that works, as others may use the machine too; 99th percentiles of calls under 50 µs are "
        "wall time. Medians are those of blocks or of commands. A ratio is the peer's time over ours: above 1, "
        "ours is the faster. A busy machine also slows processor time, through its caches: each part says how many "
        "times as long as in the quietest part a fixed calculation took.",
        "",
        *_summary(run, quietest),
        *_machine(facts, minutes),
    ]
    for name, part in run.items():
        lines += _section(name, part, folder, quietest)
    page.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    (folder / DATA).write_text(_json(run, facts), encoding="utf-8")
    return page


def _summary(run: Run, quietest: float) -> list[str]:
    judged = [
        (part, result) for part in run.values() if isinstance(part, Part) for result in part.results if result.asked
    ]
    held = sum(result.holds is True for _, result in judged)
    lines = [f"**{held} of the {len(judged)} figures that are asked for hold.**"]
    for part, result in judged:
        if result.holds is not True:
            peer = f" beside {result.peer}" if result.peer else ""
            what = f"{part.title}, {result.name}{peer if result.bar.ratio else ''}: asked {result.asked}"
            if result.holds is None:
                lines.append(f"- Can't say: {what}; {result.peer} isn't installed.")
            else:
                pace = f" at the machine's pace {part.pace / quietest:.2f}" if result.unit in TIMES else ""
                lines.append(f"- Missed: {what}, measured {_measured(result)}{pace}.")
    lines += [f"- Failed: `{name}`: {reason}" for name, reason in run.items() if isinstance(reason, str)]
    return [*lines, ""]


def _measured(result: Result) -> str:
    """The figures that the bar is about."""
    bar, figures = result.bar, []
    if bar.median is not None and result.ours is not None:
        figures.append(number(result.ours.median))
    if bar.p99 is not None and result.ours is not None and result.ours.p99 is not None:
        figures.append(f"p99 {number(result.ours.p99)}")
    if bar.ratio is not None and result.ratio is not None:
        figures.append(f"ratio {result.ratio:.2f}")
    return ", ".join(figures)


def _machine(facts: Mapping[str, str], minutes: float) -> list[str]:
    rows = [f"| {name} | {value} |" for name, value in (*facts.items(), ("the run took", f"{minutes:.1f} minutes"))]
    return ["| machine and versions | |", "|---|---|", *rows, ""]


def _section(name: str, part: Part | str, folder: Path, quietest: float) -> list[str]:
    if isinstance(part, str):
        return [f"## {name}", "", f"Failed: {part}", ""]
    repeat = f"Repeat: `.venv/bin/python -m benchmarks {name}`. The machine's pace: {part.pace / quietest:.2f}."
    lines = [f"## {part.title}", "", part.text, "", repeat, ""]
    lines.append("| " + " | ".join(HEAD) + " |")
    lines.append("|" + "|".join("--:" if i in RIGHT else "---" for i in range(len(HEAD))) + "|")
    notes: dict[str, int] = {}
    for result in part.results:
        row = cells(result)
        if result.note:
            row[0] += f" [{notes.setdefault(result.note, len(notes) + 1)}]"
        lines.append("| " + " | ".join(row) + " |")
    lines.append("")
    lines += [f"[{mark}] {note}  " for note, mark in notes.items()] + ([""] if notes else [])
    for chart in part.charts:
        lines += [f"![{chart.title}]({draw(chart, folder).name})", ""]
    return lines


def _json(run: Run, facts: Mapping[str, str]) -> str:
    parts: dict[str, object] = {}
    for name, part in run.items():
        if isinstance(part, str):
            parts[name] = {"failed": part}
            continue
        rows = [
            {**dataclasses.asdict(result), "asked": result.asked, "holds": result.holds} for result in part.results
        ]
        for row in rows:
            del row["bar"]
        parts[name] = {"title": part.title, "pace_us": part.pace, "results": rows}
    return json.dumps({"facts": dict(facts), "parts": parts}, indent=1, ensure_ascii=False) + "\n"
