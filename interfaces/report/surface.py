"""The page of a design sweep: which architecture wins where, with intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from interfaces.lab.driving.design import AXES, Place, surface
from interfaces.lab.driving.output import COMPARED
from interfaces.report.pages import page
from interfaces.report.tables import FIGURES
from interfaces.system import written

PAGE: Final = "sweep.html"
COLOURS: Final = 6
"""Architectures that are told apart by colour."""


class Sheet(NamedTuple):
    """The surface of one figure."""

    title: str
    scale: float
    """What the figure is multiplied by to be in its unit."""
    unit: str
    rows: tuple[tuple[str, tuple[Place | None, ...]], ...]
    """A row a delay."""
    wins: tuple[tuple[str, int], ...]
    """Places that each architecture wins, and those that none does (an empty name)."""


def _sheet(found: Mapping[str, Any], metric: str, columns: list[tuple[str, ...]]) -> Sheet:
    _, title, scale, unit = next(figure for figure in FIGURES if figure[0] == metric)
    places = {place.key: place for place in surface(found, metric)}
    delays = dict.fromkeys(key[0] for key in places)
    wins = Counter(place.winner for place in places.values())
    rows = tuple((delay, tuple(places.get((delay, *column)) for column in columns)) for delay in delays)
    names = (*found["settings"]["architectures"], "")
    return Sheet(title, scale, unit, rows, tuple((name, wins[name]) for name in names if wins[name]))


def render_sweep(found: Mapping[str, Any]) -> str:
    """The page as one HTML text; equal summaries give equal texts.

    Args:
        found: The sweep's summary.
    """
    settings = found["settings"]
    columns = list(dict.fromkeys(tuple(group[name] for name in AXES[1:]) for group in found["groups"]))
    varying = [k for k in range(len(AXES) - 1) if len({column[k] for column in columns}) > 1]
    heads = [", ".join(column[k] for k in varying) for column in columns]
    facts = [(name, columns[0][k]) for k, name in enumerate(AXES[1:]) if k not in varying]
    facts += [("seeds", str(settings["runs"])), ("length", f"{settings['length_s']:g} s")]
    facts += [("position", settings["position"]), ("runs", f"{sum(one['runs'] for one in found['groups']):,}")]
    return page(
        "sweep.html",
        title="Which architecture wins where",
        facts=facts,
        heads=heads,
        sheets=[_sheet(found, metric, columns) for metric in COMPARED],
        colours={"": 0} | {name: k % COLOURS + 1 for k, name in enumerate(settings["architectures"])},
    )


def write_sweep(found: Mapping[str, Any], out: Path) -> Path:
    """Write the page into an existing directory.

    Raises:
        FormatError: If the directory can't hold it.
    """
    with written(out, "can't hold the results"):
        (out / PAGE).write_text(render_sweep(found), encoding="utf-8", newline="\n")
    return out / PAGE
