"""A simulated hour of the twins, without physics: both sites, the link, moves, redirections and steering."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.moves import LIMITS, MODEL
from benchmarks.results import Bar, Cost, Part, Result
from interfaces.link import Conditions, LinkConditions, Service, delay_profile
from interfaces.runtime.laboratory import Laboratory
from interfaces.teleop import FollowingArm, OperatorSite, VirtualArm
from vrs import Insertion, JointTarget, MotionCommand, SteerCommand
from vrs.commands import Command

PROFILES = ("tue", "mon", "domain")
HOUR = 3600.0
NOMINAL = MODEL.poses["nominal"]


def part() -> Part:
    """Measure."""
    results = []
    for profile in PROFILES:
        lab, moves, inputs = session(profile, HOUR)
        begin = time.process_time()
        lab.run(HOUR)
        spent = time.process_time() - begin
        same = _agree(lab)
        results.append(
            Result(
                f"an hour under `{profile}`",
                Cost(spent),
                unit="s",
                bar=Bar(ratio=100.0) if profile == "tue" else Bar(),
                peer="real time",
                theirs=Cost(HOUR),
                ratio=HOUR / spent,
                note=f"{moves} moves, {inputs} inputs; off the virtual robot's path by {same:.1e} rad",
            )
        )
    return Part(
        "Twins",
        "Operator's and robot's site with an engine each, joined by an in-order link, with adaptive D, messages "
        "every 50 ms there and 100 ms back, in virtual time: a move every 3 s on average (spliced, replacing or "
        "appended, at once or later), and three seconds of steering at 20 Hz every 23 s. Processor time.",
        tuple(results),
    )


def session(profile: str, length: float) -> tuple[Laboratory, int, int]:
    """Both sites with what the operator will do; how many moves and steering inputs."""
    rng = np.random.default_rng(0)
    operator, robot = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0)), FollowingArm(MODEL, NOMINAL, now=0.0)
    conditions = Conditions(delay=delay_profile(profile), service=Service.IN_ORDER)
    lab = Laboratory(operator, robot, LinkConditions.symmetric(conditions), rng)

    def give(t: float, command: Command) -> None:
        lab.schedule(t, lambda now: operator.robot.execute(command, now=now))

    t, moves, inputs = 1.0, 0, 0
    while t < length:
        if rng.random() < 0.13:
            rates = rng.uniform(-0.3, 0.3, 6) * LIMITS.qd_max
            for k in range(60):
                give(t + 0.05 * k, SteerCommand(rates=rates * np.sin(0.1 * k)))
            inputs += 60
            t += 4.0
        else:
            q = np.clip(NOMINAL + rng.uniform(-0.8, 0.8, 6), LIMITS.q_min, LIMITS.q_max)
            wait, speed = float(rng.choice([0.0, 0.5, 2.0])), float(rng.choice([0.3, 0.6, 1.0]))
            how = Insertion(str(rng.choice(list(Insertion))))
            give(t, MotionCommand(JointTarget(q), None, t + wait, speed, insertion=how))
            moves += 1
            t += float(rng.exponential(3.0))
    return lab, moves, inputs


def _agree(lab: Laboratory) -> float:
    """How far the robot ever was from the virtual one's path [rad], at the same place of the plan."""
    virtual = lab.operator.robot.engine.timeline.sample(lab.play[:, 1])
    return float(np.abs(virtual - lab.reference.q).max())
