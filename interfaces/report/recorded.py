"""The report of a run, from its recording alone."""

from __future__ import annotations

from interfaces.recording.driving.figures import driven, figures_of
from interfaces.recording.figures import figures
from interfaces.recording.recording import Recording
from interfaces.report import drive, html
from interfaces.runs.summary import summarize


def render(recording: Recording) -> tuple[str, tuple[str, ...]]:
    """The run's report as HTML, and what isn't in the recording.

    Raises:
        FormatError: If the recording has too little of it.
    """
    if recording.session.drive is None:
        arm = figures(recording)
        return html.render(arm.run, summarize(arm.run, arm.attributions, arm.offsets)), arm.missing
    found = driven(recording)
    return drive.render(found.drive, figures_of(recording, found), recording.events), found.missing
