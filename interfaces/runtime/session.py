"""Runs of both twins in the laboratory: of a plan, or of a program; and counterfactual ones that attribute errors.

Virtual time, as fast as the processor goes, repeatable from a seed. The operator's site takes each command at once
and sends it on; the robot's site carries it out, plays its timeline, and its body follows at 1 kHz. How far behind
it plays adapts to the network, or is fixed as in the paper (Doulgeri, Zikos, Delopoulos, section IV-A): commands
that take longer are then postponed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np

from interfaces.link import Conditions, ConstantDelay, DelayProfile, LinkConditions, PacketRecord, Service
from interfaces.messages.fields import text
from interfaces.messages.recording import Begin, CommandPacket, RunEvent
from interfaces.runs.summary import OffsetOutcome, measures
from interfaces.runs.twin_run import (
    QUANTILE,
    RunKeeper,
    Turn,
    TwinRun,
    command_events,
    commands_alone,
    correction_events,
    spelled,
    waits,
)
from interfaces.runtime.laboratory import Laboratory
from interfaces.runtime.plan import PlannedCommand, PlannedMotion, RunPlan
from interfaces.system import software
from interfaces.teleop import FollowingArm, OperatorSite, RobotSiteConfig, VirtualArm
from robots.bullet.grasping import grasping
from robots.robot import ArmBody, Robot, exact_arm
from robots.things import Scene
from vrs import Engine, Lateness, Receipt, Status
from vrs.model import Array
from vrs.timeline import Timeline

TICK = 0.001
"""Period of the real robot's servo [s]."""
STEP = 0.02
"""Period of the record [s]."""
REPORT = 0.1
"""Time between two reports of the robot [s]; between them the body runs without a break."""
TURN = 0.5
"""How often it's looked whether the run is over [s]."""
SETTLE = 2.0
"""How long the record goes on after the last motion [s]."""
PATIENCE = 120.0
"""How long the operator waits for what is still to be done [s], beside four times what the link usually takes."""
LINK_LOSS = "hold"
"""What the robot does when messages stay away."""


ArmFactory: TypeAlias = Callable[[Array], AbstractContextManager[ArmBody]]
"""Makes a body at rest at the given joints [rad]."""
Progress: TypeAlias = Callable[[float], None]
"""Told the user time reached [s]."""


