"""The scenario of section 5: the book arrives because friction holds it, and doesn't where there's too little."""

from __future__ import annotations

import math

import pytest

from interfaces.jobs import Stage
from interfaces.lab import Study
from interfaces.lab.kim2002 import PAPER
from interfaces.lab.kim2002.paper import ORDER, conclude
from interfaces.lab.kim2002.scenario import PLEASE, Scenario, play
from interfaces.lab.papers import papers
from robots.ipr.body import MobileBody
from robots.ipr.cargo import Cargo
from robots.ipr.chassis import IPR
from robots.ipr.robot import place
from vrs.errors import InvalidValueError


def test_the_scenario_is_played_to_its_end() -> None:
    found = play(Scenario(3))
    assert (found.stage, found.reason) == (Stage.DONE, "")
    assert found.asked == ORDER
    assert found.shown == PLEASE
    assert found.on_top
    assert found.slid < 0.005
    assert not found.touched
    assert 0.05 < found.passed < 1.5
    assert all(stop.off < 0.05 and stop.turned < math.radians(2) and stop.lost < 0.01 for stop in found.stops)
    claims = conclude(Study(runs=2), ((found,), (found,), (), (), ())).claims
    assert all(claim.holds for claim in claims)
    home = place("home")
    a, b = home.place("A"), home.place("B")
    near = [min(math.dist(row[:2], (spot.x, spot.y)) for row in found.track.tolist()) for spot in (a, b)]
    assert max(near) < 0.05


@pytest.mark.parametrize(("friction", "stays"), [(0.5, True), (0.005, False)])
def test_friction_holds_a_book_while_the_robot_drives(friction: float, stays: bool) -> None:
    with MobileBody("ipr", (0.0, 0.0, 0.0)) as body:
        body.load(Cargo(friction=friction))
        for k in range(60):
            body.follow(0.5 if k % 20 < 10 else 0.0, 0.7 if k % 20 < 10 else -0.7)
        ((x, y, z),) = body.cargo
        assert not body.collisions
    on_top = z > IPR.height and math.hypot(x - IPR.centre_x, y) < 0.05
    assert on_top is stays


def test_a_book_is_put_on_top_or_nowhere() -> None:
    with MobileBody("ipr", (0.0, 0.0, 0.0)) as body, pytest.raises(InvalidValueError, match="top"):
        body.load(Cargo(), (1.0, 0.0))
    with pytest.raises(InvalidValueError):
        Cargo(mass=0.0)


def test_the_paper_is_known_by_its_name() -> None:
    assert papers("kim2002") == (PAPER,)
