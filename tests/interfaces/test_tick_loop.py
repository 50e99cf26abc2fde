"""The loop that follows rows tick by tick, in virtual time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from interfaces.runtime.physics_messages import (
    ROWS_MOST,
    Attach,
    Close,
    Fault,
    FaultKind,
    Measurement,
    News,
    PhysicsActivity,
    PhysicsReady,
    PhysicsSetup,
    Rows,
    decode_news,
    decode_order,
    encode,
)
from interfaces.runtime.physics_process import BodyTicks
from interfaces.runtime.tick_loop import AHEAD_MOST, PAUSE, TickLoop
from interfaces.teleop import JointReference
from robots.robot import IDEAL, ExactArm
from tests.interfaces.ticks import LIMITS, MODEL, NOMINAL, TICK, motion, sampled, standing
from vrs import Engine, Insertion, JointTarget, ManualClock, MotionCommand, Status
from vrs.errors import FormatError, InvalidValueError, VrsError

QUICK = (Phase.explicit, Phase.reuse, Phase.generate)


def rows(reference: JointReference, start: int, *, run: int = 0, placed: bool = False) -> Rows:
    return Rows(run, start, placed, np.stack(reference, axis=1).tobytes())


class Bench:
    """A loop with the exact body, reporting every tick, under a clock that a test moves."""

    def __init__(self, body: Any = None) -> None:
        self.loop = TickLoop(
            BodyTicks(ExactArm()) if body is None else body, LIMITS, tuple(NOMINAL), tick=TICK, every=1, now=0.0
        )
        self.now = 0.0
        self.news: list[News] = []

    def run(self, until: float) -> None:
        """Every tick on time."""
        while not self.loop.finished and self.loop.next_deadline() <= until + 1e-9:
            self.now = self.loop.next_deadline() + 1e-5
            self.loop.advance(now=self.now)
            self.news += self.loop.take()

    def pause(self, seconds: float) -> int:
        """Nothing for a while; then how many ticks are made good at once."""
        self.now += seconds
        ticks = len(self.measured)
        while not self.loop.finished and self.loop.next_deadline() <= self.now:
            self.loop.advance(now=self.now)
            self.news += self.loop.take()
        return len(self.measured) - ticks

    @property
    def measured(self) -> list[Measurement]:
        return [m for m in self.news if isinstance(m, Measurement)]

    @property
    def faults(self) -> list[Fault]:
        return [m for m in self.news if isinstance(m, Fault)]

    def check(self) -> None:
        """From one tick that was run to the next the reference keeps the limits."""
        q = np.array([NOMINAL, NOMINAL, *(m.q_ref for m in self.measured)])
        qd = np.diff(q, axis=0) / TICK
        assert (np.abs(qd) <= LIMITS.qd_max * (1 + 1e-6)).all()
        assert (np.abs(np.diff(qd, axis=0)) <= LIMITS.qdd_max * TICK * (1 + 1e-6) + 1e-9).all()


def test_it_follows_to_the_bit_and_holds_after_a_rest() -> None:
    bench, timeline = Bench(), motion()
    count = int(timeline.end / TICK) + 2
    reference = sampled(timeline, 1, count)
    for low in range(0, count, 150):
        bench.loop.receive(rows(JointReference(*(part[low : low + 400] for part in reference)), 1 + low))
    bench.run(timeline.end + 1.0)
    assert np.array_equal([m.q for m in bench.measured[:count]], reference.q)
    assert np.array_equal([m.q for m in bench.measured[count:]], np.tile(timeline.final(), (998, 1)))
    assert bench.faults == []
    assert bench.measured[-1].counts.late == 0
    assert bench.measured[-1].counts.ticks == len(bench.measured)
    assert sum(bench.measured[-1].counts.histogram) == len(bench.measured)
    bench.check()


@settings(max_examples=25, deadline=None, phases=QUICK)
@given(st.integers(0, 5), st.integers(1, 2500))
def test_starved_it_brakes_within_the_limits_and_waits_for_an_acknowledgement(seed: int, count: int) -> None:
    bench, timeline = Bench(), motion(seed)
    low = 0
    while low < count:
        bench.loop.receive(rows(sampled(timeline, 1 + low, min(900, count - low)), 1 + low))
        low += 900
    bench.run(TICK * count + 0.8)
    bench.check()
    if not timeline.sample(TICK * count, derivative=1).any():
        assert bench.faults == []
        return
    (fault,) = bench.faults
    assert (fault.kind, fault.tick, fault.number) == (FaultKind.STARVED, count + 1, 1)
    at_rest = next(m for m in bench.measured if m.doing is PhysicsActivity.HOLDING)
    assert at_rest.tick == fault.rest_tick
    assert at_rest.q_ref == fault.rest == bench.measured[-1].q_ref
    speed = np.abs(timeline.sample(TICK * count, derivative=1))
    assert (fault.rest_tick - count) * TICK <= (speed / LIMITS.qdd_max).max() + 2 * TICK
    now = count + 900
    bench.loop.receive(rows(sampled(timeline, 150, 900), now))
    bench.run(TICK * (now + 20))
    assert bench.measured[-1].q_ref == fault.rest
    engine = Engine(MODEL, q=np.array(fault.rest))
    engine.execute(MotionCommand(JointTarget(NOMINAL), None, 0.1, 0.5))
    again = engine.timeline
    bench.loop.receive(rows(sampled(again, 0, 900), now + 50, run=1))
    bench.run(TICK * (now + 500))
    assert bench.measured[-1].doing is PhysicsActivity.FOLLOWING
    assert (
        np.abs(bench.measured[-1].q_ref - again.sample((bench.measured[-1].tick - now - 50) * TICK)).max() < 1e-12
    )
    assert len(bench.faults) == 1
    bench.check()


def test_an_acknowledgement_during_the_stop_counts_when_it_rests() -> None:
    bench = Bench()
    bench.loop.receive(rows(sampled(motion(), 1, 400), 1))
    bench.run(0.41)
    (fault,) = bench.faults
    assert bench.measured[-1].doing is PhysicsActivity.BRAKING
    bench.loop.receive(rows(standing(np.array(fault.rest)), 420, run=1))
    bench.run(2.0)
    assert bench.measured[-1].doing is PhysicsActivity.FOLLOWING
    assert bench.measured[-1].q_ref == fault.rest
    assert len(bench.faults) == 1


@pytest.mark.parametrize("what", ["position", "little", "speed", "late"])
def test_a_jump_is_not_followed(what: str) -> None:
    bench, timeline = Bench(), motion()
    bench.loop.receive(rows(sampled(timeline, 1, 900), 1))
    bench.run(0.4)
    q, qd, qdd = sampled(timeline, 420, 400, late=0.03 if what == "late" else 0.0)
    if what == "position":
        q = q + np.array([0, 0, 1e-3, 0, 0, 0])
    if what == "little":
        q = q + 3.2 * TICK**2 * LIMITS.qdd_max * np.array([0, 1, 0, 0, 0, 0])
    if what == "speed":
        qd = qd + 3.2 * TICK * LIMITS.qdd_max * np.array([0, 0, 0, 1, 0, 0])
    bench.loop.receive(rows(JointReference(q, qd, qdd), 420))
    bench.run(3.0)
    (fault,) = bench.faults
    assert (fault.kind, fault.tick) == (FaultKind.JUMPED, 420)
    assert "joint" in fault.text
    bench.check()
    assert bench.measured[-1].q_ref == fault.rest


def test_rows_that_come_late_count_from_the_present_tick_on() -> None:
    bench, timeline = Bench(), motion()
    bench.loop.receive(rows(sampled(timeline, 1, 900), 1))
    bench.run(0.4)
    bench.loop.receive(rows(sampled(timeline, 350, 900), 350))
    bench.run(1.2)
    assert bench.faults == []
    assert np.array_equal([m.q for m in bench.measured], timeline.sample(TICK * np.arange(1, 1201)))


@settings(max_examples=40, deadline=None, phases=QUICK)
@given(st.integers(0, 50), st.integers(0, 50), st.integers(200, 2500), st.integers(1, 60))
def test_rows_of_another_motion_that_come_late_are_gone_over_to(
    seed: int, other: int, tick: int, late: int
) -> None:
    timeline = motion(seed)
    # One motion until the first of the late rows, then another.
    clock = ManualClock(TICK * (tick - late))
    engine = Engine(MODEL, timeline=timeline, clock=clock)
    target = np.clip(NOMINAL + np.random.default_rng(other).uniform(-0.8, 0.8, 6), LIMITS.q_min, LIMITS.q_max)
    assert (
        engine.execute(MotionCommand(JointTarget(target), insertion=Insertion.REPLACE)).status
        is not Status.REJECTED
    )
    bench = Bench()
    for low in range(0, tick, 900):
        bench.loop.receive(rows(sampled(timeline, 1 + low, 900), 1 + low))
        bench.run(TICK * min(low + 600, tick))
    bench.run(TICK * tick)
    end = int(engine.timeline.end / TICK) + 2
    for low in range(tick - late, max(end, tick) + 2, 900):
        bench.loop.receive(rows(sampled(engine.timeline, low, 901), low))
        bench.run(TICK * max(low + 600, tick))
    bench.run(TICK * (end + 1500))
    bench.check()
    if late > 12:
        assert [fault.kind for fault in bench.faults] in ([], [FaultKind.JUMPED])
        return
    assert bench.faults == []
    assert np.abs(np.array(bench.measured[-1].q_ref) - target).max() < 1e-9


@pytest.mark.parametrize(("seconds", "made_good"), [(0.04, 40), (0.3, 1), (1.0, 1)])
def test_a_short_pause_is_made_good_and_a_long_one_is_no_burst(seconds: float, made_good: int) -> None:
    bench, timeline = Bench(), motion()
    for low in range(0, 4000, 1000):
        bench.loop.receive(rows(sampled(timeline, 1 + low, 1000), 1 + low))
    bench.run(0.4)
    assert abs(bench.pause(seconds) - made_good) <= 1
    bench.run(4.0)
    bench.check()
    counts = bench.measured[-1].counts
    assert counts.worst == pytest.approx(seconds - TICK, abs=2e-3)
    if seconds < PAUSE:
        assert bench.faults == []
        assert (counts.skipped, counts.late) == (0, pytest.approx(made_good, abs=3))
    else:
        (fault,) = bench.faults
        assert fault.kind is FaultKind.PAUSED
        assert counts.skipped == pytest.approx(1000 * seconds, abs=2)
        assert bench.measured[-1].q_ref == fault.rest


def test_a_pause_at_rest_is_no_fault_but_a_motion_missed_in_it_is() -> None:
    bench, timeline = Bench(), motion()
    bench.loop.receive(rows(standing(NOMINAL), 1))
    bench.run(0.2)
    bench.pause(0.5)
    assert bench.faults == []
    start = round(bench.now / TICK) + 100
    bench.loop.receive(rows(sampled(timeline, 1, 1000), start))
    bench.loop.receive(rows(sampled(timeline, 1001, 1000), start + 1000))
    bench.loop.receive(rows(sampled(timeline, 2001, 1000), start + 2000))
    bench.loop.receive(rows(standing(timeline.final()), start + 3000))
    bench.pause(5.0)
    assert [fault.kind for fault in bench.faults] == [FaultKind.JUMPED]
    assert bench.measured[-1].q_ref == tuple(NOMINAL)


@settings(max_examples=20, deadline=None, phases=QUICK)
@given(st.integers(0, 5), st.integers(1, 2500), st.booleans())
def test_without_its_parent_it_brakes_and_ends(seed: int, tick: int, asked: bool) -> None:
    bench, timeline = Bench(), motion(seed)
    for low in range(0, 4000, 1000):
        bench.loop.receive(rows(sampled(timeline, 1 + low, 1000), 1 + low))
    bench.run(TICK * tick)
    if asked:
        bench.loop.receive(Close())
    else:
        bench.loop.leave()
    bench.run(TICK * tick + 2.0)
    assert bench.loop.finished
    assert not bench.loop.failed
    assert not any(bench.measured[-1].qd)
    assert bench.faults == []
    bench.check()
    speed = np.abs(timeline.sample(TICK * tick, derivative=1))
    assert len(bench.measured) - tick <= (speed / LIMITS.qdd_max).max() / TICK + 2


def test_what_makes_no_sense_brings_it_to_rest() -> None:
    good = sampled(motion(), 420, 100)
    wrong = np.array(good.q)
    wrong[50, 2] = np.nan
    fast = np.array(good.qd)
    fast[99, 1] = 1.1 * LIMITS.qd_max[1]
    for message in (
        rows(JointReference(wrong, good.qd, good.qdd), 420),
        rows(JointReference(good.q, fast, good.qdd), 420),
        rows(good, 400 + AHEAD_MOST + 1),
        Rows(0, 420, False, b""),
        Rows(0, 420, False, bytes(143)),
        Rows(0, 420, False, bytes(145)),
        Rows(0, 420, False, bytes(144 * (ROWS_MOST + 1))),
        PhysicsSetup("", IDEAL, True, TICK, 1, 0.0, 1, (), ((), (), (), (), ())),
        Attach(-1.0),
    ):
        bench = Bench(Picky())
        bench.loop.receive(rows(sampled(motion(), 1, 900), 1))
        bench.run(0.4)
        bench.loop.receive(message)
        bench.run(2.0)
        assert [fault.kind for fault in bench.faults] == [FaultKind.REFUSED]
        bench.check()
    with pytest.raises(FormatError):
        decode_order(b"\xc1")
    with pytest.raises(FormatError):
        decode_news(encode(Close()))


class Picky(BodyTicks):
    """A body that minds its loads, and breaks when it's told to."""

    broken = False

    def __init__(self) -> None:
        super().__init__(ExactArm())

    def attach(self, mass: float) -> None:
        if mass <= 0:
            raise InvalidValueError("mass", mass, "positive")

    def step(self, prepared: Any) -> Any:
        if self.broken:
            raise VrsError("the arm fell off")
        return super().step(prepared)


