"""What happens at an operator's site, as messages of a recording.

Both drivers add what they know of the real robot.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from operator import itemgetter
from typing import Protocol, TypeAlias

import numpy as np
from typing_extensions import override

from interfaces.link import PacketRecord
from interfaces.messages.fields import text
from interfaces.messages.recording import (
    Anchor,
    CellsEntry,
    CommandRecord,
    Direction,
    EditEntry,
    GivenEntry,
    HistoryEntry,
    Late,
    LinkEntry,
    Placement,
    ReceiptEntry,
    RunEvent,
    Site,
)
from interfaces.messages.requests import portable
from interfaces.messages.sites import Report, Sample
from interfaces.recording.channels import Message
from interfaces.recording.history import AnyTimeline, edit_entries, whole_entries
from interfaces.recording.kinds import ARM, MOBILE
from interfaces.recording.poses import LINK_RATE, POSE_RATE, Paced, pose_of
from interfaces.teleop import Correction
from interfaces.teleop.operator import SiteObserver
from vrs.commands import Profile
from vrs.engine import Engine, MobileEngine
from vrs.ledger import Receipt, Standing, Status
from vrs.model import Array
from vrs.timeline import Timeline

MOST_AT_ONCE = 1200
"""Samples of a robot that are taken at once; the others next time."""
MOST_REPEATED = 20_000
"""Segments of a timeline that's written once more when a recording ends, at most."""
MOST_BEFORE = 20_000
"""Segments that a recording which begins in the middle has of the time before, less those to come."""
_WAITING = 1024
"""Things that happened and weren't written yet, at most."""
_WATCHED = 64
"""Newest commands whose receipts are looked at for changes."""


Cell: TypeAlias = tuple[int, int]
"""Of the virtual environment: along x, along y."""


class Put(Protocol):
    """What a capture writes with."""

    def __call__(self, message: Message, *, t: float) -> object:
        """Take a message of a time [s]."""


_What: TypeAlias = CommandRecord | Placement | tuple[Correction, Timeline]
_Happened: TypeAlias = tuple[_What, AnyTimeline, AnyTimeline]
"""A command, a correction or a placement, and the timelines before and after it."""


