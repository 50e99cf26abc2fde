"""How far off everybody is who says where the robot is, and how honest the doubt: drives in made-up rooms."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.lab.claims import (
    OWN_BAR,
    Cell,
    Claim,
    Figure,
    Findings,
    Results,
    Study,
    Table,
    at_least,
    at_most,
    between,
)
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
from interfaces.lab.output import BAD, GOOD, INK, MUTED, REAL, VIRTUAL, draw
from robots.mobile.floor_plan import plan_map
from robots.onboard.gsp_map import GspMap, Lines
from robots.onboard.localization import LocalizationConfig, PaperLocalizer, weighted_update
from robots.onboard.localizer import Localizer, LocalizerConfig
from robots.onboard.map_building import MapBuilder
from robots.rooms import Room
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

EACH = 10.0
"""A scan is drawn each so many seconds [s]."""
SCALE = 30.0
"""Ellipses of 95 % are drawn so many times as large: they're of millimetres."""
_TWO_SIGMA = 2.4477
"""Radius of the 95 % ellipse of two degrees of freedom, in deviations."""
COLOURS = (VIRTUAL, "#7b4fa3", GOOD, MUTED, REAL, BAD)


@dataclass(slots=True, eq=False)
class DrawnDrive:
    """A drive to be drawn."""

    room: Room
    plan: GspMap
    built: GspMap
    record: Record | None = None
    looks: list[tuple[tuple[float, float, float], Array, Array]] = field(default_factory=list)
    """Instants: the posture, its covariance, and what was seen, in the world as the estimate has it [m], (k, 2)."""

    def look(self, t: float, localizer: Localizer) -> None:
        """Note what a localizer says at a time [s], each so often."""
        tracker = localizer.tracker
        if tracker is None or tracker.points is None or t < EACH * (len(self.looks) + 0.5):
            return
        x, y, theta = tracker.seen_from
        c, s = math.cos(theta), math.sin(theta)
        points = tracker.points.places @ np.array([[c, s], [-s, c]]) + (x, y)
        self.looks.append((tracker.seen_from, np.array(tracker.covariance), points))


def pictures(scene: DrawnDrive | None) -> tuple[Figure, ...]:
    """Pictures of a drive, if there's one."""
    if scene is None or scene.record is None:
        return ()
    record = scene.record
    what = f"{scene.room.name}, ellipses {SCALE:g} times as large"
    height = 7.2 * scene.room.width / scene.room.length
    return (
        draw("localization_map", f"Map, scans and estimates: {what}", _map, scene, record, height=height),
        draw("localization_errors", "Errors over time", _errors, record, height=4.2),
    )


def _lines(ax: Axes, known: GspMap, colour: str, label: str, width: float) -> None:
    for k, end in enumerate(known.lines.ends):
        ax.plot(end[:, 0], end[:, 1], color=colour, linewidth=width, label=label if k == 0 else None)


def _map(canvas: Canvas, scene: DrawnDrive, record: Record) -> None:
    ax = canvas.subplots()
    ax.grid(False)
    _lines(ax, scene.plan, INK, "floor-plan map", 2.4)
    _lines(ax, scene.built, GOOD, "map built from a drive", 1.2)
    points = np.concatenate([seen for _, _, seen in scene.looks]) if scene.looks else np.zeros((0, 2))
    ax.plot(points[:, 0], points[:, 1], ".", color=VIRTUAL, markersize=1.2, alpha=0.5, label="scans")
    ax.plot(record.truth[:, 0], record.truth[:, 1], color=REAL, linewidth=1.0, label="true way")
    for k, ((x, y, theta), covariance, _) in enumerate(scene.looks):
        ring = _ellipse((x, y), covariance)
        ax.plot(ring[:, 0], ring[:, 1], color=BAD, linewidth=1.0, label="estimate, 95 %" if k == 0 else None)
        ax.plot([x, x + 0.25 * math.cos(theta)], [y, y + 0.25 * math.sin(theta)], color=BAD, linewidth=1.0)
    ax.set_aspect("equal")
    ax.set(xlabel="x [m]", ylabel="y [m]")
    canvas.legend(loc="outside upper center", ncols=5, fontsize=8.0, labelcolor=INK)


