"""The laboratory driver: both twins and the link in virtual time, repeatable from a seed.

The operator's engine takes each command at once. Across the link, the real robot's own engine takes those
that arrive, under a clock that runs D_f behind the user's (Doulgeri, Zikos, Delopoulos, section IV-A), and
its body follows its own timeline. A command that needs longer than D_f comes late, and is postponed there.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias

import numpy as np

from interfaces.link import Channel, ConstantDelay, DelayProfile, Service
from interfaces.runtime.plan import Plan, PlannedMotion, PlannedPayload
from interfaces.runtime.run import Event, Packet, TwinRun
from vrs import Engine, JointTarget, Lateness, ManualClock, MotionCommand, Receipt, Status
from vrs.model import Array, RobotModel

TICK = 0.001
"""Period of the real robot's servo [s]."""
STEP = 0.02
"""Period of the record [s]."""
BLOCK = 500
"""Most ticks between two progress reports."""
QUANTILE = 0.95
"""Share of packets that a random profile's D_f covers."""
SETTLE = 2.0
"""How long the record goes on after the last motion [s]."""


class Arm(Protocol):
    """A robot's body that follows references, a row a tick."""

    def run(self, q_ref: Array, qd_ref: Array, qdd_ref: Array) -> Array:
        """Follow references (m, n) [rad, rad/s, rad/s²]; return measured joints after each tick, (m, n)."""

    def attach(self, mass: float) -> None:
        """Take a load [kg] that the servo doesn't know."""

    def release(self) -> None:
        """Drop the load."""


ArmFactory: TypeAlias = Callable[[Array], AbstractContextManager[Arm]]
"""Makes a body at rest at the given joints [rad]."""
Progress: TypeAlias = Callable[[float], None]
"""Told the user time reached [s]."""


def clock_offset(profile: DelayProfile) -> float:
    """D = −D_f [s]: the constant delay, or the 95 % quantile rounded up to a step of the record."""
    if isinstance(profile, ConstantDelay):
        return 0.0 - profile.delay
    return -STEP * math.ceil(profile.quantile(QUANTILE) / STEP - 1e-9)


def robot_time(t_user: float, D: float) -> float:
    """What the robot's clock reads at user time t_user [s]: whole nanoseconds, rounded down.

    Floats alone don't do: (t + D_f) − D_f may lie a rounding error after t, and a command that arrives just
    in time would count as late.
    """
    return math.floor((t_user + D) * 1e9) / 1e9


@dataclass(frozen=True, slots=True)
class _Wire:
    """What crosses the link: the command as the operator's engine resolved it."""

    command_id: int
    command: MotionCommand


def run_twins(
    plan: Plan,
    model: RobotModel,
    profile: DelayProfile,
    arm: ArmFactory,
    *,
    seed: int,
    service: Service = Service.IN_ORDER,
    progress: Progress | None = None,
) -> TwinRun:
    """Run a plan on both twins.

    Args:
        plan: What the operator does.
        model: The robot.
        profile: The link's delay.
        arm: Makes the real robot's body.
        seed: Seed of the link, ≥ 0.
        service: Order of delivery on the link.
        progress: Called now and then with the user time reached [s].

    Returns:
        The record, every 20 ms of user time, until both robots have been at rest for 2 s.
    """
    D = clock_offset(profile)
    link: Channel[_Wire] = Channel(profile, np.random.default_rng(seed), service)
    with arm(plan.start) as body:
        session = _Session(plan, model, D, link, body)
        session.run(progress or _ignore)
    t = STEP * np.arange(len(session.measured), dtype=np.float64)
    return TwinRun(
        model=model,
        title=plan.title,
        seed=seed,
        delay=profile.name,
        D=D,
        t=t,
        q_virtual=session.virtual.timeline.sample(t),
        q_real=np.array(session.measured),
        q_reference=session.real.timeline.sample(t + D),
        receipts_virtual=session.virtual.receipts,
        receipts_real=session.real.receipts,
        packets=tuple(session.packets.values()),
        events=tuple(sorted(session.events, key=lambda event: event.t)),
    )


def _ignore(t: float) -> None:
    """Report nothing."""


