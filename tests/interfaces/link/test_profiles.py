"""Delay profiles as text, and those that aren't measured rows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from interfaces.link import (
    ConstantDelay,
    GammaDelay,
    HeavyTailedDelay,
    Hop,
    RouteDelay,
    TraceDelay,
    delay_profile,
)
from vrs.errors import FormatError, InvalidValueError

ERRORS = 5.0


def test_simple_profiles():
    rng = np.random.default_rng(0)
    assert delay_profile("none").source(rng)(3.0, 0) == 0
    assert delay_profile("constant:0.25").source(rng)(3.0, 0) == 0.25
    assert delay_profile("lunar").quantile(0.95) == 1.28


@pytest.mark.parametrize("text", ["thu", "thu@20", "country@0.2", "gamma:0.2,0.1@0", "gamma:0.2,0.1,0.05",
                                  "route:3e5,29,1e-4,0.02,1e7@5", "constant:1", "none", "lunar"])  # fmt: skip
def test_a_profile_is_called_as_it_was_spelled(text):
    assert delay_profile(text).name == text


def test_the_correlation_time_is_part_of_the_name():
    assert delay_profile("thu").correlation_time == 2.0
    assert delay_profile("thu@20").correlation_time == 20.0
    assert delay_profile("gamma:1,0.5@0").correlation_time == 0.0
    assert delay_profile("route:1,0,0,0,1e6@7").correlation_time == 7.0


@pytest.mark.parametrize(
    "text",
    ["", "nine", "constant", "constant:", "constant:x", "constant:-1", "constant:nan", "constant:inf",
     "constant:1e9", "thu:1", "thu:", "trace:", "none:0", "THU", "thu@", "thu@x", "thu@-1", "thu@nan", "thu@inf",
     "thu@1e9", "@2", "none@2", "lunar@2", "constant:1@2", "gamma", "gamma:", "gamma:1", "gamma:1,0", "gamma:1,2,3",
     "gamma:1,0.1,0,4", "gamma:1,1e9", "gamma:1,x", "gamma:nan,1", "route:1,2,3", "route:1,2.5,0,0,1e6",
     "route:1,-1,0,0,1e6", "route:1,999,0,0,1e6", "route:1,2,0,0,0", "route:-1,2,0,0,1e6", "route:1e13,0,0,0,1e6",
     "thu@2@3", "ThU@2"],
)  # fmt: skip
def test_bad_profiles_name_what_is_allowed(text):
    with pytest.raises(InvalidValueError, match=r"none, constant:S .*lunar, or trace:FILE\.csv.*@TAU"):
        delay_profile(text)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ConstantDelay("x", -1.0),
        lambda: ConstantDelay("x", math.nan),
        lambda: HeavyTailedDelay("x", 4.0, 0.0, 0.1, 1.0),
        lambda: HeavyTailedDelay("x", math.nan, 1.0, 0.1, 1.0),
        lambda: HeavyTailedDelay("x", 4.0, 1.0, 1.0, 1.0),
        lambda: HeavyTailedDelay("x", 4.0, 1.0, 0.1, 1.0, -2.0),
        lambda: GammaDelay("x", 0.1, 0.1, 0.1),
        lambda: TraceDelay("x", ()),
        lambda: TraceDelay("x", (0.1, -0.1)),
        lambda: RouteDelay("x", ()),
        lambda: RouteDelay("x", (Hop(),), speed=math.inf),
        lambda: Hop(bandwidth=math.nan),
        lambda: Hop(load=-1.0),
        lambda: delay_profile("thu").quantile(1.0),
    ],
)
def test_values_are_checked(make):
    with pytest.raises(InvalidValueError):
        make()


def draws(profile, count, gap, seed=5):
    source = profile.source(np.random.default_rng(seed))
    return np.array([source(gap * i, 0) for i in range(count)])


@pytest.mark.parametrize(("mean", "sd", "low"), [(0.2, 0.05, 0.0), (0.5, 0.9, 0.1), (2.0, 2.0, 0.0)])
def test_gamma_delays_are_gamma_distributed(mean, sd, low):
    profile = GammaDelay("gamma", mean, sd, low, correlation_time=0.0)
    d = draws(profile, 20_000, 1.0)
    shape = ((mean - low) / sd) ** 2
    law = stats.gamma(shape, loc=low, scale=(mean - low) / shape)
    assert stats.kstest(d, law.cdf).pvalue > 1e-4
    assert d.mean() == pytest.approx(mean, abs=ERRORS * sd / math.sqrt(d.size))
    # The fourth central moment of a gamma variable is (3 + 6/k) sd⁴.
    assert d.var() == pytest.approx(sd**2, abs=ERRORS * sd**2 * math.sqrt((2 + 6 / shape) / d.size))
    for share in (1e-6, 0.05, 0.5, 0.95, 1 - 1e-9):
        assert profile.quantile(share) == pytest.approx(law.ppf(share), rel=1e-9)


def test_gamma_delays_are_correlated():
    profile = GammaDelay("gamma", 0.2, 0.1, 0.0, correlation_time=3.0)
    high = draws(profile, 20_000, 3.0) > profile.quantile(0.5)
    expected = 0.25 + math.asin(math.exp(-1.0)) / (2 * math.pi)
    assert np.mean(high[1:] & high[:-1]) == pytest.approx(expected, abs=ERRORS * math.sqrt(0.2 / (0.25 * 20_000)))


def test_a_route_adds_up_distance_nodes_and_message():
    """Eq. (7) with the paper's two routes; the load is left out."""
    hops = (Hop(200.0, 1e-3, 0.0, 1e7), Hop(100.0, 2e-3, 0.0, 56e3))
    route = RouteDelay("two", hops)
    expected = 300.0 / 299_792_458.0 + 3e-3 + 8 * 100 / 1e7 + 8 * 100 / 56e3
    assert route.source(np.random.default_rng(0))(0.0, 100) == pytest.approx(expected, rel=1e-12)
    assert route.fixed() == route.fixed(64)
    assert route.quantile(0.3) == route.fixed()
    country = delay_profile("route:300e3,28,1e-3,0,10e6")
    assert country.fixed(125) == pytest.approx(300e3 / 299_792_458.0 + 29 * (1e-3 + 1e-4), rel=1e-12)


