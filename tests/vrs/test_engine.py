from __future__ import annotations

import numpy as np
import pytest

from robots import puma560
from vrs import (
    DriveCommand,
    Engine,
    Insertion,
    JointTarget,
    Lateness,
    ManualClock,
    Motion,
    MotionCommand,
    OffsetClock,
    ParameterChange,
    PoseTarget,
    PositionQuery,
    Profile,
    Status,
)
from vrs.errors import InvalidValueError, NonFiniteTimeError, UnknownCommandError, VrsError
from vrs.notes import NoteCode

MODEL = puma560.model()
A = np.array([0.0, 0.8, -2.4, 0.0, 0.6, 0.0])
B = np.array([0.9, 0.4, -1.8, 0.5, 0.2, 1.0])
C = np.array([-0.8, 1.1, -2.0, -0.4, 0.9, -1.0])
D = np.array([0.2, 0.1, -1.0, 1.0, -0.7, 2.0])


def to(q, t=None, **options):
    return MotionCommand(JointTarget(q), execute_at=t, **options)


@pytest.fixture
def offline() -> Engine:
    return Engine(MODEL, q=A)


def live(now: float = 0.0, lateness: Lateness = Lateness.POSTPONE) -> tuple[Engine, ManualClock]:
    clock = ManualClock(now)
    return Engine(MODEL, q=A, clock=clock, lateness=lateness), clock


