"""The engine of a mobile robot against a plain list of arcs, and its laws."""

from __future__ import annotations

import copy
import math
import pickle
import random
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from robots import ipr, puma560
from vrs import (
    ArcSegment,
    Cancel,
    DriveCommand,
    Engine,
    JointTarget,
    Lateness,
    ManualClock,
    MotionCommand,
    ParameterChange,
    PositionQuery,
    Status,
    Stop,
)
from vrs.engine import MobileEngine
from vrs.errors import InvalidValueError, NonFiniteTimeError, UnknownCommandError
from vrs.mobile import ArcTimeline, advanced

close = partial(np.testing.assert_allclose, rtol=0.0)

MODEL = ipr.model()
START = (1.0, -2.0, 0.7)


def made(*, clock=None, **more):
    return Engine(MODEL, posture=START, clock=clock, **more)


class Naive:
    """What is scheduled as a list of (start, duration, v, w, owner), gone through from the beginning."""

    def __init__(self):
        self.arcs = []

    @property
    def end(self):
        return self.arcs[-1][0] + self.arcs[-1][1] if self.arcs else 0.0

    def splice(self, t, duration, v, w, owner):
        kept, tail, broken = [], [], None
        if t > self.end:
            kept = [*self.arcs, (self.end, t - self.end, 0.0, 0.0, 0)]
        else:
            for arc in self.arcs:
                start, lasting = arc[:2]
                if start + lasting <= t:
                    kept.append(arc)
                elif start <= t:
                    if start < t:
                        kept.append((start, t - start, *arc[2:]))
                    broken = arc[4]
                elif arc[4] and arc[4] == broken and not any(other[4] not in (0, broken) for other in tail):
                    tail.clear()
                else:
                    tail.append(arc)
        arrival = t + duration
        kept.append((t, duration, v, w, owner))
        shift = 0.0
        if any(arc[4] for arc in tail):
            shift = max(arrival - tail[0][0], 0.0)
            if tail[0][0] > arrival:
                kept.append((arrival, tail[0][0] - arrival, 0.0, 0.0, 0))
            kept += [(arc[0] + shift, *arc[1:]) for arc in tail]
        self.arcs = kept
        return shift

    def posture(self, t):
        here = START
        for start, duration, v, w, _ in self.arcs:
            if t < start:
                break
            here = advanced(here, v, w, min(duration, t - start))
        return here


@pytest.mark.parametrize("seed", range(8))
def test_random_commands_make_what_a_list_makes(seed):
    rng = random.Random(seed)
    engine, naive = made(), Naive()
    for _ in range(60):
        t = None if rng.random() < 0.5 else round(rng.uniform(0, naive.end + 1), 2)
        command = DriveCommand(rng.uniform(-0.5, 0.5), rng.uniform(-0.7, 0.7), rng.choice([0.1, 0.5, 1.3]), None, t)
        receipt = engine.execute(command)
        assert receipt.status is Status.ACCEPTED
        at = naive.end if t is None else t
        shift = naive.splice(at, command.duration, command.v, command.w, receipt.command_id)
        assert receipt.shift == pytest.approx(shift, abs=1e-9)
        assert receipt.execute_at == pytest.approx(at, abs=1e-9)
    assert engine.timeline.end == pytest.approx(naive.end, abs=1e-9)
    moments = np.linspace(-1, naive.end + 1, 400)
    expected = [naive.posture(t) for t in moments.tolist()]
    close(engine.posture(moments), expected, atol=1e-9)
    for t, row in zip(moments.tolist(), expected, strict=True):
        close(engine.posture(t), row, atol=1e-9)
    assert [s.command_id or 0 for s in engine.timeline.segments] == [arc[4] for arc in naive.arcs]


def speeds_of(timeline):
    return {(s.command_id, s.duration, s.v, s.w) for s in timeline.segments if s.command_id}


