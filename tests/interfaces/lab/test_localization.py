"""Localization in whole: what it finds, how sure it is, what it says it can't know."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from interfaces.cli.main import app
from interfaces.lab.claims import Findings, Results, Study
from interfaces.lab.driving.run import run
from interfaces.lab.driving.sweep import attributed
from interfaces.lab.localization.accuracy import METHODS, RIVALS
from interfaces.lab.localization.searching import (
    Twice,
    conclude_carried,
    conclude_starts,
    conclude_symmetric,
    distinctive,
    measure_carried,
    measure_starts,
    measure_symmetric,
    symmetric,
)
from interfaces.lab.localization.study import conclude_axes, measure_axis
from interfaces.lab.localization.trial import CONTROL, body_of, drive, setting, wander
from interfaces.runs.drive_run import DriveCase
from robots.mobile.apartments import ApartmentConfig, apartment
from robots.mobile.chassis import MobileReality
from robots.mobile.floor_plan import FloorPlan, plan_map
from robots.onboard.driving import STAND, Drive
from robots.onboard.global_localization import locate
from robots.onboard.localization import PaperLocalizer
from robots.onboard.localizer import Localizer, Status
from robots.onboard.map_building import MapBuilder, Surveyor
from robots.rooms import Room, read_room
from vrs.mobile import wrapped

ROOM = read_room(
    "room 1\nsize 6 4.5\nstart 1.5 1.5 20\nwall 0 0 6 0\nwall 6 0 6 4.5\nwall 6 4.5 0 4.5\nwall 0 4.5 0 0\n"
    "box 5.6 3.9 0.7 1.0\nbox 3 4.2 1.2 0.5 unknown\ncolumn 3.4 1.2 0.2 unknown\n"
)
CROWDED = Room(
    "crowded", 6, 4.5, ROOM.start, ROOM.blocks, ROOM.columns,
    read_room("room 1\nsize 6 4.5\nperson 0.2 repeat 0,4.6,0.6 6,4.6,3 8,4.6,3 14,4.6,0.6 18,4.6,0.6\n").people,
)  # fmt: skip


def test_a_robot_that_slips_knows_where_it_is_to_the_centimetre_and_how_well_it_knows() -> None:
    chosen = setting(CROWDED, 1, 0.03, (4, 1))
    plan = plan_map(CROWDED)
    with body_of(chosen) as body:
        listeners = {"ours": Localizer(plan, body.truth), "paper": PaperLocalizer(plan, body.truth)}
        record = drive(body, 20.0, wander(chosen), listeners)
    ours, paper = record.tracks["ours"], record.tracks["paper"]
    assert np.quantile(ours.place, 0.95) < 0.01
    assert np.quantile(ours.turn, 0.95) < math.radians(0.3)
    assert ours.place.max() < 0.1
    values = ours.normalised[20:]
    assert 0.8 < values.mean() < 5.0
    assert np.mean(values < 7.81) > 0.85
    # The paper's update works, too, and is some ten times as far off.
    assert np.quantile(paper.place, 0.95) < 0.1
    assert np.quantile(paper.place, 0.95) > 2 * np.quantile(ours.place, 0.95)


def test_a_sudden_slip_is_made_up_for() -> None:
    chosen = setting(ROOM, 0, 0.03, (5, 2))
    with body_of(chosen) as body:
        localizer = Localizer(plan_map(ROOM), body.truth)

        def pushed(t: float) -> None:
            if abs(t - 4.05) < CONTROL / 2:
                x, y, theta = body.truth
                body.carry((x + 0.05, y + 0.04, theta + 0.1))

        record = drive(body, 6.0, lambda _, __: Drive(0.0, 0.1), {"": localizer}, pushed)
    assert localizer.status is Status.TRACKING
    assert record.tracks[""].place[round(4.6 / CONTROL) :].max() < 0.02
    assert record.tracks[""].place[round(4.15 / CONTROL)] > 0.05


def test_a_scan_counts_once_and_waits_for_the_odometry() -> None:
    chosen = setting(ROOM, 0, 0.03, (8, 1))
    with body_of(chosen) as body:
        localizer = Localizer(plan_map(ROOM), body.truth)
        localizer.move(body.time, body.reckoned)
        body.drive(0.0, 0.0, 15)
        scan = body.laser
        assert scan is not None
        assert not localizer.see(scan)
        body.drive(0.0, 0.0, 3)
        localizer.move(body.time, body.reckoned)
        assert localizer.see(scan)
        told = localizer.covariance
        assert not localizer.see(scan)
        assert np.array_equal(localizer.covariance, told)


def test_a_map_that_is_built_has_the_walls_and_nobody_who_walks() -> None:
    chosen = setting(CROWDED, 1, 0.03, (6, 3))
    with body_of(chosen) as body:
        builder = MapBuilder(body.truth)
        record = drive(body, 40.0, wander(chosen, still=2.0, thorough=True), {"": builder})
    built = builder.built("crowded")
    assert record.tracks[""].place.max() < 0.03
    standing = FloorPlan(Room("", 6, 4.5, blocks=ROOM.blocks, columns=ROOM.columns))
    for line in built.lines.ends:
        for share in (0.1, 0.5, 0.9):
            x, y = (line[0] + share * (line[1] - line[0])).tolist()
            assert standing.clearance(x, y, 0.0) < 0.05
    long = built.lines.lengths > 2.0
    assert long.sum() >= 4
    # What the map says that it doesn't know covers what it's off: the walls' distances.
    walls = plan_map(ROOM, shortest=2.0).lines
    for pose, variance in zip(built.lines.poses[long], built.lines.variances[long], strict=True):
        turn = np.abs(np.remainder(walls.poses[:, 2] - pose[2] + math.pi, math.tau) - math.pi)
        k = int(np.argmin(np.where(turn < 0.1, np.linalg.norm(walls.poses[:, :2] - pose[:2], axis=1), np.inf)))
        off = float((pose[:2] - walls.poses[k, :2]) @ walls.normals[k])
        assert abs(off) < 4 * math.sqrt(variance[0])


@pytest.mark.parametrize("place", ["corridor", "single wall", "room"])
def test_what_can_not_be_known_is_said(place: str) -> None:
    found = measure_axis(Study(1, 2, 2.0), place)
    if place == "room":
        assert found.none > 0.95
        assert found.along < 0.01
    else:
        assert found.named > 0.95
        assert found.along > 5 * found.across
    assert found.inside > 0.7
    assert all(claim.holds for claim in conclude_axes(Study(), (found,)).claims)
    off = {"named": found.middles_named, "none": found.single_none, "along": found.middles_ratio, "across": 1.0}
    lacking = conclude_axes(Study(), (Results(**vars(found) | off),)).claims
    assert not any(claim.holds for claim in lacking)


def hold_by_what_they_say(conclude: Callable[..., Findings], found: Twice) -> None:
    """Claims hold, and don't where what they say is switched off."""
    assert all(claim.holds for claim in conclude(Study(), (found,)).claims)
    assert not any(claim.met for claim in conclude(Study(), (Twice(found.rival, found.rival),)).claims)


