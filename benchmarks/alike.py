"""The same commands live and in the laboratory, with adaptive D and a body with physics: are the figures alike?

`python -m benchmarks alike`: runs live, in real time, beside as many in the laboratory with other seeds.
"""

from __future__ import annotations

import asyncio
import contextlib
import os

import numpy as np

from interfaces.lab.statistics import bootstrap, interval_name
from interfaces.link import Conditions, LinkConditions, delay_profile
from interfaces.messages.control import Role
from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
from interfaces.runtime.live.physics_body import PhysicsBody
from interfaces.runtime.live.robot import LiveRobot
from interfaces.runtime.live.robot_server import LARGEST
from interfaces.runtime.physics import PhysicsConfig
from interfaces.runtime.plan import PlannedMotion, RunPlan
from interfaces.runtime.session import SETTLE, run_twins
from interfaces.stream import sockets
from interfaces.stream.access import OPEN, Access, hosts
from interfaces.stream.server import application
from robots import load
from vrs import JointTarget, MotionCommand
from vrs.comparison import agreement, compare_paths
from vrs.model import Array

ROBOT = load("puma560")
MODEL = ROBOT.arm
NOMINAL = MODEL.poses["nominal"]
PROFILE = os.environ.get("VRS_ALIKE_DELAY", "tue")
RUNS = int(os.environ.get("VRS_ALIKE_RUNS", "12"))
SETTLED = 4.0
"""When the commands begin [s]: the robot's clock has been compared with, and D has settled."""
LONG = 12.0
"""How long a run is looked at [s]."""
STEP = 0.02
NAMES = ("time difference, mean [s]", "path error, mean [m]", "servo error, rms of joint 2 [rad]", "progress")
_TARGETS = (
    (0.0, 0.8, -2.4, 0.0, 0.6, 0.0),
    (0.5, 0.6, -2.0, 0.3, 0.4, 0.6),
    (-0.6, 1.0, -2.6, -0.4, 0.8, -0.5),
    tuple(NOMINAL.tolist()),
)


def commands(begin: float) -> list[tuple[float, MotionCommand]]:
    """When each command is given [s], and the command: a little ahead, less than the delay."""
    return [
        (begin + 2.0 * i, MotionCommand(JointTarget(q), begin + 2.0 * i, begin + 2.0 * i + 0.05, speed=0.7))
        for i, q in enumerate(_TARGETS)
    ]


def figures(t: Array, virtual: Array, real: Array, reference: Array) -> tuple[float, ...]:
    """The figures of a run, of joints at times t (k,): (k, 6) [rad] each."""
    paths = compare_paths(t, MODEL.forward(virtual)[:, :3, 3], MODEL.forward(real)[:, :3, 3])
    servo = agreement(MODEL, reference, real)
    assert paths.time_difference_mean is not None
    assert paths.path_error_mean is not None
    assert paths.progress is not None
    return paths.time_difference_mean, paths.path_error_mean, float(servo.joint_rms[1]), paths.progress


def in_laboratory(seed: int) -> tuple[float, ...]:
    """A run in virtual time."""
    motions = tuple(PlannedMotion(f"command {i}", t, c) for i, (t, c) in enumerate(commands(SETTLED)))
    plan = RunPlan("alike", NOMINAL, motions, ())
    run = run_twins(plan, ROBOT, delay_profile(PROFILE), seed=seed)
    rows = (run.t >= SETTLED - 0.5) & (run.t <= SETTLED + LONG)
    return figures(run.t[rows], run.q_shown[rows], run.q_real[rows], run.q_reference[rows])


async def live(seed: int) -> tuple[float, ...]:
    """A run in real time."""
    async with contextlib.AsyncExitStack() as stack:
        listening = sockets.bind("127.0.0.1", 0)
        port = listening.getsockname()[1]
        body = PhysicsBody(PhysicsConfig(ROBOT, NOMINAL))
        robot = LiveRobot(body, Access(free={Role.SITE}))
        app = application(robot.routes, hosts(["127.0.0.1"], port))
        await stack.enter_async_context(sockets.serve(app, listening, largest=LARGEST))
        await stack.enter_async_context(robot.running())
        await robot.ready()
        way = LinkConditions.symmetric(Conditions(delay=delay_profile(PROFILE)))
        at = f"ws://127.0.0.1:{port}/site"
        operator = LiveOperator(LiveOperatorConfig(ROBOT, at, way, seed=seed, q=NOMINAL), Access(free=OPEN))
        await stack.enter_async_context(operator.running())
        site, clock = operator.operator, operator.clock
        async with asyncio.timeout(20):
            while site.halted:
                site.resume(now=clock.now())
                await asyncio.sleep(0.01)
        begin = clock.now() + SETTLED
        # Both clocks of this process are the same but for their origins.
        apart = clock.now() - robot.clock.now()
        waiting = commands(begin)
        rows: list[tuple[float, list[float], list[float]]] = []
        while clock.now() < begin + LONG:
            while waiting and clock.now() >= waiting[0][0]:
                site.robot.execute(waiting.pop(0)[1], now=clock.now())
            facts = robot.health()
            reference = body.host.reference(np.array([facts["measured_at"]])).q[0]
            t_now = facts["measured_at"] + apart
            if not rows or t_now > rows[-1][0]:
                rows.append((t_now, facts["q"], reference.tolist()))
            await asyncio.sleep(STEP)
        t, asked = np.array([row[0] for row in rows]), np.array([row[2] for row in rows])
        # Means are over the same phases as in the laboratory, whose record ends so long after the last motion.
        rests = t[np.flatnonzero((np.diff(asked, axis=0) != 0).any(axis=1))[-1] + 1]
        keep = (t >= begin - 0.5) & (t <= rests + SETTLE)
        if site.halted or body.faults:
            print(
                f"live run {seed}: {site.halted}, {body.faults} faults, {robot.health()['timer_late']:.3f} s late"
            )
        real = np.array([row[1] for row in rows])[keep]
        return figures(t[keep], site.robot.engine.timeline.sample(t[keep]), real, asked[keep])


def main() -> None:
    """Print the figures of both, with their intervals."""
    here = np.array([in_laboratory(seed) for seed in range(RUNS)])
    there = np.array([asyncio.run(live(seed)) for seed in range(1000, 1000 + RUNS)])
    print(f"{RUNS} runs each, delay {PROFILE}, adaptive D, physics; means, {interval_name(RUNS)} in brackets")
    for name, a, b in zip(NAMES, here.T, there.T, strict=True):
        one, other = bootstrap(a, 1), bootstrap(b, 2)
        rng = np.random.default_rng(3)
        draws = [rng.choice(b, RUNS).mean() - rng.choice(a, RUNS).mean() for _ in range(4000)]
        low, high = np.quantile(draws, (0.025, 0.975))
        near = abs(other.value - one.value) <= 0.1 * abs(one.value)
        verdict = "alike" if low <= 0 <= high else "within 10 %" if near else "DIFFERENT"
        print(
            f"{name:36s} laboratory {one.value:.4g} [{one.low:.4g}, {one.high:.4g}]  "
            f"live {other.value:.4g} [{other.low:.4g}, {other.high:.4g}]  "
            f"difference [{low:.2g}, {high:.2g}]: {verdict}"
        )


if __name__ == "__main__":
    main()
