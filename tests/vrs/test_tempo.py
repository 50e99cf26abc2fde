"""Edits of how a plan is gone through: another pace, stop, resume; steering."""

from __future__ import annotations

import numpy as np
import pytest

from tests.vrs.plans import MODEL, PROFILES, A, B, C, D, check, plan, to
from vrs import (
    Engine,
    Insertion,
    JointTarget,
    Lateness,
    ManualClock,
    Motion,
    MotionCommand,
    Profile,
    Retime,
    Status,
    SteerCommand,
    Stop,
)


def curve(engine: Engine, start: float, end: float) -> np.ndarray:
    """Points of the joint path, evenly spaced along it."""
    q = engine.joints(np.linspace(start, end, 40001))
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    even = np.linspace(0, s[-1], 200)
    return np.stack([np.interp(even, s, q[:, j]) for j in range(6)], -1)


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
        way = old.sample(np.linspace(now, r.end, 30_001))
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


def test_what_an_undo_brakes_smoothly_a_stop_brakes_smoothly_though_the_undone_move_was_of_parabolas():
    clock = ManualClock()
    engine = Engine(MODEL, q=np.array([-1.542, 3.791, -0.624, 2.945, -1.55, 1.185]), clock=clock)
    engine.execute(to(np.array([-1.548, -0.194, -2.55, 1.499, -0.167, 1.107]), 0.0))
    clock.set(0.315)
    engine.execute(SteerCommand(rates=np.array([-0.21, -0.85, -0.61, -2.39, -3.54, -1.84])))
    clock.set(0.348)
    line = np.array([-1.571, 3.335, -0.865, 2.59, -1.558, 1.006])
    move = engine.execute(
        MotionCommand(JointTarget(line), None, 0.515, speed=0.36, motion=Motion.LINE, insertion=Insertion.REPLACE)
    )
    assert "braked first" in move.reason
    clock.set(0.454)
    engine.execute(Retime(move.command_id, 0.551))
    clock.set(0.692)
    engine.undo()
    clock.set(0.72)
    engine.execute(Stop())
    knots = [segment.start for segment in engine.timeline.segments if segment.start >= clock.now()]
    before = engine.timeline.sample(np.nextafter(knots, 0.0), derivative=2)
    assert np.abs(before - engine.timeline.sample(np.array(knots), derivative=2)).max() <= 1e-9
    check(engine)


@pytest.mark.parametrize("gap", [5e-10, 9e-10])
def test_a_move_cut_by_less_than_rounding_has_arrived_at_any_pace(gap):
    """Slower it isn't cut by more than rounding: who is superseded next is told from the moves that are there."""
    engine = Engine(MODEL, q=A, clock=None)
    first = engine.execute(to(B, 0.5))
    second = engine.execute(to(C, first.end - gap))
    assert engine.receipt(first.command_id).stands
    engine.scale_time(0.5)
    cut = engine.receipt(second.command_id).execute_at
    assert engine.receipt(first.command_id).end == cut
    last = engine.execute(to(D, cut, insertion=Insertion.REPLACE))
    assert last.superseded == (second.command_id,)
    assert engine.receipt(first.command_id).stands
