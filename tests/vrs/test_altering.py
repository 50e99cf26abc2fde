"""Alter: an offset on what is planned is followed after its delay, within the limits, whatever comes and goes."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.spatial.transform import Rotation

from robots import puma560
from vrs import (
    Alter,
    Engine,
    Frame,
    Insertion,
    InsertVia,
    JointTarget,
    ManualClock,
    Motion,
    MotionCommand,
    PoseTarget,
    Profile,
    Retime,
    ScaleTime,
    Status,
    SteerCommand,
    Stop,
)
from vrs.errors import InvalidValueError
from vrs.planning.altering import DELAY, FADE

from .test_line_refusals import Gantry

MODEL = puma560.model()
PERIOD = 0.028
TIP = np.array([[0.0, -1, 0, 0.03], [1, 0, 0, 0.01], [0, 0, 1, 0.1], [0, 0, 0, 1]])


class Alone:
    """An engine under a clock, and what it was told to do without offsets."""

    def __init__(self, q=None):
        self.clock = ManualClock(0.0)
        self.engine = Engine(MODEL, q=MODEL.poses["nominal"] if q is None else q, clock=self.clock)
        self.plan = self.engine.timeline
        self.seen = []

    @property
    def now(self):
        return self.clock.now()

    def line(self, way, *, speed=0.2, turn=(0.0, 0.0, 0.0), acceleration=0.5, **more):
        X = MODEL.forward(self.plan.final()).copy()
        X[:3, 3] += way
        X[:3, :3] = Rotation.from_rotvec(turn).as_matrix() @ X[:3, :3]
        receipt = self.engine.execute(
            MotionCommand(
                PoseTarget(X), motion=Motion.LINE, speed=speed, acceleration=acceleration,
                insertion=Insertion.APPEND, **more,
            )
        )  # fmt: skip
        assert receipt.status is not Status.REJECTED, receipt.reason
        return receipt

    def planned(self):
        """What was commanded so far is what is planned."""
        self.plan = self.engine.timeline

    def give(self, offset, *, given=None, **more):
        before = self.engine.timeline
        receipt = self.engine.execute(Alter(np.asarray(offset, float), issued_at=given, **more))
        self.past_stays(before)
        return receipt

    def past_stays(self, before):
        t = np.linspace(0.0, self.now, 40)
        assert np.abs(self.engine.timeline.sample(t) - before.sample(t)).max() < 1e-12

    def expected(self, t, offset, frame, tool):
        """Poses of the tip, (k, 4, 4), with offsets (k, 6) on the plan."""
        tip = np.eye(4) if tool is None else tool
        X = MODEL.forward(self.plan.sample(t)) @ tip
        E = Rotation.from_rotvec(offset[:, 3:]).as_matrix()
        found = X.copy()
        if frame is Frame.BASE:
            found[:, :3, 3] += offset[:, :3]
            found[:, :3, :3] = E @ X[:, :3, :3]
        else:
            found[:, :3, 3] += np.einsum("kij,kj->ki", X[:, :3, :3], offset[:, :3])
            found[:, :3, :3] = X[:, :3, :3] @ E
        return found

    def misses(self, t, offset, frame=Frame.BASE, tool=None):
        """How far the tip is from there [mm], and turned away [rad], (k,) each."""
        tip = np.eye(4) if tool is None else tool
        X, wanted = MODEL.forward(self.engine.timeline.sample(t)) @ tip, self.expected(t, offset, frame, tool)
        turn = Rotation.from_matrix(X[:, :3, :3].transpose(0, 2, 1) @ wanted[:, :3, :3]).magnitude()
        return 1e3 * np.linalg.norm(X[:, :3, 3] - wanted[:, :3, 3], axis=1), turn


def check_limits(timeline, *, until=None):
    """Every segment's own polynomials, at 1 kHz and at its ends, keep the limits, and they join."""
    limits, last = MODEL.limits, None
    for segment in timeline.segments:
        u = np.append(np.arange(0.0, segment.duration, 1e-3), segment.duration)
        rows = [Polynomial(column) for column in segment.coefficients.T]
        for order, low, high in (
            (0, limits.q_min, limits.q_max),
            (1, -limits.qd_max, limits.qd_max),
            (2, -limits.qdd_max, limits.qdd_max),
        ):
            values = np.array([row.deriv(order)(u) if order else row(u) for row in rows])
            slack = 1e-8 * np.abs(high)[:, None] + 1e-12
            assert (values <= high[:, None] + slack).all(), (order, segment.start)
            assert (values >= low[:, None] - slack).all(), (order, segment.start)
        first = np.array([[row(0.0), row.deriv()(0.0)] for row in rows])
        if last is not None:
            assert np.abs(first - last).max() < 1e-8, segment.start
        last = np.array([[row(u[-1]), row.deriv()(u[-1])] for row in rows])


