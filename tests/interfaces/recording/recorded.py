"""Recordings to test with: a smooth motion, whose samples are known functions of their number."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from interfaces.messages import recording as m
from interfaces.recording import Recording, RecordingWriter
from interfaces.recording.channels import Message
from interfaces.recording.history import edit_entries, whole_entries
from interfaces.recording.poses import link_transforms, pose_of
from robots import puma560
from tests.interfaces.stream.same import same
from vrs import Engine, Insertion, JointTarget, Lateness, ManualClock, MotionCommand

MODEL = puma560.model()
HOME = MODEL.poses["nominal"]
STEP = 1 / 60


def begin(**fields: Any) -> m.Begin:
    usual: dict[str, Any] = {
        "t": 0.0, "robot": "puma560", "driver": "laboratory", "title": "a test", "seed": 3, "delay": "mon",
        "offset": "adaptive", "service": "datagram", "link_loss": "hold", "step": STEP, "q": HOME.tolist(),
        "lateness": "postpone", "software": "vrs test",
    }  # fmt: skip
    return m.Begin(**usual | fields)


def sample(k: int, step: float = STEP) -> m.RealSample:
    t = k * step
    return m.RealSample(t, t - 0.3, (HOME + 0.1 * np.sin(t + np.arange(6))).tolist(), HOME.tolist())


def history(engine: Engine, number: int) -> m.HistoryEntry:
    (entry,) = whole_entries(engine.timeline, number, engine.now())
    return entry


def motion(
    seconds: float, *, step: float = STEP, every: float = 1.0, drawn: float = 0.5, seed: int = 0
) -> tuple[list[tuple[float, Message]], Engine, list[Any]]:
    """Messages of both twins, of every kind, with their times; the engine, and its timelines after each edit."""
    rng = np.random.default_rng(seed)
    engine = Engine(MODEL, q=HOME, clock=(clock := ManualClock(0.0)), lateness=Lateness.POSTPONE)
    found: list[tuple[float, Message]] = [(0.0, history(engine, 0))]
    timelines, number, shown = [engine.timeline], 0, -1.0
    for k in range(round(seconds / step) + 1):
        t = k * step
        clock.set(t)
        if t >= number * every:
            number += 1
            before = engine.timeline
            target = JointTarget(HOME + rng.uniform(-0.4, 0.4, 6))
            command = MotionCommand(target, execute_at=t + 0.1, insertion=list(Insertion)[number % 3])
            receipt = engine.execute(command)
            timelines.append(engine.timeline)
            (edit,) = edit_entries(before, engine.timeline, number, t, receipt.command_id)
            found += [
                (t, m.CommandRecord(number, t, command, receipt)),
                (t, edit),
                (t, m.ReceiptEntry(t, "real", receipt.named())),
                (t, m.GivenEntry(t, receipt.named(), smooth=True)),
                (t, m.CommandPacket(number, receipt.command_id, t, t + 0.2, receipt.command_id)),
                (t, m.LinkEntry("forward", t, t + 0.2)),
                (t, m.LinkEntry("backward", t, lost=True, attempts=2)),
                (t, m.RunEvent(t, "late", f"command {number} came late")),
            ]
        q = engine.joints(t)
        found += [(t, m.VirtualSample(t, q.tolist(), number)), (t, sample(k, step))]
        if t >= shown + drawn:
            shown = t
            links = MODEL.links(q)
            found += [(t, pose_of("virtual", t, links[-1])), (t, pose_of("real", t, links[-1]))]
            found.append((t, link_transforms(t, [("virtual", links), ("real", links)])))
    return found, engine, timelines


def write(path: Path, messages: list[tuple[float, Message]], *, end: float | None = None, **fields: Any) -> Path:
    """Write a recording; without an end it's cut."""
    writer = RecordingWriter(path, begin(**fields))
    for t, message in messages:
        writer.write(message, t=t)
    if end is None:
        writer.flush()
        writer.abandon()
    else:
        writer.finish(m.End(end, {"offsets": [1.5, None]}))
    return path


def everything(recording: Recording) -> dict[str, list[Any]]:
    """All that a recording says, in lists of plain values."""
    found: dict[str, list[Any]] = {
        "commands": list(recording.commands),
        "changes": list(recording.changes),
        "events": list(recording.events),
        "link": list(recording.link),
        "packets": list(recording.packets),
    }
    for topic in ("/virtual/joints", "/real/joints"):
        track = recording.track(topic)
        columns = (track.t, track.q, track.play, track.reference, track.edit)
        found[topic] = [tuple(np.ravel(part).tobytes() for part in row) for row in zip(*columns, strict=True)]
    return found


def is_part(some: list[Any], whole: list[Any]) -> bool:
    """Whether a list is another one with items left out."""
    rest: Iterator[Any] = iter(whole)
    return all(any(same(item, other) for other in rest) for item in some)
