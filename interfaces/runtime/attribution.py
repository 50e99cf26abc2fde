"""Why the twins are apart: counterfactual runs with one cause after the other switched off."""

from __future__ import annotations

from dataclasses import replace

from interfaces.link import ConstantDelay, DelayProfile, Service
from interfaces.runs.summary import OffsetOutcome, measures
from interfaces.runs.twin_run import RunKeeper, TwinRun
from interfaces.runtime.bodies import exact_arm, simulated_puma
from interfaces.runtime.plan import RunPlan
from interfaces.runtime.session import Progress
from interfaces.runtime.virtual import run_twins
from vrs.model import RobotModel


def run_without(
    causes: frozenset[str],
    plan: RunPlan,
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
    plan: RunPlan,
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