def sine(amplitude, frequency, direction):
    """5 mm at 1 Hz, and so on: the offset at times (k,), from 0 on."""
    direction = np.asarray(direction, float)

    def at(t):
        t = np.clip(np.asarray(t, float), 0.0, None)
        return np.multiply.outer(amplitude * np.sin(2 * np.pi * frequency * t), direction)

    return at


def follow(alone, offset, *, begin=0.0, end=None, stamps=None, **more):
    """Give an offset every 28 ms; the answers."""
    end = alone.plan.end if end is None else end
    answers = []
    for k in range(int((end - begin) / PERIOD)):
        t = begin + k * PERIOD
        alone.clock.set(t)
        answers.append(alone.give(offset(t - begin), **more))
    return answers


@pytest.mark.parametrize("frame", [Frame.BASE, Frame.TOOL])
@pytest.mark.parametrize("tool", [None, TIP])
def test_a_sine_on_a_line_is_followed_to_a_tenth_of_a_millimetre(frame, tool):
    alone = Alone()
    alone.line([-0.25, 0.0, 0.0])
    alone.planned()
    offset = sine(5e-3, 1.0, [0, 0, 1, 0, 0, 0])
    answers = follow(alone, offset, begin=0.2, frame=frame, tool=tool)
    assert all(answer.status is not Status.REJECTED and not answer.hindrance for answer in answers)
    t = np.arange(0.0, alone.now + DELAY, 1e-3)
    miss, turn = alone.misses(t, offset(t - 0.2 - DELAY), frame, tool)
    assert miss.max() < 0.1
    assert turn.max() < 1e-6
    assert miss[t > 0.4].max() < 0.02
    check_limits(alone.engine.timeline)
    # Without it the path is off by the whole amplitude.
    still = np.linalg.norm(
        MODEL.forward(alone.plan.sample(t))[:, :3, 3] - MODEL.forward(alone.engine.timeline.sample(t))[:, :3, 3],
        axis=1,
    )
    assert 1e3 * still.max() == pytest.approx(5.0, abs=0.02)


@pytest.mark.parametrize("seed", range(25))
def test_whatever_is_asked_is_followed_or_said_to_be_late(seed):
    rng = np.random.default_rng(seed)
    names = [name for name in MODEL.poses if name not in {"ready", "zero", "stretch"}]
    q = np.array(MODEL.poses[names[0]]) + rng.uniform(-0.3, 0.3, 6)
    alone = Alone(q)
    way = rng.normal(size=3)
    way *= rng.uniform(0.05, 0.15) / np.linalg.norm(way)
    try:
        alone.line(way, speed=rng.uniform(0.1, 0.4), turn=rng.normal(size=3) * 0.1)
    except AssertionError:
        alone.line(way * 0.2, speed=0.1)
    alone.planned()
    direction = rng.normal(size=6) * [1, 1, 1, 3, 3, 3]
    direction /= np.linalg.norm(direction[:3])
    offset = sine(rng.uniform(5e-4, 5e-3), rng.uniform(0.3, 2.0), direction)
    frame = (Frame.BASE, Frame.TOOL)[rng.integers(2)]
    tool = TIP if rng.random() < 0.5 else None
    answers = follow(alone, offset, begin=0.15, frame=frame, tool=tool)
    check_limits(alone.engine.timeline)
    late = [answer.hindrance or answer.status is Status.REJECTED for answer in answers]
    if not any(late):
        t = np.arange(0.3, alone.now + DELAY, 1e-3)
        miss, turn = alone.misses(t, offset(t - 0.15 - DELAY), frame, tool)
        assert miss.max() < 0.1
        assert turn.max() < 1e-3
    alone.clock.set(alone.now + 3.0)
    assert np.abs(alone.engine.timeline.final() - alone.plan.final()).max() < 1e-9


def test_few_are_late():
    """The test above isn't empty: of its kind most are followed."""
    followed = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        alone = Alone(np.array(MODEL.poses["nominal"]) + rng.uniform(-0.2, 0.2, 6))
        alone.line(rng.uniform(-0.05, 0.05, 3))
        alone.planned()
        answers = follow(alone, sine(2e-3, 1.0, [1, 0, 0, 0, 0, 0]), begin=0.1)
        followed += all(not a.hindrance and a.status is not Status.REJECTED for a in answers)
    assert followed >= 6


