"""The laws of an edit, on 100,000 random ones: an independent look at every timeline that the engine makes."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import perm

import numpy as np
import pytest

from robots import puma560
from vrs import (
    Engine,
    Insertion,
    JointTarget,
    Lateness,
    ManualClock,
    MotionCommand,
    Profile,
    Receipt,
    Status,
    Timeline,
)
from vrs.notes import NoteCode

MODEL = puma560.model()
LIMITS = MODEL.limits
SHARDS, EDITS, SESSION = 50, 2000, 40
QUICK = 15
"""Of them, how many `make test` runs."""


@dataclass
class Extremes:
    """The worst that was seen."""

    figures: dict[str, float] = field(default_factory=dict)

    def see(self, name: str, value: float) -> None:
        self.figures[name] = max(self.figures.get(name, 0.0), float(value))


def padded(segments: list) -> tuple[np.ndarray, np.ndarray]:
    a = np.zeros((len(segments), 4, 6))
    for row, segment in zip(a, segments, strict=True):
        row[: len(segment.coefficients)] = segment.coefficients
    return a, np.array([segment.duration for segment in segments])


def values(a: np.ndarray, u: np.ndarray, order: int) -> np.ndarray:
    total = np.zeros_like(a[:, 0])
    for k in range(3, order - 1, -1):
        total = total * u + perm(k, order) * a[:, k]
    return total


def check_limits(a: np.ndarray, h: np.ndarray, jerk_limited: np.ndarray, worst: Extremes) -> None:
    """Extremes of every polynomial, by the textbook's roots and apart from the engine's own certificate."""
    u = h[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = -a[:, 2] / (3 * a[:, 3])
        spread = np.sqrt(4 * a[:, 2] ** 2 - 12 * a[:, 3] * a[:, 1])
        turns = [(-2 * a[:, 2] + sign * spread) / (6 * a[:, 3]) for sign in (1, -1)]
        turns.append(-a[:, 1] / (2 * a[:, 2]))
    grid = [np.full_like(a[:, 0], share) * u for share in (0.0, 0.2, 0.5, 0.8, 1.0)]
    m = np.array([*turns, vertex, *grid])
    m = np.clip(np.where(np.isfinite(m), m, 0), 0, u)
    a0, a1, a2, a3 = (a[:, k] for k in range(4))
    q = a0 + m * (a1 + m * (a2 + m * a3))
    qd = a1 + m * (2 * a2 + 3 * m * a3)
    qdd = 2 * a2 + 6 * m * a3
    worst.see("position", ((q - LIMITS.q_max) / np.maximum(1, np.abs(LIMITS.q_max))).max())
    worst.see("position", ((LIMITS.q_min - q) / np.maximum(1, np.abs(LIMITS.q_min))).max())
    worst.see("speed", (np.abs(qd) / LIMITS.qd_max).max() - 1)
    worst.see("acceleration", (np.abs(qdd) / LIMITS.qdd_max).max() - 1)
    if jerk_limited.any():
        worst.see("jerk", (np.abs(6 * a[jerk_limited, 3]) / LIMITS.qddd_max).max() - 1)


def check_edit(old: Timeline, new: Timeline, r: Receipt, command: MotionCommand, worst: Extremes) -> None:
    t = r.execute_at
    assert t is not None
    assert r.end is not None
    # The past, to the bit.
    # Ends are sums of durations: a plan that nothing was added to may end an ulp after the cut.
    low = new.index_at(t) if t < new.end - 1e-9 else len(new)
    for i in range(max(low - 4, 0), low):
        mine, before = new.segment(i), old.segment(i) if i < len(old) else None
        if before is None:
            assert mine.command_id is None, "only a hold can fill the way to an append"
            continue
        assert mine.start == before.start
        assert np.array_equal(mine.coefficients, before.coefficients)
        assert mine.duration == before.duration or abs(mine.end - t) <= 1e-9 * max(1, t)
    # The tail, to the bit, behind the new segments.
    ours = [i for i in range(low, len(new)) if new.owner_of(i) == r.command_id]
    high = (ours[-1] + 1) if ours else low
    tail = len(new) - high
    kept = 0
    while kept < tail and kept < len(old):
        mine, before = new.segment(len(new) - 1 - kept), old.segment(len(old) - 1 - kept)
        if mine.command_id is None and kept == tail - 1:
            break
        assert np.array_equal(mine.coefficients, before.coefficients)
        assert mine.duration == before.duration
        assert mine.command_id == before.command_id
        assert abs(mine.start - before.start - r.shift) <= 1e-9
        kept += 1
    if tail:
        assert r.shift >= 0
    # Continuity and limits around everything that is new.
    segments = [new.segment(i) for i in range(max(low - 1, 0), min(high + 2, len(new)))]
    if segments:
        a, h = padded(segments)
        ends = h[:-1, None]
        for order, name in ((0, "jump q"), (1, "jump qd")):
            jump = np.abs(values(a[:-1], ends, order) - values(a[1:], np.zeros_like(ends), order))
            worst.see(name, jump.max(initial=0))
        gaps = [abs(x.end - y.start) for x, y in pairwise(segments)]
        worst.see("gap", max(gaps, default=0))
        mine = np.array([s.command_id == r.command_id for s in segments])
        smooth = command.profile is Profile.JERK_LIMITED and NoteCode.BRAKED_FIRST.value not in r.reason
        smooth = smooth and "parabolas" not in r.reason
        if smooth:
            # From the second of our segments to the last of them, and where the past left off smoothly.
            inner = mine[:-1] & mine[1:]
            bend = np.abs(values(a[:-1], ends, 2) - values(a[1:], np.zeros_like(ends), 2))
            worst.see("jump qdd", bend[inner].max(initial=0))
        check_limits(a, h, mine & smooth, worst)
    # The receipt.
    worst.see("arrival", np.abs(new.sample(r.end) - r.q).max())
    worst.see("rest", np.abs(new.sample(max(r.end - 1e-12, t), derivative=1)).max() if r.end > t + 1e-9 else 0)
    assert np.array_equal(r.q, command.target.q)
    assert not new.sample(new.end, derivative=1).any()


def draw_target(rng: np.random.Generator, present: np.ndarray) -> np.ndarray:
    kind = rng.integers(6)
    q = rng.uniform(LIMITS.q_min, LIMITS.q_max)
    if kind == 0:
        return np.where(rng.random(6) < 0.5, LIMITS.q_min, LIMITS.q_max)
    if kind == 1:
        return np.where(rng.random(6) < 0.5, present, q)
    if kind == 2:
        return np.clip(present + rng.normal(0, 10.0 ** -rng.integers(0, 8), 6), LIMITS.q_min, LIMITS.q_max)
    if kind == 3:
        edge = np.where(rng.random(6) < 0.5, LIMITS.q_min, LIMITS.q_max)
        return np.clip(edge + rng.normal(0, 1e-6, 6), LIMITS.q_min, LIMITS.q_max)
    return q


def draw_time(rng: np.random.Generator, timeline: Timeline, now: float, last: float) -> float:
    span = max(timeline.end - now, 0.5)
    knot = timeline.start_of(int(rng.integers(max(len(timeline) - 12, 0), len(timeline)))) if len(timeline) else now
    choices = (
        now + span * rng.random(),
        now + rng.exponential(0.3),
        timeline.end + rng.exponential(0.5),
        timeline.end,
        knot,
        knot + 1e-9,
        last,
        last + 1e-9,
        last - 1e-9,
        now - rng.exponential(0.2),
    )
    return float(choices[rng.integers(len(choices))])


def check_session(engine: Engine, worst: Extremes) -> None:
    """Every standing receipt is true, and the plan is whole."""
    timeline = engine.timeline
    for r in engine.receipts:
        if r.status is Status.REJECTED or r.superseded_by is not None:
            continue
        worst.see("standing", np.abs(timeline.sample(r.end) - r.q).max())
    a, h = padded(list(timeline.segments))
    if len(a) > 1:
        ends = h[:-1, None]
        for order, name in ((0, "jump q"), (1, "jump qd")):
            worst.see(name, np.abs(values(a[:-1], ends, order) - values(a[1:], 0 * ends, order)).max())


@pytest.mark.parametrize(
    "shard", [*range(QUICK), *(pytest.param(shard, marks=pytest.mark.slow) for shard in range(QUICK, SHARDS))]
)
def test_laws_hold_on_random_edits(shard: int) -> None:
    rng = np.random.default_rng([560, shard])
    worst = Extremes()
    statuses = dict.fromkeys(Status, 0)
    done = 0
    while done < EDITS:
        clock = ManualClock(float(rng.choice([0.0, 1e3]))) if rng.random() < 0.5 else None
        policy = Lateness.REJECT if rng.random() < 0.2 else Lateness.POSTPONE
        engine = Engine(MODEL, q=rng.uniform(LIMITS.q_min, LIMITS.q_max), clock=clock, lateness=policy)
        last = engine.timeline.end
        for _ in range(SESSION):
            now = clock.now() if clock else float(engine.timeline.start)
            t = draw_time(rng, engine.timeline, now, last)
            if clock is None:
                t = max(t, 0.0)
            command = MotionCommand(
                JointTarget(draw_target(rng, engine.timeline.sample(t))),
                issued_at=min(now, t) if rng.random() < 0.95 else now,
                execute_at=t,
                speed=float(rng.choice([1.0, rng.uniform(0.05, 1.0), 0.01])),
                profile=Profile.JERK_LIMITED if rng.random() < 0.5 else Profile.PARABOLIC,
                insertion=rng.choice([Insertion.SPLICE, Insertion.SPLICE, Insertion.APPEND, Insertion.REPLACE]),
            )
            before = engine.timeline
            r = engine.execute(command)
            statuses[r.status] += 1
            if r.status is Status.REJECTED:
                assert engine.timeline is before
                assert r.reason
            else:
                last = r.execute_at
                if r.status is Status.ACCEPTED:
                    assert r.execute_at == t
                assert clock is None or r.execute_at >= now
                check_edit(before, engine.timeline, r, command, worst)
            if clock is not None:
                clock.advance(float(rng.exponential(0.3)))
            done += 1
        check_session(engine, worst)
    bounds = {
        "jump q": 1e-9, "jump qd": 1e-9, "jump qdd": 1e-9, "position": 1e-9, "speed": 1e-9, "acceleration": 1e-9,
        "jerk": 1e-9, "arrival": 1e-9, "standing": 1e-9, "rest": 1e-6, "gap": 1e-9,
    }  # fmt: skip
    passed = {name: value for name, value in worst.figures.items() if value > bounds[name]}
    assert not passed, passed
    assert statuses[Status.ACCEPTED] > EDITS / 3
    assert statuses[Status.POSTPONED] > 10
    assert statuses[Status.REJECTED] > 0
