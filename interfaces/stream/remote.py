"""Designer, Observer, Supervisor and Viewer of a robot elsewhere, for programs with threads: `now` is filled in."""

from __future__ import annotations

from collections.abc import Callable

from interfaces.clients.designer import Designer, Issued
from interfaces.clients.observer import Observation, Observer
from interfaces.clients.playhead import Mode
from interfaces.clients.ports import RemotePort
from interfaces.clients.viewer import ShownFrame, Viewer
from interfaces.messages import Scene
from interfaces.stream.client_socket import Line
from vrs.commands import Command
from vrs.timeline import Timeline


class RemoteDesigner:
    """A `Designer` under a lock. Commands that have no answer when a session is lost are refused as unknown."""

    def __init__(self, session: Line) -> None:
        self._session = session
        self._designer = Designer(session.port)
        session.add(self)

    def issue(self, command: Command, *, execute_in: float | None = None, wait: float = 0.0) -> Issued:
        """Issue a command.

        Args:
            command: See `Designer.issue`.
            execute_in: When to carry it out, counted from now [s], for a command without `execute_at`.
            wait: How long to wait for an answer [s].

        Returns:
            What is known of it then; it may still be pending.

        Raises:
            InvalidValueError: See `Designer.issue`.
        """
        made = self._session.do(lambda now: self._designer.issue(command, now=now, execute_in=execute_in))
        return self.answered(made.number, wait)

    def undo(self, *, wait: float = 0.0) -> Issued:
        """Take back the newest accepted command."""
        return self.answered(self._session.do(lambda now: self._designer.undo(now=now)).number, wait)

    def answered(self, number: int, wait: float) -> Issued:
        """A command, when its answer has come, or the time [s] is over.

        Raises:
            UnknownCommandError: If no command of that number is kept.
        """
        self._session.wait(lambda: not self._designer.issued(number).is_pending, wait)
        return self.issued(number)

    def issued(self, number: int) -> Issued:
        """What is known of a command; see `Designer.issued`."""
        return self._session.do(lambda _: self._designer.issued(number))

    @property
    def history(self) -> tuple[Issued, ...]:
        """The newest commands, oldest first."""
        return self._session.do(lambda _: self._designer.history)

    @property
    def pending(self) -> tuple[Issued, ...]:
        """The commands without an answer."""
        return self._session.do(lambda _: self._designer.pending)

    def advance(self, *, now: float) -> None:
        """Send again what has no answer."""
        self._designer.advance(now=now)

    def next_deadline(self) -> float | None:
        """When something is sent again [s]."""
        return self._designer.next_deadline()

    def renew(self) -> None:
        """Nothing: what was under way has been answered."""


class RemoteObserver:
    """An `Observer` under a lock."""

    def __init__(self, session: Line) -> None:
        self._session = session
        self._observer = Observer(session.port)
        session.add(self)

    def ask(self, t: float | None = None, *, wait: float = 5.0) -> Observation | None:
        """Ask for the position, and wait for the answer.

        Args:
            t: Time [s]; None for the engine's present.
            wait: How long to wait [s].

        Returns:
            The answer; None where none came in time.

        Raises:
            NonFiniteTimeError: If t is NaN or infinite.
        """
        number = self._session.do(lambda now: self._observer.ask(t, now=now))
        self._session.wait(lambda: self._observer.observation(number) is not None, wait)
        return self.observation(number)

    def observation(self, number: int) -> Observation | None:
        """The answer to a question, as far as it can be trusted now."""
        return self._session.do(lambda _: self._observer.observation(number))

    def advance(self, *, now: float) -> None:
        """Send again what has no answer."""
        self._observer.advance(now=now)

    def next_deadline(self) -> float | None:
        """When something is sent again [s]."""
        return self._observer.next_deadline()

    def renew(self) -> None:
        """Ask no more for what was asked before."""
        self._observer.close()
        self._observer = Observer(self._session.port)