@pytest.mark.parametrize("seed", range(4))
def test_the_past_never_changes(seed):
    """Commands, stops and undos under a clock leave every posture before now as it was, to the last bit."""
    rng = random.Random(seed)
    clock = ManualClock()
    engine = made(clock=clock, lateness=rng.choice(list(Lateness)))
    for _ in range(100):
        now = clock.advance(rng.choice([0.0, 0.01, 0.1, 0.1, 0.37]))
        moments = [rng.uniform(-1, now) for _ in range(4)] + [now]
        before = [engine.posture(t).tolist() for t in moments]
        known = engine.timeline
        kept = known.sample(np.linspace(0, known.end + 1, 9))
        what = rng.random()
        if what < 0.75:
            at = None if rng.random() < 0.4 else now + rng.uniform(-0.5, 2)
            engine.execute(DriveCommand(rng.uniform(-0.5, 0.5), rng.uniform(-0.7, 0.7), 0.3, now - 1, at))
        elif what < 0.85:
            engine.stop(execute_at=rng.choice([None, now + 0.2]))
        else:
            engine.undo()
        assert [engine.posture(t).tolist() for t in moments[:-1]] == before[:-1]
        close(engine.posture(now), before[-1], atol=1e-12)
        np.testing.assert_array_equal(known.sample(np.linspace(0, known.end + 1, 9)), kept)
        if engine.timeline is not known:
            assert engine.timeline.version == known.version + 1
    segments = engine.timeline.segments
    for one, other in pairwise(segments):
        assert one.end == pytest.approx(other.start, abs=1e-9)
        close(one.value(other.start), other.posture, atol=1e-9)


def test_commands_follow_one_another():
    clock = ManualClock(5.0)
    engine = made(clock=clock)
    assert isinstance(engine, MobileEngine)
    first = engine.execute(DriveCommand(0.5, 0.2, 1.0))
    second = engine.execute(DriveCommand(0.3, -0.2, 0.5))
    assert (first.execute_at, first.end, second.execute_at, second.end) == (5.0, 6.0, 6.0, 6.5)
    clock.advance(4.0)
    third = engine.execute(DriveCommand(-0.1, 0.0, 1.0))
    assert (third.execute_at, third.command_id, third.issued_at) == (9.0, 3, 9.0)
    assert [s.command_id for s in engine.timeline.segments] == [1, 2, None, 3]
    assert all(isinstance(s, ArcSegment) for s in engine.timeline.segments)
    expected = advanced(advanced(START, 0.5, 0.2, 1.0), 0.3, -0.2, 0.5)
    close(engine.posture(), expected, atol=1e-14)


def test_a_splice_replaces_the_rest_shifts_the_tail_and_keeps_its_speeds():
    engine = made()
    for v in (0.1, 0.2, 0.3, 0.4):
        engine.execute(DriveCommand(v, 0.1, 1.0))
    before = engine.timeline
    receipt = engine.execute(DriveCommand(0.0, 0.7, 1.0, execute_at=1.5))
    assert (receipt.superseded, receipt.shifted, receipt.shift) == ((2,), (3, 4), 0.5)
    assert engine.receipt(2).superseded_by == 5
    assert engine.receipt(3).execute_at == 2.5
    tail = {s for s in speeds_of(before) if s[0] in (3, 4)}
    assert tail <= speeds_of(engine.timeline)
    short = engine.execute(DriveCommand(0.0, 0.0, 0.25, execute_at=0.5))
    assert (short.shift, short.superseded) == (0.0, (1,))
    held = engine.timeline.segment(engine.timeline.index_at(0.8))
    assert (held.command_id, held.v, held.w) == (None, 0.0, 0.0)


@pytest.mark.parametrize(("v", "w"), [(0.51, 0), (-0.6, 0), (0, math.radians(45.1)), (0, -1)])
def test_limits_are_refused_in_one_line(v, w):
    engine = made()
    before = engine.timeline
    receipt = engine.execute(DriveCommand(v, w, 1.0))
    assert receipt.status is Status.REJECTED
    assert "given" in receipt.reason
    assert engine.timeline is before
    assert engine.execute(DriveCommand(0.5, -math.radians(45.0), 1.0)).status is Status.ACCEPTED


