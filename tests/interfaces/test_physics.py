"""The body in a process of its own: a few real processes, and what a site feeds it."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interfaces.pipes import MessageSocket
from interfaces.runtime.physics import Event, PhysicsConfig, PhysicsProcess, ProcessEnded, References, Silent
from interfaces.runtime.physics_messages import (
    MESSAGE_MOST,
    Fault,
    FaultKind,
    Measurement,
    News,
    PhysicsActivity,
    PhysicsReady,
    PhysicsSetup,
    TickCounts,
    decode_news,
)
from interfaces.runtime.physics_process import ParentSocket, tick_body
from interfaces.teleop import FollowingArm, JointReference
from robots.robot import IDEAL
from tests.interfaces.test_teleop import laboratory
from tests.interfaces.ticks import LIMITS, MODEL, NOMINAL, ROBOT, TICK, motion, sampled, standing
from vrs import Engine, JointTarget, MotionCommand, Timeline, WallClock
from vrs.errors import InvalidValueError
from vrs.model import Array


def motion_from(q: Array, target: Array | None = None) -> Timeline:
    """One move, from 0 s on."""
    engine = Engine(MODEL, q=q)
    engine.execute(MotionCommand(JointTarget(q + 0.3 if target is None else target), None, 0.0, 1.0))
    return engine.timeline


def foreseen(site: FollowingArm) -> Callable[[Array], JointReference]:
    return lambda t: site.reference(site.foreseen(t))


@pytest.mark.parametrize(("profile", "D"), [("domain", None), ("wed", None), ("none", -0.3)])
def test_what_a_site_foresees_is_what_it_finds_after_a_stall(profile: str, D: float | None) -> None:
    lab = laboratory(profile, 4, D=D, length=8.0)
    references, known, moving = References(foreseen(lab.robot), now=0.0), 1, 0
    for k in range(20):
        now = 1.0 + 0.4 * k
        lab.run(now)
        first, seen = references.take(now=now)
        following = int(now / TICK + 1e-9) + 1
        assert first == max(known, following - 500)
        known = following
        t = TICK * np.arange(first, following + 500)
        at = lab.robot.reference(lab.robot.foreseen(t))
        assert 1 <= len(seen.q) <= len(t)
        for part, whole in zip(seen, at, strict=True):
            assert np.array_equal(part, whole[: len(part)])
        assert (at.q[len(seen.q) - 1 :] == at.q[-1]).all()
        assert len(seen.q) == len(t) or not (seen.qd[-1].any() or seen.qdd[-1].any())
        assert np.abs(np.diff(at.q, axis=0)).max() <= 1.01 * TICK * LIMITS.qd_max.max()
        moving += int(len(seen.q) > 1)
    assert moving >= 5
    expected = lab.robot.foreseen(t)
    lab.robot.advance_play(now=now + 0.52)
    for one, other in zip(lab.robot.play_at(t), expected, strict=True):
        assert np.array_equal(one, other)


def configured(**options: Any) -> PhysicsConfig:
    return PhysicsConfig(ROBOT, NOMINAL, **({"body": IDEAL} | options))


def wait(physics: PhysicsProcess, clock: WallClock, until: Callable[[Event], bool], longest: float) -> list[Event]:
    """Poll until something comes that's waited for; once more at the end, however late that is."""
    events: list[Event] = []
    end = clock.now() + longest
    left = longest
    while left > 0.0:
        select.select([physics], [], [], min(0.05, left))
        left = end - clock.now()
        events += physics.poll(now=clock.now())
        if any(map(until, events)):
            return events
    raise AssertionError(f"nothing such came within {longest} s: {events[-3:]}")


@pytest.fixture(name="clock")
def _clock() -> WallClock:
    return WallClock(0.0)


