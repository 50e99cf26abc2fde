"""A run of both twins in the laboratory, whoever operates: a plan, or a program.

The operator's site takes each command at once and sends it on; the robot's site carries it out, plays its timeline,
and its body follows at 1 kHz.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol, TypeAlias

import numpy as np

from interfaces.link import Conditions, LinkConditions, PacketRecord
from interfaces.runtime.happenings import command_events, correction_events, waits
from interfaces.runtime.laboratory import Body, Laboratory
from interfaces.runtime.offset import spelled
from interfaces.runtime.plan import PlannedCommand
from interfaces.runtime.run import Event, Packet, TwinRun
from interfaces.teleop import OperatorSite, RobotSite, RobotSiteConfig
from vrs import Engine, Lateness, ManualClock, Receipt, Status
from vrs.model import Array, RobotModel
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


class Arm(Body, Protocol):
    """A robot's body, with a hand."""

    def attach(self, mass: float) -> None:
        """Take a load [kg] that the servo doesn't know."""

    def release(self) -> None:
        """Drop the load."""


ArmFactory: TypeAlias = Callable[[Array], AbstractContextManager[Arm]]
"""Makes a body at rest at the given joints [rad]."""
Progress: TypeAlias = Callable[[float], None]
"""Told the user time reached [s]."""