@pytest.mark.parametrize("policy", list(Lateness))
def test_late_commands_are_postponed_or_rejected(policy):
    clock = ManualClock()
    engine = made(clock=clock, lateness=policy)
    engine.execute(DriveCommand(0.5, 0.0, 1.0))
    engine.execute(DriveCommand(0.4, 0.0, 1.0))
    clock.advance(0.5)
    late = engine.execute(DriveCommand(0.1, 0.1, 1.0, 0.0, 0.2))
    assert "had passed" in late.reason
    if policy is Lateness.REJECT:
        assert late.status is Status.REJECTED
    else:
        assert (late.status, late.execute_at, late.superseded) == (Status.POSTPONED, 1.0, (2,))
    early = engine.execute(DriveCommand(0.1, 0.1, 1.0, 3.0, 2.0))
    assert early.status is Status.REJECTED
    assert "t_iss" in early.reason


def test_a_stop_brakes_on_the_arc_within_the_limits():
    clock = ManualClock()
    engine = made(clock=clock)
    engine.execute(DriveCommand(0.5, 0.3, 2.0))
    engine.execute(DriveCommand(0.5, -0.3, 2.0))
    planned = engine.timeline
    clock.advance(0.77)
    receipt = engine.stop()
    assert receipt.superseded == (1, 2)
    assert receipt.end == pytest.approx(0.77 + 0.9)
    braking = [(s.v, s.w) for s in engine.timeline.segments if s.command_id == receipt.command_id]
    stair = [(0.5, 0.3), *braking, (0.0, 0.0)]
    assert all(0 <= a[0] - b[0] <= 0.52 * 0.1 + 1e-9 for a, b in pairwise(stair))
    # On the arc: the distances from its centre stay the radius.
    x, y, theta = START
    centre = np.array([x - 0.5 / 0.3 * math.sin(theta), y + 0.5 / 0.3 * math.cos(theta)])
    way = engine.posture(np.linspace(0.77, 3, 50))[:, :2]
    close(np.hypot(*(way - centre).T), 0.5 / 0.3, atol=1e-12)
    engine.undo()
    assert engine.timeline == planned
    clock.advance(10)
    assert engine.stop().reason == "stood"


def test_a_stop_between_two_arcs_brakes_on_the_one_before():
    engine = made()
    engine.execute(DriveCommand(0.5, 0.3, 1.0))
    engine.execute(DriveCommand(-0.5, -0.3, 1.0))
    engine.stop(execute_at=1.0)
    first = next(s for s in engine.timeline.segments if s.command_id == 3)
    assert (first.v, first.w) == pytest.approx((0.45, 0.27))


def test_undo_takes_back_the_future_and_brakes_what_is_under_way():
    clock = ManualClock()
    engine = made(clock=clock)
    engine.execute(DriveCommand(0.5, 0.0, 1.0))
    before = engine.timeline
    engine.execute(DriveCommand(0.2, 0.5, 1.0))
    assert engine.undo().undone
    assert engine.timeline == before
    clock.advance(0.4)
    assert "undone from 0.4 s on" in engine.undo().reason
    assert engine.timeline.end == pytest.approx(0.4 + 0.9)
    assert engine.undo() is None


def test_a_branch_goes_its_own_way():
    engine = made()
    engine.execute(DriveCommand(0.5, 0.1, 1.0))
    branch = Engine(MODEL, timeline=engine.timeline)
    assert branch.execute(DriveCommand(0.1, 0.0, 1.0)).command_id == 2
    assert engine.timeline.end == 1.0
    np.testing.assert_array_equal(branch.posture(0.5), engine.posture(0.5))
    with pytest.raises(InvalidValueError, match="timeline"):
        Engine(MODEL, timeline=Engine(puma560.model()).timeline)
    with pytest.raises(InvalidValueError, match="posture"):
        Engine(MODEL, timeline=engine.timeline, posture=START)