class RemoteSupervisor:
    """A Designer and an Observer together."""

    def __init__(self, designer: RemoteDesigner, observer: RemoteObserver) -> None:
        self.designer, self.observer = designer, observer

    def issue(self, command: Command, *, execute_in: float | None = None, wait: float = 0.0) -> Issued:
        """Issue a command; see `RemoteDesigner.issue`."""
        return self.designer.issue(command, execute_in=execute_in, wait=wait)

    def undo(self, *, wait: float = 0.0) -> Issued:
        """Take back the newest accepted command."""
        return self.designer.undo(wait=wait)

    def ask(self, t: float | None = None, *, wait: float = 5.0) -> Observation | None:
        """Ask for the position; see `RemoteObserver.ask`."""
        return self.observer.ask(t, wait=wait)


class RemoteViewer:
    """A `Viewer` under a lock, on a connection of its own, shown at its rate by the connection's thread."""

    def __init__(
        self,
        session: Line,
        make: Callable[[RemotePort], Viewer],
        end: Callable[[], None],
        show: Callable[[ShownFrame], None] | None = None,
    ) -> None:
        """Follow.

        Args:
            session: Its connection.
            make: Makes the viewer of a port, in the beginning and for each further session.
            end: Closes the connection.
            show: Is called with each frame, in the connection's thread and under its lock: to be quick.
        """
        self._session, self._make, self._end, self._show = session, make, end, show
        self._viewer = make(session.port)
        session.add(self)

    @property
    def newest(self) -> ShownFrame | None:
        """The frame that was shown last."""
        return self._session.do(lambda _: self._viewer.shown(self._viewer.number))

    @property
    def history(self) -> tuple[ShownFrame, ...]:
        """The newest 4096 frames that were shown, oldest first."""
        return self._session.do(lambda _: self._viewer.history)

    @property
    def timeline(self) -> Timeline | None:
        """The timeline as far as it has come; None before that, and in the forms of frames."""
        return self._session.do(lambda _: self._viewer.timeline)

    @property
    def scene(self) -> Scene | None:
        """What there is to see; None before it's known."""
        return self._session.do(lambda _: self._viewer.scene)

    @property
    def mode(self) -> Mode:
        """What the play head does."""
        return self._session.do(lambda _: self._viewer.mode)

    def wait(self, ready: Callable[[Viewer], bool], timeout: float = 5.0) -> bool:
        """Wait until something is so of the viewer, or the time [s] is over; whether it is."""
        return self._session.wait(lambda: ready(self._viewer), timeout)

    def next(self, timeout: float = 5.0) -> ShownFrame | None:
        """The next frame that is shown; None where none is in time [s]."""
        number = self._session.do(lambda _: self._viewer.number)
        self._session.wait(lambda: self._viewer.number > number, timeout)
        shown = self.newest
        return shown if shown is not None and shown.number > number else None

    def play(self, rate: float | None = None) -> None:
        """Run from here at a rate, −10 to 10 but not 0, negative to rewind."""
        self._session.do(lambda now: self._viewer.play(now=now, rate=rate))

    def pause(self) -> None:
        """Stand."""
        self._session.do(lambda now: self._viewer.pause(now=now))

    def rewind(self, rate: float = 1.0) -> None:
        """Run backwards at a rate above 0, 10 at most."""
        self._session.do(lambda now: self._viewer.rewind(now=now, rate=rate))

    def step(self, frames: float = 1.0) -> None:
        """Stand so many of its own frames further on, or back where that's negative."""
        self._session.do(lambda now: self._viewer.step(frames, now=now))

    def seek(self, t: float) -> None:
        """Go to a time [s] at once."""
        self._session.do(lambda now: self._viewer.seek(t, now=now))

    def set_loop(self, start: float, end: float) -> None:
        """Loop a range [s]."""
        self._session.do(lambda now: self._viewer.set_loop(start, end, now=now))

    def clear_loop(self) -> None:
        """Loop no more."""
        self._session.do(lambda now: self._viewer.clear_loop(now=now))

    def go_live(self) -> float:
        """Catch up with the newest there is; when it will be there [s]."""
        return self._session.do(lambda now: self._viewer.go_live(now=now))

    def advance(self, *, now: float) -> None:
        """Show the frame that is due."""
        for shown in self._viewer.advance(now=now):
            if self._show is not None:
                self._show(shown)

    def next_deadline(self) -> float | None:
        """When the next frame is due [s]."""
        return self._viewer.next_deadline()

    def close(self) -> None:
        """End its connection."""
        self._end()

    def renew(self) -> None:
        """Follow anew, live."""
        self._viewer.close()
        self._viewer = self._make(self._session.port)
