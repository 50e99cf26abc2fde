"""`vrs reproduce han2001` in small: its measurements, and that claims hold or don't as the figures say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from interfaces.lab.claims import Claim, Findings, Results, Study
from interfaces.lab.driving.run import run
from interfaces.lab.han2001 import PAPER, architectures, information
from interfaces.lab.han2001.architectures import CASES, REPEATED, STREAMED, ArchitectureResult
from interfaces.teleop.architectures import Transport
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
    assert all(claim.met for claim in found.claims)
    assert found.figures[0].svg.startswith("<?xml")


def test_a_sine_that_arrives_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(information, "PROFILE", "none")
    assert [claim.met for claim in information.work(SMALL, "").claims] == [True, False]


def test_the_modified_filter_saves_what_the_formula_says() -> None:
    found = information.work_filter(SMALL, "")
    assert found.claims[0].met
    assert information.last_output(7, 0.1) == pytest.approx(0.7)


def test_a_case_is_run_by_all_compositions() -> None:
    found = architectures.work(SMALL, "model thu")
    assert len(found.runs) == 6
    assert all(len(runs) == 2 for runs in found.runs.values())
    assert set(found.first) == set(found.runs)


def made(worst: float, late: float, *, speed: float = 0.05, progress: float = 1.0) -> ArchitectureResult:
    path = PathComparison(worst / 3, worst / 2, worst, late, 0.1, late, late, speed, progress)
    return ArchitectureResult(path, worst, late, 0, 0)


GOOD = {
    "I": made(2.0, 5.0), "II": made(0.4, 6.0), "III": made(0.06, 3.0), "III-capped": made(0.006, 3.0),
    STREAMED: made(0.007, 3.1, speed=0.03), REPEATED: made(0.007, 0.4, speed=0.03),
}  # fmt: skip


SIMULATED = "II in simulation"


def concluded(
    runs: dict[str, ArchitectureResult], others: dict[str, ArchitectureResult] | None = None
) -> dict[str, Claim]:
    """Claims where the first seed went like this, the second like that, in every case."""
    both = runs, runs if others is None else others
    simulated = [them | {"II": them.get(SIMULATED, made(0.001, 6.0))} for them in both]
    results = tuple(
        Results(
            runs={
                who: tuple(them[who] for them in (simulated if case.startswith("model") else both)) for who in GOOD
            },
            first={},
        )
        for case in CASES
    )
    drawn, architectures.DRAWN = architectures.DRAWN, ()  # type: ignore[misc]
    try:
        return claims(architectures.conclude(SMALL, results))
    finally:
        architectures.DRAWN = drawn  # type: ignore[misc]


def test_claims_hold_where_the_figures_say_so() -> None:
    assert [claim.claim for claim in concluded(GOOD).values() if not claim.met] == []


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
def test_and_don_t_where_they_say_otherwise(who: str, instead: ArchitectureResult, said: str) -> None:
    failed = [claim.claim for claim in concluded(GOOD | {who: instead}).values() if not claim.met]
    assert any(said in claim for claim in failed), failed


def failed(runs: dict[str, ArchitectureResult], others: dict[str, ArchitectureResult] | None = None) -> set[str]:
    return {text for text, claim in concluded(runs, others).items() if not claim.met}


def test_each_network_has_its_own_bar_of_the_time_difference() -> None:
    share = f"{REPEATED}: mean time difference as a share of III's"
    late = {f"mon: {share}", f"wed: {share}", f"thu: {share}", f"domain: {REPEATED}: mean time difference [s]"}
    assert failed(GOOD | {REPEATED: made(0.007, 2.3, speed=0.03)}) == late
    assert failed(GOOD | {REPEATED: made(0.007, 2.2, speed=0.03)}) == late - {f"mon: {share}"}
    assert failed(GOOD | {REPEATED: made(0.007, 0.51, speed=0.03)}) == {
        f"domain: {REPEATED}: mean time difference [s]"
    }


def test_the_worst_seed_counts_where_it_is_asked_for_and_an_interval_with_both_ends() -> None:
    bad = failed(GOOD, GOOD | {STREAMED: made(0.06, 3.1, speed=0.03)})
    assert sum("worst seed" in text for text in bad) == 4
    assert not any("worst seed" in text for text in failed(GOOD, GOOD | {STREAMED: made(0.049, 3.1, speed=0.03)}))
    wide = failed(GOOD, GOOD | {SIMULATED: made(0.03, 6.0)})
    assert any(text.startswith("II keeps the path in simulation") for text in wide)


def test_a_run_is_summed_up_with_what_it_broke() -> None:
    drive = run(architectures.case_of("model", "domain", "timeline", Transport.DATAGRAMS, 0, 6.0))
    assert architectures.seen(drive).limits_passed == 0
    fast = drive.drives.copy()
    fast[40] = 0.6, 0.0
    # Faster than the limit, and two steps too large.
    assert architectures.seen(replace(drive, drives=fast)).limits_passed == 2
    fast[40] = drive.drives[40, 0], 1.0
    assert architectures.seen(replace(drive, drives=fast)).limits_passed == 1
    assert architectures.growth(np.arange(9.0)) == 6.0


def test_a_seed_counts_once_however_many_networks_it_ran_under() -> None:
    found = concluded(GOOD, GOOD | {"III": made(0.3, 3.0)})
    claim = next(one for text, one in found.items() if text.startswith("III's path error stays small"))
    # Of two seeds it's the range: each counts once.
    assert claim.interval == pytest.approx((6.0, 30.0))
    assert not claim.met


def test_the_paper_is_in_the_list() -> None:
    assert PAPER.name == "han2001"
    assert PAPER.length == 120.0
