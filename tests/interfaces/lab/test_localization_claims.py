"""What is claimed of the localization follows from the figures, and fails where they do."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from interfaces.lab.claims import Findings, Results, Study
from interfaces.lab.localization import searching
from interfaces.lab.localization.accuracy import (
    AS_BUILT,
    BUILT,
    BUILT_EXACT,
    DRAWN_EXACT,
    METHODS,
    NOISE_ALONE,
    ODOMETRY,
    PAPER,
    PLAN,
    RIVALS,
    SLOW,
    UNINJECTED,
    conclude_rooms,
)
from interfaces.lab.localization.searching import (
    Starts,
    Twice,
    conclude_carried,
    conclude_starts,
    conclude_symmetric,
)
from interfaces.lab.localization.study import conclude_axes
from interfaces.lab.localization.trial import PostureErrors
from robots.onboard.localizer import Status

SPREAD = np.array([0.002, 0.002, 0.001])
"""Deviations of x, y [m] and heading [rad] of somebody who keeps all bars."""


def track(*, place: float = 1.0, turn: float = 1.0, doubt: float = 1.0, outlier: float = 0.0) -> PostureErrors:
    """Errors so many times as large as they may be, honest but for what `doubt` is larger than they are."""
    rng = np.random.default_rng(0)
    spread = SPREAD * (place, place, turn)
    errors = rng.normal(size=(4000, 3)) * spread
    errors[-1, 0] += outlier
    return PostureErrors(errors, np.tile(np.diag((doubt * spread) ** 2), (4000, 1, 1)))


GOOD = track()


BAD = track(place=100.0, turn=100.0)
UNSURE = track(doubt=0.5)
RIVALRY = {
    ODOMETRY: track(place=50.0, turn=50.0), NOISE_ALONE: UNSURE, DRAWN_EXACT: UNSURE, BUILT_EXACT: UNSURE,
    UNINJECTED: BAD,
}  # fmt: skip
"""What lacks something keeps no bar."""


def room(name: str = "", bad: PostureErrors = GOOD) -> Results:
    """A room in which everybody keeps the bars, but for one, and for those who lack something."""
    tracks = dict.fromkeys(METHODS, GOOD) | RIVALRY | ({name: bad} if name else {})
    return Results(
        name="room", people=0, noise=0.01, way=10.0, collisions=0, lines=(4, 4), tracks=tracks, scene=None
    )


def failed(conclude: Callable[..., Findings], found: Sequence[Any]) -> list[str]:
    return [claim.claim for claim in conclude(Study(), tuple(found)).claims if not claim.met]


ACCURATE = [
    ({"place": 2.2}, ["95 % of position", "rooms of 3"]),
    ({"turn": 3.0}, ["95 % of heading", "rooms of 3"]),
    ({"outlier": 0.11}, ["largest position"]),
    ({"doubt": 0.8}, ["mean squared normalised", "inside the 95 %"]),
    ({"doubt": 1.4}, ["mean squared normalised", "inside the 95 %"]),
    ({"doubt": 1.2}, []),
]


@pytest.mark.parametrize("name", [PLAN, AS_BUILT])
@pytest.mark.parametrize(("changes", "said"), ACCURATE)
def test_claims_on_accuracy_fail_where_the_errors_are_too_large(
    name: str, changes: dict[str, float], said: list[str]
) -> None:
    assert failed(conclude_rooms, [room()] * 3) == []
    found = failed(conclude_rooms, [room(name, track(**changes))] * 3)
    assert all(claim.startswith(f"{name}: ") for claim in found)
    assert len(found) == len(said)
    assert all(any(word in claim for claim in found) for word in said)


@pytest.mark.parametrize("name", [PLAN, AS_BUILT, BUILT, PAPER])
def test_what_lacks_what_is_claimed_shows_nothing(name: str) -> None:
    assert all(claim.holds for claim in conclude_rooms(Study(), (room(),)).claims)
    for what in (RIVALS[name], ODOMETRY):
        lacking = conclude_rooms(Study(), (room(name, RIVALRY[what]),)).claims
        about = [claim for claim in lacking if claim.claim.startswith(name) and claim.counterfactual.what == what]
        assert about or name == PAPER
        assert not any(claim.holds for claim in about)


def test_a_built_map_has_bars_of_its_own_and_a_slow_sweep_has_none() -> None:
    assert failed(conclude_rooms, [room(BUILT, track(place=2.2, turn=3.0))] * 3) == []
    found = failed(conclude_rooms, [room(BUILT, track(place=6.5, turn=6.5))] * 3)
    assert ["95 % of" in claim and claim.startswith(BUILT) for claim in found] == [True, True]
    assert failed(conclude_rooms, [room(SLOW, track(place=10.0))] * 3) == []


def test_one_room_of_three_or_a_posture_that_is_missing_is_enough_to_fail() -> None:
    assert any(
        "rooms of 3" in claim for claim in failed(conclude_rooms, [room(), room(PLAN, track(place=2.2)), room()])
    )
    lost = track()
    lost.errors[2000] = np.nan
    assert any("95 % of position" in claim for claim in failed(conclude_rooms, [room(PLAN, lost)]))


def test_the_figures_are_in_the_units_that_the_claims_name() -> None:
    claims = {
        claim.claim: claim.measured for claim in conclude_rooms(Study(), (room(PLAN, track(outlier=0.5)),)).claims
    }
    # 95 % of Rayleigh's distribution, and of the absolute normal one.
    assert claims[f"{PLAN}: 95 % of position errors [cm]"] == pytest.approx(0.2 * 2.448, rel=0.03)
    assert claims[f"{PLAN}: 95 % of heading errors [deg]"] == pytest.approx(math.degrees(0.001) * 1.96, rel=0.03)
    assert claims[f"{PLAN}: largest position error [cm]"] == pytest.approx(50.0, abs=1.0)


def starts(**count: int) -> list[Starts]:
    return [Starts("room", Counter({answer: many}), Counter(wrong=1)) for answer, many in count.items()]


def test_claims_on_starts_fail_where_too_few_are_found_or_too_many_wrong() -> None:
    assert failed(conclude_starts, starts(right=95, none=4, wrong=1)) == []
    assert failed(conclude_starts, starts(right=94, ambiguous=6)) == ["of 100 starts found [%]"]
    assert failed(conclude_starts, starts(right=98, wrong=2)) == ["wrong and confident [%]"]


@pytest.mark.parametrize(("status", "posture", "answer"), [
    (Status.TRACKING, (1.09, 2.0, 0.05), "right"), (Status.TRACKING, (1.08, 2.08, 0.0), "wrong"),
    (Status.TRACKING, (1.0, 2.0, math.radians(3.1)), "wrong"), (Status.AMBIGUOUS, (1.0, 2.0, 0.0), "ambiguous"),
    (Status.SEARCHING, (1.0, 2.0, 0.0), "none"), (Status.SEARCHING, None, "none"),
])  # fmt: skip
def test_an_answer_is_right_within_10_cm_and_3_deg(
    status: Status, posture: tuple[float, float, float] | None, answer: str
) -> None:
    told: Any = SimpleNamespace(status=status, posture=posture)
    assert searching.answer_of(told, (1.0, 2.0, 0.0)) == answer


def twofold(status: Status = Status.AMBIGUOUS, named: int = 2, off: float = 0.05) -> Results:
    return Results(room="room", status=status, named=named, expected=2, off=off)


def twice(*found: Results) -> list[Twice]:
    """Without what is claimed they're as well."""
    return [Twice(one, one) for one in found]


