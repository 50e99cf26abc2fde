"""How a robot comes to rest: references for its servo, from the state that it was commanded, or that it is in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array
from vrs.commands import Profile
from vrs.insertion import piece
from vrs.model import Array, Limits, frozen_array
from vrs.pacing import composed, halting
from vrs.planning import parabolic
from vrs.planning.jerk_limited import is_prompt_stop, stop
from vrs.planning.plan import Plan, end_state
from vrs.segment import PolynomialSegment, State
from vrs.timeline import Timeline


@dataclass(frozen=True, slots=True, eq=False)
class StopMotion:
    """A stop as references for the servo, which holds the last of them."""

    timeline: Timeline
    """The references, from `begin` on; of a stop from the commanded state the past is in it too."""
    begin: float
    """[s]."""
    end: float
    """When the references rest [s]."""
    rest: Array
    """Where they rest [rad], (n,), within the limits to the bit: where the next engine may begin."""
    on_path: bool
    """Whether it keeps to the path that was commanded; else each joint brakes as fast as it may."""


def from_commanded(
    timeline: Timeline, t: float, limits: Limits, profile: Profile = Profile.PARABOLIC, *, keep_path: bool = True
) -> StopMotion:
    """Stop from the commanded state: no jump of position or speed, no deceleration over the limits.

    On the path where that takes at most twice as long as each joint's own braking (and 50 ms); else, or where
    keep_path is False, each joint brakes. All that was commanded after t is dropped.

    Args:
        timeline: What the robot was commanded [rad], within the limits.
        t: When the stop begins [s]: now, not the time at which it became due.
        limits: Limits that hold at every instant.
        profile: Jerk-limited where the motion is.
        keep_path: Whether to try to stay on the path.
    """
    t = finite("t", t, "finite seconds")
    state = timeline.state_before(t)
    braking, _ = stop(state, profile, limits)
    if not len(braking):
        after = timeline.edited(t, []) if t < timeline.end else timeline
        return _stop(after, t, t, limits, on_path=True)
    pieces = [piece(braking, 0)]
    on_path = False
    if keep_path:
        law = halting(timeline, t, limits, jerk=profile is Profile.JERK_LIMITED)
        if is_prompt_stop(law.duration, braking.duration):
            pieces, on_path = list(composed(timeline, law)), True
    after = timeline.edited(t, pieces)
    return _stop(after, t, after.end, limits, on_path=on_path)


def from_measured(t: float, q: ArrayLike, qd: ArrayLike, limits: Limits) -> StopMotion:
    """Stop from the measured state, after a violation of the tolerance: the commanded one is somewhere else.

    Each joint brakes with its largest deceleration. A speed over its limit counts as the limit: an arm that hit
    something has moments of any speed, and braking from 34 rad/s within the limits would swing it round for
    seconds. A joint that comes to rest outside its position limits, by its sensor's error or because it was too
    fast, then goes back to the limit at a tenth of its speed.

    Args:
        t: When the stop begins [s].
        q: Measured [rad], (n,).
        qd: Measured [rad/s], (n,).
        limits: Joint limits.

    Raises:
        InvalidValueError: If a value isn't finite or its shape is wrong: a robot whose sensors fail can't be
            stopped by its references.
    """
    n = limits.dof
    t = finite("t", t, "finite seconds")
    position = finite_array("q", q, (n,), f"finite joint values [rad], shape ({n},)")
    speed = finite_array("qd", qd, (n,), f"finite joint speeds [rad/s], shape ({n},)")
    speed = np.clip(speed, -limits.qd_max, limits.qd_max)
    plan = parabolic.brake(State(position, speed, np.zeros(n)), limits)
    rest = end_state(plan).q if len(plan) else np.array(position)
    inside = np.clip(rest, limits.q_min, limits.q_max)
    if (rest != inside).any():
        wide = replace(limits, q_min=np.minimum(limits.q_min, rest), q_max=np.maximum(limits.q_max, rest))
        plan = plan.then(parabolic.rest_to_rest(rest, inside, 0.1, wide))
    timeline = Timeline(position, t, _segments(plan, t))
    return _stop(timeline, t, timeline.end, limits, on_path=False)


def _stop(timeline: Timeline, begin: float, end: float, limits: Limits, *, on_path: bool) -> StopMotion:
    rest = frozen_array(np.clip(timeline.final(), limits.q_min, limits.q_max))
    return StopMotion(timeline, begin, end, rest, on_path)


def _segments(plan: Plan, t: float) -> list[PolynomialSegment]:
    segments = []
    part = piece(plan, 0)
    for duration, rows in zip(part.durations, part.coefficients, strict=True):
        segments.append(PolynomialSegment(t, duration, rows, None))
        t += duration
    return segments
