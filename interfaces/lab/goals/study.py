"""The study behind vrs lab goals: trips in groups, what is asked of them, what was measured, and their maps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from interfaces.lab.claims import (
    OWN_BAR,
    Cell,
    Claim,
    Figure,
    Findings,
    Paper,
    PaperPart,
    Reproduction,
    Study,
    Table,
    at_least,
    at_most,
    none_of,
)
from interfaces.lab.goals.rivals import HEEDLESS, IMPATIENT, MAPPED, STRAIGHT
from interfaces.lab.goals.scenes import FURNITURE, LATE, PEOPLE, PHYSICS, ROUND, SHUT, TITLES, Shortest, setting
from interfaces.lab.goals.trial import Aboard, Trip, seen_all, travel
from interfaces.lab.output import BAD, GOOD, INK, MUTED, REAL, draw, write_runs
from interfaces.lab.statistics import Estimate, bootstrap, median
from robots.mobile.navigation import route_config
from robots.onboard.journey import JourneyState
from robots.onboard.routes import RouteProblem
from robots.robot import USUAL_BASE, load
from robots.rooms import Block, Column, Room

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

DRAWN = 4
"""Trips of each group that are drawn; those that went wrong first."""


def maps(found: Sequence[Trip]) -> list[Figure]:
    """A picture of each group's trips."""
    figures = []
    for group in dict.fromkeys(one.group for one in found):
        those = [one for one in found if one.group == group]
        those.sort(key=lambda one: one.arrived and not one.touched)
        shown = those[:DRAWN]
        rows = math.ceil(len(shown) / 2)
        title = f"Trips: {group}"
        figures.append(draw(f"goals_{group}", title, _maps, shown, height=3.4 * rows))
    return figures


def _maps(canvas: Canvas, found: Sequence[Trip]) -> None:
    axes = np.ravel(canvas.subplots(math.ceil(len(found) / 2), min(len(found), 2), squeeze=False))
    for ax, one in zip(axes, found, strict=False):
        draw_trip(ax, one)
    for ax in axes[len(found) :]:
        ax.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside upper center", ncols=5, fontsize=8.0, labelcolor=INK)


def draw_trip(ax: Axes, one: Trip) -> None:
    """Draw the room and the way that was driven in it."""
    goal = one.setting.goal
    draw_room(ax, one.setting.room)
    ax.plot(one.track[:, 0], one.track[:, 1], color=REAL, linewidth=1.4, label="driven")
    ax.plot(*one.setting.start[:2], "o", color=GOOD, markersize=4, label="start")
    ax.plot(goal.x, goal.y, "x", color=BAD, markersize=6, label="goal")
    for touch in one.touched:
        x, y, _ = one.track[min(round(touch.time / 0.05), len(one.track) - 1)]
        ax.plot(x, y, "*", color=BAD, markersize=8)
    ax.set_title(f"{one.setting.room.name}: {one.state}, {one.way:.1f} m, {one.time:.0f} s", fontsize=8.0)


def draw_room(ax: Axes, room: Room) -> None:
    """Draw what stands in a room; doors as they are at first."""
    from matplotlib.patches import Polygon

    ax.grid(False)
    ax.set_aspect("equal")
    for thing in (*room.things, *(door.at(0.0) for door in room.doors)):
        fill = MUTED if thing.known else "none"
        ax.add_patch(Polygon(_ring(thing), closed=True, facecolor=fill, edgecolor=MUTED, linewidth=0.8))
    for person in room.people:
        ax.plot(person.x, person.y, color=MUTED, linewidth=0.6, linestyle=":")
    ax.set(xlim=(-0.1, room.length + 0.1), ylim=(-0.1, room.width + 0.1))


def _ring(thing: Block | Column) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    if isinstance(thing, Column):
        turn = np.linspace(0.0, math.tau, 33)
        return np.column_stack([thing.x + thing.radius * np.cos(turn), thing.y + thing.radius * np.sin(turn)])
    c, s = math.cos(thing.angle), math.sin(thing.angle)
    half = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (thing.length, thing.width)
    return np.asarray(half @ np.array([[c, s], [-s, c]]) + (thing.x, thing.y))


GOALS = 100
"""Trips among furniture and doors, unless said otherwise."""
SHARES: Final = {ROUND: 0.25, LATE: 0.15, SHUT: 0.05, PEOPLE: 0.1, PHYSICS: 0.2}
"""Trips of each group as shares of those; the rest of them is of `FURNITURE`."""
ASKED: Final = (FURNITURE, ROUND, LATE)
"""Groups that make them up."""
REACHED, LONGER = 99.0, 1.15
"""Share of goals that are to be reached [%]; how much longer than the shortest a route may be."""
SOURCE: Final = f"section 4.1; {OWN_BAR}"
NO_AVOIDANCE, NO_DETOUR, NO_OTHER, NO_WAITING = (
    "no avoidance",
    "straight to the goal",
    "the map's way alone",
    "no waiting",
)
RIVALS: Final[dict[str, dict[str, Aboard]]] = {
    FURNITURE: {NO_DETOUR: STRAIGHT, NO_AVOIDANCE: HEEDLESS},
    ROUND: {NO_OTHER: MAPPED},
    LATE: {NO_WAITING: IMPATIENT},
    SHUT: {NO_OTHER: MAPPED},
    PEOPLE: {},
    PHYSICS: {NO_DETOUR: STRAIGHT, NO_AVOIDANCE: HEEDLESS},
}
"""Robots that lack something, by what they lack, and in which groups they are sent, too."""
COMPARED = 5
"""They're sent on each so manieth trip."""
PATIENCE = 10.0
"""They may take so much longer than ours [s]."""


