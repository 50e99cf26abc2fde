"""A hand that steers is told what is in its way, and what leads away from it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from robots import puma560
from vrs import Engine, SteerCommand
from vrs.clock import ManualClock

MODEL = puma560.model()


class Hand:
    """Steers an arm from a named pose."""

    def __init__(self, pose: str) -> None:
        self.clock = ManualClock(0.0)
        self.engine = Engine(MODEL, q=MODEL.poses[pose], clock=self.clock)

    def push(self, seconds: float, **asked) -> str:
        """Ask for so long for the same; what is in the way then."""
        begin, receipt = self.clock.now(), None
        while self.clock.now() < begin + seconds:
            self.clock.set(self.clock.now() + 0.04)
            receipt = self.engine.execute(SteerCommand(**asked, issued_at=self.clock.now()))
        assert receipt is not None
        return receipt.hindrance

    @property
    def q(self):
        return self.engine.timeline.sample(self.clock.now())

    def nearness(self) -> float:
        J = np.array(MODEL.jacobian(self.q))
        J[:3] /= MODEL.characteristic_length
        S = np.linalg.svd(J, compute_uv=False)
        return float(S[-1] / S[0])


@pytest.mark.parametrize(
    ("pose", "twist"),
    [
        ("nominal", [0, 0, 0.1, 0, 0, 0]),
        ("nominal", [0.1, 0, 0, 0, 0, 0]),
        ("nominal", [0, 0, 0, 0, 0.5, 0]),
        ("ready", [0, 0, 0.1, 0, 0, 0]),
    ],
)
def test_a_hand_is_told_of_a_singularity_and_of_a_way_out_that_leads_out(pose, twist):
    hand = Hand(pose)
    told = hand.push(9.0, twist=np.array(twist, float))
    assert np.abs(hand.engine.timeline.sample(hand.clock.now(), derivative=1)).max() < 1e-3, "it stopped"
    found = re.fullmatch(r"near a singularity: jog joint ([1-6])( up| down)?, or move back", told)
    assert found is not None, told
    before = hand.nearness()
    rates = np.zeros(6)
    rates[int(found[1]) - 1] = -0.3 if found[2] == " down" else 0.3
    assert hand.push(1.0, rates=rates) == ""
    # Beside READY there are two singularities at once; no joint leads out of both.
    assert hand.nearness() > (1.0 if pose == "ready" else 2.0) * before
    assert hand.push(0.3, twist=np.zeros(6)) == "", "who lets go needs no word"


def test_a_hand_is_told_of_a_joints_limit_and_which_way_is_back():
    limits = MODEL.limits
    for joint in range(6):
        for sign, which, back in ((1.0, "upper", "down"), (-1.0, "lower", "up")):
            hand = Hand("nominal")
            assert hand.push(0.2, rates=sign * 0.3 * np.eye(6)[joint]) == "" or joint == 2
            told = hand.push(12.0, rates=sign * limits.qd_max * np.eye(6)[joint])
            assert told.startswith(f"joint {joint + 1} is at its {which} limit, ")
            assert f"jog it {back}" in told
            assert hand.push(1.0, rates=-sign * 0.3 * np.eye(6)[joint]) == ""
