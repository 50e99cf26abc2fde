"""Edits of the plan: retime, cancel, vias, another pace, stop, resume, steering."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from robots import puma560
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

MODEL = puma560.model()
LIMITS = MODEL.limits
A = np.array([0.0, 0.8, -2.4, 0.0, 0.6, 0.0])
B = np.array([0.9, 0.4, -1.8, 0.5, 0.2, 1.0])
C = np.array([-0.8, 1.1, -2.0, -0.4, 0.9, -1.0])
D = np.array([0.2, 0.1, -1.0, 1.0, -0.7, 2.0])
PROFILES = list(Profile)


def to(q, t=None, **options):
    return MotionCommand(JointTarget(q), execute_at=t, issued_at=None if t is None else min(t, 0.0), **options)


def plan(clock=None, profile=Profile.PARABOLIC, lateness=Lateness.POSTPONE) -> Engine:
    """A → B at 0.5, → C at 3, → D right after that."""
    engine = Engine(MODEL, q=A, clock=clock, lateness=lateness)
    engine.execute(to(B, 0.5, profile=profile))
    engine.execute(to(C, 3.0, profile=profile))
    engine.execute(to(D, insertion=Insertion.APPEND, profile=profile))
    return engine


def check(engine: Engine, *, smooth: bool = False) -> None:
    """The plan is whole and within the limits, and every standing receipt is true."""
    timeline = engine.timeline
    segments = list(timeline.segments)
    orders = 3 if smooth else 2
    for a, b in pairwise(segments):
        assert abs(a.end - b.start) <= 1e-9
        for k in range(orders):
            assert np.abs(a.value(a.end, derivative=k) - b.value(b.start, derivative=k)).max() <= 1e-9
    t = np.linspace(timeline.start, timeline.end, 20001)
    assert (timeline.sample(t) <= LIMITS.q_max + 1e-9).all()
    assert (timeline.sample(t) >= LIMITS.q_min - 1e-9).all()
    assert (np.abs(timeline.sample(t, derivative=1)) <= LIMITS.qd_max * (1 + 1e-9)).all()
    assert (np.abs(timeline.sample(t, derivative=2)) <= LIMITS.qdd_max * (1 + 1e-9)).all()
    assert not timeline.sample(timeline.end, derivative=1).any()
    for r in engine.receipts:
        if r.stands and r.q is not None:
            assert np.abs(engine.joints(r.end) - r.q).max() <= 1e-9


def curve(engine: Engine, start: float, end: float) -> np.ndarray:
    """Points of the joint path, evenly spaced along it."""
    q = engine.joints(np.linspace(start, end, 40001))
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    even = np.linspace(0, s[-1], 200)
    return np.stack([np.interp(even, s, q[:, j]) for j in range(6)], -1)


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


class TestPace:
    @pytest.mark.parametrize("profile", PROFILES)
    @pytest.mark.parametrize("now", [0.2, 0.6, 0.9, 1.2, 2.0, 3.6])
    def test_slower_keeps_the_way_and_is_smooth(self, profile, now):
        clock = ManualClock()
        engine = plan(clock, profile)
        end, way = engine.timeline.end, curve(engine, 0, engine.timeline.end)
        clock.advance(now)
        t = np.linspace(0, now - 1e-6, 100)
        past = engine.joints(t)
        r = engine.scale_time(0.5)
        assert r.status is Status.ACCEPTED
        assert np.array_equal(engine.joints(t), past)
        assert np.abs(curve(engine, 0, engine.timeline.end) - way).max() < 1e-4
        assert now + 2 * (end - now) - 1.0 < engine.timeline.end <= now + 2 * (end - now) + 1e-9
        check(engine, smooth=profile is Profile.JERK_LIMITED)

    def test_faster_goes_as_far_as_the_limits_and_says_how_far(self):
        engine = plan()
        engine.scale_time(0.25)
        r = engine.scale_time(8.0)
        assert r.status is Status.REJECTED
        assert "at most 4 times" in r.reason
        assert engine.scale_time(4.0).status is Status.ACCEPTED
        check(engine)

    def test_scaled_by_one_half_and_back_is_the_same_plan(self):
        engine = plan()
        before = engine.timeline
        engine.scale_time(0.5)
        engine.scale_time(2.0)
        assert engine.timeline == before
        engine.undo()
        engine.undo()
        assert engine.timeline == before


class TestStop:
    @pytest.mark.parametrize("profile", PROFILES)
    @pytest.mark.parametrize("now", [0.3, 0.55, 0.7, 0.9, 1.1, 1.3, 3.4, 4.7])
    def test_it_keeps_to_the_way_and_resume_goes_on(self, profile, now):
        clock = ManualClock()
        engine = plan(clock, profile)
        old = engine.timeline
        clock.advance(now)
        r = engine.stop()
        assert r.end - now < 0.75
        t = np.linspace(now, r.end, 200)
        way = old.sample(np.linspace(now, old.end, 200001))
        if "stopped on its way" in r.reason:
            for q in engine.joints(t):
                assert np.abs(way - q).max(1).min() < 1e-4
        assert all(engine.receipt(i).superseded_by == r.command_id for i in r.superseded)
        check(engine, smooth=profile is Profile.JERK_LIMITED)
        clock.advance(2.0)
        again = engine.resume()
        assert again.status is Status.ACCEPTED
        assert np.abs(engine.joints(engine.timeline.end) - D).max() < 1e-9
        assert all(engine.receipt(i).stands for i in (1, 2, 3))
        check(engine, smooth=profile is Profile.JERK_LIMITED)
        assert engine.resume().status is Status.REJECTED

    def test_scheduled_times_are_kept_where_they_can_be(self):
        clock = ManualClock()
        engine = plan(clock)
        clock.advance(0.8)
        engine.stop()
        clock.advance(0.5)
        engine.resume()
        assert engine.receipt(2).execute_at == 3.0
        slow = plan(clock2 := ManualClock())
        clock2.advance(0.8)
        slow.stop()
        clock2.advance(10.0)
        slow.resume()
        assert slow.receipt(2).execute_at > 10.8
        check(slow)

    def test_a_redirection_that_leaves_no_room_on_its_way_is_braked_joint_by_joint(self):
        clock = ManualClock()
        engine = Engine(MODEL, q=A, clock=clock)
        engine.execute(to(B, 0.0))
        engine.execute(to(D, 0.45, insertion=Insertion.REPLACE))
        for now in np.linspace(0.46, 1.2, 12):
            branch = Engine(MODEL, timeline=engine.timeline, clock=ManualClock(float(now)))
            r = branch.stop()
            assert r.end - now < 0.6
            check(branch)

    def test_a_late_stop_stops_at_once_whatever_the_policy(self):
        clock = ManualClock()
        engine = plan(clock, lateness=Lateness.REJECT)
        clock.advance(0.9)
        r = engine.stop(issued_at=0.1, execute_at=0.2)
        assert (r.status, r.execute_at) == (Status.POSTPONED, 0.9)

    def test_after_another_command_there_is_nothing_to_resume(self):
        clock = ManualClock()
        engine = plan(clock)
        assert "nothing to resume" in engine.resume().reason
        clock.advance(0.9)
        engine.stop()
        engine.execute(to(A))
        assert engine.resume().status is Status.REJECTED

    def test_undo_of_resume_and_stop(self):
        clock = ManualClock()
        engine = plan(clock)
        before, receipts = engine.timeline, engine.receipts
        engine.stop(execute_at=0.9)
        stopped = engine.timeline
        engine.resume(execute_at=2.0)
        engine.undo()
        assert engine.timeline == stopped
        assert not engine.receipt(2).stands
        engine.undo()
        assert engine.timeline == before
        assert engine.receipts[:3] == receipts

    def test_what_follows_may_be_too_short_to_last_at_its_time(self):
        engine = Engine(MODEL, q=A)
        engine.execute(to(B, 0.1))
        engine.execute(to(C, float(np.nextafter(np.nextafter(0.1, 1.0), 1.0))))
        engine.execute(Retime(2, 0.0, issued_at=0.0))
        engine.cancel(2)
        last = engine.timeline.segments[-1]
        assert last.end == last.start == engine.timeline.end
        before = engine.timeline
        engine.execute(Stop(issued_at=0.0, execute_at=0.0))
        assert len(engine.timeline) == 0
        assert engine.resume().status is Status.ACCEPTED
        assert list(engine.timeline.segments) == list(before.segments)
        check(engine)


class TestSteering:
    def test_inputs_in_a_row_are_one_command_and_end_by_themselves(self):
        clock = ManualClock()
        engine = Engine(MODEL, q=A, clock=clock)
        ids = set()
        for _ in range(50):
            r = engine.execute(SteerCommand(rates=[0.3, 0, 0, 0, 0.2, 0]))
            assert r.status is Status.ACCEPTED
            ids.add(r.command_id)
            clock.advance(0.02)
        assert ids == {1}
        assert np.abs(engine.timeline.sample(clock.now(), derivative=1) - [0.3, 0, 0, 0, 0.2, 0]).max() < 1e-9
        assert engine.timeline.end < clock.now() + 0.6
        check(engine, smooth=True)

    def test_a_twist_moves_the_tool_as_asked(self):
        clock = ManualClock()
        engine = Engine(MODEL, q=A, clock=clock)
        for _ in range(50):
            engine.execute(SteerCommand(twist=[0.0, 0.1, 0.05, 0, 0, 0]))
            clock.advance(0.02)
        X = engine.pose(np.linspace(0.5, 1.0, 20))
        way = np.diff(X[:, :3, 3], axis=0)
        direction = way / np.linalg.norm(way, axis=1)[:, None]
        assert np.abs(direction - np.array([0.0, 0.1, 0.05]) / np.hypot(0.1, 0.05)).max() < 0.02
        check(engine, smooth=True)

    def test_an_old_input_moves_nothing(self):
        clock = ManualClock(5.0)
        engine = Engine(MODEL, q=A, clock=clock)
        r = engine.execute(SteerCommand(rates=[0.3, 0, 0, 0, 0, 0], issued_at=4.7))
        assert r.status is Status.REJECTED
        assert "old" in r.reason
        assert len(engine.timeline) == 0

    def test_it_takes_over_from_what_is_scheduled(self):
        clock = ManualClock()
        engine = plan(clock)
        clock.advance(0.9)
        r = engine.execute(SteerCommand(rates=np.zeros(6)))
        assert r.superseded == (1, 2, 3)
        assert engine.receipt(2).superseded_by == r.command_id
        clock.advance(5.0)
        assert engine.execute(to(B)).command_id == r.command_id + 1
        check(engine)


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


def test_a_stop_of_what_moved_before_another_stop_resumes_behind_it():
    engine = Engine(MODEL, q=A)
    end = engine.execute(to(B, 0.5)).end
    engine.stop(execute_at=end - 1e-12)
    engine.resume()
    engine.stop(execute_at=0.9)
    t = engine.resume().execute_at
    moves = [s for s in engine.timeline.segments if s.start >= t]
    assert [s.command_id for s in moves] == [1] * len(moves)
    assert np.abs(engine.joints(engine.timeline.end) - B).max() < 1e-9
    assert engine.timeline.end < 2 * end
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
    cut = move.end - 1e-9
    engine.cancel(engine.execute(to(C, cut, insertion=Insertion.REPLACE)).command_id)
    stop = engine.stop(execute_at=cut + 0.3 * (engine.timeline.end - cut))
    answer = engine.execute(Cancel(move.command_id, execute_at=stop.execute_at))
    assert answer.status is Status.ACCEPTED
    for a, b in pairwise(engine.timeline.segments):
        jump = a.value(a.end, derivative=1) - b.value(b.start, derivative=1)
        assert np.abs(jump).max() <= 1e-12
