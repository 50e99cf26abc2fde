"""Plays the operator's trajectory some time behind, and tracks it: on-board half of the `timeline` architecture.

The trajectory is a chain of time-stamped arcs. The player moves a play time p along it: at pace 1 a given offset
behind the clock, slower where it isn't known further, quicker where it has fallen behind. A pace bends time, never
the path: the robot goes through the same curves, with what the limits allow on them.

The tracker keeps the robot at the posture of the play time: feed-forward of the arcs' speeds at the pace, and
Samson's feedback with the gains that De Luca, Oriolo and Vendittelli schedule with the speed, each part bounded.

Source: Samson, *Control of chained systems*, IEEE Trans. Automatic Control 40(1), 1995; De Luca, Oriolo,
Vendittelli, *Control of Wheeled Mobile Robots: An Experimental Overview*, 2001, their nonlinear law; of the same
form as Kanayama, Kimura, Miyazaki, Noguchi, *A Stable Tracking Control Method for an Autonomous Mobile Robot*,
ICRA 1990, but it also corrects the heading while the reference turns on the spot.

The robot knows final arcs of the trajectory without a gap, and the braking tail after them.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, NamedTuple

from robots.onboard.driving import IPR_LIMITS, STAND, Drive, Posture, kept
from vrs.checks import finite, not_before, validated, within
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, advanced, clipped, wrapped
from vrs.mobile.model import sinc
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


_KEPT = 2.0
"""How much trajectory is kept behind the play time [s]."""
_CRAWL = 0.2
"""Least share of the pace that's left to a robot far from its reference."""
_SLOW = 0.02
"""Reference speeds of less [m/s] say nothing about the robot's curve."""
_STILL = 1e-9
"""A speed of less [m/s or rad/s] is standing."""


@dataclass(frozen=True, slots=True)
@validated
class TrackingConfig:
    """How a trajectory is played and tracked. One set serves every delay."""

    period: Annotated[float, within(1e-3, 1.0)] = 0.05
    """Between two calls [s], in [1e-3, 1]."""
    lag: Annotated[float, within(0.0, 1.0)] = 0.05
    """Of the motors, first order [s], in [0, 1]: by this, and half a period, the feed-forward is ahead of the
    play."""
    damping: Annotated[float, within(0.1, 5.0)] = 0.8
    """ζ of the feedback, in [0.1, 5]."""
    stiffness: Annotated[float, within(0.1, 1000.0)] = 50.0
    """b: the feedback's natural frequency is √(ω² + b v²) [1/m²], in [0.1, 1000]."""
    least_gain: Annotated[float, within(0.0, 20.0)] = 2.0
    """Least gain of the errors along the way and of heading [1/s], so that they also vanish at rest, in [0, 20]."""
    most_gain: Annotated[float, within(0.1, 50.0)] = 3.0
    """Largest such gain [1/s], in [0.1, 50]: what a loop of this period and lag follows without ringing."""
    v_feedback: Annotated[float, within(0.0, 10.0)] = 0.15
    """Largest part of v that is feedback [m/s], in [0, 10]."""
    w_feedback: Annotated[float, within(0.0, 20.0)] = 0.6
    """Largest part of ω that is feedback [rad/s], in [0, 20]."""
    leash: Annotated[float, within(0.01, 10.0)] = 0.15
    """Distance between robot and reference from which play slows down [m], in [0.01, 10]; at twice it, play
    waits."""
    catch_up: Annotated[float, within(0.0, 20.0)] = 1.0
    """Pace above 1 for each second behind [1/s], in [0, 20]; as much is taken from it ahead."""
    most_pace: Annotated[float, within(1.0, 100.0)] = 10.0
    """Largest pace, in [1, 100]: of what was driven slowly, the limits allow any."""
    tolerance: Annotated[float, within(0.0, 10.0)] = 0.01
    """Deviation from the offset that isn't corrected [s], in [0, 10]."""
    share: Annotated[float, within(0.1, 1.0)] = 0.85
    """Share of the limits that play takes at a pace above 1, in [0.1, 1]: the feedback needs the rest."""
    venture: Annotated[float, within(0.0, 10.0)] = 0.0
    """How far beyond what is complete play may go, on the braking tail [s], in [0, 10]. With 0 nothing of the
    operator's path is missed: the robot slows down before it must know more."""
    capacity: Annotated[int, within(10, 10**7)] = 36_000
    """Most arcs kept, in [10, 10⁷]."""
    limits: DriveLimits = IPR_LIMITS
    """Of the robot."""


class Reference(NamedTuple):
    """What the robot should do at a moment."""

    t_play: float
    """p, time of the trajectory [s]."""
    posture: Posture
    """Where it should be."""
    drive: Drive
    """How it should move."""
    starved: bool
    """Whether it's slower than it should be as the trajectory isn't known further."""


