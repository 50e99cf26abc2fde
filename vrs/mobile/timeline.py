"""The timeline of a mobile robot: exact arcs, one after the other, on the tree that joints have too."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Sequence
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array
from vrs.errors import InvalidValueError, NonFiniteTimeError
from vrs.mobile.model import advanced, displaced, on_arcs, wrapped
from vrs.model import Array
from vrs.segment import HOLD, ArcSegment, check_derivative, known_arc, times
from vrs.timeline import BaseTimeline, remade
from vrs.tree import Node, Run, leaves, splice

_Posture = tuple[float, float, float]
_row = Struct("=5d")
_WIDTH = 5
_ALLOWED = "three finite numbers (x, y, θ)"
_TOLERANCE = 1e-6
"""Jump of a posture [m or rad] between segments that's only rounding."""
_SPARSE = 8
"""Segments in between for each time asked for, from which on the times are looked up one by one."""


class ArcPiece(NamedTuple):
    """A new arc for an edit: it begins where the one before it ends."""

    duration: float
    """[s], positive."""
    v: float
    """[m/s]."""
    w: float
    """[rad/s]."""
    command_id: int
    """Who made it; HOLD for standing."""


class ArcTimeline(BaseTimeline[ArcSegment]):
    """An immutable run of arcs, half-open and contiguous.

    Before the start the robot stands at the initial posture, after the end at the last one. θ isn't wrapped.
    """

    __slots__ = ("_final", "_found")

    def __init__(
        self,
        posture: ArrayLike = (0.0, 0.0, 0.0),
        start: float = 0.0,
        segments: Iterable[ArcSegment] = (),
        version: int = 0,
    ) -> None:
        """Make a timeline that stands at a posture, or that runs along the arcs.

        Args:
            posture: Initial (x, y, θ) [m, m, rad], (3,).
            start: Origin [s].
            segments: Contiguous arcs from `start` on, from the initial posture on.
            version: Number of the version.

        Raises:
            InvalidValueError: If the arcs leave gaps, overlap or jump.
        """
        initial = finite_array("posture", posture, (3,), _ALLOWED)
        origin = finite("start", start, "finite seconds")
        self._set(initial, origin, *splice(0, None, None, _checked(segments, origin, initial)), version)

    def _set(self, initial: Array, start: float, root: Node | None, height: int, version: int) -> None:
        super()._set(initial, start, root, height, version)
        self._final: _Posture | None = None
        self._found: tuple[float, float, tuple[float, ...]] = math.inf, -math.inf, ()

    @property
    def initial(self) -> Array:
        """Posture before the start, (3,)."""
        return self._initial

    def segment(self, index: int) -> ArcSegment:
        """The arc at an index, 0 to len(self) − 1."""
        leaf, i, offset = self._locate(index)
        x, y, theta, v, w = _row.unpack(leaf.rows[i])
        return known_arc(offset + leaf.starts[i], leaf.durations[i], (x, y, theta), v, w, leaf.owners[i] or None)

    def sample(self, t: ArrayLike, *, derivative: int = 0) -> Array:
        """Evaluate the timeline: g for a mobile robot.

        Args:
            t: Timeline time [s], scalar or (k,). Before the start the robot stands, after the end too. At a knot
                the later arc counts.
            derivative: Order of the time derivative, 0 to 3.

        Returns:
            Postures (x, y, θ), [m or rad / s**derivative], (3,) or (k, 3).

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
            InvalidValueError: If derivative isn't 0 to 3.
        """
        if derivative == 0 and isinstance(t, float):
            return np.array(self.posture_at(t))
        order = check_derivative(derivative)
        moments = times(t)
        if moments.ndim == 0:
            one: Array = self.sample(moments[None], derivative=order)[0]
            return one
        starts, rows = self._arcs(moments)
        return on_arcs(rows, moments - starts, order)

    def speeds_before(self, t: float) -> tuple[float, float]:
        """V and ω [m/s, rad/s] on the arc that leads to t; 0 up to the start, and from the end on."""
        if self._root is None or not self._first < t < self._end:
            return 0.0, 0.0
        index = self.index_at(t)
        leaf, i, offset = self._locate(index)
        if offset + leaf.starts[i] >= t:
            leaf, i, offset = self._locate(index - 1)
        _, _, _, v, w = _row.unpack(leaf.rows[i])
        return v, w

    def posture_at(self, t: float) -> _Posture:
        """The posture at a finite time [s], as plain numbers."""
        start, end, row = self._found
        if not start <= t < end:
            start, _, row = self._find(t)
        x, y, theta, v, w = row
        return advanced((x, y, theta), v, w, t - start)

    def edited(
        self, cut: float, pieces: Sequence[ArcPiece], tail: int | None = None, tail_start: float = 0.0
    ) -> ArcTimeline:
        """Keep what lies before `cut`, put arcs there, and let the segments from `tail` on follow.

        The tail keeps its speeds, durations and the spans between them to the last bit; as a rigid body it's
        moved to where the new arcs end.

        Args:
            cut: Time of the cut [s]; the arc that it falls into is shortened. After the end the robot stands
                until then; before the start the timeline begins at the cut.
            pieces: What comes instead.
            tail: Index, in this timeline, of the first segment that stays after the new ones; None for none.
            tail_start: Time at which the tail starts [s].
        """
        start, height = self._start, self._height
        left, last = self._cut(cut)
        here = self._last() if cut >= self._end else self.posture_at(cut)
        begin, made = cut, list(pieces)
        if self._root is None or not self._first <= cut < self._end:
            start = min(start, cut)
            if cut > self._end:
                made.insert(0, ArcPiece(cut - self._end, 0.0, 0.0, HOLD))
                begin = self._end
        starts, durations, owners, rows = array("d"), array("d"), array("q"), list[bytes]()
        for duration, v, w, owner in made:
            starts.append(begin)
            durations.append(duration)
            owners.append(owner)
            rows.append(_row.pack(*here, v, w))
            begin, here = begin + duration, advanced(here, v, w, duration)
        if tail is not None and tail < self._count:
            times_, arcs, lasting, theirs = self._columns(tail, self._count)
            delta = tail_start - times_[0]
            starts = array("d", [min(known, tail_start) for known in starts])
            starts += array("d", (times_ + delta).tobytes())
            durations += lasting
            owners += theirs
            x, y, theta = arcs[0, :3].tolist()
            data = displaced(arcs, (x, y, theta), here).tobytes()
            rows += [data[k : k + _row.size] for k in range(0, len(data), _row.size)]
        tree = splice(height, left, last, Run(starts, durations, owners, tuple(rows)))
        return remade(ArcTimeline, self._initial, start, *tree, self.version + 1)

    def _columns(self, low: int, high: int) -> tuple[Array, Array, array[float], array[int]]:
        """Starts (m,), rows (m, 5), durations and owners of the segments low to high − 1."""
        starts, rows = [np.empty(0)], bytearray()
        durations, owners = array("d"), array("q")
        for leaf, part, offset in leaves(self._root, self._height, low, high):
            starts.append(offset + np.frombuffer(leaf.starts)[part])
            rows += b"".join(leaf.rows[part])
            durations += leaf.durations[part]
            owners += leaf.owners[part]
        return np.concatenate(starts), np.frombuffer(rows).reshape(-1, _WIDTH), durations, owners

    def _arcs(self, t: Array) -> tuple[Array, Array]:
        """Starts (k,) and rows (k, 5) of the arcs at times (k,)."""
        low = high = 0
        if len(t) and self._count:
            low = max(self.index_at(float(t.min())), 0)
            high = min(self.index_at(float(t.max())) + 1, self._count)
        if high - low > _SPARSE * len(t) or not self._count:
            found = [self._find(moment) for moment in t.tolist()]
            return np.array([f[0] for f in found]), np.array([f[2] for f in found]).reshape(-1, _WIDTH)
        starts, rows, _, _ = self._columns(low, high)
        begin, end = [self._first], [self._end]
        standing = np.array([[*self._initial, 0.0, 0.0], [*self._last(), 0.0, 0.0]])
        place = np.searchsorted(starts, t, side="right")
        place[t < self._first] = 0
        place[t >= self._end] = len(starts) + 1
        return np.concatenate([begin, starts, end])[place], np.concatenate([standing[:1], rows, standing[1:]])[
            place
        ]

    def _find(self, t: float) -> tuple[float, float, tuple[float, ...]]:
        """Start and end of the arc at a time, and x, y, θ at its start, v and ω."""
        if not self._first <= t < self._end or self._root is None:
            if not math.isfinite(t):
                raise NonFiniteTimeError(t)
            if t < self._first or self._root is None:
                x, y, theta = self._initial.tolist()
                return t, t, (x, y, theta, 0.0, 0.0)
            return self._end, math.inf, (*self._last(), 0.0, 0.0)
        index, (_, leaf, i, offset) = self._way_at(t)
        end = offset + leaf.starts[i + 1] if i + 1 < leaf.count else self.start_of(index + 1)
        self._found = found = offset + leaf.starts[i], end, _row.unpack(leaf.rows[i])
        return found

    def _last(self) -> _Posture:
        """Where the robot stands after the end."""
        if self._final is None:
            if self._count:
                leaf, i, _ = self._locate(self._count - 1)
                x, y, theta, v, w = _row.unpack(leaf.rows[i])
                self._final = advanced((x, y, theta), v, w, leaf.durations[i])
            else:
                x, y, theta = self._initial.tolist()
                self._final = x, y, theta
        return self._final


