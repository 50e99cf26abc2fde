"""Reproductions as JSON, as standalone SVG pictures that repeat byte for byte, and as tables for a reader."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from interfaces.lab.claims import (
    Cell,
    Claim,
    Counterfactual,
    Figure,
    Reproduction,
    Table,
    Verdict,
    interval_said,
    said,
)
from interfaces.runs.drive_run import DIGITS, cell
from vrs.errors import FormatError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from rich.table import Table as RichTable

INK: Final = "#1b2733"
MUTED: Final = "#5c6b7a"
LINE: Final = "#d5dce3"
VIRTUAL: Final = "#1f6fb4"
REAL: Final = "#d2691e"
BAD: Final = "#b3261e"
GOOD: Final = "#2e8540"
WIDTH: Final = 7.2
"""Of a picture [inch]."""


def draw(name: str, title: str, paint: Callable[..., None], *given: object, height: float = 3.2) -> Figure:
    """Paint a picture.

    Args:
        name: Of its file, without the ending.
        title: What it shows.
        paint: Adds axes to the canvas, its first argument, and draws in them.
        *given: What else it takes.
        height: Its height [inch].
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    style: dict[Any, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": "vrs",
        "font.family": "sans-serif",
        "font.size": 9.0,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.titlecolor": INK,
        "axes.labelcolor": MUTED,
        "axes.edgecolor": LINE,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "grid.color": LINE,
        "grid.linewidth": 0.6,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "xtick.major.size": 0.0,
        "ytick.major.size": 0.0,
        "text.color": INK,
        "legend.frameon": False,
        "lines.linewidth": 1.4,
        "path.simplify": True,
    }
    buffer = io.StringIO()
    with matplotlib.rc_context(style):
        canvas = Canvas(figsize=(WIDTH, height), layout="constrained", facecolor="white")
        FigureCanvasSVG(canvas)
        paint(canvas, *given)
        canvas.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Title": title})
    return Figure(name, title, buffer.getvalue())


def legend(ax: Axes, *, columns: int = 1, place: Any = "best") -> None:
    """A legend without a frame."""
    ax.legend(loc=place, ncols=columns, fontsize=8.0, handlelength=1.6, labelcolor=INK, borderaxespad=0.3)


TONES: Final = {Verdict.HOLDS: "green", Verdict.FAILS: "bold red", Verdict.NOT_SHOWN: "yellow"}
"""Colours of verdicts on a console."""


def measured_said(found: Claim | Counterfactual) -> str:
    """What was measured, with its interval, as it's shown."""
    ends = interval_said(found.interval)
    return f"{said(found.measured)} ({ends})" if ends else said(found.measured)


SCHEMA = "vrs-reproduction/2"


def to_json(reproduction: Reproduction) -> str:
    """The whole of it but for the pictures; the same study gives the same bytes, but for `timings`."""
    found, study = reproduction.findings, reproduction.study
    document = {
        "schema": SCHEMA,
        "paper": reproduction.paper.name,
        "citation": reproduction.paper.citation,
        "seed": study.seed,
        "runs": study.runs,
        "length_s": study.length,
        **({"body": study.body} if study.body else {}),
        "claims": [_claim(claim, claim.verdict, ours=claim.is_ours) for claim in found.claims],
        "tables": [
            {
                "name": table.name,
                "title": table.title,
                "columns": list(table.columns),
                "rows": [list(map(_value, row)) for row in table.rows],
            }
            for table in found.tables
        ],
        "figures": [{"file": f"{figure.name}.svg", "title": figure.title} for figure in found.figures],
        "timings": [_claim(bar, bar.speed_verdict, ours=True) for bar in found.timings],
        "timings_note": "measured by the clock of the machine that ran this: never the same twice",
    }
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _claim(claim: Claim, verdict: Verdict, *, ours: bool) -> dict[str, Any]:
    beside = claim.counterfactual
    return {
        "claim": claim.claim,
        "source": claim.source,
        "expected": _value(claim.expected),
        "measured": _value(claim.measured),
        "interval": _interval(claim.interval),
        "counterfactual": None if beside is None else {
            "what": beside.what,
            "measured": _value(beside.measured),
            "interval": _interval(beside.interval),
            "met": bool(beside.met),
        },
        "met": bool(claim.met),
        "verdict": verdict,
        "holds": verdict is Verdict.HOLDS,
        "ours": ours,
    }  # fmt: skip


