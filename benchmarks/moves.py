"""Timelines of random joint moves of the PUMA 560, half of them parabolic, half jerk-limited."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robots import puma560
from vrs import Engine, Insertion, JointTarget, MotionCommand, Profile, Timeline, planning
from vrs.model import Array
from vrs.segment import Piece, State

MODEL = puma560.model()
LIMITS = MODEL.limits
STILL = np.zeros(LIMITS.dof)
PROFILES = (Profile.PARABOLIC, Profile.JERK_LIMITED)


def targets(rng: np.random.Generator) -> Iterator[Array]:
    """Yield random joint positions within the limits."""
    while True:
        yield rng.uniform(LIMITS.q_min, LIMITS.q_max)


def appended(count: int, seed: int = 0) -> tuple[Engine, list[MotionCommand]]:
    """An engine with at least so many segments, and the commands that made them."""
    engine, commands = Engine(MODEL), []
    for k, q in enumerate(targets(np.random.default_rng(seed))):
        command = MotionCommand(JointTarget(q), insertion=Insertion.APPEND, profile=PROFILES[k % 2])
        engine.execute(command)
        commands.append(command)
        if len(engine.timeline) >= count:
            break
    return engine, commands


def cycle(moves: int = 1000, seed: int = 1) -> list[Piece]:
    """Moves that lead back to where they began."""
    begin = MODEL.poses["nominal"]
    rng = np.random.default_rng(seed)
    q, pieces = begin, []
    for k in range(moves):
        goal = begin if k == moves - 1 else next(targets(rng))
        plan, _ = planning.move(State(q, STILL, STILL), goal, 1.0, PROFILES[k % 2], LIMITS)
        pieces.append(Piece(plan.durations.tolist(), list(plan.coefficients), k + 1))
        q = goal
    return pieces


def repeated(count: int, pieces: list[Piece]) -> Timeline:
    """A timeline of exactly so many segments: a cycle of moves again and again, appended move by move."""
    timeline = Timeline(MODEL.poses["nominal"])
    made = 0
    while made < count:
        for piece in pieces:
            part = Piece(piece.durations[: count - made], piece.coefficients[: count - made], piece.command_id)
            timeline = timeline.edited(timeline.end, [part])
            made += len(part.durations)
            if made >= count:
                break
    return timeline


def knots(timeline: Timeline) -> Array:
    """Starts of the segments, and the end [s], (m + 1,)."""
    return np.array([timeline.start_of(i) for i in range(len(timeline) + 1)])
