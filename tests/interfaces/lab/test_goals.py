"""`vrs lab goals`: small cases of its trips, its yardstick, and the same bytes with one worker and two."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from interfaces.cli.main import app
from interfaces.lab import Study, reproduce
from interfaces.lab.claims import Findings, Paper, PaperPart
from interfaces.lab.goals import study as goals_study
from interfaces.lab.goals.scenes import FURNITURE, LATE, PHYSICS, ROUND, SHUT, Shortest, setting
from interfaces.lab.goals.study import (
    EACH,
    Measured,
    conclude_asked,
    conclude_physics,
    conclude_shut,
    measure,
    study_of,
    write,
)
from interfaces.lab.goals.trial import Trip, TripSetting
from robots.ipr.parameters import IPR
from robots.mobile.navigation import route_map
from robots.mobile.robot import Collision
from robots.onboard.journey import Goal, JourneyState
from robots.onboard.routes import Route, RouteProblem
from robots.robot import load
from robots.rooms import Block, Room
from vrs.errors import InvalidValueError


def test_the_shortest_way_round_a_box_is_that_of_geometry() -> None:
    square = Room("square", 6.0, 6.0, blocks=(Block("box", 3.0, 3.0, 2.0, 2.0, 0.0, 1.0),))
    radius = 0.3
    found = Shortest(square, radius).length((1.0, 3.0), (5.0, 3.0))
    # A tangent to the circle about each corner, its arc, and the side between them.
    far = math.hypot(1.0, 1.0)
    arc = math.pi / 4 + math.asin(radius / far)
    exact = 2 * math.sqrt(far**2 - radius**2) + 2.0 + 2 * radius * arc
    assert found == pytest.approx(exact, rel=0.02)
    assert Shortest(square, 2.0).length((1.0, 3.0), (5.0, 3.0)) == math.inf
    assert Shortest(square, 0.1).length((0.5, 0.5), (5.5, 0.5)) == pytest.approx(5.0, abs=0.03)


def test_settings_repeat_and_are_what_their_group_says() -> None:
    for group in (FURNITURE, ROUND):
        one, other = setting(group, 3, 1), setting(group, 3, 1)
        assert (one.start, one.goal, one.room) == (other.start, other.goal, other.room)
        assert setting(group, 4, 1).start != one.start
    closed = setting(ROUND, 3, 1).room
    assert sum(door.share(100.0) == 0.0 for door in closed.doors) == 3
    late = setting(LATE, 3, 1).room
    assert sum(door.share(0.0) < door.share(100.0) for door in late.doors) == 1
    assert setting(PHYSICS, 3, 0).body == load("ipr").usual_body


@pytest.mark.parametrize("group", [FURNITURE, PHYSICS])
def test_a_goal_is_reached_and_nothing_is_touched(group: str) -> None:
    found, rivals, _ = measure(Study(11), f"{group}:2")
    assert not rivals
    assert found.arrived, found.reason
    assert not found.touched
    assert 0.98 <= found.ratio <= 1.15
    assert found.lost < 0.06
    assert np.hypot(*(found.track[-1, :2] - (found.setting.goal.x, found.setting.goal.y))) == found.off


def test_two_workers_write_what_one_writes(tmp_path: Path) -> None:
    paper = Paper(
        "goals",
        "two trips",
        (PaperPart("goals", measure, conclude_asked, (f"{FURNITURE}:1", f"{ROUND}:1")),),
    )
    written = []
    for workers in (1, 2):
        out = tmp_path / str(workers)
        out.mkdir()
        write(reproduce(paper, Study(5), workers=workers), out)
        written.append({file.name: file.read_bytes() for file in sorted(out.iterdir())})
    assert written[0] == written[1]
    assert {"summary.json", "runs.csv", "goals_furniture.svg", "goals_round.svg"} <= set(written[0])
    rows = written[0]["runs.csv"].decode().splitlines()
    assert rows[0] == ",".join(EACH)
    assert len(rows) == 3
    claims = json.loads(written[0]["summary.json"])["claims"]
    assert claims[0]["measured"] == 100


WHERE = TripSetting(Room("square", 6.0, 6.0), (1.0, 1.0, 0.0), Goal(5.0, 5.0, 0.0), (0, 1, 0))
ARRIVED = (JourneyState.ARRIVED, "", 5.2, 20.0, 1, 5.2, 0.01, 0.01, 0.02, (), np.zeros((2, 3)))
FAILED = {"state": JourneyState.FAILED, "problem": RouteProblem.NO_WAY}


LACKING = {"off": 1.0, "touched": (Collision(1.0, "chair"),)}
"""What comes of a trip without what it takes."""


def found(group: str, *, mapped: float = 5.0, **changes: Any) -> Measured:
    trip = replace(Trip(group, WHERE, mapped, mapped, *ARRIVED), **changes)
    lacking = replace(Trip(group, WHERE, mapped, mapped, *ARRIVED), **LACKING)
    return Measured(trip, dict.fromkeys(goals_study.RIVALS[group], lacking), 1.3 * mapped)


@pytest.fixture(name="without_maps")
def _without_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(goals_study, "maps", lambda _: [])


@pytest.mark.usefixtures("without_maps")
@pytest.mark.parametrize(
    ("group", "changes", "said"),
    [
        (FURNITURE, {"off": 0.051}, ["reached within"]),
        (FURNITURE, {"turned": math.radians(2.1)}, ["reached within"]),
        (FURNITURE, FAILED, ["reached within"]),
        (FURNITURE, {"touched": (Collision(1.0, "chair"),)}, ["without a touch"]),
        (FURNITURE, {"planned": 5.8}, ["longer than"]),
        (FURNITURE, {"planned": math.nan}, ["longer than"]),
        (FURNITURE, {"mapped": math.inf}, ["longer than"]),
        (ROUND, FAILED, ["reached within", "went round"]),
        (LATE, FAILED, ["reached within", "waited for"]),
    ],
)
def test_claims_on_goals_fail_where_a_trip_did(group: str, changes: dict[str, Any], said: list[str]) -> None:
    good = [found(FURNITURE), found(ROUND), found(LATE)] * 3
    assert [claim.claim for claim in conclude_asked(Study(), tuple(good)).claims if not claim.holds] == []
    made = conclude_asked(Study(), (*good, found(group, **changes))).claims
    assert [any(word in claim.claim for word in said) for claim in made] == [not claim.met for claim in made]


@pytest.mark.usefixtures("without_maps")
def test_routes_that_are_mostly_too_long_or_unknown_are_said_so() -> None:
    for changes in ({"planned": 6.0}, {"mapped": math.inf}):
        middle = conclude_asked(
            Study(), tuple(found(group, **changes) for group in (FURNITURE, ROUND, LATE))
        ).claims[2]
        assert "median" in middle.claim
        assert not middle.met


@pytest.mark.usefixtures("without_maps")
def test_claims_on_closed_doors_and_on_physics_fail_where_a_trip_did() -> None:
    def holds(conclude: Callable[..., Findings], *trips: Measured) -> list[bool]:
        return [claim.holds for claim in conclude(Study(), trips).claims]

    shut = found(SHUT, **FAILED)
    assert holds(conclude_shut, shut) == [True]
    for wrong in ({}, FAILED | {"state": JourneyState.ENDED}, FAILED | {"problem": None}):
        assert holds(conclude_shut, shut, found(SHUT, **wrong)) == [False]
    assert holds(conclude_physics, found(PHYSICS)) == [True, True]
    assert holds(conclude_physics, found(PHYSICS), found(PHYSICS, **FAILED)) == [False, True]
    assert holds(conclude_physics, found(PHYSICS, touched=(Collision(1.0, "chair"),))) == [True, False]


@pytest.mark.slow
@pytest.mark.usefixtures("without_maps")
def test_without_what_they_say_claims_on_goals_hold_no_more() -> None:
    # A robot that waits takes long: the last one is made up.
    trips = {group: measure(Study(5), f"{group}:0") for group in (FURNITURE, ROUND)} | {LATE: found(LATE)}
    claims = conclude_asked(Study(), tuple(trips.values())).claims
    assert [claim.claim for claim in claims if not claim.holds] == []
    for group, one in trips.items():
        for what, lacking in one.rivals.items():
            off: dict[str, Measured] = trips | {group: one._replace(trip=lacking)}
            planted = conclude_asked(Study(), tuple(off.values())).claims
            said = [claim for claim in planted if what in claim.counterfactual.what]
            assert said
            assert not any(claim.holds for claim in said)


def test_a_way_through_a_door_leads_through_it() -> None:
    for group in (ROUND, LATE):
        made = setting(group, 3, 1)
        closed = [door.at(0.0) for door in made.room.doors if door.share(0.0) == 0.0]
        route = route_map(made.room, IPR.footprint).route(made.start[:2], (made.goal.x, made.goal.y))
        assert isinstance(route, Route)
        places = route.places(0.05)
        assert min(np.hypot(*(places - (door.x, door.y)).T).min() for door in closed) < 0.4


def test_a_study_has_as_many_goals_as_are_asked_for() -> None:
    for goals in (2, 10, 100):
        assert len(study_of(goals).parts[0].cases) == max(goals, 3)


@pytest.mark.parametrize("option", [["--architecture", "III"], ["--length", "20"], ["--record"]])
def test_options_of_other_experiments_are_refused(tmp_path: Path, option: list[str]) -> None:
    found = CliRunner().invoke(app, ["lab", "goals", "--out", str(tmp_path / "o"), *option])
    assert isinstance(found.exception, InvalidValueError)
    assert "goals" in str(found.exception)
    assert not (tmp_path / "o").exists()
