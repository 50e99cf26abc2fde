"""How a robot plays its timeline under jitter: never beyond what is known to be complete, and never in a burst.

Every message says up to which time c the operator's timeline is complete: no later message will change anything
before c. The robot's play time p follows the clock at pace ṗ = 1, D behind; where messages are late, it slows down
along the committed path so that it rests at c at the latest, and D grows by the stretch. A late command therefore
still takes effect at the same point of the path. With a pace r = ṗ the joints move at q̇ = q'(p) r and
q̈ = q''(p) r² + q'(p) ṙ, and these keep the limits. Solves open problem (a) of Doulgeri, Zikos, Delopoulos.

At every moment the robot has an escape: a certified change of pace that begins at a known p and ends at rest before
c. It looks for a later one only when it gets there, and takes it if there's none.

`Play` says where the play time is and was. A leg is a part of it: a change of pace, then a steady pace.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np

from vrs.checks import validated, within
from vrs.model import Array, Limits
from vrs.pacing import TimeScaling, certified, change, rest_after, seems_kept
from vrs.planning import violation
from vrs.planning.plan import stacked
from vrs.timeline import Timeline


class PlayState(NamedTuple):
    """Where play is, at times (k,)."""

    p: Array
    """Play time, on the timeline [s]."""
    pace: Array
    """dp/dt."""
    rate: Array
    """d²p/dt² [1/s]."""


def play_of(newest_first: Iterable[tuple[float, Callable[[Array], PlayState]]], t: Array) -> PlayState:
    """Where play is at ascending times [s], (k,), k ≥ 1.

    Args:
        newest_first: Since when each course counts [s], and what says where play is on it; the oldest counts before
            that, too. No more are taken than are needed.
        t: The times.
    """
    states: list[PlayState] = []
    high = len(t)
    for since, at in newest_first:
        low = min(int(np.searchsorted(t, since)), high)
        if high > low:
            states.append(at(t[low:high]))
        high = low
        if high == 0:
            break
    if high > 0:
        states.append(at(t[:high]))
    states.reverse()
    return PlayState(*(np.concatenate([state[i] for state in states]) for i in range(3)))


class EvenPlay:
    """Play at an even pace, 1 or none: p = pace · t + D, up to an end."""

    def __init__(self, D: float, pace: float = 1.0, end: float = math.inf) -> None:
        self.D, self.pace, self.end = D, pace, end

    def at(self, t: Array) -> PlayState:
        """Where play is at times [s], (k,)."""
        p = self.pace * np.asarray(t, float) + self.D
        return PlayState(np.minimum(p, self.end), np.where(p < self.end, self.pace, 0.0), np.zeros_like(p))

    foreseen = at


STEADY = TimeScaling((), ())
"""No change of pace."""


class Leg(NamedTuple):
    """A change of pace, then a steady pace."""

    begin: float
    """By the robot's clock [s]."""
    law: TimeScaling
    p: float
    """Where the law ends [s]."""
    pace: float
    """The steady pace."""


def along(leg: Leg, t: Array) -> PlayState:
    """Where play is at times on a leg, (k,)."""
    u = t - leg.begin
    pace, rate = np.empty(len(u)), np.zeros(len(u))
    pace.fill(leg.pace)
    if not leg.law.durations:
        return PlayState(leg.p + leg.pace * u, pace, rate)
    late = u - leg.law.duration
    p = leg.p + leg.pace * late
    changing = late < 0
    if changing.any():
        p[changing], pace[changing], rate[changing], _ = leg.law(u[changing])
    return PlayState(p, pace, rate)


def braking(p: float, pace: float, duration: float) -> TimeScaling:
    """Slow down evenly to a stop."""
    return TimeScaling((duration,), ((p, pace, -0.5 * pace / duration),))


_RAMPS = tuple(np.geomspace(0.05, 2.5, 18).tolist())
"""Durations of a change of pace to try [s]."""
_GO_ON = (1.0, 0.9, 0.75, 0.5, 0.25)
"""Paces to take a motion up again at: where it needs all that the limits allow, a change of pace has no room."""
_SLEW_RAMPS = (0.4, 0.2, 0.1)
"""Durations of a small change of pace to try [s]."""
_LOOK = 0.25
"""Longest time between two looks at the aim [s]."""
_REST_LOOK = 1.0
"""The same where it's known when the motion rests [s]."""
_SOON = 0.05
"""When to look again if the pace couldn't be changed [s]."""
_STEP = 1e-3
"""Least way [s of the timeline] that makes a later escape worth while."""
_LATE = 0.01
"""A decision that's more overdue [s] isn't made any more: the body has followed what was foreseen."""
_NEEDS = 64
"""Escapes that say how much timeline it takes to slow down."""
_LEGS = 4096
"""Decisions of the past that are kept."""
_ROUNDING = 1e-9
"""Play times nearer than this [s] are one."""


