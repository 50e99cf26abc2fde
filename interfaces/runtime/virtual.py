"""A plan on both twins in the laboratory: virtual time, as fast as the processor goes, repeatable from a seed.

The operator's site takes each command at once and sends it on; the robot's site carries it out, plays its timeline,
and its body follows at 1 kHz. How far behind it plays adapts to the network, or is fixed as in the paper (Doulgeri,
Zikos, Delopoulos, section IV-A): commands that take longer are then postponed.
"""

from __future__ import annotations

from interfaces.link import Conditions, DelayProfile, LinkConditions, Service
from interfaces.runs.twin_run import QUANTILE, RunKeeper, TwinRun
from interfaces.runtime.plan import PlannedMotion, RunPlan
from interfaces.runtime.session import PATIENCE, ArmFactory, Progress, TwinSession, unheard
from vrs import Receipt, Status
from vrs.model import RobotModel


def run_twins(
    plan: RunPlan,
    model: RobotModel,
    profile: DelayProfile,
    arm: ArmFactory,
    *,
    seed: int,
    offset: float | None = None,
    service: Service = Service.DATAGRAM,
    progress: Progress | None = None,
    keeper: RunKeeper | None = None,
) -> TwinRun:
    """Run a plan on both twins.

    Args:
        plan: What the operator does.
        model: The robot.
        profile: The link's delay, either way.
        arm: Makes the real robot's body.
        seed: Seed of the link, ≥ 0.
        offset: A fixed D = −D_f [s], ≤ 0; None adapts it to the network.
        service: Order of delivery on the link.
        progress: Called now and then with the user time reached [s].
        keeper: Who writes the run down while it goes on.

    Returns:
        The record, every 20 ms of user time, until both robots have been at rest for 2 s.
    """
    conditions = LinkConditions.symmetric(Conditions(delay=profile, service=service))
    with arm(plan.start) as body:
        session = TwinSession(
            plan.start, model, conditions, body, title=plan.title, seed=seed, offset=offset, keeper=keeper
        )
        for motion in plan.motions:
            session.lab.schedule(motion.registered_at, lambda now, motion=motion: _register(session, motion, now))  # type: ignore[misc]
        for item in plan.payloads:
            session.hand(item.t, item.mass)
        session.last_action = max((motion.registered_at for motion in plan.motions), default=0.0)
        end = session.run(PATIENCE + 4 * profile.quantile(QUANTILE), progress or unheard)
    return session.record(end)


def _register(session: TwinSession, item: PlannedMotion, now: float) -> None:
    receipt = session.operator.execute(item.command, now=now)
    # What the virtual robot refused isn't sent.
    if isinstance(receipt, Receipt) and receipt.status is not Status.REJECTED:
        session.sent(now, item.command, receipt)
