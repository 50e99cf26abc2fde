"""Who gives way when too many connections haven't shown who they are, and whose deadline has passed."""

from __future__ import annotations

import pytest

from interfaces.stream.limits import Strangers
from vrs.errors import InvalidValueError


def test_the_oldest_gives_way_and_who_is_known_never_does() -> None:
    strangers: Strangers[str] = Strangers(3)
    assert [strangers.add(name, "here", until=9.0) for name in "abc"] == [None] * 3
    strangers.know("a")
    assert strangers.add("d", "here", until=9.0) is None
    assert strangers.add("e", "here", until=9.0) == "b"
    strangers.renew("c", until=9.0)
    assert strangers.add("f", "here", until=9.0) == "d"
    assert (len(strangers), strangers.gave_way) == (3, 2)


def test_an_address_that_takes_all_the_room_gives_way_to_the_others() -> None:
    strangers: Strangers[tuple[str, int]] = Strangers(100)
    strangers.add(("quiet", 0), "quiet", until=9.0)
    for k in range(500):
        gone = strangers.add(("loud", k), "loud", until=9.0)
        assert gone is None or gone[0] == "loud"
    for k in range(1, 40):
        gone = strangers.add(("quiet", k), "quiet", until=9.0)
        assert gone is not None
        assert gone[0] == "loud"
    assert len(strangers) == 100


def test_deadlines() -> None:
    strangers: Strangers[str] = Strangers(10)
    strangers.add("a", "here", until=1.0)
    strangers.add("b", "here", until=2.0)
    assert list(strangers) == ["a", "b"]
    assert strangers.overdue(0.9) == []
    strangers.expect("a", until=3.0)
    assert strangers.overdue(2.0) == ["b"]
    strangers.know("b")
    assert strangers.overdue(2.5) == []
    strangers.expect("b", until=2.2)
    assert strangers.overdue(2.5) == ["b"]
    for name in "ab":
        strangers.discard(name)
    strangers.expect("b", until=0.0)
    assert (len(strangers), strangers.overdue(9.0)) == (0, [])


def test_how_many_there_may_be() -> None:
    with pytest.raises(InvalidValueError):
        Strangers(0)
