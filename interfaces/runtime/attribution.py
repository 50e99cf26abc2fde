"""Why the twins are apart: counterfactual runs with one cause after the other switched off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from interfaces.link import ConstantDelay, DelayProfile
from interfaces.runtime.bodies import exact_arm, simulated_puma
from interfaces.runtime.plan import Plan
from interfaces.runtime.run import TwinRun
from interfaces.runtime.virtual import Progress, run_twins
from vrs.comparison import agreement, shifted
from vrs.model import RobotModel

CAUSES = ("network", "payload_and_friction", "servo")
"""The order in which causes are switched off; each stays off in the runs after it."""


@dataclass(frozen=True, slots=True)
class Measures:
    """The errors of one run that are attributed; equal timeline time compares the robots' own clocks."""

    tool_rms_timeline_m: float
    """Tool distance at equal timeline time, rms [m]."""
    tool_rms_user_m: float
    """Tool distance at equal user time, rms [m]."""
    joint_rms_timeline_rad: float
    """Joint error at equal timeline time, rms over all joints [rad]."""


@dataclass(frozen=True, slots=True)
class Attribution:
    """One measure, split: parts and residual add up to the total."""

    measure: str
    """Name of a field of Measures; its last part is the unit."""
    total: float
    parts: tuple[tuple[str, float], ...]
    """Cause, and by how much the measure fell when it was switched off, in that order."""
    residual: float
    """What is left with every cause off."""


def measures(run: TwinRun) -> Measures:
    """Measure one run."""
    q_timeline = shifted(run.t, run.q_virtual, run.D)
    timeline = agreement(run.model, q_timeline, run.q_real)
    user = agreement(run.model, run.q_virtual, run.q_real)
    return Measures(timeline.tool_rms, user.tool_rms, float(np.sqrt(np.mean(timeline.joint_rms**2))))


def run_without(
    causes: frozenset[str],
    plan: Plan,
    model: RobotModel,
    profile: DelayProfile,
    *,
    seed: int,
    progress: Progress | None = None,
) -> TwinRun:
    """Run a plan with some causes of error switched off.

    Args:
        causes: Any of CAUSES. Without `network` every command arrives at once; without
            `payload_and_friction` the hand stays empty and the joints turn freely; without `servo` the body
            is where its reference is.
        plan: What the operator does.
        model: The robot.
        profile: The link's delay, unless it is switched off.
        seed: Seed of the link.
        progress: Called now and then with the user time reached [s].
    """
    if "network" in causes:
        profile = ConstantDelay("none", 0.0)
    free = "payload_and_friction" in causes
    if free:
        plan = replace(plan, payloads=())
    arm = exact_arm if "servo" in causes else simulated_puma(friction=not free)
    return run_twins(plan, model, profile, arm, seed=seed, progress=progress)


def attribute(stages: tuple[Measures, ...]) -> tuple[Attribution, ...]:
    """Split each measure among the causes.

    Args:
        stages: Measures of the whole run, then of the runs with the first one, two and three of CAUSES off.

    Returns:
        One attribution for each measure.
    """
    splits = []
    for name in Measures.__slots__:
        values = [float(getattr(stage, name)) for stage in stages]
        parts = tuple((cause, values[i] - values[i + 1]) for i, cause in enumerate(CAUSES))
        splits.append(Attribution(name, values[0], parts, values[-1]))
    return tuple(splits)