class TwinSession:
    """State of one run. Who operates schedules what is done, and says when nothing more will be."""

    def __init__(
        self,
        start: Array,
        robot: Robot,
        conditions: LinkConditions,
        body: ArmBody,
        *,
        title: str,
        seed: int,
        offset: float | None,
        keeper: RunKeeper | None = None,
        scene: Scene | None = None,
    ) -> None:
        """Put both twins at rest.

        Args:
            start: Joints [rad], (n,).
            robot: Which robot.
            conditions: What the link does.
            body: The real robot's.
            title: What the run is called.
            seed: Seed of the link, ≥ 0.
            offset: A fixed D = −D_f [s], ≤ 0; None adapts it to the network.
            keeper: Who writes it down while it goes on.
            scene: What is around the real robot, which its body has.
        """
        model = robot.arm
        self._start, self._robot, self._offset, self._body, self._scene = start, robot, offset, body, scene
        virtual = VirtualArm(model, start, now=0.0, lateness=Lateness.POSTPONE, stroke=robot.stroke)
        self.operator = OperatorSite(virtual)
        config = RobotSiteConfig(fixed_offset=offset, beat=REPORT)
        self._site = FollowingArm(model, start, now=0.0, config=config)
        self.lab = Laboratory(
            self.operator, self._site, conditions, np.random.default_rng(seed),
            tick=TICK, every=round(STEP / TICK), body=body,
        )  # fmt: skip
        self._sent: list[tuple[float, PlannedCommand, Receipt]] = []
        self._messages: list[PacketRecord] = []
        self._events: list[RunEvent] = []
        self._lost: set[float] = set()
        self._packets: list[CommandPacket | None] = []
        self._unsettled: dict[int, None] = {}
        self._told = self._corrected = self._blocks = self._rows = 0
        self._halted: set[int] = set()
        self._cues, self._handled = 0, 0.0
        self._first_play = self._site.play_at(np.zeros(1)).p
        self.last_action = 0.0
        """When the operator did something last, or will [s]; infinity while that's unknown."""
        link = conditions.forward
        self._session = Begin(
            t=0.0, robot=robot.name, driver="laboratory", title=text(title), seed=seed,
            delay=text(link.delay.name), offset=spelled(offset), service=str(link.service), link_loss=LINK_LOSS,
            step=STEP, q=start.tolist(), lateness=Lateness.POSTPONE.value, software=software(),
            found_by=text(robot.recorded_by),
        )  # fmt: skip
        self._keeper = keeper
        if keeper is not None:
            keeper.begin(self._session, self.operator)

    def sent(self, now: float, command: PlannedCommand, receipt: Receipt) -> None:
        """Write down a command that the virtual robot took, and the operator's site sent on."""
        self._sent.append((now, command, receipt))
        self._packets.append(None)
        self._unsettled[len(self._sent)] = None

    def hand(self, t: float, mass: float | None) -> None:
        """Let the real hand take a load [kg], or release it, when the robot's own clock reads t [s]."""
        self._cues += 1
        self.lab.cue(t, lambda at: self._handle(mass, at))

    def run(self, patience: float, progress: Progress) -> float:
        """Let everything be carried out.

        Args:
            patience: How long to wait for anything that's still to happen [s].
            progress: Told the user time reached [s].

        Returns:
            When the record is to end [s].
        """
        lab = self.lab
        while True:
            lab.run(lab.now + TURN)
            self._take_down()
            progress(lab.now)
            rest = max(self.last_action, self._handled, _end(self.operator.robot.engine))
            arrived = self._robot_rests() if lab.now >= rest else None
            if arrived is not None and self._agree(arrived):
                rest = max(rest, arrived)
                break
            if lab.now > rest + patience:
                self._tell(lab.now, "unfinished", f"not everything was done {patience:.0f} s after the last motion")
                rest = lab.now
                break
        end = STEP * math.ceil((rest + SETTLE) / STEP - 1e-9)
        lab.run(max(end, lab.now))
        self._take_down()
        progress(lab.now)
        return end

    def _take_down(self) -> None:
        """Note what has happened since the last time, and have it written down."""
        lab, corrections = self.lab, self.operator.robot.corrections
        there, back = lab.link.forward.log.take(), lab.link.backward.log.take()
        self._messages += there
        self._lost |= {m.sent for m in there if m.lost is not None or m.attempts > 1}
        packets = self._settle()
        self._events += correction_events(corrections[self._corrected :], self._robot.arm.prismatic)
        self._corrected = len(corrections)
        for epoch in sorted(lab.halts.keys() - self._halted):
            self._halted.add(epoch)
            at, why = lab.halts[epoch]
            self._tell(at, "halted", f"the real robot stopped: {why}")
        if self._keeper is None:
            return
        blocks = list(lab.blocks(self._blocks))
        first, self._blocks = self._rows, self._blocks + len(blocks)
        if not first:
            blocks.insert(0, (np.array([[0.0, self._first_play[0]]]), self._start[None], self._start[None]))
        play = np.concatenate([block[:, 1] for block, _, _ in blocks]) if blocks else np.empty(0)
        self._rows += len(play)
        none = np.empty((0, len(self._start)))
        reference, real = (np.concatenate([none, *(block[i] for block in blocks)]) for i in (1, 2))
        events, self._told = tuple(self._events[self._told :]), len(self._events)
        hands, lab.hands = tuple(lab.hands), []
        self._keeper.turn(
            Turn(lab.now, first, play, real, reference, there, back, events, packets, hands, self._scene)
        )

    def _robot_rests(self) -> float | None:
        """When the robot had done everything that it was told [s]; None if it hasn't."""
        everything = self._site.halted or (len(self.lab.answers) == len(self._sent) and not self._cues)
        began = self._site.epoch > 0 or self._offset is not None
        end = _end(self._site.engine) - 1e-9
        if not (everything and began) or self._play_at(self.lab.now) < end:
            return None
        return STEP * float(np.searchsorted(self._play(), end))

    def _agree(self, arrived: float) -> bool:
        """Whether the operator has heard of all that the robot did otherwise."""
        report = self.operator.report
        return not self._site.parted or (report is not None and report.sent_at >= arrived)

    def _play(self) -> Array:
        """Play time in each row of the record, the first moment included [s]."""
        return np.concatenate([self._first_play, self.lab.play[:, 1]])

    def _handle(self, mass: float | None, t: float) -> None:
        self._cues, self._handled = self._cues - 1, max(self._handled, t)
        if mass is None:
            self._body.release()
            self._tell(t, "release", "the real gripper released its load")
        else:
            self._body.attach(mass)
            self._tell(t, "payload", f"the real gripper took {mass:g} kg")

    def _tell(self, t: float, kind: str, text: str) -> None:
        self._events.append(RunEvent(t, kind, text))

    def record(self, end: float) -> TwinRun:
        """Write down what happened up to the end [s]."""
        rows = round(end / STEP) + 1
        t, play = STEP * np.arange(rows, dtype=np.float64), self._play()[:rows]
        shown = self.operator.robot.engine.timeline
        commanded = self._commanded() if self.operator.robot.corrections else shown
        reference = np.vstack([self._start, self.lab.reference.q])[:rows]
        corrections = tuple(self.operator.robot.corrections)
        self._settle(all_of_them=True)
        events = [*self._events, *waits(t, play, reference, slowest=1.0 - self._site.config.playout.slew)]
        arrivals = [(m.sent, math.nan if m.arrived is None else m.arrived) for m in self._messages]
        run = TwinRun(
            robot=self._robot,
            session=self._session,
            t=t,
            play=play,
            q_virtual=commanded.sample(t),
            q_shown=shown.sample(t),
            q_matched=commanded.sample(play),
            q_real=np.vstack([self._start, self.lab.measured])[:rows],
            q_reference=reference,
            receipts_virtual=self.operator.robot.engine.receipts,
            receipts_real=self._receipts(),
            packets=tuple(packet for packet in self._packets if packet is not None),
            messages=np.array(arrivals, dtype=np.float64).reshape(-1, 2),
            corrections=corrections,
            events=tuple(sorted(event for event in events if event.t <= end)),
        )
        if self._keeper is not None:
            self._keeper.end(run)
        return run

    def _play_at(self, t: float) -> float:
        return float(self._site.play_at(np.array([t])).p[0])

    def _answers(self) -> list[Receipt | None]:
        """What the robot's engine answered to each command that was sent."""
        return [self.lab.answers.get((1, number)) for number in range(1, len(self._sent) + 1)]

    def _settle(self, *, all_of_them: bool = False) -> tuple[CommandPacket, ...]:
        """Find out what became of commands that weren't answered before, if they are now; at the end, of all."""
        found = []
        for number in list(self._unsettled):
            answer = self.lab.answers.get((1, number))
            if answer is None and not all_of_them:
                continue
            del self._unsettled[number]
            sent, _, receipt = self._sent[number - 1]
            real_id = None if answer is None else answer.command_id
            arrived = self.lab.arrivals.get((1, number))
            packet = self._packets[number - 1] = CommandPacket(
                number, receipt.command_id, sent, arrived, real_id, sent in self._lost
            )
            self._events += command_events(packet, receipt, answer, play_at=self._play_at)
            found.append(packet)
        return tuple(found)

    def _receipts(self) -> tuple[Receipt, ...]:
        """The truth about every command at the robot; of those before a stop, what was answered then."""
        answered = {answer.command_id: answer for answer in self._answers() if answer is not None}
        answered |= {receipt.command_id: receipt for receipt in self._site.engine.receipts}
        return tuple(answered[command_id] for command_id in sorted(answered))

    def _commanded(self) -> Timeline:
        """What the commands alone make of the virtual robot."""
        return commands_alone(self._robot.arm, self._start, self._sent)


