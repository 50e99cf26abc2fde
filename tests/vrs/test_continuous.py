"""Moves with a pace and a share of the acceleration; and continuous paths, which don't stop between moves."""

from __future__ import annotations

from itertools import pairwise
from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots import puma560
from tests.vrs.laws import Figures, check_run, check_way, columns
from tests.vrs.watch import Watch
from vrs import (
    Cancel,
    Engine,
    Insertion,
    InsertVia,
    JointTarget,
    ManualClock,
    Motion,
    MotionCommand,
    PoseTarget,
    Profile,
    Resume,
    Retime,
    ScaleTime,
    Status,
    Stop,
)
from vrs.planning.path import rotations

MODEL = puma560.model()
LIMITS = MODEL.limits
HOME = MODEL.poses["nominal"]
A = np.array([0.0, 0.8, -2.4, 0.0, 0.6, 0.0])
B = np.array([0.9, 0.4, -1.8, 0.5, 0.2, 1.0])
C = np.array([-0.8, 1.1, -2.0, -0.4, 0.9, -1.0])
KINDS = [(motion, profile) for motion in Motion for profile in Profile]
TOOL = np.eye(4)
TOOL[:3, :3] = rotations(np.array([[0.3, -0.5, 0.2]]))[0]
TOOL[:3, 3] = 0.05, -0.03, 0.2
SIDE = 0.15


def corner(k: int, side: float = SIDE) -> PoseTarget:
    X = MODEL.forward(HOME)
    X[:2, 3] += np.array([(0, 0), (-side, 0), (-side, side), (0, side)][k % 4])
    return PoseTarget(X)


def square(engine: Engine, motion: Motion, *, corners=(1, 2, 3, 4), side: float = SIDE, **how) -> list:
    options = {"deviation": inf, "insertion": Insertion.APPEND, "motion": motion, **how}
    return [engine.execute(MotionCommand(corner(k, side), **options)) for k in corners]


def drawn(motion: Motion, profile: Profile = Profile.PARABOLIC, **how) -> Engine:
    engine = Engine(MODEL, q=HOME)
    answers = square(engine, motion, profile=profile, **how)
    assert all(answer.status is Status.ACCEPTED for answer in answers)
    return engine


def lawful(engine: Engine, smooth=()) -> None:
    """Every segment keeps the limits at every instant, and meets the next one."""
    run = columns(engine.timeline)
    check_run(run, 0, len(run), LIMITS, set(smooth), Figures())


def along(engine: Engine, count: int = 2001) -> np.ndarray:
    timeline = engine.timeline
    return timeline.sample(np.linspace(timeline.start, timeline.end, count))


def tool_speeds(engine: Engine, t) -> np.ndarray:
    J = MODEL.jacobian(engine.timeline.sample(t))
    return np.linalg.norm((J @ engine.timeline.sample(t, derivative=1)[:, :, None])[:, :3, 0], axis=1)


def nearest(engine: Engine, X: PoseTarget) -> float:
    p = MODEL.forward(along(engine))[:, :3, 3]
    return float(np.linalg.norm(p - X.X[:3, 3], axis=1).min())


