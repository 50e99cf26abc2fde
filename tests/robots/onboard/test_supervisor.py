"""The virtual environment supervisor: walls aren't obstacles, others are told, what's looked through is freed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from interfaces.teleop.architectures import Immediate
from interfaces.teleop.architectures.compositions import robot_surroundings
from robots.ipr.parameters import IPR
from robots.mobile.position import FusedPosition
from robots.mobile.robot import BareBody, place
from robots.onboard.avoidance import SonarMount
from robots.onboard.driving import Drive, Posture
from robots.onboard.supervisor import EnvironmentSupervisor, SupervisorConfig
from vrs.errors import InvalidValueError
from vrs.mobile import Grid, VirtualEnvironment

GRID = Grid((60, 40), 0.1)
AHEAD = SupervisorConfig((SonarMount(0.2, 0.0, 0.0),))
"""One sonar that looks ahead."""
HERE = (1.0, 2.05, 0.0)
NOTHING = math.inf


def wall_at(m: int) -> np.ndarray:
    known = np.zeros(GRID.shape, bool)
    known[m] = True
    return known


def supervisor(known: np.ndarray | None = None, config: SupervisorConfig = AHEAD) -> EnvironmentSupervisor:
    return EnvironmentSupervisor(GRID, np.zeros(GRID.shape, bool) if known is None else known, config)


@pytest.mark.parametrize("room", ["furnished", "empty"])
@pytest.mark.parametrize("seed", range(2))
def test_an_unchanged_room_gives_no_new_cells(room: str, seed: int) -> None:
    """Some metres each through known rooms, with noise, lost echoes and the position that the robot has."""
    body = BareBody(IPR, room=place(room).known(), rng=seed)
    around = robot_surroundings(body, Posture(*body.posture.tolist()), Immediate(), 0.05)
    position, rng = FusedPosition(body), np.random.default_rng(seed)
    drive, wanted, told, way = Drive(0.0, 0.0), Drive(0.0, 0.0), 0, 0.0
    for k in range(500):
        if k % 30 == 0:
            wanted = Drive(float(rng.uniform(0.2, 0.5)), float(rng.uniform(-0.6, 0.6)))
        drive = around.drive(wanted, position.posture(), now=0.05 * k, v_before=drive.v)
        told += len(around.supervisor.changes(now=0.05 * k))
        body.drive(drive.v, drive.w, 3)
        way += 0.05 * abs(drive.v)
    assert way > 2.0
    assert told == 0


@pytest.mark.parametrize("off", [-0.05, 0.0, 0.05])
def test_an_echo_of_a_known_wall_is_the_walls_and_one_before_it_is_not(off: float) -> None:
    known = supervisor(wall_at(30))
    known.hear([1.8 + off], HERE, now=0.0)
    assert known.obstacles == ()
    known.hear([1.3 + off], HERE, now=0.1)
    assert known.obstacles
    assert all(abs(m - 25) <= 2 for m, _ in known.obstacles)


def test_an_echo_from_behind_a_known_thing_is_new() -> None:
    """A known corner at the cone's edge explains echoes from there, and none from further off."""
    known = np.zeros(GRID.shape, bool)
    known[20, 22] = True
    heard = supervisor(known)
    heard.hear([0.87], HERE, now=0.0)
    assert heard.obstacles == ()
    heard.hear([2.0], HERE, now=0.1)
    assert heard.obstacles


@pytest.mark.parametrize("r", [0.1, 0.3, 1.0, 2.9])
@pytest.mark.parametrize("heading", [0.0, 0.4, math.pi / 4, 2.0])
def test_no_cell_is_alone_and_all_are_under_the_arc(r: float, heading: float) -> None:
    middle = (3.0, 2.0, heading)
    heard = supervisor()
    heard.hear([r], middle, now=0.0)
    cells = heard.obstacles
    inside = [c for c in cells if 0 < c[0] < 59 and 0 < c[1] < 39]
    for m, n in inside:
        assert any(max(abs(m - p), abs(n - q)) == 1 for p, q in cells)
    x, y = 3.0 + 0.2 * math.cos(heading), 2.0 + 0.2 * math.sin(heading)
    for m, n in cells:
        dx, dy = 0.1 * m + 0.05 - x, 0.1 * n + 0.05 - y
        assert r - 0.08 < math.hypot(dx, dy) < r + 0.15 + 0.08
    straight = (int((x + (r + 0.01) * math.cos(heading)) / 0.1), int((y + (r + 0.01) * math.sin(heading)) / 0.1))
    assert straight in cells or not (0 <= straight[0] < 60 and 0 <= straight[1] < 40)