class Measured(NamedTuple):
    """A trip, and what it's held against."""

    trip: Trip
    rivals: dict[str, Trip]
    """The same of robots that lack something, by what; none on most trips."""
    along_axes: float
    """Length of the shortest way along x and y alone [m]; nan on most trips."""


def study_of(goals: int) -> Paper:
    """The parts of a study: so many goals among furniture and doors, fewer of the other groups."""
    counts = {group: max(1, round(share * goals)) for group, share in SHARES.items()}
    counts[FURNITURE] = max(1, goals - counts[ROUND] - counts[LATE])
    asked = tuple(f"{group}:{k}" for group in ASKED for k in range(counts[group]))
    others = [
        PaperPart(group, measure, conclude, tuple(f"{group}:{k}" for k in range(counts[group])))
        for group, conclude in ((SHUT, conclude_shut), (PEOPLE, conclude_people), (PHYSICS, conclude_physics))
    ]
    return Paper(
        "goals",
        "Kim, Han, Kim, Kim, Internet-Based Personal Robot System using Map-Based Localization, 2002, section 4.1",
        (PaperPart("goals", measure, conclude_asked, asked), *others),
        runs=GOALS,
    )


def measure(study: Study, case: str) -> Measured:
    """A trip; the case is its group and number."""
    group, number = case.split(":")
    chosen = setting(group, study.seed, int(number))
    begin, end = chosen.start[:2], (chosen.goal.x, chosen.goal.y)
    # A disc as wide as the robot, with what its routes keep free on either side.
    needed = route_config(load(USUAL_BASE).base.body)
    radius = needed.half_width + needed.margin
    known = Shortest(chosen.room.known(), radius)
    mapped, true = known.length(begin, end), Shortest(seen_all(chosen.room), radius).length(begin, end)
    trip = travel(group, chosen, mapped, true)
    if int(number) % COMPARED:
        return Measured(trip, {}, math.nan)
    limit = trip.time + PATIENCE
    rivals = {what: travel(group, chosen, mapped, true, aboard, limit) for what, aboard in RIVALS[group].items()}
    return Measured(trip, rivals, known.length_along_axes(begin, end))


def conclude_asked(study: Study, measured: tuple[Measured, ...]) -> Findings:
    """What is asked of the goals among furniture and doors."""
    found = _trips(measured)
    known = _ratios(found)
    long = len(found) - sum(ratio <= LONGER for ratio in known)
    axes = [one.along_axes / one.trip.mapped for one in measured if math.isfinite(one.along_axes)]
    middle, other = (
        bootstrap(ratios, study.seed, median) if ratios else Estimate(math.nan, math.nan, math.nan)
        for ratios in (known, axes)
    )
    what = f"ways along x and y alone, {len(axes)} trips"
    blocked, late = ([one for one in measured if one.trip.group == group] for group in (ROUND, LATE))
    claims = (
        _reached(measured),
        _untouched(measured),
        at_most("routes on the map, by the shortest way: median", SOURCE, LONGER, middle, (what, other)),
        none_of(
            f"routes of {len(found)} that are longer than {LONGER:g} times that", SOURCE, long,
            (what, sum(ratio > LONGER for ratio in axes)),
        ),
        _share(f"of {len(blocked)} blocked doors the robot went round [%]", 100, arrived, blocked, NO_OTHER),
        _share(f"of {len(late)} doors it waited for [%]", 100, arrived, late, NO_WAITING),
    )  # fmt: skip
    groups = dict.fromkeys(one.group for one in found)
    rows = tuple(_row(group, [one for one in found if one.group == group]) for group in groups)
    table = Table("groups", "trips by group", COLUMNS, rows)
    return Findings(claims, (table, _each(found)), tuple(maps(found)))


def conclude_shut(_study: Study, measured: tuple[Measured, ...]) -> Findings:
    """Where there's no way the robot says so."""

    def says_so(one: Trip) -> bool:
        return one.state is JourneyState.FAILED and one.problem is RouteProblem.NO_WAY

    what = f"of {len(measured)} goals behind a closed door, given up with the reason [%]"
    claim = _share(what, 100, says_so, measured, NO_OTHER)
    found = _trips(measured)
    return Findings((claim,), (_each(found),), tuple(maps(found)))