class TrajectoryTracker:
    """Player and tracker; it knows no clock, and is called once a period."""

    def __init__(
        self,
        posture: tuple[float, float, float],
        t_play: float,
        *,
        now: float,
        config: TrackingConfig | None = None,
    ) -> None:
        """Start at rest.

        Args:
            posture: Where the robot is, (x, y, θ) [m, m, rad], and where the trajectory begins.
            t_play: Where that is on the trajectory [s].
            now: Time by the robot's clock [s].
            config: How to play and track.
        """
        self._config = TrackingConfig() if config is None else config
        self._known = KnownTrajectory(posture, t_play, capacity=self._config.capacity)
        self._p = t_play
        self._now = finite("now", now, "finite seconds")
        self._offset = t_play - now
        self._way = 0.0
        """Speed of the reference along the path, with its sign [m/s]."""
        self._v = 0.0
        self._capped = False
        self._stops_at_horizon = False
        """Whether what stands next to be passed is the end of what is known."""
        self._to_stop = 0.0
        """How far the reference is from where it next stands [m]; infinity where that's far."""
        self.reference = Reference(t_play, Posture(*posture), STAND, False)
        """What the last call aimed at."""

    @property
    def complete_until(self) -> float:
        """Up to where the trajectory is final, without a gap [s]."""
        return self._known.complete

    @property
    def reserve(self) -> float:
        """How much trajectory [s] must be known ahead so that the present speed needn't fall."""
        arc = self._known.arc_at(self._known.index_at(self._p))
        if arc is None or abs(arc.v) <= _STILL:
            return self._config.period
        return self._config.limits.braking_distance(arc.v, 2 * self._config.period + self._config.lag) / abs(arc.v)

    def receive(self, arcs: Iterable[ArcSegment], *, complete_until: float) -> bool:
        """Take in a packet, see `KnownTrajectory.hear`."""
        return self._known.hear(arcs, complete_until)

    def aim(self, offset: float) -> None:
        """Say where play should be: at now + offset; the offset is D ≤ 0 [s], less the robot's clock's own."""
        self._offset = finite("offset", offset, "finite seconds")

    def advance(self, posture: tuple[float, float, float], *, now: float, v_before: float | None = None) -> Drive:
        """Play up to now, and say what to drive until the next call.

        Args:
            posture: Where the robot is, (x, y, θ) [m, m, rad].
            now: By the robot's clock [s], not before the last call.
            v_before: Linear speed that it was really told to drive last [m/s], if others changed it.

        Returns:
            A drive within the limits.

        Raises:
            InvalidValueError: If the time runs backwards.
        """
        now = not_before("now", now, self._now, "{} or later: time doesn't run backwards")
        if v_before is not None:
            self._v = v_before
        config = self._config
        # Called late, the reference goes on as if it had been called once; the rest is caught up.
        dt = min(now - self._now, 2 * config.period)
        self._now = now
        if dt > 0:
            rate = self._play(dt, self._pace(posture, now))
            self.reference = Reference(
                self._p, self._known.posture_at(self._p), self._drive_soon(rate), self._capped
            )
            self._known.forget(self._p - _KEPT)
        return self._track(posture)

    def _pace(self, posture: tuple[float, float, float], now: float) -> float:
        config = self._config
        behind = now + self._offset - self._p
        pace = 1.0
        if abs(behind) > config.tolerance:
            pace += config.catch_up * (behind - math.copysign(config.tolerance, behind))
        x, y, _ = self.reference.posture
        away = math.hypot(x - posture[0], y - posture[1])
        # Beside a reference that stands, a robot can't come nearer: it must go on, if slowly.
        share = min(max(2 - away / config.leash, _CRAWL), 1.0)
        return min(max(pace, 0.0), config.most_pace) * share

    def _drive_soon(self, rate: float) -> Drive:
        """How the reference moves once the motors have answered, at a pace."""
        config, known = self._config, self._known
        horizon = min(known.complete + config.venture, known.end)
        lead = 0.5 * config.period + config.lag
        arc = known.arc_at(known.index_at(min(self._p + rate * lead, horizon - 2 * SAME)))
        if arc is None:
            return STAND
        if abs(arc.v) <= _STILL:
            return Drive(0.0, clipped(rate * arc.w, config.limits.w_max))
        # At a high pace the arcs that come soon may be much quicker: the reference won't be in that time.
        v = clipped(rate * arc.v, config.limits.a_max * lead, self._way)
        return Drive(v, arc.w / arc.v * v)

    def _play(self, dt: float, pace: float) -> float:
        """Move the play time by dt seconds of the clock; return the pace that it then has."""
        config, known = self._config, self._known
        horizon = min(known.complete + config.venture, known.end)
        target = self._now + self._offset
        budget, index, chosen = dt, known.index_at(self._p), False
        rate, self._capped, self._to_stop = 0.0, False, 0.0
        while budget > SAME:
            arc = known.arc_at(index)
            if arc is None or self._p >= horizon - SAME:
                self._way, self._capped = 0.0, target > self._p + config.tolerance
                return 0.0
            rest = min(arc.end, horizon) - self._p
            if abs(arc.v) > _STILL:
                if not chosen or self._way * arc.v <= 0:
                    self._way, chosen = self._speed(arc, index, dt, pace, horizon), True
                rate = self._way / arc.v
            elif abs(arc.w) > _STILL:
                w_max = config.limits.w_max
                self._way, rate = 0.0, min(pace, max(config.share * w_max / abs(arc.w), 1.0), w_max / abs(arc.w))
            else:
                # Time that is merely waited for is skipped by a robot that's behind.
                skipped = min(rest, max(target - self._p - budget, 0.0))
                self._way, rate = 0.0, min(pace, 1.0)
                self._p += skipped
                rest -= skipped
            if rate * budget < rest - SAME:
                self._p += rate * budget
                return rate
            self._p += rest
            budget -= rest / rate if rate > 0 else 0.0
            index += 1
        return rate

    def _speed(self, arc: ArcSegment, index: int, dt: float, pace: float, horizon: float) -> float:
        """Speed of the reference on an arc at a pace, within the limits here and ahead, with its sign [m/s]."""
        limits = self._config.limits
        before = max(math.copysign(1.0, arc.v) * self._way, 0.0)
        step = limits.a_max * dt
        speed = min(pace * abs(arc.v), self._cap(arc), before + step)
        reach = limits.braking_distance(max(speed, before), dt + self._config.lag) + self._config.leash
        self._to_stop = math.inf
        for gap, end in self._ways_ahead(arc, index, horizon, reach):
            if end == 0.0:
                self._to_stop = gap
            last = end == 0.0 and gap <= step * dt
            # Before its own stops the operator has slowed down; before the end of what is known nobody has.
            reaction = dt + (self._config.lag if self._stops_at_horizon else 0.0)
            allowed = gap / dt if last else limits.braking_speed(gap, reaction, end)
            if allowed < speed:
                speed = allowed
                self._capped = end == 0.0 and self._stops_at_horizon
        return math.copysign(max(speed, before - step), arc.v)

    def _ways_ahead(
        self, arc: ArcSegment, index: int, horizon: float, distance: float
    ) -> Iterator[tuple[float, float]]:
        """Yield how far along the path there's a largest speed [m], and the speed [m/s], up to a distance."""
        known = self._known
        gap = (min(arc.end, horizon) - self._p) * abs(arc.v)
        self._stops_at_horizon = False
        while gap <= distance:
            index += 1
            after = known.arc_at(index)
            if after is None or after.start >= horizon - SAME:
                self._stops_at_horizon = True
                yield gap, 0.0
                return
            if after.v * arc.v <= 0 or abs(after.v) <= _STILL:
                yield gap, 0.0
                return
            yield gap, self._cap(after)
            gap += (min(after.end, horizon) - after.start) * abs(after.v)

    def _cap(self, arc: ArcSegment) -> float:
        """Largest speed on an arc's curve [m/s]: a share of what the limits allow, or the operator's own."""
        limits = self._config.limits
        most = min(limits.v_max, limits.w_max * abs(arc.v / arc.w)) if abs(arc.w) > _STILL else limits.v_max
        return max(self._config.share * most, min(abs(arc.v), most))

    def _track(self, posture: tuple[float, float, float]) -> Drive:
        """Feed-forward and bounded feedback."""
        config = self._config
        (x_d, y_d, theta_d), (v_d, w_d) = self.reference.posture, self.reference.drive
        x, y, theta = posture
        cos, sin = math.cos(theta), math.sin(theta)
        along = cos * (x_d - x) + sin * (y_d - y)
        left = cos * (y_d - y) - sin * (x_d - x)
        turn = wrapped(theta_d - theta)
        gain = 2 * config.damping * math.sqrt(w_d * w_d + config.stiffness * v_d * v_d)
        gain = min(max(gain, config.least_gain), config.most_gain)
        v = v_d * math.cos(turn) + clipped(gain * along, config.v_feedback)
        # The motors' lag would carry the robot past where the reference stands, and the path ends or turns there.
        sense = math.copysign(1.0, self._way or self._v)
        room = self._to_stop - abs(self._way) * config.period + sense * along
        if room > 0 and self._v * sense > 0:
            v = sense * min(v * sense, config.limits.braking_speed(room, config.period + config.lag))
        self._v = kept(v, 0.0, self._v, config.period, config.limits).v
        # A robot that is slower than its reference stays on the curve all the same.
        if abs(v_d) > _SLOW:
            w_d *= min(max(self._v / v_d, 0.0), 1.0)
        w = w_d + clipped(config.stiffness * v_d * sinc(turn) * left + gain * turn, config.w_feedback)
        return Drive(self._v, clipped(w, config.limits.w_max))
