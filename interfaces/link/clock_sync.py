"""The clock at the other end of a link: its offset with a bound that holds, and times mapped to and fro.

A's clock is the local one and never runs back; B's is remote. The offset is B's reading less A's. A probe leaves
at t0 (A), arrives at t1 (B), is answered at t2 (B) and the answer arrives at t3 (A). However the delay is shared
between the two ways, B read at most t1 when A read t0, and at least t2 when A read t3:

    offset(t0) ≤ t1 − t0        offset(t3) ≥ t2 − t3

Where B's rate differs from A's by at most ρ, both bounds hold at any later time t too, wider by ρ (t − t0) and
ρ (t − t3). Every round trip gives an interval as wide as itself; their intersection is the tightest bound there is
for a drift of which no more is known. Its middle is the estimate, so that |error| ≤ minRTT/2 + ρ · age. A constant
asymmetry can't be seen: it moves the middle by half of it, and stays within the bound. `docs/clocks.md` derives
this, and says what a step of B's clock does to it.
"""

from __future__ import annotations

import enum
import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Annotated

from interfaces.link.round_trip import RoundTrip
from vrs.checks import at_least, finite, not_before, validated, within
from vrs.errors import InvalidValueError


@dataclass(frozen=True, slots=True)
@validated
class ClockSyncConfig:
    """What is known of B's clock, and how mapped times follow the estimate."""

    max_drift: Annotated[float, within(0.0, 0.01)] = 200e-6
    """Largest difference between B's rate and A's, as a share, in [0, 0.01]."""
    smallest_step: Annotated[float, at_least(0.0, "finite seconds ≥ 0")] = 0.5
    """B's clock steps by at least this [s], ≥ 0, or not at all. Round trips are intersected only where they are
    short enough to show such a step; at 0 each stands for itself."""
    slew: Annotated[float, within(0.001, 0.5)] = 0.05
    """Largest difference between the rate of mapped time and A's, as a share, in [0.001, 0.5]."""
    resolution: Annotated[float, at_least(0.0, "finite seconds ≥ 0")] = 1e-6
    """Largest error of rounding in one of B's stamps [s], ≥ 0."""
    history: Annotated[int, within(2, 1_000_000)] = 1000
    """Corners of the map kept, in [2, 1,000,000]; earlier times are mapped with the oldest offset."""


class ClockEvidence(enum.StrEnum):
    """What a round trip said about B's clock."""

    FIRST = "first"
    """The first one: times can be mapped from now on."""
    TAKEN = "taken"
    """It agrees with what was known, and shows that no step came between."""
    BETTER = "better"
    """It can't show that, but it's the tighter bound by itself, and replaces what was known."""
    WIDE = "wide"
    """It can't show that and isn't tighter: it says nothing."""
    STEP = "step"
    """It contradicts what was known: B's clock has stepped. What was known is dropped."""
    OVERTAKEN = "overtaken"
    """It contradicts what was known and may be older: it waits for a probe sent later to decide."""
    IMPOSSIBLE = "impossible"
    """Its stamps contradict themselves: B's clock stepped between them, or drifts faster than allowed."""


@dataclass(frozen=True, slots=True)
class ClockEstimate:
    """B's clock as known at one moment of A's."""

    offset: float
    """B's reading less A's [s]: the middle of the interval that the bounds leave."""
    uncertainty: float
    """Half that interval [s]: |error| ≤ uncertainty, unless B's clock has stepped since `verified`."""
    verified: float
    """A's time of sending the newest probe that a step would have shown in [s]."""


