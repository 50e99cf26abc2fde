"""Why the twins are apart: counterfactual runs with one cause after the other switched off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from interfaces.link import ConstantDelay, DelayProfile, Service
from interfaces.runtime.bodies import exact_arm, simulated_puma
from interfaces.runtime.keeping import RunKeeper
from interfaces.runtime.plan import Plan
from interfaces.runtime.run import TwinRun
from interfaces.runtime.session import Progress
from interfaces.runtime.virtual import run_twins
from vrs.comparison import agreement
from vrs.model import RobotModel

CAUSES = ("network", "payload_and_friction", "servo")
"""The order in which causes are switched off; each stays off in the runs after it."""


@dataclass(frozen=True, slots=True)
class Measures:
    """The errors of one run that are attributed; equal timeline time is the same place in the plan."""

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


@dataclass(frozen=True, slots=True)
class OffsetOutcome:
    """What one choice of the offset makes of a network, with a body that follows exactly."""

    offset: str
    """`adaptive`, or `fixed:S` for D = −S."""
    behind_mean_s: float
    """How far the real robot played behind the operator, mean over the run [s]."""
    behind_max_s: float
    """The same, at most [s]."""
    late: int
    """Commands that were carried out later in the plan than asked, or not at all."""
    waits: int
    """How often the robot slowed down or waited."""
    tool_rms_timeline_m: float
    """Tool distance at equal timeline time, rms [m]."""


def measures(run: TwinRun) -> Measures:
    """Measure one run."""
    timeline = agreement(run.model, run.q_matched, run.q_real)
    user = agreement(run.model, run.q_shown, run.q_real)
    return Measures(timeline.tool_rms, user.tool_rms, float(np.sqrt(np.mean(timeline.joint_rms**2))))


def run_without(
    causes: frozenset[str],
    plan: Plan,
    model: RobotModel,
    profile: DelayProfile,
    *,
    seed: int,
    offset: float | None = None,
    service: Service = Service.DATAGRAM,
    progress: Progress | None = None,
    keeper: RunKeeper | None = None,
) -> TwinRun:
    """Run a plan with some causes of error switched off.

    Args:
        causes: Any of CAUSES. Without `network` every command arrives at once and D is 0; without
            `payload_and_friction` the hand stays empty and the joints turn freely; without `servo` the body
            is where its reference is.
        plan: What the operator does.
        model: The robot.
        profile: The link's delay, unless it is switched off.
        seed: Seed of the link.
        offset: A fixed D [s], ≤ 0, unless the network is switched off; None adapts it.
        service: Order of delivery on the link.
        progress: Called now and then with the user time reached [s].
        keeper: Who writes the run down while it goes on.
    """
    if "network" in causes:
        profile, offset = ConstantDelay("none", 0.0), 0.0
    free = "payload_and_friction" in causes
    if free:
        plan = replace(plan, payloads=())
    arm = exact_arm if "servo" in causes else simulated_puma(friction=not free)
    return run_twins(
        plan, model, profile, arm, seed=seed, offset=offset, service=service, progress=progress, keeper=keeper
    )


def offset_outcome(
    plan: Plan,
    model: RobotModel,
    profile: DelayProfile,
    *,
    seed: int,
    offset: float | None,
    service: Service = Service.DATAGRAM,
    progress: Progress | None = None,
) -> OffsetOutcome:
    """Run a plan for the sake of its offset: see `interfaces.runtime.virtual.run_twins`."""
    run = run_twins(
        replace(plan, payloads=()), model, profile, exact_arm,
        seed=seed, offset=offset, service=service, progress=progress,
    )  # fmt: skip
    kinds = [event.kind for event in run.events]
    return OffsetOutcome(
        run.offset,
        float(-run.D.mean()),
        float(-run.D.min()),
        kinds.count("late") + kinds.count("diverged"),
        kinds.count("slowed") + kinds.count("waited"),
        measures(run).tool_rms_timeline_m,
    )


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