def test_what_is_looked_through_is_told_free_a_few_times_and_not_kept() -> None:
    heard = supervisor()
    heard.hear([1.0], HERE, now=0.0)
    added = heard.changes(now=0.0)
    assert added
    assert all(change.occupied for change in added)
    heard.hear([2.5], HERE, now=1.0)
    freed = [change for k in range(10, 60) for change in heard.changes(now=0.1 * k) if not change.occupied]
    seen = {change.cell for change in freed}
    assert seen
    assert seen <= {change.cell for change in added}
    assert (22, 20) in seen
    assert len(freed) == AHEAD.repeats * len(seen)
    assert all(change.seen == 1.0 for change in freed)


def test_a_lost_echo_frees_nothing_and_three_do() -> None:
    heard = supervisor()
    heard.hear([1.0], HERE, now=0.0)
    cells = heard.obstacles
    for k in (1, 2):
        heard.hear([NOTHING], HERE, now=0.1 * k)
        assert heard.obstacles == cells
    heard.hear([math.nan], HERE, now=0.3)
    assert (22, 20) not in heard.obstacles


def test_another_sonar_that_looks_through_leaves_its_part_of_an_arc_free() -> None:
    both = SupervisorConfig((SonarMount(0.2, 0.0, 0.0), SonarMount(0.2, 0.0, 0.2)))
    alone, beside = supervisor(wall_at(39), both), supervisor(wall_at(39), both)
    alone.hear([2.0, NOTHING], HERE, now=0.0)
    beside.hear([2.0, 2.8], HERE, now=0.0)
    assert set(beside.obstacles) < set(alone.obstacles)
    assert max(n for _, n in beside.obstacles) < max(n for _, n in alone.obstacles)


def test_what_is_seen_all_along_is_told_at_a_bounded_rate_often_enough_to_live() -> None:
    heard, environment = supervisor(), VirtualEnvironment(GRID.shape)
    told, first = 0, ()
    for k in range(200):
        now = 0.1 * k
        heard.hear([1.0], HERE, now=now)
        changes = heard.changes(now=now)
        told += len(changes)
        environment.add([change.cell for change in changes], now)
        first = first or environment.obstacles(now)
        assert environment.obstacles(now) == first
    assert told <= 41 * len(first)


def test_a_report_is_bounded_and_nothing_is_left_out() -> None:
    config = SupervisorConfig((SonarMount(0.2, 0.0, 0.0),), most=5)
    heard = supervisor(config=config)
    heard.hear([2.0], HERE, now=0.0)
    told = []
    while changes := heard.changes(now=0.0):
        assert len(changes) <= 5
        told += [change.cell for change in changes]
    assert sorted(told) == list(heard.obstacles)


def test_what_is_kept_is_bounded_in_time_and_number() -> None:
    config = SupervisorConfig((SonarMount(0.2, 0.0, 0.0),), most_kept=10)
    heard = supervisor(config=config)
    for k in range(20):
        heard.hear([2.0 + 0.02 * k], (1.0, 2.0, 0.1 * k), now=0.1 * k)
    heard.hear([NOTHING], HERE, now=2.0)
    assert len(heard.obstacles) <= 10
    heard.hear([NOTHING], (1.0, 2.0, math.pi), now=2.0 + config.memory)
    assert heard.obstacles == ()


def test_echoes_from_outside_the_grid_are_left_out() -> None:
    heard = supervisor()
    heard.hear([2.0], (5.5, 2.0, 0.0), now=0.0)
    heard.hear([2.0], (-50.0, 2.0, 0.0), now=0.1)
    assert heard.obstacles == ()


def test_wrong_values_are_refused() -> None:
    with pytest.raises(InvalidValueError):
        SupervisorConfig(())
    with pytest.raises(InvalidValueError):
        SupervisorConfig(AHEAD.mounts, tolerance=math.nan)
    with pytest.raises(InvalidValueError):
        SupervisorConfig(AHEAD.mounts, most=0)
    with pytest.raises(InvalidValueError):
        supervisor(np.zeros((3, 3), bool))
    with pytest.raises(InvalidValueError):
        supervisor().hear([1.0, 2.0], HERE, now=0.0)
    with pytest.raises(InvalidValueError):
        supervisor().hear([1.0], HERE, now=math.inf)
