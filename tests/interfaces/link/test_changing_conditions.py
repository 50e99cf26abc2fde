"""Conditions that change while packets are on their way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.link import (
    BernoulliLoss,
    Channel,
    Conditions,
    ConstantDelay,
    Gauge,
    GilbertElliottLoss,
    Link,
    LinkConditions,
    PacketRecord,
    Service,
    delay_profile,
    loss_model,
    spelled_loss,
)
from tests.interfaces.link.test_channel import conditions, conserved
from vrs.errors import InvalidValueError

DATAGRAM, IN_ORDER = Service.DATAGRAM, Service.IN_ORDER
serviced = st.builds(
    lambda given_, service: replace(given_, service=service), conditions, st.sampled_from(list(Service))
)
steps = st.lists(st.tuples(st.floats(0, 2), st.none() | serviced), min_size=1, max_size=40)


def run(first, steps, seed, looks):
    """Send a packet or change the conditions after each gap; what came out, and how each packet was sent."""
    channel = Channel(first, np.random.default_rng(seed))
    now, out, sent = 0.0, [], []
    for gap, change in steps:
        now += gap
        if looks:
            while (deadline := channel.next_deadline()) is not None and deadline <= now:
                out += channel.receive(deadline)
        if change is None:
            number = len(sent)
            sent.append((now, channel.conditions.service, channel.send(number, now)))
        else:
            channel.change(change, now)
        conserved(channel)
    while (deadline := channel.next_deadline()) is not None:
        now = max(now, deadline)
        out += channel.receive(now)
        conserved(channel)
    return out, sent, channel.log.take()


@settings(max_examples=200, deadline=None)
@given(serviced, steps, st.integers(0, 99))
def test_what_was_taken_is_carried_as_it_was_to_be(first, steps, seed):
    out, sent, records = run(first, steps, seed, looks=True)
    assert sorted({record.number for record in records}) == list(range(len(sent)))
    arrivals = [item.arrived for item in out]
    assert arrivals == sorted(arrivals)
    came = {}
    for item in out:
        came.setdefault(item.payload, item.arrived)
    for number, (_, service, promised) in enumerate(sent):
        if promised is not None:
            assert came[number] == promised
        if service is IN_ORDER and number in came:
            # Nothing that was sent before it comes after it; copies of datagrams count, too.
            assert all(item.arrived <= came[number] for item in out if item.payload < number)
    ordered = [item.payload for item in out if sent[item.payload][1] is IN_ORDER]
    assert ordered == sorted(set(ordered))
    lost = {record.number for record in records if record.lost is not None and not record.copy}
    assert came.keys() | lost == set(range(len(sent)))
    assert not came.keys() & lost


@settings(max_examples=100, deadline=None)
@given(serviced, steps, st.integers(0, 99))
def test_it_depends_on_the_seed_and_the_instants_alone(first, steps, seed):
    enough = replace(first, capacity=100)
    steps = [(gap, change and replace(change, capacity=100)) for gap, change in steps]
    runs = [run(enough, steps, seed, looks) for looks in (True, False, True)]
    assert runs[0][:2] == runs[2][:2]
    assert [(item.payload, item.sent) for item in runs[0][0]] == [(item.payload, item.sent) for item in runs[1][0]]
    for one, other in zip(runs[0][0], runs[1][0], strict=True):
        assert one.arrived == other.arrived


def test_a_shorter_way_overtakes_only_where_it_may():
    slow, quick = ConstantDelay("slow", 1.0), ConstantDelay("quick", 0.1)
    for service, expected in ((DATAGRAM, [1, 0]), (IN_ORDER, [0, 1])):
        channel = Channel(Conditions(delay=slow, service=service), np.random.default_rng(0))
        assert channel.send(0, 0.0) == 1.0
        channel.change(Conditions(delay=quick, service=service), 0.2)
        assert channel.send(1, 0.3) == (0.4 if service is DATAGRAM else 1.0)
        assert [item.payload for t in (0.5, 1.0) for item in channel.receive(t)] == expected


def test_a_packet_lost_before_meets_the_conditions_of_its_next_attempt():
    channel = Channel(Conditions(loss=BernoulliLoss(1.0), service=IN_ORDER), np.random.default_rng(0))
    assert channel.send("a", 0.0) is None
    # Its second attempt, at 1 s, was lost as well, though nobody looked.
    channel.change(Conditions(delay=ConstantDelay("c", 0.5), service=IN_ORDER), 2.0)
    assert channel.send("b", 2.0) is None
    assert [(item.payload, item.arrived) for item in channel.receive(9.0)] == [("a", 3.5), ("b", 3.5)]
    assert channel.log.totals().resent == 2


def test_what_isn_t_changed_goes_on_as_if_nothing_had_been():
    one, other = (Channel(Conditions(delay=delay_profile("thu")), np.random.default_rng(8)) for _ in range(2))
    arrivals = []
    for channel, share in ((one, 0.0), (other, 0.5)):
        arrivals.append([channel.send(k, 0.1 * k) for k in range(50)])
        if share:
            channel.change(Conditions(delay=delay_profile("thu"), loss=BernoulliLoss(share)), 5.0)
        arrivals[-1] += [channel.send(k, 0.1 * k) for k in range(50, 100)]
    kept = [(a, b) for a, b in zip(*arrivals, strict=True) if b is not None]
    assert 60 < len(kept) < 90
    assert all(a == b for a, b in kept)


def test_the_time_of_a_change_does_not_run_back():
    link = Link(LinkConditions(), np.random.default_rng(0))
    link.forward.send("a", 1.0)
    worse = LinkConditions.symmetric(Conditions(delay=ConstantDelay("c", 0.3)))
    for wrong in (0.5, math.nan):
        with pytest.raises(InvalidValueError):
            link.change(worse, wrong)
    link.change(worse, 1.0)
    assert link.conditions == worse
    assert link.backward.send("b", 1.0) == pytest.approx(1.3)


def test_a_gauge_measures_the_newest_packets():
    gauge = Gauge()
    assert gauge.measured(now=0.0).packets == 0
    for k in range(100):
        arrived = None if k % 5 == 0 else 0.1 * k + 0.001 * k
        gauge.add(PacketRecord(k, 0, 0.1 * k, arrived))
        gauge.add(PacketRecord(k, 0, 0.1 * k, 99.0, copy=True))
    found = gauge.measured(now=10.0)
    assert (found.packets, found.lost) == (100, pytest.approx(0.2))
    assert (found.median, found.p95) == (pytest.approx(0.049, abs=0.002), pytest.approx(0.094, abs=0.002))
    assert gauge.measured(now=35.0).packets == 50
    gauge.since = 9.0
    assert gauge.measured(now=10.0).packets == 10
    assert gauge.measured(now=99.0) == Gauge().measured(now=0.0)
    # What took long counts from when it came.
    late = Gauge()
    late.add(PacketRecord(0, 0, 0.0, 40.0))
    assert late.measured(now=69.0).median == 40.0


def test_losses_are_spelled_as_they_are_read():
    for text in ("0", "0.25", "burst:0.2,3"):
        assert spelled_loss(loss_model(text)) == text
    assert "0.1" in spelled_loss(GilbertElliottLoss(0.1, 0.4, 0.5))
