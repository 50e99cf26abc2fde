from __future__ import annotations

import math

import numpy as np
import pytest

from robots import puma560
from robots.onboard.servo import StopMotion, from_commanded, from_measured
from vrs import Engine, JointTarget, ManualClock, Motion, MotionCommand, PoseTarget, Profile, SteerCommand, Timeline
from vrs.errors import InvalidValueError

MODEL = puma560.model()
LIMITS = MODEL.limits
Q = MODEL.poses["nominal"]
DENSE = 4000


def busy(profile: Profile, seed: int) -> Timeline:
    """Moves, a redirection in motion, a line, a hold and steering."""
    rng = np.random.default_rng(seed)
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=Q, clock=clock)
    for at in (0.1, 0.7, 3.0):
        q = Q + rng.uniform(-0.5, 0.5, 6)
        engine.execute(MotionCommand(JointTarget(q), execute_at=at, profile=profile))
    X = np.array(MODEL.forward(engine.joints(engine.timeline.end)))
    X[:3, 3] += rng.uniform(-0.05, 0.05, 3)
    engine.execute(
        MotionCommand(PoseTarget(X), motion=Motion.LINE, execute_at=engine.timeline.end, profile=profile)
    )
    clock.set(engine.timeline.end + 0.2)
    for _ in range(5):
        engine.execute(SteerCommand(rates=rng.uniform(-0.4, 0.4, 6), execute_at=clock.now()))
        clock.advance(0.02)
    return engine.timeline


def check(stop: StopMotion, before: Timeline | None) -> None:
    """No jump of position or speed, every limit kept, and rest at the end."""
    t = np.linspace(stop.begin, max(stop.end, stop.begin + 1e-3), DENSE)
    q, qd, qdd = (stop.timeline.sample(t, derivative=d) for d in range(3))
    dt = t[1] - t[0]
    assert (np.abs(qd) <= LIMITS.qd_max * (1 + 1e-9)).all()
    assert (np.abs(qdd) <= LIMITS.qdd_max * (1 + 1e-9)).all()
    assert (np.abs(np.diff(q, axis=0)) <= LIMITS.qd_max * dt * (1 + 1e-6) + 1e-12).all()
    assert (np.abs(np.diff(qd, axis=0)) <= LIMITS.qdd_max * dt * (1 + 1e-6) + 1e-12).all()
    assert not stop.timeline.sample(stop.end + np.arange(3.0), derivative=1).any()
    if before is not None:
        was = before.state_before(stop.begin)
        assert np.abs(q[0] - was.q).max() <= 1e-12
        assert np.abs(qd[0] - was.qd).max() <= 1e-9
        assert (q >= LIMITS.q_min - 1e-9).all()
        assert (q <= LIMITS.q_max + 1e-9).all()


@pytest.mark.parametrize("profile", Profile)
@pytest.mark.parametrize("keep_path", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_a_stop_at_any_instant_keeps_the_limits(profile: Profile, keep_path: bool, seed: int) -> None:
    timeline = busy(profile, seed)
    slowest = (LIMITS.qd_max / LIMITS.qdd_max).max()
    for t in np.random.default_rng(seed).uniform(-0.5, timeline.end + 0.5, 20):
        stop = from_commanded(timeline, float(t), LIMITS, profile, keep_path=keep_path)
        check(stop, timeline)
        assert stop.begin == t
        assert np.abs(stop.timeline.sample(stop.end) - stop.rest).max() <= 1e-9
        assert stop.end <= t + 4 * slowest + 0.2
        past = np.linspace(-0.5, t, 50)
        np.testing.assert_array_equal(stop.timeline.sample(past[:-1]), timeline.sample(past[:-1]))


def test_on_its_path_the_arm_goes_nowhere_else() -> None:
    timeline = busy(Profile.PARABOLIC, 1)
    stop = from_commanded(timeline, 0.5, LIMITS)
    assert stop.on_path
    path = timeline.sample(np.linspace(0.5, 3.0, 20_000))
    for q in stop.timeline.sample(np.linspace(0.5, stop.end, 30)):
        assert np.abs(path - q).max(axis=1).min() < 2e-4
    assert not from_commanded(timeline, 0.5, LIMITS, keep_path=False).on_path


def test_a_stop_at_rest_drops_the_future() -> None:
    timeline = busy(Profile.PARABOLIC, 2)
    stop = from_commanded(timeline, 0.05, LIMITS)
    assert stop.begin == stop.end == 0.05
    np.testing.assert_array_equal(stop.timeline.sample(np.linspace(0, 9, 50)), np.tile(Q, (50, 1)))


def test_from_the_measured_state_the_command_begins_where_the_robot_is() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        q, qd = rng.uniform(LIMITS.q_min, LIMITS.q_max), rng.uniform(-1, 1, 6) * LIMITS.qd_max
        stop = from_measured(2.0, q, qd, LIMITS)
        wide = stop.timeline.sample(np.linspace(2.0, stop.end, 200))
        np.testing.assert_array_equal(wide[0], q)
        check(stop, None)
        np.testing.assert_allclose(stop.timeline.sample(2.0, derivative=1), qd, atol=1e-12)
        assert np.abs(stop.timeline.sample(stop.end) - stop.rest).max() <= 1e-12
        Engine(MODEL, q=stop.rest, clock=ManualClock(9.0))


def test_a_measured_speed_that_no_joint_has_doesnt_swing_the_arm_round() -> None:
    stop = from_measured(0.0, Q, [0, 0, 0, 34.5, -31.2, 0], LIMITS)
    check(stop, None)
    assert stop.end <= 0.25 + 1e-9


def test_a_joint_a_count_outside_its_limit_comes_back() -> None:
    q = np.array(Q)
    q[1] = LIMITS.q_max[1] + 1e-4
    stop = from_measured(0.0, q, np.zeros(6), LIMITS)
    check(stop, None)
    assert LIMITS.q_max[1] - 1e-12 <= stop.rest[1] <= LIMITS.q_max[1]
    assert np.abs(stop.timeline.sample(stop.end) - stop.rest).max() <= 1e-12
    np.testing.assert_array_equal(np.delete(stop.rest, 1), np.delete(Q, 1))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_robot_without_sensors_isnt_stopped_by_numbers(bad: float) -> None:
    for q, qd in (([bad] * 6, [0] * 6), (Q, [bad] * 6)):
        with pytest.raises(InvalidValueError):
            from_measured(0.0, q, qd, LIMITS)
    with pytest.raises(InvalidValueError):
        from_commanded(Timeline(Q), bad, LIMITS)