def _checked(segments: Iterable[ArcSegment], start: float, posture: Array) -> Run:
    """Arcs that begin at a time [s] and at a posture (3,).

    Raises:
        InvalidValueError: If they leave gaps, overlap or jump.
    """
    starts, durations, owners, rows = array("d"), array("d"), array("q"), list[bytes]()
    end, here = start, tuple(posture.tolist())
    for index, arc in enumerate(segments):
        if not isinstance(arc, ArcSegment):
            raise InvalidValueError(f"segment {index}", arc, "an ArcSegment")
        if abs(arc.start - end) > 1e-9 * max(1.0, abs(end)):
            raise InvalidValueError(f"segment {index} start", arc.start, f"contiguous, at {end}")
        x, y, theta = arc.posture
        if max(abs(x - here[0]), abs(y - here[1]), abs(wrapped(theta - here[2]))) > _TOLERANCE:
            raise InvalidValueError(f"segment {index} posture", arc.posture, f"at {here}")
        # What's only rounding doesn't let a segment start before the one that it follows.
        starts.append(max(arc.start, starts[-1]) if starts else arc.start)
        durations.append(arc.duration)
        owners.append(arc.command_id or HOLD)
        rows.append(_row.pack(x, y, theta, arc.v, arc.w))
        end = arc.end
        here = advanced(arc.posture, arc.v, arc.w, arc.duration)
    return Run(starts, durations, owners, tuple(rows))
