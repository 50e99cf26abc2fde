"""Runs as pictures that move within a notebook: the arm's report in 3D, a mobile robot's drive from above."""

from __future__ import annotations

import json
from html import escape
from importlib import resources
from string import Template
from typing import Any, Final

import numpy as np

from interfaces.runs.drive_run import DriveRun
from interfaces.runs.twin_run import TwinRun

MOST_SAMPLES: Final = 1200
"""Of each robot, in the picture of a drive."""


class Framed:
    """An HTML page in a frame of its own, as notebooks show what has `_repr_html_`."""

    def __init__(self, page: str, height: int) -> None:
        """Take a whole page, and the height that it's shown at [px]."""
        self.page, self.height = page, height

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self.page)}" sandbox="allow-scripts" title="Both robots" loading="lazy" '
            f'style="width: 100%; height: {self.height}px; border: 0; border-radius: 12px"></iframe>'
        )


def inline_report(run: TwinRun, *, height: int = 760) -> Framed:
    """The report of two arms, its 3D view first; it needs no network.

    Args:
        run: Both arms.
        height: Of the frame [px].
    """
    from interfaces.report.html import render
    from interfaces.runs.summary import summarize

    return Framed(render(run, summarize(run)), height)


def inline_drive(drive: DriveRun, *, height: int = 560) -> Framed:
    """Both mobile robots from above, with a play button and a slider; it needs no network.

    Args:
        drive: The run.
        height: Of the frame [px].
    """
    data = json.dumps(_drive(drive), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    text = resources.files("interfaces.report").joinpath("inline.html").read_text(encoding="utf-8")
    case = drive.case
    return Framed(Template(text).substitute(title=escape(f"{case.architecture}, {case.delay}"), data=data), height)


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