class TwinSession:
    """State of one run. Who operates schedules what is done, and says when nothing more will be."""

    def __init__(
        self,
        start: Array,
        model: RobotModel,
        conditions: LinkConditions,
        body: Arm,
        *,
        seed: int,
        offset: float | None,
    ) -> None:
        """Put both twins at rest.

        Args:
            start: Joints [rad], (n,).
            model: The robot.
            conditions: What the link does.
            body: The real robot's.
            seed: Seed of the link, ≥ 0.
            offset: A fixed D = −D_f [s], ≤ 0; None adapts it to the network.
        """
        self._start, self._model, self._offset, self._body = start, model, offset, body
        self.operator = OperatorSite(model, start, now=0.0, lateness=Lateness.POSTPONE)
        config = RobotSiteConfig(fixed_offset=offset, beat=REPORT)
        self._robot = RobotSite(model, start, now=0.0, config=config)
        self.lab = Laboratory(
            self.operator, self._robot, conditions, np.random.default_rng(seed),
            tick=TICK, every=round(STEP / TICK), body=body,
        )  # fmt: skip
        self._sent: list[tuple[float, PlannedCommand, Receipt]] = []
        self._messages: list[PacketRecord] = []
        self._events: list[Event] = []
        self._cues, self._handled = 0, 0.0
        self.last_action = 0.0
        """When the operator did something last, or will [s]; infinity while that's unknown."""

    def sent(self, now: float, command: PlannedCommand, receipt: Receipt) -> None:
        """Write down a command that the virtual robot took, and the operator's site sent on."""
        self._sent.append((now, command, receipt))

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
            self._messages += lab.link.forward.log.take()
            progress(lab.now)
            rest = max(self.last_action, self._handled, self.operator.engine.timeline.end)
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
        self._messages += lab.link.forward.log.take()
        progress(lab.now)
        return end

    def _robot_rests(self) -> float | None:
        """When the robot had done everything that it was told [s]; None if it hasn't."""
        everything = self._robot.halted or (len(self.lab.answers) == len(self._sent) and not self._cues)
        began = self._robot.epoch > 0 or self._offset is not None
        end = self._robot.engine.timeline.end - 1e-9
        if not (everything and began) or self._play_at(self.lab.now) < end:
            return None
        return STEP * float(np.searchsorted(self._play(), end))

    def _agree(self, arrived: float) -> bool:
        """Whether the operator has heard of all that the robot did otherwise."""
        report = self.operator.report
        return not self._robot.parted or (report is not None and report.sent_at >= arrived)

    def _play(self) -> Array:
        """Play time in each row of the record, the first moment included [s]."""
        return np.concatenate([self._robot.play_at(np.zeros(1)).p, self.lab.play[:, 1]])

    def _handle(self, mass: float | None, t: float) -> None:
        self._cues, self._handled = self._cues - 1, max(self._handled, t)
        if mass is None:
            self._body.release()
            self._tell(t, "release", "the real gripper released its load")
        else:
            self._body.attach(mass)
            self._tell(t, "payload", f"the real gripper took {mass:g} kg")

    def _tell(self, t: float, kind: str, text: str) -> None:
        self._events.append(Event(t, kind, text))

    def record(self, end: float, title: str, link: Conditions, seed: int) -> TwinRun:
        """Write down what happened up to the end [s]."""
        rows = round(end / STEP) + 1
        t, play = STEP * np.arange(rows, dtype=np.float64), self._play()[:rows]
        shown = self.operator.engine.timeline
        commanded = self._commanded() if self.operator.corrections else shown
        reference = np.vstack([self._start, self.lab.reference.q])[:rows]
        corrections = tuple(self.operator.corrections)
        packets = self._packets()
        fates = zip(packets, (receipt for _, _, receipt in self._sent), self._answers(), strict=True)
        events = [
            *self._events,
            *(event for fate in fates for event in command_events(*fate, play_at=self._play_at)),
            *waits(t, play, reference, slowest=1.0 - self._robot.config.playout.slew),
            *correction_events(corrections),
            *(Event(at, "halted", f"the real robot stopped: {why}") for at, why in self.lab.halts.values()),
        ]
        arrivals = [(m.sent, math.nan if m.arrived is None else m.arrived) for m in self._messages]
        return TwinRun(
            model=self._model,
            title=title,
            seed=seed,
            delay=link.delay.name,
            offset=spelled(self._offset),
            service=str(link.service),
            link_loss=LINK_LOSS,
            t=t,
            play=play,
            q_virtual=commanded.sample(t),
            q_shown=shown.sample(t),
            q_matched=commanded.sample(play),
            q_real=np.vstack([self._start, self.lab.measured])[:rows],
            q_reference=reference,
            receipts_virtual=self.operator.engine.receipts,
            receipts_real=self._receipts(),
            packets=packets,
            messages=np.array(arrivals, dtype=np.float64).reshape(-1, 2),
            corrections=corrections,
            events=tuple(sorted((e for e in events if e.t <= end), key=lambda event: event.t)),
        )

    def _play_at(self, t: float) -> float:
        return float(self._robot.play_at(np.array([t])).p[0])

    def _answers(self) -> list[Receipt | None]:
        """What the robot's engine answered to each command that was sent."""
        return [self.lab.answers.get((1, number)) for number in range(1, len(self._sent) + 1)]

    def _packets(self) -> tuple[Packet, ...]:
        lost = {m.sent for m in self._messages if m.lost is not None or m.attempts > 1}
        return tuple(
            Packet(
                receipt.command_id,
                sent,
                self.lab.arrivals.get((1, number)),
                None if answer is None else answer.command_id,
                sent in lost,
            )
            for number, ((sent, _, receipt), answer) in enumerate(
                zip(self._sent, self._answers(), strict=True), start=1
            )
        )

    def _receipts(self) -> tuple[Receipt, ...]:
        """The truth about every command at the robot; of those before a stop, what was answered then."""
        answered = {answer.command_id: answer for answer in self._answers() if answer is not None}
        answered |= {receipt.command_id: receipt for receipt in self._robot.engine.receipts}
        return tuple(answered[command_id] for command_id in sorted(answered))

    def _commanded(self) -> Timeline:
        """What the commands alone make of the virtual robot."""
        clock = ManualClock(0.0)
        engine = Engine(self._model, q=self._start, clock=clock, lateness=Lateness.POSTPONE)
        for now, command, _ in self._sent:
            clock.set(now)
            engine.execute(command)
        return engine.timeline


def unheard(t: float) -> None:
    """Report no progress."""


def status_counts(receipts: tuple[Receipt, ...]) -> dict[str, int]:
    """How many receipts there are of each status."""
    return {str(status): sum(r.status is status for r in receipts) for status in Status}
