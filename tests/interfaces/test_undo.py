"""Why a command isn't taken back, where it isn't."""

from __future__ import annotations

from interfaces.engine_server.site import Site
from interfaces.messages import Order
from interfaces.teleop import OperatorSite, VirtualArm
from interfaces.teleop.operator import Halt, HaltCause
from robots import puma560
from vrs import JointTarget, MotionCommand
from vrs.commands import Cancel
from vrs.engine import Engine

MODEL = puma560.model()
NOMINAL, READY = MODEL.poses["nominal"], MODEL.poses["ready"]


class Hand:
    """A client of an operator's site."""

    def __init__(self) -> None:
        self.operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
        self.servlet = Site(self.operator.robot.engine).servlet()
        self.number = 0

    def order(self, command, now):
        self.operator.robot.clock.set(now)
        self.number += 1
        self.servlet.receive(Order(self.number, command, 1), now=now)
        return self.servlet.advance(now=now)[-1]


def test_a_deleted_move_comes_back_however_long_ago():
    hand = Hand()
    hand.order(MotionCommand(JointTarget(READY), execute_at=30.0), 1.0)
    hand.order(Cancel(1), 5.0)
    assert hand.operator.robot.engine.timeline.end < 30.5
    outcome = hand.order(None, 20.0)
    assert (outcome.refusal, outcome.receipt.undone) == ("", False)
    assert hand.operator.robot.engine.timeline.end > 30.5


def test_after_a_correction_it_says_why_nothing_is_taken_back():
    hand = Hand()
    hand.order(MotionCommand(JointTarget(READY), execute_at=30.0), 1.0)
    truth = Engine(MODEL, timeline=hand.operator.robot.engine.timeline, clock=hand.operator.robot.clock)
    hand.order(Cancel(1), 5.0)
    # The robot heard of the deletion too late, and goes.
    hand.operator.robot.clock.set(6.0)
    hand.operator.robot.engine.anchor(truth.timeline)
    outcome = hand.order(None, 7.0)
    assert outcome.receipt is None
    assert outcome.refusal.startswith("the plan was put right at 6 s")
    assert hand.order(Cancel(1), 8.0).refusal == ""
    assert hand.order(None, 9.0).receipt is not None, "what came after it can be taken back"


def test_what_is_over_or_was_never_there_is_told_apart():
    hand = Hand()
    outcome = hand.order(None, 0.5)
    assert (outcome.receipt, outcome.refusal) == (None, "")
    end = hand.order(MotionCommand(JointTarget(READY)), 1.0).receipt.end
    assert "is over" in hand.order(None, end + 1.0).refusal
    hand.order(MotionCommand(JointTarget(NOMINAL)), end + 1.0)
    assert hand.order(None, end + 1.2).receipt is not None
    assert "was under way when it was taken back" in hand.order(None, end + 1.3).refusal


def test_a_robot_that_does_not_follow_is_named():
    hand = Hand()
    hand.order(MotionCommand(JointTarget(READY), execute_at=30.0), 1.0)
    hand.operator.halted = Halt(HaltCause.REPORTED, "the link was lost")
    assert "the link was lost" in hand.order(None, 2.0).refusal
