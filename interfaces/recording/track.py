"""Recorded messages: those of a channel, and samples over time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from interfaces.messages import recording as d
from interfaces.messages.fields import rich
from interfaces.messages.recording import RealSample
from interfaces.recording.channels import CHANNELS
from interfaces.recording.mcap_reading import NUMBERS, Blocks
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array, frozen_array

DECODERS = {
    number: msgspec.json.Decoder(reduce(or_, channel.kinds), dec_hook=rich)
    for number, channel in enumerate(CHANNELS, 1)
}
"""By number of the channel."""
DECODING = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
"""What decoders raise."""


class Log:
    """All messages of a channel: read when they're asked for first, and those that have come since."""

    def __init__(self, blocks: Blocks, topic: str, where: str) -> None:
        self._blocks, self._where = blocks, where
        self._number = NUMBERS[topic]
        self._seen = 0
        self._found: list[Any] = []

    def entries(self) -> list[Any]:
        """The messages.

        Raises:
            FormatError: If one isn't what the channel's schema says.
        """
        count = len(self._blocks)
        if self._seen < count:
            for index in self._blocks.having(self._number):
                if index >= self._seen:
                    self._found += self.of(index)
            self._seen = count
        return self._found

    def of(self, index: int) -> list[Any]:
        """The messages in one block.

        Raises:
            FormatError: See `entries`.
        """
        return [self._decoded(data) for data in self._blocks.read(index, self._number)]

    def _decoded(self, data: bytes) -> Any:
        try:
            return DECODERS[self._number].decode(data)
        except DECODING as error:
            raise unreadable(self._where, self._number, error) from None


def unreadable(where: str, number: int, error: Exception) -> FormatError:
    """A message that isn't what its channel's schema says."""
    return FormatError(where, f"a message on {CHANNELS[number - 1].topic}: {error}")


GAP = 0.1
"""Between neighbours that are further apart [s] nothing was measured: no line is drawn, and nothing is compared."""
APART = GAP + 1e-6
"""The same, with what rounding makes of it."""
AROUND = 1.5
"""Samples from so long before and after one moment are kept for the next [s]."""
VIRTUAL, REAL = "/virtual/joints", "/real/joints"
VIRTUAL_POSTURE, REAL_POSTURE = "/virtual/posture", "/real/posture"
MEASURED, ESTIMATED = "/real/measured", "/virtual/estimated"
_DECODERS: dict[str, msgspec.json.Decoder[Any]] = {
    channel.topic: msgspec.json.Decoder(list[channel.kinds[0]])  # type: ignore[name-defined]
    for channel in CHANNELS
    if channel.topic in {VIRTUAL, REAL, VIRTUAL_POSTURE, REAL_POSTURE, MEASURED, ESTIMATED}
}


@dataclass(frozen=True, slots=True, eq=False)
class SampleTrack:
    """Samples, ascending in time; arrays of m rows, read-only."""

    t: Array
    """User time [s], (m,)."""
    q: Array
    """Joints [rad], (m, n), or postures (x, y, θ) [m, m, rad], (m, 3)."""
    play: Array
    """Play time [s], (m,); of the virtual robot the user's."""
    reference: Array
    """What the real robot's own timeline asked for [rad], (m, n); of a mobile robot what it was told, v and ω
    [m/s, rad/s], (m, 2). NaN where that isn't known."""
    edit: Array
    """Number of the virtual robot's newest edit, (m,); 0 of the real one."""
    block: Array
    """Which block of the file a sample stands in, (m,)."""

    @property
    def gaps(self) -> Array:
        """From when to when nothing was measured between two samples [s], (k, 2)."""
        after = np.flatnonzero(np.diff(self.t) > APART)
        return np.stack((self.t[after], self.t[after + 1]), axis=1)

    def on(self, t: Array, column: str) -> Array:
        """Values at times, linear between neighbours, across gaps too, and held outside; see `unmeasured`.

        Args:
            t: [s], (k,).
            column: `q`, `play` or `reference`.
        """
        values: Array = getattr(self, column)
        flat = values.reshape(len(values), -1)
        found = np.stack([np.interp(t, self.t, one) for one in flat.T], axis=1)
        return found.reshape(len(t), *values.shape[1:])

    def unmeasured(self, t: Array) -> NDArray[np.bool_]:
        """Whether times [s], (k,), lie in gaps, or outside of the samples."""
        gaps = self.gaps
        left = np.searchsorted(gaps[:, 0], t, side="left") - 1
        inside = (left >= 0) & (t < gaps[np.maximum(left, 0), 1]) if len(gaps) else np.zeros(len(t), dtype=bool)
        return np.asarray(inside | (t < self.t[0] - 1e-6) | (t > self.t[-1] + 1e-6))

    def gap_lengths(self, t: Array) -> Array:
        """How long each span was in which nothing was measured [s], within times [s], (k,)."""
        outside = np.array([self.t[0] - t[0], t[-1] - self.t[-1]])
        return np.concatenate((self.gaps[:, 1] - self.gaps[:, 0], outside[outside > 1e-6]))

    def not_measured(self, t: Array) -> list[str]:
        """Says for how long nothing was measured within times [s], (k,), if there's such a time."""
        lengths = self.gap_lengths(t)
        if not len(lengths):
            return []
        what = f"samples of the real robot for {lengths.sum():.1f} s, {lengths.max():.1f} s on end at most"
        return [f"{what}: nothing is compared there"]


