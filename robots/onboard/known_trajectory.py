"""What a robot knows of the operator's trajectory: final arcs without a gap, and the braking tail after them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

from robots.onboard.driving import Posture
from vrs.checks import finite
from vrs.errors import InvalidValueError
from vrs.mobile import advanced
from vrs.segment import ArcSegment

SAME = 1e-9
"""Times nearer than this [s] are one."""


class KnownTrajectory:
    """Takes in packets of arcs in any order, more than once, or not at all.

    An arc, or the part of it, before its packet's `complete_until` is final; what comes after it is the braking
    tail, which counts only until a later packet. A final arc beyond a gap waits until the gap is filled.
    """

    def __init__(self, posture: tuple[float, float, float], t: float, *, capacity: int = 36_000) -> None:
        """Begin.

        Args:
            posture: Where the robot is, (x, y, θ) [m, m, rad], until the first arc.
            t: Where the trajectory begins [s]: its first arc starts there, be it one of standing.
            capacity: Most arcs that are kept, of those that wait behind a gap as many again.
        """
        self._start = Posture(*(finite("posture", value) for value in posture))
        self.complete = finite("t", t, "finite seconds")
        """Up to where it's final, without a gap [s]."""
        self._capacity = capacity
        self._arcs: list[ArcSegment] = []
        self._starts: list[float] = []
        self._final = 0
        """How many arcs are final; the others are the tail."""
        self._waiting: dict[float, ArcSegment] = {}
        self._told = self.complete
        self._tail: list[ArcSegment] = []

    def __len__(self) -> int:
        """How many arcs are kept."""
        return len(self._arcs) + len(self._waiting)

    @property
    def end(self) -> float:
        """Up to where it's known, with the tail [s]."""
        return self._arcs[-1].end if self._arcs else self.complete

    def hear(self, arcs: Iterable[ArcSegment], complete_until: float) -> bool:
        """Take in a packet.

        Args:
            arcs: Consecutive arcs by time. Where the last one ends before `complete_until`, the robot then stands.
            complete_until: No later packet changes anything before this time [s].

        Returns:
            Whether there was room. Where there wasn't the packet is left out, as if it had been lost.

        Raises:
            InvalidValueError: If the arcs aren't consecutive, or the time isn't finite.
        """
        packet = list(arcs)
        until = finite("complete_until", complete_until, "finite seconds")
        for before, after in pairwise(packet):
            if abs(after.start - before.end) > SAME:
                raise InvalidValueError("arcs", (before.end, after.start), "consecutive, the next where one ends")
        if not packet:
            return True
        if len(self) + len(packet) > self._capacity:
            return False
        if packet[-1].end < until - SAME:
            last = packet[-1]
            packet.append(ArcSegment(last.end, until - last.end, tuple(last.value(last.end)), 0.0, 0.0))
        for arc in packet:
            if self.complete + SAME < min(arc.end, until) and arc.start < until - SAME:
                final = arc if arc.end <= until + SAME else replace(arc, duration=until - arc.start)
                known = self._waiting.get(arc.start)
                if known is None or known.end < final.end:
                    self._waiting[arc.start] = final
        if until >= self._told:
            self._told = until
            self._tail = [_from(arc, until) for arc in packet if arc.end > until + SAME]
        self._join()
        return True

    def arc_at(self, index: int) -> ArcSegment | None:
        """An arc by its number, as it's now; None if there's none."""
        return self._arcs[index] if 0 <= index < len(self._arcs) else None

    def index_at(self, t: float) -> int:
        """Number of the arc at a time [s]; −1 before the first, the last one's after the end."""
        return bisect_right(self._starts, t + SAME) - 1

    def posture_at(self, t: float) -> Posture:
        """Where the robot should be at a time [s], held before the first arc and after the last."""
        arc = self.arc_at(self.index_at(t))
        if arc is None:
            return Posture(*self._arcs[0].posture) if self._arcs else self._start
        u = min(max(t - arc.start, 0.0), arc.duration)
        return Posture(*advanced(arc.posture, arc.v, arc.w, u))

    def forget(self, t: float) -> None:
        """Drop what ends before a time [s]; some is kept, as one arc at a time would be slow."""
        gone = min(self.index_at(t), self._final)
        if gone >= 64:
            del self._arcs[:gone], self._starts[:gone]
            self._final -= gone

    def _join(self) -> None:
        """Chain what follows without a gap, then the tail if it follows, too."""
        del self._arcs[self._final :], self._starts[self._final :]
        for start in sorted(self._waiting):
            if start > self.complete + SAME:
                break
            arc = self._waiting.pop(start)
            if arc.end > self.complete + SAME:
                self._append(_from(arc, self.complete))
                self.complete = arc.end
        self._final = len(self._arcs)
        if self._tail and abs(self._tail[0].start - self.complete) <= SAME:
            for arc in self._tail:
                self._arcs.append(arc)
                self._starts.append(arc.start)

    def _append(self, arc: ArcSegment) -> None:
        last = self._arcs[-1] if self._arcs else None
        if last is not None and last.v == last.w == arc.v == arc.w == 0.0:
            self._arcs[-1] = replace(last, duration=arc.end - last.start)
            return
        self._arcs.append(arc)
        self._starts.append(arc.start)


def _from(arc: ArcSegment, t: float) -> ArcSegment:
    """The part of an arc from a time on [s]; the whole if it starts later."""
    u = t - arc.start
    if u <= SAME:
        return arc
    return replace(arc, start=t, duration=arc.end - t, posture=advanced(arc.posture, arc.v, arc.w, u))