def _ellipse(centre: tuple[float, float], covariance: Array) -> Array:
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    turn = np.linspace(0, math.tau, 49)
    ring = np.column_stack([np.cos(turn), np.sin(turn)]) * np.sqrt(np.maximum(values, 0.0)) * _TWO_SIGMA * SCALE
    return np.asarray(ring @ vectors.T + centre)


def _errors(canvas: Canvas, record: Record) -> None:
    upper, lower = canvas.subplots(2, 1, sharex=True)
    for colour, (name, track) in zip(COLOURS, record.tracks.items(), strict=False):
        upper.plot(record.t, 100 * np.maximum(track.place, 1e-6), color=colour, linewidth=0.9, label=name)
        lower.plot(record.t, np.degrees(np.maximum(track.turn, 1e-7)), color=colour, linewidth=0.9)
    first = next(iter(record.tracks.values()))
    _bound(upper, record, first, (0, 1), 100.0)
    _bound(lower, record, first, (2,), math.degrees(1.0))
    for ax, what, low, bar in ((upper, "position [cm]", 0.01, 1.0), (lower, "heading [deg]", 0.003, 0.3)):
        ax.set(yscale="log", ylim=(low, None))
        ax.axhline(bar, color=INK, linewidth=0.7, linestyle=":")
        ax.set_ylabel(what)
    lower.set_xlabel("time [s]")
    canvas.legend(loc="outside upper center", ncols=5, fontsize=8.0, labelcolor=INK)


def _bound(ax: Axes, record: Record, track: PostureErrors, of: tuple[int, ...], scale: float) -> None:
    """Two deviations of what the first one says."""
    variance = sum(track.covariances[:, k, k] for k in of)
    ax.fill_between(record.t, 1e-4, 2 * scale * np.sqrt(variance), color=VIRTUAL, alpha=0.12, linewidth=0)


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
NOISE_ALONE, DRAWN_EXACT, BUILT_EXACT, UNINJECTED = (
    "floor-plan map, scans independent",
    "floor plan as built, taken as exact",
    "map built from a drive, taken as exact",
    "the paper's eq. (5), without R",
)
RIVALS: Final = {PLAN: NOISE_ALONE, AS_BUILT: DRAWN_EXACT, BUILT: BUILT_EXACT, PAPER: UNINJECTED}
"""What lacks something, by what has it."""
SURE: Final = 1e-4
"""A map that is taken as exact has so small a share of its variances."""
INDEPENDENT: Final = LocalizerConfig(
    localization=LocalizationConfig(across_floor=0.0, turn_floor=0.0, fresh=0.0, fresh_turn=0.0, learning=0.0)
)
"""Of one that takes lines to be off by their noise alone, and odometry as it's said to be."""
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


def measure_room(study: Study, case: str) -> Results:
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
    return Results(
        name=room.name,
        people=len(room.people),
        noise=first.laser.noise,  # of the ranges [m]
        way=float(np.hypot(*np.diff(record.truth[:, :2], axis=0).T).sum()),  # how far the robot drove [m]
        collisions=record.collisions,
        lines=(len(plan.lines), len(built.lines)),  # of the floor-plan map and of the built one
        tracks={**record.tracks, **later.tracks},  # of each method, by name
        scene=scene,  # to be drawn; of the first room
    )


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
            NOISE_ALONE: Localizer(plan, body.truth, config=INDEPENDENT),
            DRAWN_EXACT: Localizer(exact(drawn), body.truth),
            BUILT_EXACT: Localizer(exact(built), body.truth),
            UNINJECTED: PaperLocalizer(plan, body.truth, weighted_update),
            ODOMETRY: Reckoning(),
        }
        hook = (lambda _: None) if scene is None else (lambda t: scene.look(t, localizer))
        return drive(body, study.length, wander(chosen), everybody, hook)


def exact(known: GspMap) -> GspMap:
    """A map that says of itself that it has nearly no errors."""
    lines = known.lines
    sure = Lines.of(lines.poses, lines.spans, SURE * lines.variances, lines.counts)
    return GspMap.of(known.name, sure, SURE * known.covariance)


