"""Reports of runs, also from recordings: one HTML file that opens without a network, or a frame in a notebook."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np

from interfaces.lab.driving.output import of_drives
from interfaces.messages.recording import RunEvent
from interfaces.recording.figures import RunFigures
from interfaces.recording.figures import figures as figures_of
from interfaces.recording.recording import Recording
from interfaces.report.pages import page
from interfaces.report.plots import plots
from interfaces.report.scene import scene
from interfaces.report.tables import FIGURES, figures, receipts, shown, tiles, words
from interfaces.runs.drive_run import DriveRun
from interfaces.runs.summary import summarize
from interfaces.runs.twin_run import TwinRun
from interfaces.stream.meshcat.meshes import viewer_bundle


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
    drawn, data = plots(run), scene(run)
    return page(
        "report.html",
        title=run.session.title or "Twin run",
        facts=_facts(run, summary),
        tiles=tiles(summary),
        plots=drawn,
        figures=figures(summary),
        receipts_virtual=receipts(run.receipts_virtual),
        receipts_real=receipts(run.receipts_real),
        happened=_happened(run.events),
        licences=licences,
        data=data,
        viewer=_script(viewer),
        script=_script(_page_script(data)),
    )


def _facts(run: TwinRun, summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    order = ", then ".join(words(str(cause)) for cause in summary["attribution_order"])
    facts = {
        "robot": run.model.name,
        "delay": run.session.delay,
        "service": run.session.service,
        "offset": run.session.offset,
        "D": _span(run),
        "link loss": run.session.link_loss,
        "corrections": str(len(run.corrections)),
        "seed": str(run.session.seed or 0),
        "duration": f"{run.t[-1] - run.t[0]:.1f} s",
        "not measured": f"{run.gap_s:.1f} s" if run.gap_s > 0 else "",
        "commands": str(len(run.receipts_virtual)),
        "counterfactuals off": order,
    }
    return [(name, value) for name, value in facts.items() if value]


def _span(run: TwinRun) -> str:
    low, high = float(run.D.min()), float(run.D.max())
    text = f"{high:.3f} s" if high - low < 1e-9 else f"{high:.3f} to {low:.3f} s"
    return text.replace("-", "−")


def _happened(events: Sequence[RunEvent]) -> list[tuple[str, str, str]]:
    return [(f"{event.t:.2f} s", event.kind, event.text) for event in events]


def _page_script(data: Mapping[str, Any]) -> str:
    """The page's script; where the chain is one of screws, with the station's `Chain` for its own kinematics."""
    text = resources.files("interfaces.report").joinpath("report.js").read_text(encoding="utf-8")
    if "home" not in data:
        return text
    chain = resources.files("interfaces.station").joinpath("static/chain.js").read_text(encoding="utf-8")
    own, following = text.index("  // Column-major products"), text.index("  // Corner normals")
    links = "  const links = (q) => new Chain({ home: run.home, screws: run.chain }).links(q);\n\n"
    return chain.replace("export ", "") + text[:own] + links + text[following:]


def _script(text: str) -> str:
    """Keep a script's own strings from ending its element."""
    return re.sub(r"</(script)", r"<\\/\1", text, flags=re.IGNORECASE).replace("<!--", "<\\!--")


FACTS: Final = ("architecture", "transport", "delay", "robot", "operator", "seed")
"""What a run is, of its summary."""


def render_drive(drive: DriveRun, summary: Mapping[str, Any], events: Sequence[RunEvent]) -> str:
    """Return the report as one HTML text; equal runs give equal texts.

    Args:
        drive: The run.
        summary: Its figures, by the names of the columns of runs.csv.
        events: What else happened.
    """
    case = drive.case
    facts = [(name, str(summary[name])) for name in FACTS]
    facts.append(("duration", f"{summary['duration_s']:.1f} s"))
    if summary["gap_s"] > 0:
        facts.append(("not measured", f"{summary['gap_s']:.1f} s"))
    return page(
        "drive.html",
        title=str(summary["title"]),
        facts=facts,
        figures=[(name, shown(summary[key], scale, unit), unit) for key, name, scale, unit in FIGURES],
        pictures=of_drives({f"{case.architecture}, {case.transport}": drive}, f"{case.robot}, {case.operator}"),
        happened=_happened(events),
    )


MOST_SAMPLES: Final = 1200
"""Of each robot, in the picture of a drive."""


class Framed:
    """An HTML page in a frame of its own, as notebooks show what has `_repr_html_`."""

    def __init__(self, page: str, height: int) -> None:
        """Take a whole page, and the height that it's shown at [px]."""
        self.page, self.height = page, height

    def _repr_html_(self) -> str:
        return page("frame.html", page=self.page, height=self.height)


def inline_report(run: TwinRun, *, height: int = 760) -> Framed:
    """The report of two arms, its 3D view first; it needs no network.

    Args:
        run: Both arms.
        height: Of the frame [px].
    """
    return Framed(render(run, summarize(run)), height)


def inline_drive(drive: DriveRun, *, height: int = 560) -> Framed:
    """Both mobile robots from above, with a play button and a slider; it needs no network.

    Args:
        drive: The run.
        height: Of the frame [px].
    """
    case = drive.case
    return Framed(page("inline.html", title=f"{case.architecture}, {case.delay}", data=_drive(drive)), height)


def _drive(drive: DriveRun) -> dict[str, Any]:
    step = max(1, -(-len(drive.t) // MOST_SAMPLES))
    both = np.concatenate([drive.virtual[:, :2], drive.real[:, :2]])
    return {
        "t": np.round(drive.t[::step], 3).tolist(),
        "virtual": np.round(drive.virtual[::step], 4).tolist(),
        "real": np.round(drive.real[::step], 4).tolist(),
        "low": (both.min(axis=0) - 0.6).tolist(),
        "high": (both.max(axis=0) + 0.6).tolist(),
    }


def render_recording(recording: Recording) -> tuple[str, tuple[str, ...]]:
    """The run's report as HTML, and what isn't in the recording.

    Raises:
        FormatError: If the recording has too little of it.
    """
    found = figures_of(recording)
    if isinstance(found, RunFigures):
        return render(found.run, found.summary()), tuple(found.missing)
    return render_drive(found.run, found.summary(), recording.events), tuple(found.missing)
