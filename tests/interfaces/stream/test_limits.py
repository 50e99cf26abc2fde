"""How much a client may send."""

from __future__ import annotations

from interfaces.stream.limits import Bucket


def test_as_many_may_be_sent_at_once_as_there_are_tokens_and_then_as_they_come() -> None:
    bucket = Bucket(2.0, 3.0, 10.0)
    assert [bucket.take(10.0) for _ in range(4)] == [True, True, True, False]
    assert [bucket.take(t) for t in (10.25, 10.5, 10.5, 10.75, 11.0)] == [False, True, False, False, True]
    assert [bucket.take(1e6) for _ in range(4)] == [True, True, True, False]
    assert not bucket.take(0.0)
