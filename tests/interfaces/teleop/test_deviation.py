"""How far a robot is from its path and how much later, against robots of which both are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from interfaces.teleop.deviation import PathDeviation
from robots.onboard.driving import Posture
from vrs.mobile.model import advanced
from vrs.segment import ArcSegment

T = 0.1


def driven(seed: int, count: int, *, pause: tuple[int, int] = (0, 0)) -> list[ArcSegment]:
    """Arcs of a drive whose speeds wander, standing in a pause."""
    rng = np.random.default_rng(seed)
    arcs, here = [], (0.0, 0.0, 0.0)
    v, w = 0.2, 0.0
    for k in range(count):
        v, w = np.clip(v + rng.normal(0, 0.02), 0.15, 0.5), np.clip(w + rng.normal(0, 0.1), -0.7, 0.7)
        stands = pause[0] <= k < pause[1]
        arcs.append(ArcSegment(k * T, T, here, 0.0 if stands else float(v), 0.0 if stands else float(w)))
        here = advanced(here, arcs[-1].v, arcs[-1].w, T)
    return arcs


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_that_is_late_and_beside_its_path_is_found_there(seed: int) -> None:
    arcs, late, beside = driven(seed, 300), 0.43, 0.03
    path = PathDeviation(0.0, Posture(0.0, 0.0, 0.0))
    for k, arc in enumerate(arcs):
        path.add(arc)
        now = arc.end
        t = now - late
        if t <= 0:
            continue
        x, y, theta = arcs[min(int(t / T), k)].value(t)
        posture = Posture(x - beside * math.sin(theta), y + beside * math.cos(theta), theta)
        found = path.match(posture, now)
        assert found.path_error == pytest.approx(beside, abs=2e-3)
        assert found.time_difference == pytest.approx(late, abs=0.06)
        assert path.place == pytest.approx(t, abs=0.06)


def test_where_the_path_stands_a_robot_that_stands_there_isnt_late() -> None:
    arcs = driven(1, 200, pause=(80, 140))
    path = PathDeviation(0.0, Posture(0.0, 0.0, 0.0))
    for arc in arcs[:140]:
        path.add(arc)
    stop = arcs[80].posture
    at_rest = Posture(*stop)
    for k in range(72):
        path.match(Posture(*arcs[k].posture), k * T + 0.3)
    for noise in (-0.008, 0.0, 0.008):
        found = path.match(Posture(stop[0] + noise, stop[1], stop[2]), 12.0)
        assert found.time_difference == 0.0
    for arc in arcs[140:]:
        path.add(arc)
    # The path has gone on for 0.4 s, and the robot still stands there.
    assert path.match(at_rest, 14.4).time_difference == pytest.approx(0.4, abs=0.02)


def test_a_path_that_crosses_itself_is_followed_and_not_cut() -> None:
    v, w = 0.4, 0.8
    here, path = (0.0, 0.0, 0.0), PathDeviation(0.0, Posture(0.0, 0.0, 0.0))
    arcs = []
    for k in range(250):
        arcs.append(ArcSegment(k * T, T, here, v, w if k < 79 else -w))
        here = advanced(here, arcs[-1].v, arcs[-1].w, T)
        path.add(arcs[-1])
    for k in range(5, 250):
        found = path.match(Posture(*arcs[k].posture), k * T + 0.2)
        assert found.time_difference == pytest.approx(0.2, abs=0.03)


def test_a_way_back_beside_the_way_out_isnt_taken_for_it() -> None:
    path = PathDeviation(0.0, Posture(0.0, 0.0, 0.0))
    for k in range(100):
        path.add(ArcSegment(k * T, T, (0.04 * k, 0.0, 0.0), 0.4, 0.0))
    for k in range(100, 200):
        path.add(ArcSegment(k * T, T, (0.04 * (200 - k), 0.06, 0.0), -0.4, 0.0))
    for k in range(2, 70):
        found = path.match(Posture(0.04 * k, 0.04, 0.0), k * T + 12.0)
        assert found.path_error == pytest.approx(0.04, abs=1e-6)
        assert found.time_difference == pytest.approx(12.0, abs=0.01)


def test_after_a_pause_the_path_goes_on_when_it_ended() -> None:
    path = PathDeviation(0.0, Posture(0.0, 0.0, 0.0))
    for t, x, v in ((0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (2.0, 1.0, 0.0), (3.0, 1.0, 1.0), (4.0, 2.0, 1.0)):
        path.add(ArcSegment(t, 1.0, (x, 0.0, 0.0), v, 0.0))
    found = path.match(Posture(1.25, 0.0, 0.0), 3.75)
    assert found.time_difference == pytest.approx(0.5)
    assert path.place == pytest.approx(3.25)
