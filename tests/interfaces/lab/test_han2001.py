"""`vrs reproduce han2001` in small: its measurements, and that claims hold or don't as the figures say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from interfaces.lab.claims import Claim, Findings, Study
from interfaces.lab.han2001 import PAPER, architectures, filtering, information
from interfaces.lab.han2001.architectures import CASES, REPEATED, STREAMED, Found, Seen
from vrs.comparison import PathComparison

SMALL = Study(seed=0, runs=2, length=6.0)


def claims(found: Findings) -> dict[str, Claim]:
    return {claim.claim: claim for claim in found.claims}


def test_a_late_command_brings_those_behind_it() -> None:
    for T_d in (0.0, 0.05, 0.1, 0.25, 1.0, 3.21):
        assert information.commands_at_once(T_d) == math.floor(T_d / 0.1 + 1e-9)


def test_a_sine_is_lost_and_the_figure_says_so() -> None:
    t, sent, there = information.received(0)
    assert t[1] - t[0] == pytest.approx(0.1)
    assert sent.min() == pytest.approx(0.0, abs=1e-9)
    # What is received was sent, some time before.
    assert all(np.abs(sent[: k + 1] - there[k]).min() < 1e-12 for k in range(len(t)) if there[k] != 5.0)
    found = information.work(SMALL, "")
    assert all(claim.holds for claim in found.claims)
    assert found.figures[0].svg.startswith("<?xml")


def test_the_modified_filter_saves_what_the_formula_says() -> None:
    found = filtering.work(SMALL, "")
    assert found.claims[0].holds
    assert filtering.last_output(7, 0.1) == pytest.approx(0.7)


def test_a_case_is_run_by_all_compositions() -> None:
    found = architectures.work(SMALL, "model thu")
    assert len(found.runs) == 6
    assert all(len(runs) == 2 for runs in found.runs.values())
    assert set(found.first) == set(found.runs)


def made(worst: float, late: float, *, speed: float = 0.05, progress: float = 1.0) -> Seen:
    path = PathComparison(worst / 3, worst / 2, worst, late, 0.1, late, late, speed, progress)
    return Seen(path, worst, late, 0, 0)


GOOD = {
    "I": made(2.0, 5.0), "II": made(0.4, 6.0), "III": made(0.06, 3.0), "III-capped": made(0.006, 3.0),
    STREAMED: made(0.007, 3.1, speed=0.03), REPEATED: made(0.007, 0.4, speed=0.03),
}  # fmt: skip


def concluded(runs: dict[str, Seen]) -> dict[str, Claim]:
    sim = runs | {"II": made(0.001, 6.0)}
    results = tuple(
        Found({who: (one, one) for who, one in (sim if case.startswith("model") else runs).items()}, {})
        for case in CASES
    )
    drawn, architectures.DRAWN = architectures.DRAWN, ()  # type: ignore[misc]
    try:
        return claims(architectures.conclude(SMALL, results))
    finally:
        architectures.DRAWN = drawn  # type: ignore[misc]


def test_claims_hold_where_the_figures_say_so() -> None:
    assert [claim.claim for claim in concluded(GOOD).values() if not claim.holds] == []


@pytest.mark.parametrize(
    ("who", "instead", "said"),
    [
        ("III", made(3.0, 3.0), "largest path error [cm]: I − III"),
        ("III", made(0.06, 9.0), "mean time difference [s]: I − III"),
        (STREAMED, made(0.03, 3.1, speed=0.03), "median [cm]"),
        (STREAMED, made(0.01, 3.1, speed=0.03), "III-capped's"),
        (STREAMED, made(0.007, 3.4, speed=0.03), "share of III's"),
        (STREAMED, made(0.007, 3.1, speed=0.06), "speed-profile"),
        (REPEATED, made(0.007, 2.0, speed=0.03), "share of III's"),
        (REPEATED, made(0.007, 0.4, speed=0.03, progress=0.9), "not reached"),
        (REPEATED, made(0.007, 0.4, speed=0.03)._replace(collisions=1), "collisions"),
        ("II", made(0.0005, 6.0), "II's path error is large"),
    ],
)
def test_and_don_t_where_they_say_otherwise(who: str, instead: Seen, said: str) -> None:
    failed = [claim.claim for claim in concluded(GOOD | {who: instead}).values() if not claim.holds]
    assert any(said in claim for claim in failed), failed


def test_the_paper_is_in_the_list() -> None:
    assert PAPER.name == "han2001"
    assert PAPER.length == 120.0
