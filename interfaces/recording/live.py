"""A live operator's site, recorded while it serves: nothing that moves waits for the disk."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from typing_extensions import override

from interfaces.messages import fields
from interfaces.messages.recording import (
    OWN,
    Begin,
    CommandRecord,
    End,
    HandEntry,
    MeasuredPosture,
    RealPosture,
    RealSample,
    RunEvent,
    SceneEntry,
)
from interfaces.messages.sites import DriveReport, Report, Sample
from interfaces.recording.capture import Capture, late_of
from interfaces.recording.channels import Message
from interfaces.recording.drives import LiveDrives
from interfaces.recording.mcap_file import RecordingError, Sink
from interfaces.recording.recorder import Recorder
from interfaces.runs.twin_run import correction_events
from interfaces.system import software
from interfaces.teleop import Correction
from interfaces.teleop.architectures.compositions import CONTROL
from interfaces.teleop.connection import SiteLine
from interfaces.teleop.samples import PERIOD
from interfaces.teleop.virtual_base import VirtualBase
from robots.rooms import Room
from robots.things import Scene, ThingPose, has_moved
from vrs.ledger import Receipt, Status
from vrs.timeline import Timeline

RATE = 60.0
"""Samples of the virtual robot a second."""
TURN = 0.1
"""Time between two turns [s]."""
_SAME = 1e-9
"""Times nearer than this [s] are one."""
_ASKED = 4096
"""Commands whose answers are waited for, at most."""
_SAMPLES = 8192
"""Samples of the real robot that wait for the next turn, at most."""


@dataclass(frozen=True, slots=True)
class LiveRecording:
    """What is recorded of a live site, and where to."""

    path: Path
    """The file, made anew."""
    offset: str
    """How far the robot plays behind, as it was asked for."""
    link_loss: str
    """What it does when messages stay away."""
    failed: Callable[[str], None] | None = None
    """Is told once why nothing more is recorded."""
    over: bool = True
    """Whether a file that's there already is written over."""
    robot: str = ""
    """Name of a mobile robot, which its model's needn't be; the model's unless given."""
    found_by: str = ""
    """What finds the robot where that's a file or numbers."""
    room: Room | None = None
    """Where a mobile robot drives."""
    architecture: str = OWN
    """What a mobile robot does with the operator's path, by its name, where that's known."""


_Measured: TypeAlias = tuple[float, Sequence[float], tuple[Message, ...]]
"""A time [s], where the real robot was then, and what is written of that."""


