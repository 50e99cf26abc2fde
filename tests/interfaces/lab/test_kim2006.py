"""`vrs reproduce kim2006` in small: its measurements, and that claims hold or don't as the figures say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from interfaces.lab.claims import Results, Study
from interfaces.lab.kim2006 import PAPER, links, packets
from interfaces.lab.kim2006.following import Followed, FollowingCase, course, path_leader, run
from interfaces.lab.kim2006.links import pair, verdict
from interfaces.lab.kim2006.schemes import SCHEMES
from robots.onboard.driving import Posture
from vrs.errors import InvalidValueError

SMALL = Study(seed=0, runs=2, length=3.0)


def test_the_first_experiments_packets_have_34_and_1992_bytes_and_save_what_the_paper_says() -> None:
    sent = packets.perform(packets.LENGTH, packets.DUTY)
    assert set(sent.sizes) == {34, 1992}
    assert len(sent.sizes) == 6000
    assert packets.saving(sent.sizes) == pytest.approx(38.65, abs=0.5)
    assert (sent.missing, sent.overflowed) == (0, 0)


def test_sealed_ones_have_24_more() -> None:
    assert set(packets.perform(2.0, 0.5, sealed=True).sizes) == {58, 2016}


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
    assert down["rsp"] < down["repeated"] < down["fixed"] == down["tcp"]
    assert down["fixed"] == pytest.approx(50 * 1992, rel=1e-3)


def test_a_lost_packet_holds_up_tcp_and_loses_commands_without_acknowledgement() -> None:
    found = {name: run(FollowingCase(name, "none", 0.1, 2, 8.0, "bare")) for name in SCHEMES}
    assert found["tcp"].age > 2 * found["rsp"].age
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
    found = links.work(SMALL, "none")
    assert set(found[0].means) == set(SCHEMES)
    made = links.conclude(SMALL, (found,))
    assert made.claims[0].met
    assert len(made.tables[0].rows) == 4
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


def test_a_claim_fails_where_tcp_is_nearer() -> None:
    pairs = dict.fromkeys(("tcp", "fixed", "repeated"), ((0.02, 0.021), (0.01, 0.011)))
    mean = links.mean_of([followed(0.01, 1)])
    worse = Results(delay="mon", loss=0.1, means=dict.fromkeys(SCHEMES, mean), pairs=pairs)
    assert not links.wins_claim(worse).met
    rows = links.wins_table([worse]).rows
    assert [row[2] for row in rows if row[1] == "path error"] == [1, 1, 1]


def test_narrow_links_are_concluded_by_the_ages() -> None:
    def made(age: float) -> list[tuple[float, ...]]:
        return [(0.01, 0.02, 1.0, age + 0.001 * k, 0.1, 0.0, 1.0, 1.0) for k in range(3)]

    good = tuple((made(0.1), made(4.0 if case == "16" else 0.1)) for case in links.NARROW_CASES)
    assert all(claim.met for claim in links.conclude_narrow(SMALL, good).claims)
    bad = tuple((made(0.5), made(0.1)) for _ in links.NARROW_CASES)
    assert not any(claim.met for claim in links.conclude_narrow(SMALL, bad).claims)


def test_the_paper_is_in_the_list() -> None:
    assert PAPER.name == "kim2006"
    assert [part.title for part in PAPER.parts] == ["Variable packet size", "Path following", "Narrow links"]