def test_a_symmetric_room_is_ambiguous_and_all_places_are_named() -> None:
    measured = measure_symmetric(Study(3, 2, 2.0), "1")
    hold_by_what_they_say(conclude_symmetric, measured)
    found = measured.ours
    assert (found.status, found.named) == ("ambiguous", 2)
    assert found.off < 0.05
    assert symmetric(0).length == symmetric(0).width


@pytest.mark.parametrize("seed", [11, 12])
def test_a_robot_that_was_told_nothing_finds_itself_after_a_turn_on_the_spot(seed: int) -> None:
    room = apartment(seed, ApartmentConfig(rooms=3))
    chosen = setting(room, seed, 0.03, (seed,))
    with body_of(chosen) as body:
        localizer = Localizer(plan_map(room))
        assert localizer.posture is None
        assert localizer.wants_turn
        drive(body, 13.0, lambda _, __: Drive(0.0, 0.6) if localizer.wants_turn else STAND, {"": localizer})
        assert localizer.status is Status.TRACKING
        assert [event.status for event in localizer.events] == [Status.TRACKING]
        x, y, theta = localizer.posture or (math.nan,) * 3
        assert math.dist((x, y), body.truth[:2]) < 0.02
        assert abs(wrapped(theta - body.truth[2])) < math.radians(1)
        # On a map of another apartment it doesn't pretend.
        surveyor = Surveyor()

        def gather(_: float) -> None:
            surveyor.move(body.time, body.reckoned)
            surveyor.see(body.laser)

        drive(body, 12.0, lambda _, __: Drive(0.0, 0.6), {}, gather)
        other = plan_map(apartment(seed + 100, ApartmentConfig(rooms=2)))
        assert len(locate(other, surveyor.surroundings())) != 1


