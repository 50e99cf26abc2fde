"""A page, and a terminal of the person before it, at one hub in virtual time."""

from __future__ import annotations

from types import SimpleNamespace

from interfaces.clients.designer import Designer
from interfaces.clients.viewer import Viewer
from interfaces.messages import control
from interfaces.messages.control import Role
from interfaces.stream.client import Phase
from interfaces.val2.controller import Controller
from interfaces.val2.monitor.control import LeaseControl, SharedController
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.motion import Arm
from interfaces.val2.motion.remote import RemoteRobot
from tests.interfaces.stream.joined import STEP, Joined
from tests.interfaces.stream.served import MODEL


class Line:
    """A connection as `connect` makes it, in virtual time."""

    def __init__(self, joined: Joined) -> None:
        self.joined, self.core = joined, joined.client()
        self._designer = Designer(self.core.port)
        joined.parts[self.core].append(self._designer)
        self.designer = self
        self.state = SimpleNamespace(q=MODEL.poses["nominal"], connected=True, halted="")
        self.history = ()
        joined.run(0.5)

    @property
    def now(self):
        return self.joined.time(self.core)

    @property
    def lease(self):
        return self.core.lease

    @property
    def lapses(self):
        return self.core.lapses

    @property
    def is_connected(self):
        return self.core.phase is Phase.OPEN

    def issue(self, command):
        return self._designer.issue(command, now=self.now)

    def undo(self):
        return self._designer.undo(now=self.now)

    def issued(self, number):
        return self._designer.issued(number)

    def wish(self, make, **how):
        return self.core.wish(make, now=self.joined.now + self.joined.ahead[self.core], **how)

    def acquire(self, *, wait):
        self.wish(control.Acquire)

    def release(self, *, wait):
        self.wish(lambda number: control.Release(number, self.core.epoch), leased=True)

    def ask_to_share(self, session):
        return self.wish(lambda number: control.Share(number, session))

    def answer(self, number):
        return self.core.answer(number)

    def viewer(self, *, rate):
        peer = self.joined.client(role=Role.VIEWER)
        self.joined.run(0.2)
        viewer = Viewer(peer.port, rate=rate)
        self.joined.parts[peer].append(viewer)
        self.joined.run(0.3)
        return _Following(viewer)


class _Following:
    """A viewer whose server answers at once."""

    def __init__(self, viewer) -> None:
        self._of = viewer

    @property
    def timeline(self):
        return self._of.timeline

    def wait(self, ready, timeout):
        return ready(self)


class Pair:
    """A page that has the lease, and its terminal."""

    def __init__(self, directory) -> None:
        self.joined = Joined()
        self.page = Line(self.joined)
        self.val = Line(self.joined)
        arm = Arm(RemoteRobot(self.val, MODEL))
        self.controller = Controller(arm, parameters=arm.parameters, now=self.val.now)
        self.shared = SharedController(self.controller, LeaseControl(self.val))
        self.taken = 0
        self.monitor = TerminalMonitor(self.shared, Files(directory), "a test", person=self)
        self.monitor.start(now=self.val.now)
        self.said = ""

    @property
    def session(self):
        return self.page.core.welcome.session

    @property
    def holds(self):
        return self.page.core.epoch > 0

    def take(self):
        self.taken += 1
        self.page.acquire(wait=0.0)

    @property
    def engine(self):
        return self.joined.hub.site.engine

    def run(self, seconds):
        """Let time pass."""
        end = self.joined.now + seconds
        while self.joined.now < end - 1e-9:
            self.joined.turn()
            self.joined.now += STEP
            self.monitor.advance(now=self.val.now)
            self.said += "".join(piece.text for piece in self.monitor.output())

    def type(self, *lines):
        """Type lines, each when there's a prompt; what was said."""
        self.said = ""
        for line in lines:
            self.monitor.line(line, now=self.val.now)
            self.run(0.05)
            for _ in range(1000):
                if self.monitor.prompt:
                    break
                self.run(0.05)
        return self.said
