"""A recording that's open for reading."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from interfaces.messages.recording import (
    Anchor,
    Begin,
    CellsEntry,
    CommandPacket,
    CommandRecord,
    Dropped,
    End,
    GivenEntry,
    LinkEntry,
    Placement,
    ReceiptEntry,
    RoomEntry,
    RunEvent,
)
from interfaces.recording.hands import RecordedHands
from interfaces.recording.history import AnyEdit, AnyTimeline, Chain, RecordedEdit, sampled
from interfaces.recording.kinds import ARM, MOBILE, RecordingKind
from interfaces.recording.mcap_reading import NUMBERS, Blocks, Damage, FileSource
from interfaces.recording.track import Log, SampleTrack, Tracks
from robots.robot import BARE, Robot, described, load, names
from vrs.commands import Grip
from vrs.errors import FormatError, InvalidValueError
from vrs.ledger import LedgerEntry, Receipt
from vrs.model import Array, frozen_array
from vrs.scheduler import HandGoal
from vrs.segment import times

POSTURE = 3
"""Numbers of a posture."""
Deed: TypeAlias = CommandRecord | Anchor | Placement
"""What the operator's engine was told, or what put the virtual robot elsewhere."""


def shows(begin: Begin) -> list[str]:
    """What a page shows besides both robots and the committed path: the paths, and what was learned of the room."""
    if begin.drive is None:
        return []
    return ["driven"] if begin.drive.grid is None else ["driven", "learned"]


def open_recording(path: Path | str, robot: Robot | None = None) -> Recording:
    """Open a recording, complete, cut, damaged or still being written.

    Args:
        path: The file.
        robot: What it may be of, if it has that name; else the robot is found by its name.

    Raises:
        FormatError: If it's none, or if what it begins with is destroyed.
    """
    return Recording(Path(path), robot)


_LOOKED_AT: Final = 16
"""Blocks that are read to see whether a description is the one that was recorded."""
_SAME_PLACE: Final = 1e-5
"""Largest distance of a recorded pose from the computed one [m]: it's written to 1e-9, its time to a nanosecond."""


