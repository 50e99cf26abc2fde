"""The certificate against dense sampling with local refinement, in both directions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import chebyshev, polynomial

from robots import puma560
from vrs import Limits
from vrs.planning import Plan, certificate, violation
from vrs.planning.certificate import MAX_DEGREE, TOLERANCE

LIMITS = puma560.model().limits
NAMES = ("position", "speed", "acceleration", "jerk")


def derivatives(plan: Plan, order: int) -> np.ndarray:
    """Ascending powers of a derivative, (m, K, n)."""
    a = plan.coefficients.astype(np.longdouble)
    for _ in range(order):
        a = a[:, 1:] * np.arange(1, a.shape[1])[:, None] if a.shape[1] > 1 else np.zeros_like(a)
    return a


def extremes(plan: Plan, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest value of each joint by a dense grid, then finer ones round its best points."""
    a = derivatives(plan, order)
    low, high = np.full(a.shape[2], np.inf), np.full(a.shape[2], -np.inf)
    for row, h in zip(a, plan.durations, strict=True):
        for j in range(a.shape[2]):
            for sign in (1, -1):
                best, width = 0.5 * h, 0.5 * h
                for count in (801, 101, 101, 101, 101):
                    u = np.clip(np.linspace(best - width, best + width, count), 0, h)
                    values = sign * polynomial.polyval(u, row[:, j])
                    best, width = u[np.argmax(values)], 2 * width / (count - 1)
                if sign > 0:
                    high[j] = max(high[j], values.max())
                else:
                    low[j] = min(low[j], -values.max())
    return low, high


def overshoot(plan: Plan, limits: Limits, *, jerk: bool) -> tuple[float, int, str]:
    """The largest relative overshoot with its joint and limit, from samples alone."""
    worst = (-np.inf, 0, "")
    bounds = [(limits.q_min, limits.q_max)]
    bounds += [(-b, b) for b in (limits.qd_max, limits.qdd_max, limits.qddd_max)]
    for order in range(4 if jerk else 3):
        low, high = extremes(plan, order)
        smallest = 1.0 if order == 0 else 0.0
        for j in range(len(low)):
            bottom, top = bounds[order][0][j], bounds[order][1][j]
            for over in (
                (high[j] - top) / max(smallest, abs(top)),
                (bottom - low[j]) / max(smallest, abs(bottom)),
            ):
                worst = max(worst, (float(over), j, NAMES[order]))
    return worst


def chebyshev_plan(rng: np.random.Generator, pieces: int, degree: int, n: int, decay: float) -> Plan:
    """Smooth pieces, which don't meet; the certificate looks at each by itself."""
    h = rng.uniform(0.05, 0.5, pieces)
    a = np.zeros((pieces, degree + 1, n))
    for i in range(pieces):
        for j in range(n):
            c = rng.normal(size=degree + 1) * decay ** np.arange(degree + 1)
            powers = chebyshev.cheb2poly(c)
            # From [-1, 1] to the time on [0, h].
            p = np.zeros(degree + 1)
            for k, value in enumerate(powers):
                term = value * polynomial.polypow([-1.0, 2.0 / h[i]], k)
                p[: len(term)] += term
            a[i, :, j] = p
    return Plan(h, a)


def limits_that_touch(plan: Plan, order: int, joint: int, over: float) -> Limits:
    """Limits that the plan keeps by far, but for one that a joint passes by `over`, relatively."""
    extreme = [extremes(plan, k) for k in range(4)]
    size = [np.maximum(np.abs(low), np.abs(high)) for low, high in extreme]
    q_min, q_max = extreme[0][0] - 1.0, extreme[0][1] + 1.0
    rates = [2.0 * s + 1e-3 for s in size[1:]]
    if order == 0:
        top = extreme[0][1][joint]
        q_max[joint] = top - over * max(1.0, abs(top))
    else:
        rates[order - 1][joint] = size[order][joint] / (1.0 + over)
    return Limits(q_min, q_max, *rates)


@pytest.mark.parametrize("degree", [2, 3, 4, 5, 7, 9, 12, 16])
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_it_refuses_what_passes_and_accepts_what_does_not(degree: int, order: int):
    rng = np.random.default_rng([degree, order])
    decided = 0
    for trial in range(4):
        plan = chebyshev_plan(rng, 2, degree, 2, 0.5)
        if order > degree:
            continue
        joint = trial % 2
        # What is accepted in between either way lies from 5e-10 to 1e-9; samples know it to 1e-10.
        for over in (-1e-3, -1e-9, 4e-10, 1.1e-9, 1e-6, 0.1):
            limits = limits_that_touch(plan, order, joint, over)
            problem = violation(plan, limits, jerk=True)
            if over < TOLERANCE:
                assert problem is None, (over, problem)
            else:
                assert problem == f"joint {joint + 1} would pass its {NAMES[order]} limit", over
            decided += 1
    assert decided == 24 or order > degree


