"""A plan of three moves to be edited, and what holds of every edited plan."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from robots import puma560
from vrs import Engine, Insertion, JointTarget, Lateness, MotionCommand, Profile

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
