from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import puma560
from robots.onboard.values import RefusalCode, ValueGuard
from vrs import Engine, JointTarget, ManualClock, MotionCommand, PoseTarget, Status, SteerCommand
from vrs.errors import InvalidValueError

MODEL = puma560.model()
GUARD = ValueGuard(MODEL.limits, tool_speed=MODEL.tool_speed, tool_turn_speed=MODEL.tool_turn_speed)
Q = MODEL.poses["nominal"]


def with_value(bad: float) -> np.ndarray:
    q = np.array(Q)
    q[3] = bad
    return q


@pytest.mark.parametrize(
    ("q", "code"),
    [
        (with_value(math.nan), RefusalCode.NOT_FINITE),
        (with_value(-math.inf), RefusalCode.NOT_FINITE),
        (with_value(5e-324), RefusalCode.SUBNORMAL),
        (with_value(-1e-310), RefusalCode.SUBNORMAL),
        (with_value(1e308), RefusalCode.HUGE),
        (with_value(-1.0000001e9), RefusalCode.HUGE),
        (with_value(MODEL.limits.q_max[3] + 1e-12), RefusalCode.OUT_OF_LIMITS),
        (Q[:5], RefusalCode.WRONG_SHAPE),
        (Q[None], RefusalCode.WRONG_SHAPE),
        (0.0, RefusalCode.WRONG_SHAPE),
        ([[1.0], [1.0, 2.0]], RefusalCode.WRONG_SHAPE),
        (None, RefusalCode.WRONG_TYPE),
        ("ready", RefusalCode.WRONG_TYPE),
        ([True] * 6, RefusalCode.WRONG_TYPE),
        ([1j] * 6, RefusalCode.WRONG_TYPE),
        ([10**400] * 6, RefusalCode.WRONG_TYPE),
        (np.array(Q, dtype=np.longdouble), RefusalCode.WRONG_TYPE),
        (object(), RefusalCode.WRONG_TYPE),
    ],
)
def test_joints_are_refused_with_a_code(q: object, code: RefusalCode) -> None:
    refusal = GUARD.joints(q)
    assert refusal is not None
    assert refusal.code is code
    single = code in (RefusalCode.NOT_FINITE, RefusalCode.SUBNORMAL, RefusalCode.HUGE, RefusalCode.OUT_OF_LIMITS)
    assert refusal.index == ((3,) if single else ())
    assert "joints must be numbers of shape (6,)" in str(refusal)


def test_what_is_within_passes() -> None:
    for q in MODEL.poses.values():
        assert GUARD.joints(q) is None
    assert GUARD.joints(MODEL.limits.q_max) is None
    assert GUARD.joints([0, 0, 0, 0, 0, 0]) is None
    assert GUARD.rates(-MODEL.limits.qd_max) is None
    assert GUARD.twist([MODEL.tool_speed] * 3 + [-MODEL.tool_turn_speed] * 3) is None
    assert GUARD.number("speed", 0.5, 0.0, 1.0) is None
    assert GUARD.command(MotionCommand(PoseTarget(MODEL.forward(Q)))) is None
    assert GUARD.command("anything else") is None


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, math.inf])
def test_a_guard_has_speeds(speed: float) -> None:
    for values in ({"tool_speed": speed, "tool_turn_speed": 1.0}, {"tool_speed": 1.0, "tool_turn_speed": speed}):
        with pytest.raises(InvalidValueError, match="speed"):
            ValueGuard(MODEL.limits, **values)


@given(st.lists(st.floats(width=64), min_size=6, max_size=6))
def test_only_what_is_within_passes(q: list[float]) -> None:
    inside = all(
        low <= x <= high and (x == 0 or abs(x) >= 2.3e-308)
        for x, low, high in zip(q, MODEL.limits.q_min, MODEL.limits.q_max, strict=True)
    )
    assert (GUARD.joints(q) is None) == inside


def test_other_values() -> None:
    assert GUARD.rates(1.001 * MODEL.limits.qd_max).code is RefusalCode.OUT_OF_LIMITS  # type: ignore[union-attr]
    assert GUARD.twist([0.6, 0, 0, 0, 0, 0]).index == (0,)  # type: ignore[union-attr]
    assert GUARD.number("speed", math.nan, 0.0, 1.0).code is RefusalCode.NOT_FINITE  # type: ignore[union-attr]
    far = np.array(MODEL.forward(Q))
    far[0, 3] = 1e12
    assert GUARD.command(MotionCommand(PoseTarget(far))).code is RefusalCode.HUGE  # type: ignore[union-attr]
    assert GUARD.command(SteerCommand(rates=9 * MODEL.limits.qd_max)) is not None
    assert GUARD.command(MotionCommand(JointTarget(MODEL.limits.q_max + 1))) is not None


def test_a_nan_twist_isnt_full_speed_backwards() -> None:
    """It was in ros_controllers #283."""
    twist = [math.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
    engine = Engine(MODEL, q=Q, clock=ManualClock(1.0))
    engine.execute(SteerCommand(twist=[0.05, 0, 0, 0, 0, 0], execute_at=1.0))
    before = pickle.dumps(engine.timeline)
    assert GUARD.twist(twist).code is RefusalCode.NOT_FINITE  # type: ignore[union-attr]
    with pytest.raises(InvalidValueError):
        engine.execute(SteerCommand(twist=twist))
    assert pickle.dumps(engine.timeline) == before


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e308, 1e9, 1e3])
def test_bad_numbers_leave_the_engine_as_it_was(bad: float) -> None:
    engine = Engine(MODEL, q=Q, clock=ManualClock(1.0))
    engine.execute(MotionCommand(JointTarget(MODEL.poses["ready"]), execute_at=1.0))
    before = pickle.dumps(engine.timeline)
    for make in (
        lambda: MotionCommand(JointTarget(with_value(bad))),
        lambda: MotionCommand(JointTarget(Q), execute_at=bad * 1e7),
        lambda: MotionCommand(JointTarget(Q), speed=bad),
        lambda: MotionCommand(JointTarget(Q[:5])),
    ):
        try:
            receipt = engine.execute(make())
        except InvalidValueError:
            continue
        assert receipt.status is Status.REJECTED
    assert pickle.dumps(engine.timeline) == before
