"""The report of a mobile robot's run: one HTML file that opens without a network, without a script."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from string import Template
from typing import Any, Final

from interfaces.lab.claims import Figure
from interfaces.lab.driving.pictures import of_drives
from interfaces.report.driven import FIGURES, shown
from interfaces.report.markup import card, table
from interfaces.runs.drive_run import DriveRun
from interfaces.runs.twin_run import RunEvent

FACTS: Final = ("architecture", "transport", "delay", "robot", "operator", "seed")
"""What a run is, of its summary."""


def render(drive: DriveRun, summary: Mapping[str, Any], events: Sequence[RunEvent]) -> str:
    """Return the report as one HTML text; equal runs give equal texts.

    Args:
        drive: The run.
        summary: Its figures, by the names of the columns of runs.csv.
        events: What else happened.
    """
    case = drive.case
    rows = [(name, shown(summary[key], scale, unit), unit) for key, name, scale, unit in FIGURES]
    facts = "".join(f"<li><span>{name}</span>{escape(str(summary[name]))}</li>" for name in FACTS)
    facts += f"<li><span>duration</span>{summary['duration_s']:.1f} s</li>"
    if summary["gap_s"] > 0:
        facts += f"<li><span>not measured</span>{summary['gap_s']:.1f} s</li>"
    drawn = of_drives({f"{case.architecture}, {case.transport}": drive}, f"{case.robot}, {case.operator}")
    happened = [(f"{event.t:.2f} s", event.kind, event.text) for event in events]
    return Template(_asset("drive.html")).substitute(
        title=escape(str(summary["title"])),
        css=_asset("report.css"),
        facts=facts,
        figures=card("By the definitions of docs/lab.md", table(("", "value", "unit"), rows)),
        pictures="".join(_picture(figure) for figure in drawn),
        events="<h2>Events</h2>" + card("By time", table(("time", "kind", "what"), happened)) if happened else "",
    )


def _picture(figure: Figure) -> str:
    data = base64.b64encode(figure.svg.encode("utf-8")).decode("ascii")
    image = f'<img alt="{escape(figure.title)}" src="data:image/svg+xml;base64,{data}">'
    return f'<figure class="card picture">{image}</figure>'


def _asset(name: str) -> str:
    return resources.files("interfaces.report").joinpath(name).read_text(encoding="utf-8")
