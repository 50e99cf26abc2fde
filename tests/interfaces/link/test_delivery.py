"""Numbered messages: each is given once and in order, acknowledged ones never go again, memory is bounded."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.link.delivery import FAILED, OVERTAKEN, Incoming, OrderBook, Outgoing
from interfaces.messages import Order, Outcome
from tests.memory import values_held
from vrs.commands import Stop

ROOM = 8
"""How far ahead the receiver keeps messages: less than the longest runs are."""


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.fixed_dictionaries(
            {
                "new": st.integers(0, 3),
                "oldest": st.booleans(),
                "most": st.integers(1, 12),
                "lateness": st.lists(st.integers(0, 9), max_size=2),
                "answer": st.integers(0, 9),
            }
        ),
        max_size=60,
    )
)
def test_whatever_the_network_does_each_message_is_given_once_and_in_order(turns):
    """A packet has a part of what waits; it gets lost, or comes once or twice; answers overtake each other, too."""
    outgoing, incoming, given_ = Outgoing(), Incoming(ROOM), []
    packets, answers = [], []
    for k, turn in enumerate(turns):
        for _ in range(turn["new"]):
            outgoing.add(f"message {outgoing.count + 1}")
        chosen = list(outgoing.waiting.items())
        chosen = chosen[: turn["most"]] if turn["oldest"] else chosen[-turn["most"] :]
        assert all(number > outgoing.acknowledged for number, _ in chosen)
        if chosen:
            run = chosen[0][0], [message for _, message in chosen]
            packets += [(k + late, run) for late in turn["lateness"]]
        for _, run in [packet for packet in packets if packet[0] == k]:
            given_ += incoming.take(*run)
        answers.append((k + turn["answer"], incoming.count))
        for _, count in [answer for answer in answers if answer[0] == k]:
            outgoing.acknowledge(count)
        assert given_ == [f"message {number}" for number in range(1, incoming.count + 1)]
        assert values_held(incoming) < 200
    while outgoing.waiting:
        before = incoming.count
        for number, message in outgoing.waiting.items():
            given_ += incoming.take(number, [message])
        outgoing.acknowledge(incoming.count)
        assert incoming.count > before or not outgoing.waiting
    assert given_ == [f"message {number}" for number in range(1, outgoing.count + 1)]


def test_what_is_acknowledged_or_taken_out_never_goes_again_and_numbers_go_on():
    outgoing = Outgoing()
    for message in "abcde":
        outgoing.add(message)
    for newest, left in ((2, "cde"), (1, "cde"), (3, "de")):
        outgoing.acknowledge(newest)
        assert "".join(outgoing.waiting.values()) == left
    outgoing.waiting.clear()
    outgoing.add("f")
    assert outgoing.waiting == {6: "f"}
    # Who says that it has more than was sent has what was sent.
    outgoing.acknowledge(2**62)
    assert (outgoing.count, outgoing.acknowledged, outgoing.waiting) == (6, 6, {})
    outgoing.add("g")
    assert outgoing.waiting == {7: "g"}


def test_memory_is_bounded_whatever_the_numbers():
    incoming = Incoming(16)
    for k in range(1000):
        assert incoming.take(2 + 2 * k, [str(k)]) == []
        assert incoming.take(2**62 + k, ["far"]) == []
        assert values_held(incoming) < 100
    assert [number for number in range(1, 40) if incoming.expects(number)] == [1, *range(3, 18, 2)]
    assert incoming.take(1, ["first"]) == ["first", "0"]
    assert not any(map(incoming.expects, (0, 1, 2, 4)))
    assert incoming.take(1, ["first", "0", "third"]) == ["third", "1"]
    repeated = Incoming(16)
    for number in range(1, 1000):
        first = max(number - 4, 1)
        assert repeated.take(first, list(range(first, number + 1))) == [number]
    assert values_held(repeated) < 50


def test_what_is_skipped_is_named_and_no_longer_given():
    incoming = Incoming(16)
    for number in (2, 3, 9):
        incoming.take(number, [number])
    assert incoming.skip_to(7) == [2, 3]
    assert incoming.count == 6
    assert incoming.take(1, [1, 2, 3]) == []
    assert incoming.take(7, [7, 8]) == [7, 8, 9]


def test_an_order_is_carried_out_once_in_its_turn_and_a_stop_overtakes():
    done, told = [], []

    def carry_out(order, now):
        done.append(order.number)
        if order.number == 2:
            raise RuntimeError
        return Outcome(order.number, now)

    book = OrderBook(carry_out, told.append)
    for number in (3, 2, 3, 1, 2, 6):
        book.take(Order(number, None), 1.0)
    assert done == [1, 2, 3]
    assert [outcome.number for outcome in told] == [1, 2, 3, 2]
    assert told[1].refusal == told[3].refusal == f"{FAILED}: RuntimeError"
    book.take(Order(8, Stop()), 2.0)
    assert done == [1, 2, 3, 8]
    book.take(Order(4, None), 3.0)
    assert [(outcome.number, outcome.refusal) for outcome in told[4:]] == [(6, OVERTAKEN), (8, ""), (4, OVERTAKEN)]