def test_a_body_that_fails_is_told_and_ends_it() -> None:
    body = Picky()
    bench = Bench(body)
    bench.run(0.1)
    body.broken = True
    bench.run(0.2)
    assert [(fault.kind, fault.text) for fault in bench.faults] == [(FaultKind.BODY, "the arm fell off")]
    assert bench.loop.finished
    assert bench.loop.failed


def test_it_may_be_placed_where_it_was_measured_and_nowhere_else() -> None:
    for away, kinds in ((0.04, []), (0.3, [FaultKind.JUMPED])):
        bench = Bench()
        bench.run(0.1)
        bench.loop.receive(rows(standing(NOMINAL + away), 120, placed=True))
        bench.run(0.2)
        assert [fault.kind for fault in bench.faults] == kinds
    bench = Bench()
    bench.run(0.1)
    bench.loop.receive(rows(standing(NOMINAL + 0.04), 120))
    bench.run(0.2)
    assert [fault.kind for fault in bench.faults] == [FaultKind.JUMPED]


def test_it_isn_t_placed_where_the_reference_moves() -> None:
    bench = Bench()
    bench.run(0.1)
    q, qd, qdd = standing(NOMINAL + 0.01)
    bench.loop.receive(rows(JointReference(q, qd + 1e-3, qdd), 120, placed=True))
    bench.run(0.2)
    assert [fault.kind for fault in bench.faults] == [FaultKind.JUMPED]


