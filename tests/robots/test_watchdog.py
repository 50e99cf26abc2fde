from __future__ import annotations

import math
import pickle
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.onboard.watchdog import (
    LARGEST,
    AcceptedFuture,
    BeginStop,
    GoOn,
    Kind,
    LossPolicy,
    Manner,
    SequenceWindow,
    Stamp,
    StopReason,
    Verdict,
    Watchdog,
    WatchdogConfig,
    WatchdogState,
)
from tests.memory import values_held
from vrs.errors import InvalidValueError

TICK = 1e-3


def armed(now: float = 0.0, **values: object) -> Watchdog:
    dog = Watchdog(WatchdogConfig(**values))  # type: ignore[arg-type]
    assert dog.arm(1, now=now) is Verdict.FRESH
    assert dog.advance(now=now) == (GoOn(now, 1),)
    return dog


def hear(dog: Watchdog, sequence: int, now: float, **changes: object) -> Verdict:
    return dog.heard(replace(Stamp(1, sequence, now), **changes), now=now, authentic=True)


def stop_of(dog: Watchdog, now: float, rest_at: float | None = None) -> BeginStop:
    (action,) = dog.advance(now=now, rest_at=rest_at)
    assert isinstance(action, BeginStop)
    return action


def halted(dog: Watchdog, now: float) -> Watchdog:
    assert dog.stopped(stop_of(dog, now).number, now=now)
    return dog


@pytest.mark.parametrize("timeout", [0.1, 0.5, 2.0])
def test_the_stop_begins_at_the_deadline_to_a_tick(timeout: float) -> None:
    dog = armed(now=0.25, timeout=timeout)
    heard = 0.317
    assert hear(dog, 0, heard) is Verdict.FRESH
    k = 318
    while not (actions := dog.advance(now=k * TICK)):
        k += 1
    (action,) = actions
    assert isinstance(action, BeginStop)
    assert action.due == heard + timeout
    assert heard + timeout <= action.at == k * TICK < heard + timeout + 1.001 * TICK
    assert dog.state is WatchdogState.STOPPING
    assert action.manner is Manner.COMMANDED


def test_next_deadline_is_when_advance_speaks() -> None:
    dog = Watchdog()
    assert dog.next_deadline() is None
    dog.arm(1, now=0.0)
    assert dog.next_deadline() == 0.0
    dog.advance(now=0.0)
    assert dog.next_deadline() == 0.5
    assert dog.advance(now=math.nextafter(0.5, 0)) == ()
    assert stop_of(dog, 0.5).due == 0.5
    assert dog.next_deadline() is None


def test_a_stop_is_never_dated_back() -> None:
    """The stop trajectory that demanded 14.5 m/s came from a late stamp (ros_controllers #493)."""
    action = stop_of(armed(), 3.25)
    assert (action.at, action.due) == (3.25, 0.5)


def test_a_message_after_the_deadline_is_too_late_even_if_nobody_looked() -> None:
    dog = armed()
    assert hear(dog, 0, 0.5) is Verdict.HALTED
    assert dog.state is WatchdogState.STOPPING
    assert stop_of(dog, 0.51).due == 0.5


def test_the_timeout_doesnt_know_how_fast_time_runs() -> None:
    """A hard-coded wall-clock time-out tripped in sped-up simulation (PX4 #14283)."""
    dog = armed()
    for k in range(1, 40_000):
        assert hear(dog, k, 0.4 * k) is Verdict.FRESH
        assert dog.advance(now=0.4 * k) == ()
    last = 0.4 * 39_999
    assert stop_of(dog, last + 0.5).due == last + 0.5


def test_halt_needs_a_resume_that_knows_the_stop() -> None:
    dog = halted(armed(), 0.5)
    assert hear(dog, 5, 1.0) is Verdict.HALTED
    assert hear(dog, 6, 1.0, kind=Kind.HEARTBEAT) is Verdict.NOTED
    assert hear(dog, 6, 1.0, kind=Kind.HEARTBEAT) is Verdict.DUPLICATE
    assert hear(dog, 7, 1.0, kind=Kind.RESUME, answers=2) is Verdict.OTHER_STOP
    assert dog.advance(now=30.0) == ()
    assert hear(dog, 8, 30.0, kind=Kind.RESUME, answers=1) is Verdict.FRESH
    assert dog.advance(now=30.0) == (GoOn(30.0, 1),)
    assert hear(dog, 5, 30.0) is Verdict.BEFORE_RESUME
    assert hear(dog, 9, 30.0) is Verdict.FRESH


