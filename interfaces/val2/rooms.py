"""VAL's monitor at a server's own robot: one controller, and the terminals of pages and connections at it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from interfaces.messages.control import Role
from interfaces.stream.access import Access
from interfaces.stream.local import LocalClient
from interfaces.timer import Turning
from interfaces.val2.controller import Controller
from interfaces.val2.errors import ValError
from interfaces.val2.monitor.control import ServedControl, SharedController
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.motion import Arm, SiteRobot, conventions_of
from interfaces.val2.parser import parse_expression
from vrs.clock import Clock
from vrs.model import Array

if TYPE_CHECKING:
    from interfaces.teleop import OperatorSite
    from interfaces.teleop.virtual_arm import VirtualArm
    from robots.robot import Robot

HOST: Final = "127.0.0.1"
"""Terminals come from this machine only: there's no encryption."""
FAULT_POLL: Final = 0.05
"""How often it's looked whether the real robot has stopped by itself [s]."""


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

    async def ready(self) -> None:
        """Wait until lines can be read: the first time it takes a second to make the grammar's tables."""
        await asyncio.to_thread(parse_expression, "1")

    def monitor(
        self, access: Access, token: str | None, session: str | None = None, *, address: str
    ) -> tuple[TerminalMonitor, Callable[[], bool]] | None:
        """A monitor for whoever shows a token, and whether that counts still; None for a wrong one.

        Args:
            access: What tokens open.
            token: The token.
            session: By which they command from elsewhere, too.
            address: Where they come from.
        """
        admission, read_only = access.admit(Role.OPERATOR, token), ""
        if admission.refusal:
            admission, read_only = access.admit(Role.VIEWER, token), "this token only looks"
        if admission.refusal:
            if access.audit is not None:
                access.audit.refused(what="terminal", why=admission.refusal, address=address)
            return None
        monitor = TerminalMonitor(self._shared, self._files, self._version, read_only=read_only, session=session)
        return monitor, admission.counts

    def correct(self, channel: int, offset: Array, at: float, *, now: float) -> str:
        """Correct the path of the program that alters it on a channel; see `interfaces.stream.hub.PathAlterer`.

        Raises:
            ValError: If none does, or it can't be.
        """
        outcome = self._shared.correct(channel, offset, at, now=now)
        self.soon()
        if outcome is None or outcome.receipt is None or outcome.reason:
            raise ValError("Path can't be altered so", "" if outcome is None else outcome.reason)
        return outcome.receipt.hindrance

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


def served_room(
    client: LocalClient, site: OperatorSite[VirtualArm], robot: Robot, directory: Path, version: str
) -> TerminalRoom:
    """The room at a server's robot, which a client of the server in its own process moves.

    Args:
        client: The client.
        site: Where the robot is.
        robot: Which that is.
        directory: Of LOAD and STORE.
        version: Name and version of the program.
    """
    port = SiteRobot(
        site, lambda command, _now: client.execute(command), fault_poll_interval=FAULT_POLL, has_fingers=True
    )
    arm = Arm(port, conventions=conventions_of(robot))
    controller = Controller(arm, parameters=arm.parameters, now=client.now())
    shared = SharedController(controller, ServedControl(client))
    return TerminalRoom(shared, client, Files(directory, examples=examples()), f"{version}, VAL-II")


def examples() -> Path | None:
    """The programs that come with the sources; None where they aren't there."""
    found = Path(__file__).resolve().parents[2] / "examples" / "val2"
    return found if found.is_dir() else None
