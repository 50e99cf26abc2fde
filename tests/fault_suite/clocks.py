"""Clocks that step and drift."""

from __future__ import annotations

import asyncio
import json
import tempfile
import time
from pathlib import Path
from random import Random
from unittest.mock import patch

import numpy as np

from benchmarks.results import Result
from interfaces.stream.audit import COUNTED, AuditLog, check_audit
from interfaces.teleop import RobotSiteConfig
from tests.fault_suite.effort import Effort, Tries, most
from tests.interfaces.link import test_clock_sync
from tests.interfaces.live_rig import HALT, NOMINAL, READY, operator_here, robot_here, until
from vrs import JointTarget, MotionCommand

HOUR = 3600.0
CASES = 10
"""Random links and clocks, so many times the tries."""


def clock_steps_and_drifts(effort: Effort) -> tuple[Result, ...]:
    """The clock at the other end steps by up to an hour, and drifts by up to 100 ppm

    Random links (asymmetric, heavy-tailed, lossy, reordering) to random clocks, in virtual time. At every moment
    that's looked at: the error is within its bound, that bound no worse than half of any round trip in use; mapped
    time runs on within its rates, can be inverted, and what is heard never runs back.
    """
    cases, steps, moments, worst = CASES * effort.tries, 0, 0, 0.0
    for seed in range(effort.seed, effort.seed + cases):
        watch, _ = test_clock_sync.run(seed)
        steps, moments, worst = steps + len(watch.remote.steps), moments + watch.moments, max(worst, watch.worst)
    note = f"{steps} steps, {moments:,} moments"
    return (most("largest error, of the stated bound", worst, 1.0, tries=cases, note=note),)


def calendar_steps(effort: Effort) -> tuple[Result, ...]:
    """The machine's calendar clock steps by an hour, live

    Both sites in one process, whose time of day is put forward and back by an hour at random instants, in
    mid-motion. What the body is asked for keeps the limits, nobody halts, and plans agree. The audit log is to
    write refusals as soon as before, and to be whole.
    """
    random, calendar, ahead = Random(effort.seed), time.time, [0.0]
    tries: Tries[tuple[bool, float]] = Tries(effort, 0.0, 0.8)

    async def session() -> None:
        async with (
            robot_here(site=RobotSiteConfig(beat=0.03, watchdog=HALT)) as (robot, url),
            operator_here(url) as (operator, _),
        ):
            virtual, clock = operator.operator.robot, operator.clock
            await until(lambda: operator.operator.report is not None)
            for instant in tries:
                await until(lambda: not operator.operator.halted or operator.operator.resume(now=clock.now()) == "")
                await until(lambda: operator.operator.report.epoch == operator.operator.epoch)
                goal = READY if len(tries.found) % 2 else NOMINAL + 0.1
                receipt = virtual.execute(MotionCommand(JointTarget(goal)), now=clock.now())
                await asyncio.sleep(instant)
                ahead[0] += random.choice((-HOUR, HOUR))
                await until(lambda receipt=receipt: clock.now() > receipt.end + 0.5)
                assert robot.host.site is not None
                here, there = (one.timeline.final() for one in (virtual.engine, robot.host.site.engine))
                halted = bool(operator.operator.halted)
                tries.take((halted, float(np.abs(here - there).max())), sound=not halted)

    with patch("time.time", lambda: calendar() + ahead[0]):
        asyncio.run(session())
        late, whole = _refused_over_a_step(ahead)
    halted, apart = zip(*tries.found, strict=True)
    return (
        most("halts", sum(halted), 0, tries=tries.count, note=tries.note),
        most("robots end apart by", max(apart), 1e-9, "rad", tries=tries.count),
        most("refusals that aren't in the audit log once it's time", late, 0, tries=2),
        most("the audit log isn't whole", not whole, 0, tries=2),
    )


def _refused_over_a_step(ahead: list[float]) -> tuple[int, bool]:
    """Refusals that the log hasn't written though `COUNTED` seconds passed over a step, and whether it's whole."""
    late, whole = 0, True
    for step in (-HOUR, HOUR):
        with tempfile.TemporaryDirectory() as folder, patch("interfaces.stream.audit.COUNTED", COUNTED / 50):
            log = AuditLog(Path(folder) / "audit.jsonl")
            for _ in range(2):
                log.refused(who="Mallory", why="no token")
            ahead[0] += step
            time.sleep(2 * COUNTED / 50)
            log.advance()
            time.sleep(0.1)
            lines = [json.loads(line) for line in log.path.read_text().splitlines()]
            late += 2 - sum(line.get("again", 1) for line in lines if line["event"] == "refused")
            log.close()
            whole = whole and not check_audit(log.path).problem
    return late, whole