def test_a_resume_of_an_earlier_stop_doesnt_undo_a_later_one() -> None:
    dog = halted(armed(), 0.5)
    dog.stop(StopReason.OPERATOR, now=0.6)
    halted(dog, 0.6)
    assert hear(dog, 1, 0.7, kind=Kind.RESUME, answers=1) is Verdict.OTHER_STOP
    assert hear(dog, 2, 0.7, kind=Kind.RESUME, answers=2) is Verdict.FRESH


def test_a_moving_robot_isnt_resumed_or_armed() -> None:
    dog = armed()
    stop = stop_of(dog, 0.5)
    assert hear(dog, 0, 0.6, kind=Kind.RESUME, answers=stop.number) is Verdict.MOVING
    assert dog.arm(2, now=0.6) is Verdict.MOVING
    assert dog.stopped(stop.number, now=0.7)
    assert dog.arm(2, now=0.7) is Verdict.FRESH
    assert dog.arm(3, now=0.7) is Verdict.MOVING


def test_under_hold_the_next_command_goes_on_however_old() -> None:
    dog = halted(armed(policy=LossPolicy.HOLD), 0.5)
    assert hear(dog, 0, 9.0, kind=Kind.HEARTBEAT) is Verdict.NOTED
    assert dog.state is WatchdogState.HALTED
    assert hear(dog, 1, 9.0, issued_at=0.1) is Verdict.FRESH
    assert dog.advance(now=9.0) == (GoOn(9.0, 1),)


def test_under_hold_only_a_lost_link_ends_by_itself() -> None:
    dog = armed(policy=LossPolicy.HOLD)
    stop_of(dog, 0.5)
    dog.stop(StopReason.TOLERANCE, now=0.6, manner=Manner.MEASURED)
    halted(dog, 0.6)
    assert hear(dog, 1, 0.7) is Verdict.HALTED
    assert hear(dog, 2, 0.7, kind=Kind.RESUME, answers=2) is Verdict.FRESH


def test_under_hold_a_robot_that_is_still_stopping_goes_on() -> None:
    dog = armed(policy=LossPolicy.HOLD)
    stop_of(dog, 0.5)
    assert hear(dog, 1, 0.55) is Verdict.FRESH
    assert dog.advance(now=0.55) == (GoOn(0.55, 1),)


def test_finish_lets_the_accepted_motion_be_the_stop_and_no_longer() -> None:
    values = {"future": AcceptedFuture.FINISH}
    assert stop_of(armed(**values), 0.5, rest_at=1.0).manner is Manner.FINISH
    assert stop_of(armed(**values), 0.5, rest_at=1.001).manner is Manner.COMMANDED
    assert stop_of(armed(**values), 0.5).manner is Manner.COMMANDED
    assert stop_of(armed(), 0.5, rest_at=0.6).manner is Manner.COMMANDED
    # Looked at only when the time to finish is over, too.
    assert stop_of(armed(**values), 1.001, rest_at=0.9).manner is Manner.COMMANDED
    dog = armed(**values)
    first = stop_of(dog, 0.5, rest_at=0.9)
    assert dog.next_deadline() == 1.0
    second = stop_of(dog, 1.0, rest_at=1.2)
    assert (second.due, second.manner, second.number) == (1.0, Manner.COMMANDED, first.number + 1)
    assert not dog.stopped(first.number, now=1.0)
    assert dog.advance(now=9.0, rest_at=9.1) == ()


def test_a_motion_that_finished_isnt_stopped_again() -> None:
    dog = armed(future=AcceptedFuture.FINISH)
    stop = stop_of(dog, 0.5, rest_at=0.9)
    assert dog.stopped(stop.number, now=0.9)
    assert dog.next_deadline() is None
    assert dog.advance(now=5.0) == ()
    assert dog.state is WatchdogState.HALTED


