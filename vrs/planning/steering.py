"""Steering: a hand's rates or twist as a plan that goes on for a while and then stops by itself.

Every plan ends at rest, so the watchdog is in the plan: what no further input replaces stops the arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array
from vrs.chunk import State
from vrs.commands import Frame
from vrs.errors import InvalidValueError, PlanningError
from vrs.model import Array, Limits, RobotModel
from vrs.planning.certificate import violation
from vrs.planning.parabolic import brake
from vrs.planning.plan import Plan
from vrs.planning.steer_course import (
    SLOW_FROM,
    Twist,
    damped_rates,
    rates_to_limits,
    sliding_rates,
    weighted_jacobian,
)
from vrs.planning.steer_joint import rates_plan
from vrs.planning.steer_tool import STANDING, along

_SLOWED = 0.5
"""A hand is told what is in its way where less than this share is left of what it asks for."""
_TRIED = 0.1
"""How far each joint is moved to see whether that leads away from a singularity [rad]."""
BRAKED_ONLY = "braked with parabolas: no jerk-limited plan from this state keeps the limits"
DROPPED = "accelerations dropped at the start: bounded jerk would pass a speed limit from this state"


class Steered(NamedTuple):
    """What comes of a hand's input."""

    plan: Plan
    """Certified, ends at rest; empty where the arm stands and stays."""
    note: str
    """What the user must know of it; empty if nothing."""
    hindrance: str
    """What keeps the arm from going as asked, and what leads away from it; empty if nothing does."""


def steer(
    state: State,
    rates: ArrayLike | None,
    twist: ArrayLike | None,
    frame: Frame,
    hold: float,
    model: RobotModel,
    limits: Limits,
) -> Steered:
    """Plan what a hand asks for now, for as long as the input is fresh, and the stop after that.

    Args:
        state: Start; any state within the limits.
        rates: Joint rates [rad/s], (n,); beyond the speed limits all are scaled alike. None with a twist.
        twist: Of the tool, (6,): linear [m/s], then angular [rad/s], of the last link's frame; beyond the model's
            nominal speeds scaled. None with rates.
        frame: Axes of the twist; those of the tool turn with it.
        hold: How long to go on [s]; 0 or less stops.
        model: The arm.
        limits: Limits that hold at every instant.

    Raises:
        InvalidValueError: If not exactly one of rates and twist is given, or something is of the wrong form.
        PlanningError: If the state can't be brought to rest within the limits.
    """
    n = limits.dof
    lasting = max(finite("hold", hold, "finite seconds"), 0.0)
    if not isinstance(frame, Frame):
        raise InvalidValueError("frame", frame, "base or tool")
    if rates is not None and twist is None:
        u = finite_array("rates", rates, (n,), f"finite joint rates [rad/s], shape ({n},)")
        return Steered(*_by_rates(state, u, lasting, limits), _at_limit(state.q, u, limits))
    if twist is None or rates is not None:
        raise InvalidValueError("rates and twist", (rates, twist), "one of the two, the other None")
    given = finite_array("twist", twist, (6,), "a finite twist (v [m/s], w [rad/s]), shape (6,)")
    return _by_twist(state, _wanted(given, frame, state, model), lasting, model, limits)


def _by_rates(
    state: State, u: Array, hold: float, limits: Limits, shares: Sequence[float] | None = None
) -> tuple[Plan, str]:
    u = u / max(1.0, *(abs(rate) / V for rate, V in zip(u.tolist(), limits.qd_max.tolist(), strict=True)))
    made = rates_plan(state, u, hold, limits, shares)
    if made is not None and violation(made[0], limits, jerk=True) is None:
        return made[0], DROPPED if made[1] else ""
    plan = brake(state, limits)
    problem = violation(plan, limits, jerk=False)
    if problem is not None:
        raise PlanningError(f"no stop from this state: {problem}")
    return plan, BRAKED_ONLY


def _wanted(given: Array, frame: Frame, state: State, model: RobotModel) -> Twist:
    """The twist in the base frame, not faster than nominal, its linear part over the characteristic length."""
    v, w = given[:3], given[3:]
    scale = max(1.0, hypot(*v.tolist()) / model.tool_speed, hypot(*w.tolist()) / model.tool_turn_speed)
    scale_linear = scale * model.characteristic_length
    if frame is Frame.TOOL:
        R = model.forward(state.q)[:3, :3]
        v, w = R @ v, R @ w
    return Twist(v / scale_linear, w / scale, frame is Frame.TOOL)