def test_the_load_of_a_route_is_a_sum_of_exponential_waits():
    means = [0.1, 0.1, 0.02, 0.3]
    route = RouteDelay("loaded", tuple(Hop(load=mean) for mean in means), message=0, correlation_time=0.0)
    d = draws(route, 20_000, 1.0)
    deviation = math.sqrt(sum(mean**2 for mean in means))
    assert d.mean() == pytest.approx(sum(means), abs=ERRORS * deviation / math.sqrt(d.size))
    for share in (0.01, 0.5, 0.95, 0.999):
        error = ERRORS * math.sqrt(share * (1 - share) / d.size)
        assert np.mean(d <= route.quantile(share)) == pytest.approx(share, abs=error)
    equal = RouteDelay("erlang", (Hop(load=0.1),) * 29, message=0)
    assert equal.quantile(0.95) == pytest.approx(stats.gamma(29, scale=0.1).ppf(0.95), rel=1e-8)


def test_the_load_of_a_route_is_correlated_as_asked():
    route = RouteDelay("loaded", (Hop(load=0.1),), message=0, correlation_time=2.0)
    d = draws(route, 40_000, 2.0) - 0.1
    expected = math.exp(-1.0)
    assert np.mean(d[1:] * d[:-1]) / np.mean(d**2) == pytest.approx(expected, abs=ERRORS * math.sqrt(9 / 40_000))


@pytest.mark.parametrize(
    ("text", "delays"),
    [
        ('delay_s\n0.1\n""\n0.3\n', (0.1, None, 0.3)),
        ("delay_s\n0.1\n\n0.3\n", (0.1, None, 0.3)),
        ("delay_s\r\n0.1\r\n\r\n0.3\r\n", (0.1, None, 0.3)),
        ("delay_s\n\n0.3", (None, 0.3)),
        ("delay_s,\n0.1,\n,\n0.3,,\n", (0.1, None, 0.3)),
        ("\ufeffseq,delay_s\n1,0.1\n2,\n3,0.3\n\n", (0.1, None, 0.3, None)),
    ],
)
def test_an_empty_cell_or_line_is_a_lost_packet(tmp_path, text, delays):
    path = tmp_path / "trace@2.csv"
    path.write_bytes(text.encode())
    source = delay_profile(f"trace:{path}").source(np.random.default_rng(0))
    assert tuple(source(0.0, 0) for _ in delays) == delays
    assert source(0.0, 0) == delays[0]


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b"", ":1"), (b"delay\n1\n", ":1"), (b"delay_s\n", ""), (b"delay_s\n0.1\nx\n", ":3"),
        (b"delay_s\n-1\n", ":2"), (b"delay_s\nnan\n", ":2"), (b"\xff\xfe\x00", ""), (b'delay_s\n"0.1', ""),
        (b"\x89PNG\r\n\x1a\n\x00", ""), (b"delay_s\n0,04\n", ":2"), (b"seq,delay_s\n1,0.1\n2\n", ":3"),
    ],
)  # fmt: skip
def test_bad_traces_name_file_and_line(tmp_path, data, line):
    path = tmp_path / "trace.csv"
    path.write_bytes(data)
    with pytest.raises(FormatError, match=rf"trace\.csv{line}"):
        delay_profile(f"trace:{path}")


def test_a_missing_trace_is_one_typed_error(tmp_path):
    with pytest.raises(FormatError, match="can't be read"):
        delay_profile(f"trace:{tmp_path}/none.csv")


def test_a_trace_may_hold_no_delay_and_the_longest(tmp_path):
    path = tmp_path / "trace.csv"
    path.write_text("delay_s\n0\n3600\n")
    source = delay_profile(f"trace:{path}").source(np.random.default_rng(0))
    assert [source(0.0, 0), source(0.0, 0)] == [0.0, 3600.0]