class ClockSync:
    """Follows the clock at the other end of a link.

    *B's timeline* is B's clock with its steps taken out: a stamp less `steps`. It's continuous, so that mapped
    times never run back and never jump, whatever B's clock does. The rate of the map stays in [1 − slew, 1 + slew].
    """

    def __init__(self, config: ClockSyncConfig | None = None) -> None:
        self.config = config or ClockSyncConfig()
        self._now = -math.inf
        self._bounds: _Bounds | None = None
        self._verified = self._settled = -math.inf
        self.steps = 0.0
        """Sum of the steps of B's clock found so far [s]."""
        self.step_count = 0
        """How many steps of B's clock were found."""
        self._map: _Map | None = None
        self._heard = -math.inf

    def receive(self, trip: RoundTrip) -> ClockEvidence:
        """Take a round trip into account.

        Args:
            trip: From `RoundTripEstimator.receive`; its arrival not before that of the one before.

        Returns:
            What it said.

        Raises:
            InvalidValueError: If a stamp isn't finite or A's stamps run back.
        """
        t0, t1, t2, t3 = (finite("stamp", t) for t in (trip.sent, trip.received, trip.replied, trip.arrived))
        earliest = max(t0, self._now)
        if t3 < earliest:
            raise InvalidValueError("arrived", t3, f"at least {earliest}, the time of sending or the last arrival")
        self._now = t3
        margin = self.config.resolution + 2 * math.ulp(max(map(abs, (t0, t1, t2, t3))))
        rho = self.config.max_drift
        echo = _Bounds((t0, t1 - t0 + margin), (t3, t2 - t3 - margin), rho)
        low, high = echo.at(t3)
        if high < low or t2 < t1:
            return ClockEvidence.IMPOSSIBLE
        known = self._bounds
        evidence = ClockEvidence.FIRST if known is None else self._judge(known, t0, low, high)
        if evidence in {ClockEvidence.WIDE, ClockEvidence.OVERTAKEN}:
            return evidence
        if known is not None and evidence is ClockEvidence.TAKEN:
            self._bounds = known.narrowed(echo, t3)
        else:
            self._bounds = echo
        if t0 > self._verified or evidence is not ClockEvidence.TAKEN:
            self._verified, self._settled = t0, t3
        if evidence is ClockEvidence.STEP and self._map is not None:
            self.steps = (high + low) / 2 - (self._map.remote(t3) - t3)
            self.step_count += 1
        if self._bounds is not known:
            low, high = self._bounds.at(t3)
            aim = t3 + (high + low) / 2 - self.steps
            if self._map is None:
                self._map = _Map(t3, aim, self.config.slew, self.config.history)
            else:
                self._map.steer(t3, aim)
        return evidence

    def estimate(self, now: float) -> ClockEstimate | None:
        """The offset of B's clock and its bound; None before the first round trip.

        Args:
            now: A's time [s], not before the last arrival.

        Raises:
            InvalidValueError: If now isn't finite or lies before the last arrival.
        """
        self._present(now)
        if self._bounds is None:
            return None
        low, high = self._bounds.at(now)
        return ClockEstimate((high + low) / 2, (high - low) / 2 + math.ulp(high), self._verified)

    def uncertainty(self, now: float) -> float:
        """Bound on the error of times mapped at present [s]; infinite before the first round trip.

        |B's reading − (to_remote(now) + steps)| ≤ uncertainty, unless B's clock has stepped since `verified`. What
        the map still has to slew counts.

        Args:
            now: A's time [s], not before the last arrival.

        Raises:
            InvalidValueError: If now isn't finite or lies before the last arrival.
        """
        self._present(now)
        if self._bounds is None or self._map is None:
            return math.inf
        reading = self._map.remote(now) + self.steps
        low, high = self._bounds.at(now)
        rounding = 2 * math.ulp(max(abs(reading), abs(now), abs(self.steps)))
        return max(high - (reading - now), (reading - now) - low) + rounding

    def to_remote(self, t_local: float) -> float | None:
        """Time on B's timeline [s] at a time of A's; None before the first round trip.

        Args:
            t_local: A's time [s]. Before the last arrival nothing changes any more; later times are a forecast.

        Raises:
            InvalidValueError: If t_local isn't finite.
        """
        t_local = finite("t_local", t_local, "finite seconds")
        return None if self._map is None else self._map.remote(t_local)

    def to_local(self, t_remote: float) -> float | None:
        """A's time [s] at a time of B's timeline: the inverse of `to_remote`; None before the first round trip.

        Args:
            t_remote: B's time [s]; a stamp is handed over `unstepped`.

        Raises:
            InvalidValueError: If t_remote isn't finite.
        """
        t_remote = finite("t_remote", t_remote, "finite seconds")
        return None if self._map is None else self._map.local(t_remote)

    def heard(self, stamp: float, *, now: float) -> float | None:
        """A's time at which B stamped a message that has just come in order; None before the first round trip.

        Results never lie after now, and from call to call never run back: not even while a step of B's clock is
        still unknown. After a step forwards they may stand still as long as a message was under way.

        Args:
            stamp: A reading of B's clock [s], not before that of the call before, steps aside.
            now: A's time [s], not before that of the call before.

        Raises:
            InvalidValueError: If stamp or now isn't finite, or now lies before the last arrival.
        """
        self._present(now)
        t_local = self.to_local(self.unstepped(stamp))
        if t_local is None:
            return None
        self._heard = min(now, max(t_local, self._heard))
        return self._heard

    def unstepped(self, stamp: float) -> float:
        """Time on B's timeline of a reading of B's clock [s], taken since the last step that was found."""
        return finite("stamp", stamp, "finite seconds") - self.steps

    def _judge(self, known: _Bounds, t0: float, low: float, high: float) -> ClockEvidence:
        lower, upper = known.at(self._now)
        if low > upper or high < lower:
            return ClockEvidence.STEP if t0 >= self._settled else ClockEvidence.OVERTAKEN
        if (upper - lower) + (high - low) < self.config.smallest_step:
            return ClockEvidence.TAKEN
        return ClockEvidence.BETTER if high - low < upper - lower and t0 >= self._verified else ClockEvidence.WIDE

    def _present(self, now: float) -> None:
        not_before("now", now, self._now, "at least {}, the last arrival")


