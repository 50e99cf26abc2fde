"""VAL's monitor at a server's own robot: a client of the server like any other, with terminals over TCP."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from interfaces.stream.control import Role
from interfaces.val2.control import LeaseControl
from interfaces.val2.controller import Controller
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import Monitor
from interfaces.val2.monitor.switchboard import Switchboard
from interfaces.val2.tcp import ValDoor

if TYPE_CHECKING:
    from interfaces.stream.access import Access
    from interfaces.stream.connect import Connection
    from interfaces.val2.motion import Arm

HOST: Final = "127.0.0.1"
"""Terminals come from this machine only: there's no encryption."""


class ServedVal:
    """Terminals at a server's robot. Enter `listening` in the server's loop, once it serves."""

    def __init__(self, url: str, token: str | None, access: Access, directory: Path, version: str) -> None:
        """Connect to nothing yet.

        Args:
            url: Of the server, `ws://HOST:PORT/ws`.
            token: By which this is an operator there.
            access: What a terminal's token opens; without any tokens, whoever comes is an operator.
            directory: Of LOAD and STORE.
            version: Name and version of the program.
        """
        self._url, self._token, self._access = url, token, access
        self._files, self._version = Files(directory), version
        self._board: Switchboard | None = None

    @contextlib.asynccontextmanager
    async def listening(self, listening: socket.socket) -> AsyncIterator[ServedVal]:
        """Serve terminals meanwhile.

        Args:
            listening: On this machine's loopback address; it's closed in the end.

        Raises:
            UnreachableError: If the server can't be reached.
        """
        connection, arm = await asyncio.to_thread(self._connect)
        try:
            controller = Controller(arm, parameters=arm.parameters, now=connection.now())
            self._board = Switchboard(controller, LeaseControl(connection))
            door = ValDoor(self._board, connection, self._terminal, locked=self._access.needs_tokens)
            async with door.listening(listening):
                yield self
        finally:
            await asyncio.to_thread(connection.close)

    def _connect(self) -> tuple[Connection, Arm]:
        from interfaces import connect
        from interfaces.val2.motion import arm_for

        connection = connect(self._url, token=self._token, name="VAL-II terminals")
        return connection, arm_for(connection)

    def _terminal(self, token: str) -> Monitor | None:
        """The monitor for whoever shows a token; None for a wrong one."""
        assert self._board is not None
        shown = token if self._access.needs_tokens else None
        barred = "this token only looks" if self._access.refusal(Role.OPERATOR, shown) else ""
        if barred and self._access.refusal(Role.VIEWER, shown):
            return None
        return Monitor(self._board, self._files, f"{self._version}, VAL-II", barred=barred)
