"""`vrs lab control`: who sees late is slower or strays, and nothing else differs between them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from interfaces.lab.claims import Study
from interfaces.lab.control import study
from interfaces.lab.control.operators import Course, Follower, Stepper, Tool, Wheels
from interfaces.lab.control.study import CASES, TRACKER, TWIN, VIEWS, WAITS, conclude, drive, steer

LINE = Course(np.column_stack((np.linspace(0.0, 1.0, 101), np.zeros(101))))


def seen(go: Any, delay: str, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.setattr(study, "LONGEST", 30.0 if go is steer else 75.0)
    monkeypatch.setattr(study, "network", lambda _: delay)
    return {view: go(view, delay, 0) for view in VIEWS}


@pytest.mark.parametrize("go", [steer, drive])
def test_with_delay_the_tracker_strays_and_who_waits_is_slower(go: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    late = seen(go, "constant:0.3", monkeypatch)
    assert late[TWIN].done
    assert late[WAITS].done
    assert late[TRACKER].error > 2 * late[TWIN].error
    assert late[WAITS].time > 1.3 * late[TWIN].time
    assert late[WAITS].waited > late[TRACKER].waited == 0.0


def test_who_sees_the_virtual_robot_does_the_same_whatever_the_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    prompt, late = (seen(steer, delay, monkeypatch)[TWIN] for delay in ("constant:0.02", "constant:0.3"))
    assert late.error == pytest.approx(prompt.error, abs=1e-3)
    # The real robot follows, so much later.
    assert late.time - prompt.time == pytest.approx(0.28, abs=0.1)


def along(follower: Follower, period: float, delay: float, speed: float = 1.0) -> tuple[list[float], list[float]]:
    """Where a point is that does as it's told, seen so much later, and how fast it's told to go."""
    places, told, place = [], [], np.zeros(2)
    for k in range(4000):
        places.append(float(place[0]))
        seen = places[max(k - round(delay / period), 0)]
        v = follower.act(k * period, np.array([seen, 0.0]))
        told.append(float(v[0]))
        place = place + speed * period * v
        if follower.finished:
            break
    return places, told


class Point(Tool):
    """A tool in the plane."""

    rest = np.zeros(2)


def test_who_tracks_goes_on_and_who_waits_does_nothing_until_he_sees_what_came_of_it() -> None:
    places, told = along(Follower(LINE, Point()), 0.02, 0.0)
    assert places[-1] == pytest.approx(1.0, abs=0.02)
    assert min(told[:-50]) > 0.0
    stepper = Stepper(LINE, Point())
    places, told = along(stepper, 0.02, 1.0)
    assert stepper.finished
    # A step, and then at least the delay and his reaction and until it's at rest.
    moving = np.array(told) != 0.0
    begun = np.flatnonzero(moving[1:] & ~moving[:-1])
    rests = np.flatnonzero(~moving[1:] & moving[:-1])
    waits = 0.02 * (begun - rests[: len(begun)])
    assert len(begun) >= 15
    assert waits.min() > 1.0 + 0.2
    assert stepper.waited == pytest.approx(0.02 * np.count_nonzero(~moving[:-1]), rel=0.05)


def test_a_base_turns_to_what_lies_aside_before_it_goes() -> None:
    hand = Wheels()
    seen = np.array([0.0, 0.0, 0.0])
    v, w = hand.toward(seen, np.array([0.0, 1.0]), 1.0)
    assert v == 0.0
    assert w == hand.turning
    (turning, turn), (driving, ahead) = hand.moves(seen, np.array([0.0, -0.6]))
    assert turn[1] * turning == pytest.approx(-np.pi / 2)
    assert ahead[0] * driving == pytest.approx(0.6)


def result(time: float, error: float) -> Any:
    track = np.zeros((2, 3))
    return study.Results(done=True, time=time, error=error, largest=error, waited=0.0, track=track, line=track)


def test_the_twin_gains_where_its_figures_say_so() -> None:
    good = {TWIN: (result(10, 0.01),) * 5, TRACKER: (result(9, 0.05),) * 5, WAITS: (result(30, 0.01),) * 5}
    asked = Study(runs=5)
    assert all(claim.holds for claim in conclude(asked, (good,) * len(CASES)).claims)
    # Whoever sees the same as the rival gains nothing.
    for rival in (TRACKER, WAITS):
        off = conclude(asked, (good | {TWIN: good[rival]},) * len(CASES)).claims
        assert not any(claim.holds for claim in off if claim.counterfactual and claim.counterfactual.what == rival)
