"""What the command filter gives out and keeps is as in the formal model; Fig. 7 and 8; what is bounded."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.onboard.command_filter import CommandFilter, CommandFilterConfig
from tests.robots.onboard.devs import Filter
from vrs.errors import InvalidValueError

INTERVALS = st.sampled_from([0.1, 0.02, 0.25, 1 / 3, 1e-3])


@st.composite
def arrivals(draw):
    """(T, ascending arrival times): bursts, pauses, simultaneous ones, and ones exactly when the generator is
    due."""
    T = draw(INTERVALS)
    times: list[float] = []
    for kind, share in draw(st.lists(st.tuples(st.sampled_from("sbgpe"), st.floats(0, 3)), max_size=40)):
        now = times[-1] if times else 0.0
        if kind == "e":
            done = [t for t, event, *_ in Filter(T).run(times) if event == "generated" and t >= now]
            now = done[min(int(share), len(done) - 1)] if done else now
        now += {"s": 0.0, "b": 0.01 * share * T, "g": share * T, "p": 10 * share, "e": 0.0}[kind]
        times.append(now)
    return T, times


def drive(T, times, *, punctual):
    """Each call's time, the command that it brings and n after it; and what was given out, as it was fetched."""
    calls, outputs = [], []
    filter_ = CommandFilter(CommandFilterConfig(interval=T))

    def fetch(now):
        outputs.extend(filter_.advance(now=now))
        calls.append((now, None, filter_.waiting))

    for i, t in enumerate(times):
        while punctual and (due := filter_.next_deadline()) is not None and due < t:
            fetch(due)
        assert filter_.receive(i, now=t)
        calls.append((t, i, filter_.waiting))
    while (due := filter_.next_deadline()) is not None:
        fetch(max(due, times[-1]))
    assert len(filter_) == 0
    return calls, outputs


def waiting_after(trace, now, command):
    """n of the formal model when a command has come and was passed on if it could be, or after all that was due."""
    if command is None:
        return [n for t, *_, n in trace if t <= now][-1]
    k = [(kind, number) for _, kind, number, _ in trace].index(("received", command))
    return trace[k + 1 if trace[k + 1][1] == "passed" else k][3]


@given(arrivals())
def test_outputs_and_queue_are_the_formal_models(case):
    T, times = case
    expected = Filter(T).run(times)
    generated = [(t, number) for t, kind, number, _ in expected if kind == "generated"]
    for punctual in (True, False):
        calls, outputs = drive(T, times, punctual=punctual)
        assert [n for *_, n in calls] == [waiting_after(expected, now, command) for now, command, _ in calls]
        assert outputs == generated


def test_generated_inputs_hold_what_the_law_is_about():
    """An arrival exactly at ta, and bursts: else the property above says little."""
    trace = Filter(0.1).run([0.0, 0.1, 0.1, 0.2])
    assert [(t, kind, number) for t, kind, number, _ in trace][:5] == [
        (0.0, "received", 0),
        (0.0, "passed", 0),
        (0.1, "received", 1),
        (0.1, "received", 2),
        (0.1, "generated", 0),
    ]


@given(N=st.integers(1, 300), T=st.floats(0.02, 0.5), share=st.floats(0.001, 1.0), t=st.floats(0, 1e4))
def test_the_modified_filter_saves_what_figure_8_says(N, T, share, t):
    """Δt = N (T − T_p)."""

    def last(interval):
        filter_ = CommandFilter(CommandFilterConfig(interval=interval))
        for i in range(N):
            filter_.receive(i, now=t)
        return filter_.advance(now=t + N * interval + 1.0)[-1][0]

    T_p = share * T
    assert last(T) - last(T_p) == pytest.approx(N * (T - T_p), abs=1e-8)


def test_a_burst_comes_out_evenly_as_in_figure_7():
    filter_ = CommandFilter(CommandFilterConfig(interval=0.1))
    for i in range(12):
        filter_.receive(i, now=5.0)
    outputs = filter_.advance(now=6.25)
    assert [command for _, command in outputs] == list(range(12))
    assert [t for t, _ in outputs] == pytest.approx([5.1 + 0.1 * i for i in range(12)])
    assert filter_.next_deadline() is None


def test_a_full_filter_refuses_the_newest_and_counts_it():
    filter_ = CommandFilter(CommandFilterConfig(interval=0.1, capacity=3))
    assert [filter_.receive(i, now=0.0) for i in range(5)] == [True, True, True, False, False]
    assert (len(filter_), filter_.waiting, filter_.refused) == (3, 2, 2)
    # What was given out and not fetched counts, too: nobody fetches, nothing grows.
    assert not filter_.receive(5, now=1.0)
    assert [command for _, command in filter_.advance(now=1.0)] == [0, 1, 2]
    assert filter_.receive(6, now=1.0)


@pytest.mark.parametrize("now", [math.nan, math.inf, -1.0])
def test_time_is_finite_and_ascends(now):
    filter_ = CommandFilter()
    filter_.receive(0, now=0.0)
    with pytest.raises(InvalidValueError):
        filter_.receive(1, now=now)
    with pytest.raises(InvalidValueError):
        filter_.advance(now=now)


@pytest.mark.parametrize("bad", [{"interval": 0.0}, {"interval": math.nan}, {"capacity": 0}, {"capacity": 2.5}])
def test_impossible_configurations_are_refused(bad):
    with pytest.raises(InvalidValueError):
        CommandFilterConfig(**bad)
