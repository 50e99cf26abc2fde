"""Why a command isn't taken back, where it isn't."""

from __future__ import annotations

from interfaces.engine_server.site import Site
from interfaces.messages import Order, Outcome
from interfaces.messages.requests import portable
from interfaces.teleop import OperatorSite, VirtualArm
from interfaces.teleop.operator import Halt, HaltCause
from robots import puma560
from vrs import (
    Cancel,
    Insertion,
    InsertVia,
    JointTarget,
    ManualClock,
    MotionCommand,
    ParameterChange,
    Redo,
    Resume,
    Retime,
    ScaleTime,
    Status,
    Stop,
)
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


def test_what_was_taken_back_is_redone_as_it_was():
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=NOMINAL, clock=clock)
    stretch = MODEL.poses["stretch"]
    for command in (
        MotionCommand(JointTarget(READY), execute_at=20.0),
        MotionCommand(JointTarget(NOMINAL), execute_at=23.0, insertion=Insertion.APPEND),
        MotionCommand(JointTarget(stretch), execute_at=22.0, speed=0.5),
        InsertVia(3, JointTarget(0.5 * (stretch + READY)), deviation=0.05),
        Retime(3, 40.0),
        Cancel(2),
        MotionCommand(JointTarget(stretch), execute_at=45.0),
        ScaleTime(0.5, execute_at=15.0),
        Stop(execute_at=50.0),
        Resume(execute_at=90.0),
    ):
        assert engine.execute(command).status is not Status.REJECTED, command
    was, told = engine.timeline, engine.receipts
    for depth in (10, 4, 1):
        between = [(engine.undo(), engine.timeline, engine.receipts)[1:] for _ in range(depth)]
        clock.advance(0.5)
        for timeline, receipts in [*between[-2::-1], (was, told)]:
            assert engine.redo().status is not Status.REJECTED
            assert list(engine.timeline.segments) == list(timeline.segments)
            assert [repr(portable(receipt)) for receipt in engine.receipts] == [
                repr(portable(one)) for one in receipts
            ]
        assert engine.redo().reason.startswith("there's nothing to redo")
        told = engine.receipts
    # What is redone can be undone again, and so on.
    assert engine.undo() is not None
    assert engine.redo().status is not Status.REJECTED


def test_what_was_commanded_meanwhile_or_has_passed_isnt_redone():
    hand = Hand()
    hand.order(MotionCommand(JointTarget(READY), execute_at=5.0), 1.0)
    before = hand.operator.robot.engine.timeline
    assert hand.order(None, 2.0).receipt.undone
    assert hand.order(MotionCommand(JointTarget(NOMINAL), execute_at=9.0), 2.5).receipt.status is Status.ACCEPTED
    outcome = hand.order(Redo(), 3.0)
    assert outcome.receipt.reason.startswith("there's nothing to redo")
    hand.order(None, 3.5)
    # The newest undo is of the second move: the first isn't to be had any more.
    assert hand.order(Redo(), 3.6).receipt.command_id == 2
    assert hand.order(Redo(), 3.7).receipt.status is Status.REJECTED
    hand.order(None, 3.8)
    outcome = hand.order(Redo(), 9.5)
    assert outcome.receipt.reason == "command 2 can't be redone: its time, 9 s, has passed"
    assert hand.operator.robot.engine.timeline.end == before.start


def test_a_client_is_told_that_its_undone_command_stands_again():
    hand = Hand()
    hand.order(MotionCommand(JointTarget(READY), execute_at=30.0), 1.0)
    hand.order(None, 2.0)
    hand.number += 1
    hand.servlet.receive(Order(hand.number, Redo(), 1), now=3.0)
    told = [reply for reply in hand.servlet.advance(now=3.0) if isinstance(reply, Outcome)]
    assert [outcome.receipt.undone for outcome in told if outcome.number == 1][-1:] == [False]


def test_limits_that_were_changed_since_bring_nothing_back():
    engine = Engine(MODEL, q=NOMINAL, clock=ManualClock(0.0))
    engine.execute(MotionCommand(JointTarget(READY), execute_at=5.0))
    engine.undo()
    engine.execute(ParameterChange("qd_max", (0.5 * MODEL.limits.qd_max).tolist()))
    assert engine.redo().status is Status.REJECTED