def test_a_stream_that_ends_goes_back_to_the_plan():
    alone = Alone()
    alone.line([-0.25, 0.0, 0.0])
    alone.planned()
    offset = sine(5e-3, 1.0, [0, 1, 0, 0, 0, 0])
    follow(alone, offset, begin=0.2, end=1.5)
    last = alone.now
    alone.clock.set(4.0)
    t = np.arange(last + DELAY + FADE, 4.0, 1e-3)
    assert np.abs(alone.engine.timeline.sample(t) - alone.plan.sample(t)).max() < 1e-9
    t = np.arange(last, last + DELAY + FADE, 1e-3)
    assert alone.misses(t, np.zeros((len(t), 6)))[0].max() < 6.5
    check_limits(alone.engine.timeline)


@pytest.mark.parametrize("seed", range(4))
def test_jitter_losses_and_repetitions_are_made_up_for_by_stamps(seed):
    rng = np.random.default_rng(seed)
    alone = Alone()
    alone.line([-0.25, 0.05, 0.0])
    alone.planned()
    offset = sine(5e-3, 1.0, [0, 0, 1, 0, 0, 0])
    coming = []
    for k in range(60):
        given = 0.2 + k * PERIOD
        if k % 7 == 3 and k > 8:
            continue
        coming.append((given + 0.01 + rng.uniform(-0.01, 0.01), given))
        if k % 5 == 0:
            coming.append((given + 0.03, given))
    for at, given in sorted(coming):
        alone.clock.set(at)
        alone.give(offset(given - 0.2), given=given)
    t = np.arange(0.4, 0.2 + 59 * PERIOD, 1e-3)
    assert alone.misses(t, offset(t - 0.2 - DELAY))[0].max() < 0.1
    check_limits(alone.engine.timeline)


@pytest.mark.parametrize("way", [0.05, 0.15])
def test_a_stream_that_comes_late_is_followed_that_much_later(way):
    alone = Alone()
    alone.line([-0.25, 0.0, 0.0])
    alone.planned()
    offset = sine(5e-3, 1.0, [0, 0, 1, 0, 0, 0])
    for k in range(60):
        alone.clock.set(0.2 + k * PERIOD + way)
        assert alone.give(offset(k * PERIOD), given=0.2 + k * PERIOD).status is not Status.REJECTED
    t = np.arange(0.5, alone.now, 1e-3)
    assert alone.misses(t, offset(t - 0.2 - DELAY - way))[0].max() < 0.1
    check_limits(alone.engine.timeline)


def test_what_comes_out_of_order_or_too_late_moves_nothing():
    alone = Alone()
    alone.line([-0.25, 0.0, 0.0])
    alone.planned()
    alone.clock.set(0.5)
    alone.give([1e-3, 0, 0, 0, 0, 0])
    alone.clock.set(0.53)
    before = alone.engine.timeline
    alone.give([9e-3, 0, 0, 0, 0, 0], given=0.49)
    assert alone.engine.timeline is before
    refused = alone.engine.execute(Alter([1e-3, 0, 0, 0, 0, 0], issued_at=0.3))
    assert refused.status is Status.REJECTED
    assert "0.23 s old" in refused.reason
    assert alone.engine.timeline is before


def test_beyond_the_limits_it_comes_later_and_the_answer_says_so():
    alone = Alone()
    alone.line([-0.25, 0.0, 0.0])
    alone.planned()
    for k in range(60):
        alone.clock.set(0.2 + k * PERIOD)
        answer = alone.give([0, 0, 0.08, 0, 0, 0])
        if k == 0:
            assert "in time" in answer.hindrance
    assert not answer.hindrance
    miss = alone.misses(np.array([alone.now]), np.array([[0, 0, 0.08, 0, 0, 0]]))[0]
    assert miss[0] < 0.01
    check_limits(alone.engine.timeline)


def test_what_is_out_of_reach_is_refused_and_what_is_planned_goes_on():
    alone = Alone()
    alone.line([-0.25, 0.0, 0.0])
    alone.planned()
    alone.clock.set(0.5)
    alone.give([0, 0, 2e-3, 0, 0, 0])
    before = alone.engine.timeline
    alone.clock.set(0.528)
    refused = alone.give([3.0, 0, 0, 0, 0, 0])
    assert refused.status is Status.REJECTED
    assert refused.reason
    assert alone.engine.timeline is before


