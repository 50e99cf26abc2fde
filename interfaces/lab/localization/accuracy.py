"""How far off everybody is who says where the robot is, and how honest the doubt: drives in made-up rooms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from interfaces.lab.claims import OWN_BAR, Cell, Claim, Findings, Study, Table
from interfaces.lab.localization.pictures import DrawnDrive, scenes
from interfaces.lab.localization.trial import (
    CONTROL,
    STILL,
    PostureErrors,
    PostureSource,
    Reckoning,
    Record,
    as_built,
    body_of,
    drive,
    furnished,
    setting,
    wander,
)
from robots.ipr.floor_plan import plan_map
from robots.onboard.gsp_map import GspMap
from robots.onboard.localization import PaperLocalizer
from robots.onboard.localizer import Localizer
from robots.onboard.map_building import MapBuilder
from vrs.model import Array

SWEEP, SLOW_SWEEP = 0.03, 0.1
"""Of the laser [s]: with a bar, and beside it."""
PLAN, AS_BUILT, BUILT, SLOW, PAPER, ODOMETRY = (
    "floor-plan map",
    "floor plan as built",
    "map built from a drive",
    "floor-plan map, sweep of 100 ms",
    "the paper's update",
    "odometry",
)
METHODS: Final = (PLAN, AS_BUILT, BUILT, SLOW, PAPER, ODOMETRY)
"""Rows of the table."""
BARS: Final = {PLAN: (0.01, 0.3), AS_BUILT: (0.01, 0.3), SLOW: (0.01, 0.3), BUILT: (0.03, 0.7)}
"""95 % of the errors: position [m] and heading [deg]."""
LARGEST = 0.10
"""Bar of the largest error of position [m]."""
ROOMS = 28 / 30
"""Share of the rooms in which bars are to be kept."""
INSIDE: Final = 7.814728
"""95 % of χ² with three degrees of freedom."""
BUILDING = 2.5
"""The drive that makes a map is so many times as long as the one that uses it."""
SETTLED = 20
"""Rows before which doubt isn't judged: the first scan comes after the first row."""


@dataclass(frozen=True, slots=True, eq=False)
class RoomFound:
    """What a room gave."""

    number: int
    name: str
    people: int
    noise: float
    """Of the ranges [m]."""
    way: float
    """How far the robot drove [m]."""
    collisions: int
    lines: tuple[int, int]
    """Of the floor-plan map and of the built one."""
    tracks: dict[str, PostureErrors]
    scene: DrawnDrive | None
    """To be drawn; of the first room."""


def measure_room(study: Study, case: str) -> RoomFound:
    """Build a map, then drive again with everybody, then with the slow sweep."""
    number = int(case)
    room = furnished(study.seed, number)
    plan = plan_map(room)
    first = setting(room, number, SWEEP, (study.seed, number, 0))
    with body_of(first) as body:
        builder = MapBuilder(body.truth)
        drive(body, BUILDING * study.length + STILL, wander(first, still=STILL, thorough=True), {"": builder})
    built = builder.built(room.name)
    scene = DrawnDrive(room, plan, built) if number == 0 else None
    record = _with_all(study, number, plan, built, scene)
    slow = setting(room, number, SLOW_SWEEP, (study.seed, number, 2))
    with body_of(slow) as body:
        later = drive(body, study.length, wander(slow), {SLOW: Localizer(plan, body.truth)})
    if scene is not None:
        scene.record = record
    way = float(np.hypot(*np.diff(record.truth[:, :2], axis=0).T).sum())
    return RoomFound(
        number, room.name, len(room.people), first.laser.noise, way, record.collisions,
        (len(plan.lines), len(built.lines)), {**record.tracks, **later.tracks}, scene,
    )  # fmt: skip


def _with_all(study: Study, number: int, plan: GspMap, built: GspMap, scene: DrawnDrive | None) -> Record:
    room = furnished(study.seed, number)
    chosen = setting(room, number, SWEEP, (study.seed, number, 1))
    with body_of(chosen) as body:
        localizer = Localizer(plan, body.truth)
        drawn = as_built(plan, np.random.default_rng([study.seed, number, 3]))
        everybody: dict[str, PostureSource] = {
            PLAN: localizer,
            AS_BUILT: Localizer(drawn, body.truth),
            BUILT: Localizer(built, body.truth),
            PAPER: PaperLocalizer(plan, body.truth),
            ODOMETRY: Reckoning(),
        }
        hook = (lambda _: None) if scene is None else (lambda t: scene.look(t, localizer))
        return drive(body, study.length, wander(chosen), everybody, hook)


