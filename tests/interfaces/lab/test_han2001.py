"""`vrs reproduce han2001` in small: its measurements, and that claims hold or don't as the figures say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from interfaces.lab.claims import Claim, Findings, Results, Study
from interfaces.lab.driving.run import run
from interfaces.lab.han2001 import PAPER, architectures, information
from interfaces.lab.han2001.architectures import (
    CASES,
    REPEATED,
    STREAMED,
    THIRD_REPEATED,
    UNTRACKED,
    ArchitectureResult,
)
from interfaces.teleop.architectures import Transport
from vrs.comparison import PathComparison

SMALL = Study(seed=0, runs=2, length=6.0)


def claims(found: Findings) -> dict[str, Claim]:
    return {claim.claim: claim for claim in found.claims}


def test_a_late_command_brings_those_behind_it() -> None:
    for T_d in (0.0, 0.05, 0.1, 0.25, 1.0, 3.21):
        assert information.commands_at_once(T_d) == math.floor(T_d / 0.1 + 1e-9)


def test_a_sine_is_lost_and_the_figure_says_so() -> None:
    t, sent, there = information.received(0, information.PROFILE)
    assert t[1] - t[0] == pytest.approx(0.1)
    assert sent.min() == pytest.approx(0.0, abs=1e-9)
    # What is received was sent, some time before.
    assert all(np.abs(sent[: k + 1] - there[k]).min() < 1e-12 for k in range(len(t)) if there[k] != 5.0)
    found = information.work(SMALL, "")
    assert all(claim.holds for claim in found.claims)
    assert found.figures[0].svg.startswith("<?xml")


def test_a_sine_that_arrives_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(information, "PROFILE", "none")
    assert [claim.met for claim in information.work(SMALL, "").claims] == [True, False]


def test_the_modified_filter_saves_what_the_formula_says() -> None:
    found = information.work_filter(SMALL, "")
    assert found.claims[0].holds
    assert information.last_output(7, 0.1) == pytest.approx(0.7)


def test_a_case_is_run_by_all_compositions() -> None:
    found = architectures.work(SMALL, "model thu")
    assert len(found.first) == 6
    assert all(len(runs) == 2 for runs in found.runs.values())
    assert set(found.runs) - set(found.first) == {"I, speeds jump", "II, speeds jump"}


def made(worst: float, late: float, *, speed: float = 0.05, progress: float = 1.0) -> ArchitectureResult:
    path = PathComparison(worst / 3, worst / 2, worst, late, 0.1, late, late, speed, progress)
    return ArchitectureResult(path, worst, late, 0, 0)


GOOD = {
    "I": made(2.0, 5.0, progress=0.5), "II": made(0.4, 6.0), "III": made(0.06, 3.0), "III-capped": made(0.006, 3.0),
    STREAMED: made(0.007, 2.9, speed=0.03), REPEATED: made(0.007, 0.4, speed=0.03),
    THIRD_REPEATED: made(0.06, 1.0), UNTRACKED: made(0.5, 1.0)._replace(collisions=1),
    "I, speeds jump": made(2.0, 5.0), "II, speeds jump": made(0.0, 6.0), "II, as its model": made(0.05, 6.0),
    "I, constant delay": made(0.0, 0.0), "II, constant delay": made(0.0, 0.0),
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
    assert [claim.claim for claim in concluded(GOOD).values() if not claim.holds] == []


def off_for(who: str, instead: ArchitectureResult) -> dict[str, ArchitectureResult]:
    return GOOD | {who: instead} | ({SIMULATED: instead} if who == "II" else {})


@pytest.mark.parametrize(
    ("who", "off", "said", "count"),
    [
        ("I", "I, constant delay", "the path error accumulates", 1),
        ("II, speeds jump", "I, speeds jump", "II keeps the path", 1),
        ("II", "II, constant delay", "the time difference grows", 1),
        ("II", "II, as its model", "II's path error is large", 1),
        ("III", "I", ": I − III", 8),
        ("III", "II", ": II − III", 5),
        ("III", "II", "III's path error stays small", 1),
        ("III", THIRD_REPEATED, f"III − {THIRD_REPEATED}", 3),
        (STREAMED, UNTRACKED, f"{STREAMED}: largest path error", 10),
        (STREAMED, UNTRACKED, f"{STREAMED}: its median", 4),
        (STREAMED, UNTRACKED, f"{STREAMED}: collisions", 4),
        (STREAMED, "I", f"{STREAMED}: largest share", 4),
        (STREAMED, "III", f"III − {STREAMED}", 4),
        (STREAMED, "II", f"{STREAMED}: mean time difference as a share", 3),
        (REPEATED, UNTRACKED, f"{REPEATED}: largest path error", 10),
        (REPEATED, UNTRACKED, f"{REPEATED}: collisions", 4),
        (REPEATED, THIRD_REPEATED, f"{THIRD_REPEATED} − {REPEATED}", 4),
    ],
)
def test_none_holds_with_its_mechanism_switched_off(who: str, off: str, said: str, count: int) -> None:
    found = [claim for text, claim in concluded(off_for(who, GOOD[off])).items() if said in text]
    assert len(found) == count
    assert [claim.claim for claim in found if claim.holds] == []


@pytest.mark.parametrize(
    ("who", "instead", "said"),
    [
        ("III", made(3.0, 3.0), "largest path error [cm]: I − III"),
        ("III", made(0.06, 9.0), "mean time difference [s]: I − III"),
        (STREAMED, made(0.03, 3.1, speed=0.03), "median [cm]"),
        (STREAMED, made(0.01, 3.1, speed=0.03), "III-capped's"),
        (STREAMED, made(0.007, 3.4, speed=0.03), "share of III's"),
        (STREAMED, made(0.007, 3.1, speed=0.06), "speed-profile"),
        (REPEATED, made(0.007, 2.0, speed=0.03), "III, datagrams − timeline, datagrams"),
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


def test_a_stream_makes_all_wait_alike_and_datagrams_show_who_is_quicker() -> None:
    share = f"{STREAMED}: mean time difference as a share of III's"
    slower = failed(GOOD | {STREAMED: made(0.007, 3.1, speed=0.03)})
    assert slower == {f"domain: mean time difference [s]: III − {STREAMED}"}
    slower = failed(GOOD | {STREAMED: made(0.007, 3.4, speed=0.03)})
    assert slower == {f"domain: mean time difference [s]: III − {STREAMED}"} | {
        f"{profile}: {share}" for profile in ("mon", "wed", "thu")
    }
    assert failed(GOOD | {REPEATED: made(0.007, 1.1, speed=0.03)}) == {
        f"{profile}: mean time difference [s]: {THIRD_REPEATED} − {REPEATED}" for profile in architectures.PROFILES
    }


def test_the_worst_seed_counts_where_it_is_asked_for_and_an_interval_with_both_ends() -> None:
    bad = failed(GOOD, GOOD | {STREAMED: made(0.06, 3.1, speed=0.03)})
    assert sum("worst seed" in text for text in bad) == 4
    assert not any("worst seed" in text for text in failed(GOOD, GOOD | {STREAMED: made(0.049, 3.1, speed=0.03)}))
    wide = failed(GOOD, GOOD | {"II, speeds jump": made(0.03, 6.0)})
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