def _by_twist(state: State, twist: Twist, hold: float, model: RobotModel, limits: Limits) -> Steered:
    J = weighted_jacobian(model, state.q[None])
    asked = np.concatenate([twist.linear, twist.angular])
    u = damped_rates(J, asked[None])[0][0]
    if hold == 0.0 or float((np.abs(u) / limits.qd_max).max()) < STANDING:
        stuck = hold > 0.0 and bool(asked.any())
        return Steered(*_released(state, J[0], hold, model, limits), _singular(state.q, model) if stuck else "")
    low, high = rates_to_limits(state.q, limits)
    blocked = bool((u < low).any() or (u > high).any())
    plan, share = along(state, model, u, twist, 1.0, hold, limits, blocked=blocked)
    hindrance = _at_limit(state.q, u, limits)
    missed = asked - J[0] @ u
    slowed = share < _SLOWED or float(missed @ missed) > (1.0 - _SLOWED) ** 2 * float(asked @ asked)
    if slowed and not hindrance and float(_nearness(J)[0]) < 1.0 / SLOW_FROM:
        hindrance = _singular(state.q, model)
    if plan is not None:
        return Steered(plan, "", hindrance)
    u = share * sliding_rates(J[0], asked, low, high)
    return Steered(*_by_rates(state, u, hold, limits, _together(state, u, limits)), hindrance)


def _at_limit(q: Array, u: Array, limits: Limits) -> str:
    """Say which joint a position limit keeps from moving at the rates u [rad/s]; empty where none does."""
    low, high = rates_to_limits(q, limits)
    most = np.where(u < 0.0, -low, high)
    left = np.where(u == 0.0, 1.0, most / np.maximum(np.abs(u), 1e-12))
    joint = int(left.argmin())
    if left[joint] >= _SLOWED:
        return ""
    which, back = ("lower", "up") if u[joint] < 0.0 else ("upper", "down")
    at = degrees(float((limits.q_min if u[joint] < 0.0 else limits.q_max)[joint]))
    return f"joint {joint + 1} is at its {which} limit, {at:.0f}°: jog it {back}, or move back"


def _nearness(J: Array) -> Array:
    """σ_min / σ_max of weighted Jacobians, (k,)."""
    S = np.linalg.svd(J, compute_uv=False)
    return np.asarray(S[:, -1] / np.maximum(S[:, 0], 1e-300))


def _singular(q: Array, model: RobotModel) -> str:
    """Say which joint, and which way, leads away from the singularity that is near q."""
    limits, n = model.limits, len(q)
    places = np.concatenate([q + _TRIED * np.eye(n), q - _TRIED * np.eye(n)])
    gains = _nearness(weighted_jacobian(model, places)) - _nearness(weighted_jacobian(model, q[None]))
    gains[((places < limits.q_min) | (places > limits.q_max)).any(axis=1)] = -np.inf
    best = int(gains.argmax())
    joint, other = best % n, float(gains[(best + n) % (2 * n)])
    # From a singularity itself both ways lead away.
    way = "" if other > 0.5 * float(gains[best]) else " up" if best < n else " down"
    return f"near a singularity: jog joint {joint + 1}{way}, or move back"


def _released(state: State, J: Array, hold: float, model: RobotModel, limits: Limits) -> tuple[Plan, str]:
    """Stop on the way that the tool is going."""
    u = state.qd
    if float((np.abs(u) / limits.qd_max).max()) >= STANDING:
        present = J @ u
        plan, _ = along(state, model, u, Twist(present[:3], present[3:], False), 0.0, hold, limits)
        if plan is not None:
            return plan, ""
    return _by_rates(state, np.zeros_like(u), hold, limits)


def _together(state: State, u: Array, limits: Limits) -> list[float]:
    """Shares of the limits with which all joints reach their rates at once, so that the direction is kept."""
    needed = np.abs(u - state.qd) / limits.qdd_max
    longest = float(needed.max())
    if longest < STANDING:
        return [1.0] * len(u)
    share = np.maximum(needed / longest, np.abs(state.qdd) / limits.qdd_max)
    return [float(value) for value in np.clip(share, 1e-3, 1.0)]