def ended(pid: int) -> bool:
    """Whether a process is no more, or waits only for its parent to hear of it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


def test_a_process_follows_is_paused_and_follows_again(clock: WallClock) -> None:
    timeline = motion()
    with PhysicsProcess(configured(every=1), clock) as physics:
        assert not physics.feed(standing(NOMINAL), 1)
        ready = next(
            e
            for e in wait(physics, clock, lambda e: isinstance(e, PhysicsReady), 30.0)
            if isinstance(e, PhysicsReady)
        )
        first = ready.tick + 300
        for low in range(0, 4000, 1000):
            assert physics.feed(sampled(timeline, low, 1000), first + low)
        events = wait(physics, clock, lambda e: isinstance(e, Measurement) and e.tick >= first + 400, 5.0)
        measured = [e for e in events if isinstance(e, Measurement)]
        ticks = np.array([m.followed for m in measured])
        assert len(ticks) > 200
        assert np.abs(np.array([m.q for m in measured]) - timeline.sample(TICK * (ticks - first))).max() <= 1e-9

        os.kill(physics.pid, signal.SIGSTOP)
        try:
            events = wait(physics, clock, lambda e: isinstance(e, Silent), 2.0)
            select.select([], [], [], 0.8)
        finally:
            os.kill(physics.pid, signal.SIGCONT)
        events += wait(
            physics, clock, lambda e: isinstance(e, Measurement) and e.doing is PhysicsActivity.HOLDING, 5.0
        )
        (fault,) = (e for e in events if isinstance(e, Fault))
        assert fault.kind is FaultKind.PAUSED
        stopped = [e for e in events if isinstance(e, Measurement)]
        assert stopped[-1].counts.skipped - measured[-1].counts.skipped > 700
        assert stopped[-1].counts.ticks - measured[-1].counts.ticks < stopped[-1].tick - measured[-1].tick - 700
        for a, b in pairwise((measured[-1], *stopped)):
            ticks_run = b.counts.ticks - a.counts.ticks
            assert (np.abs(np.subtract(b.q_ref, a.q_ref)) <= LIMITS.qd_max * TICK * ticks_run * 1.001).all()

        physics.acknowledge(fault)
        back = motion_from(np.array(fault.rest), NOMINAL)
        start = stopped[-1].tick + 300
        count = int(back.end / TICK) + 2
        assert physics.feed(sampled(back, 0, count), start)
        events = wait(physics, clock, lambda e: isinstance(e, Measurement) and e.tick > start + count, 5.0)
        assert not any(isinstance(e, Fault) for e in events)
        last = next(e for e in reversed(events) if isinstance(e, Measurement))
        assert np.abs(last.q - NOMINAL).max() < 1e-9

        # Rows that end in mid-motion, as if this process stood still.
        assert physics.feed(sampled(motion_from(np.array(last.q)), 0, 150), last.tick + 200)
        events = wait(
            physics, clock, lambda e: isinstance(e, Measurement) and e.doing is PhysicsActivity.HOLDING, 5.0
        )
        (fault,) = (e for e in events if isinstance(e, Fault))
        assert (fault.kind, fault.number, fault.tick) == (FaultKind.STARVED, 2, last.tick + 350)
        pid = physics.pid
    assert ended(pid)


def test_the_end_of_a_process_is_told_and_the_next_can_begin(clock: WallClock) -> None:
    with PhysicsProcess(configured(), clock) as physics:
        wait(physics, clock, lambda e: isinstance(e, Measurement), 30.0)
        os.kill(physics.pid, signal.SIGKILL)
        events = wait(physics, clock, lambda e: isinstance(e, ProcessEnded), 0.2)
        assert events[-1] == ProcessEnded(-signal.SIGKILL)
        assert not physics.feed(standing(NOMINAL), 1)
        assert physics.poll(now=clock.now()) == ()
        assert physics.next_deadline() == np.inf


PARENT = """
import select
import numpy as np
from interfaces.runtime.physics import *
from interfaces.runtime.physics_messages import PhysicsReady
from interfaces.teleop import JointReference
from robots import load
from vrs.clock import WallClock
robot = load("puma560")
q, clock = np.array(robot.arm.poses["nominal"]), WallClock(0.0)
physics = PhysicsProcess(PhysicsConfig(robot, q, body="ideal"), clock)
while not any(isinstance(e, PhysicsReady) for e in physics.poll(now=clock.now())):
    select.select([physics], [], [], 1.0)
first, h = int(clock.now() / TICK) + 200, TICK * np.arange(1000)[:, None] * np.ones(6)
for k in range(4):
    u = h + k
    part = JointReference(q + 0.1 * (1 - np.cos(2 * u)), 0.2 * np.sin(2 * u), 0.4 * np.cos(2 * u))
    assert physics.feed(part, first + 1000 * k)