@dataclass(frozen=True, slots=True)
@validated
class PlayoutConfig:
    """How the play time follows its aim."""

    slew: Annotated[float, within(0.0, 0.2)] = 0.05
    """Largest deviation of the pace from 1 while D is corrected, in [0, 0.2]."""
    tolerance: Annotated[float, within(0.0, 1.0)] = 0.005
    """Deviation from the aim [s] that isn't corrected, in [0, 1]."""
    buffer: Annotated[float, within(0.0, 10.0)] = 0.1
    """How much timeline [s] must be known to be complete before play goes on in mid-motion, in [0, 10]."""


class Stretch(NamedTuple):
    """Play slowed down, as messages were late."""

    begin: float
    """By the robot's clock [s]."""
    end: float
    """When it went at its normal pace again [s]."""
    p: float
    """Where on the timeline it began [s]."""


class _Escape(NamedTuple):
    """Where play must slow down at the latest, and how."""

    p: float
    law: TimeScaling | None = None
    """None where the arm rests at p by itself."""


class Playout:
    """The play time of a robot; it knows no clock, no engine and no link.

    Drivers call `advance` when `next_deadline` says so, and read `at` for times between.
    """

    def __init__(
        self,
        timeline: Timeline,
        limits: Limits,
        *,
        now: float,
        p: float,
        config: PlayoutConfig | None = None,
        smooth: Callable[[int], bool] | None = None,
    ) -> None:
        """Start to play.

        Args:
            timeline: The plan so far; it rests at p.
            limits: Limits that hold at every instant.
            now: Time by the robot's clock [s].
            p: Where play begins, on the timeline [s]; the plan is known to be complete up to there.
            config: How to follow the aim.
            smooth: Says of a command whether its moves keep jerk limits; by default none does.
        """
        self._timeline, self._limits = timeline, limits
        self._config = PlayoutConfig() if config is None else config
        self._quicker = _at_pace(limits, 1.0 + self._config.slew)
        self._smooth = smooth if smooth is not None else _never
        self._complete = p
        self._leg = Leg(now, STEADY, p, 0.0)
        self._legs = deque([self._leg], maxlen=_LEGS)
        self._due: float | None = None
        self._escape = _Escape(p)
        self._offset = p - now
        self._ramp = 0
        # To begin with: braking from full speed takes half of this way, and seldom more than three times that.
        self._needs = deque([1.5 * float((limits.qd_max / limits.qdd_max).max())], maxlen=_NEEDS)
        self._slowed: tuple[float, float] | None = None
        self._known_rest = (p, p)
        """From where on it's known when the motion next rests, and when: it's complete, and so won't change."""
        self._refused = math.nan
        """When a motion rests that can't be played faster."""
        self.stretches: list[Stretch] = []
        """When play slowed down in mid-motion; the driver may empty it."""

    @property
    def complete_until(self) -> float:
        """Up to where the timeline is known to be complete [s]."""
        return self._complete

    @property
    def reserve(self) -> float:
        """How much complete timeline it has lately taken to slow down in [s]."""
        return max(self._needs)

    def hear(self, complete_until: float, timeline: Timeline, *, now: float) -> None:
        """Take in what a message said.

        Args:
            complete_until: No later message changes anything before this time [s]; what is less than before counts
                as nothing new.
            timeline: The plan now; before what was complete until now it's as it was.
            now: Time by the robot's clock [s], not before the last one.
        """
        self.advance(now=now)
        self._timeline = timeline
        if complete_until > self._complete:
            self._complete = complete_until
            if self._due is None:
                self._decide(now)

    def aim(self, offset: float, *, now: float) -> None:
        """Say where play should be: at now + offset; the offset is D ≤ 0 [s], less the robot's clock's own."""
        self.advance(now=now)
        self._offset = offset

    def advance(self, *, now: float) -> None:
        """Do what is due by now [s]."""
        while self._due is not None and self._due <= now:
            late = now - self._due > _LATE
            waits = self._leg.pace == 0.0 and not self._leg.law.durations
            self._decide(now if late and waits else self._due, late=late and not waits)

    def next_deadline(self) -> float | None:
        """When the pace must be looked at again, by the robot's clock [s]; None while it waits for a message."""
        return self._due

    def at(self, t: Array) -> PlayState:
        """Where play is at ascending times up to the next deadline [s], (k,), as far back as decisions are kept."""
        t = np.asarray(t, float)
        if not len(t) or t[0] >= self._leg.begin:
            return along(self._leg, t)
        return play_of(((leg.begin, partial(along, leg)) for leg in reversed(self._legs)), t)

    def foreseen(self, t: Array) -> PlayState:
        """Where play is at ascending times [s], (k,), if nobody looks before: it takes its escape, and waits."""
        t = np.asarray(t, float)
        if not len(t) or self._due is None or t[-1] < self._due:
            return self.at(t)
        ahead = copy(self)
        ahead._legs, ahead.stretches = self._legs.copy(), []
        while ahead._due is not None and ahead._due <= t[-1]:
            ahead._decide(ahead._due, late=True)
        return ahead.at(t)

    def _decide(self, t: float, *, late: bool = False) -> None:
        """Choose how to go on from where play is at a time; no law is under way. Too late, it's as foreseen."""
        leg = self._leg
        p, pace = leg.p + leg.pace * max(t - leg.begin - leg.law.duration, 0.0), leg.pace
        if abs(p - self._escape.p) <= _ROUNDING:
            p = self._escape.p
        behind = t + self._offset - p
        config = self._config
        wanted = 1.0 + (math.copysign(config.slew, behind) if abs(behind) > config.tolerance else 0.0)
        until = _rest_until(self._timeline, p)
        if p < until <= p + _ROUNDING:
            p = until
        if until > p:
            self._rest(t, p, wanted, min(until, self._complete), abs(behind))
        elif late:
            self._as_foreseen(t, p, pace)
        elif not self._timeline.state_before(p).qd.any():
            self._depart(t, p, wanted)
        elif pace == 0.0:
            self._go_on(t, p)
        else:
            self._play(t, p, pace, wanted)

    def _as_foreseen(self, t: float, p: float, pace: float) -> None:
        """Go on without a look at what is known: to the escape, then along it, then wait."""
        if pace > 0.0 and p < self._escape.p - _ROUNDING:
            self._steady(t, p, pace, self._escape, _LOOK)
        elif pace > 0.0 and self._escape.law is not None:
            self._brake(t, p)
        else:
            self._wait(t, p)
            self._due = t + _LOOK

    def _steady(self, t: float, p: float, pace: float, escape: _Escape, longest: float) -> None:
        """Play at a steady pace up to an escape, and look again after `longest` seconds at the latest."""
        self._leg, self._escape = Leg(t, STEADY, p, pace), escape
        self._legs.append(self._leg)
        self._due = t + min((escape.p - p) / pace, longest) if pace > 0 else None

    def _change(self, t: float, law: TimeScaling, pace: float, escape: _Escape) -> None:
        """Change the pace by a law."""
        self._leg, self._escape = Leg(t, law, law.end, pace), escape
        self._legs.append(self._leg)
        self._due = t + law.duration

    def _wait(self, t: float, p: float) -> None:
        self._steady(t, p, 0.0, _Escape(p), math.inf)

    def _rest(self, t: float, p: float, wanted: float, until: float, behind: float) -> None:
        """Let time pass while the arm rests: any pace will do."""
        if until - p <= _ROUNDING:
            self._wait(t, p)
        else:
            correcting = behind / self._config.slew if wanted != 1.0 else math.inf
            self._steady(t, p, wanted, _Escape(until), max(correcting, _STEP))

    def _depart(self, t: float, p: float, wanted: float) -> None:
        """Begin to move, if a way to stop is known."""
        pace = wanted if wanted <= 1.0 or self._allows(p) else 1.0
        escape = self._later(p, pace)
        if escape is None:
            self._wait(t, p)
        else:
            self._steady(t, p, pace, escape, _LOOK)

    def _go_on(self, t: float, p: float) -> None:
        """Take up the motion again where play stopped on the way."""
        found = self._resumption(p) if self._complete - p >= self._config.buffer else None
        if found is None:
            self._wait(t, p)
            return
        law, pace, escape = found
        self._change(t, law, pace, escape)
        if self._slowed is not None:
            self.stretches.append(Stretch(self._slowed[0], t + law.duration, self._slowed[1]))
            self._slowed = None

    def _resumption(self, p: float) -> tuple[TimeScaling, float, _Escape] | None:
        """The change from pace 0 to the highest pace that keeps the limits, and the escape after it."""
        for pace in _GO_ON:
            for ramp in _RAMPS:
                law = change(p, 0.0, pace, ramp, 0.0)
                escape = self._later(law.end, pace) if law.end < self._complete else None
                if escape is None:
                    break
                if self._keeps(law):
                    return law, pace, escape
        return None

    def _play(self, t: float, p: float, pace: float, wanted: float) -> None:
        """Go on moving; slow down if no later escape is known than the one that's reached."""
        escape = self._later(p, pace)
        if escape is None and p < self._escape.p - _ROUNDING:
            escape = self._escape
        if escape is None:
            self._brake(t, p)
            return
        longest = _LOOK if escape.law is not None else _REST_LOOK
        wanted = wanted if wanted <= 1.0 or self._allows(p) else 1.0
        if wanted != pace:
            until = self._complete if wanted <= 1.0 else self._rest_after(p)
            for ramp in _SLEW_RAMPS:
                law = change(p, 0.0, wanted, ramp, pace)
                after = self._later(law.end, wanted) if law.end < until else None
                if after is not None and self._keeps(law):
                    self._change(t, law, wanted, after)
                    return
            longest = _SOON if escape.law is not None else _LOOK
        self._steady(t, p, pace, escape, longest)

    def _brake(self, t: float, p: float) -> None:
        """Take the escape that was kept for this moment."""
        law = self._escape.law
        assert law is not None
        self._slowed = self._slowed or (t, p)
        self._change(t, law, 0.0, _Escape(law.end))

    def _later(self, p: float, pace: float) -> _Escape | None:
        """The latest escape that was found on the way from p on, for play at a pace; None if there's none."""
        complete = self._complete
        rest = self._rest_after(p)
        if rest < math.inf:
            return _Escape(rest)
        smooth = self._smooth_on(p, complete)
        first = max(self._ramp - 2, 0)
        for k in (*range(first, len(_RAMPS)), *range(first)):
            ramp = _RAMPS[k]
            begin = complete - 0.5 * pace * ramp - _ROUNDING
            law = change(begin, 0.0, 0.0, ramp, pace) if smooth else braking(begin, pace, ramp)
            if begin > p + _STEP and self._keeps(law):
                self._ramp = k
                self._needs.append(complete - begin)
                return _Escape(begin, law)
        return None

    def _rest_after(self, p: float) -> float:
        """When the motion from p on next rests; infinity where that isn't known to be complete."""
        since, rest = self._known_rest
        if not since <= p < rest:
            rest = rest_after(self._timeline, p, self._complete)
            if rest < math.inf:
                self._known_rest = p, rest
        return rest

    def _smooth_on(self, low: float, high: float) -> bool:
        """Whether anything between two times of the timeline keeps jerk limits."""
        timeline = self._timeline
        first, last = timeline.index_at(low), timeline.index_at(high)
        return any(self._smooth(owner) for owner in timeline.owners(max(first, 0), last + 1))

    def _keeps(self, law: TimeScaling) -> bool:
        """Whether the motion along a law keeps the limits."""
        jerk = self._smooth_on(law.coefficients[0][0], law.end)
        # Most that are tried don't, and samples tell so in a fraction of a certificate's time.
        if not seems_kept(self._timeline, law, self._limits, jerk=jerk):
            return False
        return certified(self._timeline, law, self._limits, jerk=jerk) is None

    def _allows(self, p: float) -> bool:
        """Whether the motion from p on is known until it rests, and can be played at the highest pace."""
        timeline = self._timeline
        rest = self._rest_after(p)
        if rest in (math.inf, self._refused):
            return False
        low, high = max(timeline.index_at(p), 0), timeline.index_at(rest)
        segments = [timeline.segment(i) for i in range(low, high)]
        plan = stacked([s.duration for s in segments], [s.coefficients for s in segments], timeline.dof)
        allowed = violation(plan, self._quicker, jerk=self._smooth_on(p, rest)) is None
        if not allowed:
            self._refused = rest
        return allowed


def _at_pace(limits: Limits, pace: float) -> Limits:
    """What a motion may need at pace 1 so that it keeps the limits at another."""
    return replace(
        limits,
        qd_max=limits.qd_max / pace,
        qdd_max=limits.qdd_max / pace**2,
        qddd_max=limits.qddd_max / pace**3,
    )


def _never(_command_id: int) -> bool:
    """No command keeps jerk limits."""
    return False


def _rest_until(timeline: Timeline, p: float) -> float:
    """Until when the arm rests from p on [s]; p where it moves."""
    index = timeline.index_at(p)
    while index < len(timeline):
        if index >= 0 and timeline.segment(index).coefficients[1:].any():
            return max(timeline.start_of(index), p)
        index += 1
    return math.inf
