"""The extended architecture: the virtual environment learns obstacles and forgets them, and nobody is run into."""

from __future__ import annotations

import itertools
import math
import os
import random
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import pytest

from interfaces.lab.driving.run import run
from interfaces.messages.sites import ArchitectureReport
from interfaces.runs.drive_run import DriveCase, DriveRun
from interfaces.teleop.architectures import OperatorSurroundings, RobotSurroundings
from interfaces.teleop.architectures.compositions import echoes_of, grid_of
from robots.ipr.parameters import IPR
from robots.mobile.chassis import SonarModel
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.robot import BareBody, place
from robots.mobile.sensing import SonarRing
from robots.onboard.avoidance import AvoidanceConfig, ObstacleAvoidance, Outline, SonarMount
from robots.onboard.driving import Drive, Posture
from robots.onboard.movers import MoversConfig, MoverTracker, Yielding, YieldingConfig
from robots.onboard.supervisor import CellChange, EnvironmentSupervisor, SupervisorConfig
from robots.rooms import EMPTY, Room, read_room
from vrs.mobile import Avoidance, DriveLimits, Grid, VirtualEnvironment, advanced

PEOPLE = int(os.environ.get("VRS_PERSON_SEEDS", "2"))
"""How many seeds meet somebody who walks through; 50 for the record."""
DELAY = 0.1
CHANGING = """room 1
size 12.5 6.1
start 1.5 3.05 0
wall 0 0  12.5 0
wall 12.5 0  12.5 6.1
wall 12.5 6.1  0 6.1
wall 0 6.1  0 0
box 4.2 3.1  0.8 0.8  unknown from=3 until=12
column 3.6 1.6 0.2    unknown from=3 until=12
"""
"""As the room of Fig. 13, and sooner over."""


def surroundings(walls: np.ndarray | None = None) -> OperatorSurroundings:
    limits = DriveLimits(0.5, math.radians(45), 0.52, 2.6)
    return OperatorSurroundings(VirtualEnvironment((30, 20), walls=walls), Avoidance(limits, 0.4))


BLOCK = [(m, n) for m in (10, 11, 12) for n in (7, 8, 9)]


Told: TypeAlias = tuple[tuple[CellChange, ...], float]
"""What a report says changed, and when it was said [s]."""


def told(time: float, seen: float, occupied: bool, cells: list[tuple[int, int]] = BLOCK) -> Told:
    return tuple(CellChange(cell, seen, occupied) for cell in cells), time


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_of_each_cell_the_last_observation_counts_in_whatever_order_reports_come(order: tuple[int, ...]) -> None:
    reports = [told(0.0, 0.0, True), told(1.0, 1.0, False, BLOCK[:3]), told(2.0, 2.0, True, BLOCK[1:2])]
    there = surroundings()
    for k, which in enumerate(order):
        there.receive(*reports[which], now=2.1 + 0.01 * k)
    assert there.environment.obstacles(2.2) == tuple(sorted(set(BLOCK) - {BLOCK[0], BLOCK[2]}))


def test_any_order_with_losses_and_repeats_ends_as_the_observations_that_came() -> None:
    """Walls beside all the cells, so that none dies within the three seconds."""
    rng, walls = random.Random(5), np.zeros((30, 20), bool)
    walls[[9, 11, 13], 6:11] = True
    cells = [(m, n) for m in (10, 12) for n in (7, 8, 9)]
    for _ in range(30):
        history = [told(0.1 * k, 0.1 * k, rng.random() < 0.6, rng.sample(cells, 4)) for k in range(30)]
        come = [report for report in history if rng.random() < 0.7] * 2
        rng.shuffle(come)
        there = surroundings(walls)
        for report in come:
            there.receive(*report, now=3.0)
        last = {change.cell: change for report in sorted(come, key=lambda r: r[1]) for change in report[0]}
        assert there.environment.obstacles(3.0) == tuple(sorted(c for c, change in last.items() if change.occupied))


def test_a_cell_lives_from_when_it_was_seen_whatever_the_clocks_say() -> None:
    for offset in (0.0, 1000.0):
        there = surroundings()
        there.receive(*told(0.0, 0.0, True, []), now=offset + 0.1)
        # The report of t = 1 takes 3 s longer than the first; a corner of three by three lives 6 s.
        there.receive(*told(1.0, 1.0, True), now=offset + 4.1)
        assert len(there.environment.obstacles(offset + 7.0)) == 9
        assert there.environment.obstacles(offset + 7.2) == ()
        there.receive(*told(2.0, 2.0, True), now=offset + 50.0)
        assert there.environment.obstacles(offset + 50.0) == ()