def test_a_filter_that_begins_anywhere_does_not_find_its_place() -> None:
    found = measure_starts(Study(2), "1:1")
    assert found.answers == {"right": 1}
    assert all(claim.holds for claim in conclude_starts(Study(), (found,)).claims)
    off = found._replace(answers=found.guessed)
    assert not any(claim.met for claim in conclude_starts(Study(), (off,)).claims)


def test_a_robot_that_is_carried_off_notices_and_finds_itself_again() -> None:
    measured = measure_carried(Study(2, 2, 2.0), "1")
    hold_by_what_they_say(conclude_carried, measured)
    found = measured.ours
    assert found.noticed < 3.0
    assert found.recovered < 15.0
    assert found.off < 0.05


def test_the_study_gives_the_same_with_any_number_of_workers(tmp_path: Path) -> None:
    made = []
    for workers in ("1", "2"):
        out = tmp_path / workers
        told = ["lab", "localization", "--runs", "2", "--length", "2", "--starts", "1", "--seed", "4"]
        result = CliRunner().invoke(app, [*told, "--workers", workers, "--out", str(out), "--json"])
        assert result.exit_code == 0, result.output
        made.append({path.name: path.read_bytes() for path in sorted(out.iterdir())})
    assert made[0] == made[1]
    assert sorted(made[0]) == ["localization_errors.svg", "localization_map.svg", "runs.csv", "summary.json"]
    summary = json.loads(made[0]["summary.json"])
    assert {table["name"] for table in summary["tables"]} == {
        "accuracy", "rooms", "unobservable", "starts", "symmetric", "carried",
    }  # fmt: skip
    rows = next(table["rows"] for table in summary["tables"] if table["name"] == "accuracy")
    assert [row[0] for row in rows] == [*METHODS, *RIVALS.values()]
    assert len(made[0]["runs.csv"].splitlines()) == 3


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (["lab", "nonsense"], "experiment must be"),
        (["lab", "localization", "--runs", "1"], "runs must be"),
        (["lab", "--position", "gps"], "position must be"),
        (["lab", "localization", "--robot", "ipr"], "options must be left out"),
    ],
)
def test_bad_input_is_one_line(wrong: list[str], said: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "interfaces.cli", *wrong, "--out", str(tmp_path / "out")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_laser_feeds_the_twins_estimator_and_their_attribution() -> None:
    case = DriveCase("timeline", "datagrams", "none", robot="bare", operator="docking", seed=1, length=12.0)
    wandering = MobileReality(radius_error=(0.01, -0.01), dt=1 / 60)
    off = {}
    for position in ("laser", "odometry"):
        found = run(replace(case, position=position, reality=wandering, room="berths"))
        off[position] = np.hypot(*(found.measured - found.real)[:, :2].T).max()
    assert off["laser"] < 0.02
    assert off["odometry"] > 3 * off["laser"]
    parts = attributed(replace(case, position="laser", reality=wandering, room="berths", length=4.0))
    assert all(sum(part for _, part in one.parts) + one.residual == pytest.approx(one.total) for one in parts)


def test_places_that_look_alike_are_told_from_those_that_do_not() -> None:
    walls = "wall 0 0 8 0\nwall 8 0 8 4\nwall 8 4 0 4\nwall 0 4 0 0\nwall 4 0 4 1.5\nwall 4 2.5 4 4\n"
    # Turned about its middle, this one is itself; with a box more, it isn't.
    twin = f"room 1\nsize 8 4\n{walls}box 1 0.5 0.8 0.4\nbox 7 3.5 0.8 0.4\n"
    assert not distinctive(read_room(twin))
    assert distinctive(read_room(f"{twin}box 6.5 1 0.9 0.5\n"))