def conclude_rooms(_study: Study, found: tuple[Results, ...]) -> Findings:
    """The table of all rooms together, the one of each, and the claims."""
    claims = [_of_the_paper(found)]
    for name in (PLAN, AS_BUILT, BUILT):
        claims += _accuracy(name, found)
    for name in (PLAN, AS_BUILT, BUILT):
        claims += _honesty(name, found)
    return Findings(tuple(claims), (_pooled(found), _by_room(found)), pictures(found[0].scene))


def _of_the_paper(found: tuple[Results, ...]) -> Claim:
    """A line tells nothing along itself: unless R takes that away the update is worse than none."""
    ours, without, odometry = (_all(name, found)[0] for name in (PAPER, UNINJECTED, ODOMETRY))
    what = f"{PAPER}, eq. (8): 95 % of position errors, by that of odometry"
    return at_most(what, "section 3.2", 1, ours / odometry, (UNINJECTED, without / odometry))


def _accuracy(name: str, found: tuple[Results, ...]) -> list[Claim]:
    place, turn, largest = _all(name, found)
    far, turned, farthest = _all(ODOMETRY, found)
    bar, turn_bar = BARS[name]
    good, others = (sum(_keeps(name, one.tracks[who]) for one in found) for who in (name, ODOMETRY))
    what = f"{name}: 95 % of position errors [cm]"
    made = [
        at_most(what, OWN_BAR, 100 * bar, 100 * place, (ODOMETRY, 100 * far)),
        at_most(f"{name}: 95 % of heading errors [deg]", OWN_BAR, turn_bar, turn, (ODOMETRY, turned)),
    ]
    if name != BUILT:
        least = math.ceil(ROOMS * len(found) - 1e-9)
        what = f"{name}: rooms of {len(found)} in which both are kept"
        made.append(at_least(what, OWN_BAR, least, good, (ODOMETRY, others)))
        what = f"{name}: largest position error [cm]"
        made.append(at_most(what, OWN_BAR, 100 * LARGEST, 100 * largest, (ODOMETRY, 100 * farthest)))
    return made


def _honesty(name: str, found: tuple[Results, ...]) -> list[Claim]:
    rival = RIVALS[name]
    (mean, inside), (other, others) = _nees(name, found), _nees(rival, found)
    what = f"{name}: normalised errors inside the 95 % bound [%]"
    return [
        between(f"{name}: mean squared normalised error, 3 if honest", OWN_BAR, 2, 4, mean, (rival, other)),
        between(what, OWN_BAR, 90, 99.5, 100 * inside, (rival, 100 * others)),
    ]


def _keeps(name: str, track: PostureErrors) -> bool:
    bar, turn_bar = BARS.get(name, BARS[PLAN])
    place, turn = np.quantile(track.place, 0.95), np.quantile(track.turn, 0.95)
    return bool(place <= bar and math.degrees(float(turn)) <= turn_bar)


def _all(name: str, found: tuple[Results, ...]) -> tuple[float, float, float]:
    """95 % of position [m] and heading [deg] and the largest position error [m] of all rooms."""
    place = np.concatenate([one.tracks[name].place for one in found])
    turn = np.concatenate([one.tracks[name].turn for one in found])
    return float(np.quantile(place, 0.95)), math.degrees(float(np.quantile(turn, 0.95))), float(place.max())


def _nees(name: str, found: tuple[Results, ...]) -> tuple[float, float]:
    values = np.concatenate([_judged(one.tracks[name]) for one in found])
    return float(values.mean()), float(np.mean(values <= INSIDE))


def _judged(track: PostureErrors) -> Array:
    values = track.normalised[SETTLED:]
    return values[np.isfinite(values)]


def _pooled(found: tuple[Results, ...]) -> Table:
    rows = []
    for name in (*METHODS, *RIVALS.values()):
        place, turn, largest = _all(name, found)
        good = sum(_keeps(name, one.tracks[name]) for one in found)
        doubtful = name in (PAPER, ODOMETRY, UNINJECTED)
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


def _by_room(found: tuple[Results, ...]) -> Table:
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
