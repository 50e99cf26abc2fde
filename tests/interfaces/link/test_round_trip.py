"""The round-trip estimator on bad links, against exact computation over what arrived."""

from __future__ import annotations

import heapq
import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.link import delay_profile
from interfaces.link.round_trip import (
    SEQUENCE_NUMBERS,
    DelayStatistics,
    Echo,
    EchoRefusal,
    Probe,
    ProbeConfig,
    RoundTrip,
    RoundTripEstimator,
    WindowConfig,
)
from tests.memory import values_held
from vrs.errors import InvalidValueError

SESSION = 77
OFFSET = 1.7e9
"""B's clock less A's [s]."""


def drive(estimator, fate, until):
    """Probe until the time, over a link whose fate(now) lists (forward, back, held) for each copy that returns.

    Yields what each arrival gave, with the echo and the time.
    """
    arrivals, count, now = [], 0, 0.0
    while True:
        deadline = max(now, estimator.next_deadline())
        if arrivals and arrivals[0][0] <= deadline:
            now, _, echo = heapq.heappop(arrivals)
            yield estimator.receive(echo, now=now), echo, now
            continue
        if deadline > until:
            return
        now = deadline
        probe = estimator.to_send(now=now)
        if probe is None:
            continue
        for forward, back, held in fate(now):
            received = OFFSET + now + forward
            echo = probe.echo(received, received + held)
            heapq.heappush(arrivals, (now + forward + held + back, count, echo))
            count += 1


def test_statistics_are_those_of_the_window():
    rng = np.random.default_rng(3)
    source = delay_profile("mon").source(rng)
    window = WindowConfig(capacity=100, horizon=20.0)
    estimator = RoundTripEstimator(SESSION, ProbeConfig(period=0.15, timeout=5.0, window=window))
    arrived = []

    def fate(now):
        if rng.random() < 0.2:
            return []
        copies = 1 + (rng.random() < 0.1)
        return [(source(now, 0), 0.3 * rng.random(), 0.01 * rng.random()) for _ in range(copies)]

    for outcome, echo, now in drive(estimator, fate, until=120.0):
        if not isinstance(outcome, RoundTrip):
            assert outcome is EchoRefusal.UNEXPECTED
            continue
        delay = (now - echo.sent) - (echo.replied - echo.received)
        arrived.append((now, delay))
        expected = [d for t, d in arrived[-100:] if now - t < 20.0]
        known = estimator.delays
        assert outcome.delay == delay
        assert len(known) == len(expected)
        assert known.mean == pytest.approx(np.mean(expected), rel=1e-12)
        found = (known.minimum, known.median, known.maximum, known.quantile(0.9))
        assert found == pytest.approx(np.quantile(expected, (0, 0.5, 1, 0.9)), abs=1e-12)
    assert estimator.sent > 500
    assert estimator.sent == estimator.returned + estimator.lost + len(estimator.in_flight)
    assert estimator.refused > 20
    assert estimator.lost / estimator.sent == pytest.approx(0.2, abs=0.12)


def test_jitter_is_that_of_rfc_3550():
    rng = np.random.default_rng(5)
    delays = rng.random(300).tolist()
    found, shifted, exact = DelayStatistics(), DelayStatistics(), 0.0
    for i, delay in enumerate(delays):
        found.add(delay, now=float(i))
        shifted.add(delay - 1e6, now=float(i))
        if i:
            exact += (abs(delay - delays[i - 1]) - exact) / 16
    assert found.jitter == pytest.approx(exact, rel=1e-12)
    assert shifted.jitter == pytest.approx(exact, rel=1e-6)
    found.clear()
    assert found.jitter == 0


