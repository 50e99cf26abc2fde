"""What the body is fed, in virtual time: messages come in bursts, and who decides stands still at times."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.link import Conditions, LinkConditions, delay_profile
from interfaces.messages.control import Pong
from interfaces.messages.sites import Orders
from interfaces.runtime.physics import Feeder
from interfaces.runtime.physics_messages import Fault, Grips, Measurement, News, Rows
from interfaces.runtime.physics_process import BodyTicks
from interfaces.runtime.tick_loop import TickLoop
from interfaces.teleop import JointReference, OperatorSite, RobotHost, RobotHostConfig, RobotLine, VirtualArm
from interfaces.teleop.operator import Halt, HaltCause
from robots.robot import ExactArm
from tests.interfaces.ticks import LIMITS, MODEL, NOMINAL, TICK
from vrs import JointTarget, MotionCommand

MET = 3.0
"""When the operator begins [s]: the clocks have been compared by then."""


class Site:
    """An operator, a robot's host that is fed now and then, and its body, tick by tick."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        halted = Halt(HaltCause.NOT_MET, "no robot has come yet")
        self.operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0), halted=halted)
        link = LinkConditions.symmetric(Conditions(delay=delay_profile("constant:0.003")))
        self.line = RobotLine(self.operator, link, np.random.default_rng(seed))
        self.line.connected = True
        self.host = RobotHost(MODEL, NOMINAL, now=0.0, config=RobotHostConfig(lead=0.02), seed=7)
        self.host.hello("session", now=0.0)
        self.loop = TickLoop(BodyTicks(ExactArm()), LIMITS, tuple(NOMINAL), tick=TICK, every=20, now=0.0)
        self.feeder = Feeder(self.host, self, now=0.0)
        self.told: list[Rows] = []
        self.news: list[News] = []

    def feed(self, reference: JointReference, start: int, *, placed: bool = False, grips: Grips = ()) -> bool:
        self.told.append(Rows(0, start, placed, np.stack(reference, axis=1).tobytes()))
        return True

    def acknowledge(self, fault: Fault) -> None:
        raise AssertionError(fault)

    def run(self, until: float, *, gap: float, still: float) -> None:
        """Run up to a time [s].

        Args:
            until: The time.
            gap: For how long the operator's site says nothing, at most, one time in ten [s].
            still: For how long the host's process stands still, at most, one turn in twenty: before it looks what
                there is, or, for a third as long, before its body has what it decided [s].
        """
        rng, says, wakes, moves = self.rng, 0.0, 0.0, MET
        waiting: list[Orders | Pong] = []
        for k in range(1, round(until / TICK)):
            t = k * TICK
            if t >= MET and self.operator.halted:
                self.operator.resume(now=t)
            elif t >= moves:
                q = np.clip(NOMINAL + rng.uniform(-0.8, 0.8, 6), LIMITS.q_min, LIMITS.q_max)
                self.operator.robot.execute(
                    MotionCommand(JointTarget(q), None, None, rng.choice([0.3, 0.6, 1.0])), now=t
                )
                moves = t + rng.exponential(1.0)
            if t >= says:
                waiting += self.line.advance(now=t)
                says = t + (rng.uniform(0.0, gap) if t > MET and rng.random() < 0.1 else 0.005)
            if t >= wakes:
                self.give()
                for message in waiting:
                    self.feeder.decided()
                    self.host.receive(message, now=t)
                waiting.clear()
                for message in self.feeder.advance(now=t):
                    self.line.receive(message, now=t)
                stands = rng.uniform(0.0, still) if t > MET and rng.random() < 0.05 else 0.0
                after = rng.random() < 0.25
                if not (after and stands):
                    self.give()
                wakes = (
                    t + (stands / 3.0 if after else stands)
                    if stands
                    else min(self.feeder.next_deadline(), t + 0.005)
                )
            self.loop.advance(now=t + 1e-6)
            self.news += self.loop.take()

    def give(self) -> None:
        """Let the body have what it's fed."""
        for rows in self.told:
            self.loop.receive(rows)
        self.told.clear()


@pytest.mark.parametrize(("gap", "still"), [(0.25, 0.0), (0.25, 0.1), (0.4, 0.2)])
def test_nothing_that_comes_late_makes_the_arm_jump_or_stop_for_good(gap: float, still: float) -> None:
    slowed = 0
    for seed in range(8):
        site = Site(seed)
        site.run(8.0, gap=gap, still=still)
        assert [one for one in site.news if isinstance(one, Fault)] == []
        assert site.host.site is not None
        assert not site.host.site.halted
        assert max(abs(m.q[0] - NOMINAL[0]) for m in site.news if isinstance(m, Measurement)) > 0.1
        assert site.host.site.playout is not None
        slowed += len(site.host.site.playout.stretches)
    # The messages were late enough that the arm had to wait for its plan.
    assert slowed > 5
