"""Cubic pieces: what they integrate, and their own certificate beside the general one."""

from __future__ import annotations

import numpy as np

from robots import puma560
from vrs import Limits
from vrs.planning import violation
from vrs.planning.online import integrated
from vrs.planning.plan import end_state
from vrs.segment import State

LIMITS = puma560.model().limits
ONE = np.ones(1)
WIDE = 1e3 * ONE


def at(q: float, qd: float, qdd: float) -> State:
    return State(q * ONE, qd * ONE, qdd * ONE)


def test_they_are_the_integral_of_the_jerk():
    rng = np.random.default_rng(1)
    for m in (1, 2, 9, 40):
        state = State(*rng.normal(size=(3, 6)))
        h, jerk = rng.uniform(0.01, 0.5, m), rng.normal(size=(m, 6))
        cubics = integrated(state, h, jerk)
        plan, (q, qd, qdd) = cubics.plan(), state
        assert np.array_equal(plan.durations, h)
        for coefficients, dt, j in zip(plan.coefficients, h, jerk, strict=True):
            assert np.allclose(coefficients, (q, qd, qdd / 2, j / 6), rtol=1e-12, atol=1e-12)
            q, qd, qdd = q + dt * (qd + dt * (qdd / 2 + dt * j / 6)), qd + dt * (qdd + dt * j / 2), qdd + dt * j
        end = end_state(plan)
        assert np.allclose(cubics.end, (end.q, end.qd, end.qdd), rtol=1e-12, atol=1e-12)
        assert np.array_equal(plan.coefficients[0, :2], (state.q, state.qd))


def test_their_certificate_is_the_general_one():
    rng = np.random.default_rng(2)
    kept = 0
    for _ in range(1500):
        m = int(rng.integers(1, 6))
        state = State(*rng.uniform(-1, 1, (3, 3)) * [[1.0], [1.0], [2.0]])
        cubics = integrated(state, rng.uniform(0.05, 0.8, m), rng.uniform(-4, 4, (m, 3)))
        plan = cubics.plan()
        # One limit close to what the plan takes, the others far: every branch decides some.
        u = np.linspace(0, 1, 200)[:, None, None] * plan.durations[:, None]
        a = plan.coefficients.swapaxes(0, 1)
        q = a[0] + u * (a[1] + u * (a[2] + u * a[3]))
        qd = a[1] + u * (2 * a[2] + u * 3 * a[3])
        qdd = 2 * a[2] + u * 6 * a[3]
        taken = [np.abs(values).max((0, 1)) for values in (q, qd, qdd, 6 * a[3:])]
        wide = rng.permutation([1.0 + rng.normal() * 0.02, 9.0, 9.0, 9.0])
        low, *rates = (share * most for share, most in zip(wide, taken, strict=True))
        limits = Limits(-low, low, *rates)
        assert cubics.keeps(limits) == (violation(plan, limits, jerk=True) is None)
        kept += cubics.keeps(limits)
    assert 400 < kept < 1100


def test_hulls_outside_are_decided_by_the_curves():
    """q = 8u³/3 − 4u² + 1.6u on [0, ½]: 0, up to 0.19296 at u = 0.276, down to 0.1333; its hull reaches 0.267."""
    within = integrated(at(0.0, 1.6, -8.0), 0.5 * ONE, 16.0 * ONE[:, None])
    for top, kept in ((0.1930, True), (0.1929, False)):
        limits = Limits(-0.001 * ONE, top * ONE, WIDE, WIDE, WIDE)
        assert within.keeps(limits) == kept
        assert (violation(within.plan(), limits, jerk=True) is None) == kept
    # Turning at ½ by −0.4 and nowhere faster than 0.39 at the knots.
    between = integrated(at(0.0, 0.39, -3.16), ONE, 6.32 * ONE[:, None])
    for speed, kept in ((0.4001, True), (0.3999, False)):
        limits = Limits(-ONE, ONE, speed * ONE, WIDE, WIDE)
        assert between.keeps(limits) == kept
        assert (violation(between.plan(), limits, jerk=True) is None) == kept


def test_numbers_that_are_none_are_not_kept():
    for bad in (np.nan, np.inf):
        for joint, piece in ((0, 0), (3, 2)):
            jerk = np.zeros((3, 6))
            jerk[piece, joint] = bad
            with np.errstate(invalid="ignore"):
                cubics = integrated(State(*np.zeros((3, 6))), np.full(3, 0.1), jerk)
            assert not cubics.keeps(LIMITS)
