"""The scheduler: J ≤ ε (1 + 1e-9) whatever is asked and whatever its network says, on the same curve."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from interfaces.middleware.middleware import GainScheduler
from interfaces.middleware.network import Formulation, TrainingConfig, default_network, examples, train
from interfaces.middleware.performance import drive_measure, optimal_gain
from robots.onboard.driving import Drive
from vrs.errors import InvalidValueError

NETWORK = default_network()
WILD = replace(NETWORK, bias=NETWORK.bias + 3.0)
"""Its gains are twenty times too high."""
TIMID = replace(NETWORK, bias=-800.0)
"""Its gains are 0."""
RAW = train(TrainingConfig(formulation=Formulation.RAW, neurons=5, epochs=5, factors=21, delays=5))
"""Some of its gains are negative."""
SPEED = st.floats(-1e6, 1e6)


@pytest.mark.parametrize(
    "network", [None, NETWORK, WILD, TIMID, RAW], ids=["exact", "good", "wild", "timid", "raw"]
)
@given(v=SPEED, w=SPEED, tau=st.floats(0, 10))
def test_the_tolerance_is_kept(network, v, w, tau):
    scheduler = GainScheduler(0.25, network)
    slowed = scheduler.schedule(Drive(v, w), tau)
    assert drive_measure(slowed, tau) <= 0.25 * (1 + 1e-9)
    assert abs(slowed.v) <= abs(v)
    assert abs(slowed.w) <= abs(w)
    assert slowed.v * v >= 0
    assert slowed.w * w >= 0
    if drive_measure(Drive(v, w), tau) <= 0.25:
        assert slowed == (v, w)
    elif abs(v) > 1e-3 and abs(w) > 1e-3:
        assert slowed.w / slowed.v == pytest.approx(w / v)


@pytest.mark.parametrize("kind", ["uniform", "log-uniform"])
def test_the_guard_holds_over_the_papers_ranges(kind):
    """50,000 of the million that `vrs reproduce tipsuwan` tries."""
    A, tau = examples(NETWORK.ranges, 50_000, np.random.default_rng(17))[kind]
    scheduler = GainScheduler(0.25, NETWORK)
    worst, least = 0.0, 1.0
    for factor, delay in zip(A.tolist(), tau.tolist(), strict=True):
        found = drive_measure(scheduler.schedule(Drive(5.0, 10.0 * factor), delay), delay)
        worst, least = max(worst, found), min(least, found)
    assert worst <= 0.25 * (1 + 1e-9)
    # And nothing is slowed more than the network errs.
    assert least >= 0.25 * (1 - 5e-3)
    assert scheduler.drives == scheduler.slowed == 50_000
    assert 0 < scheduler.exact < 50_000


def test_without_a_network_the_gain_is_the_exact_one():
    scheduler = GainScheduler(0.25)
    slowed = scheduler.schedule(Drive(-2.0, 4.0), 0.2)
    K = optimal_gain(-1.0, 0.2, 0.25)
    assert slowed == pytest.approx((-K, 2 * K))
    assert (scheduler.drives, scheduler.slowed, scheduler.exact) == (1, 1, 1)


def test_turns_on_the_spot_and_straight_lines():
    scheduler = GainScheduler(0.25, NETWORK)
    assert scheduler.schedule(Drive(0.0, -8.0), 0.5) == pytest.approx((0.0, -0.5))
    assert scheduler.schedule(Drive(3.0, 0.0), 0.5).v == pytest.approx(0.5, rel=5e-3)
    slowed = scheduler.schedule(Drive(1e-300, 8.0), 0.5)
    assert slowed.w == pytest.approx(0.5)
    assert scheduler.schedule(Drive(3.0, 1.0), 0.0) == (3.0, 1.0)


def test_outside_of_its_ranges_the_network_isnt_asked():
    scheduler = GainScheduler(0.25, WILD)
    far = scheduler.schedule(Drive(2.0, 0.0), 5.0)
    assert far.v == pytest.approx(0.05)
    assert scheduler.exact == 1


@pytest.mark.parametrize(("drive", "tau", "said"), [
    ((math.nan, 0.0), 0.2, "drive must be"), ((0.0, math.inf), 0.2, "drive must be"),
    ((1.0, 0.0), -0.1, "tau must be"), ((1.0, 0.0), math.nan, "tau must be"),
])  # fmt: skip
def test_senseless_drives_and_delays_are_refused(drive, tau, said):
    scheduler = GainScheduler(0.25, NETWORK)
    with pytest.raises(InvalidValueError, match=said):
        scheduler.schedule(Drive(*drive), tau)
    assert scheduler.drives == 0


def test_a_network_of_another_tolerance_is_refused():
    with pytest.raises(InvalidValueError, match=r"ε = 0\.3"):
        GainScheduler(0.3, NETWORK)
    with pytest.raises(InvalidValueError, match="epsilon must be"):
        GainScheduler(math.inf)