class Capture(SiteObserver[Report, Timeline]):
    """Writes down an operator's site: it listens, and writes what is due when it's told the time.

    While it listens it only takes notes: commands don't wait for it.
    """

    def __init__(
        self,
        engine: Engine,
        *,
        now: float,
        step: float,
        every: bool,
        most_before: int = MOST_BEFORE,
    ) -> None:
        """Begin with a site, at its start or in the middle.

        Who makes this lets it listen to the site, and writes what `first` gives before anything else.

        Args:
            engine: The site's.
            now: By the operator's clock [s].
            step: Between two samples of the virtual robot [s].
            every: Whether receipts name every command that they shifted or superseded, however many.
            most_before: See `MOST_BEFORE`.
        """
        self.engine, self.model, self.step, self._every = engine, engine.model, step, every
        self.kind = MOBILE if isinstance(engine, MobileEngine) else ARM
        """Of the robot."""
        self.put: Put | None = None
        """Takes what is written; None at first, and when nothing can be written any more."""
        self._timeline = timeline = engine.timeline
        self._cut = max(min(timeline.index_at(now) - 2, len(timeline) - most_before), 0)
        self._happened: deque[_Happened] = deque()
        self._due: list[tuple[float, Message]] = []
        self._number = self._edit = 0
        self._row = math.ceil(now / step - 1e-9)
        self._linked = {"forward": now, "backward": now}
        self._known: dict[int, int] = {}
        self._cells: set[Cell] = set()
        self._ever: set[Cell] = set()
        self._poses = defaultdict[Site, Paced](partial(Paced, POSE_RATE))
        """When a robot's pose is shown."""
        self._links = defaultdict[tuple[str, ...], Paced](partial(Paced, LINK_RATE))
        """When the links of robots are shown at once."""
        fresh = not engine.newest and not len(timeline) and timeline.start == now
        self.late = None if fresh or self.kind is MOBILE else engine.standing()
        """How an arm's engine stood; None where nothing had happened yet."""
        self._began = timeline, now

    def first(self) -> Iterator[Message]:
        """What a recording begins with: the timeline so far, and commands that aren't over. From any thread."""
        timeline, now = self._began
        yield from whole_entries(timeline, 0, now, cut=self._cut)
        for known in () if self.late is None else self.late.known:
            yield GivenEntry(now, self._named(known.receipt), known.command, known.profile is Profile.JERK_LIMITED)

    def commanded(self, deed: CommandRecord) -> None:
        """Note a command."""
        self._note(deed)

    def corrected(self, correction: Correction, truth: Timeline) -> None:
        """Note a correction."""
        self._note((correction, truth))

    def place(self, engine: Engine, at: float, *, along: bool = False) -> None:
        """Note that a virtual base begins a drive.

        Args:
            engine: Of that drive.
            at: When [s].
            along: Whether it only goes along with the real one, which drives by itself.
        """
        self.tell_happened()
        self._known.clear()
        self.engine = engine
        x, y, theta = engine.timeline.initial.tolist()
        self._note(Placement(0, at, (x, y, theta), along))

    def learn(self, t: float, cells: Iterable[Cell]) -> None:
        """Note the cells of the virtual environment at a time [s]; events: some are new, all are gone."""
        now, before = set(cells), self._cells
        if now == before:
            return
        self.add(t, CellsEntry(t, _flat(sorted(now - before)), _flat(sorted(before - now))))
        if new := len(now - self._ever):
            self.add(t, RunEvent(t, "learned", f"the virtual environment learned {new} cell{'s' * (new > 1)}"))
        elif not now:
            self.add(t, RunEvent(t, "forgot", "the virtual environment forgot all that it had learned"))
        self._cells, self._ever = now, self._ever | now

    @override
    def answered(self, command_id: int, receipt: Receipt, *, now: float) -> None:
        """Note an answer of the robot's."""
        self.add(now, ReceiptEntry(now, "real", self._named(receipt)))

    def reported(self, report: Report, *, now: float) -> None:
        """Drivers that know the real robot by its reports alone take them."""

    def measured(self, samples: Sequence[Sample], *, now: float) -> None:
        """The same of samples."""

    def grasped(self, report: Report, *, now: float) -> None:
        """The same of its hand."""

    def failed(self, error: Exception) -> None:
        """Let a run in virtual time fail: what it records is all that comes of it."""
        raise error

    def _note(self, what: _What) -> None:
        before, self._timeline = self._timeline, self.engine.timeline
        self._happened.append((what, before, self._timeline))
        if len(self._happened) >= _WAITING:
            self.tell_happened()
            self.write_out()

    def add(self, t: float, message: Message) -> None:
        """Let a message of a time [s] be written."""
        self._due.append((t, message))

    def show(self, site: Site, t: Array, q: Array) -> None:
        """Let a robot's pose be shown, as often as it's due.

        Args:
            site: Whose.
            t: Ascending times [s], (k,).
            q: Joints or postures, (k, n).
        """
        rows = self._poses[site].chosen(t, q)
        if rows:
            for now, X in zip(t[rows].tolist(), self.kind.poses(self.model, q[rows]), strict=True):
                self.add(now, pose_of(site, now, X, self.kind.frame))

    def show_links(self, t: Array, **robots: Array) -> None:
        """Let all links of robots, `virtual` and `real`, be shown at once; see `show`."""
        rows = self._links[*robots].chosen(t, np.hstack([*robots.values()]))
        if rows:
            times = t[rows].tolist()
            chosen = {name: q[rows] for name, q in robots.items()}
            for now, frames in zip(times, self.kind.frames(self.model, times, chosen), strict=True):
                self.add(now, frames)

    def link(self, direction: Direction, records: Iterable[PacketRecord]) -> None:
        """Write down what became of packets, in the order in which it was known."""
        for record in records:
            known, entry = link_entry(direction, record)
            t = self._linked[direction] = max(self._linked[direction], known)
            self.add(t, entry)

    def sample(self, *, now: float) -> tuple[Array, Array]:
        """Write down what is due; the virtual robot's times [s], (k,), and joints [rad], (k, n), for the driver."""
        self.tell_happened()
        t = self._times(now)
        q = self.engine.timeline.sample(t)
        self._sample(t, q)
        return t, q

    def write_out(self) -> None:
        """Write what waits, by time."""
        for t, message in self.taken():
            if self.put is None:
                return
            self.put(message, t=t)

    def taken(self) -> list[tuple[float, Message]]:
        """What waits to be written, by time [s]; it waits no longer."""
        due, self._due = self._due, []
        due.sort(key=itemgetter(0))
        return due

    def _times(self, now: float) -> Array:
        """Times of the samples that are due [s], (k,)."""
        last = min(math.floor(now / self.step + 1e-9), self._row + MOST_AT_ONCE - 1)
        t: Array = self.step * np.arange(self._row, last + 1, dtype=np.float64)
        self._row = max(self._row, last + 1)
        return t

    def _sample(self, t: Array, q: Array) -> None:
        edits = [(at, message.edit) for at, message in self._due if isinstance(message, EditEntry | HistoryEntry)]
        since = edits[0][1] - 1 if edits else self._edit
        places = np.searchsorted([at for at, _ in edits], t, side="right").tolist()
        numbers = [max(since, 0), *(number for _, number in edits)]
        for row, (now, joints) in enumerate(zip(t.tolist(), q.tolist(), strict=True)):
            self.add(now, self.kind.sample(now, joints, numbers[places[row]]))
        self.show("virtual", t, q)

    def tell_happened(self) -> None:
        """Write down what was noted."""
        changed = False
        while self._happened:
            what, before, after = self._happened.popleft()
            self._number += 1
            if isinstance(what, Placement):
                at, command_id = what.at, None
                self.add(at, replace(what, number=self._number))
            elif isinstance(what, CommandRecord):
                at, receipt = what.at, None if what.receipt is None else self._named(what.receipt)
                command_id = None if receipt is None else receipt.command_id
                self.add(at, replace(what, number=self._number, receipt=receipt))
                if receipt is not None and receipt.status is not Status.REJECTED:
                    self._known[receipt.command_id] = receipt.version
            else:
                at, command_id = what[0].t, None
                self.add(at, _anchor(self._number, *what, after.version))
            if after is not before:
                changed = True
                self._edit += 1
                for change in edit_entries(before, after, self._edit, at, command_id, cut=self._cut):
                    self.add(change.at, change)
        if changed:
            self._revise()

    def _revise(self) -> None:
        """Write down receipts that later commands changed."""
        engine = self.engine
        for command_id in list(self._known)[:-_WATCHED]:
            del self._known[command_id]
        for command_id, version in self._known.items():
            receipt = engine.receipt(command_id)
            if receipt.version != version:
                self._known[command_id] = receipt.version
                now = engine.now()
                self.add(now, ReceiptEntry(now, "virtual", self._named(receipt)))

    def _named(self, receipt: Receipt) -> Receipt:
        """A receipt whose names don't take long."""
        if self._every:
            return portable(receipt)
        names = [
            names if isinstance(names, tuple) else () for names in (receipt.shifted_names, receipt.superseded_names)
        ]
        return portable(replace(receipt, shifted_names=names[0], superseded_names=names[1]))

    def whole(self, t: float) -> None:
        """Write down the newest timeline once more at a time [s]: it's known then, whatever is lost of a file."""
        if len(self._timeline) - self._cut <= MOST_REPEATED:
            for entry in whole_entries(self._timeline, self._edit, t, cut=self._cut):
                self.add(t, entry)

    def receipts(self, t: float, site: Site, receipts: Sequence[Receipt]) -> None:
        """Write down the truth about commands at a site, `virtual` or `real`, at a time [s]."""
        for receipt in receipts:
            self.add(t, ReceiptEntry(t, site, self._named(receipt)))


