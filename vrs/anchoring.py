"""Re-anchoring: a timeline joins another one that turned out to be the true one.

Solves open problem (e) of Doulgeri, Zikos, Delopoulos: what came back from the real robot corrects the virtual one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vrs.commands import Profile
from vrs.errors import InvalidValueError
from vrs.insertion import hold, piece
from vrs.model import Array, Limits
from vrs.pacing import as_plan, remainder, rest_after, segment_at
from vrs.planning import move, violation
from vrs.segment import HOLD, Piece, State, shifted
from vrs.timeline import Timeline

_SPANS = tuple(np.geomspace(0.1, 20.0, 24).tolist())
"""Durations of a correction to try [s]."""
_ROUNDING = 1e-10
"""Difference of positions [rad], rates and accelerations that counts as none."""


@dataclass(frozen=True, slots=True, eq=False)
class Anchored:
    """A timeline that joined another."""

    timeline: Timeline
    begin: float
    """Where the correction begins [s]."""
    end: float
    """From where on it's the other one [s]."""
    error: Array
    """How far apart they were at the beginning [rad], (n,)."""


def anchored(timeline: Timeline, truth: Timeline, t: float, limits: Limits) -> Anchored:
    """Let a timeline go over into another from t on, within the limits and as soon as they allow.

    The error dies away as a quintic polynomial, added to the other timeline. Where that one needs all that the
    limits allow, the arm goes instead to where the other next rests long enough.

    Args:
        timeline: What is being executed; it stays as it is before t.
        truth: What it's to become.
        t: Where the correction begins [s].
        limits: Limits that hold at every instant.

    Raises:
        InvalidValueError: If the timelines aren't of one robot.
        PlanningError: If no correction keeps the limits.
    """
    if truth.dof != timeline.dof:
        raise InvalidValueError("truth", truth, f"a Timeline of {timeline.dof} joints")
    now = timeline.state_before(t)
    there = _state(truth, t)
    error = now.q - there.q
    rates = now.qd - there.qd, now.qdd - there.qdd
    if max(np.abs(x).max() for x in (error, *rates)) <= _ROUNDING:
        return Anchored(timeline.edited(t, remainder(truth, t, 1.0)), t, t, error)
    for span in _SPANS:
        pieces = list(_superposed(truth, t, span, _vanishing(error, *rates, span)))
        if violation(as_plan(pieces, timeline.dof), limits, jerk=False) is None:
            after = timeline.edited(t, [*pieces, *remainder(truth, t + span, 1.0)])
            return Anchored(after, t, t + span, error)
    pieces, end = _by_a_rest(truth, t, now, limits)
    return Anchored(timeline.edited(t, [*pieces, *remainder(truth, end, 1.0)]), t, end, error)


def _state(timeline: Timeline, t: float) -> State:
    q, qd, qdd = (timeline.sample(t, derivative=k) for k in range(3))
    return State(q, qd, qdd)


def _vanishing(e: Array, ed: Array, edd: Array, T: float) -> Array:
    """Quintic polynomials from values, rates and accelerations to zero within T, (6, n)."""
    c = np.zeros((6, len(e)))
    c[0], c[1], c[2] = e, ed, 0.5 * edd
    c[3] = -(10.0 * e + 6.0 * ed * T + 1.5 * edd * T**2) / T**3
    c[4] = (15.0 * e + 8.0 * ed * T + 1.5 * edd * T**2) / T**4
    c[5] = -(6.0 * e + 3.0 * ed * T + 0.5 * edd * T**2) / T**5
    return c


def _superposed(truth: Timeline, t: float, span: float, error: Array) -> Iterator[Piece]:
    """The other timeline from t on, with an error that vanishes within a span."""
    index, until = truth.index_at(t), t + span
    now = t
    while now < until:
        begin, a, owner, end = segment_at(truth, index)
        stop = min(end, until)
        if stop > now:
            mine = shifted(a, now - begin) if begin < now < np.inf and len(a) > 1 else a
            total = np.zeros((max(len(mine), len(error)), truth.dof))
            total[: len(mine)] += mine
            total[: len(error)] += shifted(error, now - t)
            total.flags.writeable = False
            yield Piece([stop - now], [total], owner)
            now = stop
        index += 1


def _by_a_rest(truth: Timeline, t: float, now: State, limits: Limits) -> tuple[list[Piece], float]:
    """Go to where the other timeline rests when the arm gets there; until when that takes."""
    rest = t
    while True:
        rest = rest_after(truth, rest)
        _, _, owner, end = segment_at(truth, truth.index_at(rest))
        plan, _ = move(now, truth.sample(rest), 1.0, Profile.PARABOLIC, limits)
        until = end if owner == HOLD else rest
        arrival = t + plan.duration
        if arrival <= until:
            wait = max(rest - arrival, 0.0)
            pieces = [piece(plan, owner)] + ([hold(wait, truth.sample(rest))] if wait > 0 else [])
            return pieces, max(arrival, rest)
