"""Re-anchoring: a timeline goes over into the true one within the limits, and its past stays."""

from __future__ import annotations

import numpy as np
import pytest

from robots import puma560
from tests.vrs.laws import Figures, check_run, columns
from vrs import Engine, JointTarget, ManualClock, MotionCommand, Status, Timeline
from vrs.anchoring import anchored
from vrs.errors import InvalidValueError

MODEL = puma560.model()
LIMITS = MODEL.limits
NOMINAL = MODEL.poses["nominal"]


def plan(seed: int, moves: int = 6) -> Timeline:
    rng = np.random.default_rng(seed)
    engine, t = Engine(MODEL, q=NOMINAL + rng.uniform(-0.3, 0.3, 6)), 0.3
    for _ in range(moves):
        q = np.clip(NOMINAL + rng.uniform(-1, 1, 6), LIMITS.q_min, LIMITS.q_max)
        engine.execute(MotionCommand(JointTarget(q), None, t, float(rng.choice([0.3, 0.8, 1.0]))))
        t += float(rng.exponential(1.0))
    return engine.timeline


def test_any_timeline_goes_over_into_any_other_within_the_limits() -> None:
    figures = Figures()
    for seed in range(60):
        mine, truth = plan(2 * seed), plan(2 * seed + 1)
        t = float(np.random.default_rng(seed).uniform(-0.2, 7.0))
        made = anchored(mine, truth, t, LIMITS)
        run = columns(made.timeline)
        check_run(run, max(run.index_at(t) - 1, 0), len(run), LIMITS, set(), figures)
        after, before = made.end + np.array([1e-6, 0.5, 3.0]), t - np.array([1e-6, 0.1, 1.0])
        assert np.abs(made.timeline.sample(after) - truth.sample(after)).max() < 1e-12
        assert np.array_equal(made.timeline.sample(before), mine.sample(before))
        assert made.end - t < 20.0
        assert made.error == pytest.approx(mine.sample(t) - truth.sample(t))


def test_a_timeline_that_is_the_true_one_already_stays_what_it_is() -> None:
    mine = plan(3)
    made = anchored(mine, mine, 1.0, LIMITS)
    t = np.linspace(-1.0, mine.end + 1.0, 500)
    assert np.abs(made.timeline.sample(t) - mine.sample(t)).max() < 1e-12
    assert made.end == pytest.approx(1.0)


def test_receipts_follow_and_commands_can_be_edited_afterwards() -> None:
    clock = ManualClock()
    engine = Engine(MODEL, q=NOMINAL, clock=clock)
    first = engine.execute(MotionCommand(JointTarget(NOMINAL + 0.4), None, 0.5, 0.5))
    second = engine.execute(MotionCommand(JointTarget(NOMINAL - 0.4), None, 3.0, 0.5))
    third = engine.execute(MotionCommand(JointTarget(NOMINAL + 0.1), None, 6.0, 0.5))
    real = Engine(MODEL, q=NOMINAL + 0.01, clock=ManualClock())
    real.execute(MotionCommand(JointTarget(NOMINAL + 0.4), None, 1.5, 0.5))
    late = real.execute(MotionCommand(JointTarget(NOMINAL - 0.4), None, 4.0, 0.5))
    clock.set(2.0)
    made = engine.anchor(real.timeline)
    assert engine.timeline is made.timeline
    assert engine.receipt(first.command_id).stands
    assert engine.receipt(second.command_id).execute_at == pytest.approx(late.execute_at)
    assert not engine.receipt(third.command_id).stands
    assert engine.undo() is None
    assert engine.cancel(second.command_id).undone
    assert engine.execute(MotionCommand(JointTarget(NOMINAL))).status is Status.ACCEPTED


def test_another_robot_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="6 joints"):
        anchored(plan(1), Timeline(np.zeros(3)), 0.0, LIMITS)
