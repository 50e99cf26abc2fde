"""`vrs lab control`: who sees late is slower or strays; without delay, or seeing late himself, nobody gains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from interfaces.cli.main import app
from interfaces.lab.claims import Results, Study, Verdict
from interfaces.lab.control import study
from interfaces.lab.control.operators import OPERATORS, Course, Driver, Follower, Stepper, Tool, Wheels
from interfaces.lab.control.study import PROFILES, PROMPT, TRACKER, TWIN, WAITS, Runs, gain_claims, work
from vrs.errors import InvalidValueError

LINE = Course(np.column_stack((np.linspace(0.0, 1.0, 101), np.zeros(101))))
SMALL = Study(runs=2)
LATE = "thu"


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = study.course
    monkeypatch.setattr(study, "course", lambda *given: Course(whole(*given).points[:401]))
    monkeypatch.setattr(study, "LONGEST", 40.0)
    monkeypatch.setattr(study, "network", lambda profile: profile if profile == PROMPT else "constant:0.4")


def claimed(robot: str, prompt: Runs, late: Runs) -> list[Verdict]:
    """Verdicts on the path beside the tracker, and on the time beside who waits."""
    found = {PROMPT: prompt, **dict.fromkeys(PROFILES, late)}
    return [claim.verdict for claim in gain_claims(SMALL, robot, found, tuple(OPERATORS))[:2]]


@pytest.mark.parametrize("robot", study.ROBOTS)
def test_the_twin_gains_by_showing_at_once_what_is_seen_late(robot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if robot == "arm":
        monkeypatch.setattr(study, "LONGEST", 20.0)
    prompt, late = (work(SMALL, f"{robot}:{profile}", tuple(OPERATORS)) for profile in (PROMPT, LATE))
    assert claimed(robot, prompt, late) == [Verdict.HOLDS] * 2
    assert all(one.done for one in (*late[TWIN], *late[WAITS]))
    assert [one.error for one in late[TWIN]] == pytest.approx([one.error for one in prompt[TWIN]], abs=1e-3)
    assert all(one.waited > 2.0 for one in late[WAITS])
    # Without delay nothing is gained, and where as much is gained without delay it isn't shown.
    assert claimed(robot, prompt, prompt | {WAITS: prompt[TRACKER]}) == [Verdict.FAILS] * 2
    assert claimed(robot, late | {TRACKER: late[WAITS]}, late)[1] is Verdict.NOT_SHOWN
    # The mechanism off: who has the virtual robot is shown the real one, or drives that.
    monkeypatch.setattr(study, "steer_virtual", study.steer_real)
    monkeypatch.setattr(study, "Driver", lambda who, start, **_: Driver(who, start, sees_real=True))
    blind = work(SMALL, f"{robot}:{LATE}", ())
    assert claimed(robot, prompt, late | blind)[0] is Verdict.FAILS


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


def test_who_waits_makes_another_step_where_one_was_lost() -> None:
    stepper = Stepper(LINE, Point())
    still = np.zeros(2)
    told = [float(stepper.act(0.02 * k, still)[0]) for k in range(400)]
    begun = np.flatnonzero(np.diff(np.array(told) != 0.0)) * 0.02
    assert begun[1] - begun[0] == pytest.approx(5.0, abs=0.05)
    assert not stepper.finished


def test_a_base_turns_to_what_lies_aside_before_it_goes() -> None:
    hand = Wheels()
    seen = np.array([0.0, 0.0, 0.0])
    v, w = hand.toward(seen, np.array([0.0, 1.0]), 1.0)
    assert v == 0.0
    assert w == hand.turning
    (turning, turn), (driving, ahead) = hand.moves(seen, np.array([0.0, -0.6]))
    assert turn[1] * turning == pytest.approx(-np.pi / 2)
    assert ahead[0] * driving == pytest.approx(0.6)


def test_an_operator_of_ones_own_is_measured_and_a_wrong_name_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_hand.py").write_text(
        "from interfaces.lab.control.operators import Follower\n\nclass Slow(Follower):\n    pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    (part,) = study.study_of(("own_hand:Slow",)).parts
    own, tracked = (study.steer(who, PROMPT, 0) for who in ("own_hand:Slow", TRACKER))
    assert own.time == tracked.time
    claims = part.conclude(SMALL, tuple(runs_of(case, (own,) * 2) for case in study.CASES)).claims
    assert len(claims) == 2 * 2 * len(PROFILES)
    for options, said in (
        (("--operator", "nobody"), "move-and-wait"),
        (("--operator", "tracker", "--operator", "tracker"), "once"),
        (("--delay", "thu"), "--delay"),
    ):
        with pytest.raises(InvalidValueError, match=said):
            CliRunner().invoke(app, ["lab", "control", "--out", str(tmp_path), *options], catch_exceptions=False)


def runs_of(case: str, own: tuple[Results, ...]) -> Runs:
    track = np.zeros((2, 3 if case.startswith("arm") else 2))
    made = tuple(Results(**{**vars(one), "track": track, "line": track}) for one in own)
    return {TWIN: made, "own_hand:Slow": made}