def test_every_fate_counts_once():
    """Loss, a duplicate, overtaking, a late echo: what each is to the counters."""
    estimator = RoundTripEstimator(SESSION, ProbeConfig(period=1.0, timeout=2.5))
    probes = [estimator.to_send(now=float(t)) for t in range(3)]
    assert estimator.next_deadline() == 2.5
    assert isinstance(estimator.receive(probes[2].echo(0.0), now=2.1), RoundTrip)
    assert isinstance(estimator.receive(probes[1].echo(0.0), now=2.2), RoundTrip)
    assert estimator.receive(probes[1].echo(0.0), now=2.3) is EchoRefusal.UNEXPECTED
    assert estimator.to_send(now=2.5) is None
    assert estimator.receive(probes[0].echo(0.0), now=2.6) is EchoRefusal.UNEXPECTED
    assert (estimator.sent, estimator.returned, estimator.lost, estimator.refused) == (3, 2, 1, 2)
    assert (estimator.delays.minimum, estimator.delays.maximum) == (pytest.approx(0.1), pytest.approx(1.2))


@pytest.mark.parametrize(
    ("echo", "refusal"),
    [
        (Echo(SESSION + 1, 0, 0.0, 1.0, 1.0), EchoRefusal.FOREIGN),
        (Echo(SESSION, 1, 0.0, 1.0, 1.0), EchoRefusal.UNEXPECTED),
        (Echo(SESSION, 0, 0.5, 1.0, 1.0), EchoRefusal.UNEXPECTED),
        (Echo(SESSION, 0, math.nan, 1.0, 1.0), EchoRefusal.UNEXPECTED),
        (Echo(SESSION, 0, 0.0, math.nan, 1.0), EchoRefusal.IMPOSSIBLE),
        (Echo(SESSION, 0, 0.0, 1.0, math.inf), EchoRefusal.IMPOSSIBLE),
        (Echo(SESSION, 0, 0.0, -math.inf, -math.inf), EchoRefusal.IMPOSSIBLE),
        (Echo(SESSION, 0, 0.0, 1e300, 1e300), EchoRefusal.IMPOSSIBLE),
        (Echo(SESSION, 0, 0.0, 1.0, 0.9), EchoRefusal.IMPOSSIBLE),
        (Echo(SESSION, 0, 0.0, 1.0, 3.0), EchoRefusal.IMPOSSIBLE),
    ],
)
def test_a_refused_echo_changes_nothing_but_its_counter(echo, refusal):
    estimator = RoundTripEstimator(SESSION)
    probe = estimator.to_send(now=0.0)
    assert estimator.receive(echo, now=1.0) is refusal
    known = estimator.delays
    assert (len(known), estimator.returned, estimator.refused, known.mean) == (0, 0, 1, None)
    assert estimator.receive(probe.echo(1.0), now=1.0) == RoundTrip(0.0, 1.0, 1.0, 1.0)


def test_sequence_numbers_wrap_and_an_old_echo_of_the_same_number_is_told_apart():
    estimator = RoundTripEstimator(SESSION, ProbeConfig(period=0.001, timeout=1000.0, most_in_flight=3))
    old = estimator.to_send(now=0.0)
    assert estimator.receive(old.echo(0.0), now=0.0005).delay == 0.0005
    kept, now, seen = None, 0.0, []
    for i in range(1, SEQUENCE_NUMBERS + 100):
        now = max(estimator.next_deadline(), now)
        probe = estimator.to_send(now=now)
        seen.append(probe.sequence)
        if i == 10:
            kept = probe
            continue
        if probe.sequence == old.sequence:
            assert estimator.receive(old.echo(0.0), now=now) is EchoRefusal.UNEXPECTED
        assert isinstance(estimator.receive(probe.echo(0.0), now=now), RoundTrip)
    assert max(seen) == SEQUENCE_NUMBERS - 1
    assert seen.count(old.sequence) == 1
    assert seen.count(kept.sequence) == 1  # still in flight: the number isn't given a second time
    assert isinstance(estimator.receive(kept.echo(0.0), now=now), RoundTrip)


def test_a_late_call_sends_one_probe_not_a_burst():
    estimator = RoundTripEstimator(SESSION, ProbeConfig(period=0.1))
    assert estimator.to_send(now=0.0) is not None
    assert estimator.to_send(now=0.05) is None
    assert estimator.to_send(now=10.0) is not None
    assert estimator.to_send(now=10.0) is None
    assert estimator.next_deadline() == 10.1
    assert estimator.to_send(now=10.104) is not None
    assert estimator.next_deadline() == pytest.approx(10.2)  # a timer that is late each time costs no probes