def test_an_operators_stop_doesnt_wait_for_the_motion_to_finish() -> None:
    dog = armed(future=AcceptedFuture.FINISH)
    dog.stop(StopReason.OPERATOR, now=0.1)
    assert stop_of(dog, 0.1, rest_at=0.2).manner is Manner.COMMANDED


def test_a_violation_isnt_forgotten_for_a_later_stop_of_the_same_tick() -> None:
    dog = armed()
    dog.stop(StopReason.TOLERANCE, now=0.1, manner=Manner.MEASURED)
    dog.stop(StopReason.OPERATOR, now=0.1)
    action = stop_of(dog, 0.1)
    assert (action.reason, action.manner) == (StopReason.OPERATOR, Manner.MEASURED)


def test_disarming_makes_the_epoch_stale() -> None:
    dog = armed()
    dog.disarm(now=0.1)
    assert dog.epoch is None
    halted(dog, 0.1)
    for kind, answers in ((Kind.COMMAND, None), (Kind.RESUME, 1)):
        assert hear(dog, 1, 0.2, kind=kind, answers=answers) is Verdict.STALE_EPOCH
    assert dog.arm(1, now=0.2) is Verdict.STALE_EPOCH
    assert dog.arm(2, now=0.2) is Verdict.FRESH
    assert hear(dog, 1, 0.2) is Verdict.STALE_EPOCH
    assert hear(dog, 1, 0.2, epoch=2) is Verdict.FRESH


def test_numbers_begin_anew_with_each_epoch() -> None:
    dog = halted(armed(), 0.5)
    assert hear(dog, 90, 0.6, kind=Kind.RESUME, answers=1) is Verdict.FRESH
    assert hear(dog, 91, 0.6) is Verdict.FRESH
    dog.disarm(now=0.7)
    (stop,) = (action for action in dog.advance(now=0.7) if isinstance(action, BeginStop))
    assert dog.stopped(stop.number, now=0.7)
    assert dog.arm(2, now=0.7) is Verdict.FRESH
    assert hear(dog, 91, 0.7, epoch=2) is Verdict.FRESH
    assert hear(dog, 3, 0.7, epoch=2) is Verdict.FRESH


BAD = [
    (Stamp(1, 1, math.nan), Verdict.INVALID),
    (Stamp(1, 1, math.inf), Verdict.INVALID),
    (Stamp(1, 1, 10**400), Verdict.INVALID),
    (Stamp(1, 1, "0"), Verdict.INVALID),  # type: ignore[arg-type]
    (Stamp(1, -1, 0.1), Verdict.INVALID),
    (Stamp(1, LARGEST + 1, 0.1), Verdict.INVALID),
    (Stamp(True, 1, 0.1), Verdict.INVALID),
    (Stamp(0, 1, 0.1), Verdict.INVALID),
    (Stamp(1.0, 1, 0.1), Verdict.INVALID),  # type: ignore[arg-type]
    (Stamp(1, 1, 0.1, "command"), Verdict.INVALID),  # type: ignore[arg-type]
    (Stamp(1, 1, 0.1, Kind.COMMAND, 1), Verdict.INVALID),
    (Stamp(1, 1, 0.1, Kind.RESUME), Verdict.INVALID),
    (None, Verdict.INVALID),
    (Stamp(2, 1, 0.1), Verdict.UNKNOWN_EPOCH),
    (Stamp(LARGEST, 1, 0.1), Verdict.UNKNOWN_EPOCH),
    (Stamp(1, 0, 0.1), Verdict.DUPLICATE),
    (Stamp(1, 1, -0.41), Verdict.TOO_OLD),
    (Stamp(1, 1, -1e308), Verdict.TOO_OLD),
    (Stamp(1, 1, 0.11), Verdict.FROM_THE_FUTURE),
    (Stamp(1, 1, 3600.0), Verdict.FROM_THE_FUTURE),
]