@pytest.mark.parametrize(("late", "place", "counts"), [
    (0.0, 0, 0), (0.00015, 1, 0), (0.0009, 3, 0), (0.0015, 4, 1), (0.03, 8, 1),
])  # fmt: skip
def test_a_tick_is_counted_by_how_late_it_begins(late: float, place: int, counts: int) -> None:
    bench = Bench()
    bench.loop.advance(now=bench.loop.next_deadline() + late)
    (measured,) = (m for m in bench.loop.take() if isinstance(m, Measurement))
    assert np.flatnonzero(measured.counts.histogram).tolist() == [place]
    assert (measured.counts.ticks, measured.counts.late) == (1, counts)
    assert measured.counts.worst == pytest.approx(late, abs=1e-9)


def late_start(late: int) -> Bench:
    """At rest, rows come whose first are late by so many ticks; more follow in time."""
    bench, timeline = Bench(), motion()
    bench.run(0.4)
    bench.loop.receive(rows(sampled(timeline, 100, 500), 400 - late + 1))
    bench.loop.receive(rows(sampled(timeline, 120, 900), 400 - late + 21))
    bench.run(0.6)
    for low in range(400, int(timeline.end / TICK) + 900, 900):
        bench.loop.receive(rows(sampled(timeline, 100 + low, 900), 400 - late + 1 + low))
    bench.run(timeline.end + 1.0)
    return bench


