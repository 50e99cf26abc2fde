"""VAL's monitor at a server's own robot: a client of the server like any other, with terminals."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from interfaces.messages.control import Role
from interfaces.val2.controller import Controller
from interfaces.val2.monitor.control import LeaseControl, SharedController, SharedOperator
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.pages import TerminalRoom
from interfaces.val2.parser import parse_expression
from interfaces.val2.tcp import TcpTerminalServer
from vrs.errors import VrsError

if TYPE_CHECKING:
    from interfaces.stream.access import Access
    from interfaces.stream.connection import Connection
    from interfaces.val2.motion import Arm

HOST: Final = "127.0.0.1"
"""Terminals come from this machine only: there's no encryption."""


class ServedVal:
    """A controller at a server's robot, made for the first terminal. Enter `running` in the server's loop."""

    def __init__(self, url: str, token: str | None, access: Access, directory: Path, version: str) -> None:
        """Connect to nothing yet.

        Args:
            url: Of the server, `ws://HOST:PORT/ws`.
            token: By which this is an operator there.
            access: What the token of a page's terminal opens; without any tokens, whoever comes is an operator.
            directory: Of LOAD and STORE.
            version: Name and version of the program.
        """
        self._url, self._token, self._access = url, token, access
        self._files, self._version = Files(directory, examples=examples()), version
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
        return TerminalRoom(shared, connection, partial(self._terminal, shared, self._access))

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

    @contextlib.asynccontextmanager
    async def listening(self, listening: socket.socket, access: Access) -> AsyncIterator[ServedVal]:
        """Serve terminals over TCP meanwhile; within `running`.

        Args:
            listening: On this machine's loopback address; it's closed in the end.
            access: What a terminal's token opens; there's no terminal without one.

        Raises:
            VrsError: If the server can't be reached.
        """
        room = await self.enter()

        def terminal(shown: str) -> TerminalMonitor | None:
            return self._terminal(room.shared, access, shown, None)

        async with TcpTerminalServer(room.shared, room.clock, terminal).listening(listening):
            yield self

    def _terminal(
        self, shared: SharedController, access: Access, token: str | None, person: SharedOperator | None
    ) -> TerminalMonitor | None:
        """The monitor for whoever shows a token; None for a wrong one."""
        read_only = "this token only looks" if access.refusal(Role.OPERATOR, token) else ""
        if read_only and access.refusal(Role.VIEWER, token):
            return None
        return TerminalMonitor(shared, self._files, f"{self._version}, VAL-II", read_only=read_only, person=person)


def examples() -> Path | None:
    """The programs that come with the sources; None where they aren't there."""
    found = Path(__file__).resolve().parents[2] / "examples" / "val2"
    return found if found.is_dir() else None
