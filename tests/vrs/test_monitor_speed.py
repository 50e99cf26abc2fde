"""Another pace in motion leaves a continuous path what it is, as a program asks for its moves: one ahead."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from robots import puma560
from tests.vrs.test_continuous import HOME, corner, lawful
from vrs import Engine, Insertion, ManualClock, Motion, MotionCommand, Profile, Timeline

MODEL = puma560.model()
CORNERS = (1, 2, 3, 4, 1, 2)


def told(motion: Motion, profile: Profile, changes: list[tuple[float, float]]) -> Engine:
    """Each move is told when the one before begins; at the times of changes [s] the pace becomes another."""
    clock, pace = ManualClock(0.0), 1.0
    engine = Engine(MODEL, q=HOME, clock=clock)
    changes = [*changes, (inf, 1.0)]
    for k in CORNERS:
        how = {"motion": motion, "profile": profile, "insertion": Insertion.APPEND, "deviation": inf, "pace": pace}
        newest = engine.execute(MotionCommand(corner(k), **how)).command_id
        while changes[0][0] <= engine.receipt(newest).execute_at:
            t, new = changes.pop(0)
            clock.advance(t - clock.now())
            assert engine.scale_time(new / pace).stands
            pace = new
        clock.advance(max(engine.receipt(newest).execute_at - clock.now(), 0.0))
    return engine


def astray(timeline: Timeline, path: Timeline) -> float:
    """How far [rad] a motion is from a path at most; both go on along it."""
    s = np.linspace(path.start, path.end, 8001)
    there, low, worst = path.sample(s), 0, 0.0
    for q in timeline.sample(np.linspace(timeline.start, timeline.end, 200)):
        low = max(low - 20, 0)
        low += int(np.abs(there[low : low + 800] - q).max(1).argmin())
        nearest = float(s[low])
        for _ in range(8):
            qd = path.sample(nearest, derivative=1)
            if qd @ qd < 1e-12:
                break
            nearest = float(np.clip(nearest + (q - path.sample(nearest)) @ qd / (qd @ qd), path.start, path.end))
        worst = max(worst, float(np.abs(path.sample(nearest) - q).max()))
    return worst


@pytest.mark.parametrize(("motion", "profile"), [(motion, profile) for motion in Motion for profile in Profile])
def test_the_path_is_what_it_was(motion, profile):
    whole = told(motion, profile, [])
    rng = np.random.default_rng(8)
    for _ in range(3):
        # A faster pace than one that's still being reached may be refused: some time lies between them.
        t = rng.uniform(0.05, 0.2, 3) + np.array([0.0, 0.9, 1.8])
        paces = rng.permutation([0.5, 0.25, 0.8])
        engine = told(motion, profile, list(zip(t.tolist(), paces.tolist(), strict=True)))
        assert engine.timeline.end > whole.timeline.end + 0.2
        assert astray(engine.timeline, whole.timeline) <= 1e-9
        lawful(engine)
    other = told(motion, profile, [])
    other.cancel(other.newest)
    assert astray(whole.timeline, other.timeline) > 1e-3
