"""The hand: how far it opens, when, and what it holds."""

from __future__ import annotations

from interfaces.val2.motion.hand import OPEN, REMEMBERED, Hand


def test_openings_are_bounded_and_only_a_closed_hand_holds() -> None:
    told: list[tuple[float, bool]] = []
    hand = Hand({"HAND.TIME": 0.5}, lambda t, holds: told.append((t, holds)))
    for number, (asked, opening) in enumerate(((30.0, 30.0), (500.0, OPEN), (10.0, 10.0), (-5.0, 0.0), (1.0, 1.0))):
        hand.ask(number, asked)
        assert hand.goal == opening
        hand.begin(lambda n: 10.0 * n, 10.0 * number)
        assert hand.opening(10.0 * number + 0.5) == opening
    assert told == [(30.5, True), (40.0, False)]


def test_a_hand_that_relaxes_with_a_motion_lets_go_where_it_is() -> None:
    told: list[tuple[float, bool]] = []
    hand = Hand({}, lambda t, holds: told.append((t, holds)))
    hand.actuate(False, 0.0)
    hand.ask(1, None)
    assert hand.waits
    hand.begin(lambda _: 5.0, 4.0)
    assert told == [(0.05, True)]
    hand.begin(lambda _: 5.0, 5.0)
    assert told == [(0.05, True), (5.0, False)]
    assert hand.opening(9.0) == 0.0
    assert not hand.waits


def test_a_hand_moves_now_to_an_opening() -> None:
    hand = Hand({"HAND.TIME": 1.0}, None)
    hand.actuate(40.0, 0.0)
    assert [hand.opening(t) for t in (0.0, 0.5, 1.0)] == [100.0, 70.0, 40.0]


def test_what_the_hand_did_can_be_looked_back_at() -> None:
    hand = Hand({"HAND.TIME": 1.0}, None)
    for t, does in ((1.0, False), (1.5, True), (4.0, None), (5.0, False)):
        hand.actuate(does, t)
    times = (-9.0, 0.0, 1.0, 1.25, 1.5, 2.0, 2.5, 4.0, 4.9, 5.5, 6.0, 99.0)
    opened = [hand.opening(t) for t in times]
    assert opened == [100.0, 100.0, 100.0, 75.0, 50.0, 75.0, 100.0, 100.0, 100.0, 50.0, 0.0, 0.0]


def test_what_the_hand_is_to_do_with_motions_to_come_can_be_looked_ahead_at() -> None:
    hand = Hand({"HAND.TIME": 1.0}, None)
    hand.ask(1, False)
    hand.ask(2, True)
    begins = {1: 10.0, 2: None}.get
    assert [hand.opening(t, begins) for t in (9.0, 10.25, 30.0)] == [100.0, 75.0, 0.0]
    assert hand.opening(30.0) == 100.0


def test_what_is_remembered_of_the_hand_is_bounded() -> None:
    hand = Hand({}, None)
    for k in range(REMEMBERED + 50):
        hand.actuate(bool(k % 2), float(k))
    assert hand.opening(float(REMEMBERED)) == 100.0
    assert hand.opening(REMEMBERED + 0.9) == 0.0
    assert hand.opening(0.0) in (0.0, 100.0)