class _Session:
    """State of one run."""

    def __init__(self, plan: Plan, model: RobotModel, D: float, link: Channel[_Wire], body: Arm) -> None:
        self._D, self._link, self._body = D, link, body
        self._clock_virtual, self._clock_real = ManualClock(0.0), ManualClock(robot_time(0.0, D))
        self.virtual = Engine(model, q=plan.start, clock=self._clock_virtual, lateness=Lateness.POSTPONE)
        self.real = Engine(model, q=plan.start, clock=self._clock_real, lateness=Lateness.POSTPONE)
        agenda = [(item.registered_at, i, item) for i, item in enumerate(plan.motions)]
        hand = [(item.t - D, len(agenda) + i, item) for i, item in enumerate(plan.payloads)]
        self._agenda: list[tuple[float, int, PlannedMotion | PlannedPayload]] = [*agenda, *hand]
        heapq.heapify(self._agenda)
        self.measured: list[Array] = [np.array(plan.start)]
        self._ticks = 0
        self.packets: dict[int, Packet] = {}
        self.events: list[Event] = []

    def run(self, progress: Progress) -> None:
        now = 0.0
        while (upcoming := self._next()) is not None:
            now = upcoming
            self._advance(now, progress)
            for delivery in self._link.receive(now):
                self._arrive(delivery.payload, now)
            while self._agenda and self._agenda[0][0] <= now:
                item = heapq.heappop(self._agenda)[2]
                if isinstance(item, PlannedMotion):
                    self._register(item, now)
                else:
                    self._handle(item, now)
        end = max(now, self.virtual.timeline.end, self.real.timeline.end - self._D) + SETTLE
        self._advance(STEP * math.ceil(end / STEP), progress)

    def _next(self) -> float | None:
        times = [self._agenda[0][0]] if self._agenda else []
        arrival = self._link.next_deadline()
        return min([*times, *([] if arrival is None else [arrival])], default=None)

    def _advance(self, now: float, progress: Progress) -> None:
        """Run the real body up to user time now [s]."""
        every = round(STEP / TICK)
        last = math.floor(now / TICK + 1e-6)
        while self._ticks < last:
            ticks = np.arange(self._ticks + 1, min(self._ticks + BLOCK, last) + 1)
            tau = TICK * ticks + self._D
            q = self._body.run(*(self.real.timeline.sample(tau, derivative=d) for d in range(3)))
            self.measured.extend(q[ticks % every == 0])
            self._ticks = int(ticks[-1])
            progress(TICK * self._ticks)

    def _register(self, item: PlannedMotion, now: float) -> None:
        self._clock_virtual.set(now)
        receipt = self.virtual.execute(item.command)
        if receipt.status is Status.REJECTED or receipt.q is None:
            return  # what the virtual robot refused isn't sent
        # The wire carries joints and the resolved time, so that both robots mean the same motion.
        command = replace(item.command, target=JointTarget(receipt.q), execute_at=receipt.execute_at)
        arrival = self._link.send(_Wire(receipt.command_id, command), now)
        self.packets[receipt.command_id] = Packet(receipt.command_id, now, arrival)
        if arrival is None:
            self._tell(now, "lost", f"command {receipt.command_id} was lost on the link")

    def _arrive(self, wire: _Wire, now: float) -> None:
        self._clock_real.set(robot_time(now, self._D))
        receipt = self.real.execute(wire.command)
        asked, command = wire.command.execute_at, wire.command_id
        self.packets[command] = replace(self.packets[command], real_id=receipt.command_id)
        if receipt.status is Status.REJECTED or receipt.execute_at is None or asked is None:
            self._tell(now, "diverged", f"the real robot rejected command {command}: {receipt.reason}")
        elif receipt.execute_at > asked + 1e-9:
            late = now + self._D - asked
            why = f"came {late:.3f} s too late" if late > 0 else "met a plan that had changed"
            text = f"command {command} {why}: executed at {receipt.execute_at:.3f} s instead of {asked:.3f} s"
            self._tell(now, "late", text)

    def _handle(self, item: PlannedPayload, now: float) -> None:
        if item.mass is None:
            self._body.release()
            self._tell(now, "release", "the real gripper released its load")
        else:
            self._body.attach(item.mass)
            self._tell(now, "payload", f"the real gripper took {item.mass:g} kg")

    def _tell(self, t: float, kind: str, text: str) -> None:
        self.events.append(Event(t, kind, text))


def status_counts(receipts: tuple[Receipt, ...]) -> dict[str, int]:
    """How many receipts there are of each status."""
    return {str(status): sum(r.status is status for r in receipts) for status in Status}
