"""Edits of the plan: retime, cancel, vias; and the forms of all edits."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.vrs.plans import MODEL, PROFILES, A, B, C, D, check, plan, to
from vrs import (
    Cancel,
    Engine,
    Insertion,
    InsertVia,
    JointTarget,
    Lateness,
    ManualClock,
    MotionCommand,
    PoseTarget,
    Profile,
    Resume,
    Retime,
    ScaleTime,
    Status,
    SteerCommand,
    Stop,
)
from vrs.errors import InvalidValueError, UnknownCommandError


class TestRetime:
    @pytest.mark.parametrize("profile", PROFILES)
    @pytest.mark.parametrize("t", [1.5, 2.0, 3.2])
    def test_within_its_room_a_move_takes_the_slack_and_pushes_what_follows(self, profile, t):
        engine = plan(profile=profile)
        follower = engine.receipt(3)
        r = engine.retime(2, t)
        assert (r.status, r.command_id, r.execute_at) == (Status.ACCEPTED, 2, t)
        late = max(r.end - follower.execute_at, 0.0)
        assert engine.receipt(3).execute_at == pytest.approx(follower.execute_at + late, abs=1e-12)
        assert r.shifted == ((3,) if late > 0 else ())
        assert r.shift == pytest.approx(late)
        check(engine, smooth=profile is Profile.JERK_LIMITED)

    def test_what_follows_stays_bit_identical(self):
        engine = plan()
        old = [s.coefficients for s in engine.timeline.segments if s.command_id == 3]
        engine.retime(2, 4.0)
        new = [s.coefficients for s in engine.timeline.segments if s.command_id == 3]
        assert all(np.array_equal(a, b) for a, b in zip(old, new, strict=True))

    def test_past_another_move_both_are_planned_anew(self):
        engine = plan()
        before = engine.timeline
        r = engine.retime(2, 9.0)
        assert r.execute_at == 9.0
        assert "cancelled" in engine.receipt(3).reason
        assert np.abs(engine.joints(engine.receipt(3).end) - D).max() < 1e-9
        assert np.abs(engine.joints(engine.timeline.end) - C).max() < 1e-9
        check(engine)
        engine.undo()
        assert engine.timeline == before
        assert engine.receipt(3).reason == ""
        assert engine.receipt(2).execute_at == 3.0

    def test_into_a_move_before_it_interrupts_that(self):
        engine = plan()
        r = engine.retime(3, 0.8)
        assert r.execute_at == 0.8
        assert engine.receipt(1).superseded_by == 3
        assert np.abs(engine.joints(engine.timeline.end) - C).max() < 1e-9
        check(engine)

    def test_what_has_begun_is_refused_and_nothing_changes(self):
        clock = ManualClock()
        engine = plan(clock)
        clock.advance(0.7)
        before, receipts = engine.timeline, engine.receipts
        r = engine.retime(1, 2.0)
        assert r.status is Status.REJECTED
        assert "began" in r.reason
        assert engine.timeline is before
        assert engine.receipts == receipts

    def test_late_stamps_follow_the_policy(self):
        clock = ManualClock()
        engine = plan(clock)
        clock.advance(2.0)
        r = engine.retime(2, 1.9, issued_at=1.0)
        assert (r.status, r.execute_at) == (Status.POSTPONED, 2.0)
        strict = plan(ManualClock(2.0), lateness=Lateness.REJECT)
        assert strict.retime(2, 1.9, issued_at=1.0).status is Status.REJECTED


class TestCancel:
    @pytest.mark.parametrize("profile", PROFILES)
    def test_the_next_move_goes_from_where_the_arm_stands(self, profile):
        engine = plan(profile=profile)
        follower = engine.receipt(3)
        r = engine.cancel(2)
        assert r.undone
        assert not engine.receipt(2).stands
        assert engine.receipt(3).execute_at == follower.execute_at
        t = np.linspace(engine.receipt(1).end, follower.execute_at, 50)
        assert np.abs(engine.joints(t) - B).max() < 1e-9
        assert 2 not in [s.command_id for s in engine.timeline.segments]
        check(engine, smooth=profile is Profile.JERK_LIMITED)

    def test_the_last_one_leaves_a_rest(self):
        engine = plan()
        engine.cancel(3)
        assert np.abs(engine.joints(engine.timeline.end) - C).max() < 1e-9
        check(engine)

    @pytest.mark.parametrize("profile", PROFILES)
    def test_under_way_it_brakes_from_now_and_keeps_the_past(self, profile):
        clock = ManualClock()
        engine = plan(clock, profile)
        clock.advance(0.9)
        t = np.linspace(0, 0.89, 90)
        past = engine.joints(t)
        r = engine.cancel(1)
        assert "0.9" in r.reason
        assert np.array_equal(engine.joints(t), past)
        assert not engine.timeline.sample(1.6, derivative=1).any()
        assert np.abs(engine.joints(engine.receipt(2).end) - C).max() < 1e-9
        check(engine, smooth=profile is Profile.JERK_LIMITED)

    def test_what_is_gone_can_not_be_cancelled(self):
        engine = plan()
        engine.cancel(2)
        assert "taken back" in engine.cancel(2).reason
        with pytest.raises(UnknownCommandError):
            engine.cancel(77)
        clock = ManualClock()
        late = plan(clock)
        clock.advance(2.0)
        assert "over" in late.cancel(1).reason

    def test_undo_brings_it_back(self):
        engine = plan()
        before, receipts = engine.timeline, engine.receipts
        engine.cancel(2)
        engine.undo()
        assert engine.timeline == before
        assert engine.receipts == receipts


class TestVias:
    @pytest.mark.parametrize("profile", PROFILES)
    def test_a_move_stops_at_a_via(self, profile):
        engine = plan(profile=profile)
        r = engine.insert_via(2, JointTarget(A))
        q = engine.joints(np.linspace(r.execute_at, r.end, 20001))
        i = int(np.argmin(np.abs(q - A).max(1)))
        assert np.abs(q[i] - A).max() < 1e-4
        assert np.abs(engine.joints(r.end) - C).max() < 1e-9
        assert engine.receipt(3).execute_at >= r.end - 1e-9
        check(engine, smooth=profile is Profile.JERK_LIMITED)

    @pytest.mark.parametrize("profile", PROFILES)
    @pytest.mark.parametrize("deviation", [0.005, 0.05])
    def test_it_passes_within_the_deviation_and_sooner(self, profile, deviation):
        via = 0.5 * (B + C) + [0.2, 0.1, 0, 0, 0, 0]
        stopping, passing = plan(profile=profile), plan(profile=profile)
        slow = stopping.insert_via(2, JointTarget(via))
        r = passing.insert_via(2, JointTarget(via), deviation=deviation)
        assert r.end < slow.end
        p = passing.pose(np.linspace(r.execute_at, r.end, 20001))[:, :3, 3]
        assert np.linalg.norm(p - MODEL.forward(via)[:3, 3], axis=1).min() <= deviation * (1 + 1e-3)
        assert "within" in r.reason
        check(passing, smooth=profile is Profile.JERK_LIMITED)

    def test_under_way_the_rest_goes_by_it(self):
        clock = ManualClock()
        engine = plan(clock)
        clock.advance(0.8)
        t = np.linspace(0, 0.79, 80)
        past = engine.joints(t)
        r = engine.insert_via(1, PoseTarget(MODEL.forward(D)))
        assert r.execute_at == 0.5
        assert np.array_equal(engine.joints(t), past)
        p = engine.pose(np.linspace(0.8, r.end, 5001))[:, :3, 3]
        assert np.linalg.norm(p - MODEL.forward(D)[:3, 3], axis=1).min() < 1e-3
        check(engine)

    def test_what_can_not_be_reached_is_refused(self):
        engine = plan()
        before = engine.timeline
        far = MODEL.forward(A).copy()
        far[0, 3] = 5.0
        assert engine.insert_via(2, PoseTarget(far)).status is Status.REJECTED
        assert engine.timeline is before

    @pytest.mark.parametrize("profile", PROFILES)
    def test_an_appended_move_may_leave_the_one_before_early(self, profile):
        engine = Engine(MODEL, q=A)
        via = A + np.array([0.5, 0.2, 0.1, 0, 0, 0])
        goal = via + np.array([0.2, 0.5, 0.2, 0, 0, 0])
        first = engine.execute(to(via, 0.0, profile=profile))
        end = engine.execute(to(goal, insertion=Insertion.APPEND, profile=profile)).end
        engine.undo()
        r = engine.execute(to(goal, insertion=Insertion.APPEND, profile=profile, deviation=0.02))
        assert r.execute_at < first.end
        assert r.end < end
        assert r.superseded == (first.command_id,)
        p = engine.pose(np.linspace(0, r.end, 20001))[:, :3, 3]
        assert np.linalg.norm(p - MODEL.forward(via)[:3, 3], axis=1).min() <= 0.02 * (1 + 1e-3)
        check(engine, smooth=profile is Profile.JERK_LIMITED)


class TestForms:
    @pytest.mark.parametrize(
        "make",
        [
            lambda: Retime(0, 1.0),
            lambda: Retime(1, np.nan),
            lambda: Retime("1", 1.0),
            lambda: Cancel(True),
            lambda: InsertVia(1, A),
            lambda: InsertVia(1, JointTarget(A), deviation=-1),
            lambda: ScaleTime(0),
            lambda: ScaleTime(np.inf),
            lambda: Stop(execute_at=np.nan),
            lambda: Resume(issued_at="now"),
            SteerCommand,
            lambda: SteerCommand(rates=A, twist=A),
            lambda: SteerCommand(twist=[0.1, 0.2]),
            lambda: SteerCommand(rates=[np.nan] * 6),
            lambda: SteerCommand(twist=A, frame="world"),
            lambda: MotionCommand(JointTarget(A), deviation=np.nan),
        ],
    )
    def test_malformed_edits_are_never_made(self, make):
        with pytest.raises(InvalidValueError, match="must be"):
            make()

    def test_rates_of_another_arm_are_refused(self):
        engine = plan()
        before = engine.timeline
        with pytest.raises(InvalidValueError, match="shape"):
            engine.execute(SteerCommand(rates=[0.1] * 5))
        with pytest.raises(InvalidValueError, match="shape"):
            engine.execute(InsertVia(1, JointTarget([0.0] * 5)))
        assert engine.timeline is before


def test_a_move_cut_a_moment_after_its_start_is_not_rounded():
    smooth = Profile.JERK_LIMITED
    engine = Engine(MODEL, q=A)
    engine.execute(to(B, 0.5, profile=smooth))
    cut = 0.5 + 1e-9
    later = engine.execute(to(C, cut, profile=smooth))
    engine.cancel(later.command_id)
    sliver = engine.timeline.state_before(engine.timeline.end)
    assert not sliver.qd.any()
    assert sliver.qdd.any()
    answer = engine.execute(to(D, insertion=Insertion.APPEND, profile=smooth, deviation=0.05))
    assert answer.status is not Status.REJECTED
    assert "nothing to round" in answer.reason
    mine = [s for s in engine.timeline.segments if s.command_id == answer.command_id]
    for a, b in pairwise(mine):
        jump = a.value(a.end, derivative=2) - b.value(b.start, derivative=2)
        assert np.abs(jump).max() <= 1e-9


def test_a_retime_leaves_alone_what_moved_before_a_stop():
    engine = Engine(MODEL, q=A)
    end = engine.execute(to(B, 0.5)).end
    engine.stop(execute_at=end - 1e-12)
    engine.resume()
    assert engine.receipt(1).is_still
    t = 0.5 * (engine.timeline.segments[-1].start + end)
    past = np.linspace(0.0, t, 500)[:-1]
    was = engine.joints(past)
    assert engine.retime(1, t).execute_at == t
    assert np.array_equal(engine.joints(past), was)
    check(engine)


def test_a_smooth_move_joins_what_it_did_before_a_stop_without_a_jump():
    smooth = Profile.JERK_LIMITED
    engine = Engine(MODEL, q=A)
    engine.execute(to(B, 0.5, profile=smooth))
    engine.execute(to(C, 0.5 + 1e-7, profile=smooth))
    engine.stop(execute_at=1.0)
    engine.resume()
    answer = engine.retime(2, 0.5 + 5e-8)
    assert answer.status is Status.ACCEPTED
    assert "parabolas" not in answer.reason
    check(engine, smooth=True)


def rounded_up(clock: ManualClock) -> tuple[Engine, float, float]:
    """A plan, the time that a receipt says its move 2 begins, and the knot, an ulp earlier, where it does."""
    engine = Engine(MODEL, q=A, clock=clock)
    engine.execute(to(B, 0.5))
    engine.execute(to(C, 0.788))
    start = engine.retime(2, 2.1).execute_at
    knot = next(s.start for s in engine.timeline.segments if s.command_id == 2)
    assert 0.0 < start - knot <= 1e-12
    return engine, start, knot


def test_a_move_is_taken_out_whole_at_the_time_that_its_receipt_says():
    engine, start, knot = rounded_up(ManualClock())
    engine.cancel(2, execute_at=start)
    assert 2 not in [s.command_id for s in engine.timeline.segments]
    assert engine.timeline.end == knot
    check(engine)


@pytest.mark.parametrize("command", [Retime(2, 5.0), Cancel(2)])
def test_rounding_never_lets_an_edit_change_the_past(command):
    clock = ManualClock()
    engine, start, knot = rounded_up(clock)
    clock.advance(start - clock.now())
    assert clock.now() == start
    engine.execute(command)
    mine = [s for s in engine.timeline.segments if s.command_id == 2]
    assert mine
    assert mine[0].start == knot
    check(engine)


def test_a_cancel_that_leaves_the_arm_moving_before_what_cant_be_planned_anew_brakes():
    engine = Engine(MODEL, q=A)
    move = engine.execute(to(B, 0.5))
    stop = engine.stop(execute_at=move.end - 9e-10)
    answer = engine.execute(Cancel(move.command_id, execute_at=stop.execute_at))
    assert answer.status is Status.ACCEPTED
    assert "still goes to where command 2 begins" in answer.reason
    for a, b in pairwise(engine.timeline.segments):
        jump = a.value(a.end, derivative=1) - b.value(b.start, derivative=1)
        assert np.abs(jump).max() <= 1e-12
