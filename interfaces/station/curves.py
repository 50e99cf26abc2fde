"""What a play-back page plots of a recording: curves by the live plots' names, and the figures of `vrs compare`."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from interfaces.recording.figures import RunFigures, figures, summary_of
from interfaces.recording.recording import open_recording
from interfaces.runs.drive_run import DriveRun
from interfaces.runs.summary import path_match
from interfaces.runs.twin_run import TwinRun
from robots.robot import Robot
from vrs.comparison import PathMatch
from vrs.model import Array

MOST_ROWS: Final = 6000
"""Rows of a table that a page gets: of a longer one two a stretch, with the least and the largest values there."""
_DIGITS: Final = 8
"""Decimals of what a page gets."""
_STILL: Final = 1e-12
"""Where a tool error is shorter [m], its parts have no direction."""
_JOINED: Final = 1.0
"""Places of a path that were reached further apart [s] aren't joined."""

Columns = dict[str, Array]


def curves(path: Path, robot: Robot, shift: float) -> bytes:
    """A recording's curves and figures as JSON; takes as long as `vrs compare`: call it in a thread.

    Args:
        path: The recording.
        robot: What it's of.
        shift: What is added to its times to get the play-back's [s].

    Raises:
        FormatError: If the recording has too little of it.
    """
    with open_recording(path, robot) as recording:
        found = figures(recording)
        gaps = recording.track(recording.kind.real).gaps.mean(axis=1)
        facts: dict[str, Any] = {"kind": recording.kind.word, "summary": summary_of(found)}
        if isinstance(found, RunFigures):
            run = found.run
            facts |= {"joints": len(run.q_real[0]), "prismatic": sorted(run.model.prismatic)}
            table, sent, match = _arm(run), run.messages, path_match(run)[0]
            facts["paths"] = _reached(match, shift)
        else:
            table = _drive(found.run)
            sent = np.stack((found.run.delays[:, 0], found.run.delays.sum(axis=1)), axis=1)
    facts["table"] = _told(_with_gaps(table, gaps), shift)
    arrived = sent[np.isfinite(sent[:, 1])]
    arrived = arrived[np.argsort(arrived[:, 1], kind="stable")]
    facts["arrived"] = _told({"arrived": arrived[:, 1], "delay": arrived[:, 1] - arrived[:, 0]}, shift)
    lost = np.sort(sent[~np.isfinite(sent[:, 1]), 0])
    facts["lost"] = _told({"sent": lost, "none": np.zeros(len(lost))}, shift)
    return json.dumps(facts, allow_nan=False, separators=(",", ":")).encode()


def _arm(run: TwinRun) -> Columns:
    """Errors of joints and tool, by `agreement`'s definitions row by row, and what the tool's is made of."""
    samples, model = run.at_samples, run.model
    pairs = {"timeline": samples.q_matched, "user": samples.q_shown, "servo": samples.q_reference}
    real = model.forward(samples.q_real)
    poses = {name: model.forward(q) for name, q in pairs.items()}
    table: Columns = {"t": samples.t, "D": np.interp(samples.t, run.t, run.D)}
    for name, X in poses.items():
        table[f"tool_{name}"] = np.linalg.norm(real[:, :3, 3] - X[:, :3, 3], axis=1)
    for name in ("timeline", "user"):
        chord = np.linalg.norm(real[:, :3, :3] - poses[name][:, :3, :3], axis=(1, 2))
        table[f"angle_{name}"] = 2 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0))
        error = samples.q_real - pairs[name]
        table |= {f"error_{name}_{j + 1}": error[:, j] for j in range(error.shape[1])}
    steps = [X[:, :3, 3] for X in (poses["user"], poses["timeline"], poses["servo"], real)]
    whole = steps[3] - steps[0]
    length = np.linalg.norm(whole, axis=1)
    for name, before, after in zip(("offset", "link", "servo"), steps, steps[1:], strict=False):
        along = np.einsum("ij,ij->i", after - before, whole)
        table[name] = np.divide(along, length, out=np.zeros(len(length)), where=length > _STILL)
    return table


def _drive(run: DriveRun) -> Columns:
    """How far the real robot was beside the virtual one's path, and how much later."""
    match = run.match()
    at, late = match.t_follower[: len(match.s)], match.time_difference[1]
    counted = match.moving[: len(at)] & np.isfinite(at)
    at = at[counted]
    difference: Array = np.full(len(match.t), np.nan)
    if len(at) > 1:
        difference = np.interp(match.t, at, late, left=np.nan, right=np.nan)
        after = np.clip(np.searchsorted(at, match.t), 1, len(at) - 1)
        difference[at[after] - at[after - 1] > _JOINED] = np.nan
    behind = np.interp(match.t, run.t, -run.offset)
    return {"t": match.t, "path_error": match.distance, "time_difference": difference, "behind": behind}


def _reached(match: PathMatch, shift: float) -> dict[str, list[float | None]]:
    """When the real tool came to places of the path, and how much later than the virtual one."""
    counted = match.moving[: len(match.t_follower)] & np.isfinite(match.t_follower)
    return _told({"arrival": match.t_follower[counted], "late": match.time_difference[1]}, shift)


def _with_gaps(table: Columns, gaps: Array) -> Columns:
    """A table with a row in which nothing is known at each of some times [s]."""
    t = table["t"]
    gaps = gaps[(gaps > t[0]) & (gaps < t[-1])]
    places = np.searchsorted(t, gaps)
    return {name: np.insert(column, places, gaps if name == "t" else np.nan) for name, column in table.items()}


def _told(table: Columns, shift: float) -> dict[str, list[float | None]]:
    """A table whose first column are times, for a page: in its time, bounded, and None for what isn't known."""
    names = list(table)
    times = table[names[0]] + shift
    if len(times) > MOST_ROWS:
        first = np.linspace(0, len(times), MOST_ROWS // 2, endpoint=False).astype(int)
        last = np.append(first[1:], len(times)) - 1
        columns = [
            np.stack((np.fmin.reduceat(table[name], first), np.fmax.reduceat(table[name], first)), axis=1).ravel()
            for name in names[1:]
        ]
        times = np.stack((times[first], times[last]), axis=1).ravel()
    else:
        columns = [table[name] for name in names[1:]]
    found = {}
    for name, column in zip(names, (times, *columns), strict=True):
        rounded = np.round(column, _DIGITS).tolist()
        found[name] = [None if math.isnan(x) else x for x in rounded]
    return found