def conclude_rooms(study: Study, found: tuple[RoomFound, ...]) -> Findings:  # noqa: ARG001
    """The table of all rooms together, the one of each, and the claims."""
    claims = []
    for name in (PLAN, AS_BUILT, BUILT):
        claims += _accuracy(name, found)
    for name in (PLAN, AS_BUILT, BUILT):
        claims += _honesty(name, found)
    pictures = scenes([one.scene for one in found if one.scene is not None])
    return Findings(tuple(claims), (_pooled(found), _by_room(found)), tuple(pictures))


def _accuracy(name: str, found: tuple[RoomFound, ...]) -> list[Claim]:
    place, turn, largest = _all(name, found)
    bar, turn_bar = BARS[name]
    good = sum(_keeps(name, one.tracks[name]) for one in found)
    made = [
        Claim(f"{name}: 95 % of position errors [cm]", OWN_BAR, f"≤ {100 * bar:g}", 100 * place, place <= bar),
        Claim(f"{name}: 95 % of heading errors [deg]", OWN_BAR, f"≤ {turn_bar:g}", turn, turn <= turn_bar),
    ]
    if name != BUILT:
        least = math.ceil(ROOMS * len(found) - 1e-9)
        what = f"{name}: rooms of {len(found)} in which both are kept"
        made.append(Claim(what, OWN_BAR, f"≥ {least}", good, good >= least))
        what = f"{name}: largest position error [cm]"
        made.append(Claim(what, OWN_BAR, f"≤ {100 * LARGEST:g}", 100 * largest, largest <= LARGEST))
    return made


def _honesty(name: str, found: tuple[RoomFound, ...]) -> list[Claim]:
    mean, inside = _nees(name, found)
    return [
        Claim(f"{name}: mean squared normalised error, 3 if honest", OWN_BAR, "2 to 4", mean, 2 <= mean <= 4),
        Claim(
            f"{name}: normalised errors inside the 95 % bound [%]", OWN_BAR, "90 to 99.5",
            100 * inside, 0.9 <= inside <= 0.995,
        ),
    ]  # fmt: skip


def _keeps(name: str, track: PostureErrors) -> bool:
    bar, turn_bar = BARS.get(name, BARS[PLAN])
    place, turn = np.quantile(track.place, 0.95), np.quantile(track.turn, 0.95)
    return bool(place <= bar and math.degrees(float(turn)) <= turn_bar)


def _all(name: str, found: tuple[RoomFound, ...]) -> tuple[float, float, float]:
    """95 % of position [m] and heading [deg] and the largest position error [m] of all rooms."""
    place = np.concatenate([one.tracks[name].place for one in found])
    turn = np.concatenate([one.tracks[name].turn for one in found])
    return float(np.quantile(place, 0.95)), math.degrees(float(np.quantile(turn, 0.95))), float(place.max())


def _nees(name: str, found: tuple[RoomFound, ...]) -> tuple[float, float]:
    values = np.concatenate([_judged(one.tracks[name]) for one in found])
    return float(values.mean()), float(np.mean(values <= INSIDE))


def _judged(track: PostureErrors) -> Array:
    values = track.normalised[SETTLED:]
    return values[np.isfinite(values)]


def _pooled(found: tuple[RoomFound, ...]) -> Table:
    rows = []
    for name in METHODS:
        place, turn, largest = _all(name, found)
        good = sum(_keeps(name, one.tracks[name]) for one in found)
        doubtful = name in (PAPER, ODOMETRY)
        mean, inside = (None, None) if doubtful else _nees(name, found)
        share = None if inside is None else 100 * inside
        rows.append((name, 100 * place, turn, 100 * largest, f"{good} of {len(found)}", mean, share))
    columns = (
        "method", "position, 95 % [cm]", "heading, 95 % [deg]", "largest [cm]", "rooms within bars",
        "mean normalised", "inside 95 % [%]",
    )  # fmt: skip
    return Table(
        "accuracy", f"errors in {len(found)} rooms, a row of {1000 * CONTROL:g} ms each", columns, tuple(rows)
    )


def _by_room(found: tuple[RoomFound, ...]) -> Table:
    columns = (
        "room", "people", "noise [cm]", "way [m]", "collisions", "lines, plan", "lines, built",
        *(f"{name}, {what}" for name in METHODS for what in ("95 % [cm]", "heading [deg]")),
        f"{PLAN}, mean normalised",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for one in found:
        cells: list[float] = []
        for name in METHODS:
            track = one.tracks[name]
            cells.append(100 * float(np.quantile(track.place, 0.95)))
            cells.append(math.degrees(float(np.quantile(track.turn, 0.95))))
        rows.append((
            one.name, one.people, 100 * one.noise, one.way, one.collisions, *one.lines, *cells,
            float(_judged(one.tracks[PLAN]).mean()),
        ))  # fmt: skip
    return Table("rooms", "the same, room by room", columns, tuple(rows))
