"""Runs of the laboratory, recorded in step with them: a run that's killed leaves what happened until then."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isnan
from operator import itemgetter
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from typing_extensions import override

from interfaces.link import PacketRecord
from interfaces.messages.fields import cut, text
from interfaces.messages.recording import (
    COLLISION,
    Begin,
    CommandPacket,
    Direction,
    DriveFacts,
    EditEntry,
    End,
    EstimatedPosture,
    HandEntry,
    HistoryEntry,
    LinkEntry,
    MeasuredPosture,
    RealPosture,
    RealSample,
    RunEvent,
    SceneEntry,
    grid_facts,
    room_entry,
)
from interfaces.recording.capture import Capture, link_entry
from interfaces.recording.channels import Message
from interfaces.recording.mcap_file import RecordingError
from interfaces.recording.poses import POSE_RATE, Paced, pose_of
from interfaces.recording.writer import RecordingWriter
from interfaces.runs.drive_run import DriveCase, DriveLink, DriveRun, Witness
from interfaces.runs.summary import CAUSES, Attribution, Measures, OffsetOutcome
from interfaces.runs.twin_run import Turn, TwinRun
from interfaces.system import software
from interfaces.teleop import OperatorSite, VirtualArm
from interfaces.teleop.architectures import ArchitectureOperatorSite
from interfaces.teleop.architectures.compositions import CONTROL, grid_of
from robots.bullet.grasping import HandState
from robots.mobile.robot import MobileRobot
from robots.onboard.driving import Posture
from robots.robot import BARE
from robots.rooms import EMPTY
from robots.things import ThingPose, has_moved
from vrs.commands import Lateness
from vrs.errors import FormatError
from vrs.mobile import Grid
from vrs.model import Array


class _FileRecorder:
    """Writes a run into a file. A disk that takes no more ends the recording, not the run."""

    def __init__(self, path: Path) -> None:
        """Record into a file, which is made anew."""
        self.path = path
        self.problem = ""
        """Why nothing more is written; empty while all is."""
        self._writer: RecordingWriter | None = None

    def _open(self, begin: Begin) -> None:
        """Make the file."""
        try:
            self._writer = RecordingWriter(self.path, begin)
        except RecordingError as error:
            self.problem = str(error)

    def _put(self, message: Message, *, t: float) -> None:
        """Write a message, if that can be done."""
        self._try(lambda writer: writer.write(message, t=t))

    def _close(self, end: End) -> None:
        """Close the file in order, if that can be done."""
        self._try(lambda writer: writer.finish(end))
        self._writer = None

    def _try(self, do: Callable[[RecordingWriter], None]) -> None:
        """Do something with the file, while there's one; a disk that doesn't take it ends the recording."""
        writer = self._writer
        try:
            if writer is not None:
                do(writer)
        except RecordingError as error:
            self.problem, self._writer = str(error), None
            if writer is not None:
                writer.give_up()


class RunRecorder(_FileRecorder):
    """Writes one run of an arm's twins into a file, while it goes on."""

    def __init__(self, path: Path) -> None:
        """Record into a file, which is made anew when the run begins."""
        super().__init__(path)
        self._capture: Capture | None = None
        self._events: set[RunEvent] = set()
        self._packets: dict[int, CommandPacket] = {}
        self._hands: dict[int, ThingPose] = {}
        """Where things were written down to be, by number."""
        self._hand: tuple[float, int | None] | None = None
        """How the hand was written down: its opening [m], and what it held."""
        self._end = 0.0

    def begin(self, begin: Begin, operator: OperatorSite[VirtualArm]) -> None:
        """Begin the file."""
        self._capture = capture = Capture(operator.robot.engine, now=0.0, step=begin.step, every=True)
        operator.listener = capture
        self._open(begin)
        for message in capture.first():
            capture.add(0.0, message)
        capture.put = self._put

    def turn(self, turn: Turn) -> None:
        """Write down what has happened."""
        capture = self._capture
        if capture is None or self._writer is None:
            return
        capture.link("forward", turn.there)
        capture.link("backward", turn.back)
        for packet in turn.packets:
            self._tell_packet(packet, turn.now)
        for event in turn.events:
            self._tell_event(event, event.t)
        t: Array = capture.step * np.arange(turn.first, turn.first + len(turn.play), dtype=np.float64)
        rows = zip(t.tolist(), turn.play.tolist(), turn.q_real.tolist(), turn.q_reference.tolist(), strict=True)
        for now, play, q, reference in rows:
            capture.add(now, RealSample(now, play, q, reference))
        capture.show("real", t, turn.q_real)
        if turn.scene is not None and self._hand is None:
            capture.add(0.0, SceneEntry(turn.scene))
        for now, state in turn.hands:
            self._show_hand(now, state)
        t_virtual, q_virtual = capture.sample(now=turn.now)
        # Both robots have samples at the same times, but for the last ones of a run.
        k = min(len(t), len(t_virtual))
        capture.show_links(t[:k], virtual=q_virtual[:k], real=turn.q_real[:k])
        capture.write_out()

    def _show_hand(self, t: float, state: HandState) -> None:
        """Write down the hand, and the things that have moved since they were written down."""
        assert self._capture is not None
        moved = tuple((k, pose) for k, pose in enumerate(state.poses) if has_moved(self._hands.get(k), pose))
        self._hands.update(moved)
        told = round(state.opening, 5), state.holds
        if moved or told != self._hand:
            self._hand = told
            self._capture.add(t, HandEntry(t, *told, moved))

    def _tell_event(self, event: RunEvent, t: float) -> None:
        if event not in self._events and self._capture is not None:
            self._events.add(event)
            self._capture.add(t, cut(event))

    def _tell_packet(self, packet: CommandPacket, t: float) -> None:
        if self._packets.get(packet.number) != packet and self._capture is not None:
            self._packets[packet.number] = packet
            self._capture.add(t, packet)

    def end(self, run: TwinRun) -> None:
        """Write down what is known once the run is over; what is in the file then can be read."""
        capture = self._capture
        if capture is None or self._writer is None:
            return
        self._end = end = float(run.t[-1])
        capture.receipts(end, "virtual", run.receipts_virtual)
        capture.receipts(end, "real", run.receipts_real)
        for packet in run.packets:
            self._tell_packet(packet, end)
        for event in run.events:
            self._tell_event(event, end)
        capture.whole(end)
        capture.write_out()
        self._try(RecordingWriter.flush)

    def finish(self, attributions: Sequence[Attribution] = (), offsets: Sequence[OffsetOutcome] = ()) -> None:
        """Close the file, with what its summary says beside what can be computed from it."""
        self._close(End(self._end, msgspec.to_builtins(_Extras(tuple(attributions), tuple(offsets)))))


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


