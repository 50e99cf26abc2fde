"""The joint controller, and the references by which it brings an arm to rest.

    τ = τ_ff(q*, q̇*, q̈*) + K_p e + K_d ė,   e = q* - q,   K_p = J ω²,   K_d = 2 ζ ω J

Feed-forward at the reference plus proportional-derivative feedback on the encoders,
with fixed joint inertias J, ω = 2π times the bandwidth, and ė a first-order low-passed difference of e: one
encoder count in one step would else read as 0.1 rad/s. There is no integral part: with stiction it hunts.

A stop begins from the state that the arm was commanded, or from the one that it is in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array, validated, within
from vrs.commands import Profile
from vrs.insertion import piece
from vrs.model import Array, Limits, frozen_array
from vrs.pacing import composed, halting
from vrs.planning import parabolic
from vrs.planning.jerk_limited import is_prompt_stop, stop
from vrs.planning.plan import Plan, end_state
from vrs.segment import PolynomialSegment, State
from vrs.timeline import Timeline

FeedForward: TypeAlias = Callable[[Array, Array, Array], Array]
"""Torques [N m] of references q [rad], qd [rad/s], qdd [rad/s²], all (k, n), row by row."""


@dataclass(frozen=True, slots=True)
@validated
class ServoGains:
    """How hard the servo pulls; the same for every payload."""

    bandwidth_hz: Annotated[float, within(0.1, 30.0)] = 12.0
    """Undamped natural frequency of the position loop [Hz], 0.1 to 30."""
    damping: Annotated[float, within(0.1, 3.0)] = 0.8
    """Damping ratio ζ of the position loop, 0.1 to 3."""
    derivative_hz: Annotated[float, within(1.0, 500.0)] = 80.0
    """Corner of the low-pass on the error's rate [Hz], 1 to 500."""
    friction: Annotated[float, within(0.0, 1.0)] = 0.5
    """Share of the nominal friction that the feed-forward makes good, 0 to 1; 1 knows it perfectly."""


class Servo:
    """One controller for all joints of an arm; it knows positions in, torques out, and no clock."""

    def __init__(
        self,
        gains: ServoGains,
        *,
        inertia: Sequence[float],
        feedforward: FeedForward,
        q: Sequence[float],
        dt: float,
    ) -> None:
        """Start holding a position.

        Args:
            gains: The gains.
            inertia: Joint inertias J that the gains are made for [kg m²], n of them.
            feedforward: Torques of a reference, row by row.
            q: Reference before the first one is given [rad], n values.
            dt: Time between two calls of `torques` [s].
        """
        omega = 2 * math.pi * gains.bandwidth_hz
        self._kp = [j * omega**2 for j in inertia]
        self._kd = [2 * gains.damping * omega * j for j in inertia]
        blend = 1.0 - math.exp(-2 * math.pi * gains.derivative_hz * dt)
        self._keep, self._gain = 1.0 - blend, blend / dt
        self._feedforward = feedforward
        self.hold(q)

    def hold(self, q: Sequence[float]) -> None:
        """Take q [rad] as reference and forget the past errors."""
        self._target: Sequence[float] = [float(x) for x in q]
        self._error: list[float] | None = None
        self._error_rate = [0.0] * len(self._target)

    def feedforward(self, q_ref: Array, qd_ref: Array, qdd_ref: Array) -> Array:
        """Return the feed-forward of a block of references [N m], (k, n), without changing state."""
        return self._feedforward(q_ref, qd_ref, qdd_ref)

    def torques(
        self, measured: Sequence[float], feedforward: Sequence[float], target: Sequence[float]
    ) -> list[float]:
        """Close the loop for one step.

        Args:
            measured: Encoder readings now [rad].
            feedforward: Row of `feedforward` for the step that begins now [N m].
            target: Reference for the end of this step [rad]; it is compared with the next reading.

        Returns:
            Drive torques for this step [N m], not limited.
        """
        error = [r - y for r, y in zip(self._target, measured, strict=True)]
        keep, gain = self._keep, self._gain
        before = error if self._error is None else self._error
        rates = [keep * d + gain * (e - o) for d, e, o in zip(self._error_rate, error, before, strict=True)]
        self._error, self._error_rate, self._target = error, rates, target
        return [
            u + p * e + k * d for u, p, e, k, d in zip(feedforward, self._kp, error, self._kd, rates, strict=True)
        ]


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
