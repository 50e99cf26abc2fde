"""When commands and edits act, what an undo at that very moment does, and how old an input may be."""

from __future__ import annotations

import numpy as np
import pytest

from robots import ipr
from tests.vrs.plans import MODEL, A, B, C, to
from vrs import (
    DriveCommand,
    Engine,
    JointTarget,
    Lateness,
    ManualClock,
    MotionCommand,
    Profile,
    Status,
    SteerCommand,
    Stop,
)


def live(now: float = 1.0, **options: Lateness) -> tuple[Engine, ManualClock]:
    clock = ManualClock(now)
    return Engine(MODEL, q=A, clock=clock, **options), clock


def test_what_begins_just_now_is_taken_back_whole():
    engine, _ = live()
    engine.execute(to(B, 3.0))
    before = engine.timeline
    engine.execute(to(C))
    assert engine.undo().reason == "undone"
    assert engine.timeline == before


@pytest.mark.parametrize("issued", [1.0, 1.5])
def test_without_a_time_a_command_begins_when_it_was_issued_and_not_before_now(issued):
    """A stamp of a clock that runs ahead is a time to come, and nothing that's refused."""
    arm, _ = live()
    answer = arm.execute(MotionCommand(JointTarget(B), issued_at=issued))
    assert (answer.status, answer.execute_at, answer.issued_at) == (Status.ACCEPTED, issued, issued)
    wheels = Engine(ipr.model(), posture=(0.0, 0.0, 0.0), clock=ManualClock(1.0))
    answer = wheels.execute(DriveCommand(0.1, 0.0, 1.0, issued_at=issued))
    assert (answer.status, answer.execute_at, answer.issued_at) == (Status.ACCEPTED, issued, issued)


@pytest.mark.parametrize("lateness", Lateness)
def test_a_late_stop_stops_whatever_the_policy(lateness):
    engine, clock = live(lateness=lateness)
    engine.execute(to(B))
    clock.advance(0.4)
    answer = engine.execute(Stop(issued_at=1.1, execute_at=1.2))
    assert (answer.status, answer.execute_at) == (Status.POSTPONED, clock.now())


def test_an_input_of_a_hand_moves_for_so_long_less_as_it_is_old():
    ends = []
    for age in (0.0, 0.1):
        engine, _ = live()
        answer = engine.execute(SteerCommand(rates=0.02 * MODEL.limits.qd_max, issued_at=1.0 - age))
        ends.append(answer.end)
    assert ends[0] - ends[1] == pytest.approx(0.1, abs=1e-9)
    old = live()[0].execute(SteerCommand(rates=0.02 * MODEL.limits.qd_max, issued_at=0.79))
    assert old.status is Status.REJECTED


def test_all_receipts_are_those_of_each_where_an_edit_meets_an_arrival():
    engine, clock = live()
    moved = engine.execute(to(B, profile=Profile.JERK_LIMITED))
    still = engine.execute(to(B, moved.end))
    assert still.is_still
    clock.set(moved.end)
    engine.stop()
    for receipt in engine.receipts:
        alone = engine.receipt(receipt.command_id)
        assert (receipt.stands, receipt.superseded_by, receipt.end) == (
            alone.stands, alone.superseded_by, alone.end,
        )  # fmt: skip
    assert np.abs(engine.joints() - B).max() < 1e-9


def test_what_comes_before_the_start_leaves_the_first_move_where_it_is():
    engine = Engine(MODEL, q=A)
    first = engine.execute(to(B, 0.0))
    before = [s.coefficients.tolist() for s in engine.timeline.segments]
    engine.execute(to(C, -9.0))
    assert [s.coefficients.tolist() for s in engine.timeline.segments][-len(before) :] == before
    assert engine.receipt(first.command_id).stands
    assert engine.receipt(first.command_id).execute_at == pytest.approx(0.0, abs=1e-9)
    assert np.abs(engine.joints(first.end) - B).max() < 1e-9