def test_queries_and_parameters():
    engine = made()
    engine.execute(DriveCommand(0.0, 0.5, 1.0))
    answer = engine.execute(PositionQuery(1.0))
    close(answer.q, [1.0, -2.0, 1.2], atol=1e-15)
    close(answer.X[:3, 3], [1.0, -2.0, 0.0], atol=1e-15)
    close(answer.X[:2, 0], [math.cos(1.2), math.sin(1.2)])
    assert engine.pose([0.0, 1.0]).shape == (2, 4, 4)
    assert engine.posture([0.0, 1.0, 2.0]).shape == (3, 3)
    assert engine.posture([]).shape == (0, 3)
    assert engine.posture(0).shape == (3,)
    engine.execute(ParameterChange("v_max", 0.2))
    assert engine.execute(DriveCommand(0.3, 0.0, 1.0)).status is Status.REJECTED
    assert engine.parameters["v_max"] == 0.2
    with pytest.raises(InvalidValueError, match="parameter"):
        engine.execute(ParameterChange("qd_max", 1.0))
    with pytest.raises(NonFiniteTimeError):
        engine.posture(math.nan)
    with pytest.raises(UnknownCommandError):
        engine.receipt(99)


@pytest.mark.parametrize("command", [MotionCommand(JointTarget([0.0] * 6)), Cancel(1), "drive"])
def test_what_is_for_arms_is_refused(command):
    with pytest.raises(InvalidValueError, match="wheels"):
        made().execute(command)


def test_an_arm_has_no_posture():
    with pytest.raises(InvalidValueError, match="wheels"):
        Engine(puma560.model(), posture=START)
    with pytest.raises(InvalidValueError, match="joints"):
        Engine(MODEL, q=[0.0] * 6)
    with pytest.raises(InvalidValueError, match="posture"):
        made().joints()
    with pytest.raises(InvalidValueError, match="model"):
        Engine("ipr")


def test_many_times_agree_with_one_over_long_plans_and_knots():
    engine = made()
    rng = random.Random(1)
    for _ in range(500):
        engine.execute(DriveCommand(rng.uniform(-0.5, 0.5), rng.choice([0.0, 0.5]), 0.1))
    timeline = engine.timeline
    knots = [s.start for s in timeline.segments]
    for moments in (knots, np.linspace(-1, 60, 1000), [0.0, 49.0], [70.0, 80.0], [-3.0], np.array([12.34])):
        together = timeline.sample(moments)
        assert np.abs(together - [timeline.sample(float(t)) for t in moments]).max() <= 1e-12
    rates = timeline.sample([0.05, 25.05], derivative=1)
    close(rates[0], timeline.sample(0.05, derivative=1), atol=1e-14)
    assert np.abs(timeline.sample(100.0, derivative=1)).max() == 0.0


def test_a_timeline_is_a_value():
    engine = made()
    engine.execute(DriveCommand(0.5, 0.1, 1.0))
    again = pickle.loads(pickle.dumps(engine.timeline))
    assert again == engine.timeline
    assert hash(again) == hash(engine.timeline)
    made_anew = ArcTimeline(START, 0.0, engine.timeline.segments, 1)
    assert made_anew == again
    assert again != Engine(puma560.model()).timeline
    gap = [ArcSegment(0, 1, START, 0.1, 0), ArcSegment(1.5, 1, START, 0.1, 0)]
    with pytest.raises(InvalidValueError, match="contiguous"):
        ArcTimeline(START, 0.0, gap)
    with pytest.raises(InvalidValueError, match="posture"):
        ArcTimeline(START, 0.0, [ArcSegment(0, 1, START, 0.1, 0), ArcSegment(1, 1, START, 0.1, 0)])


def test_an_engine_of_either_kind_can_be_copied():
    engine = made()
    engine.execute(DriveCommand(0.5, 0.1, 1.0))
    again = copy.deepcopy(engine)
    again.execute(DriveCommand(0.5, 0.1, 1.0))
    assert (again.timeline.end, engine.timeline.end) == (2.0, 1.0)
    arm = copy.deepcopy(Engine(puma560.model()))
    assert type(arm) is Engine


def test_stop_is_a_command_too():
    engine = made()
    engine.execute(DriveCommand(0.5, 0.0, 1.0))
    receipt = engine.execute(Stop(execute_at=0.5))
    assert receipt.execute_at == 0.5
    early = engine.execute(Stop(issued_at=1.0, execute_at=0.2))
    assert early.status is Status.ACCEPTED