LONGEST_WORD = 200
"""Characters of an operator's name that are kept."""


class DriveRecorder(_FileRecorder, Witness):
    """A `Witness` that writes a run into a file when it's over."""

    @override
    def begun(
        self, case: DriveCase, start: Posture, body: MobileRobot, site: ArchitectureOperatorSite, link: DriveLink
    ) -> None:
        self._case, self._start = case, start
        self._place = () if body.room is EMPTY else (room_entry(body.room),)
        self._grid: Grid | None = None if site.surroundings is None else grid_of(body.room, start)
        self._noted: list[tuple[float, Message]] = []
        self._capture = Capture(site.engine, now=0.0, step=CONTROL, every=True)
        self._capture.put = self._note
        for message in self._capture.first():
            self._note(message, t=0.0)
        site.listener = self._capture.commanded
        self._sent: dict[Direction, list[tuple[float, int]]] = {"forward": [], "backward": []}
        self._settled: dict[Direction, list[PacketRecord]] = {"forward": [], "backward": []}
        link.forward.log.told = self._settled["forward"].append
        link.backward.log.told = self._settled["backward"].append

    def _note(self, message: Message, *, t: float) -> None:
        self._noted.append((t, message))

    @override
    def sent(self, direction: Direction, now: float, size: int) -> None:
        self._sent[direction].append((now, size))

    def finish(self, drive: DriveRun) -> None:
        """Write the run down. A disk that doesn't take it is a `problem`, and ends nothing else."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self.problem = str(error)
            return
        end, capture = float(drive.t[-1]), self._capture
        capture.tell_happened()
        capture.write_out()
        self._add_samples(drive)
        self._add_poses(drive)
        self._add_packets("forward", end)
        self._add_packets("backward", end)
        for t, cells in drive.learned:
            capture.learn(t, cells)
        for touch in drive.touched:
            capture.add(touch.time, RunEvent(touch.time, COLLISION, f"collision: {touch.thing}"))
        capture.whole(end)
        capture.write_out()
        self._open(self._begin())
        for entry in self._place:
            self._put(entry, t=0.0)
        for t, message in sorted(self._noted, key=itemgetter(0)):
            self._put(message, t=t)
        for entry in self._place:
            self._put(entry, t=end)
        self._close(End(end))

    def _begin(self) -> Begin:
        case = self._case
        named = case.architecture, case.transport.value, case.delay, case.robot, case.operator
        return Begin(
            t=0.0,
            robot=case.real[0].base.name,
            driver="laboratory",
            title=text(f"{', '.join(named)}, seed {case.seed}"),
            seed=case.seed,
            delay=text(case.delay),
            offset="adaptive" if case.architecture == "timeline" else "none",
            service=case.transport.service.value,
            link_loss="hold",
            step=CONTROL,
            q=list(self._start),
            lateness=str(Lateness.POSTPONE),
            software=software(),
            drive=DriveFacts(
                body=BARE if case.robot == BARE else case.real[0].name,
                architecture=case.architecture,
                transport=case.transport.value,
                operator=text(case.operator)[:LONGEST_WORD],
                length=case.length,
                period=case.constants.period,
                position=case.position,
                grid=None if self._grid is None else grid_facts(self._grid),
            ),
            found_by=text(case.real[0].recorded_by),
        )

    def _add_samples(self, drive: DriveRun) -> None:
        """Where both robots were, and were thought to be."""
        capture = self._capture
        edited = {m.edit: t for t, m in self._noted if isinstance(m, EditEntry | HistoryEntry) and m.edit}
        edits = np.searchsorted(list(edited.values()), drive.t, side="right").tolist()
        columns = (drive.t, drive.virtual, drive.real, drive.measured, drive.estimated, drive.drives, drive.offset)
        rows = zip(*(column.tolist() for column in columns), edits, strict=True)
        for t, virtual, real, measured, estimated, (v, w), D, edit in rows:
            capture.add(t, capture.kind.sample(t, virtual, edit))
            capture.add(t, RealPosture(t, *real, v=v, w=w, D=None if isnan(D) else D))
            capture.add(t, MeasuredPosture(t, *measured))
            capture.add(t, EstimatedPosture(t, *estimated))

    def _add_poses(self, drive: DriveRun) -> None:
        """Both robots for other readers, at a lower rate."""
        capture = self._capture
        rows = Paced(POSE_RATE).chosen(drive.t, np.hstack([drive.virtual, drive.real]))
        t, robots = drive.t[rows].tolist(), {"virtual": drive.virtual[rows], "real": drive.real[rows]}
        poses = (capture.kind.poses(capture.model, q) for q in robots.values())
        shown = zip(t, *poses, capture.kind.frames(capture.model, t, robots), strict=True)
        for now, X_virtual, X_real, frames in shown:
            capture.add(now, pose_of("virtual", now, X_virtual, capture.kind.frame))
            capture.add(now, pose_of("real", now, X_real, capture.kind.frame))
            capture.add(now, frames)

    def _add_packets(self, direction: Direction, end: float) -> None:
        """Packets whose fate is known, and then those that are still on their way."""
        settled = [record for record in self._settled[direction] if not record.copy]
        for record in settled:
            self._capture.add(*link_entry(direction, record, record.size))
        known = {record.number for record in settled}
        for number, (sent, size) in enumerate(self._sent[direction]):
            if number not in known:
                self._capture.add(end, LinkEntry(direction, sent, size=size))
