"""A person at a monitor, in virtual time: an arm on an engine of its own, lines in, a transcript out."""

from __future__ import annotations

import math
import re
from pathlib import Path

from interfaces.val2.controller import Controller
from interfaces.val2.monitor.control import Control, SharedController
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.motion import arm_for
from robots import puma560
from vrs.clock import ManualClock
from vrs.engine import Engine

MODEL = puma560.model()
LONGEST = 120.0
"""Longest that anything may take here [s]."""
HELLO = ("EDIT hello", 'TYPE "hello"', "E")
LOOP = ("EDIT loop", "WHILE TRUE DO", "DELAY 0.1", "END", "E")
ASK = ("EDIT ask", 'PROMPT "n? ", n', 'TYPE "n is", n', "E")
"""Programs, as they are typed."""
AWAY = "DO MOVE TRANS(400,0,200,90,0,0)"


def numbers(shown: str) -> list[float]:
    """The decimal fractions in what was shown."""
    return [float(text) for text in re.findall(r"-?\d+\.\d+", shown)]


class Sitting:
    """One or more terminals at a controller."""

    def __init__(self, directory: Path, *, control: Control | None = None, queues_commands: bool = False) -> None:
        self.engine = Engine(MODEL, q=MODEL.poses["ready"], clock=ManualClock(0.0))
        parameters: dict[str, float] = {}
        self.arm = arm_for(self.engine, parameters=parameters)
        self.controller = Controller(self.arm, parameters=parameters)
        self.shared = SharedController(self.controller, Control() if control is None else control)
        self.files = Files(directory)
        self.now = 0.0
        self.monitor = self.terminal(queues_commands=queues_commands)
        self.shown = ""

    def terminal(self, *, queues_commands: bool = False) -> TerminalMonitor:
        """One more terminal."""
        monitor = TerminalMonitor(self.shared, self.files, "vrs-teleop 0: a test", queues_commands=queues_commands)
        monitor.start(now=self.now)
        monitor.output()
        return monitor

    def type(self, *lines: str) -> str:
        """Type lines, each when the prompt is there; what was shown since."""
        self.shown = ""
        for line in lines:
            self.line(line)
            self.until(lambda: bool(self.monitor.prompt))
        return self.shown

    def line(self, text: str) -> str:
        """Type a line, whatever is there; what was shown at once."""
        before = len(self.shown)
        self.monitor.line(text, now=self.now)
        self._show()
        return self.shown[before:]

    def until(self, there, longest: float = LONGEST) -> None:
        """Let time pass until something is so."""
        end = self.now + longest
        while not there():
            assert self.now < end, f"not within {longest} s: {self.shown}"
            self.pass_time(0.05)

    def pass_time(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        for _ in range(1_000_000):
            deadline = self.monitor.next_deadline()
            self.now = min(end, max(deadline, self.now + 1e-3)) if math.isfinite(deadline) else end
            self.monitor.advance(now=self.now)
            self._show()
            if self.now >= end:
                return

    def finish(self) -> str:
        """Let a program run to its end; what was shown."""
        self.shown = ""
        self.until(lambda: not (self.controller.running or self.controller.doing))
        return self.shown

    def joints(self) -> tuple[float, ...]:
        """Where the arm is, in VAL's joints [deg]."""
        return self.arm.here(now=self.now).joints.joints

    def _show(self) -> None:
        self.shown += "".join(piece.text for piece in self.monitor.output())
