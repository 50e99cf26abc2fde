"""The Supervisor: a Designer and an Observer of one engine.

Source: Doulgeri, Zikos, Delopoulos, section III.
"""

from __future__ import annotations

from interfaces.clients.designer import Designer, Issued
from interfaces.clients.observer import Observation, Observer
from interfaces.clients.ports import RemotePort, port_to
from interfaces.engine_server.site import earliest
from interfaces.messages import Reply
from vrs.commands import Command
from vrs.engine import Engine


class Supervisor:
    """Specifies the trajectory, and collects feedback."""

    def __init__(self, engine: RemotePort | Engine, *, resend: float = 0.3) -> None:
        """Reach an engine by one port; see `Designer` and `Observer`."""
        port, self._own = port_to(engine)
        self.designer = Designer(port, resend=resend)
        self.observer = Observer(port, resend=resend)

    def issue(self, command: Command, *, now: float, execute_in: float | None = None) -> Issued:
        """Issue a command; see `Designer.issue`."""
        return self.designer.issue(command, now=now, execute_in=execute_in)

    def undo(self, *, now: float) -> Issued:
        """Take back the newest accepted command; see `Designer.undo`."""
        return self.designer.undo(now=now)

    def ask(self, t: float | None = None, *, now: float) -> int:
        """Ask for the position; see `Observer.ask`."""
        return self.observer.ask(t, now=now)

    def observation(self, number: int) -> Observation | None:
        """The answer to a question; see `Observer.observation`."""
        return self.observer.observation(number)

    def receive(self, message: Reply, *, now: float) -> None:
        """Take a reply; those that come by the port have been taken already, and count once."""
        self.designer.receive(message, now=now)
        self.observer.receive(message, now=now)

    def advance(self, *, now: float) -> tuple[Issued | Observation, ...]:
        """Do what is due; what was heard of commands, then the answers."""
        if self._own is not None:
            self._own.advance(now=now)
        return (*self.designer.advance(now=now), *self.observer.advance(now=now))

    def next_deadline(self) -> float | None:
        """When something is to be done [s]; None for nothing."""
        own = None if self._own is None else self._own.next_deadline()
        return earliest(self.designer.next_deadline(), self.observer.next_deadline(), own)
