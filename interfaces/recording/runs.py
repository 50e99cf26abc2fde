"""Runs of the laboratory, recorded in step with them: a run that's killed leaves what happened until then."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from interfaces.recording.capture import Capture
from interfaces.recording.channels import Message
from interfaces.recording.errors import RecordingError
from interfaces.recording.messages import Begin, End, EventEntry, PacketEntry, RealSample
from interfaces.recording.poses import LINK_RATE, POSE_RATE, Paced, link_transforms, real_pose
from interfaces.recording.sink import Sink
from interfaces.recording.writer import RecordingWriter
from interfaces.runs.attribution import CAUSES, Attribution, Measures, OffsetOutcome
from interfaces.runs.keeper import RunFacts, Turn
from interfaces.runs.twin_run import CommandPacket, RunEvent, TwinRun
from interfaces.system import software
from interfaces.teleop import OperatorSite
from interfaces.wire.fields import text
from vrs.commands import Lateness
from vrs.errors import FormatError
from vrs.model import Array


class RunRecorder:
    """Writes one run into a file. A disk that takes no more ends the recording, not the run."""

    def __init__(self, path: Path) -> None:
        """Record into a file, which is made anew when the run begins."""
        self.path = path
        self.problem = ""
        """Why nothing more is written; empty while all is."""
        self._writer: RecordingWriter | None = None
        self._capture: Capture | None = None
        self._real, self._links = Paced(POSE_RATE), Paced(LINK_RATE)
        self._events: set[RunEvent] = set()
        self._packets: dict[int, CommandPacket] = {}
        self._end = 0.0

    def begin(self, facts: RunFacts, operator: OperatorSite) -> None:
        """Begin the file."""
        self._capture = Capture(operator, facts.model, now=0.0, step=facts.step, every=True)
        begin = Begin(
            t=0.0,
            robot=facts.model.name,
            driver="laboratory",
            title=facts.title,
            seed=facts.seed,
            delay=facts.delay,
            offset=facts.offset,
            service=facts.service,
            link_loss=facts.link_loss,
            step=facts.step,
            q=np.asarray(facts.start, float).tolist(),
            lateness=str(Lateness.POSTPONE),
            software=software(),
        )
        sink = None
        try:
            sink = Sink.create(self.path)
            self._writer = RecordingWriter(sink, begin)
        except RecordingError as error:
            self._fail(error)
            if sink is not None:
                sink.close()
        else:
            self._capture.put = self._put

    def turn(self, turn: Turn) -> None:
        """Write down what has happened."""
        capture = self._capture
        if capture is None or self._writer is None:
            return
        capture.link("forward", turn.there)
        capture.link("backward", turn.back)
        for number, packet in turn.packets:
            self._tell_packet(number, packet, turn.now)
        for event in turn.events:
            self._tell_event(event, event.t)
        t: Array = capture.step * np.arange(turn.first, turn.first + len(turn.play), dtype=np.float64)
        rows = zip(t.tolist(), turn.play.tolist(), turn.q_real.tolist(), turn.q_reference.tolist(), strict=True)
        for now, play, q, reference in rows:
            capture.add(now, RealSample(now, play, q, reference))
        capture.show(self._real, t, turn.q_real, capture.model.forward, real_pose)
        self._tell_links(capture, t, turn.q_real, *capture.advance(now=turn.now))
        capture.write_out()

    def _tell_links(self, capture: Capture, t: Array, q_real: Array, t_virtual: Array, q_virtual: Array) -> None:
        # Both robots have samples at the same times, but for the last ones of a run.
        k = min(len(t), len(t_virtual))
        rows = self._links.chosen(t[:k], np.hstack([q_virtual[:k], q_real[:k]]))
        if rows:
            virtual, real = capture.model.links(q_virtual[rows]), capture.model.links(q_real[rows])
            for row, X, Y in zip(rows, virtual, real, strict=True):
                capture.add(t[row], link_transforms(t[row], (("virtual", X[1:]), ("real", Y[1:]))))

    def _tell_event(self, event: RunEvent, t: float) -> None:
        if event not in self._events and self._capture is not None:
            self._events.add(event)
            self._capture.add(t, EventEntry(float(event.t), event.kind, text(event.text)))

    def _tell_packet(self, number: int, packet: CommandPacket, t: float) -> None:
        if self._packets.get(number) != packet and self._capture is not None:
            self._packets[number] = packet
            entry = PacketEntry(
                number=number,
                command_id=packet.command_id,
                sent=packet.sent,
                arrived=packet.arrived,
                real_id=packet.real_id,
                lost=packet.lost,
            )
            self._capture.add(t, entry)

    def end(self, run: TwinRun) -> None:
        """Write down what is known once the run is over; what is in the file then can be read."""
        capture = self._capture
        if capture is None or self._writer is None:
            return
        self._end = end = float(run.t[-1])
        capture.receipts(end, "virtual", run.receipts_virtual)
        capture.receipts(end, "real", run.receipts_real)
        for number, packet in enumerate(run.packets, start=1):
            self._tell_packet(number, packet, end)
        for event in run.events:
            self._tell_event(event, end)
        capture.whole(end)
        capture.write_out()
        if self._writer is not None:
            self._try(self._writer.flush)

    def finish(self, attributions: Sequence[Attribution] = (), offsets: Sequence[OffsetOutcome] = ()) -> None:
        """Close the file, with what its summary says beside what can be computed from it."""
        writer, self._writer = self._writer, None
        if writer is None:
            return
        extras = {
            "attributions": [asdict(item) for item in attributions],
            "offsets": [asdict(item) for item in offsets],
        }
        self._try(lambda: writer.finish(End(self._end, extras)))

    def _put(self, message: Message, *, t: float) -> None:
        writer = self._writer
        if writer is not None:
            self._try(lambda: writer.write(message, t=t))

    def _try(self, do: Callable[[], None]) -> None:
        """Do something with the file; a disk that doesn't take it ends the recording."""
        try:
            do()
        except RecordingError as error:
            self._fail(error)

    def _fail(self, error: RecordingError) -> None:
        self.problem = str(error)
        writer, self._writer = self._writer, None
        if self._capture is not None:
            self._capture.put = None
        if writer is not None:
            writer.give_up()


class _Extras(msgspec.Struct, frozen=True):
    """What `RunRecorder.finish` was given."""

    attributions: tuple[Attribution, ...] = ()
    offsets: tuple[OffsetOutcome, ...] = ()


def extras_of(extras: dict[str, Any], where: str) -> tuple[tuple[Attribution, ...], tuple[OffsetOutcome, ...]]:
    """What `RunRecorder.finish` was given.

    Args:
        extras: As it stands at the end of a file.
        where: The file.

    Raises:
        FormatError: If it's something else.
    """
    try:
        found = msgspec.convert(extras, _Extras)
    except msgspec.MsgspecError as error:
        raise FormatError(where, f"its end: {error}") from None
    for item in found.attributions:
        if item.measure not in Measures.__slots__ or tuple(cause for cause, _ in item.parts) != CAUSES:
            raise FormatError(where, f"its end has a measure {item.measure!r} or causes that aren't known here")
    return found.attributions, found.offsets
