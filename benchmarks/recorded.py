"""Recordings to measure with: motion like the demo's, written in virtual time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from benchmarks.moves import MODEL
from interfaces.messages import recording as m
from interfaces.recording import RecordingWriter
from interfaces.recording.channels import Message
from interfaces.recording.history import edit_entries, whole_entries
from interfaces.recording.poses import LINK_RATE, POSE_RATE, link_transforms, pose_of
from vrs import Engine, JointTarget, ManualClock, MotionCommand
from vrs.model import Array

RATE = 60
"""Samples of both robots a second."""
EVERY = 3.0
"""A command so often [s]; its move takes two thirds of that."""
BEHIND = 0.25
"""How far the real robot is behind, about [s]."""
HOME = MODEL.poses["nominal"]


def begin() -> m.Begin:
    """How such a recording is set up."""
    return m.Begin(
        t=0.0, robot="puma560", driver="live", title="benchmark", seed=0, delay="mon", offset="adaptive",
        service="datagram", link_loss="hold", step=1 / RATE, q=HOME.tolist(), lateness="postpone", software="vrs",
        began=1.7e9,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """Both twins at one moment, and what else was said then."""

    t: float
    edit: int
    q: Array
    play: float
    measured: Array
    reference: Array
    moving: bool
    others: list[Message]


def ticks(seconds: float, seed: int = 0) -> Iterator[Tick]:
    """Both twins: the arm moves two thirds of the time, and all the digits of the real one are noise."""
    rng = np.random.default_rng(seed)
    engine = Engine(MODEL, q=HOME, clock=(clock := ManualClock(0.0)))
    number, others = 0, list[Message]()
    for k in range(round(seconds * RATE) + 1):
        t = k / RATE
        clock.set(t)
        others = [*whole_entries(engine.timeline, 0, t)] if k == 0 else []
        if k % round(EVERY * RATE) == 0:
            number += 1
            others += _command(engine, number, t, rng)
        if k % 6 == 0:
            ways: tuple[Literal["forward", "backward"], ...] = ("forward", "backward")
            others += [m.LinkEntry(way, t - 0.1, t - 0.1 + 0.05 * rng.random()) for way in ways]
        play = t - BEHIND - 0.01 * rng.random()
        reference = engine.joints(play)
        measured = reference + 1e-4 * rng.normal(size=len(reference))
        moving = bool(engine.timeline.sample(t, derivative=1).any())
        if k == round(seconds * RATE):
            others += whole_entries(engine.timeline, number, t)
        yield Tick(t, number, engine.joints(t), play, measured, reference, moving, others)


class Teller:
    """Makes of ticks what is recorded."""

    def __init__(self) -> None:
        self._drawn = -1.0

    def messages(self, tick: Tick) -> list[Message]:
        """The messages of a tick."""
        t = tick.t
        found: list[Message] = [
            *tick.others,
            m.VirtualSample(t, tick.q.tolist(), tick.edit),
            m.RealSample(t, tick.play, tick.measured.tolist(), tick.reference.tolist()),
        ]
        if t - self._drawn >= (1 / min(LINK_RATE, POSE_RATE) if tick.moving else 1.0) - 1e-9:
            self._drawn = t
            virtual, real = MODEL.links(tick.q), MODEL.links(tick.measured)
            found += [
                pose_of("virtual", t, virtual[-1]),
                pose_of("real", t, real[-1]),
                link_transforms(t, [("virtual", virtual), ("real", real)]),
            ]
        return found


def _command(engine: Engine, number: int, t: float, rng: np.random.Generator) -> list[Message]:
    before = engine.timeline
    command = MotionCommand(JointTarget(_target(engine.joints(t), rng)), execute_at=t)
    receipt = engine.execute(command)
    return [
        m.CommandRecord(number, t, command, receipt.named()),
        *edit_entries(before, engine.timeline, number, t, receipt.command_id),
        m.ReceiptEntry(t, "real", receipt.named()),
        m.CommandPacket(number, number, t, t + BEHIND, number),
    ]


def _target(q: Array, rng: np.random.Generator) -> Array:
    """A target to which a move takes two thirds of the time between two commands."""
    way, low, high = rng.uniform(-1.0, 1.0, len(q)), 0.0, 4.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        target = np.clip(HOME + middle * way, MODEL.limits.q_min + 0.01, MODEL.limits.q_max - 0.01)
        receipt = Engine(MODEL, q=q, clock=None).execute(MotionCommand(JointTarget(target)))
        assert receipt.end is not None
        assert receipt.execute_at is not None
        short = receipt.end - receipt.execute_at < 2 / 3 * EVERY
        low, high = (middle, high) if short else (low, middle)
    return target


def record(path: Path, seconds: float) -> int:
    """Write a recording of so many seconds in virtual time; its size [bytes]."""
    writer, teller = RecordingWriter(path, begin()), Teller()
    for tick in ticks(seconds):
        for message in teller.messages(tick):
            writer.write(message, t=tick.t)
    writer.finish(m.End(seconds))
    return path.stat().st_size
