"""Pictures and sound as browsers take them: VP8 and Opus by PyAV, of the extra `[media]`."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Sequence
from fractions import Fraction
from importlib.util import find_spec
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

VIDEO_CLOCK: Final = 90_000
"""RTP's clock of video [1/s]."""
SOUND_RATE: Final = 48_000
"""Samples a second of Opus, and RTP's clock of it [1/s]."""
SOUND_PERIOD: Final = 0.02
"""Length of an Opus packet [s]."""
BITS: Final = 800_000
"""Of video a second at most."""
KEY_PERIOD: Final = 2.0
"""Time between two whole pictures [s]: so long at most a receiver that lost one shows nothing new."""
_LEAD_OUT: Final = 0.08
"""Silence after what is said [s]: the last sound isn't cut off."""


def missing() -> str:
    """What the extra `[media]` would bring and isn't there; empty where it's whole."""
    return ", ".join(name for name in ("aiortc", "av") if find_spec(name) is None)


VideoEncoder: TypeAlias = Callable[[NDArray[np.uint8], bool], tuple[bytes, bool]]
"""Encodes a picture, red, green, blue, (height, width, 3), whole if asked for; others refer to the one before.

It gives the frame, and whether it's whole.
"""


def video_encoder(width: int, height: int, rate: float) -> VideoEncoder:
    """Begin one stream of VP8 for any number of receivers.

    Args:
        width: Pixels across.
        height: Pixels down.
        rate: Pictures a second.
    """
    import av

    codec: Any = av.CodecContext.create("libvpx", "w")
    codec.width, codec.height, codec.pix_fmt = width, height, "yuv420p"
    codec.bit_rate = BITS
    codec.time_base = Fraction(1, VIDEO_CLOCK)
    codec.framerate = Fraction(rate).limit_denominator(1000)
    codec.gop_size = max(1, round(KEY_PERIOD * rate))
    codec.options = {"cpu-used": "-6", "deadline": "realtime", "lag-in-frames": "0"}
    codec.thread_count = 1
    times = itertools.count(0, round(VIDEO_CLOCK / rate))

    def encode(picture: NDArray[np.uint8], key: bool) -> tuple[bytes, bool]:
        frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="yuv420p")
        frame.pts, frame.time_base = next(times), Fraction(1, VIDEO_CLOCK)
        if key:
            frame.pict_type = av.video.frame.PictureType.I
        packets = codec.encode(frame)
        return b"".join(bytes(packet) for packet in packets), any(packet.is_keyframe for packet in packets)

    return encode


SoundEncoder: TypeAlias = Callable[[Any], bytes]
"""Encodes a frame of `SOUND_PERIOD`: 16 bits, two channels, `SOUND_RATE`."""


def _sound_encoder(application: str) -> SoundEncoder:
    """Begin a stream of Opus, for one of its applications."""
    import av

    codec: Any = av.CodecContext.create("libopus", "w")
    codec.bit_rate, codec.format, codec.layout, codec.sample_rate = 48_000, "s16", "stereo", SOUND_RATE
    codec.time_base, codec.options = Fraction(1, SOUND_RATE), {"application": application}
    return lambda frame: b"".join(bytes(packet) for packet in codec.encode(frame))


def room_encoder() -> Callable[[NDArray[np.int16]], bytes]:
    """Begin one stream of Opus of a microphone: it takes the samples of each `SOUND_PERIOD`, (960,)."""
    import av

    encode, times = _sound_encoder("audio"), itertools.count(0, round(SOUND_RATE * SOUND_PERIOD))

    def packet(samples: NDArray[np.int16]) -> bytes:
        frame = av.AudioFrame.from_ndarray(np.repeat(samples, 2)[None], format="s16", layout="stereo")
        frame.sample_rate, frame.pts = SOUND_RATE, next(times)
        return encode(frame)

    return packet


def encode_sound(samples: NDArray[np.int16], rate: int) -> tuple[bytes, ...]:
    """Encode what is said.

    Args:
        samples: (k,), one channel.
        rate: Samples a second.

    Returns:
        Opus packets, of `SOUND_PERIOD` each.
    """
    import av

    encode = _sound_encoder("voip")
    quiet = np.zeros(round(_LEAD_OUT * rate), dtype=np.int16)
    frame = av.AudioFrame.from_ndarray(np.concatenate([samples, quiet])[None], format="s16", layout="mono")
    frame.sample_rate, frame.pts = rate, 0
    size = round(SOUND_RATE * SOUND_PERIOD)
    resampler = av.AudioResampler(format="s16", layout="stereo", rate=SOUND_RATE, frame_size=size)
    frames = [*resampler.resample(frame), *resampler.resample(None)]
    whole = [part for part in frames if part.samples == size]
    return tuple(encode(part) for part in whole)


SILENCE: Final = b"\xfc\xff\xfe"
"""An Opus packet of 20 ms in stereo in which nothing is heard."""
LEAD: Final = 0.1
"""What is to be said begins so much later [s], so that nobody who listens misses its beginning."""


class VoicePlayout:
    """Which packet is heard at which time, by everybody alike."""

    def __init__(self) -> None:
        """Be silent."""
        self._said: deque[tuple[float, tuple[bytes, ...]]] = deque()

    def say(self, packets: Sequence[bytes], *, now: float) -> tuple[float, float]:
        """Let something be heard, after what is being said.

        Args:
            packets: Of `SOUND_PERIOD` each.
            now: [s].

        Returns:
            When it begins and when it's over [s].
        """
        begin = max(now + LEAD, self.end)
        while self._said and _end(*self._said[0]) < now - LEAD:
            self._said.popleft()
        self._said.append((begin, tuple(packets)))
        return begin, self.end

    def hush(self) -> None:
        """Be silent at once."""
        self._said.clear()

    @property
    def end(self) -> float:
        """When nothing is said any more [s]; −∞ while nothing ever was."""
        return _end(*self._said[-1]) if self._said else -math.inf

    def at(self, t: float) -> bytes:
        """The packet that is heard at a time [s]."""
        for begin, packets in self._said:
            if begin <= t < _end(begin, packets):
                return packets[min(int((t - begin) / SOUND_PERIOD), len(packets) - 1)]
        return SILENCE


def _end(begin: float, packets: Sequence[bytes]) -> float:
    return begin + len(packets) * SOUND_PERIOD
