"""References for the body: motions of the Puma, sampled at its ticks."""

from __future__ import annotations

from functools import cache

import numpy as np

import robots
from interfaces.teleop import JointReference
from vrs import Engine, Insertion, JointTarget, MotionCommand, Timeline
from vrs.model import Array

ROBOT = robots.load("puma560")
MODEL = ROBOT.arm
LIMITS = MODEL.limits
NOMINAL = np.array(MODEL.poses["nominal"])
TICK = 0.001


@cache
def motion(seed: int = 0) -> Timeline:
    """Moves one into the other, from 0.1 s on."""
    rng, engine = np.random.default_rng(seed), Engine(MODEL, q=NOMINAL)
    for k in range(6):
        q = np.clip(NOMINAL + rng.uniform(-0.8, 0.8, 6), LIMITS.q_min, LIMITS.q_max)
        engine.execute(MotionCommand(JointTarget(q), None, 0.1 + 0.5 * k, 1.0, insertion=Insertion.SPLICE))
    return engine.timeline


def sampled(timeline: Timeline, first: int, count: int, late: float = 0.0) -> JointReference:
    """References for ticks from the first on."""
    t = TICK * np.arange(first, first + count) - late
    return JointReference(*(timeline.sample(t, derivative=k) for k in range(3)))


def standing(q: Array, count: int = 1) -> JointReference:
    return JointReference(np.tile(q, (count, 1)), np.zeros((count, 6)), np.zeros((count, 6)))
