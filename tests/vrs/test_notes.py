"""Notes: what receipts say for people, as values that code decides by."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from robots import ipr
from tests.vrs.plans import MODEL, A, B, C, D, plan, to
from vrs import Engine, Insertion, JointTarget, ManualClock, MotionCommand, Profile, SteerCommand, Stop
from vrs.ledger import Receipt, Status
from vrs.notes import ROUGH, NoteCode, text_of

LOW = np.array([-2.0, 0.0, -2.0, 0.0, 0.0, 0.0])
HIGH = np.array([MODEL.limits.q_max[0], 0.0, -2.0, 0.0, 0.0, 0.0])


def codes(engine: Engine, receipt: Receipt) -> list[NoteCode]:
    """What a receipt says, as codes; its reason is what they say."""
    notes = engine.notes(receipt.command_id)
    assert engine.receipt(receipt.command_id).reason == text_of(notes)
    return [note.code for note in notes]


@pytest.mark.parametrize("code", NoteCode)
def test_what_is_rough_says_so(code: NoteCode) -> None:
    assert (code in ROUGH) == ("parabolas" in code.value or code is NoteCode.ACCELERATIONS_DROPPED)


def test_receipts_say_what_their_notes_are() -> None:
    clock = ManualClock(0.0)
    engine = plan(clock)
    first, second, third = engine.receipts
    assert [codes(engine, r) for r in engine.receipts] == [[], [], []]
    assert codes(engine, engine.retime(second.command_id, 3.2)) == [NoteCode.RETIMED]
    assert codes(engine, engine.cancel(second.command_id)) == [NoteCode.CANCELLED]
    assert codes(engine, engine.receipt(third.command_id)) == [NoteCode.REPLANNED]
    undone = engine.undo()
    assert undone is not None
    assert codes(engine, undone) == [NoteCode.RETIMED]
    assert codes(engine, third) == []
    clock.set(1.0)
    assert codes(engine, engine.scale_time(0.5)) == [NoteCode.AT_A_PACE]
    assert codes(engine, engine.stop()) == [NoteCode.STOPPED_ON_WAY]
    clock.set(engine.timeline.end)
    assert codes(engine, engine.resume()) == [NoteCode.RESUMED]
    assert codes(engine, first) == [NoteCode.GOES_ON]
    late = engine.execute(to(C, 0.1))
    assert late.status is Status.POSTPONED
    assert codes(engine, late) == [NoteCode.LATE_POSTPONED]
    clock.advance(0.2)
    newest = engine.execute(to(D))
    clock.advance(0.2)
    assert engine.undo() is not None
    assert codes(engine, newest) == [NoteCode.UNDONE_FROM]


def test_a_mobile_robot_says_what_it_did() -> None:
    engine = Engine(ipr.model())
    assert codes(engine, engine.stop()) == [NoteCode.STOOD]


def rough() -> tuple[Engine, ManualClock, Receipt]:
    """An arm that brakes with parabolas first, which only what it says tells."""
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=LOW, clock=clock)
    engine.execute(to(HIGH, 0.0))
    t = engine.timeline.segments[-1].start - 1e-3
    move = engine.execute(to(LOW, t, profile=Profile.JERK_LIMITED))
    clock.set(t + 0.02)
    return engine, clock, move


def test_an_engine_that_takes_up_a_rough_move_knows_that_it_is() -> None:
    engine, clock, move = rough()
    assert codes(engine, move) == [NoteCode.BRAKED_FIRST]
    other = Engine(MODEL, timeline=engine.timeline, clock=clock)
    other.take_up(engine.standing())
    assert other.notes(move.command_id) == engine.notes(move.command_id)
    answers = [one.execute(Stop()) for one in (engine, other)]
    assert codes(engine, answers[0])[0] is NoteCode.EACH_JOINT_BRAKED
    assert answers[0].reason == answers[1].reason
    assert engine.timeline == other.timeline


def test_what_is_rejected_or_unknown_has_no_notes() -> None:
    engine = Engine(MODEL, q=A, clock=ManualClock(1.0))
    old = engine.execute(SteerCommand(rates=np.zeros(6), issued_at=0.0))
    assert old.status is Status.REJECTED
    assert engine.notes(old.command_id) == engine.notes(99) == ()
    assert engine.execute(to(B)).reason == ""


def test_without_ruckig_a_move_from_motion_brakes_first_within_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some machines have no wheel of it."""
    monkeypatch.setitem(sys.modules, "ruckig", None)
    for profile in Profile:
        engine = Engine(MODEL, q=MODEL.poses["nominal"])
        for t, share in ((0.0, 0.3), (0.6, -0.2)):
            q = MODEL.poses["nominal"] + share
            r = engine.execute(
                MotionCommand(JointTarget(q), execute_at=t, profile=profile, insertion=Insertion.REPLACE)
            )
            assert r.status is Status.ACCEPTED
        times = np.linspace(0.0, engine.timeline.end, 2000)
        assert np.abs(engine.timeline.sample(times, derivative=1) / MODEL.limits.qd_max).max() <= 1 + 1e-9
        assert np.abs(engine.timeline.sample(times, derivative=2) / MODEL.limits.qdd_max).max() <= 1 + 1e-9
        np.testing.assert_allclose(engine.timeline.final(), q, atol=1e-12)