def test_cells_that_are_none_and_times_that_are_none_are_left_out() -> None:
    there = surroundings()
    there.receive(*told(0.0, 0.0, True, [(-1, 0), (0, 20), (30, 0)]), now=0.0)
    there.receive(*told(0.0, math.nan, True), now=0.0)
    assert there.environment.obstacles(0.0) == ()


def test_the_virtual_robot_stands_before_what_was_reported() -> None:
    """The cells come while it drives; it brakes, and drives on when they're gone."""
    wall = [(m, n) for m in (18, 19) for n in range(20)]
    there, posture, before = surroundings(), Posture(0.5, 1.0, 0.0), Drive(0.0, 0.0)
    for k in range(150):
        now = 0.1 * k
        if 5 <= k < 75 and k % 10 == 5:
            there.receive(*told(now, now, True, wall), now=now)
        elif k == 75:
            there.receive(*told(now, now, False, wall), now=now)
        before = there.command(Drive(0.3, 0.0), before, posture, now=now)
        posture = Posture(posture.x + 0.1 * before.v, posture.y, 0.0)
        if k < 75:
            assert posture.x + 0.4 < 1.8 + 1e-9
    assert posture.x > 2.0


def test_changes_count_on_the_wire() -> None:
    plain = ArchitectureReport(1, 0, Posture(0, 0, 0), 0)
    cells, said_at = told(0.0, 0.0, True)
    full = ArchitectureReport(1, 0, Posture(0, 0, 0), 0, said_at, cells)
    assert plain.size == 48
    assert full.size == 48 + 10 + 6 * len(BLOCK)


def on_board(heard_at: Callable[[], float] = lambda: -10.0) -> RobotSurroundings:
    """A robot whose newest scan is of then, and whose controller's path has ended here."""
    mounts = (SonarMount(0.2, 0.0, 0.0), SonarMount(-0.3, 0.0, math.pi))
    outline = Outline(0.2, 0.32, 0.225)
    avoidance = ObstacleAvoidance(AvoidanceConfig(outline, mounts, memory=0.0))
    grid = Grid((60, 40), 0.1, (-3.0, -2.0))
    return RobotSurroundings(
        lambda: (heard_at(), [0.5, math.inf]),
        EnvironmentSupervisor(grid, np.zeros(grid.shape, bool), SupervisorConfig(mounts)),
        avoidance,
        MoverTracker(MoversConfig(mounts)),
        Yielding(YieldingConfig(outline), avoidance),
        lambda: (0.0, 0.0, (0.0, 0.0)),
    )


@pytest.mark.parametrize("bearing_deg", range(0, 360, 40))
def test_beside_the_end_of_its_path_the_robot_comes_back(bearing_deg: int) -> None:
    """What it went out of the way of has gone; the field would lead along the path, on which nothing is left."""
    here, b = on_board(), math.radians(bearing_deg)
    posture, drive = Posture(math.cos(b), math.sin(b), 0.3), Drive(0.0, 0.0)
    for k in range(400):
        drive = here.drive(Drive(0.0, 0.0), posture, now=0.05 * k, v_before=drive.v)
        posture = Posture(*advanced(posture, *drive, 0.05))
    assert math.hypot(posture.x, posture.y) < 0.05
    assert drive == Drive(0.0, 0.0)


def test_a_robot_that_is_hardly_off_is_left_to_its_controller() -> None:
    here = on_board()
    assert here.drive(Drive(0.02, 0.1), Posture(0.1, 0.1, 0.0), now=0.0, v_before=0.0) == Drive(0.02, 0.1)


def test_a_scan_is_placed_where_the_robot_was_when_it_was_taken() -> None:
    # A scan of 0.02 s comes at 0.04 s, when the robot is a metre further: half of it counts.
    times = [-1.0]
    late = on_board(lambda: times[-1])
    late.drive(Drive(0.0, 0.0), Posture(0.0, 0.0, 0.0), now=0.0, v_before=0.0)
    times.append(0.02)
    late.drive(Drive(0.0, 0.0), Posture(1.0, 0.0, 0.0), now=0.04, v_before=0.0)
    # From x = 0.5 the sonar, 0.2 m before it, hears something 0.5 m ahead: 1.2 m, cell 42.
    assert (42, 20) in late.supervisor.obstacles
    assert (47, 20) not in late.supervisor.obstacles