def _flat(cells: Iterable[Cell]) -> tuple[int, ...]:
    return tuple(number for cell in cells for number in cell)


def link_entry(direction: Direction, record: PacketRecord, size: int = 0) -> tuple[float, LinkEntry]:
    """When it was known what became of a packet [s], and that; its size [byte] where that's to be recorded."""
    known = record.sent if record.arrived is None else record.arrived
    lost = record.lost is not None
    return known, LinkEntry(direction, record.sent, record.arrived, lost, record.attempts, size)


def late_of(stand: Standing | None, t: float) -> Late | None:
    """How an engine stood when a recording begins [s], as it's written there."""
    if stand is None:
        return None
    steered, at = (None, 0.0) if stand.steered is None else stand.steered
    limits = stand.limits
    return Late(
        stand.newest, limits.qd_max.tolist(), limits.qdd_max.tolist(), limits.qddd_max.tolist(), steered, at,
        () if stand.opening == math.inf else ((t, stand.opening),),
    )  # fmt: skip


def _anchor(number: int, correction: Correction, truth: Timeline, version: int) -> Anchor:
    return Anchor(
        number=number,
        at=correction.t,
        initial=truth.initial,
        start=truth.start,
        version=truth.version,
        segments=truth.segments[:],
        end=correction.end,
        error=correction.error,
        reason=text(correction.reason),
        timeline_version=version,
    )