class TestInsertion:
    def test_moves_and_receipts(self, offline):
        r = offline.execute(to(B, 0.5, speed=0.8))
        assert r.status is Status.ACCEPTED
        assert (r.execute_at, r.command_id, r.version) == (0.5, 1, 1)
        assert np.abs(offline.joints(r.end) - B).max() < 1e-12
        assert np.array_equal(offline.joints(0.4), A)
        assert [s.command_id for s in offline.timeline.segments][:2] == [None, 1]

    def test_with_nothing_behind_it_a_splice_just_replaces_the_target(self, offline):
        first = offline.execute(to(B, 0.0))
        second = offline.execute(to(C, 0.3))
        assert second.superseded == (first.command_id,)
        assert second.shifted == ()
        assert offline.receipt(1).superseded_by == 2
        assert offline.timeline.end == pytest.approx(second.end)

    def test_a_splice_shifts_the_tail_behind_a_joining_move(self, offline):
        offline.execute(to(B, 0.0))
        tail = offline.execute(to(C, insertion=Insertion.APPEND))
        before = [s for s in offline.timeline.segments if s.command_id == 2]
        r = offline.execute(to(D, 0.3))
        after = [s for s in offline.timeline.segments if s.command_id == 2]
        assert r.shifted == (2,)
        assert r.shift > 0
        assert offline.receipt(2).end == pytest.approx(tail.end + r.shift)
        for new, old in zip(after, before, strict=True):
            assert np.array_equal(new.coefficients, old.coefficients)
            assert new.duration == old.duration
        assert np.abs(offline.joints(r.end) - D).max() < 1e-12
        assert np.abs(offline.joints(offline.receipt(2).execute_at) - B).max() < 1e-12

    def test_slack_is_spent_at_rest_at_the_tails_first_state(self, offline):
        offline.execute(to(B, 0.0))
        tail = offline.execute(to(C, 60.0))
        r = offline.execute(to(D, 20.0))
        assert r.shift == 0
        assert r.shifted == ()
        assert offline.receipt(2).execute_at == tail.execute_at
        assert np.abs(offline.joints(59.0) - B).max() < 1e-12
        hold = offline.timeline.segment(offline.timeline.index_at(59.0))
        assert hold.command_id is None

    def test_holds_between_later_moves_are_shifted_with_them(self, offline):
        offline.execute(to(B, 0.0, speed=0.2))
        offline.execute(to(C, 10.0))
        offline.execute(to(D, 15.0))
        holds = [s.duration for s in offline.timeline.segments if s.command_id is None]
        r = offline.execute(to(A + 0.1, 0.5, speed=0.05))
        assert r.shifted == (2, 3)
        assert [s.duration for s in offline.timeline.segments if s.command_id is None] == holds

    def test_a_moving_tail_is_met_with_its_velocity(self, offline):
        offline.execute(to(B, 0.0))
        offline.execute(to(C, 0.4))
        moving = offline.timeline.sample(0.4, derivative=1)
        assert moving.any()
        r = offline.execute(to(D, 0.2))
        assert r.shifted == (2,)
        start = offline.receipt(2).execute_at
        assert np.abs(offline.timeline.sample(start, derivative=1) - moving).max() < 1e-9

    def test_replace_drops_the_rest_and_names_it(self, offline):
        offline.execute(to(B, 0.0))
        offline.execute(to(C, insertion=Insertion.APPEND))
        r = offline.execute(to(D, 0.3, insertion=Insertion.REPLACE))
        assert r.superseded == (1, 2)
        assert offline.timeline.end == pytest.approx(r.end)

    def test_append_before_the_end_is_postponed(self, offline):
        first = offline.execute(to(B, 0.0))
        r = offline.execute(to(C, 0.1, insertion=Insertion.APPEND))
        assert r.status is Status.POSTPONED
        assert r.execute_at == first.end
        assert offline.execute(to(A, insertion=Insertion.APPEND)).status is Status.ACCEPTED

    @pytest.mark.parametrize("profile", list(Profile))
    def test_at_equal_times_the_later_registration_wins(self, offline, profile):
        offline.execute(to(B, 1.0, profile=profile))
        r = offline.execute(to(C, 1.0, profile=profile))
        assert r.superseded == (1,)
        assert 1 not in [s.command_id for s in offline.timeline.segments]
        mid = Engine(MODEL, timeline=offline.timeline)
        mid.execute(to(D, 1.4))
        r = mid.execute(to(A, 1.4))
        assert r.execute_at == 1.4
        assert 3 not in [s.command_id for s in mid.timeline.segments]

    def test_stamps_stay_exact_in_a_tail_that_was_shifted(self, offline):
        for q in (B, C, D, A, B, C):
            offline.execute(to(q, offline.timeline.end + 0.3))
        rng = np.random.default_rng(8)
        for k in range(300):
            t = float(offline.timeline.end * rng.random())
            first = offline.execute(to(rng.permutation([B, C, D])[0] + 1e-3 * k % 0.1, t))
            starts = [s.start for s in offline.timeline.segments if s.command_id == first.command_id]
            assert starts[0] == t
            second = offline.execute(to(A, t))
            assert first.command_id in second.superseded
            owners = [s.command_id for s in offline.timeline.segments]
            assert first.command_id not in owners

    def test_a_command_to_where_the_arm_stands_is_true_until_something_moves_it(self, offline):
        still = offline.execute(to(A, 10.0))
        assert still.end == still.execute_at
        r = offline.execute(to(B, 5.0, insertion=Insertion.REPLACE))
        assert still.command_id in r.superseded

    def test_before_the_start_an_offline_timeline_begins_earlier(self, offline):
        tail = offline.execute(to(B, 1.0))
        r = offline.execute(to(C, -30.0))
        assert r.status is Status.ACCEPTED
        assert r.shift == 0
        assert offline.timeline.start == -30.0
        assert offline.receipt(tail.command_id).execute_at == 1.0

    def test_jerk_limited_from_a_state_that_only_parabolas_can_stop(self):
        limits = MODEL.limits
        low = np.array([-2.0, 0, -2, 0, 0, 0.0])
        goal = np.array([limits.q_max[0], 0, -2, 0, 0, 0])
        engine = Engine(MODEL, q=low)
        engine.execute(to(goal, 0.0))
        # At the end of the line the speed is highest and the acceleration zero.
        r = engine.execute(to(low, engine.timeline.segments[-1].start - 1e-3, profile=Profile.JERK_LIMITED))
        assert r.status is Status.ACCEPTED
        assert NoteCode.BRAKED_FIRST.value in r.reason
        assert engine.timeline.sample(np.linspace(0, r.end, 20001))[:, 0].max() <= limits.q_max[0] + 1e-12


