"""Runs of the laboratory, recorded in step with them: a run that's killed leaves what happened until then."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from math import isnan
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeAlias

import msgspec
import numpy as np
from typing_extensions import override

from interfaces.link import PacketRecord
from interfaces.messages import recording as d
from interfaces.messages.commands import portable
from interfaces.messages.fields import cut, text
from interfaces.messages.recording import (
    COLLISION,
    Begin,
    CommandPacket,
    CommandRecord,
    Direction,
    End,
    LinkEntry,
    RealSample,
    RunEvent,
    grid_facts,
    room_entry,
)
from interfaces.recording.capture import Capture, link_entry
from interfaces.recording.channels import Message
from interfaces.recording.errors import RecordingError
from interfaces.recording.history import edit_entries, whole_entries
from interfaces.recording.poses import (
    LINK_RATE,
    POSE_RATE,
    WORLD,
    Paced,
    link_transforms,
    real_pose,
    robot_frames,
    virtual_pose,
)
from interfaces.recording.writer import RecordingWriter
from interfaces.runs.drive_run import DriveCase, DriveLink, DriveRun, Witness
from interfaces.runs.summary import CAUSES, Attribution, Measures, OffsetOutcome
from interfaces.runs.twin_run import Turn, TwinRun
from interfaces.system import software
from interfaces.teleop import OperatorSite
from interfaces.teleop.architectures import ArchitectureOperatorSite
from interfaces.teleop.architectures.compositions import CONTROL, grid_of
from robots.bullet.rooms import EMPTY
from robots.ipr.robot import MobileRobot
from robots.onboard.driving import Posture
from robots.robot import BARE
from vrs.commands import Lateness
from vrs.errors import FormatError
from vrs.mobile import Grid
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

    def begin(self, begin: Begin, operator: OperatorSite) -> None:
        """Begin the file."""
        self._capture = Capture(operator, operator.engine.model, now=0.0, step=begin.step, every=True)
        try:
            self._writer = RecordingWriter(self.path, begin)
        except RecordingError as error:
            self._fail(error)
        else:
            self._capture.put = self._put

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
        if self._writer is not None:
            self._try(self._writer.flush)

    def finish(self, attributions: Sequence[Attribution] = (), offsets: Sequence[OffsetOutcome] = ()) -> None:
        """Close the file, with what its summary says beside what can be computed from it."""
        writer, self._writer = self._writer, None
        if writer is None:
            return
        extras = msgspec.to_builtins(_Extras(tuple(attributions), tuple(offsets)))
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


Timed: TypeAlias = tuple[float, Message]
"""A message and its time [s]."""
LONGEST_WORD = 200
"""Characters of an operator's name that are kept."""


