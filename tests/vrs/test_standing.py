"""An engine that takes up another's standing answers what comes as that one does."""

from __future__ import annotations

import pytest

from tests.vrs.plans import MODEL, A, B, C, D, to
from vrs import (
    Engine,
    Insertion,
    JointTarget,
    Lateness,
    ManualClock,
    MotionCommand,
    ParameterChange,
    Profile,
    ScaleTime,
    SteerCommand,
    Stop,
)

NEXT = {
    "move": lambda: to(D, 1.4, profile=Profile.JERK_LIMITED),
    "append": lambda: to(D, insertion=Insertion.APPEND, deviation=0.05),
    "late": lambda: MotionCommand(JointTarget(D), issued_at=0.1, execute_at=0.2),
    "pace": lambda: ScaleTime(0.5),
    "stop": Stop,
    "steer": lambda: SteerCommand(rates=0.3 * MODEL.limits.qd_max),
}


def taken_up(engine: Engine, clock: ManualClock) -> Engine:
    other = Engine(MODEL, timeline=engine.timeline, clock=clock)
    other.take_up(engine.standing())
    return other


@pytest.mark.parametrize("steers", [False, True])
@pytest.mark.parametrize("name", NEXT)
def test_the_next_command_has_the_same_answer_and_makes_the_same_plan(name, steers):
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=A, clock=clock)
    engine.execute(ParameterChange("qd_max", 0.9 * MODEL.limits.qd_max))
    engine.execute(ParameterChange("lateness", Lateness.REJECT))
    engine.execute(to(B, profile=Profile.JERK_LIMITED))
    engine.execute(to(C, 2.5))
    clock.set(0.6)
    if steers:
        engine.execute(SteerCommand(rates=0.3 * MODEL.limits.qd_max))
        clock.advance(0.05)
    other = taken_up(engine, clock)
    answers = [one.execute(NEXT[name]()) for one in (engine, other)]
    assert answers[0].command_id == answers[1].command_id
    for field in ("status", "execute_at", "end", "reason", "shifted", "superseded"):
        assert getattr(answers[0], field) == getattr(answers[1], field)
    assert engine.timeline == other.timeline


def test_it_knows_by_what_the_arm_moved_last_and_nothing_older():
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=A, clock=clock)
    first, last = engine.execute(to(B, 0.0)), engine.execute(to(C, insertion=Insertion.APPEND))
    clock.set(last.end + 1.0)
    known = engine.standing().known
    assert [one.receipt.command_id for one in known] == [last.command_id]
    other = taken_up(engine, clock)
    assert other.receipt(last.command_id).end == last.end
    assert other.newest == engine.newest == last.command_id > first.command_id


def test_what_is_scheduled_can_be_edited_by_its_id():
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=A, clock=clock)
    engine.execute(to(B))
    second = engine.execute(to(C, 2.5))
    clock.set(0.6)
    other = taken_up(engine, clock)
    for one in (engine, other):
        assert one.retime(second.command_id, 4.0).execute_at == 4.0
        assert one.cancel(second.command_id).undone
    assert engine.timeline == other.timeline


def test_a_command_to_where_the_arm_stands_anyway_is_known_too():
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=A, clock=clock)
    moved = engine.execute(to(B))
    still = engine.execute(to(B, moved.end + 1.0))
    assert still.is_still
    other = taken_up(engine, clock)
    assert other.receipt(still.command_id).execute_at == still.execute_at
    assert other.stop().superseded == engine.stop().superseded