class Recording:
    """One recording: the virtual robot is computed, the real one lies on lines between its samples.

    What is missing stands in `damage`; nothing is made up for it.
    """

    def __init__(self, path: Path, robot: Robot | None = None) -> None:
        self.path, self._robot = path, robot
        self._source = FileSource(path)
        try:
            self._blocks = Blocks(self._source)
            self.logs = {topic: Log(self._blocks, topic, str(path)) for topic in NUMBERS}
            """Entries by channel."""
            self.end: End | None = None
            """What it was closed with; None where it's cut."""
            begin = self._session()
            if begin is None:
                raise FormatError(str(path), "isn't a recording, or the block that it begins with is destroyed")
            self.session: Begin = begin
            """How the run was set up."""
            self.kind: RecordingKind = ARM if begin.drive is None else MOBILE
            """What its robot is."""
            # A reference a joint; v and ω.
            told = len(begin.q) if begin.drive is None else 2
            self._tracks = Tracks(self._blocks, len(begin.q), told, str(path))
            self._chain, self._applied = Chain(str(path)), 0
            self._told: tuple[int, tuple[HandGoal, ...]] = (-1, ())
            self.hands = RecordedHands(self.logs["/hand"].entries)
            """The real arm's hand, and the things around it."""
        except FormatError:
            self._source.close()
            raise

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._source.close()

    def _session(self) -> Begin | None:
        """Whether the recording has ended; the first beginning that's readable."""
        held = self._blocks.having(NUMBERS["/session"])
        if held and not self.end:
            ends = [entry for entry in self.logs["/session"].of(held[-1]) if isinstance(entry, End)]
            if ends:
                self.end = ends[-1]
                self._blocks.complete = True
        for index in held:
            for entry in self.logs["/session"].of(index):
                if isinstance(entry, Begin):
                    return entry
        return None

    def poll(self) -> bool:
        """Look whether a file that is still being written has grown.

        Raises:
            FormatError: If what has come is none of a recording's.
        """
        if self._blocks.complete:
            return False
        grown = self._blocks.grow()
        if grown:
            self._session()
        return grown

    @property
    def damage(self) -> Damage:
        """What is missing; of a file above 256 MiB only blocks that were read are looked at."""
        return self._blocks.damage()

    @property
    def dropped(self) -> dict[str, int]:
        """Messages that weren't recorded because the disk was too slow, by topic."""
        found: dict[str, int] = {}
        for entry in self.logs["/session"].entries():
            if isinstance(entry, Dropped):
                for drop in entry.counts:
                    found[drop.topic] = max(drop.count, found.get(drop.topic, 0))
        return found

    @cached_property
    def robot(self) -> Robot:
        """The robot that it's of.

        Raises:
            FormatError: If it's none that is known here, or has other joints.
        """
        begin = self.session
        # Mobile robots of one family have its name as their model's, and a name of their own.
        name = begin.robot if begin.drive is None or begin.drive.body == BARE else begin.drive.body
        robot = self._robot
        if robot is None or robot.name != name:
            robot = self._found(name, begin.found_by)
        if robot is None or robot.name != name:
            raise FormatError(
                str(self.path), f"of a robot that isn't known here: {name!r}; --robot says where it is"
            )
        numbers = POSTURE if begin.drive is not None else robot.arm.limits.dof
        if len(begin.q) != numbers:
            raise FormatError(str(self.path), f"of a {name!r} with {len(begin.q)} numbers to say where it is")
        if begin.drive is None and described(begin.found_by):
            self._check_description(robot)
        return robot

    def _check_description(self, robot: Robot) -> None:
        """See that an arm's last link is where the recording has it; else each figure of its tool would be another.

        Raises:
            FormatError: If it isn't: the description has changed since, or it's another one of the same name.
        """
        held = list(self._blocks.having(NUMBERS["/virtual/pose"]))
        log = self.logs["/virtual/pose"]
        shown = [entry for index in held[:: len(held) // _LOOKED_AT + 1] for entry in log.of(index)]
        q = self.virtual([entry.timestamp.sec + 1e-9 * entry.timestamp.nsec for entry in shown])
        known = np.isfinite(q).all(axis=-1)
        if not known.any():
            return
        places = (entry.pose.position for entry in shown)
        p = np.array([[place.x, place.y, place.z] for place in places])
        off = np.linalg.norm(self.kind.poses(robot.arm, q[known])[:, :3, 3] - p[known], axis=1)
        # A single one may have been shown before a command of the same instant counted.
        if (off > _SAME_PLACE).mean() > 0.1:
            text = f"its tool is up to {1e3 * off.max():.3g} mm from where the recording has it"
            said = f"of another {robot.name!r} than is there now: {text}; --robot says where the old one is"
            raise FormatError(str(self.path), said)

    def _found(self, name: str, found_by: str) -> Robot | None:
        """The robot of a file or of numbers, or of a name; None where nothing here has it.

        No module is imported because a recording says so.

        Raises:
            FormatError: If its file is gone, or can't be read any more.
        """
        if not described(found_by):
            return load(name) if name in names() else None
        try:
            return load(found_by)
        except (FormatError, InvalidValueError) as error:
            said = f"of {name!r}, a robot that was read from a file: {error}; --robot says where it is"
            raise FormatError(str(self.path), said) from None

    @cached_property
    def model(self) -> Any:
        """The robot's model: a `RobotModel`, or a `MobileBase` with the period of its run.

        Raises:
            FormatError: If it's none that is known here.
        """
        drive = self.session.drive
        return self.robot.arm if drive is None else replace(self.robot.base, period=drive.period)

    @cached_property
    def prismatic(self) -> Collection[int]:
        """Joints that are, from 0; none where the robot has none, or isn't known."""
        try:
            return () if self.session.drive is not None else self.model.prismatic
        except FormatError:
            return ()

    @property
    def unit(self) -> str:
        """Of how far the real robot is from the virtual one: `rad`, or `m` of an arm without a joint that turns."""
        return "m" if len(self.prismatic) == len(self.session.q) else self.kind.unit

    @property
    def span(self) -> tuple[float, float]:
        """From the beginning to the last sample [s]."""
        start, last = self.session.t, self.session.t
        for topic in (self.kind.virtual, self.kind.real):
            for index in reversed(self._blocks.having(NUMBERS[topic])):
                first, end = self._blocks.span(index)
                track = self._tracks.between(topic, first * 1e-9 - 1e-6, end * 1e-9 + 1e-6)
                if len(track.t):
                    last = max(last, float(track.t[-1]))
                    break
        return start, last

    @property
    def commands(self) -> tuple[Deed, ...]:
        """What the operator's engine was told, in order; numbers are missing where blocks are."""
        return tuple(entry for entry in self._commands() if isinstance(entry, CommandRecord | Anchor | Placement))

    def receipts(self, site: Literal["virtual", "real"]) -> tuple[Receipt, ...]:
        """The newest truth about each command at a site, by command id."""
        found = {}
        for entry in self._commands():
            if isinstance(entry, ReceiptEntry):
                if entry.site == site:
                    found[entry.receipt.command_id] = entry.receipt
            elif isinstance(entry, CommandRecord | GivenEntry) and site == "virtual" and entry.receipt is not None:
                found[entry.receipt.command_id] = entry.receipt
        return tuple(found[command_id] for command_id in sorted(found))

    @property
    def grips(self) -> tuple[HandGoal, ...]:
        """What the hand was told, by time."""
        count = len(self._commands())
        if self._told[0] == count:
            return self._told[1]
        late = self.session.late
        goals = [HandGoal(*goal) for goal in (() if late is None else late.grips)]
        for entry in self.commands:
            if isinstance(entry, CommandRecord) and isinstance(entry.command, Grip):
                at = None if entry.receipt is None else entry.receipt.execute_at
                goals += [] if at is None else [HandGoal(at, float(entry.command.opening))]
        self._told = count, tuple(sorted(goals))
        return self._told[1]

    @property
    def packets(self) -> tuple[CommandPacket, ...]:
        """Commands on their way across the link, in the order of sending; what is newest about each."""
        found = {entry.number: entry for entry in self._commands() if isinstance(entry, CommandPacket)}
        return tuple(found[number] for number in sorted(found))

    @property
    def given(self) -> tuple[LedgerEntry, ...]:
        """Commands from before the recording that weren't over when it began.

        Raises:
            FormatError: If one is none.
        """
        try:
            return tuple(entry.known for entry in self._commands() if isinstance(entry, GivenEntry))
        except InvalidValueError as error:
            raise FormatError(str(self.path), f"a command from before it: {error}") from None

    def _commands(self) -> list[Deed | ReceiptEntry | CommandPacket | GivenEntry]:
        return self.logs["/commands"].entries()

    @property
    def events(self) -> tuple[RunEvent, ...]:
        """What else happened, by time."""
        return tuple(sorted(self.logs["/events"].entries(), key=attrgetter("t")))

    @property
    def changes(self) -> tuple[AnyEdit, ...]:
        """The messages about the timeline, as they stand in the file."""
        return tuple(self.logs["/timeline"].entries())

    @property
    def edits(self) -> tuple[RecordedEdit, ...]:
        """The timelines that the virtual robot had, one after the other.

        Raises:
            FormatError: If an edit doesn't fit the timeline before it.
        """
        return tuple(self._edits())

    def _edits(self) -> list[RecordedEdit]:
        entries = self.logs["/timeline"].entries()
        while self._applied < len(entries):
            self._chain.add(entries[self._applied])
            self._applied += 1
        return self._chain.edits

    @property
    def timeline(self) -> AnyTimeline:
        """The newest that is known.

        Raises:
            FormatError: If none is.
        """
        return self._known()[-1].timeline

    def _known(self) -> list[RecordedEdit]:
        edits = self._edits()
        if not edits:
            raise FormatError(str(self.path), "the block with the timeline is destroyed")
        return edits

    @property
    def drives(self) -> Sequence[AnyTimeline]:
        """The newest timeline of each drive, by their starts; of an arm there's one. Not to be changed.

        Raises:
            FormatError: If none is known.
        """
        self._known()
        return self._chain.drives

    def timeline_at(self, t: float) -> AnyTimeline:
        """The timeline as it was known at a user time [s]: what came later isn't in it.

        Raises:
            FormatError: If none is known.
        """
        edits = self._known()
        return edits[max(bisect_right(self._chain.times, t) - 1, 0)].timeline

    @property
    def certain(self) -> float:
        """Up to this time the newest timeline is what the virtual robot did [s]; infinity if complete."""
        edits = self._edits()
        if not edits:
            return -math.inf
        newest, lost = edits[-1], self._blocks.lost(NUMBERS["/timeline"])
        spans = [(first * 1e-9, last * 1e-9) for first, last in lost if last * 1e-9 > newest.at]
        if self._chain.broken:
            return max(newest.at, spans[0][0]) if spans else newest.at
        for first, last in spans:
            after = self._tracks.between(self.kind.virtual, last, last + 2.0)
            if not len(after.t) or after.edit[0] != newest.number:
                return max(newest.at, first)
        return math.inf

    def virtual(self, t: ArrayLike) -> Array:
        """Joints of the virtual robot, or its posture, computed from the newest timeline of each drive.

        Args:
            t: User time [s], scalar or (k,).

        Returns:
            [rad], (n,) or (k, n); NaN where a lost edit may have changed it.

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
        """
        moments = times(t)
        found: Array = sampled(self.drives, moments).copy()
        found[np.asarray(moments) > self.certain + 1e-9] = np.nan
        return found

    def real(self, t: ArrayLike) -> Array:
        """Joints of the real robot as measured, or its true posture, on lines between the samples.

        Args:
            t: User time [s], scalar or (k,).

        Returns:
            [rad], (n,) or (k, n); NaN outside of the samples, and where some are lost.

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
        """
        return self._at(t, "q")

    def play(self, t: ArrayLike) -> Array:
        """Where the real robot played its timeline, or wanted to [s]; see `real`."""
        return self._at(t, "play")

    def _at(self, t: ArrayLike, column: str) -> Array:
        moments = times(t)
        found = self._tracks.at(self.kind.real, np.atleast_1d(moments), column)
        return found if moments.ndim else found[0]

    def track(self, topic: str, since: float = -math.inf, until: float = math.inf) -> SampleTrack:
        """The samples of a robot, both ends included [s]; only blocks that are needed are read.

        Raises:
            InvalidValueError: If the topic has none.
        """
        return self._tracks.between(topic, since, until)

    @property
    def room(self) -> RoomEntry | None:
        """Where a mobile robot drove; None if that isn't there."""
        rooms = [entry for entry in self.logs["/session"].entries() if isinstance(entry, RoomEntry)]
        return rooms[-1] if rooms else None

    @property
    def learned(self) -> tuple[CellsEntry, ...]:
        """What came into the virtual environment, and went, in order."""
        return tuple(self.logs["/environment"].entries())

    def messages(self) -> Array:
        """When packets to the robot were sent and arrived [s], (m, 2), in the order of the file; NaN: lost."""
        rows = [
            (entry.sent, np.nan if entry.arrived is None else entry.arrived)
            for entry in self.link
            if entry.direction == "forward"
        ]
        return frozen_array(np.array(rows).reshape(-1, 2))

    @property
    def link(self) -> tuple[LinkEntry, ...]:
        """Packets of the link whose fate was known, both ways, in the order of the file."""
        return tuple(self.logs["/link"].entries())


def check_alike(recordings: Sequence[Recording]) -> None:
    """Refuse recordings of robots of different kinds.

    Raises:
        InvalidValueError: If they are.
    """
    names = [recording.kind.name for recording in recordings]
    if len(set(names)) > 1:
        given = f"{recordings[0].path} of {names[0]} and {recordings[1].path} of {names[1]}"
        raise InvalidValueError("recordings", given, "of one kind of robot")