def test_where_the_plan_is_over_it_stays_if_it_is_to():
    for stays in (False, True):
        alone = Alone()
        alone.line([-0.1, 0.0, 0.0])
        alone.planned()
        for k in range(60):
            alone.clock.set(k * PERIOD)
            alone.give([0, 0, 5e-3, 0, 0, 0], stays=stays)
        assert alone.now > alone.plan.end
        alone.clock.set(4.0)
        offset = np.array([[0, 0, 5e-3 if stays else 0.0, 0, 0, 0]])
        assert alone.misses(np.array([4.0]), offset)[0][0] < 1e-6
        check_limits(alone.engine.timeline)


def test_a_motion_that_is_appended_meanwhile_gets_the_offset_too():
    alone = Alone()
    alone.line([-0.1, 0.0, 0.0], deviation=np.inf)
    follow(alone, lambda _: np.array([0, 0, 5e-3, 0, 0, 0]), begin=0.1, end=0.8)
    alone.clock.set(0.8)
    receipt = alone.line([0.0, 0.1, 0.0], deviation=np.inf)
    twin = Alone()
    twin.line([-0.1, 0.0, 0.0], deviation=np.inf)
    twin.clock.set(0.8)
    assert twin.line([0.0, 0.1, 0.0], deviation=np.inf).execute_at == receipt.execute_at
    alone.plan = twin.engine.timeline
    follow(alone, lambda _: np.array([0, 0, 5e-3, 0, 0, 0]), begin=0.8, end=alone.plan.end)
    t = np.arange(0.6, alone.now, 1e-3)
    assert alone.misses(t, np.tile([0, 0, 5e-3, 0, 0, 0], (len(t), 1)))[0].max() < 0.1
    check_limits(alone.engine.timeline)


def test_another_pace_keeps_the_offset():
    alone, twin = Alone(), Alone()
    for one in (alone, twin):
        one.line([-0.2, 0.0, 0.0])
        one.planned()
    offset = sine(4e-3, 1.0, [0, 0, 1, 0, 0, 0])
    follow(alone, offset, begin=0.2, end=0.9)
    for one in (alone, twin):
        one.clock.set(0.9)
        assert one.engine.execute(ScaleTime(0.5)).status is not Status.REJECTED
    alone.plan = twin.engine.timeline
    for k in range(40):
        alone.clock.set(0.9 + k * PERIOD)
        alone.give(offset(alone.now - 0.2))
    t = np.arange(0.4, alone.now, 1e-3)
    assert alone.misses(t, offset(t - 0.2 - DELAY))[0].max() < 0.1
    check_limits(alone.engine.timeline)


@pytest.mark.parametrize("what", ["stop", "undo", "steer", "cancel"])
def test_what_ends_it_is_smooth_and_the_next_counts_from_there(what):
    alone = Alone()
    number = alone.line([-0.25, 0.0, 0.0]).command_id
    alone.planned()
    follow(alone, sine(5e-3, 1.0, [0, 0, 1, 0, 0, 0]), begin=0.2, end=0.9)
    alone.clock.set(0.91)
    before = alone.engine.timeline
    if what == "undo":
        assert alone.engine.undo().undone
    else:
        command = {"stop": Stop(), "steer": SteerCommand(rates=np.zeros(6))}.get(what)
        receipt = alone.engine.cancel(number) if command is None else alone.engine.execute(command)
        assert receipt.status is not Status.REJECTED
    alone.past_stays(before)
    check_limits(alone.engine.timeline)
    stands = alone.engine.timeline.final()
    alone.clock.set(2.5)
    assert np.abs(alone.engine.timeline.sample(2.5) - stands).max() < 1e-9
    alone.planned()
    follow(alone, lambda _: np.array([2e-3, 0, 0, 0, 0, 0]), begin=2.5, end=3.0)
    assert alone.misses(np.array([3.0]), np.array([[2e-3, 0, 0, 0, 0, 0]]))[0][0] < 0.01
    check_limits(alone.engine.timeline)


