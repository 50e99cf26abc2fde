"""The hand: how far it opens, when, and what it holds."""

from __future__ import annotations

from interfaces.val2.motion.hand import OPEN, Hand


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
    hand.wanted, hand.relax = None, True
    hand.ask(1, None)
    assert hand.waits
    hand.begin(lambda _: 5.0, 4.0)
    assert told == [(0.05, True)]
    hand.begin(lambda _: 5.0, 5.0)
    assert told == [(0.05, True), (5.0, False)]
    assert hand.opening(9.0) == 0.0
    assert not hand.waits
