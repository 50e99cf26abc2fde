"""VAL's monitor at a server's own robot: one controller, and the terminals of pages and connections that are at it.

The controller is a client of the server like any other, made for the first terminal.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from interfaces.messages.control import Role
from interfaces.stream.access import Access
from interfaces.timer import Turning
from interfaces.val2.controller import Controller
from interfaces.val2.monitor.control import LeaseControl, SharedController, SharedOperator
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.parser import parse_expression
from vrs.clock import Clock
from vrs.errors import VrsError

if TYPE_CHECKING:
    from interfaces.stream.connection import Connection
    from interfaces.val2.motion import Arm

HOST: Final = "127.0.0.1"
"""Terminals come from this machine only: there's no encryption."""


class RoomTerminal(Protocol):
    """A terminal in a room."""

    def advance(self, *, now: float) -> None:
        """Do what is due."""

    def next_deadline(self) -> float:
        """When something is due [s]; infinity for not before something comes."""

    def leave(self, *, now: float) -> None:
        """It's gone: what it ran is stopped."""


class TerminalRoom:
    """Terminals at one controller, which are moved on together."""

    def __init__(self, shared: SharedController, clock: Clock, files: Files, version: str) -> None:
        """Begin with nobody.

        Args:
            shared: What all terminals are at.
            clock: Session time.
            files: What LOAD and STORE reach.
            version: Name and version of the program.
        """
        self.clock = clock
        self._shared, self._files, self._version = shared, files, version
        self._terminals: set[RoomTerminal] = set()
        self._turning = Turning(clock, self._turn)

    def monitor(
        self, access: Access, token: str | None, person: SharedOperator | None = None
    ) -> TerminalMonitor | None:
        """A monitor for whoever shows a token; None for a wrong one.

        Args:
            access: What tokens open.
            token: The token.
            person: Who it is, where they command by a session of their own, too.
        """
        read_only = "this token only looks" if access.refusal(Role.OPERATOR, token) else ""
        if read_only and access.refusal(Role.VIEWER, token):
            return None
        return TerminalMonitor(self._shared, self._files, self._version, read_only=read_only, person=person)

    def join(self, terminal: RoomTerminal) -> None:
        """Move a terminal on from now."""
        self._terminals.add(terminal)
        self._turning.start()

    def leave(self, terminal: RoomTerminal) -> None:
        """A terminal is gone."""
        terminal.leave(now=self.clock.now())
        self._terminals.discard(terminal)
        if not self._terminals:
            self._turning.stop()

    def soon(self) -> None:
        """Something has come."""
        self._turning.soon()

    def _turn(self, now: float) -> float:
        self._shared.advance(now=now)
        for terminal in tuple(self._terminals):
            terminal.advance(now=now)
        return min([self._shared.next_deadline(), *(terminal.next_deadline() for terminal in self._terminals)])


class ServedVal:
    """The room at a server's robot, made for the first terminal. Enter `running` in the server's loop."""

    def __init__(self, url: str, token: str | None, directory: Path, version: str) -> None:
        """Connect to nothing yet.

        Args:
            url: Of the server, `ws://HOST:PORT/ws`.
            token: By which this is an operator there.
            directory: Of LOAD and STORE.
            version: Name and version of the program.
        """
        self._url, self._token = url, token
        self._files, self._version = Files(directory, examples=examples()), f"{version}, VAL-II"
        self._entering: asyncio.Task[TerminalRoom] | None = None
        self._connection: Connection | None = None

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[ServedVal]:
        """Let terminals come meanwhile."""
        try:
            yield self
        finally:
            if self._entering is not None:
                await asyncio.wait([self._entering])
            if self._connection is not None:
                await asyncio.to_thread(self._connection.close)

    async def enter(self) -> TerminalRoom:
        """What all terminals are at.

        Raises:
            VrsError: If the server can't be reached; the next one who comes tries anew.
        """
        if self._entering is None:
            self._entering = asyncio.create_task(self._made())
        entering = self._entering
        try:
            return await asyncio.shield(entering)
        except (VrsError, OSError):
            self._entering = None if self._entering is entering else self._entering
            raise

    async def _made(self) -> TerminalRoom:
        connection, arm = await asyncio.to_thread(self._connect)
        self._connection = connection
        controller = Controller(arm, parameters=arm.parameters, now=connection.now())
        shared = SharedController(controller, LeaseControl(connection))
        return TerminalRoom(shared, connection, self._files, self._version)

    def _connect(self) -> tuple[Connection, Arm]:
        from interfaces import connect
        from interfaces.val2.motion import arm_for

        parse_expression("1")  # Makes the grammar's tables, which takes a second, beside the loop.
        connection = connect(self._url, token=self._token, name="VAL-II terminals")
        try:
            return connection, arm_for(connection)
        except BaseException:
            connection.close()
            raise


def examples() -> Path | None:
    """The programs that come with the sources; None where they aren't there."""
    found = Path(__file__).resolve().parents[2] / "examples" / "val2"
    return found if found.is_dir() else None
