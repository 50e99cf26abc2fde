"""The serial frame, and scans of a moving robot as seen from one place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.onboard.gsp_map import GspMap, Lines
from robots.onboard.laser import (
    BEAMS,
    FrameReader,
    LaserModel,
    LaserScan,
    OdometryTrack,
    beam_angles,
    checksum,
    decode_scan,
    deskewed,
    encode_scan,
)
from robots.onboard.line_filter import LineFilter
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import advanced


def ranges(seed: int, beams: int = 361) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.where(rng.random(beams) < 0.1, np.inf, np.round(rng.uniform(0, 8.19, beams), 3))


@pytest.mark.parametrize(("beams", "size"), [(361, 733), (181, 373), (721, 1453)])
def test_a_frame_has_two_bytes_a_beam_and_eleven_more_and_reads_back(beams: int, size: int) -> None:
    told = ranges(1, beams)
    frame = encode_scan(told)
    assert len(frame) == size
    assert np.array_equal(decode_scan(frame), told)


def test_the_checksum_is_a_remainder_by_its_polynomial() -> None:
    # Longhand: each byte comes in beside the one before it, a bit carried out takes the polynomial.
    value, before = 0, 0
    for byte in b"\x02\x80\x06\x00\xb0":
        carry, value = value >> 15, value << 1 & 0xFFFF
        value ^= (0x8005 if carry else 0) ^ byte ^ before * 256
        before = byte
    assert checksum(b"\x02\x80\x06\x00\xb0") == value


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 732), st.integers(1, 255))
def test_a_flipped_byte_is_noticed(at: int, flip: int) -> None:
    frame = bytearray(encode_scan(ranges(2)))
    frame[at] ^= flip
    with pytest.raises(FormatError):
        decode_scan(bytes(frame))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=40), st.integers(0, 2)), max_size=6), st.integers(1, 300))
def test_a_stream_gives_its_frames_whatever_is_between_and_however_it_is_cut(parts: list, cut: int) -> None:
    frames = [encode_scan(ranges(k, BEAMS[k])) for k in range(3)]
    noise = [part.replace(b"\x06", b"\x07") if isinstance(part, bytes) else frames[part] for part in parts]
    stream, reader, found = b"".join(noise), FrameReader(), []
    for k in range(0, len(stream), cut):
        found += reader.receive(stream[k : k + cut])
    assert [encode_scan(one) for one in found] == [frames[part] for part in parts if isinstance(part, int)]


def test_after_a_broken_frame_the_next_whole_one_is_found() -> None:
    frame = encode_scan(ranges(3))
    reader = FrameReader()
    assert len(reader.receive(frame[:400] + frame + frame)) == 2


@pytest.mark.parametrize("bad", [np.zeros(360), np.full(361, -0.1), np.full(361, 9.0), np.full(361, np.nan)])
def test_what_is_no_scan_makes_no_frame(bad: np.ndarray) -> None:
    with pytest.raises(InvalidValueError, match="ranges"):
        encode_scan(bad)


@pytest.mark.parametrize(
    "wrong", [{"rate": 10.0}, {"step_deg": 0.3}, {"reach": 9.0}, {"sweep": 0.3}, {"rate": 25.0, "sweep": 0.05}]
)
def test_the_scanner_has_the_settings_that_it_has(wrong: dict) -> None:
    with pytest.raises(InvalidValueError):
        LaserModel(**wrong)


@pytest.mark.parametrize("w", [0.0, 0.7, -0.5])
def test_a_moving_robots_scan_is_put_into_one_frame_exactly(w: float) -> None:
    """A wall x = 3 from a robot on an arc: de-skewed, all points lie on it as seen from the last posture."""
    scan_time, sweep, forward, v = 1.0, 0.1, 0.1, 0.4
    angles, count = beam_angles(361), 361
    track, told = OdometryTrack(), np.full(count, np.inf)
    # Odometry has a frame of its own: turned by 2 rad, and moved.
    for k in range(241):
        t = 0.9 + 0.001 * k
        track.add(t, advanced((5.0, -3.0, 2.0), v, w, t - 0.9))
    for k in range(count):
        x, _, theta = advanced((0.0, 0.0, 0.1), v, w, scan_time + sweep * k / 360 - 0.9)
        way = math.cos(theta + angles[k])
        if way > 0.3:
            told[k] = (3.0 - x - forward * math.cos(theta)) / way
    points = deskewed(LaserScan(scan_time, told, sweep, forward), track)
    x, _, theta = advanced((0.0, 0.0, 0.1), v, w, 1.14 - 0.9)
    world_x = x + points.places @ (math.cos(theta), -math.sin(theta))
    assert np.abs(world_x - 3.0).max() < 1e-6
    assert np.allclose(points.ranges, told[points.beams])
    # Without odometry the same scan is bent by centimetres.
    still = deskewed(LaserScan(scan_time, told, sweep, forward))
    bent = np.ptp(still.places @ (math.cos(theta), -math.sin(theta)))
    assert bent > 0.02


def test_numbers_that_are_none_are_refused() -> None:
    for ranges in (np.zeros(1), np.array([1.0, np.nan]), np.array([1.0, -1.0])):
        with pytest.raises(InvalidValueError, match="ranges"):
            LaserScan(0.0, ranges)
    with pytest.raises(InvalidValueError, match="odometry"):
        OdometryTrack().add(0.0, (0.0, math.nan, 0.0))
    for posture, doubt in (((0.0, math.inf, 0.0), np.eye(3)), ((0.0, 0.0, 0.0), -np.eye(3))):
        with pytest.raises(InvalidValueError):
            LineFilter(posture, doubt, GspMap.of("", Lines.none()))


def test_a_scan_that_the_odometry_does_not_cover_waits() -> None:
    track = OdometryTrack()
    assert not track.covers(0.0, 0.0)
    track.add(0.0, (0.0, 0.0, 0.0))
    track.add(0.05, (0.0, 0.0, 0.0))
    assert track.covers(0.0, 0.05)
    assert not track.covers(0.04, 0.07)


def test_a_scanner_that_is_unwell_is_not_believed() -> None:
    frame = bytearray(encode_scan(ranges(3)))
    frame[-3] = 0x10
    frame[-2:] = checksum(bytes(frame[1:-2])).to_bytes(2, "little")
    with pytest.raises(FormatError, match="status 16"):
        decode_scan(bytes(frame))