class TestCausality:
    def test_execution_before_issue_is_rejected(self):
        engine, _ = live()
        r = engine.execute(to(B, 1.0, issued_at=2.0))
        assert r.status is Status.REJECTED
        assert "t_iss" in r.reason

    def test_a_late_command_is_postponed_to_the_end_of_the_active_segment(self):
        engine, clock = live()
        engine.execute(to(B, 0.0))
        clock.advance(0.4)
        active = engine.timeline.segment(engine.timeline.index_at(0.4))
        r = engine.execute(to(C, 0.2, issued_at=0.1))
        assert r.status is Status.POSTPONED
        assert r.execute_at == active.end
        assert r.reason

    def test_a_late_command_in_a_hold_or_after_the_end_starts_now(self):
        engine, clock = live()
        engine.execute(to(B, 5.0))
        clock.advance(2.0)
        assert engine.execute(to(C, 1.0, issued_at=0.5)).execute_at == 2.0
        clock.advance(100.0)
        assert engine.execute(to(D, 50.0, issued_at=49.0)).execute_at == 102.0

    def test_by_the_other_policy_it_is_rejected(self):
        engine, clock = live(lateness=Lateness.REJECT)
        clock.advance(1.0)
        before = engine.timeline
        r = engine.execute(to(B, 0.5, issued_at=0.1))
        assert r.status is Status.REJECTED
        assert engine.timeline is before

    def test_the_past_never_changes(self):
        engine, clock = live()
        seen = {}
        rng = np.random.default_rng(0)
        for _ in range(60):
            q = rng.uniform(MODEL.limits.q_min, MODEL.limits.q_max)
            t = clock.now() + rng.normal(0.2, 0.5)
            engine.execute(to(q, t, issued_at=min(t, clock.now())))
            clock.advance(0.25)
            seen[clock.now()] = engine.joints()
        for t, q in seen.items():
            assert np.array_equal(engine.joints(t), q)

    def test_stamps_are_kept_and_now_is_read_once_a_command(self):
        class Counting(ManualClock):
            reads = 0

            def now(self) -> float:
                self.reads += 1
                return super().now()

        clock = Counting()
        engine = Engine(MODEL, q=A, clock=clock)
        clock.reads = 0
        r = engine.execute(to(B, 1.0))
        assert clock.reads == 1
        assert r.issued_at == 0.0
        assert engine.execute(to(B, 3.0, issued_at=-2.5)).issued_at == -2.5

    def test_an_offset_clock_shifts_the_engines_time(self):
        user = ManualClock(10.0)
        engine = Engine(MODEL, q=A, clock=OffsetClock(user, -3.0))
        assert engine.execute(to(B)).execute_at == 7.0

    def test_clocks_never_run_back(self):
        clock = ManualClock(5.0)
        with pytest.raises(InvalidValueError, match="≥ 0"):
            clock.advance(-1)
        with pytest.raises(InvalidValueError, match="present"):
            clock.set(4.0)
        assert clock.now() == 5.0


class TestRefusals:
    @pytest.mark.parametrize(
        "make",
        [
            lambda: JointTarget([np.nan] * 6),
            lambda: JointTarget([[0.0] * 6]),
            lambda: JointTarget(["a"] * 6),
            lambda: JointTarget([1, [2]]),
            lambda: PoseTarget(np.eye(3)),
            lambda: PoseTarget(np.diag([1, 1, -1, 1.0])),
            lambda: PoseTarget(2 * np.eye(4)),
            lambda: to(A, np.inf),
            lambda: to(A, 1e300),
            lambda: to(A, "soon"),
            lambda: to(A, speed=0),
            lambda: to(A, speed=1.01),
            lambda: to(A, speed=np.nan),
            lambda: to(A, speed=True),
            lambda: to(A, motion="curve"),
            lambda: MotionCommand(A),
            lambda: PositionQuery(np.nan),
            lambda: DriveCommand(1.0, 0.0, -1.0),
        ],
    )
    def test_malformed_values_are_never_made(self, make):
        with pytest.raises(InvalidValueError, match="must be"):
            make()

    @pytest.mark.parametrize(
        "command", [to(np.zeros(5)), DriveCommand(0.1, 0.0, 1.0), "MOVE", None, JointTarget(A)]
    )
    def test_commands_that_do_not_fit_raise_and_change_nothing(self, offline, command):
        before = offline.timeline
        with pytest.raises(InvalidValueError):
            offline.execute(command)
        assert offline.timeline is before
        assert offline.receipts == ()

    def test_targets_out_of_limits_or_reach_are_rejected_with_what_is_allowed(self, offline):
        far = np.eye(4)
        far[0, 3] = 3.0
        before = offline.timeline
        too_far = A.copy()
        too_far[4] = 2.0
        for command, words in (
            (to(too_far), "joint 5 must be within"),
            (MotionCommand(PoseTarget(far)), "unreachable"),
            (MotionCommand(PoseTarget(MODEL.forward(A), "SIDEWAYS")), "configuration"),
            (to(B + np.eye(6)[0] * 3, motion=Motion.LINE), "joint 1"),
        ):
            r = offline.execute(command)
            assert r.status is Status.REJECTED
            assert words in r.reason
            assert offline.timeline is before
            assert r.execute_at is None

    def test_engines_refuse_starts_that_do_not_fit(self):
        for options in ({"q": np.full(6, 9.0)}, {"q": [0.0] * 5}, {"q": A, "timeline": Engine(MODEL).timeline}):
            with pytest.raises(VrsError):
                Engine(MODEL, **options)
        with pytest.raises(InvalidValueError, match="postpone"):
            Engine(MODEL, lateness="whenever")

    def test_unknown_receipts_and_times(self, offline):
        with pytest.raises(UnknownCommandError):
            offline.receipt(7)
        with pytest.raises(NonFiniteTimeError):
            offline.joints(np.nan)