class DriveRecorder(Witness):
    """A `Witness` that writes a run into a file when it's over."""

    def __init__(self, path: Path) -> None:
        """Record into a file, which is made anew when the run is over."""
        self.path = path
        self.problem = ""
        """Why it wasn't written; empty where it was."""
        self._commands: list[Timed] = []
        """Commands, and the edits that they made."""
        self._number = 0
        self._edited: list[float] = []
        """When the timeline was edited [s]."""
        self._sent: dict[str, list[tuple[float, int]]] = {"forward": [], "backward": []}
        self._settled: dict[str, list[PacketRecord]] = {"forward": [], "backward": []}

    @override
    def begun(
        self, case: DriveCase, start: Posture, body: MobileRobot, site: ArchitectureOperatorSite, link: DriveLink
    ) -> None:
        self._case, self._start, self._site = case, start, site
        self._place = () if body.room is EMPTY else (room_entry(body.room),)
        self._grid: Grid | None = None if site.surroundings is None else grid_of(body.room, start)
        self._first = self._timeline = site.engine.timeline
        site.listener = self._commanded
        for direction, lane in (("forward", link.forward), ("backward", link.backward)):
            lane.log.told = partial(self._settle, direction)

    @override
    def sent(self, direction: str, now: float, size: int) -> None:
        self._sent[direction].append((now, size))

    def finish(self, drive: DriveRun) -> None:
        """Write the run down. A disk that doesn't take it is a `problem`, and ends nothing else."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            writer = RecordingWriter(self.path, self._begin())
        except (RecordingError, OSError) as error:
            self.problem = str(error)
            return
        try:
            for t, message in self._messages(drive):
                writer.write(message, t=t)
            writer.finish(End(float(drive.t[-1])))
        except RecordingError as error:
            self.problem = str(error)
            writer.give_up()

    def _commanded(self, deed: CommandRecord) -> None:
        before, self._timeline = self._timeline, self._site.engine.timeline
        receipt = None if deed.receipt is None else portable(deed.receipt)
        self._number += 1
        self._commands.append((deed.at, replace(deed, number=self._number, receipt=receipt)))
        if self._timeline is not before:
            self._edited.append(deed.at)
            command_id = None if receipt is None else receipt.command_id
            entries = edit_entries(before, self._timeline, len(self._edited), deed.at, command_id)
            self._commands += [(deed.at, entry) for entry in entries]

    def _settle(self, direction: str, record: PacketRecord) -> None:
        if not record.copy:
            self._settled[direction].append(record)

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
            drive=d.DriveFacts(
                body=BARE if case.robot == BARE else case.real[0].name,
                architecture=case.architecture,
                transport=case.transport.value,
                operator=text(case.operator)[:LONGEST_WORD],
                length=case.length,
                period=case.constants.period,
                position=case.position,
                grid=None if self._grid is None else grid_facts(self._grid),
            ),
        )

    def _messages(self, drive: DriveRun) -> Iterator[Timed]:
        """All of them, by time."""
        end = float(drive.t[-1])
        yield from ((0.0, entry) for entry in self._place)
        yield from ((0.0, entry) for entry in whole_entries(self._first, 0, 0.0))
        yield from heapq.merge(
            self._commands,
            self._samples(drive),
            self._shown(drive),
            self._packets("forward", end),
            self._packets("backward", end),
            self._learned(drive),
            sorted(
                ((c.time, RunEvent(c.time, COLLISION, f"collision: {c.thing}")) for c in drive.touched),
                key=itemgetter(0),
            ),
            key=itemgetter(0),
        )
        yield from ((end, entry) for entry in whole_entries(self._timeline, len(self._edited), end))
        yield from ((end, entry) for entry in self._place)

    def _samples(self, drive: DriveRun) -> Iterator[Timed]:
        edits = np.searchsorted(self._edited, drive.t, side="right").tolist()
        columns = (drive.t, drive.virtual, drive.real, drive.measured, drive.estimated, drive.drives, drive.offset)
        for row, (t, virtual, real, measured, estimated, (v, w), D) in enumerate(
            zip(*(column.tolist() for column in columns), strict=True)
        ):
            x, y, theta = virtual
            yield t, d.VirtualPosture(t, x, y, theta, edits[row])
            yield t, d.RealPosture(t, *real, v=v, w=w, D=None if isnan(D) else D)
            yield t, d.MeasuredPosture(t, *measured)
            yield t, d.EstimatedPosture(t, *estimated)

    def _shown(self, drive: DriveRun) -> Iterator[Timed]:
        """Both robots for other readers, at a lower rate."""
        poses, links = Paced(POSE_RATE), Paced(LINK_RATE)
        both = np.hstack([drive.virtual, drive.real])
        drawn = set(links.chosen(drive.t, both))
        for row in sorted(drawn | set(poses.chosen(drive.t, both))):
            t, X = float(drive.t[row]), np.stack([_pose(*q) for q in (drive.virtual[row], drive.real[row])])
            yield t, virtual_pose(t, X[0], WORLD)
            yield t, real_pose(t, X[1], WORLD)
            if row in drawn:
                yield t, robot_frames(t, WORLD, ("virtual", "real"), X)

    def _packets(self, direction: Direction, end: float) -> Iterator[Timed]:
        """Packets whose fate is known, and then those that are still on their way."""
        settled = self._settled[direction]
        for record in settled:
            yield link_entry(direction, record, record.size)
        known_ones = {record.number for record in settled}
        for number, (sent, size) in enumerate(self._sent[direction]):
            if number not in known_ones:
                yield end, LinkEntry(direction, sent, size=size)

    def _learned(self, drive: DriveRun) -> Iterator[Timed]:
        """What came into the virtual environment and went; events are cells that are new, and that all are gone."""
        before: set[tuple[int, int]] = set()
        ever: set[tuple[int, int]] = set()
        for t, cells in drive.learned:
            now = set(cells)
            if now == before:
                continue
            yield t, d.CellsEntry(t, _flat(sorted(now - before)), _flat(sorted(before - now)))
            if new := len(now - ever):
                text = f"the virtual environment learned {new} cell{'s' * (new > 1)}"
                yield t, RunEvent(t, "learned", text)
            elif not now:
                yield t, RunEvent(t, "forgot", "the virtual environment forgot all that it had learned")
            before, ever = now, ever | now


def _flat(cells: Iterable[tuple[int, int]]) -> tuple[int, ...]:
    return tuple(number for cell in cells for number in cell)


def _pose(x: float, y: float, theta: float) -> Array:
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