def seen_at(room: Room, drive: DriveRun) -> dict[str, list[float]]:
    """When an echo of each unknown thing came back, by the true postures [s]."""
    ring = SonarRing(IPR, SonarModel(), np.random.default_rng(0))
    plan, found = FloorPlan(room, IPR.sonar_height), {}
    for thing in (*room.blocks, *room.columns):
        if thing.known:
            continue
        blocks, columns = ((thing,), ()) if thing in room.blocks else ((), (thing,))
        alone = FloorPlan(Room("alone", room.length, room.width, room.start, blocks, columns))
        found[thing.name] = times = []
        for t, posture in zip(drive.t[::2], drive.real[::2], strict=True):
            rays = ring.rays(tuple(posture.tolist()))
            nearest = plan.cast(*rays, t, ring.reach).reshape(16, -1).min(axis=1)
            own = alone.cast(*rays, t, ring.reach).reshape(16, -1).min(axis=1)
            if ((own <= nearest + 1e-9) & (own < 0.98 * ring.reach)).any():
                times.append(float(t))
    return found


def near(room: Room, name: str) -> set[tuple[int, int]]:
    """Cells within 0.15 m of an unknown thing."""
    blocks = tuple(block for block in room.blocks if block.name == name)
    columns = tuple(column for column in room.columns if column.name == name)
    plan = FloorPlan(Room("alone", room.length, room.width, room.start, blocks, columns))
    m, n = round(room.length / 0.1), round(room.width / 0.1)
    start = (*blocks, *columns)[0].start
    return {
        (i, j)
        for i in range(m)
        for j in range(n)
        if plan.clearance(0.1 * i + 0.05, 0.1 * j + 0.05, max(start, 0.0)) < 0.15
    }


@pytest.mark.parametrize("seed", range(2))
def test_obstacles_are_learnt_within_two_seconds_of_being_seen_and_forgotten_in_their_lifetime(seed: int) -> None:
    room = read_room(CHANGING)
    case = DriveCase("extended", "datagrams", f"constant:{DELAY}", "bare", "wander", seed, 24.0, room=room)
    drive = run(case)
    assert drive.collisions == 0
    assert drive.limits_passed() == 0
    for name, times in seen_at(room, drive).items():
        thing = next(thing for thing in room.things if thing.name == name)
        assert times
        cells = near(room, name)
        appeared = next(t for t, there in drive.learned if cells & set(there))
        assert thing.start <= appeared <= times[0] + DELAY + 2.0
    last = thing.end + DELAY + VirtualEnvironment().longest
    assert all(there == () for t, there in drive.learned if t > last)
    assert drive.learned[-1][0] > last


@pytest.mark.parametrize("seed", range(PEOPLE))
def test_nobody_who_walks_through_is_run_into(seed: int) -> None:
    """Collisions of any kind count: also the person's with the robot while it stands."""
    length = 20.0 if PEOPLE <= 2 else 40.0
    drive = run(DriveCase("extended", "datagrams", "mon@3.3", "bare", "wander", seed, length, room="fig13_person"))
    assert place("fig13_person").people
    assert drive.touched == ()
    assert drive.limits_passed() == 0


def test_on_a_drive_echoes_are_as_old_as_the_drive_says() -> None:
    """The body's own time is another one: it may have stood there for long."""
    with BareBody(IPR, room=place("furnished"), rng=0) as body:
        while body.time < 5.0:
            body.drive(0.0, 0.0, 30)
        scan, own = echoes_of(body, 4.0), body.sonar
        assert scan is not None
        assert own is not None
        assert scan[0] == pytest.approx(own.time - 4.0)
        assert 0.0 <= scan[0] <= body.time - 4.0
        assert list(scan[1]) == own.ranges.tolist()


def test_where_there_is_no_room_cells_lie_about_the_start() -> None:
    grid = grid_of(EMPTY, Posture(3.0, -2.0, 1.0))
    width, height = (n * grid.cell for n in grid.shape)
    assert grid.origin == pytest.approx((3.0 - width / 2, -2.0 - height / 2))
    room = place("furnished")
    inside = grid_of(room, Posture(3.0, 2.0, 0.0))
    for n, size in zip(inside.shape, (room.length, room.width), strict=True):
        assert 0.0 <= n * inside.cell - size < inside.cell