class TestQueriesAndParameters:
    def test_a_position_query_answers_with_its_stamp(self, offline):
        offline.execute(to(B, 0.0))
        answer = offline.execute(PositionQuery(0.3))
        assert answer.t == 0.3
        assert np.array_equal(answer.q, offline.joints(0.3))
        assert np.array_equal(answer.X, MODEL.forward(answer.q))

    def test_g_takes_arrays(self, offline):
        r = offline.execute(to(B, 0.0))
        t = np.linspace(0, r.end, 11)
        assert offline.joints(t).shape == (11, 6)
        assert offline.pose(t).shape == (11, 4, 4)
        assert offline.links(t).shape == (11, 7, 4, 4)

    def test_pose_targets_are_resolved_and_the_receipt_carries_the_joints(self, offline):
        X = MODEL.forward(B)
        r = offline.execute(MotionCommand(PoseTarget(X)))
        assert np.abs(MODEL.forward(r.q) - X).max() < 1e-9
        assert np.abs(offline.pose(r.end) - X).max() < 1e-9
        assert MODEL.configuration(r.q) == MODEL.configuration(A)

    def test_parameters_change_what_later_commands_do(self, offline):
        slow = offline.execute(to(B)).end - offline.execute(to(A)).execute_at
        assert slow == 0
        offline.execute(ParameterChange("qd_max", 0.1))
        r = offline.execute(to(B))
        assert (
            np.abs(offline.timeline.sample(np.linspace(r.execute_at, r.end, 99), derivative=1)).max() <= 0.1 + 1e-12
        )
        for bad in (ParameterChange("qd_max", -1), ParameterChange("colour", 1), ParameterChange("lateness", "x")):
            with pytest.raises(InvalidValueError):
                offline.execute(bad)

    def test_limits_do_not_change_under_a_moving_arm(self):
        engine, clock = live()
        engine.execute(to(B))
        clock.advance(0.1)
        with pytest.raises(InvalidValueError, match="at rest"):
            engine.execute(ParameterChange("qdd_max", 1.0))


class TestUndoAndBranches:
    def test_undo_takes_back_what_lies_in_the_future(self, offline):
        offline.execute(to(B, 0.0))
        offline.execute(to(C, insertion=Insertion.APPEND))
        before, receipts = offline.timeline, offline.receipts
        offline.execute(to(D, 0.2))
        undone = offline.undo()
        assert undone.undone
        assert offline.timeline == before
        assert offline.timeline.version > before.version
        assert offline.receipts[:2] == receipts
        offline.undo()
        offline.undo()
        assert len(offline.timeline) == 0
        assert offline.undo() is None

    def test_undo_under_way_brakes_from_now_and_keeps_the_past(self):
        engine, clock = live()
        engine.execute(to(B, 0.0))
        clock.advance(0.3)
        before = engine.timeline
        undone = engine.undo()
        assert undone.undone
        t = np.linspace(0, 0.3, 31)
        assert np.array_equal(engine.joints(t), before.sample(t))
        qd = engine.timeline.sample(np.linspace(0.3, engine.timeline.end, 500), derivative=1)
        assert np.abs(qd[0] - before.sample(0.3, derivative=1)).max() < 1e-12
        assert engine.timeline.end - 0.3 < 0.3
        clock.advance(10)
        assert engine.undo() is None

    def test_a_branch_goes_its_own_way(self, offline):
        offline.execute(to(B, 0.0))
        branch = Engine(MODEL, timeline=offline.timeline)
        kept = offline.timeline
        r = branch.execute(to(C, 0.2))
        assert r.command_id == 2
        assert offline.timeline is kept
        assert branch.timeline != kept
