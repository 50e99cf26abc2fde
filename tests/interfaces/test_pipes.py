"""Whole messages over a stream socket, whatever pieces it makes of them."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from interfaces.pipes import MessageSocket, framed
from vrs.errors import FormatError

MOST = 1 << 16


@pytest.fixture
def pair() -> Iterator[tuple[MessageSocket, MessageSocket]]:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        yield MessageSocket(ours, MOST), MessageSocket(theirs, MOST)


def test_messages_stay_whole_and_in_order_when_it_is_full(pair: tuple[MessageSocket, MessageSocket]) -> None:
    """What isn't taken is told; what has begun is sent to its end."""
    one, other = pair
    taken, found = [], []
    for number in range(2_000):
        message = number.to_bytes(4, "big") * (1 + number % 997)
        if one.send(message):
            taken.append(message)
        elif number % 3 == 0:
            found += other.receive()
    assert len(taken) < 2_000
    while one.send(b"") is False:
        found += other.receive()
    one.flush(1.0)
    while not found or found[-1]:
        found += other.receive()
    assert found == [*taken, b""]


@given(st.lists(st.binary(max_size=50), max_size=20), st.integers(1, 60))
def test_pieces_of_any_length_give_the_same_messages(messages: list[bytes], piece: int) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        reader, data = MessageSocket(theirs, 50), b"".join(map(framed, messages))
        found = []
        for at in range(0, len(data), piece):
            ours.send(data[at : at + piece])
            found += reader.receive()
        assert found == messages
        assert not reader.ended
        ours.close()
        assert reader.receive() == []
        assert reader.ended


def test_an_end_that_is_closed_is_told_to_readers_and_writers(pair: tuple[MessageSocket, MessageSocket]) -> None:
    one, other = pair
    assert one.send(b"last words")
    one.close()
    assert other.wait(1.0)
    assert other.receive() == [b"last words"]
    assert other.ended
    assert other.send(b"too late") is False


def test_a_message_that_is_too_long_is_refused_before_it_is_held() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.send((MOST + 1).to_bytes(4, "big"))
        with pytest.raises(FormatError, match="65537 bytes; 65536 are allowed"):
            MessageSocket(theirs, MOST).receive()
