"""Speed of the simulated PUMA against a bare PyBullet loop, in the same run.

Blocks of both alternate, so that a busy machine slows both; the median and the worst block are shown.
"""

from __future__ import annotations

import statistics
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.timing import seconds
from robots.bullet import World
from robots.bullet.chain import BulletChain
from robots.puma560.body import RealArm, chain
from robots.puma560.parameters import POSES, default_limits
from robots.simulated import Payload, Reality
from vrs.model import Array

if TYPE_CHECKING:
    from benchmarks.results import Part

BLOCK = 500
"""Steps a block."""


def references(steps: int, *, speed: float = 0.9, dt: float = 1e-3) -> tuple[Array, Array, Array]:
    """Return sinusoids about `nominal` that reach a share of the joint speeds, as q, qd, qdd, (steps, 6)."""
    limits = default_limits()
    omega = np.minimum(limits.qdd_max / limits.qd_max, 2 * np.pi * np.array([0.5, 0.6, 0.7, 0.55, 0.65, 0.75]))
    size = speed * limits.qd_max / omega
    phase = np.outer(np.arange(1, steps + 1) * dt, omega)
    q = POSES["nominal"] + size * (1 - np.cos(phase)) / 2
    return q, size * omega * np.sin(phase) / 2, size * omega**2 * np.cos(phase) / 2


def bare_loop(world: World, body: int, torques: Array) -> None:
    """Set torques, step, read the joints: the least that any PyBullet arm does."""
    bullet, joints = world.bullet, tuple(range(6))
    for tau in torques.tolist():
        bullet.setJointMotorControlArray(body, joints, bullet.TORQUE_CONTROL, forces=tau)
        bullet.stepSimulation()
        bullet.getJointStates(body, joints)


def measure(blocks: int = 20) -> dict[str, float]:
    """Return microseconds a step, times real time, and the ratio to the bare loop."""
    q, qd, qdd = references(blocks * BLOCK)
    arm_s, bare_s = [], []
    with (
        RealArm(Reality(), q=POSES["nominal"], payload=Payload(2.5)) as arm,
        BulletChain(chain(), gravity=9.81, dt=1e-3) as bare,
    ):
        arm.run(q[:1], qd[:1], qdd[:1])
        for i in range(blocks):
            part = slice(i * BLOCK, (i + 1) * BLOCK)
            arm_s.append(seconds(partial(arm.run, q[part], qd[part], qdd[part])))
            bare_s.append(seconds(partial(bare_loop, bare.world, bare.body, np.zeros((BLOCK, 6)))))
    step = statistics.median(arm_s) / BLOCK
    bare = statistics.median(bare_s) / BLOCK
    return {
        "arm_us": step * 1e6,
        "arm_best_us": min(arm_s) / BLOCK * 1e6,
        "arm_worst_us": max(arm_s) / BLOCK * 1e6,
        "bare_us": bare * 1e6,
        "times_real_time": 1e-3 / step,
        "ratio_to_bare": statistics.median(a / b for a, b in zip(arm_s, bare_s, strict=True)),
    }


def step_in(world: str, blocks: int = 20) -> list[float]:
    """Microseconds a step of the same arm in a world of physics, of each block."""
    q, qd, qdd = references(blocks * BLOCK)
    with RealArm(Reality(), q=POSES["nominal"], payload=Payload(2.5), world=world) as arm:
        arm.run(q[:1], qd[:1], qdd[:1])
        parts = [slice(i * BLOCK, (i + 1) * BLOCK) for i in range(blocks)]
        return [1e6 / BLOCK * seconds(partial(arm.run, q[part], qd[part], qdd[part])) for part in parts]


def part() -> Part:
    """Measure."""
    from benchmarks.results import Bar, Cost, Part, Result

    found, mujoco = measure(), step_in("mujoco")
    return Part(
        "The real arm",
        f"The simulated body of the PUMA 560 (servo, friction, payload, sensors) at 1 kHz, blocks of {BLOCK} steps "
        "in turns with a bare PyBullet loop that sets torques, steps and reads the joints. Processor time; the "
        "second figure is the worst block.",
        (
            Result(
                "a step of 1 ms",
                Cost(found["arm_us"], found["arm_worst_us"]),
                bar=Bar(ratio=0.25),
                peer="bare PyBullet loop",
                theirs=Cost(found["bare_us"]),
                ratio=1 / found["ratio_to_bare"],
                note=f"{found['times_real_time']:.1f} times real time; 0.25: at most 4 times the bare loop",
            ),
            Result(
                "a step of 1 ms in MuJoCo",
                Cost(statistics.median(mujoco), max(mujoco)),
                bar=Bar(median=100.0),
                note=f"{1e3 / statistics.median(mujoco):.1f} times real time; 10 are asked for in either world",
            ),
        ),
    )
