"""Engines that stand as the recorded ones did when their recordings began."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interfaces.recording.messages import Late
from interfaces.recording.recording import Recording
from robots.ipr.model import Ipr
from robots.ipr.model import model as ipr_model
from vrs.clock import ManualClock
from vrs.commands import Lateness
from vrs.engine import Engine
from vrs.errors import FormatError
from vrs.ledger import Standing
from vrs.timeline import Timeline

POSTURE = 3
"""Numbers of a posture."""
NAME = "ipr"
"""The mobile robot that is known here."""


def begun(recording: Recording) -> tuple[Engine, ManualClock]:
    """An engine that stands as the recorded one did when the recording began, and its clock.

    Raises:
        FormatError: If it can't stand so, or what it needs for that is missing from the file.
    """
    return _arm(recording) if recording.session.drive is None else _mobile(recording)


def _arm(recording: Recording) -> tuple[Engine, ManualClock]:
    begin, where = recording.session, str(recording.path)
    try:
        clock, lateness = ManualClock(begin.t), Lateness(begin.lateness)
        if begin.late is None:
            return Engine(recording.model, q=begin.q, clock=clock, lateness=lateness), clock
        edits = recording.edits
        if not edits or edits[0].number or not isinstance(edits[0].timeline, Timeline):
            raise FormatError(where, "the timeline that it begins with is destroyed")
        engine = Engine(recording.model, timeline=edits[0].timeline, clock=clock, lateness=lateness)
        engine.take_up(_stand(recording, begin.late, engine))
    except FormatError:
        raise
    except ValueError as error:
        raise FormatError(where, f"its beginning: {error}") from None
    return engine, clock


def _stand(recording: Recording, late: Late, engine: Engine) -> Standing:
    limits = replace(
        engine.limits, **{name: np.array(getattr(late, name)) for name in ("qd_max", "qdd_max", "qddd_max")}
    )
    steered = None if late.steered is None else (late.steered, late.steered_at)
    return Standing(late.newest, Lateness(recording.session.lateness), limits, steered, recording.given)


def _mobile(recording: Recording) -> tuple[Engine, ManualClock]:
    begin, where = recording.session, str(recording.path)
    model = mobile_model(recording)
    if begin.late is not None:
        raise FormatError(where, "it begins in the middle of a session, which isn't known of mobile robots")
    try:
        clock = ManualClock(begin.t)
        return Engine(model, posture=begin.q, clock=clock, lateness=Lateness(begin.lateness)), clock
    except ValueError as error:
        raise FormatError(where, f"its beginning: {error}") from None


def mobile_model(recording: Recording) -> Ipr:
    """The mobile robot of a recording.

    Raises:
        FormatError: If it's none that is known here.
    """
    begin = recording.session
    facts = begin.drive
    if facts is None or begin.robot != NAME or len(begin.q) != POSTURE:
        raise FormatError(str(recording.path), f"of a robot that isn't known here: {begin.robot!r}")
    return ipr_model("micro" if facts.body == "micro" else "ipr", period=facts.period)