class TestPace:
    @pytest.mark.parametrize(("motion", "profile"), KINDS)
    def test_a_rounded_square_is_the_same_path_at_every_pace(self, motion, profile):
        full = drawn(motion, profile)
        for pace in (0.5, 0.3, 0.25, 0.001):
            slow = drawn(motion, profile, pace=pace)
            assert slow.timeline.end * pace == pytest.approx(full.timeline.end, rel=1e-12)
            assert np.abs(along(slow) - along(full)).max() <= 1e-9
            lawful(slow, range(1, 5) if profile is Profile.JERK_LIMITED else ())

    def test_so_it_is_where_the_deviation_is_finite(self):
        full, slow = (drawn(Motion.JOINT, deviation=0.02, pace=pace) for pace in (1.0, 0.3))
        assert slow.timeline.end * 0.3 == pytest.approx(full.timeline.end, rel=1e-12)
        assert np.abs(along(slow) - along(full)).max() <= 1e-9

    @pytest.mark.parametrize("profile", Profile)
    def test_the_limits_are_those_of_the_pace(self, profile):
        engine = Engine(MODEL, q=A)
        engine.execute(MotionCommand(JointTarget(B), pace=0.3, profile=profile))
        t = np.linspace(0.0, engine.timeline.end, 4001)
        peaks = [
            (np.abs(engine.timeline.sample(t, derivative=k)) / top).max()
            for k, top in ((1, LIMITS.qd_max), (2, LIMITS.qdd_max), (3, LIMITS.qddd_max))
        ]
        assert peaks[0] == pytest.approx(0.3, rel=1e-6)
        assert peaks[1] == pytest.approx(0.3**2, rel=1e-6)
        if profile is Profile.JERK_LIMITED:
            assert peaks[2] == pytest.approx(0.3**3, rel=1e-6)

    @pytest.mark.parametrize("profile", Profile)
    @pytest.mark.parametrize("pace", [0.9, 0.1])
    def test_an_arm_that_is_faster_than_the_pace_is_led_there_within_the_limits(self, profile, pace):
        engine = Engine(MODEL, q=A)
        engine.execute(MotionCommand(JointTarget(B), speed=0.5, profile=profile))
        answer = engine.execute(
            MotionCommand(JointTarget(C), execute_at=0.8, pace=pace, profile=profile, acceleration=0.5)
        )
        assert answer.stands
        assert ("too fast for the command's pace" in answer.reason) == (pace == 0.1)
        lawful(engine)
        assert np.abs(engine.timeline.sample(engine.timeline.end) - C).max() < 1e-9

    def test_an_arm_that_was_too_fast_goes_on_at_the_pace(self):
        ends = []
        for pace in (0.2, 0.1):
            engine = Engine(MODEL, q=A)
            engine.execute(MotionCommand(JointTarget(B)))
            answer = engine.execute(MotionCommand(JointTarget(C), execute_at=0.6, pace=pace))
            assert "too fast for the command's pace" in answer.reason
            ends.append(answer.end - answer.execute_at)
        assert ends[1] > 1.5 * ends[0]

    @pytest.mark.parametrize("seed", [6, 11, 14])
    def test_no_state_is_too_fast_to_be_answered(self, seed):
        """States far beyond the limits of the pace, of which Ruckig would make an error of its own."""
        rng = np.random.default_rng(seed)
        start, goal, other = rng.uniform(LIMITS.q_min, LIMITS.q_max, (3, 6))
        engine = Engine(MODEL, q=start)
        engine.execute(MotionCommand(JointTarget(goal), profile=Profile.JERK_LIMITED))
        t = rng.uniform(0, 1) * engine.timeline.end
        answer = engine.execute(
            MotionCommand(JointTarget(other), execute_at=t, pace=0.1, profile=Profile.JERK_LIMITED)
        )
        assert "too fast for the command's pace" in answer.reason
        lawful(engine, {1, 2})

    def test_a_move_before_another_joins_it_at_its_pace(self):
        engine = Engine(MODEL, q=A)
        engine.execute(MotionCommand(JointTarget(B), execute_at=0.0))
        engine.execute(MotionCommand(JointTarget(C), execute_at=9.0))
        engine.execute(MotionCommand(JointTarget(A), execute_at=5.0, pace=0.25, insertion=Insertion.SPLICE))
        t = np.linspace(5.0, engine.receipt(2).execute_at or 0.0, 1000)
        qd = np.abs(engine.timeline.sample(t, derivative=1)) / LIMITS.qd_max
        assert 0.2 < qd.max() <= 0.25 * (1 + 1e-9)


class TestAcceleration:
    @pytest.mark.parametrize("motion", Motion)
    @pytest.mark.parametrize("share", [0.4, 0.05])
    def test_a_move_takes_its_share_and_no_more(self, motion, share):
        engine = drawn(motion, corners=(1,), deviation=0.0, acceleration=share)
        t = np.linspace(0.0, engine.timeline.end, 4001)
        qdd = np.abs(engine.timeline.sample(t, derivative=2)) / LIMITS.qdd_max
        assert qdd.max() == pytest.approx(share, rel=2e-2)
        run = columns(engine.timeline)
        eased = type(LIMITS)(LIMITS.q_min, LIMITS.q_max, LIMITS.qd_max, share * LIMITS.qdd_max)
        check_run(run, 0, len(run), eased, set(), Figures())