def test_a_dead_link_holds_a_bounded_number_of_probes():
    config = ProbeConfig(period=0.01, timeout=5.0, most_in_flight=20, window=WindowConfig(capacity=50))
    estimator = RoundTripEstimator(SESSION, config)
    sent = []
    while estimator.next_deadline() < 100.0:
        now = estimator.next_deadline()
        sent += [now] * (estimator.to_send(now=now) is not None)
        assert values_held(estimator) < 100
    assert estimator.sent == len(sent) == 400
    assert estimator.lost + len(estimator.in_flight) == 400
    assert estimator.delays.median is None


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.lists(st.tuples(st.floats(0, 3), st.floats(0, 3), st.floats(0, 0.1)), max_size=3),
        min_size=1,
        max_size=10,
    ),
    st.integers(1, 8),
    st.sampled_from([0.15, 0.4]),
)
def test_any_schedule_is_counted_exactly(fates, most, period):
    """However copies are lost, doubled, delayed and reordered: each probe returns once, in time, or is lost."""
    config = ProbeConfig(period=period, timeout=2.0, most_in_flight=most)
    estimator = RoundTripEstimator(SESSION, config)
    calls = iter(fates)
    arrivals, returned = [], {}

    def fate(now):
        copies = next(calls, [])
        arrivals.extend((now + forward + held + back, now) for forward, back, held in copies)
        return copies

    for outcome, echo, now in drive(estimator, fate, until=30.0):
        if isinstance(outcome, RoundTrip):
            assert echo.sent not in returned
            assert now < echo.sent + 2.0
            returned[echo.sent] = now
        else:
            assert outcome is EchoRefusal.UNEXPECTED
            assert echo.sent in returned or now >= echo.sent + 2.0
    assert estimator.returned == len(returned)
    assert estimator.returned + estimator.refused == len(arrivals)
    assert estimator.sent == estimator.returned + estimator.lost + len(estimator.in_flight)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ProbeConfig(period=0.0),
        lambda: ProbeConfig(timeout=math.inf),
        lambda: ProbeConfig(timeout=math.nan),
        lambda: ProbeConfig(most_in_flight=0),
        lambda: ProbeConfig(most_in_flight=SEQUENCE_NUMBERS),
        lambda: WindowConfig(capacity=0),
        lambda: WindowConfig(horizon=-1.0),
        lambda: WindowConfig(smoothing=0.5),
        lambda: RoundTripEstimator(-1),
        lambda: RoundTripEstimator(2**32),
        lambda: RoundTripEstimator(0, start=math.nan),
    ],
)
def test_nonsense_is_refused(make):
    with pytest.raises(InvalidValueError):
        make()


def test_time_that_runs_back_is_refused_and_changes_nothing():
    estimator = RoundTripEstimator(SESSION)
    probe = estimator.to_send(now=1.0)
    with pytest.raises(InvalidValueError):
        estimator.to_send(now=0.9)
    with pytest.raises(InvalidValueError):
        estimator.receive(probe.echo(0.0), now=0.9)
    assert isinstance(estimator.receive(probe.echo(0.0), now=1.0), RoundTrip)


def test_a_call_costs_no_more_than_20_microseconds():
    """Two calls, a probe sent and its echo taken; the best of several runs, in a window of 1,000."""
    estimator = RoundTripEstimator(SESSION, ProbeConfig(period=0.001))
    rng = np.random.default_rng(0)
    laps, now = [], 0.0
    for _ in range(10):
        waits = (0.0009 * rng.random(500)).tolist()
        begin = time.process_time()
        for wait in waits:
            now = max(now, estimator.next_deadline())
            probe = estimator.to_send(now=now)
            now += wait
            estimator.receive(Probe(probe.session, probe.sequence, probe.sent).echo(now), now=now)
        laps.append((time.process_time() - begin) / 500)
    assert estimator.returned == 5000
    assert min(laps) < 40e-6
