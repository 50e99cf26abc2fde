"""The figures of a mobile robot's run from its recording alone: a row of the laboratory's table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interfaces.recording.driving.pursuit import FARTHEST, matchable
from interfaces.recording.rerun import rerun
from interfaces.recording.track import (
    ESTIMATED,
    GAP,
    MEASURED,
    REAL_POSTURE,
    SampleTrack,
    gap_lengths,
    not_measured,
)
from interfaces.runs.drive_row import facts_of, row_of
from interfaces.runs.drive_run import DriveCase, DriveRun
from interfaces.teleop.architectures import Transport
from robots.ipr.robot import Collision
from vrs.comparison import resample
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array

if TYPE_CHECKING:
    from interfaces.recording.recording import Recording

SCHEMA = "vrs-drive/1"
COLLISION = "collision"
"""Kind of the events that are collisions."""
MOST_ROWS = 1_000_000
"""Samples of a run that is compared, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """A run as its recording has it."""

    drive: DriveRun
    missing: tuple[str, ...]
    """What isn't in the recording, and what stands for it; nothing in a whole one."""
    gap_s: float
    """For how long nothing was measured of the real robot, between its samples [s]."""


def summary(recording: Recording) -> dict[str, Any]:
    """The run's figures, with a list `missing` where something is.

    Raises:
        FormatError: As `driven`.
    """
    found = driven(recording)
    value = figures_of(recording, found)
    return value | {"missing": list(found.missing)} if found.missing else value


def figures_of(recording: Recording, found: Driven) -> dict[str, Any]:
    """The figures of a run that was put together from its recording."""
    return {
        "schema": SCHEMA,
        "title": recording.session.title,
        "duration_s": float(found.drive.t[-1] - found.drive.t[0]),
        "gap_s": found.gap_s,
        **facts_of(row_of(found.drive)),
    }


def driven(recording: Recording) -> Driven:
    """The run, put together from its recording.

    Raises:
        FormatError: If the recording has too little of it: no samples of the real robot, no known robot.
    """
    missing: list[str] = []
    if recording.damage:
        missing.append(f"the recording is damaged: {recording.damage}")
    track = recording.track(REAL_POSTURE)
    t = _grid(recording, track)
    missing += not_measured(track, t)
    real = _on(t, track.t, track.q)
    if len(t) != len(track.t):
        real[track.unmeasured(t)] = np.nan
        if len(track.gaps) == len(track.t) - 1:
            raise FormatError(str(recording.path), f"holds no two samples of the real robot within {GAP} s")
    packets = [entry for entry in recording.link if entry.direction == "forward"]
    case = _case(recording)
    taken = [(e.sent, e.arrived - e.sent) for e in packets if e.arrived is not None and e.sent < case.length]
    drive = DriveRun(
        case=case,
        t=t,
        virtual=_virtual(recording, t, missing),
        real=real,
        measured=_sampled(recording, MEASURED, t),
        estimated=_sampled(recording, ESTIMATED, t),
        drives=_on(t, track.t, track.reference),
        offset=_on(t, track.t, (track.t - track.play)[:, None])[:, 0],
        delays=np.array(taken).reshape(-1, 2),
        touched=tuple(Collision(e.t, e.text) for e in recording.events if e.kind == COLLISION),
        sent_bytes=sum(entry.size for entry in packets),
        reported_bytes=sum(entry.size for entry in recording.link if entry.direction == "backward"),
        learned=(),
    )  # fmt: skip
    return Driven(drive, tuple(missing), float(gap_lengths(track, t).sum()))


def _case(recording: Recording) -> DriveCase:
    begin, facts = recording.session, recording.session.drive
    if facts is None:
        raise FormatError(str(recording.path), "of no mobile robot")
    try:
        return DriveCase(
            architecture=facts.architecture,
            transport=Transport(facts.transport),
            delay=begin.delay,
            robot=facts.body,
            operator=facts.operator,
            seed=begin.seed or 0,
            length=facts.length,
            position=facts.position,
        )
    except InvalidValueError as error:
        raise FormatError(str(recording.path), f"its beginning: {error}") from None


def _grid(recording: Recording, track: SampleTrack) -> Array:
    """Times of the run [s], (k,): the samples' own where none is missing."""
    step, t, where = recording.session.step, track.t, str(recording.path)
    if len(t) < 2:
        raise FormatError(where, "holds less than two samples of the real robot")
    if max(float(t[-1] - t[0]), abs(float(t[0]))) >= MOST_ROWS * step:
        raise FormatError(where, f"is longer than the {MOST_ROWS} samples that are compared")
    first, last = round(float(t[0]) / step), round(float(t[-1]) / step)
    if last - first + 1 == len(t):
        return t
    whole: Array = step * np.arange(first, last + 1, dtype=np.float64)
    return whole


def _virtual(recording: Recording, t: Array, missing: list[str]) -> Array:
    """Postures of the virtual robot: as the commands make them, which is exact, or by its recorded edits."""
    again = rerun(recording)
    timeline = again.timeline
    if again.missing or again.difference:
        why = again.difference or again.missing
        missing.append(f"the virtual robot is as its recorded edits have it, since {why}")
        timeline = recording.timeline
        if recording.certain < t[-1]:
            missing.append(f"edits of the virtual robot's timeline after {recording.certain:.3f} s")
    virtual = timeline.sample(t)
    if not matchable(virtual):
        raise FormatError(str(recording.path), f"its virtual robot drives further than {FARTHEST:g} m")
    return virtual


def _sampled(recording: Recording, topic: str, t: Array) -> Array:
    """Postures of a channel at times [s], (k, 3); NaN where it has none."""
    track = recording.track(topic)
    return _on(t, track.t, track.q) if len(track.t) else np.full((len(t), 3), np.nan)


def _on(t: Array, known: Array, values: Array) -> Array:
    """Values (m, n) of times (m,) at other times (k,): the same ones where those are the same."""
    return values if np.array_equal(t, known) else resample(known, values, t)