print(physics.pid, flush=True)
select.select([], [], [], 60.0)
"""


def test_the_death_of_the_parent_ends_it() -> None:
    home = str(Path(__file__).resolve().parents[2])
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT], stdout=subprocess.PIPE, env=os.environ | {"PYTHONPATH": home}
    )
    try:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        select.select([], [], [], 0.6)
        assert not ended(pid)
    finally:
        parent.kill()
        parent.communicate()
    for _ in range(40):
        if ended(pid):
            break
        select.select([], [], [], 0.05)
    assert ended(pid)


@pytest.mark.parametrize("body", ["bullet", "mujoco"])
def test_the_puma_follows_in_its_process_and_carries_a_load(clock: WallClock, body: str) -> None:
    timeline = motion(1)
    with PhysicsProcess(configured(body=body), clock) as physics:
        ready = next(
            e
            for e in wait(physics, clock, lambda e: isinstance(e, PhysicsReady), 60.0)
            if isinstance(e, PhysicsReady)
        )
        with pytest.raises(InvalidValueError, match="mass"):
            physics.attach(-1.0)
        first = ready.tick + 300
        for low in range(0, 2000, 1000):
            assert physics.feed(sampled(timeline, low, 1000), first + low)
        assert physics.attach(2.5)
        events = wait(physics, clock, lambda e: isinstance(e, Measurement) and e.tick >= first + 1000, 10.0)
        measured = [e for e in events if isinstance(e, Measurement) and e.tick > first + 100]
        error = np.abs(np.array([m.q for m in measured]) - [m.q_ref for m in measured]).max()
        assert 1e-6 < error < 0.02
        assert all(len(m.tau) == 6 for m in measured)
        assert physics.release()


@pytest.mark.parametrize("friction", [True, False])
def test_a_puma_has_friction_if_that_is_asked_for(friction: bool) -> None:
    bounds: Any = (tuple(map(tuple, (LIMITS.q_min, LIMITS.q_max, LIMITS.qd_max, LIMITS.qdd_max, LIMITS.qddd_max))),)
    setup = PhysicsSetup("puma560", ROBOT.usual_body, friction, 0.002, 1, 0.0, 1, tuple(NOMINAL), *bounds)
    with tick_body(setup) as body, ROBOT.body()(NOMINAL, friction=friction) as arm:
        for made in (body.arm, arm):  # type: ignore[attr-defined]
            reality = made.reality
            assert reality.friction is friction
        assert body.arm.reality.dt == 0.002  # type: ignore[attr-defined]


def test_a_fault_waits_until_the_parent_reads_and_measurements_do_not() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        reader = MessageSocket(ours, MESSAGE_MOST)
        counts = TickCounts(1, 0, 0.0, 0, 0, (1,))
        told = ParentSocket(MessageSocket(theirs, MESSAGE_MOST), os.getppid())
        fault = Fault(1, FaultKind.STARVED, "", 5, (0.0,), 6)
        number = 0
        while not told.unsent and number < 1_000_000:
            told.tell([PhysicsReady(number, False)])
            number += 1
        told.tell([fault, Measurement(7, PhysicsActivity.HOLDING, (0.0,), (0.0,), (), (0.0,), 7, counts)])
        found: list[News] = []
        for _ in range(number):
            found += map(decode_news, reader.receive())
            told.tell([])
        assert found == [*(PhysicsReady(k, False) for k in range(number)), fault]


def test_it_refuses_what_can_not_be_sent(clock: WallClock) -> None:
    with pytest.raises(InvalidValueError, match="joint"):
        PhysicsConfig(ROBOT, NOMINAL + 100.0)
    with pytest.raises(InvalidValueError, match="every"):
        configured(every=0)
    with PhysicsProcess(configured(), clock) as physics:
        for bad in (JointReference(*(np.zeros((3, 5)),) * 3), standing(NOMINAL, 1001), standing(NOMINAL, 0)):
            with pytest.raises(InvalidValueError, match="reference"):
                physics.feed(bad, 1)
        with pytest.raises(InvalidValueError, match="reference"):
            physics.feed(JointReference(np.zeros((3, 6)), np.zeros((2, 6)), np.zeros((3, 6))), 1)


def test_a_site_at_rest_asks_for_one_row() -> None:
    references = References(foreseen(FollowingArm(MODEL, NOMINAL, now=0.0)), now=0.0205)
    first, reference = references.take(now=0.0205)
    assert first == 21
    assert np.array_equal(reference.q, NOMINAL[None])
    assert references.take(now=0.04)[0] == 21
    assert references.take(now=0.04)[0] == 41
    references.restart(now=0.06)
    assert references.take(now=0.07)[0] == 61
    with pytest.raises(InvalidValueError, match="horizon"):
        References(foreseen(FollowingArm(MODEL, NOMINAL, now=0.0)), now=0.0, horizon=0.6)