def _end(engine: Engine) -> float:
    """When an engine has done all that it was told [s], its hand too."""
    return max(engine.timeline.end, engine.scheduler.grips[-1].t)


def placed_in(scene: Scene | None, arm: Callable[..., AbstractContextManager[ArmBody]], robot: Robot) -> ArmFactory:
    """What makes an arm's body where something is around it that it can grasp; where nothing is, as it's given."""
    return arm if scene is None else grasping(arm, robot, scene)


def unheard(t: float) -> None:
    """Report no progress."""


def run_twins(
    plan: RunPlan,
    robot: Robot,
    profile: DelayProfile,
    arm: ArmFactory | None = None,
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
        robot: Which robot.
        profile: The link's delay, either way.
        arm: Makes the real robot's body; its usual one unless given.
        seed: Seed of the link, ≥ 0.
        offset: A fixed D = −D_f [s], ≤ 0; None adapts it to the network.
        service: Order of delivery on the link.
        progress: Called now and then with the user time reached [s].
        keeper: Who writes the run down while it goes on.

    Returns:
        The record, every 20 ms of user time, until both robots have been at rest for 2 s.
    """
    conditions = LinkConditions.symmetric(Conditions(delay=profile, service=service))
    with placed_in(plan.scene, arm or robot.body(), robot)(plan.start) as body:
        session = TwinSession(
            plan.start, robot, conditions, body, title=plan.title, seed=seed, offset=offset, keeper=keeper,
            scene=plan.scene,
        )  # fmt: skip
        for motion in plan.motions:
            session.lab.schedule(motion.registered_at, lambda now, motion=motion: _register(session, motion, now))  # type: ignore[misc]
        for item in plan.payloads:
            session.hand(item.t, item.mass)
        session.last_action = max((motion.registered_at for motion in plan.motions), default=0.0)
        end = session.run(PATIENCE + 4 * profile.quantile(QUANTILE), progress or unheard)
    return session.record(end)


def _register(session: TwinSession, item: PlannedMotion, now: float) -> None:
    receipt = session.operator.robot.execute(item.command, now=now)
    # What the virtual robot refused isn't sent.
    if isinstance(receipt, Receipt) and receipt.status is not Status.REJECTED:
        session.sent(now, item.command, receipt)


def run_without(
    causes: frozenset[str],
    plan: RunPlan,
    robot: Robot,
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
        robot: Which robot.
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
        plan = replace(plan, payloads=(), scene=None)
    arm = exact_arm if "servo" in causes else partial(robot.body(), friction=not free)
    return run_twins(
        plan, robot, profile, arm, seed=seed, offset=offset, service=service, progress=progress, keeper=keeper
    )


def offset_outcome(
    plan: RunPlan,
    robot: Robot,
    profile: DelayProfile,
    *,
    seed: int,
    offset: float | None,
    service: Service = Service.DATAGRAM,
    progress: Progress | None = None,
) -> OffsetOutcome:
    """Run a plan for the sake of its offset: see `interfaces.runtime.session.run_twins`."""
    run = run_twins(
        replace(plan, payloads=(), scene=None), robot, profile, exact_arm,
        seed=seed, offset=offset, service=service, progress=progress,
    )  # fmt: skip
    kinds = [event.kind for event in run.events]
    return OffsetOutcome(
        run.session.offset,
        float(-run.D.mean()),
        float(-run.D.min()),
        kinds.count("late") + kinds.count("diverged"),
        kinds.count("slowed") + kinds.count("waited"),
        measures(run).tool_rms_timeline_m,
    )
