"""Messages repeated in each packet: given once, in order or as they come, in bounded memory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.link import (
    Bundle,
    Channel,
    Conditions,
    Repeater,
    RepeatReceiver,
    Service,
    delay_profile,
    loss_model,
)
from tests.memory import values_held
from vrs.errors import InvalidValueError


def bundles(repeat, count):
    repeater = Repeater(repeat)
    return [repeater.send(i) for i in range(count)]


def feed(receiver, packets):
    """Give packets at times of their own, and every deadline in between; all messages that come out."""
    out = []
    for t, packet in packets:
        while (deadline := receiver.next_deadline()) is not None and deadline <= t:
            out += receiver.advance(now=deadline)
        out += receiver.receive(packet, now=t)
    while (deadline := receiver.next_deadline()) is not None:
        out += receiver.advance(now=deadline)
    return out


def test_a_packet_carries_the_last_messages():
    assert bundles(3, 5)[0] == Bundle(0, (0,))
    assert bundles(3, 5)[4] == Bundle(2, (2, 3, 4))
    repeater = Repeater(2)
    assert repeater.again() is None
    repeater.send("a")
    assert repeater.send("b") == repeater.again() == Bundle(0, ("a", "b"))


@settings(max_examples=200, deadline=None)
@given(
    st.integers(1, 5),
    st.lists(st.tuples(st.integers(0, 30), st.floats(0, 3)), max_size=60),
    st.sampled_from(list(Service)),
    st.sampled_from((0.0, 0.5, 3.0)),
    st.sampled_from((1, 3, 1024)),
)
def test_any_packets_in_any_order_give_each_message_at_most_once(repeat, arrivals, service, patience, window):
    sent = bundles(repeat, 31)
    packets = sorted((t, i) for i, t in arrivals)
    receiver = RepeatReceiver(service, patience=patience, window=window)
    out = feed(receiver, [(t, sent[i]) for t, i in packets])
    assert len(out) == len(set(out))
    came = {message for _, i in packets for message in sent[i].messages}
    assert set(out) <= came
    if service is Service.IN_ORDER:
        assert out == sorted(out)
    if service is Service.DATAGRAM and window == 1024:
        assert set(out) == came
    total = sum(len(sent[i].messages) for _, i in packets)
    assert receiver.repeated == total - len(out)
    if service is Service.IN_ORDER and out:
        assert receiver.missed == max(out) + 1 - len(out)


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 6), st.lists(st.booleans(), min_size=1, max_size=80), st.sampled_from(list(Service)))
def test_losses_shorter_than_the_repeats_lose_nothing(repeat, lost, service):
    """Of packets that come in order, only runs of `repeat` lost ones or more lose a message."""
    sent = bundles(repeat, len(lost))
    packets = [(0.01 * i, packet) for i, packet in enumerate(sent) if not lost[i]]
    out = feed(RepeatReceiver(service), packets)
    expected = {i for i in range(len(lost)) if not all(lost[i : i + repeat])}
    assert out == sorted(expected)


def test_in_order_waits_for_the_missing_and_no_longer():
    receiver = RepeatReceiver(Service.IN_ORDER, patience=0.5)
    assert receiver.receive(Bundle(0, ("a",)), now=0.0) == ("a",)
    assert receiver.receive(Bundle(2, ("c",)), now=1.0) == ()
    assert receiver.next_deadline() == 1.5
    assert receiver.receive(Bundle(1, ("b",)), now=1.2) == ("b", "c")
    assert receiver.next_deadline() is None
    assert receiver.receive(Bundle(4, ("e",)), now=2.0) == ()
    assert receiver.advance(now=2.499) == ()
    assert receiver.advance(now=2.5) == ("e",)
    assert receiver.receive(Bundle(3, ("d",)), now=2.6) == ()
    assert (receiver.missed, receiver.repeated) == (1, 1)


@pytest.mark.parametrize("service", list(Service))
def test_memory_is_bounded_whatever_the_numbers(service):
    receiver = RepeatReceiver(service, patience=3600.0, window=16)
    given_ = 0
    for i in range(1000):
        given_ += len(receiver.receive(Bundle(2 * i, (i,)), now=0.0))
        assert values_held(receiver) < 100
    given_ += len(receiver.receive(Bundle(2**62, ("far",)), now=0.0))
    assert values_held(receiver) < 100
    assert given_ >= 1000
    assert receiver.missed >= 2**62 - 2000


def test_without_order_nothing_waits():
    receiver = RepeatReceiver(Service.DATAGRAM)
    assert receiver.receive(Bundle(3, ("d",)), now=0.0) == ("d",)
    assert receiver.receive(Bundle(2, ("c", "d", "e")), now=0.0) == ("c", "e")
    assert receiver.next_deadline() is None


def test_over_a_lossy_link_repeats_pay():
    """Bernoulli loss p and k repeats lose a message with probability p^k."""
    lost = []
    for repeat in (1, 3):
        channel = Channel(
            Conditions(delay=delay_profile("constant:0.1"), loss=loss_model("0.3")), np.random.default_rng(3)
        )
        repeater, receiver = Repeater(repeat), RepeatReceiver(Service.IN_ORDER, patience=0.5)
        for i in range(5000):
            channel.send(repeater.send(i), 0.02 * i)
        out = feed(receiver, [(item.arrived, item.payload) for item in channel.receive(1e9)])
        lost.append(1 - len(out) / 5000)
    assert lost[0] == pytest.approx(0.3, abs=5 * math.sqrt(0.21 / 5000))
    assert lost[1] == pytest.approx(0.027, abs=5 * math.sqrt(0.0263 * 2 / 5000))


def test_misuse_is_refused():
    for make in (
        lambda: Repeater(0),
        lambda: RepeatReceiver(window=0),
        lambda: RepeatReceiver(patience=math.nan),
        lambda: Bundle(-1, (1,)),
        lambda: Bundle(0, ()),
        lambda: Bundle(0, [1]),
        lambda: Bundle(0, (1,) * 1025),
    ):
        with pytest.raises(InvalidValueError):
            make()
    receiver = RepeatReceiver()
    receiver.receive(Bundle(0, (1,)), now=1.0)
    with pytest.raises(InvalidValueError):
        receiver.advance(now=0.5)
