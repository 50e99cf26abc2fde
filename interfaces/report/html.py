"""The report of a run: one HTML file that opens without a network."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from interfaces.clients.appearance import viewer_bundle
from interfaces.report.markup import card, figures, receipts, table, tiles, words
from interfaces.report.plots import Plot, plots
from interfaces.report.scene import scene
from interfaces.runs.twin_run import TwinRun


def write_report(path: str | Path, run: TwinRun, summary: Mapping[str, Any]) -> None:
    """Write the report of a run; equal runs give equal bytes.

    Args:
        path: The file to write.
        run: Both twins.
        summary: Its figures, as `interfaces.runs.summary.summarize` gives them.

    Raises:
        FormatError: If the installed MeshCat has no viewer bundle.
        OSError: If the file can't be written.
    """
    Path(path).write_text(render(run, summary), encoding="utf-8", newline="\n")


def render(run: TwinRun, summary: Mapping[str, Any]) -> str:
    """Return the report as one HTML text."""
    viewer, licences = viewer_bundle()
    drawn = plots(run)
    return Template(_asset("report.html")).substitute(
        title=escape(run.title or "Twin run"),
        css=_asset("report.css"),
        facts=_facts(run, summary),
        tiles=tiles(summary),
        plots="".join(_figure(plot) for plot in drawn if not plot.is_joint),
        joints="".join(_figure(plot) for plot in drawn if plot.is_joint),
        figures=figures(summary),
        receipts=receipts("Virtual robot", run.receipts_virtual) + receipts("Real robot", run.receipts_real),
        events=_events(run),
        licences=escape(licences),
        data=_script_json(scene(run)),
        viewer=_script(viewer),
        script=_script(_asset("report.js")),
    )


def _facts(run: TwinRun, summary: Mapping[str, Any]) -> str:
    order = ", then ".join(words(str(cause)) for cause in summary.get("attribution_order", ()))
    facts = {
        "robot": run.model.name,
        "delay": run.delay,
        "service": run.service,
        "offset": run.offset,
        "D": _span(run),
        "link loss": run.link_loss,
        "corrections": str(len(run.corrections)),
        "seed": str(run.seed),
        "duration": f"{run.t[-1] - run.t[0]:.1f} s",
        "not measured": f"{run.gap_s:.1f} s" if run.gap_s > 0 else "",
        "commands": str(len(run.receipts_virtual)),
        "counterfactuals off": order,
    }
    return "".join(f"<li><span>{name}</span>{escape(value)}</li>" for name, value in facts.items() if value)


def _span(run: TwinRun) -> str:
    low, high = float(run.D.min()), float(run.D.max())
    text = f"{high:.3f} s" if high - low < 1e-9 else f"{high:.3f} to {low:.3f} s"
    return text.replace("-", "−")


def _figure(plot: Plot) -> str:
    note = f"<figcaption>{escape(plot.note)}</figcaption>" if plot.note else ""
    cursor = (
        f'<div class="cursor" hidden data-low="{plot.low!r}" data-high="{plot.high!r}" '
        f'data-left="{plot.left:.5f}" data-right="{plot.right:.5f}"></div>'
    )
    return (
        f'<figure class="card" id="plot-{plot.name}"><h3>{escape(plot.title)}</h3>'
        f'<div class="plot">{plot.svg}{cursor}</div>{note}</figure>'
    )


def _events(run: TwinRun) -> str:
    if not run.events:
        return ""
    rows = [(f"{event.t:.2f} s", event.kind, event.text) for event in run.events]
    return "<h2>Events</h2>" + card("By user time", table(("time", "kind", "what"), rows))


def _asset(name: str) -> str:
    return resources.files("interfaces.report").joinpath(name).read_text(encoding="utf-8")


def _script_json(value: object) -> str:
    """JSON that no browser takes for markup."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _script(text: str) -> str:
    """Keep a script's own strings from ending its element."""
    return re.sub(r"</(script)", r"<\\/\1", text, flags=re.IGNORECASE).replace("<!--", "<\\!--")