class _Bounds:
    """A bound from above and one from below on the offset of a clock, each as tight as can be at its own time."""

    __slots__ = ("_lower", "_rho", "_upper")

    def __init__(self, upper: tuple[float, float], lower: tuple[float, float], rho: float) -> None:
        self._upper, self._lower, self._rho = upper, lower, rho

    def at(self, t: float) -> tuple[float, float]:
        """The least and the largest offset at time t [s], not before either bound's own."""
        (t_upper, upper), (t_lower, lower) = self._upper, self._lower
        return lower - self._rho * (t - t_lower), upper + self._rho * (t - t_upper)

    def narrowed(self, other: _Bounds, t: float) -> _Bounds:
        """What both leave at time t and after; this very object where the other adds nothing."""
        (low, high), (other_low, other_high) = self.at(t), other.at(t)
        if other_low <= low and other_high >= high:
            return self
        upper = other._upper if other_high < high else self._upper
        lower = other._lower if other_low > low else self._lower
        return _Bounds(upper, lower, self._rho)


class _Map:
    """A continuous, increasing, piecewise linear map from A's time to B's; its past is fixed."""

    def __init__(self, t: float, r: float, slew: float, history: int) -> None:
        self._slew, self._history = slew, history
        self._t, self._r, self._rates = [t], [r], [1.0]

    def remote(self, t: float) -> float:
        i = bisect_right(self._t, t) - 1
        if i < 0:
            return self._r[0] + (t - self._t[0])
        r = self._r[i] + self._rates[i] * (t - self._t[i])
        return min(r, self._r[i + 1]) if i + 1 < len(self._r) else r

    def local(self, r: float) -> float:
        i = bisect_right(self._r, r) - 1
        if i < 0:
            return self._t[0] + (r - self._r[0])
        t = self._t[i] + (r - self._r[i]) / self._rates[i]
        return min(t, self._t[i + 1]) if i + 1 < len(self._t) else t

    def steer(self, now: float, aim: float) -> None:
        """From now on run towards the line of rate 1 through (now, aim), at the most allowed rate."""
        here = self.remote(now)
        while self._t and self._t[-1] >= now:
            del self._t[-1], self._r[-1], self._rates[-1]
        gap = aim - here
        end = now + abs(gap) / self._slew
        if end > now:
            self._t.append(now)
            self._r.append(here)
            self._rates.append(1 + math.copysign(self._slew, gap))
        self._t.append(end)
        self._r.append(here + (end - now) + gap if end > now else here)
        self._rates.append(1.0)
        if len(self._t) > 2 * self._history:
            del self._t[: -self._history], self._r[: -self._history], self._rates[: -self._history]