@pytest.mark.parametrize(("stamp", "verdict"), BAD, ids=str)
def test_a_refused_message_changes_no_bit(stamp: Stamp, verdict: Verdict) -> None:
    dog = armed()
    assert hear(dog, 0, 0.05) is Verdict.FRESH
    before = pickle.dumps(dog)
    assert dog.heard(stamp, now=0.1, authentic=True) is verdict
    assert dog.heard(Stamp(1, 1, 0.1), now=0.1, authentic=False) is Verdict.NOT_AUTHENTIC
    assert dog.heard(Stamp(1, 1, 0.1), now=0.1, authentic=1) is Verdict.NOT_AUTHENTIC  # type: ignore[arg-type]
    assert pickle.dumps(dog) == before


@pytest.mark.parametrize(
    ("issued_at", "uncertainty", "verdict"),
    [
        (0.6, 0.1, Verdict.FRESH),
        (0.59, 0.1, Verdict.TOO_OLD),
        (1.1, 0.1, Verdict.FRESH),
        (1.11, 0.1, Verdict.FROM_THE_FUTURE),
        (1.0, 0.11, Verdict.CLOCK_UNKNOWN),
        (1.0, math.inf, Verdict.CLOCK_UNKNOWN),
        (1.0, math.nan, Verdict.CLOCK_UNKNOWN),
        (1.0, -0.01, Verdict.CLOCK_UNKNOWN),
    ],
)
def test_the_age_gate_allows_for_the_clocks(issued_at: float, uncertainty: float, verdict: Verdict) -> None:
    dog = armed(now=0.9)
    stamp = Stamp(1, 0, issued_at)
    assert dog.heard(stamp, now=1.0, authentic=True, uncertainty=uncertainty) is verdict
    dog = armed(now=0.9, policy=LossPolicy.HOLD)
    assert dog.heard(stamp, now=1.0, authentic=True, uncertainty=uncertainty) is Verdict.FRESH


@pytest.mark.parametrize("now", [math.nan, math.inf, -math.inf, 0.04, "1"])
def test_time_that_isnt_or_runs_back_is_refused_everywhere(now: float) -> None:
    dog = armed()
    assert hear(dog, 0, 0.05) is Verdict.FRESH
    before = pickle.dumps(dog)
    calls = (
        lambda: dog.advance(now=now),
        lambda: dog.heard(Stamp(1, 1, 0.0), now=now, authentic=True),
        lambda: dog.arm(2, now=now),
        lambda: dog.disarm(now=now),
        lambda: dog.stop(StopReason.FAULT, now=now),
        lambda: dog.stopped(1, now=now),
        lambda: dog.advance(now=1.0, rest_at=math.nan),
    )
    for call in calls:
        with pytest.raises(InvalidValueError):
            call()
    assert pickle.dumps(dog) == before


@pytest.mark.parametrize(
    "values",
    [
        {"timeout": 0.09},
        {"timeout": 2.01},
        {"timeout": math.nan},
        {"timeout": "0.5"},
        {"policy": "halt!"},
        {"future": "go"},
        {"max_age": 0.0},
        {"max_uncertainty": -0.1},
        {"window": 0},
        {"window": 1.5},
    ],
)
def test_the_configuration_refuses(values: dict[str, object]) -> None:
    assert WatchdogConfig(policy="hold").policy is LossPolicy.HOLD  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match=next(iter(values))):
        WatchdogConfig(**values)  # type: ignore[arg-type]


@given(st.lists(st.integers(0, 60) | st.integers(LARGEST - 40, LARGEST), max_size=80), st.integers(1, 40))
@settings(max_examples=100, deadline=None)
def test_the_window_takes_each_number_once(numbers: list[int], size: int) -> None:
    window, taken = SequenceWindow(size), set[int]()
    for number in numbers:
        newest = max(taken, default=-1)
        refusal = window.refusal(number)
        if number <= newest - size:
            assert refusal is Verdict.OVERTAKEN
        else:
            assert refusal is (Verdict.DUPLICATE if number in taken else None)
        if refusal is None:
            window.note(number)
            taken.add(number)


def test_the_window_ends_where_it_ends_and_stays_small() -> None:
    window = SequenceWindow(8)
    window.note(3)
    for newest in range(10, 5000):
        window.note(newest)
        assert window.refusal(newest - 7) is (None if newest < 17 and newest - 7 != 3 else Verdict.DUPLICATE)
        assert window.refusal(newest - 8) is Verdict.OVERTAKEN
    assert values_held(window) < 20
