"""The scenario of section 5: the book arrives because friction holds it, and doesn't where there's too little."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from interfaces.lab import Study
from interfaces.lab.claims import Claim, Figure, Results
from interfaces.lab.kim2002 import PAPER, scenario
from interfaces.lab.kim2002.scenario import (
    CASTS,
    HEEDLESS_ROBOT,
    ORDER,
    OURS,
    PLEASE,
    Measured,
    conclude,
    gap,
    play,
)
from interfaces.lab.papers import papers
from interfaces.messages.jobs import JobStage
from robots.ipr.parameters import IPR
from robots.mobile.body import MobileBody
from robots.mobile.robot import Collision, place
from robots.rooms import Person
from robots.simulated import WORLDS
from robots.vehicle import Cargo
from vrs.errors import InvalidValueError

SEED = int(np.random.SeedSequence([0, 1]).generate_state(1)[0])


@pytest.fixture(name="played", scope="module")
def _played() -> dict[str, Results]:
    """The scenario as it is, and with each of the robots that lack something."""
    return {who: play(SEED, who) for who in CASTS}


def test_the_scenario_is_played_to_its_end(played: dict[str, Results]) -> None:
    found = played[OURS]
    assert (found.stage, found.reason) == (JobStage.DONE, "")
    assert found.asked == ORDER
    assert found.in_turn
    assert found.shown == PLEASE
    assert found.on_top
    assert found.slid < 0.005
    assert not found.touched
    assert 0.05 < found.passed < 1.5
    assert all(stop.off < 0.05 and stop.turned < math.radians(2) and stop.lost < 0.01 for stop in found.stops)
    home = place("home")
    a, b = home.place("A"), home.place("B")
    near = [min(math.dist(row[:2], (spot.x, spot.y)) for row in found.track.tolist()) for spot in (a, b)]
    assert max(near) < 0.05


def test_who_walks_by_would_be_met_by_a_robot_that_ignores_him(played: dict[str, Results]) -> None:
    (touch,) = played[HEEDLESS_ROBOT].touched
    assert touch.thing == "passer-by"


def measured(runs: list[Results], rivals: dict[str, Results]) -> tuple[Measured, ...]:
    return tuple(
        Measured(tuple(runs[k :: scenario.TOGETHER]), rivals[scenario.RIVALS[k]]) for k in range(scenario.TOGETHER)
    )


def test_what_is_claimed_holds_with_it_and_not_without(
    played: dict[str, Results], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scenario, "picture", lambda _: Figure("", "", ""))
    claims = conclude(Study(runs=2), measured([played[OURS]] * 2, played)).claims
    assert [claim.claim for claim in claims if not claim.holds] == []
    for who in scenario.WITHOUT:
        planted = conclude(Study(runs=2), measured([played[who]] * 2, played)).claims
        lacking = [claim for claim in planted if scenario.WITHOUT[who] in claim.counterfactual.what]
        assert lacking
        assert not any(claim.holds for claim in lacking)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize(("friction", "stays"), [(0.5, True), (0.005, False)])
def test_friction_holds_a_book_while_the_robot_drives(friction: float, stays: bool, world: str) -> None:
    with MobileBody(IPR, (0.0, 0.0, 0.0), world=world) as body:
        body.drive(0.5, 0.0, 240)
        body.drive(0.0, 0.0, 240)
        at, _ = body.vehicle.pose()
        body.load(Cargo(friction=friction))
        assert np.array_equal(body.vehicle.pose()[0], at)
        for k in range(60):
            body.follow(0.5 if k % 20 < 10 else 0.0, 0.7 if k % 20 < 10 else -0.7)
        ((x, y, z),) = body.cargo
        assert not body.collisions
    on_top = z > IPR.height and math.hypot(x - IPR.centre_x, y) < 0.05
    assert on_top is stays


def test_a_book_is_put_on_top_or_nowhere() -> None:
    with MobileBody(IPR, (0.0, 0.0, 0.0)) as body, pytest.raises(InvalidValueError, match="top"):
        body.load(Cargo(), (1.0, 0.0))
    with pytest.raises(InvalidValueError):
        Cargo(mass=0.0)


def stop(off: float, turned: float, lost: float) -> Results:
    return Results(off=off, turned=turned, lost=lost)


GOOD = Results(
    stage=JobStage.DONE, reason="", asked=ORDER, in_turn=True, shown=PLEASE, stops=(stop(0.01, 0.01, 0.001),) * 2,
    slid=0.0, on_top=True, touched=(), passed=0.5, lost=0.01, time=60.0,
    track=np.zeros((2, 3)),
)  # fmt: skip


def concluded(monkeypatch: pytest.MonkeyPatch, *runs: Results) -> dict[str, Claim]:
    monkeypatch.setattr(scenario, "picture", lambda _: Figure("", "", ""))
    found = measured(list(runs), dict.fromkeys(CASTS, GOOD))
    return {claim.claim: claim for claim in conclude(Study(runs=len(runs)), found).claims}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"stage": JobStage.FAILED}, ["done to its end"]),
        ({"asked": ORDER[::-1]}, ["move, voice, message, move"]),
        ({"shown": ""}, ["until the key"]),
        ({"on_top": False}, ["on top at A"]),
        ({"in_turn": False}, ["move, voice, message, move"]),
        ({"touched": (Collision(50.0, "passer-by"),)}, ["nothing was touched"]),
        ({"stops": (stop(0.051, 0.0, 0.0), stop(0.0, 0.0, 0.0))}, ["position error at B"]),
        (
            {"stops": (stop(0.0, 0.0, 0.0), stop(0.051, 0.0, 0.0))},
            ["position error at A", "on top at A"],
        ),
        (
            {"stops": (stop(0.0, 0.0, 0.0), stop(0.0, math.radians(2.1), 0.0))},
            ["heading error at A"],
        ),
        ({"stops": (stop(0.0, 0.0, 0.011), stop(0.0, 0.0, 0.0))}, ["localization at B"]),
    ],
)
def test_one_run_of_six_that_goes_wrong_is_enough_to_fail(
    changes: dict[str, Any], said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert all(claim.met for claim in concluded(monkeypatch, *[GOOD] * 6).values())
    found = concluded(monkeypatch, *[GOOD] * 5, Results(**vars(GOOD) | changes))
    assert not any(claim.holds for claim in found.values())
    assert [any(word in text for word in said) for text in found] == [not claim.met for claim in found.values()]


def test_a_gap_is_from_outline_to_outline() -> None:
    walker = Person("passer-by", 0.22, 1.7, (0.0, 1.0), (2.0, 2.0), (0.1, 0.1))
    body: Any = SimpleNamespace(truth=(0.0, 0.0, 0.0), time=0.0)
    assert gap(body, walker) == pytest.approx(2.0 - (IPR.centre_x + IPR.length / 2) - 0.22)
    body.truth = (2.0, -0.9, math.pi)
    assert gap(body, walker) == pytest.approx(1.0 - IPR.width / 2 - 0.22)


def test_the_paper_is_known_by_its_name() -> None:
    assert papers("kim2002") == (PAPER,)
