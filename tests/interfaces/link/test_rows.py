"""The measured rows: the model's exact moments against the published figures, and the draws against the model.

Tolerances come from the sampling error. Of N draws with autocorrelation ρ from one to the next, mean and
variance scatter as those of N(1 − ρ)/(1 + ρ) independent ones at the least: the delay is a monotone function
of a Gaussian AR(1), and no function of one is correlated more than it is itself (Mehler's expansion). The
variance of a sample variance is (m4 − m2²)/n, with the exact fourth central moment of the clipped log-normal:
clipping makes it finite, and it is large (kurtosis up to some 500), so that heavy tails get the tolerance
that they need. Five standard errors are allowed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from interfaces.link import delay_profile

# Han, Kim, Kim, Kim (2001), tables 1 and 2 [s]: mean, standard deviation, smallest, largest.
ROWS = {
    "domain": (0.020, 0.0517, 0.006, 0.89),
    "country": (4.194, 22.5, 0.039, 343.0),
    "mon": (0.531, 1.42, 0.048, 15.0),
    "tue": (6.880, 28.9, 0.045, 343.0),
    "wed": (1.480, 7.77, 0.044, 154.0),
    "thu": (1.030, 4.16, 0.045, 68.0),
    "fri": (0.779, 2.59, 0.049, 35.0),
}
Phi = NormalDist().cdf
DRAWS = 24_000
ERRORS = 5.0


def moments(profile):
    """Mean, variance and fourth central moment of min + min(L, max − min), in closed form [s]."""
    clip = profile.high - profile.low
    mu, s = profile.mu - math.log(1e3), profile.sigma
    a = (math.log(clip) - mu) / s
    m = [math.exp(k * mu + (k * s) ** 2 / 2) * Phi(a - k * s) + clip**k * (1 - Phi(a)) for k in range(5)]
    fourth = m[4] - 4 * m[3] * m[1] + 6 * m[2] * m[1] ** 2 - 3 * m[1] ** 4
    return profile.low + m[1], m[2] - m[1] ** 2, fourth


@pytest.mark.parametrize("name", ROWS)
def test_the_published_figures_follow_from_the_parameters(name):
    """Within what rounding μ and σ to two decimals leaves open."""
    mean, sd, low, high = ROWS[name]
    profile = delay_profile(name)
    assert (profile.low, profile.high) == (low, high)
    exact_mean, variance, _ = moments(profile)
    mean_open = sd_open = 0.0
    for name_ in ("mu", "sigma"):
        other_mean, other, _ = moments(replace(profile, **{name_: getattr(profile, name_) + 0.005}))
        mean_open += abs(other_mean - exact_mean)
        sd_open += abs(math.sqrt(other) - math.sqrt(variance))
    assert mean == pytest.approx(exact_mean, abs=mean_open)
    assert sd == pytest.approx(math.sqrt(variance), abs=sd_open)


@pytest.mark.parametrize("tau", [0.0, 0.2, 2.0, 20.0])
@pytest.mark.parametrize("name", ROWS)
def test_draws_reproduce_mean_deviation_smallest_and_largest(name, tau):
    profile = delay_profile(f"{name}@{tau:g}")
    mean, variance, fourth = moments(profile)
    gap = 0.5 * tau
    rho = math.exp(-0.5) if tau else 0.0
    n = DRAWS * (1 - rho) / (1 + rho)
    source = profile.source(np.random.default_rng(11))
    d = np.array([source(gap * i, 0) for i in range(DRAWS)])
    assert d.mean() == pytest.approx(mean, abs=ERRORS * math.sqrt(variance / n))
    assert d.var() == pytest.approx(variance, abs=ERRORS * math.sqrt((fourth - variance**2) / n))
    # The smallest of n draws lies above the quantile p with probability (1 − p)^n: e^−20 for p = 20/n.
    p = 20.0 / n
    assert profile.low <= d.min() <= profile.quantile(p)
    assert profile.quantile(1.0 - p) <= d.max() <= profile.high
    share = 0.95
    assert np.mean(d <= profile.quantile(share)) == pytest.approx(
        share, abs=ERRORS * math.sqrt(share * (1 - share) / n)
    )
    if not tau:
        assert d.max() == pytest.approx(profile.high, rel=1e-12)


@pytest.mark.parametrize("tau", [0.0, 0.2, 2.0, 20.0])
def test_congestion_lasts_as_long_as_asked(tau):
    """The autocorrelation of ln L at the lag τ; Bartlett's standard error for an AR(1) is √((1 − ρ²)/N).

    Clipping, which touches a thousandth of the draws, moves it by less than 0.002.
    """
    profile = delay_profile(f"thu@{tau:g}")
    source = profile.source(np.random.default_rng(3))
    logs = np.log(np.array([source((tau or 1.0) * i, 0) for i in range(DRAWS)]) - profile.low)
    logs -= logs.mean()
    rho = math.exp(-1.0) if tau else 0.0
    assert np.mean(logs[1:] * logs[:-1]) / np.mean(logs**2) == pytest.approx(
        rho, abs=ERRORS * math.sqrt((1 - rho**2) / DRAWS) + 0.002
    )


def test_packets_at_one_instant_share_their_delay_unless_draws_are_independent():
    for text, equal in (("thu", True), ("thu@0", False)):
        source = delay_profile(text).source(np.random.default_rng(0))
        assert (source(1.0, 0) == source(1.0, 0)) is equal