def carried(noticed: float, off: float) -> Results:
    return Results(room="room", distance=2.0, noticed=noticed, recovered=6.0, off=off)


def axis(place: str, *, named: float = 1.0, none: float = 0.0, along: float = 1.0) -> Results:
    return Results(
        place=place, named=named, none=none, along=along, across=0.01, inside=0.95, middles_named=0.0,
        middles_ratio=1.0, single_none=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("bad", [
    twofold(Status.TRACKING), twofold(named=1), twofold(named=4), twofold(off=0.11), twofold(off=math.nan),
])  # fmt: skip
def test_a_symmetric_room_that_is_taken_for_another_fails(bad: Results) -> None:
    assert failed(conclude_symmetric, twice(*[twofold()] * 3)) == []
    assert len(failed(conclude_symmetric, twice(twofold(), bad))) == 1


@pytest.mark.parametrize(("noticed", "off", "said"), [
    (3.1, 0.01, "noticed"), (math.inf, 0.01, "noticed"), (1.0, 0.11, "found again"), (1.0, math.nan, "found again"),
])  # fmt: skip
def test_a_robot_that_never_finds_itself_again_fails(noticed: float, off: float, said: str) -> None:
    good = carried(1.0, 0.01)
    assert failed(conclude_carried, twice(good, good)) == []
    (claim,) = failed(conclude_carried, twice(good, carried(noticed, off)))
    assert said in claim


@pytest.mark.parametrize(("bad", "said"), [
    (axis("corridor", named=0.94), "named"),
    (axis("single wall", along=0.09), "times"),
    (axis("room", named=0.0, none=0.94), "nothing"),
])  # fmt: skip
def test_an_axis_that_is_not_named_fails(bad: Results, said: str) -> None:
    good = [axis("corridor"), axis("single wall"), axis("room", named=0.0, none=1.0)]
    assert failed(conclude_axes, good) == []
    (claim,) = failed(conclude_axes, [bad])
    assert said in claim
    assert claim.startswith(bad.place)