def _interval(interval: Sequence[float] | None) -> list[Cell] | None:
    return None if interval is None else [_value(end) for end in interval]


def _value(given: Cell) -> Cell:
    """A number with as many digits as mean something; no infinity or NaN, which JSON hasn't got."""
    if not isinstance(given, float):
        return given
    return float(f"{given:.{DIGITS}g}") if math.isfinite(given) else str(given)


def write(reproduction: Reproduction, out: Path) -> Path:
    """Write PAPER.json and the pictures beside it.

    Args:
        reproduction: What to write.
        out: An existing directory.

    Returns:
        The JSON file.

    Raises:
        FormatError: If the directory can't hold them.
    """
    name = f"{reproduction.paper.name}.json"
    write_files(out, reproduction.findings.figures, {name: to_json(reproduction)})
    return out / name


def write_files(out: Path, figures: Iterable[Figure], texts: Mapping[str, str]) -> None:
    """Write pictures, and texts by the names of their files, into an existing directory.

    Raises:
        FormatError: If it can't hold them.
    """
    files = {f"{figure.name}.svg": figure.svg for figure in figures} | dict(texts)
    try:
        for name, text in files.items():
            (out / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise FormatError(str(out), f"can't hold the results: {error.strerror}") from None


def write_runs(found: Reproduction, out: Path, tables: Sequence[Table]) -> None:
    """Write summary.json, runs.csv with the rows of some tables, which have the same columns, and the pictures.

    Raises:
        FormatError: If the directory, which must exist, can't hold them.
    """
    runs = csv_of(tables[0].columns, (map(cell, row) for table in tables for row in table.rows))
    write_files(out, found.findings.figures, {"runs.csv": runs, "summary.json": to_json(found)})


def csv_of(columns: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A table as CSV, its columns' names first."""
    lines = io.StringIO()
    table = csv.writer(lines, lineterminator="\n")
    table.writerow(columns)
    table.writerows(rows)
    return lines.getvalue()


def rich_tables(reproduction: Reproduction) -> list[RichTable]:
    """The claims, a row a claim, then the other tables."""
    from rich.table import Table as RichTable

    found = reproduction.findings
    made = []
    judged = (
        ("claims", [(claim, claim.verdict) for claim in found.claims]),
        ("speed of this machine", [(bar, bar.speed_verdict) for bar in found.timings]),
    )
    for title, claims in judged:
        if not claims:
            continue
        table = RichTable(title=f"{reproduction.paper.name}: {title}", title_justify="left", show_lines=True)
        shares = {"claim": 4, "source": 2, "expected": 2, "measured": 3, "without it": 4, "verdict": 2}
        for name, share in shares.items():
            table.add_column(name, ratio=share, overflow="fold")
        for claim, verdict in claims:
            beside = claim.counterfactual
            without = "" if beside is None else f"{beside.what}: {measured_said(beside)}"
            words = claim.claim, claim.source, said(claim.expected), measured_said(claim), without
            table.add_row(*(word.replace("[", r"\[") for word in words), f"[{TONES[verdict]}]{verdict}[/]")
        made.append(table)
    for plain in found.tables:
        table = RichTable(title=plain.title.replace("[", r"\["), title_justify="left")
        for k, name in enumerate(plain.columns):
            table.add_column(name.replace("[", r"\["), justify="left" if k == 0 else "right")
        for row in plain.rows:
            table.add_row(*(said(value).replace("[", r"\[") for value in row))
        made.append(table)
    return made
