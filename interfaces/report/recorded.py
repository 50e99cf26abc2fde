"""The figures and the report of a run, from its recording alone."""

from __future__ import annotations

from typing import Any

from interfaces.recording import figures
from interfaces.recording.recording import Recording
from interfaces.report import drive, html
from interfaces.runs.summary import summarize


def summary(recording: Recording) -> dict[str, Any]:
    """The run's figures, with a list `missing` where something is.

    Raises:
        FormatError: If the recording has too little of it.
    """
    return figures.summary(recording) if recording.session.drive is None else figures.drive_summary(recording)


def render(recording: Recording) -> tuple[str, tuple[str, ...]]:
    """The run's report as HTML, and what isn't in the recording.

    Raises:
        FormatError: If the recording has too little of it.
    """
    if recording.session.drive is None:
        arm = figures.figures(recording)
        return html.render(arm.run, summarize(arm.run, arm.attributions, arm.offsets)), arm.missing
    found = figures.driven(recording)
    return drive.render(found.drive, figures.figures_of(recording, found), recording.events), found.missing
