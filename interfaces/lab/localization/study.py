"""The study behind vrs lab localization, and its part on what can't be known: the way along a wall."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np

from interfaces.lab.claims import OWN_BAR, Findings, Paper, PaperPart, Reproduction, Results, Study, Table, at_least
from interfaces.lab.localization.accuracy import INSIDE, conclude_rooms, measure_room
from interfaces.lab.localization.searching import (
    STARTS,
    conclude_carried,
    conclude_starts,
    conclude_symmetric,
    measure_carried,
    measure_starts,
    measure_symmetric,
)
from interfaces.lab.localization.trial import body_of, drive, setting
from interfaces.lab.output import write_runs
from robots.mobile.floor_plan import plan_map
from robots.onboard.driving import Drive
from robots.onboard.localization import LocalizationConfig, Observability, Tracker, observability
from robots.onboard.localizer import Localizer
from robots.rooms import Room, read_room
from vrs.checks import number_in
from vrs.mobile import clipped
from vrs.model import Array

ALONG_LENGTH, SPEED = 20.0, 0.3
"""Of the drive [s], and its speed [m/s]."""
MIDDLE = 10.0
"""The way's y [m]."""
ALONG = math.radians(2)
"""The axis that is named lies so near the walls' direction [rad]."""
PLACES = ("corridor", "single wall", "room")
"""The last is for comparison: nothing is unknown there."""
UNKNOWN: Final = LocalizationConfig().unknown
"""What counts as unobservable [m]."""


def place(name: str) -> Room:
    """A corridor, a wall, both longer than the laser sees, or a room."""
    walls = {
        "corridor": "wall 0 9 40 9\nwall 0 11 40 11\n",
        "single wall": "wall 0 9 40 9\n",
        "room": "wall 15 8 25 8\nwall 25 8 25 12\nwall 25 12 15 12\nwall 15 12 15 8\n",
    }[name]
    return read_room(f"room 1\nname {name}\nsize 40 20\nstart 17 {MIDDLE:g} 0\n{walls}", name)


def measure_axis(study: Study, case: str) -> Results:
    """Drive along the walls."""
    chosen = setting(place(case), 1, 0.03, (study.seed, PLACES.index(case), 23))
    said: list[tuple[bool, ...]] = []
    with body_of(chosen) as body:
        localizer = Localizer(plan_map(chosen.room), body.truth)

        def look(_: float) -> None:
            tracker = localizer.tracker
            assert tracker is not None
            if tracker.sights is None:
                return
            unknown = tracker.observability.unobservable
            middles, single = middles_known(tracker), single_line(tracker)
            said.append((_is_along(unknown), len(unknown) == 0, _is_along(middles.unobservable),
                         len(single.unobservable) == 0))  # fmt: skip

        record = drive(body, ALONG_LENGTH, _swinging, {"": localizer}, look)
    track = record.tracks[""]
    last = track.covariances[-1]
    assert localizer.tracker is not None
    doubt = np.linalg.inv(middles_known(localizer.tracker).information)
    named, none, middles_named, single_none = np.mean(said, axis=0).tolist()
    return Results(
        place=case,
        named=named,  # share of the scans after which just the walls' direction was named as unobservable
        none=none,  # share after which nothing was
        middles_named=middles_named,  # as `named`, with the lines' middles taken as known
        single_none=single_none,  # as `none`, by one line of each scan
        middles_ratio=math.sqrt(doubt[0, 0] / doubt[1, 1]),  # doubt along by that across, with middles as known
        along=math.sqrt(last[0, 0]),  # standard deviation along the walls at the end [m]
        across=math.sqrt(last[1, 1]),  # and across [m]
        inside=float(np.mean(track.normalised[20:] <= INSIDE)),  # share of normalised errors inside the 95 % bound
    )


def middles_known(tracker: Tracker) -> Observability:
    """What the last scan would say if a seen line's middle were that of the map's, as in eq. (4): along it, too."""
    sights, lines = tracker.sights, tracker.filter.lines
    assert sights is not None
    x, y = (lines.poses[sights.of, :2] - tracker.posture[:2]).T
    along = lines.directions[sights.of]
    H = np.column_stack([along, along[:, 1] * x - along[:, 0] * y])
    return observability(tracker.observability.information + (H.T / sights.lines.variances[:, 0]) @ H, UNKNOWN)