class TestContinuous:
    @pytest.mark.parametrize(("motion", "profile"), KINDS)
    def test_the_tool_goes_round_the_corners_and_a_break_stops_there(self, motion, profile):
        engine = drawn(motion, profile)
        starts = [receipt.execute_at for receipt in engine.receipts]
        t = np.linspace(starts[1], starts[-1] + 0.1, 2001)
        assert tool_speeds(engine, t).min() > 0.1
        lawful(engine, range(1, 5) if profile is Profile.JERK_LIMITED else ())
        stopping = drawn(motion, profile, deviation=0.0)
        for receipt in stopping.receipts:
            assert tool_speeds(stopping, np.array([receipt.end]))[0] < 1e-9
            assert np.abs(stopping.joints(receipt.end) - receipt.q).max() <= 1e-12
        assert engine.timeline.end < stopping.timeline.end
        assert nearest(stopping, corner(1)) < 1e-4
        assert nearest(engine, corner(1)) > 5e-3

    @pytest.mark.parametrize("motion", Motion)
    def test_corners_are_rounded_by_the_square_of_the_speed(self, motion):
        slow, fast = (nearest(drawn(motion, speed=v), corner(1)) for v in (0.1, 0.2))
        assert fast / slow == pytest.approx(4.0, rel=0.1)

    @pytest.mark.parametrize("profile", Profile)
    def test_the_next_move_begins_where_the_first_begins_to_brake(self, profile):
        engine = Engine(MODEL, q=A)
        engine.execute(MotionCommand(JointTarget(B), deviation=inf, profile=profile))
        segments = list(engine.timeline.segments)
        braking = segments[-1].start if profile is Profile.PARABOLIC else segments[-3].start
        answer = engine.execute(
            MotionCommand(JointTarget(A), insertion=Insertion.APPEND, deviation=inf, profile=profile)
        )
        assert answer.execute_at == pytest.approx(braking, abs=1e-12)

    def test_a_short_start_begins_later(self):
        engine = Engine(MODEL, q=A)
        first = engine.execute(MotionCommand(JointTarget(B), deviation=inf))
        near = B + 0.01 * (C - B)
        answer = engine.execute(MotionCommand(JointTarget(near), insertion=Insertion.APPEND, deviation=inf))
        delta = first.end - answer.execute_at
        assert delta == pytest.approx(0.5 * (answer.end - answer.execute_at), rel=1e-9)
        lawful(engine)

    @pytest.mark.parametrize("motion", Motion)
    def test_a_move_of_full_acceleration_before_it_is_planned_anew(self, motion):
        engine = Engine(MODEL, q=HOME)
        square(engine, motion, corners=(1,), deviation=0.0)
        answer = square(engine, motion, corners=(2,))[0]
        assert "begins" in answer.reason
        lead = np.linspace(0.1, answer.end - 0.1, 1000)
        assert np.abs(engine.timeline.sample(lead, derivative=1)).max(1).min() > 0.01
        lawful(engine)

    @pytest.mark.parametrize("begun", [False, True])
    def test_where_both_need_the_acceleration_the_first_gives_way_unless_it_has_begun(self, begun):
        clock = ManualClock(0.0)
        engine = Engine(MODEL, q=A, clock=clock)
        first = engine.execute(MotionCommand(JointTarget(B)))
        clock.advance(0.1 if begun else 0.0)
        # Straight back: where the first brakes with all of it, nothing is left.
        answer = engine.execute(MotionCommand(JointTarget(A), insertion=Insertion.APPEND, deviation=inf))
        lawful(engine)
        if begun:
            assert "stops at the via" in answer.reason
            assert answer.execute_at == first.end
        else:
            assert "before command 1 is over" in answer.reason
            assert answer.execute_at == 0.0

    def test_three_moves_never_overlap_at_once(self):
        """The second, short and slow, begins while the first brakes; the third when the second brakes."""
        engine = Engine(MODEL, q=A)
        goals = (B, B + 0.02 * np.eye(6)[4], C)
        for q in goals:
            engine.execute(MotionCommand(JointTarget(q), insertion=Insertion.APPEND, deviation=inf))
        alone = Engine(MODEL, q=goals[0])
        alone.execute(MotionCommand(JointTarget(goals[1]), deviation=inf))
        begin = engine.receipts[1].execute_at
        assert engine.receipts[2].execute_at == pytest.approx(begin + 0.5 * alone.timeline.end, abs=1e-9)
        lawful(engine)

    def test_a_smooth_move_after_a_line_of_parabolas_begins_at_rest(self):
        engine = drawn(Motion.LINE, corners=(1,))
        start = engine.joints(engine.timeline.end)
        alone = Engine(MODEL, q=start)
        how = {"profile": Profile.JERK_LIMITED, "deviation": inf, "insertion": Insertion.APPEND}
        alone.execute(MotionCommand(JointTarget(A), **how))
        answer = engine.execute(MotionCommand(JointTarget(A), **how))
        assert answer.end - answer.execute_at == pytest.approx(alone.timeline.end, abs=1e-9)
        assert "parabolas" in answer.reason
        lawful(engine)

    def test_what_comes_while_the_first_brakes_takes_what_is_left_of_that(self):
        clock = ManualClock(0.0)
        engine = Engine(MODEL, q=A, clock=clock)
        first = engine.execute(MotionCommand(JointTarget(B), deviation=inf))
        clock.advance(first.end - 0.05)
        before = engine.timeline
        answer = engine.execute(MotionCommand(JointTarget(C), insertion=Insertion.APPEND, deviation=inf))
        assert answer.execute_at == pytest.approx(clock.now(), abs=1e-9)
        lawful(engine)
        t = np.linspace(0.0, clock.now(), 200)
        assert np.array_equal(engine.timeline.sample(t), before.sample(t))

    @pytest.mark.parametrize("motion", Motion)
    def test_a_change_of_pace_keeps_the_path_and_later_corners(self, motion):
        """Monitor speed: what is scheduled is scaled, what comes after has the new pace."""
        whole = drawn(motion)
        end = {r.command_id: r.end for r in drawn(motion, corners=(1, 2)).receipts}[2]
        clock = ManualClock(0.0)
        engine = Engine(MODEL, q=HOME, clock=clock)
        square(engine, motion, corners=(1, 2))
        clock.advance(0.45)
        before = engine.timeline
        answer = engine.scale_time(0.5)
        assert answer.stands
        check_way(before, engine.timeline, (0.45, answer.end), None, 0.5, Figures())
        away = np.linspace(0.0, 0.3 * (engine.timeline.end - answer.end), 200)
        old = before.sample(before.end - 0.5 * away)
        assert np.abs(engine.timeline.sample(engine.timeline.end - away) - old).max() <= 1e-9
        scaled = engine.timeline.end
        square(engine, motion, corners=(3, 4), pace=0.5)
        # Times of the path from the second move's end, where nothing else counts any more.
        s = np.linspace(end - 0.1, whole.timeline.end, 500)
        assert np.abs(engine.timeline.sample(scaled + (s - end) / 0.5) - whole.timeline.sample(s)).max() <= 1e-9

    @pytest.mark.parametrize(("motion", "profile"), KINDS)
    def test_edits_of_continuous_moves_keep_the_laws(self, motion, profile):
        clock = ManualClock(0.0)
        watch = Watch(Engine(MODEL, q=HOME, clock=clock))
        how = {"motion": motion, "profile": profile, "deviation": inf, "insertion": Insertion.APPEND}

        def go(*corners, **more):
            for k in corners:
                watch.execute(MotionCommand(corner(k), **{**how, **more}))

        engine = watch.engine
        go(1, 2, 3)
        watch.undo()
        go(3, 4, tool=TOOL)
        clock.advance(0.3)
        watch.execute(ScaleTime(0.5))
        go(1, 2, pace=0.5, acceleration=0.6)
        clock.advance(0.2)
        watch.execute(InsertVia(6, corner(3), 0.02))
        watch.execute(Retime(6, engine.timeline.end + 0.4))
        clock.advance(0.2)
        watch.execute(Cancel(6))
        watch.execute(Stop())
        assert engine.receipts[-1].stands
        clock.advance(1.0)
        watch.execute(Resume())
        assert engine.receipts[-1].stands
        go(1, 4, 3, pace=0.5)
        clock.advance(0.4)
        watch.undo()
        clock.advance(0.1)
        watch.undo()
        lawful(engine)
        assert not engine.timeline.sample(engine.timeline.end + 1.0, derivative=1).any()

    def test_all_but_a_rounded_end_of_the_past_stays_as_it_was(self):
        watch = Watch(Engine(MODEL, q=A))
        for q in (B, C, A, B):
            watch.execute(MotionCommand(JointTarget(q), insertion=Insertion.APPEND, deviation=inf))
        # Between moves, so that those after it are a tail.
        t = watch.engine.receipt(3).execute_at
        watch.execute(MotionCommand(JointTarget(0.5 * (A + B)), execute_at=t, deviation=inf))
        lawful(watch.engine)

    def test_a_plain_rounding_passes_the_end_of_a_line_too(self):
        engine = drawn(Motion.LINE, deviation=0.0, corners=(1,))
        answer = square(engine, Motion.LINE, corners=(2,), deviation=0.02)[0]
        assert "passes the via" in answer.reason
        assert 1e-3 < nearest(engine, corner(1)) <= 0.02 * (1 + 1e-3)
        lawful(engine)

    def test_a_thousand_moves_overlap(self):
        engine, rng = Engine(MODEL, q=HOME, clock=ManualClock(0.0)), np.random.default_rng(5)
        for _ in range(1000):
            goal = JointTarget(rng.uniform(LIMITS.q_min, LIMITS.q_max))
            engine.execute(MotionCommand(goal, insertion=Insertion.APPEND, deviation=inf))
        assert sum("begins" in receipt.reason for receipt in engine.receipts) == 999
        lawful(engine)
        for a, b in pairwise(engine.receipts):
            assert a.execute_at < b.execute_at

    @given(st.integers(0, 10_000), st.sampled_from([0.5, 0.25, 0.7]), st.sampled_from(list(Profile)))
    @settings(max_examples=25, deadline=None)
    def test_random_corners_are_the_same_at_every_pace(self, seed, pace, profile):
        rng = np.random.default_rng(seed)
        goals = rng.uniform(LIMITS.q_min, LIMITS.q_max, (4, 6))
        speeds = rng.uniform(0.1, 1.0, 3)
        engines = Engine(MODEL, q=goals[0]), Engine(MODEL, q=goals[0])
        for engine, share in zip(engines, (1.0, pace), strict=True):
            for q, speed in zip(goals[1:], speeds, strict=True):
                command = MotionCommand(
                    JointTarget(q), speed=speed, insertion=Insertion.APPEND, deviation=inf, pace=share,
                    profile=profile,
                )  # fmt: skip
                assert engine.execute(command).stands
            lawful(engine, range(1, 4) if profile is Profile.JERK_LIMITED else ())
        assert np.abs(along(engines[0]) - along(engines[1])).max() <= 1e-9


def test_an_overlap_begins_at_a_knot_where_rounding_alone_keeps_them_apart():
    rng = np.random.default_rng(5)
    for _ in range(60):
        engine = Engine(MODEL, q=HOME)
        for _ in range(3):
            target = JointTarget(HOME + rng.uniform(-0.5, 0.5, 6))
            profile, pace = rng.choice(list(Profile)), float(rng.choice([1.0, 0.3]))
            engine.execute(
                MotionCommand(target, profile=profile, insertion=Insertion.APPEND, deviation=inf, pace=pace)
            )
        assert min(segment.duration for segment in engine.timeline.segments) > 1e-12
