"""The figures and the report of a run, from its recording alone."""

from __future__ import annotations

from typing import Any

from interfaces.recording import figures as arms
from interfaces.recording.driving import figures as drives
from interfaces.recording.recording import Recording
from interfaces.report import drive, html
from interfaces.runs.summary import summarize


def summary(recording: Recording) -> dict[str, Any]:
    """The run's figures, with a list `missing` where something is.

    Raises:
        FormatError: If the recording has too little of it.
    """
    return arms.summary(recording) if recording.session.drive is None else drives.summary(recording)


def render(recording: Recording) -> tuple[str, tuple[str, ...]]:
    """The run's report as HTML, and what isn't in the recording.

    Raises:
        FormatError: If the recording has too little of it.
    """
    if recording.session.drive is None:
        arm = arms.figures(recording)
        return html.render(arm.run, summarize(arm.run, arm.attributions, arm.offsets)), arm.missing
    found = drives.driven(recording)
    return drive.render(found.drive, drives.figures_of(recording, found), recording.events), found.missing
