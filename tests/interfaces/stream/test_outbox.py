"""What waits for one client: bounded, in order, nothing twice."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from interfaces.stream.codec import Encoding
from interfaces.stream.limits import BATCH, Outbox


@dataclass(frozen=True)
class Letter:
    """A message of so many bytes."""

    size: int
    mark: int = 0


class Card(Letter):
    """One of which only the newest counts."""


class Poster(Letter):
    """Another one."""


def written(message: Any, encoding: Encoding) -> bytes:
    return bytes([message.mark]) * message.size


def outbox(limit: int) -> Any:
    return Outbox(written, Encoding.MSGPACK, limit)


@given(st.lists(st.tuples(st.integers(1, 40), st.booleans()), max_size=60), st.integers(1, 60))
def test_what_finds_room_is_sent_once_in_order_and_the_rest_is_counted(
    steps: list[tuple[int, bool]], limit: int
) -> None:
    box, kept, sent, dropped = outbox(limit), [], [], 0
    for mark, (size, take) in enumerate(steps):
        waiting = sum(map(len, kept))
        roomy = not kept or waiting + size <= limit
        assert box.is_full == (waiting >= limit)
        assert box.put(Letter(size, mark)) == roomy
        if roomy:
            kept.append(bytes([mark]) * size)
        dropped += not roomy
        assert (box.waiting, box.dropped, bool(box)) == (sum(map(len, kept)), dropped, bool(kept))
        if take:
            assert list(box.take()) == kept
            sent += kept
            kept = []
    assert len(sent) + len(kept) + dropped == len(steps)


def test_some_16_kib_are_taken_at_once() -> None:
    box = outbox(10 * BATCH)
    for mark in range(5):
        box.put(Letter(BATCH // 2, mark))
    assert [data[0] for data in box.take()] == [0, 1]
    assert box.waiting == 3 * (BATCH // 2)
    assert [data[0] for data in itertools.chain(box.take(), box.take())] == [2, 3, 4]
    assert box.take() == ()


def test_of_each_kind_the_newest_goes_behind_all_that_waits() -> None:
    box = outbox(10 * BATCH)
    box.put_newest(Card(1, 1))
    for mark in range(2, 5):
        box.put(Letter(BATCH, mark))
    box.put_newest(Poster(1, 5))
    box.put_newest(Card(1, 6))
    assert [[data[0] for data in box.take()] for _ in range(4)] == [[2], [3], [4, 6, 5], []]
    assert not box
