"""A page, and a terminal of the person before it, at one hub in virtual time."""

from __future__ import annotations

from interfaces.clients.designer import Designer
from interfaces.messages import control
from interfaces.messages.control import State
from interfaces.stream.local import LocalClient
from interfaces.val2.controller import Controller
from interfaces.val2.monitor.control import ServedControl, SharedController
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.motion import Arm, EngineRobot
from tests.interfaces.stream.joined import STEP, Joined
from tests.interfaces.stream.served import MODEL

FOLLOWS = State(
    number=1, t=0.0, q=MODEL.poses["nominal"], play=0.0, pace=1.0, D=0.0, following_error=0.0, connected=True,
    halted="",
)  # fmt: skip


class Page:
    """A page's connection, in virtual time."""

    def __init__(self, joined: Joined) -> None:
        self.joined, self.core = joined, joined.client()
        self._designer = Designer(self.core.port)
        joined.parts[self.core].append(self._designer)
        joined.run(0.5)

    @property
    def holds(self):
        return self.core.epoch > 0

    def issue(self, command):
        return self._designer.issue(command, now=self.joined.time(self.core))

    def undo(self):
        return self._designer.undo(now=self.joined.time(self.core))

    def issued(self, number):
        return self._designer.issued(number)

    def release(self):
        now = self.joined.now + self.joined.ahead[self.core]
        self.core.wish(lambda number: control.Release(number, self.core.epoch), now=now, leased=True)


class Clock:
    """Session time of what is joined."""

    def __init__(self, joined: Joined) -> None:
        self._joined = joined

    def now(self) -> float:
        return self._joined.now


class Pair:
    """A page, and its terminal in the server's process."""

    def __init__(self, directory) -> None:
        self.joined = Joined()
        self.joined.hub.show(FOLLOWS)
        self.page = Page(self.joined)
        self.val = LocalClient(self.joined.hub, Clock(self.joined), "VAL-II terminals", lambda: None)
        arm = Arm(EngineRobot(self.engine, lambda command, _now: self.val.execute(command)))
        self.controller = Controller(arm, parameters=arm.parameters, now=self.joined.now)
        self.shared = SharedController(self.controller, ServedControl(self.val))
        session = self.page.core.welcome.session
        self.monitor = TerminalMonitor(self.shared, Files(directory), "a test", session=session)
        self.monitor.start(now=self.joined.now)
        self.said = ""

    @property
    def holds(self):
        return self.page.holds

    @property
    def engine(self):
        return self.joined.hub.site.engine

    def run(self, seconds):
        """Let time pass."""
        end = self.joined.now + seconds
        while self.joined.now < end - 1e-9:
            self.joined.turn()
            self.joined.now += STEP
            self.monitor.advance(now=self.joined.now)
            self.said += "".join(piece.text for piece in self.monitor.output())

    def type(self, *lines):
        """Type lines, each when there's a prompt; what was said."""
        self.said = ""
        for line in lines:
            self.monitor.line(line, now=self.joined.now)
            self.run(0.05)
            for _ in range(1000):
                if self.monitor.prompt:
                    break
                self.run(0.05)
        return self.said
