"""`vrs reproduce han2001` in small: its measurements, and that claims hold or don't as the figures say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from interfaces.lab.claims import Claim, Findings, Results, Study, Verdict
from interfaces.lab.driving.operators import operator
from interfaces.lab.driving.run import run
from interfaces.lab.han2001 import PAPER, architectures, delays, environment, information, operator_view
from interfaces.lab.han2001.architectures import (
    BLIND,
    CASES,
    INSTEAD,
    PATIENT,
    REPEATED,
    SCALE,
    STREAMED,
    THIRD_REPEATED,
    UNHURRIED,
    UNQUEUED,
    UNTRACKED,
    ArchitectureResult,
)
from interfaces.lab.han2001.environment import Surrounded
from interfaces.lab.han2001.operator_view import OperatorView
from interfaces.runs.drive_run import DriveCase
from interfaces.teleop.architectures import Transport
from robots.onboard.driving import STAND
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
    rest = {"I, speeds jump", "II, speeds jump", INSTEAD[UNQUEUED], UNHURRIED}
    assert set(found.runs) - set(found.first) == rest


def made(worst: float, late: float, *, speed: float = 0.05, progress: float = 1.0) -> ArchitectureResult:
    path = PathComparison(worst / 3, worst / 2, worst, late, 0.1, late, late, speed, progress)
    return ArchitectureResult(path, worst, late, 0, 0)


GOOD = {
    "I": made(2.0, 5.0, progress=0.5), "II": made(0.4, 6.0), "III": made(0.06, 3.0), "III-capped": made(0.006, 3.0),
    STREAMED: made(0.007, 2.6, speed=0.03), REPEATED: made(0.007, 0.4, speed=0.03),
    THIRD_REPEATED: made(0.06, 1.0), UNTRACKED: made(0.5, 1.0)._replace(collisions=1),
    "I, speeds jump": made(2.0, 5.0), "II, speeds jump": made(0.0, 6.0), "II, as its model": made(0.05, 6.0),
    "I, constant delay": made(0.0, 0.0), "II, constant delay": made(0.0, 0.0),
    "III, constant delay": made(0.0, 1.0), f"{THIRD_REPEATED}, constant delay": made(0.0, 1.0),
    INSTEAD[UNQUEUED]: made(2.5, 5.0), UNHURRIED: made(0.06, 7.0), INSTEAD[BLIND]: made(0.5, 3.0),
    INSTEAD[PATIENT]: made(0.007, 1.4),
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
        ("III", "I", ": I − III", 2),
        ("III", "II", ": II − III", 2),
        ("III", INSTEAD[UNQUEUED], ": I − III", 2),
        ("III", UNHURRIED, ": the lesser − III", 1),
        ("III", "II", "III's path error stays small", 1),
        ("III", THIRD_REPEATED, f"III − {THIRD_REPEATED}", 1),
        (STREAMED, UNTRACKED, f"{STREAMED}: largest path error", 10),
        (STREAMED, UNTRACKED, f"{STREAMED}: its median", 4),
        (STREAMED, UNTRACKED, f"{STREAMED}: collisions", 4),
        (STREAMED, "I", f"{STREAMED}: largest share", 4),
        (STREAMED, "III", f"III − {STREAMED}", 1),
        (STREAMED, "II", f"{STREAMED}: mean time difference as a share", 4),
        (REPEATED, UNTRACKED, f"{REPEATED}: largest path error", 10),
        (REPEATED, UNTRACKED, f"{REPEATED}: collisions", 4),
        (REPEATED, "III", f"III − {REPEATED}", 1),
        (REPEATED, INSTEAD[PATIENT], f"{THIRD_REPEATED} − {REPEATED}", 1),
    ],
)
def test_none_holds_with_its_mechanism_switched_off(who: str, off: str, said: str, count: int) -> None:
    found = [claim for text, claim in concluded(off_for(who, GOOD[off])).items() if said in text]
    assert len(found) == count
    assert [claim.claim for claim in found if claim.holds] == []


@pytest.mark.parametrize(
    ("who", "instead", "said"),
    [
        ("III", made(3.0, 3.0), "I − III, largest"),
        ("III", made(0.06, 9.0), "the lesser − III"),
        (STREAMED, made(0.03, 3.1, speed=0.03), "median [cm]"),
        (STREAMED, made(0.01, 3.1, speed=0.03), "III-capped's"),
        (STREAMED, made(0.007, 3.4, speed=0.03), "share of III's"),
        (STREAMED, made(0.007, 3.1, speed=0.06), "keeps the operator's speeds"),
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
    assert slower == {f"domain: {share}"}
    slower = failed(GOOD | {STREAMED: made(0.007, 3.4, speed=0.03)})
    assert slower == {f"{profile}: {share}" for profile in architectures.PROFILES}
    (one,) = failed(GOOD | {REPEATED: made(0.007, 1.1, speed=0.03)})
    assert f"{THIRD_REPEATED} − {REPEATED}" in one


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


def test_a_rivals_figures_are_beside_a_superiority() -> None:
    """Where what has the mechanism switched off is as good, nothing is shown of it."""
    good = GOOD | {INSTEAD[UNQUEUED]: GOOD["III"], UNHURRIED: GOOD["III"], INSTEAD[BLIND]: GOOD["III"]}
    good |= {INSTEAD[PATIENT]: GOOD[REPEATED], "III-capped": made(0.006, 3.0, speed=0.03)}
    good |= {f"{THIRD_REPEATED}, constant delay": made(0.0, 0.5)}
    unshown = [claim for text, claim in concluded(good).items() if text.startswith("75 kg") or "III has" in text]
    assert len(unshown) == 9
    assert {claim.verdict for claim in unshown} == {Verdict.NOT_SHOWN}


def test_the_micro_robot_drives_to_scale() -> None:
    who, small = (operator("figure-eight", 0, 0.1) for _ in range(2))
    miniature = architectures.MiniatureOperator(small)
    start = who.start
    for k in range(30):
        v, w = who.drive(0.1 * k, start, STAND)
        assert miniature.drive(0.1 * k, miniature.start, STAND) == pytest.approx((v / SCALE, w))
    assert pytest.approx(52 / 7.5) == SCALE
    case = replace(architectures.case_of("micro", "domain", "III", Transport.STREAM, 0, 6.0), operator="slalom")
    drive = architectures.driven(case)
    way = np.linalg.norm(drive.virtual[-1, :2] - drive.virtual[0, :2])
    # Half a metre or so of the other robot's.
    assert 0.3 < way < 1.5
    assert drive.drives[:, 0].max() < 0.34 / SCALE * 1.6
    assert architectures.seen(drive).worst < 0.1


@pytest.mark.parametrize("who", [UNQUEUED, BLIND, PATIENT])
def test_without_its_mechanism_it_is_worse(who: str) -> None:
    transport = Transport.DATAGRAMS if who == PATIENT else Transport.STREAM
    # Delays that vary are what lets packets come together, or late; a robot that slips is on a quick network, too.
    delay = "domain@3.3" if who == BLIND else "thu@3.3"
    case = DriveCase("timeline" if who == PATIENT else "III", transport, delay, "bare", "slalom", 3, 20.0)
    good, worse = (architectures.seen(run(one)) for one in (case, replace(case, architecture=who)))
    if who == PATIENT:
        assert worse.late > 1.2 * good.late
    else:
        assert worse.worst > 1.5 * good.worst


def test_tables_1_and_2_have_tails_that_a_normal_distribution_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    found = delays.work(SMALL, "").claims
    assert [claim.verdict for claim in found] == [Verdict.NOT_SHOWN] * 2 + [Verdict.HOLDS] * 7
    for row in delays.PRINTED.values():
        assert abs(delays.normal_days(row, SMALL).mean() / row.mean - 1) < 0.5
    monkeypatch.setattr(delays, "days", lambda profile, study: delays.normal_days(delays.PRINTED[profile], study))
    assert {claim.verdict for claim in delays.work(SMALL, "").claims[2:]} == {Verdict.FAILS}
    monkeypatch.setattr(delays, "moments", lambda _: (0.5, 1.0))
    assert not any(claim.met for claim in delays.work(SMALL, "").claims[:2])


def test_what_the_estimator_moves_without_a_command_is_a_jump() -> None:
    drive = run(architectures.case_of("model", "domain", "I", Transport.STREAM, 0, 6.0))
    led = drive.virtual[2:]
    # Where the estimate is where the commands lead, only turned and moved, nothing jumps.
    c, s = math.cos(0.7), math.sin(0.7)
    turned = np.column_stack([c * led[:, 0] - s * led[:, 1] + 1, s * led[:, 0] + c * led[:, 1], led[:, 2] + 0.7])
    estimated = np.vstack([turned, turned[-2:]])
    assert operator_view.jumps(replace(drive, estimated=estimated)).max() < 1e-9
    estimated[40:, 0] += 0.3
    found = operator_view.jumps(replace(drive, estimated=estimated))
    assert found[19] == pytest.approx(0.3)
    assert np.delete(found, 19).max() < 1e-9


def test_by_what_he_sees_an_operator_corrects_what_the_network_lost() -> None:
    case = architectures.case_of("model", "mon", "I", Transport.STREAM, 0, 45.0)
    on, off = (operator_view.view(case, sees_estimate=sees) for sees in (True, False))
    assert on.apart < 1.0
    assert on.left < 20.0
    assert off.left > 50.0
    assert off.reckoned > 50.0


VIEWS = {
    "I": OperatorView(60.0, 3.0, 4.0, 0.1, 300.0, 60.0, 50.0),
    "III": OperatorView(30.0, 1.0, 3.0, 0.1, 0.2, 4.0, 9.0),
    "II": OperatorView(40.0, 2.0, 4.0, 0.1, 9.0, 20.0, 9.0), "I, dead reckoning": OperatorView(*[300.0] * 7),
    "I, constant delay": OperatorView(30.0, *[1.0] * 6), "I, no delay": OperatorView(29.0, *[1.0] * 6),
    "III, no delay": OperatorView(30.0, *[1.0] * 6), "I, dead reckoning, no delay": OperatorView(29.0, *[1.0] * 6),
    "II, as its model": OperatorView(40.0, *[2.0] * 6),
    f"II, {operator_view.SLIPS}": OperatorView(40.0, *[30.0] * 6),
}  # fmt: skip


def viewed(views: dict[str, OperatorView]) -> list[Claim]:
    runs = {who: (one, one) for who, one in views.items()}
    return list(operator_view.conclude(SMALL, (runs,) * len(operator_view.CASES)).claims)


def test_the_estimators_claims_hold_and_none_with_its_mechanism_off() -> None:
    assert all(claim.holds for claim in viewed(VIEWS))
    # Off: dead reckoning, a delay that doesn't vary, the other architecture, a robot that is like its model.
    mean = VIEWS["I"]
    off = viewed(VIEWS | {
        "I": mean._replace(apart=300.0, left=300.0, time=29.0, jump=1.0), "III": VIEWS["III"]._replace(jump=60.0),
        "II": VIEWS["II, as its model"], f"II, {operator_view.SLIPS}": VIEWS["II, as its model"],
    })  # fmt: skip
    assert [claim.claim for claim in off if claim.holds] == []
    table = operator_view.conclude(SMALL, ({"I": (mean,)} | {w: (o,) for w, o in VIEWS.items()},) * 3).tables[0]
    assert len(table.rows) == 3 * len(VIEWS)


AROUND = dict.fromkeys(environment.CASES, Surrounded(0.0, 0, 0, 0, 0.0, 1.0)) | {
    "extended": Surrounded(1.0, 60, 0, 0, 0.1, 1.0),
    f"extended, {environment.BLIND}": Surrounded(0.0, 0, 0, 0, 0.1, 5.0),
    "III": Surrounded(0.0, 0, 0, 1, 0.1, 1.0), "I, mapped": Surrounded(0.0, 0, 0, 20, 0.0, 20.0),
    f"III, mapped, {environment.BARE}": Surrounded(0.0, 0, 0, 1, 0.1, 1.0),
}  # fmt: skip


def enclosed(runs: dict[str, Surrounded]) -> list[Claim]:
    return list(environment.conclude(SMALL, tuple((runs[case],) * 2 for case in environment.CASES)).claims)


def test_the_virtual_environments_claims_hold_and_none_with_its_mechanism_off() -> None:
    assert all(claim.holds for claim in enclosed(AROUND))
    off = AROUND | {
        "extended": AROUND[f"extended, {environment.BLIND}"]._replace(left=60, collisions=1),
        "III, mapped": Surrounded(0.0, 0, 0, 20, 0.1, 1.0),
    }
    assert [claim.claim for claim in enclosed(off) if claim.holds] == []


def test_what_stands_in_the_room_of_fig_13_is_told_from_its_cells() -> None:
    box, _, column = environment.THINGS
    assert environment.shows(column, ((69, 25),))
    assert not environment.shows(column, ((62, 34), (10, 10)))
    assert environment.shows(box, ((62, 34),))
    assert all(thing.known and thing.stands(0.0) for thing in environment.MAPPED.columns)


@pytest.mark.slow
def test_the_virtual_environment_learns_what_stands_at_the_centre() -> None:
    found = {
        who: environment.work(Study(seed=0, runs=2, length=30.0), who)
        for who in ("extended", f"extended, {environment.BLIND}", "III")
    }
    assert min(one.learnt for one in found["extended"]) > 0.6
    assert max(one.there for one in found[f"extended, {environment.BLIND}"]) == 0
    assert sum(one.collisions for one in found["extended"]) == 0
    assert sum(one.collisions for one in found["III"]) > 0


def test_the_paper_is_in_the_list() -> None:
    assert PAPER.name == "han2001"
    assert PAPER.length == 120.0