@pytest.mark.parametrize("late", [3, 10, 60, 299])
def test_a_motion_whose_first_rows_come_late_begins_late_and_is_on_time_after_it(late: int) -> None:
    bench, timeline = late_start(late), motion()
    assert bench.faults == []
    bench.check()
    moved = [m for m in bench.measured if 400 < m.tick <= 1500]
    assert {m.tick - m.followed for m in moved} == {late}
    t = TICK * (np.array([m.followed for m in moved]) - 400 + late + 99)
    assert np.abs(np.array([m.q for m in moved]) - timeline.sample(t)).max() < 1e-9
    assert bench.measured[-1].followed == bench.measured[-1].tick


@pytest.mark.parametrize("late", [5, 60, 250])
def test_rows_that_tell_late_of_a_rest_and_of_the_motion_after_it_are_followed_late(late: int) -> None:
    """The arm went to rest by what it had; then one block tells how it came there, and that it had gone on."""
    bench, engine = Bench(), Engine(MODEL, q=NOMINAL)
    engine.execute(MotionCommand(JointTarget(NOMINAL + 0.1), None, 0.05, 1.0))
    begins = int(engine.timeline.end / TICK) + 30
    bench.loop.receive(rows(sampled(engine.timeline, 1, begins), 1))
    engine.execute(MotionCommand(JointTarget(NOMINAL), None, TICK * begins, 1.0))
    whole = sampled(engine.timeline, 1, begins + 800)
    bench.run(TICK * (begins + late - 1))
    bench.loop.receive(rows(JointReference(*(part[begins - 151 :] for part in whole)), begins - 150))
    bench.run(TICK * (begins + 1000))
    assert bench.faults == []
    bench.check()
    moved = [m for m in bench.measured if begins + late < m.tick <= begins + late + 100]
    assert {m.tick - m.followed for m in moved} == {late}
    followed = np.array([m.followed for m in moved])
    np.testing.assert_allclose([m.q_ref for m in moved], whole.q[followed - 1], rtol=0, atol=1e-9)


def test_a_motion_that_is_too_late_is_a_jump() -> None:
    assert [fault.kind for fault in late_start(330).faults] == [FaultKind.JUMPED]


def test_news_that_nobody_takes_stay_few_and_the_fault_is_among_them() -> None:
    bench = Bench()
    bench.loop.receive(rows(sampled(motion(), 1, 400), 1))
    for k in range(1, 3000):
        bench.loop.advance(now=TICK * k + 1e-5)
    news = bench.loop.take()
    assert len(news) <= 64
    assert [type(n) for n in news if not isinstance(n, Measurement)] == [PhysicsReady, Fault]