def test_what_is_to_come_is_taken_back_without_a_jump():
    alone = Alone()
    alone.line([-0.25, 0.0, 0.0])
    alone.planned()
    offset = sine(5e-3, 1.0, [0, 0, 1, 0, 0, 0])
    follow(alone, offset, begin=0.2, end=0.9)
    alone.clock.set(0.9)
    alone.line([0.0, 0.1, 0.0])
    follow(alone, lambda t: offset(t + 0.7), begin=0.9, end=1.3)
    before = alone.engine.timeline
    assert alone.engine.undo().undone
    alone.past_stays(before)
    follow(alone, lambda t: offset(t + 1.1), begin=1.3, end=2.0)
    t = np.arange(0.4, 2.0, 1e-3)
    assert alone.misses(t, offset(t - 0.2 - DELAY))[0].max() < 0.1
    alone.clock.set(5.0)
    assert np.abs(alone.engine.timeline.final() - alone.plan.final()).max() < 1e-9
    check_limits(alone.engine.timeline)


def test_edits_of_the_plan_find_it_as_it_was_planned():
    alone = Alone()
    alone.line([-0.15, 0.0, 0.0])
    number = alone.line([0.0, 0.1, 0.0]).command_id
    follow(alone, lambda _: np.array([0, 0, 4e-3, 0, 0, 0]), begin=0.2, end=0.8)
    alone.clock.set(0.8)
    X = MODEL.forward(alone.plan.final())
    via = PoseTarget(X + np.array([[0, 0, 0, -0.15], [0, 0, 0, 0.0], [0, 0, 0, 0.03], [0, 0, 0, 0]]))
    assert alone.engine.execute(InsertVia(number, via)).status is not Status.REJECTED
    alone.clock.set(0.82)
    assert alone.give([0, 0, 4e-3, 0, 0, 0]).status is not Status.REJECTED
    alone.clock.set(8.0)
    check_limits(alone.engine.timeline)
    receipt = alone.engine.receipt(number)
    assert np.abs(alone.engine.timeline.final() - receipt.q).max() < 1e-9
    assert receipt.stands


def test_an_edit_that_is_refused_leaves_the_offset_as_it_was():
    alone = Alone()
    number = alone.line([-0.15, 0.0, 0.0]).command_id
    follow(alone, lambda _: np.array([0, 0, 4e-3, 0, 0, 0]), begin=0.2, end=0.8)
    before = alone.engine.timeline
    for edit in (Retime(number, 3.0), ScaleTime(1000.0), MotionCommand(PoseTarget(np.eye(4)), motion=Motion.LINE)):
        assert alone.engine.execute(edit).status is Status.REJECTED
        assert alone.engine.timeline is before


def test_jerk_limits_bind_where_the_plan_keeps_them():
    alone = Alone()
    q = np.array(MODEL.poses["nominal"])
    alone.engine.execute(MotionCommand(JointTarget(q + 0.4), speed=0.3, profile=Profile.JERK_LIMITED))
    alone.planned()
    follow(alone, sine(1e-3, 0.5, [0, 0, 1, 0, 0, 0]), begin=0.3)
    alone.clock.set(6.0)
    for segment in alone.engine.timeline.segments:
        u = np.linspace(0.0, segment.duration, 20)
        jerk = np.array([Polynomial(c).deriv(3)(u) for c in segment.coefficients.T])
        assert (np.abs(jerk) <= MODEL.limits.qddd_max[:, None] * (1 + 1e-6)).all()


def test_an_arm_of_another_number_of_joints_is_refused():
    with pytest.raises(InvalidValueError, match="an arm of 6 joints: gantry has 3"):
        Engine(Gantry()).execute(Alter(np.zeros(6)))


def test_offsets_are_six_finite_numbers():
    for offset in ([0.0] * 5, [np.nan] + [0.0] * 5):
        with pytest.raises(InvalidValueError):
            Alter(offset)


def test_one_period_is_planned_well_within_it():
    alone = Alone()
    alone.line([-0.25, 0.0, 0.0])
    alone.planned()
    offset = sine(5e-3, 1.0, [0, 0, 1, 0, 0, 0])
    took = []
    for k in range(60):
        alone.clock.set(0.2 + k * PERIOD)
        begun = time.process_time()
        alone.engine.execute(Alter(offset(k * PERIOD)))
        took.append(time.process_time() - begun)
    # Generous: the machine is shared. `benchmarks/altering.py` says what it takes.
    assert np.median(took) < 0.25 * PERIOD


def test_the_same_commands_make_the_same_timeline():
    def run():
        alone = Alone()
        alone.line([-0.25, 0.0, 0.0])
        alone.planned()
        follow(alone, sine(5e-3, 1.0, [0, 0, 1, 0.5, 0, 0]), begin=0.2)
        return alone.engine.timeline

    assert run() == run()
    assert replace(Alter(np.zeros(6)), issued_at=1.0).issued_at == 1.0