class LiveRecorder(Capture):
    """Records an operator's site. `advance` takes its turns; a thread of the recorder's does the writing.

    It begins with a session, or in its middle; takes notes from when it's made, and writes once `open` has made a
    file. `finish` ends it; or `end`, and `close` from a thread, which takes a moment.
    """

    def __init__(
        self, what: LiveRecording, line: SiteLine[Any, Any, Any], *, seed: int, began: float, now: float = 0.0
    ) -> None:
        """Begin to take notes.

        Args:
            what: What is recorded, and where to.
            line: From the operator's site, of any robot, to the robot; nobody else listens to that site.
            seed: Of the emulated link.
            began: Seconds since 1970 now.
            now: Session time [s].
        """
        self._site, robot = line.operator, line.operator.robot
        drives = LiveDrives(line.operator, what.room, now=now) if isinstance(robot, VirtualBase) else None
        engine = robot.engine
        step = 1.0 / RATE if drives is None else CONTROL
        super().__init__(engine, now=now, step=step, every=False)
        self._site.listener = self
        self.path, self.since = what.path, now
        self._what, self._link, self._drives = what, line.link, drives
        for way in (line.link.forward, line.link.backward):
            way.log.take()
        link, name = line.link.conditions.forward, engine.model.name
        self._begin = Begin(
            t=now,
            robot=name,
            driver="live",
            title=f"live {what.robot or name}",
            seed=seed,
            delay=fields.text(link.delay.name),
            offset=what.offset,
            service=str(link.service),
            link_loss=what.link_loss,
            step=step,
            q=engine.timeline.sample(now).tolist(),
            lateness=str(engine.parameters["lateness"]),
            software=software(),
            began=began,
            sampled=PERIOD if drives is None else None,
            late=late_of(self.late, now),
            drive=None if drives is None else drives.facts(what.robot or name, what.architecture),
            found_by=fields.text(what.found_by),
        )
        self.recorder: Recorder | None = None
        """Writes the file, once there is one."""
        self._asked: OrderedDict[int, float] = OrderedDict()
        self._samples: list[_Measured] = []
        self._connected = self._halted = self._followed = False
        self._stopped, self._told = "", False
        self._scene: Scene | None = None
        self._things: dict[int, ThingPose] = {}
        """Where things were written down to be, by number."""
        self._rest: tuple[End, tuple[Receipt, ...]] | None = None

    @override
    def first(self) -> Iterator[Message]:
        if self._drives is not None:
            yield from self._drives.rooms()
        yield from super().first()

    def open(self) -> None:
        """Make the file, with what is known so far; from any thread.

        Raises:
            RecordingError: If the file can't be made.
        """
        sink = Sink.create(self.path, over=self._what.over)
        try:
            self.recorder = Recorder(sink, self._begin, first=self.first())
        except RecordingError:
            self.leave()
            raise
        self.put = self.recorder.put

    def leave(self) -> None:
        """Listen no more."""
        self.put = None
        if self._site.listener is self:
            self._site.listener = None

    def advance(self, *, now: float, connected: bool) -> None:
        """Write down what is due at a time [s].

        Args:
            now: Session time [s].
            connected: Whether the robot is heard of.
        """
        if self.put is None:
            return
        self._look()
        if connected is not self._connected:
            self._connected = connected
            text = "the real robot is heard of" if connected else "the real robot isn't heard of any more"
            self.tell(now, "up" if connected else "down", text)
        self.link("forward", self._link.forward.log.take())
        self.link("backward", self._link.backward.log.take())
        if self._drives is not None:
            self._drives.follow(self, now=now)
        t, q = self.sample(now=now)
        self.show_links(t, virtual=q)
        self._write_samples()
        self.write_out()

    def _write_samples(self) -> None:
        """Write down what was measured of the real robot since the last time."""
        samples, self._samples = sorted(self._samples, key=itemgetter(0)), []
        if not samples:
            return
        t, q = np.array([now for now, *_ in samples]), np.array([where for _, where, _ in samples])
        for now, _, messages in samples:
            for message in messages:
                self.add(now, message)
        self.show("real", t, q)
        self.show_links(t, real=q)

    @override
    def commanded(self, deed: CommandRecord) -> None:
        super().commanded(deed)
        receipt = deed.receipt
        if receipt is not None and receipt.status is not Status.REJECTED and receipt.execute_at is not None:
            self._asked[receipt.command_id] = receipt.execute_at
            if len(self._asked) > _ASKED:
                self._asked.popitem(last=False)

    @override
    def corrected(self, correction: Correction, truth: Timeline) -> None:
        if self._drives is not None:
            self.place(self._site.robot.engine, correction.t)
            return
        super().corrected(correction, truth)
        for event in correction_events([correction], self.model.prismatic):
            self.add(event.t, fields.cut(event))

    @override
    def answered(self, command_id: int, receipt: Receipt, *, now: float) -> None:
        super().answered(command_id, receipt, now=now)
        asked = self._asked.pop(command_id, None)
        if receipt.status is Status.REJECTED or receipt.execute_at is None:
            self.tell(now, "diverged", f"the real robot rejected command {command_id}: {receipt.reason}")
        elif asked is not None and receipt.execute_at > asked + _SAME:
            late = f"executed at {receipt.execute_at:.3f} s instead of {asked:.3f} s"
            self.tell(now, "late", f"command {command_id} was late at the real robot: {late}")

    @override
    def reported(self, report: Report | DriveReport, *, now: float) -> None:
        halted = bool(report.halted)
        if halted and not self._halted and self._followed:
            self.tell(now, "halted", f"the real robot stopped: {report.halted}")
        elif not halted and (self._halted or not self._followed):
            self.tell(now, "followed", "the real robot follows the operator")
        self._halted, self._followed = halted, self._followed or not halted
        if isinstance(report, DriveReport):
            t, posture, drive = report.measured_at, report.posture, report.drive
            # Its own measurement is all that's known of where it truly is.
            real = RealPosture(t, *posture, v=drive.v, w=drive.w, D=report.D)
            self._measure(t, posture, real, MeasuredPosture(t, *posture))

    @override
    def measured(self, samples: Sequence[Sample], *, now: float) -> None:
        # Of a mobile robot reports say more.
        for one in () if self._drives is not None else samples:
            q, reference = one.q.tolist(), None if one.reference is None else one.reference.tolist()
            self._measure(one.t, q, RealSample(one.t, one.play, q, reference))

    @override
    def grasped(self, report: Report, *, now: float) -> None:
        hand, t = report.hand, report.measured_at
        if hand is not None and t >= self.since and not self._stopped:
            moved = tuple((k, pose) for k, pose in hand.things if has_moved(self._things.get(k), pose))
            self._things.update(moved)
            self.add(t, HandEntry(t, hand.opening, hand.holds, moved))

    def furnish(self, scene: Scene | None) -> None:
        """Write down what is around the real arm, where that's news."""
        if scene is not None and scene != self._scene:
            self._scene = scene
            self._things.clear()
            self.add(self.since, SceneEntry(scene))

    def _measure(self, t: float, q: Sequence[float], *messages: Message) -> None:
        """Take a sample; what was measured before the recording began is compared with nothing in it."""
        if t >= self.since and len(self._samples) < _SAMPLES:
            self._samples.append((t, q, messages))

    @override
    def failed(self, error: Exception) -> None:
        self.stop(str(error) or type(error).__name__)

    def tell(self, t: float, kind: str, text: str) -> None:
        """Write down an event of a kind at a time [s]."""
        if not self._stopped:
            self.add(t, RunEvent(t, kind, fields.text(text)))

    @property
    def problem(self) -> str | None:
        """Why it doesn't record; None while it does."""
        return self._stopped or (None if self.recorder is None else self.recorder.problem)

    def stop(self, why: str) -> None:
        """Record nothing more, for a reason."""
        self._stopped = f"recording failed: {why}"
        self.leave()
        self._look()

    def _look(self) -> None:
        """Tell of a problem that's new."""
        problem = self.problem
        if problem and not self._told and self._what.failed is not None:
            self._what.failed(problem)
        self._told = problem is not None

    def finish(self, *, now: float) -> None:
        """Write down the rest, and close the file, which takes a moment."""
        self.end(now=now)
        self.close()

    def end(self, *, now: float) -> None:
        """Take the last notes."""
        receipts: tuple[Receipt, ...] = ()
        if not self._stopped:
            self.advance(now=now, connected=self._connected)
            # Those of a mobile robot stand with its commands, and nothing changes them.
            receipts = self.engine.receipts if self._drives is None else ()
            late = self._begin.late
            if late is not None:
                receipts = tuple(one for one in receipts if one.command_id > late.newest)
        self.leave()
        self._rest = End(now), receipts

    def close(self) -> None:
        """Write the last notes down, and close the file; from any thread, after `end`."""
        recorder = self.recorder
        assert self._rest is not None
        end, receipts = self._rest
        if recorder is None:
            return
        if self._stopped:
            # What happened since isn't there: the file isn't whole.
            recorder.close(None)
        else:
            self.receipts(end.t, "virtual", receipts)
            self.whole(end.t)
            recorder.close(end, last=[message for _, message in self.taken()])
        self._look()

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        recorder = self.recorder
        return {
            "file": str(self.path),
            "written_s": self._begin.t if recorder is None else recorder.written,
            "dropped": 0 if recorder is None else sum(recorder.dropped.values()),
            "problem": self.problem,
        }

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return 0 if self.recorder is None else self.recorder.size
