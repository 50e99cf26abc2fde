"""Small recordings for play-back: an engine that is told things, and a real robot that does the same later."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from interfaces.engine_server.journal import difference
from interfaces.messages.recording import (
    Begin,
    ChangeEntry,
    CommandRecord,
    End,
    HistoryEntry,
    RealSample,
    RunEvent,
    VirtualSample,
)
from interfaces.recording.writer import RecordingWriter
from robots import puma560
from vrs import Engine, JointTarget, ManualClock, MotionCommand, PoseTarget, Stop, Timeline
from vrs.commands import Command, Insertion, Motion
from vrs.errors import VrsError

MODEL = puma560.model()
HOME = MODEL.poses["nominal"]
STEP = 1 / 60
BEHIND = 0.35
"""How far the real robot is behind [s]."""


def to(k: int, **named) -> MotionCommand:
    """A move to one of many places."""
    away = 0.35 * np.sin(np.arange(1, 7) * (k + 1))
    return MotionCommand(JointTarget(HOME + away), speed=named.pop("speed", 0.4), **named)


def plan(length: float) -> list[tuple[float, Command | None]]:
    """What is told when [s]: moves, redirections, a late one, a refused one, an undo."""
    X = MODEL.forward(HOME)
    X[2, 3] -= 0.05
    X[0, 3] = 99.0
    told: list[tuple[float, Command | None]] = [
        (0.2, to(0)),
        (0.9, to(1, execute_at=1.1)),
        (1.6, to(2, issued_at=0.5, execute_at=0.6)),
        (2.0, MotionCommand(PoseTarget(X), motion=Motion.LINE)),
        (2.4, to(3, insertion=Insertion.APPEND)),
        (2.5, to(4, insertion=Insertion.APPEND)),
        (2.8, None),
        (4.0, to(5)),
        (4.5, Stop()),
    ]
    told += [(5.0 + 0.8 * k, to(k)) for k in range(int(max(length - 5.0, 0.0) / 0.8))]
    return [pair for pair in told if pair[0] < length]


class Site:
    """Writes a recording as time goes by."""

    def __init__(
        self, path: Path, *, length: float, began: float | None = None, seed: int = 6, flush: float = 0.25
    ) -> None:
        self.clock = ManualClock(0.0)
        self.engine = Engine(MODEL, q=HOME, clock=self.clock)
        self.told = plan(length)
        self.edit = self.number = self.beat = 0
        begin = Begin(
            t=0.0, robot="puma560", driver="laboratory", title="a made plan", seed=seed, delay="constant:0.35",
            offset="adaptive", service="datagram", link_loss="hold", step=STEP, q=HOME.tolist(),
            lateness="postpone", software="test", began=began,
        )  # fmt: skip
        self.writer = RecordingWriter(path, begin, flush=flush)
        tau = self.engine.timeline
        history = HistoryEntry(
            edit=0, at=0.0, version=tau.version, initial=tau.initial.tolist(), start=tau.start, total=0, index=0
        )
        self.writer.write(history, t=0.0)
        self.timelines: list[tuple[float, Timeline]] = [(0.0, tau)]

    def run(self, until: float) -> None:
        """Go on to a time [s]."""
        while self.beat * STEP <= until + 1e-9:
            now = self.beat * STEP
            self.clock.set(now)
            while self.told and self.told[0][0] <= now:
                self.tell(self.told.pop(0)[1])
            self.sample(now)
            self.beat += 1

    def tell(self, command: Command | None) -> None:
        now, before = self.clock.now(), self.engine.timeline
        try:
            receipt = self.engine.undo() if command is None else self.engine.execute(command)
        except VrsError as error:
            receipt = self.engine.refuse(command, str(error))
        self.number += 1
        self.writer.write(CommandRecord(self.number, now, command, receipt), t=now)
        after = self.engine.timeline
        if after is not before:
            change = difference(before, after, now, edit=self.edit + 1, command_id=receipt.command_id)
            self.edit += 1
            entry = ChangeEntry(
                edit=self.edit, base=self.edit - 1, at=now, version=after.version, first=change.first, dof=6,
                segments=change.segments, tail=change.tail, tail_start=change.tail_start,
                end=change.end, command_id=change.command_id,
            )  # fmt: skip
            self.writer.write(entry, t=now)
            self.timelines.append((now, after))

    def event(self, kind: str, text: str) -> None:
        now = self.clock.now()
        self.writer.write(RunEvent(now, kind, text), t=now)

    def sample(self, now: float) -> None:
        q = self.engine.joints(now).tolist()
        self.writer.write(VirtualSample(now, q, self.edit), t=now)
        play = now - BEHIND
        self.writer.write(RealSample(now, play, self.engine.joints(play).tolist()), t=now)

    def end(self) -> None:
        self.writer.finish(End(self.clock.now()))


def make(path: Path, length: float = 6.0, *, close: bool = True, **named) -> Site:
    """Write a recording of so many seconds."""
    site = Site(path, length=length, **named)
    site.run(3.0)
    site.event("lost", "the message with command 4 was lost on the link")
    site.run(3.5)
    site.event("halted", "the real robot stopped: no message for 0.5 s")
    site.event("payload", "a load of 1.5 kg was picked up")
    site.run(length)
    if close:
        site.end()
    else:
        site.writer.abandon()
    return site