def test_random_plans_agree_with_samples():
    rng = np.random.default_rng(8)
    refused = 0
    for _ in range(60):
        degree = int(rng.integers(1, 13))
        plan = chebyshev_plan(rng, 2, degree, 2, 0.4)
        size = [np.maximum(*np.abs(extremes(plan, k))) for k in range(4)]
        shares = rng.choice([0.7, 1.5, 3.0], size=(4, 2), p=[0.1, 0.2, 0.7])
        bounds = [one * share + 1e-6 for one, share in zip(size, shares, strict=True)]
        limits = Limits(-bounds[0], *bounds)
        jerk = bool(rng.integers(2))
        over, _, _ = overshoot(plan, limits, jerk=jerk)
        problem = violation(plan, limits, jerk=jerk)
        assert (problem is not None) == (over > TOLERANCE), (over, problem)
        refused += problem is not None
    assert 10 < refused < 50


def test_what_only_the_hull_passes_is_accepted_and_a_peak_between_samples_refused():
    wide = np.full(1, 1e6)
    # q = T8(2u − 1) swings between −1 and 1; its Bernstein coefficients go far beyond.
    p = polynomial.Polynomial([0.0])
    line = polynomial.Polynomial([-1.0, 2.0])
    for k, c in enumerate(chebyshev.cheb2poly([0] * 8 + [1])):
        p += c * line**k
    plan = Plan(np.ones(1), p.coef[None, :, None])
    assert violation(plan, Limits(-np.ones(1), np.ones(1), wide, wide, wide), jerk=True) is None
    shrunk = Limits(-np.ones(1), np.ones(1) * (1 - 2e-9), wide, wide, wide)
    assert violation(plan, shrunk, jerk=True) == "joint 1 would pass its position limit"
    # A narrow bump with its top at 0.51.
    bump = (1.0 - 3.8 * polynomial.Polynomial([-0.51, 1.0]) ** 2) ** 8
    plan = Plan(np.ones(1), bump.coef[None, :, None])
    low = Limits(-np.ones(1), np.array([1 - 2e-9]), wide, wide, wide)
    assert violation(plan, low, jerk=True) == "joint 1 would pass its position limit"
    assert violation(plan, Limits(-np.ones(1), np.ones(1), wide, wide, wide), jerk=True) is None


def test_limits_of_the_highest_degree_and_of_rounding():
    plan = Plan(np.ones(1), np.zeros((1, MAX_DEGREE + 1, 6)))
    assert violation(plan, LIMITS, jerk=True) is None
    steep = np.zeros((1, MAX_DEGREE + 1, 1))
    steep[0, MAX_DEGREE] = 1.0
    one, wide = np.ones(1), np.full(1, 1e6)
    for speed, allowed in ((31.0 * (1 - 4e-10), True), (31.0 * (1 - 1.1e-9), False)):
        problem = violation(Plan(one, steep), Limits(-one, one, one * speed, wide, wide), jerk=True)
        assert problem == (None if allowed else "joint 1 would pass its speed limit")
    beyond = Plan(np.ones(1), np.zeros((1, MAX_DEGREE + 2, 6)))
    assert "degree 32" in str(violation(beyond, LIMITS, jerk=True))
    # 1e18 (1 − u)^19: nothing but rounding is left near its end.
    hidden = np.zeros((1, 20, 6))
    hidden[0, :, 2] = [1e18 * (-1) ** k * math.comb(19, k) for k in range(20)]
    assert "rounding" in str(violation(Plan(np.ones(1), hidden), LIMITS, jerk=False))


def test_what_halving_cannot_decide_is_refused(monkeypatch):
    """A top that touches the limit, and no halvings left."""
    top = 1.0 - 4.0 * polynomial.Polynomial([-0.49, 1.0]) ** 2
    plan = Plan(np.ones(1), (top**5).coef[None, :, None])
    limits = Limits(-np.ones(1), np.ones(1), *np.full((3, 1), 1e6))
    assert violation(plan, limits, jerk=False) is None
    monkeypatch.setattr(certificate, "HALVINGS", 1)
    assert violation(plan, limits, jerk=False) == "joint 1: can't decide whether its position limit is kept"
    # The start of the right half is beyond already: refused at once, not left undecided.
    low = Limits(-np.ones(1), 0.99 * np.ones(1), *np.full((3, 1), 1e6))
    monkeypatch.setattr(certificate, "HALVINGS", 2)
    assert violation(plan, low, jerk=False) == "joint 1 would pass its position limit"


def test_bad_numbers_are_refused_whatever_the_degree():
    for degree in (1, 3, 9):
        for bad in (np.nan, np.inf, -np.inf):
            a = np.zeros((2, degree + 1, 6))
            a[1, degree, 3] = bad
            assert violation(Plan(np.ones(2), a), LIMITS, jerk=True) == "the plan isn't finite"
            assert violation(Plan(np.array([1.0, bad]), np.zeros_like(a)), LIMITS, jerk=True) is not None
        for h in (0.0, -1.0):
            plan = Plan(np.array([1.0, h]), np.zeros((2, degree + 1, 6)))
            assert violation(plan, LIMITS, jerk=True) == "the plan isn't finite"


def test_padding_with_zeros_changes_nothing():
    rng = np.random.default_rng(9)
    for _ in range(40):
        a = rng.normal(size=(3, 4, 6)) * [[1.5], [0.6], [1.5], [6.0]]
        h = rng.uniform(0.05, 0.3, 3)
        padded = np.zeros((3, 10, 6))
        padded[:, :4] = a
        short, long = (violation(Plan(h, c), LIMITS, jerk=True) for c in (a, padded))
        assert (short is None) == (long is None)