def single_line(tracker: Tracker) -> Observability:
    """What the first of its lines says by itself."""
    sights = tracker.sights
    assert sights is not None
    H = tracker.filter.innovation(sights).H[:1, :, :3]
    return observability(np.einsum("kai,ka,kaj->ij", H, 1 / sights.lines.variances[:1], H), UNKNOWN)


def _is_along(unknown: Array) -> bool:
    """Whether the walls' direction, and no other, is among unit vectors, (k, 2)."""
    return len(unknown) == 1 and abs(math.asin(min(1.0, abs(unknown[0, 1])))) <= ALONG


def _swinging(t: float, posture: tuple[float, float, float]) -> Drive:
    """Along the walls, swinging by 17 deg to either side."""
    _, y, theta = posture
    return Drive(SPEED, clipped(2.0 * (0.3 * math.sin(0.8 * t) - 0.5 * (y - MIDDLE) - theta), 0.7))


def conclude_axes(_study: Study, found: tuple[Results, ...]) -> Findings:
    """Whether the axis is named, and the doubt along it honest."""
    claims, without = [], "middles of lines taken as known"
    for one in found:
        if one.place == "room":
            what = "room: scans after which nothing is called unobservable [%]"
            claims.append(at_least(what, OWN_BAR, 95, 100 * one.none, ("one line alone", 100 * one.single_none)))
            continue
        what = f"{one.place}: scans after which the way along is named as unobservable [%]"
        claims.append(at_least(what, OWN_BAR, 95, 100 * one.named, (without, 100 * one.middles_named)))
        what = f"{one.place}: doubt along the walls, times that across"
        claims.append(at_least(what, OWN_BAR, 10, one.along / one.across, (without, one.middles_ratio)))
    rows = [
        (
            ("place", one.place),
            ("way along named [%]", 100 * one.named),
            ("nothing named [%]", 100 * one.none),
            ("doubt along at the end [cm]", 100 * one.along),
            ("across [cm]", 100 * one.across),
            ("inside 95 % [%]", 100 * one.inside),
        )
        for one in found
    ]
    return Findings(tuple(claims), (Table.of("unobservable", "what can't be known", rows),))


ROOMS, LENGTH, FULL_STARTS = 30, 60.0, 200
"""Rooms, length of a drive [s] and starts, unless said otherwise."""
SYMMETRIC, CARRIED = 3, 10
"""Symmetric rooms, and robots that are carried off; fewer where there are fewer rooms."""


def study_of(rooms: int, starts: int) -> Paper:
    """The parts of a study.

    Args:
        rooms: In which accuracy is measured, 2 to 1000.
        starts: From which a robot that knows nothing is found, 1 to 10,000.

    Raises:
        InvalidValueError: If there are too few or too many.
    """
    number_in("starts", starts, 1, 10_000, "a number")
    groups = tuple(f"{k}:{min(STARTS, starts - first)}" for k, first in enumerate(range(0, starts, STARTS)))
    return Paper(
        "localization",
        "Kim, Han, Kim, Kim, Internet-Based Personal Robot System using Map-Based Localization, 2002, section 3",
        (
            PaperPart("accuracy", measure_room, conclude_rooms, _cases(rooms)),
            PaperPart("what can't be known", measure_axis, conclude_axes, PLACES),
            PaperPart("starts anywhere", measure_starts, conclude_starts, groups),
            PaperPart("symmetric rooms", measure_symmetric, conclude_symmetric, _cases(SYMMETRIC)),
            PaperPart("carried off", measure_carried, conclude_carried, _cases(min(CARRIED, len(groups)))),
        ),
        runs=ROOMS,
        length=LENGTH,
    )


def _cases(count: int) -> tuple[str, ...]:
    return tuple(str(k) for k in range(count))


def write(found: Reproduction, out: Path) -> None:
    """Write summary.json, runs.csv with a row a room, and the pictures into an existing directory.

    Raises:
        FormatError: If it can't hold them.
    """
    write_runs(found, out, [table for table in found.findings.tables if table.name == "rooms"])