class Tracks:
    """The samples of both robots in a file."""

    def __init__(self, blocks: Blocks, dof: int, told: int, where: str) -> None:
        self._blocks, self._dof, self._told, self._where = blocks, dof, told, where
        self._near: dict[str, tuple[float, float, int, SampleTrack]] = {}

    def between(self, topic: str, since: float, until: float) -> SampleTrack:
        """The samples of a time, both ends included [s].

        Raises:
            InvalidValueError: If the topic has none.
            FormatError: If a sample is none.
        """
        if topic not in _DECODERS:
            raise InvalidValueError("topic", topic, ", ".join(_DECODERS))
        number, found, places = NUMBERS[topic], [], []
        for index in self._blocks.having(number, since * 1e9 - 1, until * 1e9 + 1):
            data = b"[" + b",".join(self._blocks.read(index, number)) + b"]"
            try:
                samples = _DECODERS[topic].decode(data)
            except DECODING as error:
                raise unreadable(self._where, number, error) from None
            found += samples
            places += [index] * len(samples)
        return self._track(found, places, since, until)

    def _track(self, samples: list[Any], places: list[int], since: float, until: float) -> SampleTrack:
        n, told = self._dof, self._told
        if any(len(sample.q) != n for sample in samples):
            raise FormatError(self._where, f"a sample that hasn't {n} joints")
        real = bool(samples) and isinstance(samples[0], RealSample | d.RealPosture)
        t: Array = np.array([sample.t for sample in samples])
        q: Array = np.array([sample.q for sample in samples]).reshape(-1, n)
        play, edit, reference = t, np.zeros(len(t)), np.full((len(q), told), math.nan)
        if real:
            play = np.array([sample.play for sample in samples])
            references = [sample.reference for sample in samples]
            if any(row is not None and len(row) != told for row in references):
                raise FormatError(self._where, f"a reference that hasn't {told} joints")
            unknown = [math.nan] * told
            reference = np.array([unknown if row is None else row for row in references]).reshape(-1, told)
        else:
            edit = np.array([float(sample.edit) for sample in samples])
        kept = np.argsort(t, kind="stable")
        kept = kept[(t[kept] >= since) & (t[kept] <= until)]
        if len(kept) > 1:
            kept = kept[np.append(np.diff(t[kept]) > 0, True)]
        return SampleTrack(
            *(frozen_array(column[kept]) for column in (t, q, play, reference, edit, np.array(places)))
        )

    def at(self, topic: str, t: Array, column: str) -> Array:
        """Values at times, linear between neighbours.

        Args:
            topic: The robot's.
            t: User time [s], (k,), finite.
            column: `q`, `play` or `reference`.

        Returns:
            (k, n), or (k,) of the play time; NaN where nothing is known.
        """
        shape = {"play": (len(t),), "reference": (len(t), self._told)}.get(column, (len(t), self._dof))
        found: Array = np.full(shape, np.nan)
        order = np.argsort(t, kind="stable")
        cuts = np.flatnonzero(np.diff(t[order]) > 2 * AROUND) + 1
        for part in np.split(order, cuts):
            if len(part):
                track = self._around(topic, float(t[part[0]]), float(t[part[-1]]))
                found[part] = self._interpolated(topic, track, t[part], column)
        return found

    def _around(self, topic: str, first: float, last: float) -> SampleTrack:
        known = self._near.get(topic)
        if (
            known is not None
            and known[2] == len(self._blocks)
            and known[0] <= first - APART
            and last + APART <= known[1]
        ):
            return known[3]
        since, until = first - AROUND, last + AROUND
        track = self.between(topic, since, until)
        self._near[topic] = since, until, len(self._blocks), track
        return track

    def _interpolated(self, topic: str, track: SampleTrack, t: Array, column: str) -> Array:
        values: Array = getattr(track, column)
        found: Array = np.full((len(t), *values.shape[1:]), np.nan)
        if not len(track.t):
            return found
        right = np.searchsorted(track.t, t, side="left")
        exact = (right < len(track.t)) & (track.t[np.minimum(right, len(track.t) - 1)] == t)
        found[exact] = values[right[exact]]
        inside = ~exact & (right > 0) & (right < len(track.t))
        right = right[inside]
        low, high = track.t[right - 1], track.t[right]
        share = (t[inside] - low) / (high - low)
        breaks = self._blocks.breaks(NUMBERS[topic])
        # What came late stands in a later block than what was measured after it.
        before, after = np.sort(np.stack((track.block[right - 1], track.block[right])), axis=0)
        whole = np.searchsorted(breaks, before, "right") == np.searchsorted(breaks, after, "left")
        known = (high - low <= APART) & whole
        if values.ndim > 1:
            share, known = share[:, None], known[:, None]
        found[inside] = np.where(known, values[right - 1] + share * (values[right] - values[right - 1]), np.nan)
        return found
