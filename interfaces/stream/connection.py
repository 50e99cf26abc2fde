"""A robot that a server serves, for `interfaces.connect` and `interfaces.connect_mobile`."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Sequence
from functools import partial
from types import TracebackType
from typing import Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from interfaces.clients.designer import Issued
from interfaces.clients.viewer import ShownFrame, Viewer
from interfaces.link.clock_sync import ClockEstimate
from interfaces.messages import ViewForm, control
from interfaces.messages.control import (
    Corrected,
    DirectionConditions,
    Impair,
    Lease,
    MobileWelcome,
    Network,
    PathCorrection,
    Plan,
    Postures,
    Problem,
    ProblemCode,
    Role,
    Seen,
    State,
    Survey,
)
from interfaces.messages.fields import Epoch
from interfaces.messages.jobs import Doing, Forecast, JobList, ListCommand, RobotTask, TaskOrder, Tasks
from interfaces.stream.certificates import peer, server_url
from interfaces.stream.client import Ask, ClientCore, Phase, Replied
from interfaces.stream.client_socket import Line, UnreachableError
from interfaces.stream.codec import Welcomed
from interfaces.stream.remote import RemoteDesigner, RemoteObserver, RemoteSupervisor, RemoteViewer
from robots.onboard.journey import Goal
from vrs.clock import WallClock
from vrs.commands import DriveCommand, Stop
from vrs.errors import InvalidValueError

A = TypeVar("A", bound=Replied)

ELSE = Problem(ProblemCode.NOT_ALLOWED, "the server answered something else")
"""What stands for an answer of another kind than was asked for."""


class Connection:
    """A robot that a server serves: an arm, or a mobile robot that's driven, sent to goals, and does jobs.

    A context manager: at its end everything is closed. Lost connections are taken up again by themselves. Calls may
    come from any thread. What a robot of the other kind does is refused as the server answers it.
    """

    def __init__(
        self, url: str | Sequence[str], client: Callable[..., ClientCore], *, role: Role, timeout: float
    ) -> None:
        """Connect; see `interfaces.connect`.

        Args:
            url: See there.
            client: Makes a client of a role, which speaks for all that this is.
            role: What to do.
            timeout: How long to wait for the first answer [s].

        Raises:
            UnreachableError: If there's no answer, or the server refuses.
            InvalidValueError, FormatError: If the address is none, or plain off this machine; see `peer`.
        """
        given = (url,) if isinstance(url, str) else tuple(url)
        if not given:
            raise InvalidValueError("url", given, "at least one address")
        self._urls, self._client, self._timeout = tuple(map(server_url, given)), client, timeout
        for one in self._urls:
            peer(one)
        self._clock = WallClock()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="vrs-client", daemon=True)
        self._thread.start()
        self._sessions: list[Line] = []
        try:
            self._session = self._open(role)
        except UnreachableError:
            self._end_thread()
            raise
        self.designer = RemoteDesigner(self._session)
        """Issues commands; they need the lease."""
        self.observer = RemoteObserver(self._session)
        """Asks for positions."""
        self.supervisor = RemoteSupervisor(self.designer, self.observer)
        """Both."""

    def _open(self, role: Role) -> Line:
        self._sessions.append(Line(self._urls, self._client(role=role), self._clock, self._loop, self._timeout))
        return self._sessions[-1]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End all connections; a lease that is held is released."""
        if self._session.core.epoch:
            self.release(wait=1.0)
        for session in self._sessions:
            session.close()
        self._sessions.clear()
        self._end_thread()

    def _end_thread(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(timeout=5.0)
        self._loop.close()

    def _end(self, session: Line) -> None:
        session.close()
        if session in self._sessions:
            self._sessions.remove(session)

    def viewer(
        self,
        *,
        rate: float = 50.0,
        form: ViewForm = ViewForm.SEGMENTS,
        delay: float = 0.0,
        show: Callable[[ShownFrame], None] | None = None,
    ) -> RemoteViewer:
        """A viewer, on a connection of its own.

        Args:
            rate: Frames to show a second, 0.1 to 1000.
            form: What crosses.
            delay: How long compact frames may wait for others that go in the same message [s], 0 to 0.1.
            show: Is called with each frame, in another thread: to be quick.

        Raises:
            UnreachableError: If the connection doesn't come about.
            InvalidValueError: If rate is out of range.
        """
        session = self._open(Role.VIEWER)
        make = partial(Viewer, rate=rate, form=ViewForm(form), delay=delay)
        return RemoteViewer(session, make, partial(self._end, session), show)

    def acquire(self, *, wait: float = 5.0) -> Lease | Problem:
        """Ask for the lease; it's kept by itself until it's released.

        Args:
            wait: How long to wait for the answer [s].

        Returns:
            The lease, `yours` if it was given; or why not.
        """
        return self._ask(Lease, control.Acquire, wait)

    def take_over(self, *, wait: float = 5.0) -> Lease | Problem:
        """Take the lease from whoever has it: for an admin. Waits until the robot has stopped.

        Args:
            wait: How long to wait [s].

        Returns:
            The lease as it's then, `yours` if it was given; or why not.
        """
        answer = self._ask(Lease, control.TakeOver, wait)
        if isinstance(answer, Lease) and not answer.yours:
            self._session.wait(lambda: self._session.core.epoch > 0, wait)
            return self.lease or answer
        return answer

    def share(self, session: str, *, wait: float = 5.0) -> Lease | Problem:
        """Ask to command under the lease that another session of the same person has.

        Whoever has the lease keeps it; when it ends, so does the share. Another session's command ends it, too.

        Args:
            session: The holder's, from its `Welcome`.
            wait: How long to wait for the answer [s].

        Returns:
            The lease, `shared` if it is; or why not.
        """
        return self._ask(Lease, lambda number: control.Share(number, session), wait)

    def release(self, *, wait: float = 5.0) -> Lease | Problem:
        """Give the lease back, and the robot stops; or the share, without a stop."""
        return self._ask(Lease, lambda number: control.Release(number, self._epoch), wait, leased=True)

    def resume(self, *, wait: float = 5.0) -> Lease | Problem:
        """Let the robot go on after it stopped by itself."""
        return self._ask(Lease, lambda number: control.Resume(number, self._epoch), wait, leased=True)

    def survey(self, *, wait: float = 5.0) -> Network | Problem:
        """Ask how the emulated way to the robot is, and what was measured of it."""
        return self._ask(Network, Survey, wait)

    def impair(
        self, forward: DirectionConditions | None, backward: DirectionConditions | None, *, wait: float = 5.0
    ) -> Network | Problem:
        """Change the emulated way to the robot: for who has the lease.

        Args:
            forward: To the robot, from now on; None leaves it as it is.
            backward: Back.
            wait: How long to wait for the answer [s].

        Returns:
            The way as it is then; or why not.
        """
        return self._ask(Network, lambda number: Impair(number, self._epoch, forward, backward), wait, leased=True)

    def drive(self, v: float, w: float, *, wait: float = 0.0) -> Issued:
        """Drive for a moment; who doesn't say so again stops. It ends what the robot does by itself.

        Args:
            v: Linear speed [m/s].
            w: Angular speed [rad/s].
            wait: How long to wait for the answer [s].

        Returns:
            What is known of it; a `refusal` says why it isn't carried out.

        Raises:
            InvalidValueError: If the robot is an arm.
        """
        welcome = self.welcome
        if not isinstance(welcome, MobileWelcome):
            raise InvalidValueError("robot", welcome.robot, "a mobile robot: nothing else is driven")
        return self.designer.issue(DriveCommand(v, w, welcome.holds), wait=wait)

    def stop(self, *, wait: float = 0.0) -> Issued:
        """Stop both robots, and what a mobile one does by itself."""
        return self.designer.issue(Stop(), wait=wait)

    def correct(
        self, channel: int, offset: ArrayLike, *, at: float | None = None, wait: float = 1.0
    ) -> Corrected | Problem:
        """Correct the path that a program alters: VAL-II's ALTER, at the server's terminals or a client's console.

        At the server's it needs the lease, or a share of it.

        Args:
            channel: Of the program's ALTER.
            offset: Translation [m] and rotation vector [rad], (6,); see `PathCorrection`.
            at: For when it's meant [session time, s]; None: for when it comes.
            wait: How long to wait for the answer [s].

        Returns:
            That it's on the path, and what keeps the arm from following in time; or why it isn't.
        """

        def ask(number: int) -> PathCorrection:
            epoch = self._epoch if self._session.core.epoch else None
            return PathCorrection(number, channel, np.asarray(offset, float), epoch, at)

        return self._ask(Corrected, ask, wait)

    def take_corrections(self) -> list[PathCorrection]:
        """What others have asked of the path of a program here since this was called last; see `connect`."""
        with self._session.changed:
            taken = list(self._session.core.corrections)
            self._session.core.corrections.clear()
        return taken

    def answer_correction(self, answer: Corrected | Problem) -> None:
        """Tell who asked what came of one of them."""
        self._session.do(lambda _: self._session.core.correct(answer))

    def go(self, goal: Goal, *, wait: float = 5.0) -> Tasks | Problem:
        """Send the robot to a goal.

        Args:
            goal: Where to.
            wait: How long to wait for the answer, not for the robot [s].

        Returns:
            What it does then; or why not.
        """
        return self._order(RobotTask(go=goal), wait)

    def load(self, jobs: JobList, *, wait: float = 5.0) -> Tasks | Problem:
        """Put a list of jobs in the place of the one that's there; see `go`."""
        return self._order(RobotTask(jobs=jobs), wait)

    def do(self, command: ListCommand, *, wait: float = 5.0) -> Tasks | Problem:
        """Run, pause, resume or abort the list, or press the key; see `go`."""
        return self._order(RobotTask(do=command), wait)

    def dry_run(self, *, wait: float = 30.0) -> Forecast | Problem:
        """Ask how long the list is likely to take; the virtual robot alone tries it."""
        answer = self._order(RobotTask(do=ListCommand.DRY_RUN), wait)
        if isinstance(answer, Problem):
            return answer
        self.wait(lambda _: self.tasks is not None and self.tasks.forecast is not None, wait)
        tasks = self.tasks
        if tasks is None or tasks.forecast is None:
            return Problem(ProblemCode.STOPPING, f"no forecast within {wait:g} s")
        return tasks.forecast

    def finished(self, timeout: float) -> bool:
        """Wait until the robot does nothing by itself any more, or the time [s] is over; whether that's so."""
        return self.wait(lambda _: self.tasks is not None and self.tasks.doing is Doing.NOTHING, timeout)

    def _order(self, task: RobotTask, wait: float) -> Tasks | Problem:
        return self._ask(Tasks, lambda number: TaskOrder(number, task, self._epoch), wait, leased=True)

    @property
    def _epoch(self) -> Epoch:
        return Epoch(self._session.core.epoch)

    def ask(self, ask: Ask, *, leased: bool = False) -> int:
        """Ask something of the lease without waiting for the answer; the number of what was asked.

        Args:
            ask: Makes the message, of its number.
            leased: Whether only who has the lease may ask that.
        """
        core = self._session.core
        return self._session.do(lambda _: core.wish(ask, now=self._clock.now(), leased=leased))

    def _ask(self, kind: type[A], ask: Ask, wait: float, *, leased: bool = False) -> A | Problem:
        """What the server answers to a wish, of a kind, or why not; see `ClientCore.wish`."""
        core = self._session.core
        number = self.ask(ask, leased=leased)
        self._session.wait(lambda: core.answer(number) is not None, wait)
        missing = Problem(ProblemCode.STOPPING, f"no answer within {wait:g} s", number)
        return _expected(kind, core.answer(number) or missing)

    def now(self) -> float:
        """Session time [s]: that of all stamps and positions."""
        return self._session.now()

    @property
    def clock(self) -> ClockEstimate:
        """Session time less local time, and how sure that is [s]."""
        with self._session.changed:
            estimate = self._session.core.sync.estimate(self._clock.now())
        assert estimate is not None
        return estimate

    @property
    def lease(self) -> Lease | None:
        """The lease as it was last heard of."""
        return self._session.core.lease

    @property
    def lapses(self) -> int:
        """How often commands of this connection have ceased to count: a lease or a share has ended."""
        return self._session.core.lapses

    @property
    def is_connected(self) -> bool:
        """Whether there's a connection just now."""
        return self._session.core.phase is Phase.OPEN

    def wait(self, ready: Callable[[Self], bool], timeout: float = 5.0) -> bool:
        """Wait until something is so of this connection, or the time [s] is over; whether it is."""
        return self._session.wait(lambda: ready(self), timeout)

    @property
    def state(self) -> State | None:
        """The real arm as it was last heard of; None before that."""
        return self._session.core.newest.get(State)

    @property
    def postures(self) -> Postures | None:
        """Where both mobile robots are; None before that was told."""
        return self._session.core.newest.get(Postures)

    @property
    def tasks(self) -> Tasks | None:
        """What a mobile robot does by itself; None before that was told."""
        return self._session.core.newest.get(Tasks)

    @property
    def seen(self) -> Seen | None:
        """What it sees; None before that was told."""
        return self._session.core.newest.get(Seen)

    @property
    def plan(self) -> Plan | None:
        """The known map; None before that was told."""
        return self._session.core.newest.get(Plan)

    @property
    def welcome(self) -> Welcomed:
        """What the server said of itself and its robot."""
        welcome = self._session.core.welcome
        assert welcome is not None
        return welcome


def _expected(kind: type[A], answer: Replied) -> A | Problem:
    return answer if isinstance(answer, (kind, Problem)) else ELSE
