"""Delay profiles against the paper's rows, and the promises of the channel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.link import Channel, ConstantDelay, Service, delay_profile
from vrs.errors import FormatError, InvalidValueError

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


@pytest.mark.parametrize("name", ROWS)
def test_measured_rows_are_matched_after_clipping(name):
    mean, sd, low, high = ROWS[name]
    profile = delay_profile(name)
    z = np.random.default_rng(1).standard_normal(400_000)
    logs = np.exp(profile.mu + profile.sigma * z) / 1e3
    d = profile.low + np.minimum(logs, profile.high - profile.low)
    assert (profile.low, profile.high) == (low, high)
    assert d.mean() == pytest.approx(mean, rel=0.06)
    assert d.std() == pytest.approx(sd, rel=0.06)
    assert [profile.delay(x) for x in z[:50]] == pytest.approx(d[:50])


@pytest.mark.parametrize("name", ROWS)
def test_draws_stay_in_range_and_meet_the_quantile(name):
    profile = delay_profile(name)
    source = profile.source(np.random.default_rng(2))
    d = np.array([source.draw(20.0 * i) for i in range(20_000)])
    assert d.min() >= profile.low
    assert d.max() <= profile.high
    assert np.mean(d <= profile.quantile(0.95)) == pytest.approx(0.95, abs=0.01)


def test_congestion_lasts_two_seconds():
    profile = delay_profile("thu")
    source = profile.source(np.random.default_rng(3))
    logs = np.log(np.array([source.draw(0.5 * i) for i in range(100_000)]) - profile.low)
    logs -= logs.mean()
    correlation = np.mean(logs[4:] * logs[:-4]) / np.mean(logs**2)
    assert correlation == pytest.approx(np.exp(-1.0), abs=0.03)


def test_simple_profiles():
    rng = np.random.default_rng(0)
    assert delay_profile("none").source(rng).draw(3.0) == 0
    assert delay_profile("constant:0.25").source(rng).draw(3.0) == 0.25
    assert delay_profile("lunar").quantile(0.95) == 1.28


@pytest.mark.parametrize(
    "text",
    ["", "nine", "constant", "constant:", "constant:x", "constant:-1", "constant:nan", "constant:inf",
     "constant:1e9", "thu:1", "trace:", "none:0", "THU"],
)  # fmt: skip
def test_bad_profiles_name_what_is_allowed(text):
    with pytest.raises(InvalidValueError, match=r"none, constant:S .*lunar, or trace:FILE\.csv"):
        delay_profile(text)


@pytest.mark.parametrize(
    ("text", "delays"),
    [
        ('delay_s\n0.1\n""\n0.3\n', (0.1, None, 0.3)),
        ("delay_s\n0.1\n\n0.3\n", (0.1, None, 0.3)),
        ("delay_s\r\n0.1\r\n\r\n0.3\r\n", (0.1, None, 0.3)),
        ("delay_s\n\n0.3", (None, 0.3)),
        ("\ufeffseq,delay_s\n1,0.1\n2,\n3,0.3\n\n", (0.1, None, 0.3, None)),
    ],
)
def test_an_empty_cell_or_line_is_a_lost_packet(tmp_path, text, delays):
    path = tmp_path / "trace.csv"
    path.write_bytes(text.encode())
    source = delay_profile(f"trace:{path}").source(np.random.default_rng(0))
    assert tuple(source.draw(0.0) for _ in delays) == delays
    assert source.draw(0.0) == delays[0]


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b"", ":1"), (b"delay\n1\n", ":1"), (b"delay_s\n", ""), (b"delay_s\n0.1\nx\n", ":3"),
        (b"delay_s\n-1\n", ":2"), (b"delay_s\nnan\n", ":2"), (b"\xff\xfe\x00", ""), (b'delay_s\n"0.1', ""),
        (b"\x89PNG\r\n\x1a\n\x00", ""),
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


def deliveries(profile, service, gaps, seed=0):
    """Send a packet at each time; take each at its deadline."""
    channel = Channel(profile, np.random.default_rng(seed), service)
    sent = np.cumsum(gaps)
    out = []
    for i, now in enumerate(sent):
        while (deadline := channel.next_deadline()) is not None and deadline <= now:
            out += channel.receive(deadline)
        channel.send(i, float(now))
    while (deadline := channel.next_deadline()) is not None:
        out += channel.receive(deadline)
    return out


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(0, 3), min_size=1, max_size=60), st.sampled_from([*ROWS, "none", "lunar"]), st.integers(0, 9)
)
def test_every_packet_arrives_once_and_not_before_its_delay(gaps, name, seed):
    for service in Service:
        out = deliveries(delay_profile(name), service, gaps, seed)
        assert sorted(item.payload for item in out) == list(range(len(gaps)))
        assert all(item.arrived >= item.sent for item in out)
        arrivals = [item.arrived for item in out]
        assert arrivals == sorted(arrivals)
    in_order = deliveries(delay_profile(name), Service.IN_ORDER, gaps, seed)
    assert [item.payload for item in in_order] == list(range(len(gaps)))


def test_datagrams_overtake_and_a_byte_stream_does_not():
    gaps = [1.0] * 300
    order = [item.payload for item in deliveries(delay_profile("tue"), Service.DATAGRAM, gaps)]
    assert order != sorted(order)


def test_same_seed_same_arrivals():
    runs = [deliveries(delay_profile("fri"), Service.DATAGRAM, [0.3] * 50, seed) for seed in (5, 5, 6)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_the_channel_is_bounded_and_time_does_not_run_back():
    channel = Channel(ConstantDelay("constant:9", 9.0), np.random.default_rng(0), capacity=2)
    assert [channel.send(i, 0.0) for i in range(3)] == [9.0, 9.0, None]
    assert channel.receive(8.999) == ()
    assert len(channel.receive(9.0)) == 2
    assert channel.next_deadline() is None
    channel.send(9, 5.0)
    for now in (4.0, float("nan")):
        with pytest.raises(InvalidValueError):
            channel.send(9, now)
