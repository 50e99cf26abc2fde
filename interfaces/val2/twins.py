"""A program on both twins in the laboratory: virtual time, repeatable from a seed."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from interfaces.link import Conditions, DelayProfile, LinkConditions, Service
from interfaces.runs.twin_run import QUANTILE, RunKeeper, TwinRun
from interfaces.runtime.plan import PlannedMotion, PlannedPayload, RunPlan
from interfaces.runtime.session import PATIENCE, ArmFactory, Progress, TwinSession, placed_in, unheard
from interfaces.val2.corrections import Corrections
from interfaces.val2.errors import ValError
from interfaces.val2.motion import Arm, SiteRobot, conventions_of
from interfaces.val2.playing import LONGEST, Listeners, Player
from interfaces.val2.source import SourceFile
from interfaces.val2.units import Units
from robots.robot import Robot
from robots.things import Scene
from vrs.commands import Command, Grip, MotionCommand, PlanEdit, SteerCommand
from vrs.ledger import Receipt, Status
from vrs.model import home

_LOOK: Final = 0.1
"""How often a program is looked after at least [s]: reports may have changed what it waits for."""


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """What became of a program on the twins."""

    run: TwinRun
    """The record of both twins."""
    plan: RunPlan
    """What the program made the operator do, for runs under other conditions."""
    error: ValError | None
    """What stopped it; None if nothing did."""


@dataclass(slots=True)
class _Operator:
    """A program in the place of an operator."""

    session: TwinSession
    limit: float
    name: str
    motions: list[PlannedMotion] = field(default_factory=list)
    payloads: list[PlannedPayload] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    player: Player = field(init=False)
    _holds: bool = False

    def execute(self, command: Command | None, now: float) -> Receipt | None:
        """Let the operator's site carry out a command, and record what the virtual robot accepts."""
        virtual = self.session.operator.robot
        if command is None:
            return virtual.undo(now=now)
        answer = virtual.execute(command, now=now)
        assert isinstance(answer, Receipt)
        if answer.status is not Status.REJECTED:
            assert isinstance(command, (MotionCommand, SteerCommand, PlanEdit, Grip))
            self.session.sent(now, command, answer)
            self.motions.append(PlannedMotion(self.name, now, command))
        return answer

    def gripped(self, t: float, holds: bool) -> None:
        """Let the real hand hold what the parameter HAND.LOAD says [kg], or nothing."""
        load = self.parameters.get("HAND.LOAD", 0.0) if holds else 0.0
        if load <= 0 and not self._holds:
            return
        self._holds = load > 0
        mass = load if load > 0 else None
        self.session.hand(t, mass)
        self.payloads.append(PlannedPayload(self.name, t, mass))

    def advance(self, now: float) -> None:
        """Let the program go on, and say when it's to be looked after again."""
        player = self.player
        player.advance(now)
        player.expire(now, self.limit)
        if player.done:
            self.session.last_action = now
        else:
            self.session.lab.schedule(min(max(player.next_deadline(), now), now + _LOOK), self.advance)


def play(
    source: SourceFile,
    robot: Robot,
    profile: DelayProfile,
    arm: ArmFactory | None = None,
    *,
    seed: int,
    offset: float | None = None,
    service: Service = Service.DATAGRAM,
    scene: Scene | None = None,
    listeners: Listeners | None = None,
    limit: float = LONGEST,
    files: Path | None = None,
    corrections: Corrections | None = None,
    progress: Progress | None = None,
    keeper: RunKeeper | None = None,
) -> Played:
    """Carry out the first program of a file, once, from the robot's `nominal` pose.

    Args:
        source: The file.
        robot: Which arm.
        profile: The link's delay, either way.
        arm: Makes the real robot's body; its usual one unless given.
        seed: Seed of the link and of RANDOM, ≥ 0.
        offset: A fixed D = −D_f [s], ≤ 0; None adapts it to the network.
        service: Order of delivery on the link.
        scene: What the real robot can grasp; nothing unless given, and then its fingers aren't modelled.
        listeners: Who hears what the program says; nobody by default.
        limit: When the program is given up [s].
        files: The directory of the program's files; it has none unless given.
        corrections: What comes from elsewhere for ALTER; nothing unless given.
        progress: Called now and then with the user time reached [s].
        keeper: Who writes the run down while it goes on.

    Raises:
        ValError: If the program can't be begun.
    """
    start = home(robot.arm)
    conditions = LinkConditions.symmetric(Conditions(delay=profile, service=service))
    with placed_in(scene, arm or robot.body(), robot)(start) as body:
        session = TwinSession(
            start, robot, conditions, body, title=source.name, seed=seed, offset=offset, keeper=keeper, scene=scene
        )
        operator = _Operator(session, limit, source.name)
        site = SiteRobot(session.operator, operator.execute, has_fingers=scene is not None)
        val = Arm(site, conventions=conventions_of(robot), parameters=operator.parameters, gripped=operator.gripped)
        rng = random.Random(seed)  # noqa: S311 - RANDOM is no secret
        operator.player = player = Player(
            source, val, listeners or Listeners(), rng, units=Units(files), corrections=corrections
        )
        session.last_action = math.inf
        player.begin(0.0)
        session.lab.schedule(0.0, operator.advance)
        end = session.run(PATIENCE + 4 * profile.quantile(QUANTILE), progress or unheard)
    run = session.record(end)
    plan = RunPlan(source.name, start, tuple(operator.motions), tuple(operator.payloads), scene)
    return Played(run, plan, player.errors[-1] if player.errors else None)