def conclude_people(_study: Study, measured: tuple[Measured, ...]) -> Findings:
    """Among people who stop for nobody nothing is asked of touches: they run into robots that stand."""
    found = _trips(measured)
    table = Table("with people", TITLES[PEOPLE], COLUMNS, (_row(PEOPLE, found),))
    return Findings((), (table, _each(found)), tuple(maps(found)))


def conclude_physics(_study: Study, measured: tuple[Measured, ...]) -> Findings:
    """The same with physics."""
    found = _trips(measured)
    claims = _reached(measured, " in PyBullet"), _untouched(measured, " in PyBullet")
    return Findings(claims, (_each(found),), tuple(maps(found)))


COLUMNS: Final = (
    "group", "goals", "reached", "with touches", "routes by the shortest", "largest", "way by the shortest true",
    "routes taken, mean", "time [s]", "position error [cm]", "heading error [deg]", "largest error underway [cm]",
)  # fmt: skip
"""Of the table of groups; medians unless they say otherwise."""


def _trips(measured: Sequence[Measured]) -> tuple[Trip, ...]:
    return tuple(one.trip for one in measured)


def _share(
    what: str, bar: float, good: Callable[[Trip], bool], measured: Sequence[Measured], lacking: str
) -> Claim:
    """So many trips are to be good, and fewer of a robot that lacks something."""
    rivals = [one.rivals[lacking] for one in measured if lacking in one.rivals]
    share, other = (
        100 * sum(map(good, trips)) / len(trips) if trips else math.nan for trips in (_trips(measured), rivals)
    )
    return at_least(what, SOURCE, bar, share, (f"{lacking}, {len(rivals)} trips", other) if rivals else None)


def arrived(one: Trip) -> bool:
    """Whether a trip led to its goal."""
    return one.arrived


def _reached(measured: Sequence[Measured], where: str = "") -> Claim:
    what = f"of {len(measured)} goals{where} reached within 5 cm and 2 deg [%]"
    return _share(what, REACHED, arrived, measured, NO_DETOUR)


def _untouched(measured: Sequence[Measured], where: str = "") -> Claim:
    what = f"of {len(measured)} trips{where} without a touch [%]"
    return _share(what, 100, lambda one: not one.touched, measured, NO_AVOIDANCE)


def _count(found: Sequence[Trip]) -> tuple[int, int]:
    """Goals that were reached, and on whose way something was touched."""
    return sum(one.arrived for one in found), sum(bool(one.touched) for one in found)


def _ratios(found: Sequence[Trip]) -> list[float]:
    """Of those routes whose length can be compared."""
    return [one.ratio for one in found if math.isfinite(one.ratio)]


def _row(group: str, found: Sequence[Trip]) -> tuple[Cell, ...]:
    there = [one for one in found if one.arrived]
    ratios = _ratios(found)
    ways = [one.way / one.true for one in there if math.isfinite(one.true)]
    reached, touched = _count(found)
    return (
        TITLES[group], len(found), reached, touched, _median(ratios), max(ratios, default=math.nan), _median(ways),
        float(np.mean([one.routes for one in found])), _median([one.time for one in there]),
        100 * _median([one.off for one in there]), math.degrees(_median([one.turned for one in there])),
        100 * max(one.lost for one in found),
    )  # fmt: skip


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else math.nan


EACH: Final = (
    "group", "room", "state", "reason", "reached", "touched", "start x [m]", "start y [m]",
    "goal x [m]", "goal y [m]", "route on the map [m]", "shortest on the map [m]", "shortest true [m]",
    "driven [m]", "routes", "time [s]", "position error [cm]", "heading error [deg]", "largest error underway [cm]",
)  # fmt: skip
"""Of the table of trips."""


def _each(found: Sequence[Trip]) -> Table:
    group = "goals" if len({one.group for one in found}) > 1 else found[0].group
    rows = tuple(_trip(one) for one in found)
    title = "trip by trip" if group == "goals" else f"{TITLES[group]}: trip by trip"
    return Table(f"trips: {group}", title, EACH, rows)


def _trip(one: Trip) -> tuple[Cell, ...]:
    start, goal = one.setting.start, one.setting.goal
    lengths = (length if math.isfinite(length) else None for length in (one.planned, one.mapped, one.true))
    things = ", ".join(dict.fromkeys(touch.thing for touch in one.touched))
    return (
        one.group, one.setting.room.name, one.state.value, one.reason, "yes" if one.arrived else "no", things,
        start[0], start[1], goal.x, goal.y, *lengths, one.way, one.routes, one.time,
        100 * one.off, math.degrees(one.turned), 100 * one.lost,
    )  # fmt: skip


def write(found: Reproduction, out: Path) -> None:
    """Write summary.json, runs.csv with a row a trip, and the maps into an existing directory.

    Raises:
        FormatError: If it can't hold them.
    """
    write_runs(found, out, [table for table in found.findings.tables if table.columns == EACH])
