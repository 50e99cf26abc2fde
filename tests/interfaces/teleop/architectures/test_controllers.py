"""What each architecture makes of commands that come late and together."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from interfaces.messages.sites import ArcPacket
from interfaces.teleop.architectures import ARCHITECTURES, Constants, DriveController, controller
from robots.onboard.driving import Posture
from vrs.errors import InvalidValueError
from vrs.segment import ArcSegment

START = Posture(0.0, 0.0, 0.0)
PERIOD = 0.05


def arcs(speeds: list[tuple[float, float]]) -> list[ArcSegment]:
    made: list[ArcSegment] = []
    posture: tuple[float, float, float] = START
    for k, (v, w) in enumerate(speeds):
        made.append(ArcSegment(0.1 * k, 0.1, posture, v, w, k))
        x, y, theta = made[-1].value(made[-1].end).tolist()
        posture = (x, y, theta)
    return made


def driven(made: DriveController, packets: dict[int, list[ArcSegment]], steps: int) -> tuple[Posture, list[float]]:
    """Drive a robot like the model by a controller; packets by the step at which they come."""
    posture, v, speeds = START, 0.0, []
    for k in range(steps):
        now = k * PERIOD
        if k in packets:
            made.receive(packets[k], ArcPacket((), packets[k][-1].end), now=now)
        drive = made.control(posture, now=now, v_before=v)
        x, y, theta = ArcSegment(0.0, PERIOD, posture, drive.v, drive.w).value(PERIOD).tolist()
        posture, v = Posture(x, y, theta), drive.v
        speeds.append(drive.v)
    return posture, speeds


def ramp(n: int) -> list[tuple[float, float]]:
    """A start, a curve and a stop within the limits, n commands."""
    return [(0.3 * math.sin(math.pi * k / (n - 1)), 0.4 * math.sin(math.tau * k / (n - 1))) for k in range(n)]


@pytest.mark.parametrize("name", list(ARCHITECTURES))
def test_commands_in_time_are_followed_by_every_architecture(name: str) -> None:
    path = arcs(ramp(60))
    end = path[-1].value(path[-1].end)
    made = controller(name, START, Constants())
    posture, _ = driven(made, {2 * k + 2: [one] for k, one in enumerate(path)}, 500)
    assert math.hypot(posture.x - end[0], posture.y - end[1]) < 0.02
    assert made.executed == len(path)


def test_of_commands_that_come_together_i_keeps_the_last_and_ii_all() -> None:
    path = arcs([(0.1, 0.0)] * 20 + [(0.2, 0.0)] * 20 + [(0.0, 0.0)])
    late = {50: path}
    lost, _ = driven(controller("I", START, Constants()), late, 400)
    kept, _ = driven(controller("II", START, Constants()), late, 400)
    assert lost.x == pytest.approx(0.0, abs=1e-9)
    assert kept.x == pytest.approx(20 * 0.01 + 20 * 0.02, abs=1e-9)


def test_i_stands_when_nothing_more_comes() -> None:
    path = arcs([(0.2, 0.0)])
    _, speeds = driven(controller("I", START, Constants()), {4: path}, 100)
    assert [round(k * PERIOD, 2) for k, v in enumerate(speeds) if v] == [
        round(0.2 + PERIOD * k, 2) for k in range(10)
    ]


@pytest.mark.parametrize("name", ["III", "III-capped"])
def test_iii_follows_a_path_that_comes_at_once(name: str) -> None:
    path = arcs(ramp(60))
    end = path[-1].value(path[-1].end)
    posture, speeds = driven(controller(name, START, Constants()), {40: path}, 600)
    assert math.hypot(posture.x - end[0], posture.y - end[1]) < 0.02
    assert not any(speeds[:40])


def test_timeline_stops_on_the_path_where_it_knows_no_further_and_goes_on_later() -> None:
    path = arcs(ramp(60))
    first, rest = path[:30], path[30:]
    made = controller("timeline", START, Constants())
    packets = {2 * k + 2: [one] for k, one in enumerate(first)} | {300: rest}
    posture, speeds = driven(made, packets, 299)
    known = first[-1].value(first[-1].end)
    assert math.hypot(posture.x - known[0], posture.y - known[1]) < 0.01
    assert speeds[-1] == pytest.approx(0.0, abs=1e-3)
    made = controller("timeline", START, Constants())
    posture, speeds = driven(made, packets, 700)
    end = path[-1].value(path[-1].end)
    assert math.hypot(posture.x - end[0], posture.y - end[1]) < 0.01
    assert max(abs(b - a) for a, b in pairwise(speeds)) <= 0.52 * PERIOD + 1e-9
    assert made.executed == len(path)


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InvalidValueError, match="III-capped"):
        controller("IV", START, Constants())
