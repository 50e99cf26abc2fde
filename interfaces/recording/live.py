"""A live operator's site, recorded while it serves: nothing that moves waits for the disk."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from interfaces.recording.capture import Capture, Paced
from interfaces.recording.messages import Begin, End, EventEntry, RealSample
from interfaces.recording.poses import LINK_RATE, POSE_RATE, link_transforms, real_pose
from interfaces.recording.recorder import Recorder
from interfaces.runtime.happenings import correction_events
from interfaces.software import software
from interfaces.teleop import Correction, Deed, Report, RobotLine
from vrs.model import Array, RobotModel
from vrs.receipt import Receipt, Status
from vrs.timeline import Timeline

RATE = 60.0
"""Samples of the virtual robot a second."""
TURN = 0.1
"""Time between two turns [s]."""
_SAME = 1e-9
"""Times nearer than this [s] are one."""
_ASKED = 4096
"""Commands whose answers are waited for, at most."""
_REPORTS = 256
"""Reports that wait for the next turn, at most."""


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


class _LiveCapture(Capture):
    """A capture that knows the real robot by its reports."""

    def __init__(self, line: RobotLine, model: RobotModel) -> None:
        super().__init__(line.operator, model, now=0.0, step=1.0 / RATE, every=False)
        self._asked: OrderedDict[int, float] = OrderedDict()
        self._reports: list[Report] = []
        self._measured = -np.inf
        self._halted = self._followed = False

    def commanded(self, deed: Deed) -> None:
        super().commanded(deed)
        receipt = deed.receipt
        if receipt is not None and receipt.status is not Status.REJECTED and receipt.execute_at is not None:
            self._asked[receipt.command_id] = receipt.execute_at
            if len(self._asked) > _ASKED:
                self._asked.popitem(last=False)

    def corrected(self, correction: Correction, truth: Timeline) -> None:
        super().corrected(correction, truth)
        for event in correction_events([correction]):
            self.tell(event.t, event.kind, event.text)

    def answered(self, command_id: int, receipt: Receipt, *, now: float) -> None:
        super().answered(command_id, receipt, now=now)
        asked = self._asked.pop(command_id, None)
        if receipt.status is Status.REJECTED or receipt.execute_at is None:
            self.tell(now, "diverged", f"the real robot rejected command {command_id}: {receipt.reason}")
        elif asked is not None and receipt.execute_at > asked + _SAME:
            late = f"executed at {receipt.execute_at:.3f} s instead of {asked:.3f} s"
            self.tell(now, "late", f"command {command_id} was late at the real robot: {late}")

    def reported(self, report: Report, *, now: float) -> None:
        halted = bool(report.halted)
        if halted and not self._halted and self._followed:
            self.tell(now, "halted", f"the real robot stopped: {report.halted}")
        elif not halted and (self._halted or not self._followed):
            self.tell(now, "followed", "the real robot follows the operator")
        self._halted, self._followed = halted, self._followed or not halted
        if report.measured_at > self._measured and len(self._reports) < _REPORTS:
            self._measured = report.measured_at
            self._reports.append(report)

    def tell(self, t: float, kind: str, text: str) -> None:
        """Write down an event."""
        self.add(t, EventEntry(t, kind, text))

    def show_links(self, robot: str, paced: Paced, t: Array, q: Array) -> None:
        """Let the links of a robot, `virtual` or `real`, be shown; see `show`."""
        self.show(paced, t, q, self.model.links, lambda now, X: link_transforms(now, ((robot, X[1:]),)))

    def reports(self) -> list[Report]:
        """Those that came since the last time."""
        reports, self._reports = self._reports, []
        return reports


class LiveRecorder:
    """Records an operator's site. `advance` takes its turns; a thread of the recorder's does the writing."""

    def __init__(
        self,
        what: LiveRecording,
        line: RobotLine,
        model: RobotModel,
        q: Array,
        *,
        seed: int,
        began: float,
    ) -> None:
        """Begin the file.

        Args:
            what: What is recorded, and where to.
            line: From the operator's site to the robot; nothing was commanded yet.
            model: The robot.
            q: Joints of the virtual robot at first [rad], (n,).
            seed: Of the emulated link.
            began: Seconds since 1970 at session time 0.

        Raises:
            RecordingError: If the file can't be made.
        """
        link = line.link.conditions.forward
        begin = Begin(
            t=0.0,
            robot=model.name,
            driver="live",
            title=f"live {model.name}",
            seed=seed,
            delay=link.delay.name,
            offset=what.offset,
            service=str(link.service),
            link_loss=what.link_loss,
            step=1.0 / RATE,
            q=np.asarray(q, float).tolist(),
            lateness=str(line.operator.engine.parameters["lateness"]),
            software=software(),
            began=began,
        )
        self.path, self._line, self._failed = what.path, line, what.failed
        self._recorder = Recorder(what.path, begin)
        self._capture = _LiveCapture(line, model)
        self._capture.put = self._recorder.put
        self._real, self._real_links = Paced(POSE_RATE), Paced(LINK_RATE)
        self._connected = self._told = False
        self._stopped = ""

    def advance(self, *, now: float, connected: bool) -> None:
        """Write down what is due at a time [s].

        Args:
            now: Session time [s].
            connected: Whether the robot is heard of.
        """
        capture = self._capture
        self._look()
        if connected is not self._connected:
            self._connected = connected
            text = "the real robot is heard of" if connected else "the real robot isn't heard of any more"
            capture.tell(now, "up" if connected else "down", text)
        link = self._line.link
        capture.link("forward", link.forward.log.take())
        capture.link("backward", link.backward.log.take())
        capture.show_links("virtual", capture.links, *capture.advance(now=now))
        self._tell_reports(capture)
        capture.write_out()

    def _tell_reports(self, capture: _LiveCapture) -> None:
        reports = capture.reports()
        if not reports:
            return
        t = np.array([report.measured_at for report in reports])
        q = np.array([report.q for report in reports])
        for now, joints, report in zip(t.tolist(), q.tolist(), reports, strict=True):
            capture.add(now, RealSample(now, report.q_at, joints))
        capture.show(self._real, t, q, capture.model.forward, real_pose)
        capture.show_links("real", self._real_links, t, q)

    @property
    def problem(self) -> str | None:
        """Why it doesn't record; None while it does."""
        return self._stopped or self._recorder.problem

    def stop(self, why: str) -> None:
        """Record nothing more, for a reason."""
        self._stopped = f"recording failed: {why}"
        self._capture.operator.listener = self._capture.put = None
        self._look()

    def _look(self) -> None:
        """Tell of a problem that's new."""
        problem = self.problem
        if problem and not self._told and self._failed is not None:
            self._failed(problem)
        self._told = problem is not None

    def finish(self, *, now: float) -> None:
        """Write down the rest, and close the file, which takes a moment."""
        capture = self._capture
        if self._stopped:
            self._recorder.close(End(now))
            return
        self.advance(now=now, connected=self._connected)
        engine = capture.operator.engine
        capture.receipts(now, "virtual", engine.receipts)
        capture.whole(now)
        capture.write_out()
        capture.operator.listener = capture.put = None
        self._recorder.close(End(now))
        self._look()

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        recorder = self._recorder
        return {
            "file": str(self.path),
            "written_s": recorder.written,
            "dropped": sum(recorder.dropped.values()),
            "problem": self.problem,
        }
