"""A run of the mobile robot's laboratory, recorded: noted while it goes on, written once it's over."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from functools import partial
from math import isnan
from operator import itemgetter
from pathlib import Path
from typing import TypeAlias

import numpy as np
from typing_extensions import override

from interfaces.link import PacketRecord
from interfaces.recording.channels import Message
from interfaces.recording.driving import messages as d
from interfaces.recording.driving.arcs import edit_entries, whole_entries
from interfaces.recording.driving.figures import COLLISION
from interfaces.recording.driving.rooms import grid_facts, room_entry
from interfaces.recording.errors import RecordingError
from interfaces.recording.messages import Begin, CommandEntry, End, EventEntry, LinkEntry
from interfaces.recording.poses import LINK_RATE, POSE_RATE, Paced, frames, placed_pose
from interfaces.recording.sink import Sink
from interfaces.recording.writer import RecordingWriter
from interfaces.runs.drive_run import DriveCase, DriveLink, DriveRun, Witness
from interfaces.system import software
from interfaces.teleop import CommandRecord
from interfaces.teleop.architectures import ArchitectureOperatorSite
from interfaces.teleop.architectures.equipment import CONTROL, grid_of
from interfaces.wire.fields import text
from robots.bullet.rooms import EMPTY
from robots.ipr.robot import MobileRobot
from robots.onboard.driving import Posture
from vrs.commands import Lateness
from vrs.mobile import ArcTimeline, Grid
from vrs.model import Array

Timed: TypeAlias = tuple[float, Message]
"""A message and its time [s]."""
LONGEST_WORD = 200
"""Characters of an operator's name that are kept."""


class DriveRecorder(Witness):
    """A `Witness` that writes a run into a file. What it costs a run is a note a command and a packet."""

    def __init__(self, path: Path) -> None:
        """Record into a file, which is made anew when the run is over."""
        self.path = path
        self.problem = ""
        """Why it wasn't written; empty where it was."""
        self._deeds: list[tuple[CommandRecord, ArcTimeline]] = []
        self._sent: dict[str, list[tuple[float, int]]] = {"forward": [], "backward": []}
        self._settled: dict[str, list[PacketRecord]] = {"forward": [], "backward": []}

    @override
    def begun(
        self, case: DriveCase, start: Posture, body: MobileRobot, site: ArchitectureOperatorSite, link: DriveLink
    ) -> None:
        self._case, self._start, self._site = case, start, site
        self._place = () if body.room is EMPTY else (room_entry(body.room),)
        self._grid: Grid | None = None if site.surroundings is None else grid_of(body.room, start)
        self._first = site.engine.timeline
        site.listener = self._commanded
        for direction, lane in (("forward", link.forward), ("backward", link.backward)):
            lane.log.told = partial(self._settle, direction)

    @override
    def sent(self, direction: str, now: float, size: int) -> None:
        self._sent[direction].append((now, size))

    def finish(self, drive: DriveRun) -> None:
        """Write the run down. A disk that doesn't take it is a `problem`, and ends nothing else."""
        sink = None
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            sink = Sink.create(self.path)
            writer = RecordingWriter(sink, self._begin())
        except (RecordingError, OSError) as error:
            self.problem = str(error)
            if sink is not None:
                sink.close()
            return
        try:
            for t, message in self._messages(drive):
                writer.write(message, t=t)
            writer.finish(End(float(drive.t[-1])))
        except RecordingError as error:
            self.problem = str(error)
            writer.give_up()

    def _commanded(self, deed: CommandRecord) -> None:
        self._deeds.append((deed, self._site.engine.timeline))

    def _settle(self, direction: str, record: PacketRecord) -> None:
        if not record.copy:
            self._settled[direction].append(record)

    def _begin(self) -> Begin:
        case = self._case
        named = case.architecture, case.transport.value, case.delay, case.robot, case.operator
        return Begin(
            t=0.0,
            robot="ipr",
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
                body=case.robot,  # type: ignore[arg-type]
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
            self._commands(),
            self._samples(drive),
            self._shown(drive),
            self._packets("forward", end),
            self._packets("backward", end),
            self._learned(drive),
            sorted(
                ((c.time, EventEntry(c.time, COLLISION, f"collision: {c.thing}")) for c in drive.touched),
                key=itemgetter(0),
            ),
            key=itemgetter(0),
        )
        edits = len(self._edited())
        yield from ((end, entry) for entry in whole_entries(self._site.engine.timeline, edits, end))
        yield from ((end, entry) for entry in self._place)

    def _edited(self) -> list[float]:
        """When the timeline was edited [s]."""
        found, before = [], self._first
        for deed, after in self._deeds:
            if after is not before:
                found.append(deed.at)
            before = after
        return found

    def _commands(self) -> Iterator[Timed]:
        """Commands, and the edits that they made."""
        before, edit = self._first, 0
        for number, (deed, after) in enumerate(self._deeds, start=1):
            command_id = None if deed.receipt is None else deed.receipt.command_id
            yield deed.at, CommandEntry.of(number, deed.at, deed.command, deed.receipt, refused=deed.refused)
            if after is not before:
                edit += 1
                for entry in edit_entries(before, after, edit, deed.at, command_id):
                    yield deed.at, entry
            before = after

    def _samples(self, drive: DriveRun) -> Iterator[Timed]:
        edits = np.searchsorted(self._edited(), drive.t, side="right").tolist()
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
            t, X = float(drive.t[row]), [_pose(*q) for q in (drive.virtual[row], drive.real[row])]
            yield t, placed_pose(t, X[0], virtual=True)
            yield t, placed_pose(t, X[1], virtual=False)
            if row in drawn:
                yield t, frames(t, (("virtual", X[0]), ("real", X[1])))

    def _packets(self, direction: str, end: float) -> Iterator[Timed]:
        """Packets whose fate is known, and then those that are still on their way."""
        settled = self._settled[direction]
        for r in settled:
            known = r.sent if r.arrived is None else r.arrived
            yield known, LinkEntry(direction, r.sent, r.arrived, r.lost is not None, r.attempts, r.size)  # type: ignore[arg-type]
        known_ones = {record.number for record in settled}
        for number, (sent, size) in enumerate(self._sent[direction]):
            if number not in known_ones:
                yield end, LinkEntry(direction, sent, size=size)  # type: ignore[arg-type]

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
                yield t, EventEntry(t, "learned", text)
            elif not now:
                yield t, EventEntry(t, "forgot", "the virtual environment forgot all that it had learned")
            before, ever = now, ever | now


def _flat(cells: Iterable[tuple[int, int]]) -> tuple[int, ...]:
    return tuple(number for cell in cells for number in cell)


def _pose(x: float, y: float, theta: float) -> Array:
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
