"""`vrs reproduce kim2006` in small: its measurements, and that claims hold or don't as the figures say."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pytest

from interfaces.lab.claims import Claim, Results, Study, Verdict
from interfaces.lab.kim2006 import PAPER, causes, links, packets
from interfaces.lab.kim2006.following import RESEND, Followed, FollowingCase, course, path_leader, resend_after, run
from interfaces.lab.kim2006.links import pair, verdict
from interfaces.lab.kim2006.schemes import SCHEMES
from interfaces.link.delays import delay_profile
from robots.onboard.driving import Posture
from vrs.errors import InvalidValueError

SMALL = Study(seed=0, runs=2, length=3.0)
Pairs: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]


def test_the_first_experiments_packets_have_34_and_1992_bytes_and_save_what_the_paper_says() -> None:
    sent = packets.perform(packets.LENGTH, packets.DUTY)
    assert set(sent.sizes) == {34, 1992}
    assert len(sent.sizes) == 6000
    assert packets.saving(sent.sizes) == pytest.approx(38.65, abs=0.5)
    assert (sent.missing, sent.overflowed) == (0, 0)


@pytest.mark.parametrize("duty", [0.0, 0.37, 1.0])
def test_the_saving_is_the_formulas_for_every_duty(duty: float) -> None:
    found = packets.saving(packets.perform(9.0, duty).sizes)
    assert found == pytest.approx(100 * (1992 - 34) * (1 - duty) / 1992, abs=1.0)


def test_a_run_repeats_to_the_last_bit_and_its_body_may_be_pybullets() -> None:
    case = FollowingCase("rsp", "mon", 0.05, 3, 3.0)
    one, other = run(case), run(case)
    assert one[:8] == other[:8]
    assert np.array_equal(one.way, other.way)
    assert one.progress > 0.5


@pytest.mark.parametrize("name", SCHEMES)
def test_every_scheme_follows_on_a_good_link(name: str) -> None:
    found = run(FollowingCase(name, "constant:0.02", 0.0, 1, 6.0, "bare"))
    assert found.path_error < 0.006
    assert found.progress == pytest.approx(1.0, abs=0.01)
    assert found.age == pytest.approx(0.06, abs=0.025)
    assert found.commands_missing == 0
    assert found.command_age == pytest.approx(0.02, abs=0.021)


def test_rsp_is_smaller_than_packets_of_one_size_and_repeated_inputs() -> None:
    down = {name: run(FollowingCase(name, "none", 0.0, 1, 4.0, "bare")).down for name in SCHEMES}
    assert down["rsp"] < down["repeated"] < down["fixed"] == down["tcp"] == down["padded"]
    assert down["fixed"] == pytest.approx(50 * 1992, rel=1e-3)


def test_a_lost_packet_holds_up_tcp_and_loses_commands_without_acknowledgement() -> None:
    found = {name: run(FollowingCase(name, "constant:0.1", 0.1, 2, 8.0, "bare")) for name in SCHEMES}
    assert found["tcp"].age > 1.3 * found["rsp"].age
    assert found["fixed"].commands_missing > 0
    assert found["rsp"].commands_missing == 0
    assert found["rsp"].path_error < found["tcp"].path_error


def test_the_leader_has_no_error_of_its_own() -> None:
    path = course(3, 20.0)
    lead = path_leader(path)
    x, y, theta = 0.0, 0.05, 0.3
    far = []
    for _ in range(900):
        left, right = lead(Posture(x, y, theta))
        v, w = 0.5e-3 * (left + right), 1e-3 * (right - left) / 0.15
        x, y, theta = x + 0.02 * v * math.cos(theta), y + 0.02 * v * math.sin(theta), theta + 0.02 * w
        far.append(float(np.linalg.norm(path - (x, y), axis=1).min()))
    assert max(far[300:]) < 0.004


def test_paths_are_smooth_and_differ_by_seed() -> None:
    one, other = course(1, 30.0), course(2, 30.0)
    steps = np.diff(one, axis=0)
    turning = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
    assert np.linalg.norm(steps, axis=1) == pytest.approx(0.003)
    assert turning.max() / 0.003 <= 1 / 0.4 + 1e-6
    assert not np.allclose(one, other)


@pytest.mark.parametrize("bad", [{"scheme": "pigeon"}, {"body": "jelly"}, {"loss": 1.0}, {"length": 1.0}])
def test_cases_are_checked(bad: dict) -> None:
    with pytest.raises(InvalidValueError):
        FollowingCase(**bad)


def test_a_network_is_measured_and_concluded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "LOSSES", (0.1,))
    found = links.work(Study(seed=1, runs=2, length=8.0), "constant:0.1")
    assert set(found[0].means) == set(links.COMPARED)
    made = links.conclude(SMALL, (found,))
    (claim,) = made.claims
    assert claim.holds
    assert len(made.tables[0].rows) == 5
    assert {figure.name for figure in made.figures} == {"paths", "path_errors"}


def followed(error: float, cells: int) -> Followed:
    distance = np.full(100, error)
    way = np.zeros((100, 2))
    return Followed(error, error, 1.0, 0.1, 0.1, 0, 1.0, 1.0, distance, np.arange(cells), way, way)


def test_the_error_until_a_cell_is_the_mean_up_to_where_it_was_reached() -> None:
    rising = followed(0.0, 10)._replace(distance=np.arange(100.0), arrivals=10 * np.arange(10))
    assert [rising.error_until(cells) for cells in (1, 2, 10, 99)] == [0.0, 5.0, 45.0, 45.0]


def test_the_verdict_is_the_paired_intervals() -> None:
    assert verdict((0.01, 0.011), (0.02, 0.021)) == "rsp"
    assert verdict((0.02, 0.021), (0.01, 0.011)) == "other"
    assert verdict((0.02, 0.021), (0.0201, 0.0205)) == "equal"
    assert verdict((0.02, 0.001), (0.001, 0.04)) == "unclear"
    assert verdict((), ()) == "the other never moved"
    assert pair([followed(0.1, 50)], [followed(0.2, 1)]) == ((), ())
    assert pair([followed(0.1, 50)], [followed(0.2, 30)]) == ((pytest.approx(0.1),), (pytest.approx(0.2),))


NEAR, FAR = (0.01, 0.011), (0.02, 0.021)


def network(pairs: tuple[tuple[float, ...], ...], streamed: tuple[tuple[float, ...], ...] = (FAR, FAR)) -> Results:
    mean = links.mean_of([followed(0.01, 1)])
    return Results(
        delay="none", loss=0.0, means=dict.fromkeys(links.COMPARED, mean), streamed=streamed,
        pairs=dict.fromkeys(links.COMPARED[1:], pairs),
    )  # fmt: skip


def test_rsp_is_nearer_than_tcp_if_its_packets_on_tcp_are_not() -> None:
    assert links.nearer_claim(network((NEAR, FAR))).verdict is Verdict.HOLDS
    assert links.nearer_claim(network((NEAR, FAR), (NEAR, FAR))).verdict is Verdict.NOT_SHOWN
    for worse in ((FAR, NEAR), (FAR, FAR)):
        assert links.nearer_claim(network(worse)).verdict is Verdict.FAILS
    assert links.nearer_claim(network(((), ()))).verdict is Verdict.NOT_SHOWN
    rows = links.wins_table([network((FAR, NEAR))]).rows
    assert [row[2] for row in rows if row[1] == "path error"] == [1, 1, 1, 1]


def test_rsp_is_equal_to_tcp_where_nothing_is_lost_if_it_is_not_where_something_is() -> None:
    even, uneven = network((FAR, FAR)), network((NEAR, FAR))
    assert links.equal_claim(even, uneven).verdict is Verdict.HOLDS
    assert links.equal_claim(even, even).verdict is Verdict.NOT_SHOWN
    assert links.equal_claim(uneven, even).verdict is Verdict.FAILS


def test_a_ratio_is_of_geometric_means() -> None:
    assert links.nearness(((0.01, 0.04), (0.02, 0.02))) == pytest.approx((1.0, 0.5, 2.0, None))
    assert links.nearness(((0.01,), (0.02,))) is None


def planted(claims: tuple[Claim, ...], lacking: tuple[Claim, ...]) -> None:
    """All claims hold, and none of them where the mechanism is off."""
    assert [claim.claim for claim in claims if not claim.holds] == []
    assert [claim.claim for claim in lacking if claim.holds] == []


def test_on_a_lossy_link_it_is_the_datagrams() -> None:
    case = FollowingCase("rsp", "constant:0.1", 0.1, 1, 8.0, "bare")
    runs = {name: [run(replace(case, scheme=name, seed=k)) for k in (1, 2)] for name in ("rsp", "tcp", "stream")}
    streamed = pair(runs["stream"], runs["tcp"])
    ours, off = (network(pair(runs[name], runs["tcp"]), streamed) for name in ("rsp", "stream"))
    planted((links.nearer_claim(ours),), (links.nearer_claim(off),))


def test_on_a_narrow_link_it_is_the_size() -> None:
    small = Study(seed=0, runs=2, length=12.0)
    found = {case: links.work_sizes(small, case) for case in ("256", "inf")}
    off = {
        case: Results(**vars(one) | {"pairs": one.pairs | {"rsp": one.pairs["padded"]}})
        for case, one in found.items()
    }
    claims, lacking = (
        links.conclude_sizes(
            small, tuple(those["inf" if case == "inf" else "256"] for case in links.SIZE_CASES)
        ).claims
        for those in (found, off)
    )
    planted(claims, lacking)


def test_led_back_over_a_longer_way_rsp_keeps_the_path_at_the_moons_distance() -> None:
    case = FollowingCase("rsp", "lunar", 0.1, 1, 30.0, "bare")
    short, far = (run(replace(case, recovery=recovery)) for recovery in (case.recovery, causes.FAR))
    assert far.progress > 3 * short.progress


def test_causes_are_concluded_by_what_they_leave() -> None:
    def made(pairs: Pairs, streamed: Pairs) -> tuple[Results, ...]:
        return (Results(pairs=pairs, streamed=streamed, progress=[0.9, 0.2]),) * len(causes.CASES)

    apart, alike = ((0.01, 0.011), (0.02, 0.021)), ((0.02, 0.021), (0.02, 0.021))
    claims = causes.conclude(SMALL, made(apart, alike)).claims
    planted(claims, causes.conclude(SMALL, made(alike, alike)).claims)
    assert all(claim.is_ours for claim in claims)
    assert causes.conclude(SMALL, made(((), ()), alike)).tables[0].rows[0][3:7] == (None, None, None, 0)


def test_packets_of_one_size_save_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packets, "LENGTH", 12.0)
    found = packets.work(SMALL, "").claims
    sizes = packets.perform_fixed(2.0)
    fixed = Results(t=[0.02 * k for k in range(len(sizes))], sizes=sizes, missing=0, overflowed=0)
    monkeypatch.setattr(packets, "perform", lambda *_: fixed)
    for one, off in zip(found, packets.work(SMALL, "").claims, strict=True):
        assert one.verdict is (Verdict.NOT_SHOWN if "fitted" in one.claim else Verdict.HOLDS)
        assert off.verdict is not Verdict.HOLDS


def test_narrow_links_are_concluded_by_the_ages() -> None:
    def made(age: float) -> list[tuple[float, ...]]:
        return [(0.01, 0.02, 1.0, age + 0.001 * k, 0.1, 0.0, 1.0, 1.0) for k in range(3)]

    good = tuple((made(0.1), made(4.0 if case == "16" else 0.1)) for case in links.NARROW_CASES)
    off = tuple((fixed, fixed) for _, fixed in good)
    planted(links.conclude_narrow(SMALL, good).claims, links.conclude_narrow(SMALL, off).claims)
    bad = tuple((made(0.6), made(0.1)) for _ in links.NARROW_CASES)
    assert not any(claim.met for claim in links.conclude_narrow(SMALL, bad).claims)


def test_tcp_sends_again_by_acknowledgements_where_the_round_trip_is_short() -> None:
    assert resend_after(delay_profile("none")) == pytest.approx(0.06)
    assert resend_after(delay_profile("constant:0.05")) == pytest.approx(0.16)
    assert resend_after(delay_profile("mon")) == RESEND


def test_the_paper_is_in_the_list() -> None:
    assert PAPER.name == "kim2006"
    assert [part.title for part in PAPER.parts] == [
        "Variable packet size",
        "Path following",
        "Causes",
        "Size alone",
        "Narrow links",
    ]
