"""The timeline τ: an ordered run of segments that is plan, live state and recording.

A timeline is a value. An edit keeps what lies before a cut, puts new pieces after it and shifts a tail; the
parts that stay are shared, not copied. Segments live in chunks of arrays; a chunk has one time offset, so that
shifting a tail touches an offset a chunk and no segment. A segment starts at `offset + starts[i]`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from vrs.chunk import CAPACITY, HOLD, Chunk, Piece, State
from vrs.commands import finite, finite_array
from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array
from vrs.segment import PolynomialSegment, check_derivative, evaluate, times

_JOINT_TOLERANCE = 1e-6


class Timeline:
    """An immutable run of segments, half-open and contiguous.

    Before the start the initial position is held, after the end the last one.
    """

    __slots__ = ("_chunks", "_counts", "_end", "_first", "_initial", "_offsets", "_start", "version")

    version: int
    """How many edits made it."""

    def __init__(
        self, q: ArrayLike, start: float = 0.0, segments: Iterable[PolynomialSegment] = (), version: int = 0
    ) -> None:
        """Make a timeline that holds q, or that runs through the segments.

        Args:
            q: Initial joints [rad], (n,).
            start: Origin [s].
            segments: Contiguous segments from `start` on, starting at q.
            version: Number of the version.

        Raises:
            InvalidValueError: If the segments leave gaps, overlap, jump or differ in width.
        """
        initial = finite_array("q", q, None, "finite joint values [rad], shape (n,)")
        if initial.ndim != 1 or len(initial) == 0:
            raise InvalidValueError("q", q, "finite joint values [rad], shape (n,)")
        origin = finite("start", start, "finite seconds")
        chunks: list[Chunk] = []
        end, position = origin, initial
        for index, segment in enumerate(segments):
            if segment.coefficients.shape[1] != len(initial):
                raise InvalidValueError(f"segment {index}", segment.coefficients.shape, f"of width {len(initial)}")
            if abs(segment.start - end) > 1e-9 * max(1.0, abs(end)):
                raise InvalidValueError(f"segment {index} start", segment.start, f"contiguous, at {end}")
            if np.abs(segment.coefficients[0] - position).max() > _JOINT_TOLERANCE:
                raise InvalidValueError(f"segment {index} position", segment.coefficients[0], f"at {position}")
            if not chunks or len(chunks[-1].starts) == CAPACITY:
                chunks.append(Chunk([], [], [], []))
            last = chunks[-1]
            last.starts.append(segment.start)
            last.durations.append(segment.duration)
            last.coefficients.append(segment.coefficients)
            last.ids.append(segment.command_id or HOLD)
            end = segment.end
            position = evaluate(segment.coefficients, segment.duration, 0)
        self._set(initial, origin, tuple(chunks), [0.0] * len(chunks), version)

    def _set(
        self,
        initial: Array,
        start: float,
        chunks: tuple[Chunk, ...],
        offsets: list[float],
        version: int,
    ) -> None:
        self._initial = initial
        self._start = start
        self._chunks = chunks
        self._offsets = offsets
        self._end = offsets[-1] + chunks[-1].starts[-1] + chunks[-1].durations[-1] if chunks else start
        self._first = [offset + chunk.starts[0] for offset, chunk in zip(offsets, chunks, strict=True)]
        counts = [0]
        for chunk in chunks:
            counts.append(counts[-1] + len(chunk.starts))
        self._counts = counts
        self.version = version

    @property
    def start(self) -> float:
        """Origin [s]."""
        return self._start

    @property
    def end(self) -> float:
        """End of the last segment [s]; the origin while there's none."""
        return self._end

    @property
    def dof(self) -> int:
        """Number of joints, n."""
        return len(self._initial)

    @property
    def initial(self) -> Array:
        """Joints before the start [rad], (n,)."""
        return self._initial

    @property
    def segments(self) -> SegmentView:
        """The segments, made when they're looked at."""
        return SegmentView(self)

    def __len__(self) -> int:
        return self._counts[-1]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Timeline):
            return False
        head = (self._start, self._end, len(self)) == (other._start, other._end, len(other))
        if not head or not np.array_equal(self._initial, other._initial):
            return False
        return all(a == b for a, b in zip(self.segments, other.segments, strict=True))

    def __hash__(self) -> int:
        return hash((self._start, self._end, len(self), self._initial.tobytes()))

    def __repr__(self) -> str:
        return f"Timeline({len(self)} segments, [{self._start:g}, {self._end:g}) s, version {self.version})"

    def _locate(self, index: int) -> tuple[int, int]:
        c = bisect_right(self._counts, index) - 1
        return c, index - self._counts[c]

    def index_at(self, t: float) -> int:
        """Index of the segment with start ≤ t < end; −1 before the first, len(self) after the last."""
        if not self._chunks or t >= self._end:
            return len(self) if t >= self._end else -1
        c = bisect_right(self._first, t) - 1
        if c < 0:
            return -1
        offset, starts = self._offsets[c], self._chunks[c].starts
        i = bisect_right(starts, t - offset) - 1
        # t − offset is rounded: the comparison that counts is the one with offset + start.
        if i + 1 < len(starts) and offset + starts[i + 1] <= t:
            i += 1
        elif i < 0 or offset + starts[i] > t:
            i -= 1
        return self._counts[c] + max(i, 0)

    def start_of(self, index: int) -> float:
        """Start of a segment [s]; of index len(self), the end."""
        if index >= len(self):
            return self._end
        c, i = self._locate(index)
        return self._offsets[c] + self._chunks[c].starts[i]

    def owner_of(self, index: int) -> int:
        """Command id of a segment, or HOLD."""
        c, i = self._locate(index)
        return self._chunks[c].ids[i]

    def segment(self, index: int) -> PolynomialSegment:
        """The segment at an index, 0 to len(self) − 1."""
        c, i = self._locate(index)
        chunk = self._chunks[c]
        start = self._offsets[c] + chunk.starts[i]
        return PolynomialSegment(start, chunk.durations[i], chunk.coefficients[i], chunk.ids[i] or None)

    def owners(self, low: int, high: int) -> tuple[int, ...]:
        """Distinct command ids of the segments low to high − 1, in order, without holds."""
        found: dict[int, None] = {}
        while low < high:
            c, i = self._locate(low)
            ids = self._chunks[c].ids[i : i + high - low]
            found.update(dict.fromkeys(ids))
            low += len(ids)
        found.pop(HOLD, None)
        return tuple(found)

    def sample(self, t: ArrayLike, *, derivative: int = 0) -> Array:
        """Evaluate the timeline.

        Args:
            t: Timeline time [s], scalar or shape (k,). Before the start the first position is held, after the
                end the last one. At a knot the later segment counts.
            derivative: Order of the time derivative, 0 to 3.

        Returns:
            Joint values [rad / s**derivative], shape (n,) or (k, n).

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
            InvalidValueError: If derivative isn't 0 to 3.
        Source: Doulgeri, Zikos, Delopoulos, eq. (4).
        """
        order = check_derivative(derivative)
        moments = times(t)
        if moments.ndim == 0:
            return self._at(float(moments), order)
        values = np.empty((len(moments), self.dof))
        chunk_of = np.searchsorted(self._first, moments, side="right") - 1
        chunk_of[moments >= self._end] = len(self._chunks)
        order_of = np.argsort(chunk_of, kind="stable")
        present, first = np.unique(chunk_of[order_of], return_index=True)
        for c, rows in zip(present.tolist(), np.split(order_of, first[1:]), strict=True):
            if c < 0 or c == len(self._chunks):
                values[rows] = self._at(float(moments[rows[0]]), order)
                continue
            offset, chunk = self._offsets[c], self._chunks[c]
            starts = offset + chunk.times
            index = np.searchsorted(starts, moments[rows], side="right") - 1
            u = np.maximum(moments[rows] - starts[index], 0.0)
            values[rows] = evaluate(chunk.stacked[index], u, order)
        return values

    def _at(self, t: float, order: int) -> Array:
        index = self.index_at(t)
        if 0 <= index < len(self):
            c, i = self._locate(index)
            chunk = self._chunks[c]
            u = t - (self._offsets[c] + chunk.starts[i])
            return evaluate(chunk.coefficients[i], max(u, 0.0), order)
        if order:
            return np.zeros(self.dof)
        return self._initial.copy() if index < 0 else self.final()

    def final(self) -> Array:
        """Position that is held after the end [rad], (n,)."""
        if not self._chunks:
            return self._initial.copy()
        last = self._chunks[-1]
        return evaluate(last.coefficients[-1], last.durations[-1], 0)

    def state_before(self, t: float) -> State:
        """The state at t as what lies before t makes it: at a knot the earlier segment counts.

        An earlier segment of degree 2 or less that ends at rest leaves no acceleration behind.
        """
        index = self.index_at(t)
        if index >= 0 and (index == len(self) or self.start_of(index) >= t):
            index -= 1
        rest = np.zeros(self.dof)
        if index < 0:
            return State(self._initial.copy(), rest, rest)
        if t > self._end:
            return State(self.final(), rest, rest)
        c, i = self._locate(index)
        chunk = self._chunks[c]
        u = min(t - (self._offsets[c] + chunk.starts[i]), chunk.durations[i])
        a = chunk.coefficients[i]
        q, qd, qdd = (evaluate(a, u, order) for order in range(3))
        qd = np.where(np.abs(qd) < 1e-11, 0.0, qd)
        qdd = np.where(np.abs(qdd) < 1e-9, 0.0, qdd)
        if len(a) < 4 and not qd.any():
            qdd = rest
        return State(q, qd, qdd)

    def state_after(self, index: int) -> State:
        """The state at the start of a segment, as the segment has it."""
        c, i = self._locate(index)
        a = self._chunks[c].coefficients[i]
        q, qd, qdd = (evaluate(a, 0.0, order) for order in range(3))
        return State(q, qd, qdd)

    def edited(
        self, cut: float, pieces: Iterable[Piece], tail: int | None = None, tail_start: float | None = None
    ) -> Timeline:
        """Keep what lies before `cut`, put pieces there, and let the segments from `tail` on follow.

        Args:
            cut: Time of the cut [s]; the segment that it falls into keeps its coefficients and is shortened.
                After the end a hold fills the gap; before the start the timeline begins at the cut.
            pieces: What comes instead.
            tail: Index, in this timeline, of the first segment that stays after the pieces; None for none.
            tail_start: Time at which the tail starts [s].
        """
        chunks, offsets, start = self._head(cut)
        if cut > self._end or (not chunks and cut > start):
            pieces = (Piece([cut - self._end], [frozen_array(self.final()[None])], HOLD), *pieces)
            cut = self._end
        moment = cut
        fresh = Chunk([], [], [], [])
        for piece in pieces:
            for duration, a in zip(piece.durations, piece.coefficients, strict=True):
                if len(fresh.starts) == CAPACITY:
                    self._join(chunks, offsets, fresh, 0.0)
                    fresh = Chunk([], [], [], [])
                fresh.starts.append(moment)
                fresh.durations.append(duration)
                fresh.coefficients.append(a)
                fresh.ids.append(piece.command_id)
                moment += duration
        if fresh.starts:
            self._join(chunks, offsets, fresh, 0.0)
        if tail is not None and tail_start is not None and tail < len(self):
            c, i = self._locate(tail)
            old = self._first[c] if i == 0 else self._offsets[c] + self._chunks[c].starts[i]
            delta = tail_start - old
            first = self._chunks[c].part(i, len(self._chunks[c].starts)) if i else self._chunks[c]
            self._join(chunks, offsets, first, self._offsets[c] + delta)
            chunks.extend(self._chunks[c + 1 :])
            later = self._offsets[c + 1 :]
            offsets.extend((np.asarray(later) + delta).tolist() if delta and later else later)
        result = Timeline.__new__(Timeline)
        result._set(self._initial, start, tuple(chunks), offsets, self.version + 1)
        return result

    def _head(self, cut: float) -> tuple[list[Chunk], list[float], float]:
        """Chunks and offsets of what lies before the cut, and the start."""
        index = self.index_at(cut)
        if index >= len(self):
            return list(self._chunks), list(self._offsets), min(self._start, cut)
        if index < 0:
            return [], [], min(self._start, cut)
        c, i = self._locate(index)
        chunk, offset = self._chunks[c], self._offsets[c]
        shortened = cut - (offset + chunk.starts[i])
        count = i + 1 if shortened > 0 else i
        chunks, offsets = list(self._chunks[:c]), self._offsets[:c]
        if count:
            part = chunk.part(0, count)
            if shortened > 0:
                part.durations[-1] = shortened
            chunks.append(part)
            offsets.append(offset)
        return chunks, offsets, self._start

    @staticmethod
    def _join(chunks: list[Chunk], offsets: list[float], chunk: Chunk, offset: float) -> None:
        """Append a chunk, merged with the one before it where both are small."""
        if chunks and len(chunks[-1].starts) + len(chunk.starts) <= CAPACITY:
            # Absolute starts: a start that is a command's time stays that time to the bit.
            last, base = chunks[-1], offsets[-1]
            offsets[-1] = 0.0
            chunks[-1] = Chunk(
                [base + s for s in last.starts] + [offset + s for s in chunk.starts],
                last.durations + chunk.durations,
                last.coefficients + chunk.coefficients,
                last.ids + chunk.ids,
            )
            return
        chunks.append(chunk)
        offsets.append(offset)

    def with_version(self, version: int) -> Timeline:
        """The same timeline under another version number."""
        result = Timeline.__new__(Timeline)
        result._set(self._initial, self._start, self._chunks, self._offsets, version)
        return result


class SegmentView(Sequence[PolynomialSegment]):
    """A timeline's segments, made one by one as they're asked for."""

    __slots__ = ("_timeline",)

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline

    def __len__(self) -> int:
        return len(self._timeline)

    @overload
    def __getitem__(self, index: int) -> PolynomialSegment: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[PolynomialSegment, ...]: ...
    def __getitem__(self, index: int | slice) -> PolynomialSegment | tuple[PolynomialSegment, ...]:
        if isinstance(index, slice):
            return tuple(self._timeline.segment(i) for i in range(*index.indices(len(self))))
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        return self._timeline.segment(index % len(self))

    def __iter__(self) -> Iterator[PolynomialSegment]:
        return (self._timeline.segment(i) for i in range(len(self)))

    def __repr__(self) -> str:
        return f"<{len(self)} segments>"
