"""A robot that a server serves, by `interfaces.connect`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.val2.motion.engines import standing
from interfaces.val2.motion.robot import Fate
from vrs.commands import Command, MotionCommand
from vrs.errors import InvalidValueError, UnknownCommandError
from vrs.model import Array, RobotModel
from vrs.receipt import Receipt
from vrs.timeline import Timeline

if TYPE_CHECKING:
    from interfaces.stream.connect import Connection

_PATIENCE: Final = 2.0
"""How long an answer waits for the edit that it speaks of to come, too [s]."""
_FETCHED: Final = 10.0
"""How long the timeline may take to come at first [s]."""
_SAME: Final = 1e-6
"""Times [s] and joints [rad] nearer than this are one."""


class RemoteRobot:
    """An engine at the other end of a connection. Nothing waits: what was asked for is answered later."""

    def __init__(self, connection: Connection, model: RobotModel) -> None:
        """Follow a robot.

        Args:
            connection: It needs the lease for commands.
            model: The robot that's served.

        Raises:
            InvalidValueError: If its timeline doesn't come within 10 s.
        """
        self._connection, self._model = connection, model
        self._viewer = connection.viewer(rate=10.0)
        self._asked: dict[int, tuple[Command | None, Timeline]] = {}
        if not self._viewer.wait(lambda viewer: viewer.timeline is not None, _FETCHED):
            self._viewer.close()
            raise InvalidValueError("timeline", None, f"sent by the server within {_FETCHED:g} s")
        self._timeline = self._newest()

    @property
    def model(self) -> RobotModel:
        """Its kinematics and limits."""
        return self._model

    @property
    def timeline(self) -> Timeline:
        """The engine's, as far as it has come."""
        return self._newest()

    def _newest(self) -> Timeline:
        timeline = self._viewer.timeline
        # While it's fetched anew there's none.
        if timeline is not None:
            self._timeline = timeline
        return self._timeline

    def ask(self, command: Command | None, *, now: float) -> int:  # noqa: ARG002 - the connection has its clock
        """Send a command, or an undo."""
        before = self.timeline
        designer = self._connection.designer
        number = (designer.undo() if command is None else designer.issue(command)).number
        self._asked[number] = command, before
        return number

    def fate(self, number: int, *, now: float) -> Fate | None:
        """What became of it, once the timeline shows it."""
        try:
            issued = self._connection.designer.issued(number)
        except UnknownCommandError:
            return Fate()
        if issued.answered_at is None:
            return None
        fate = Fate(issued.receipt, issued.refusal)
        if fate.reason or number not in self._asked:
            return fate
        command, before = self._asked[number]
        if now - issued.answered_at < _PATIENCE and not self._shows(command, issued.receipt, before):
            return None
        del self._asked[number]
        return fate

    def _shows(self, command: Command | None, receipt: Receipt | None, before: Timeline) -> bool:
        timeline = self.timeline
        if timeline is not before:
            if not isinstance(command, MotionCommand) or receipt is None or receipt.q is None:
                return True
            there = bool(np.abs(timeline.final() - receipt.q).max() <= _SAME)
            return there and (receipt.end is None or timeline.end >= receipt.end - _SAME)
        return receipt is None or receipt.is_still

    def scheduled(self, *, now: float) -> tuple[Receipt, ...]:
        """Receipts of this client's commands that aren't over."""
        receipts = (issued.receipt for issued in self._connection.designer.history)
        return standing((receipt for receipt in receipts if receipt is not None), now)

    def real(self, *, now: float) -> Array | None:  # noqa: ARG002 - the newest state counts
        """Joints as the server heard of them last."""
        state = self._connection.state
        return None if state is None else state.q

    def close(self) -> None:
        """Follow no more; the connection stays."""
        self._viewer.close()


def remote_robot(connection: Connection) -> RemoteRobot:
    """The robot of a connection, with the limits that its server tells.

    Raises:
        InvalidValueError: If it isn't a PUMA 560, or its timeline doesn't come.
    """
    from robots import puma560

    welcome = connection.welcome
    model = puma560.model(limits=welcome.limits)
    if welcome.robot != model.name:
        raise InvalidValueError("robot", welcome.robot, f"{model.name}: VAL-II moves no other")
    return RemoteRobot(connection, model)
