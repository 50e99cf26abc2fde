"""Play under jitter: never beyond what is complete, within the limits, without a burst."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from robots import puma560
from robots.onboard.playout import Playout, PlayoutConfig, PlayState
from vrs import Engine, Insertion, JointTarget, MotionCommand, Profile, SteerCommand, Timeline
from vrs.errors import InvalidValueError
from vrs.model import Array

MODEL = puma560.model()
LIMITS = MODEL.limits
GRID = 0.005


@cache
def plan(seed: int, profile: Profile = Profile.PARABOLIC) -> Timeline:
    """Moves of all kinds, one into the other, and steering."""
    rng = np.random.default_rng(seed)
    engine, t = Engine(MODEL, q=MODEL.poses["nominal"]), 0.3
    for _ in range(8):
        q = np.clip(MODEL.poses["nominal"] + rng.uniform(-1, 1, 6), LIMITS.q_min, LIMITS.q_max)
        speed = float(rng.choice([0.3, 0.8, 1.0]))
        engine.execute(MotionCommand(JointTarget(q), None, t, speed, profile=profile, insertion=Insertion.SPLICE))
        t += float(rng.exponential(1.0))
    if seed % 2:
        engine.execute(SteerCommand(rates=0.5 * LIMITS.qd_max * rng.uniform(-1, 1, 6), execute_at=t))
    return engine.timeline


def spaced() -> Timeline:
    """Moves with rests between them."""
    engine = Engine(MODEL, q=MODEL.poses["nominal"])
    for k in range(6):
        q = MODEL.poses["nominal"] + 0.3 * np.array([1, -1, 0.5, 1, -1, 1]) * (-1) ** k
        engine.execute(MotionCommand(JointTarget(q), None, 6.0 + 4.0 * k, 0.8))
    return engine.timeline


class Run:
    """A playout fed with messages that say c = sent at given arrivals, and where it was at each tick.

    The driver comes late to its deadlines by the given times [s], in turn.
    """

    def __init__(
        self, timeline: Timeline, sent: Array, arrived: Array, offset: float, late: Sequence[float] = (0.0,),
        **options: object,
    ) -> None:  # fmt: skip
        self.timeline = timeline
        self.playout = Playout(timeline, LIMITS, now=0.0, p=offset, **options)  # type: ignore[arg-type]
        self.playout.aim(offset, now=0.0)
        states: list[PlayState] = []
        self.over = -np.inf
        grid, k, message, now = np.arange(0.0, arrived[-1] + 40.0, GRID), 0, 0, 0.0
        turns = 0
        while now < grid[-1]:
            due = self.playout.next_deadline()
            coming = float(arrived[message]) if message < len(arrived) else np.inf
            turns += 1
            wanted = np.inf if due is None else due + late[turns % len(late)]
            now = max(now, min(wanted, coming, float(grid[-1])))
            high = max(int(np.searchsorted(grid, now - (0.01 if any(late) else 0.0))), k)
            if high > k:
                state = self.playout.foreseen(grid[k:high])
                self.over = max(self.over, float((state.p - self.playout.complete_until).max()))
                states.append(state)
                k = high
            if coming <= now:
                self.playout.hear(float(sent[message]), timeline, now=now)
                message += 1
            else:
                self.playout.advance(now=now)
        self.t = grid[:k]
        self.p, self.pace, self.rate = (np.concatenate([s[i] for s in states]) for i in range(3))

    def check(self) -> None:
        """The laws: complete, within the limits, no burst, the whole of the plan in the end."""
        timeline, pace, rate = self.timeline, self.pace[:, None], self.rate[:, None]
        qd, qdd = timeline.sample(self.p, derivative=1), timeline.sample(self.p, derivative=2)
        assert self.over <= 1e-9
        assert (np.abs(qd * pace) <= LIMITS.qd_max * (1 + 1e-9)).all()
        assert (np.abs(qdd * pace**2 + qd * rate) <= LIMITS.qdd_max * (1 + 1e-9)).all()
        steps = np.diff(self.p)
        assert steps.min() >= 0.0
        assert steps.max() <= 1.05 * GRID + 1e-12
        velocity = np.abs(np.diff(qd * pace, axis=0))
        assert (velocity <= LIMITS.qdd_max * GRID * (1 + 1e-6) + 1e-9).all()
        assert self.p[-1] > timeline.end


@settings(max_examples=15, deadline=None, phases=(Phase.explicit, Phase.reuse, Phase.generate))
@given(
    st.integers(0, 10), st.lists(st.floats(0.0, 2.0), min_size=5, max_size=30), st.floats(0.5, 8.0),
    st.floats(0.02, 3.0),
)  # fmt: skip
def test_who_stood_still_finds_what_was_foreseen(
    seed: int, delays: list[float], stands_at: float, still: float
) -> None:
    timeline = plan(seed)
    sent, arrived = messages(timeline, np.array(delays), 0.05)
    playout = Playout(timeline, LIMITS, now=0.0, p=-1.0)
    playout.aim(-1.0, now=0.0)
    for c, now in zip(sent, arrived, strict=True):
        if now > stands_at:
            break
        while (due := playout.next_deadline()) is not None and due <= now:
            playout.advance(now=due)
        playout.hear(float(c), timeline, now=float(now))
    while (due := playout.next_deadline()) is not None and due <= stands_at:
        playout.advance(now=due)
    t = stands_at + 0.001 * np.arange(-200, 4000)
    before = len(playout.stretches), playout.next_deadline(), playout.at(t[:200])
    parts = [playout.foreseen(t[k : k + 500]) for k in range(0, len(t), 500)]
    whole = playout.foreseen(t)
    after = len(playout.stretches), playout.next_deadline(), playout.at(t[:200])
    assert before[:2] == after[:2]
    assert all(map(np.array_equal, before[2], after[2]))
    for column, part in zip(whole, zip(*parts, strict=True), strict=True):
        assert np.array_equal(column, np.concatenate(part))
    pace, rate = whole.pace[:, None], whole.rate[:, None]
    qd, qdd = timeline.sample(whole.p, derivative=1), timeline.sample(whole.p, derivative=2)
    assert whole.p.max() <= playout.complete_until + 1e-9
    assert (np.abs(qdd * pace**2 + qd * rate) <= LIMITS.qdd_max * (1 + 1e-9)).all()
    assert (np.abs(np.diff(qd * pace, axis=0)) <= LIMITS.qdd_max * 0.001 * (1 + 1e-6) + 1e-9).all()
    assert not (qd * pace)[-1].any()
    playout.advance(now=stands_at + still)
    over = t < stands_at + still - 0.01
    for column, found in zip(whole, playout.at(t[over]), strict=True):
        assert np.array_equal(column[over], found)
    assert len(playout.foreseen(t[:0]).p) == 0


@settings(max_examples=15, deadline=None, phases=(Phase.explicit, Phase.reuse, Phase.generate))
@given(
    st.integers(0, 10), st.lists(st.floats(0.0, 1.0), min_size=5, max_size=30),
    st.lists(st.floats(0.0, 0.6), min_size=3, max_size=20),
)  # fmt: skip
def test_a_driver_that_is_often_late_keeps_the_laws(seed: int, delays: list[float], late: list[float]) -> None:
    timeline = plan(seed)
    Run(timeline, *messages(timeline, np.array(delays), 0.05), -1.0, late=late).check()


def messages(timeline: Timeline, delays: Array, beat: float) -> tuple[Array, Array]:
    sent = -0.5 + beat * np.arange(int((timeline.end + 2.0) / beat))
    return sent, np.maximum.accumulate(sent + 0.5 + np.resize(delays, len(sent)))


@settings(max_examples=20, deadline=None, phases=(Phase.explicit, Phase.reuse, Phase.generate))
@given(
    st.integers(0, 30), st.lists(st.floats(0.0, 3.0), min_size=5, max_size=60), st.sampled_from([0.02, 0.05, 0.3]),
    st.floats(-2.0, 0.0), st.sampled_from(list(Profile)),
)  # fmt: skip
def test_any_schedule_of_delays_keeps_the_laws(
    seed: int, delays: list[float], beat: float, offset: float, profile: Profile
) -> None:
    timeline = plan(seed, profile)
    Run(timeline, *messages(timeline, np.array(delays), beat), offset - 0.5).check()


def test_steady_messages_are_played_at_an_even_pace() -> None:
    timeline = spaced()
    run = Run(timeline, *messages(timeline, np.array([0.2]), 0.05), -1.5)
    run.check()
    moving = (run.p > 6.0) & (run.p < timeline.end)
    assert (run.pace[moving] == 1.0).all()
    assert not run.playout.stretches


def test_starved_it_slows_down_along_the_way_and_goes_on_at_the_same_place() -> None:
    timeline = plan(2)
    delays = np.full(int((timeline.end + 3.0) / 0.05), 0.2)
    delays[30:] += 3.0
    run = Run(timeline, *messages(timeline, delays, 0.05), -1.0)
    run.check()
    assert run.playout.stretches
    stretch = run.playout.stretches[0]
    assert stretch.end > stretch.begin
    late = run.t - run.p
    assert late.max() > 3.0
    assert (run.pace == 0.0).any()


def test_delay_that_went_away_is_made_good_slowly() -> None:
    timeline = spaced()
    delays = np.full(int((timeline.end + 3.0) / 0.05), 2.0)
    delays[120:] = 0.1
    run = Run(timeline, *messages(timeline, delays, 0.05), -1.0)
    run.check()
    late = (run.t - run.p)[run.p < timeline.end]
    assert late[-1] < late.max() - 0.2


def test_jerk_limited_moves_are_slowed_down_smoothly() -> None:
    stretched = 0
    for seed in (6, 8, 10):
        timeline = plan(seed, Profile.JERK_LIMITED)
        delays = np.full(int((timeline.end + 3.0) / 0.05), 0.2)
        delays[25:] += 2.0
        run = Run(timeline, *messages(timeline, delays, 0.05), -1.0, smooth=lambda _: True)
        run.check()
        stretched += len(run.playout.stretches)
        qd, qdd = (timeline.sample(run.p, derivative=k) for k in (1, 2))
        pace, rate = run.pace[:, None], run.rate[:, None]
        moving = np.abs(qd).max(1) > 0
        jump = np.abs(np.diff(qdd * pace**2 + qd * rate, axis=0))[moving[1:] & moving[:-1]]
        assert (jump <= LIMITS.qddd_max * GRID * 1.01 + 1e-6).all()
    assert stretched


def test_rejects_what_makes_no_sense() -> None:
    with pytest.raises(InvalidValueError, match="slew"):
        PlayoutConfig(slew=0.5)
    with pytest.raises(InvalidValueError, match="buffer"):
        PlayoutConfig(buffer=float("nan"))


def test_in_mid_motion_it_goes_on_only_with_enough_ahead() -> None:
    """Else each message would let it start and stop again."""
    engine = Engine(MODEL, q=MODEL.poses["nominal"])
    engine.execute(MotionCommand(JointTarget(MODEL.poses["ready"]), None, 0.5, 0.2))
    playout = Playout(engine.timeline, LIMITS, now=0.0, p=0.0, config=PlayoutConfig(buffer=1.5))
    playout.aim(0.0, now=0.0)

    def hear(complete: float, now: float, until: float) -> float:
        playout.hear(complete, engine.timeline, now=now)
        while (due := playout.next_deadline()) is not None and due <= until:
            playout.advance(now=due)
        return float(playout.at(np.array([until])).p[0])

    stood = hear(2.0, 0.0, 4.0)
    assert 1.5 < stood <= 2.0
    assert hear(stood + 1.4, 4.0, 6.0) == stood
    assert hear(stood + 1.6, 6.0, 8.0) > stood + 0.5
