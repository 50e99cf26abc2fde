"""A robot that a server serves, by `interfaces.connect`."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from typing_extensions import override

from interfaces.clients.designer import Issued
from interfaces.messages.control import State, Welcome
from interfaces.val2.motion.robot import OtherTwin, RobotPort
from vrs.commands import Command, Grip, MotionCommand
from vrs.errors import InvalidValueError, UnknownCommandError
from vrs.ledger import Receipt
from vrs.model import RobotModel
from vrs.timeline import Timeline

if TYPE_CHECKING:
    from interfaces.stream.connection import Connection
    from robots.robot import Robot

_PATIENCE: Final = 2.0
"""How long an answer waits for the edit that it speaks of to come, too [s]: a motion's from its end on."""
_FETCHED: Final = 10.0
"""How long the timeline may take to come at first [s]."""
_SAME: Final = 1e-6
"""Times [s] and joints [rad] nearer than this are one."""


class RemoteRobot(RobotPort):
    """An engine at the other end of a connection. Nothing waits: what was asked for is answered later."""

    fault_poll_interval = 0.05
    has_fingers = True

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
        self.newest = 0
        self._open: int | None = None
        """The newest that has no answer yet."""
        self._outdated: State | None = None
        """What was heard of the real robot when that was answered: an answer is newer."""
        if not self._viewer.wait(lambda viewer: viewer.timeline is not None, _FETCHED):
            self._viewer.close()
            raise InvalidValueError("timeline", None, f"sent by the server within {_FETCHED:g} s")
        self._timeline = self.timeline

    @property
    @override
    def model(self) -> RobotModel:
        return self._model

    @property
    @override
    def timeline(self) -> Timeline:
        timeline = self._viewer.timeline
        # While it's fetched anew there's none.
        if timeline is not None:
            self._timeline = timeline
        return self._timeline

    @override
    def ask(self, command: Command | None, *, now: float) -> int:
        before = self.timeline
        designer = self._connection.designer
        number = (designer.undo() if command is None else designer.issue(command)).number
        self._asked[number] = command, before
        self._open = self.newest = number
        return number

    @override
    def outcome(self, number: int, *, now: float) -> Issued | None:
        """What became of it, once the timeline shows it."""
        try:
            issued = self._connection.designer.issued(number)
        except UnknownCommandError:
            return Issued(number, None, now, now)
        if issued.answered_at is None:
            return None
        if number == self._open:
            self._open, self._outdated = None, self._connection.state
        if issued.reason or number not in self._asked:
            return issued
        command, before = self._asked[number]
        if not (self._shows(command, issued.receipt, before) or self.other.halted):
            end = None if issued.receipt is None else issued.receipt.end
            if now < max(issued.answered_at, end or -math.inf) + _PATIENCE:
                return None
            if isinstance(command, MotionCommand) and not self._leads_to(issued.receipt):
                issued = replace(
                    issued, receipt=None, refusal="the server took it, but doesn't show what the arm does"
                )
        del self._asked[number]
        return issued

    def _shows(self, command: Command | None, receipt: Receipt | None, before: Timeline) -> bool:
        timeline = self.timeline
        if isinstance(command, Grip):
            return True
        if timeline is not before:
            if not isinstance(command, MotionCommand) or receipt is None or not receipt.stands:
                return True
            return self._leads_to(receipt) and (receipt.end is None or timeline.end >= receipt.end - _SAME)
        return receipt is None or receipt.is_still

    def _leads_to(self, receipt: Receipt | None) -> bool:
        """Whether the timeline ends where a receipt says."""
        q = None if receipt is None else receipt.q
        return q is None or bool(np.abs(self.timeline.final() - q).max() <= _SAME)

    @property
    @override
    def other(self) -> OtherTwin:
        state = self._connection.state
        if state is None:
            return OtherTwin()
        halted = "" if state is self._outdated else state.halted
        return OtherTwin(state.q, halted, state.hand, state.play)

    @property
    @override
    def lost(self) -> bool:
        return not self._connection.is_connected

    def close(self) -> None:
        """Follow no more; the connection stays."""
        self._viewer.close()


def remote_robot(connection: Connection, robot: Robot) -> RemoteRobot:
    """The robot of a connection, with the limits that its server tells.

    Raises:
        InvalidValueError: If it isn't that robot, or its timeline doesn't come.
    """
    from robots import puma560

    welcome, model = connection.welcome, robot.arm
    if not isinstance(welcome, Welcome) or welcome.robot != model.name:
        raise InvalidValueError("robot", model.name, f"the server's, {welcome.robot}: --robot says which that is")
    if isinstance(model, puma560.Puma560):
        return RemoteRobot(connection, puma560.model(limits=welcome.limits))
    mine, its = (np.array([getattr(one, f.name) for f in fields(one)]) for one in (model.limits, welcome.limits))
    if mine.shape != its.shape or not np.allclose(mine, its, rtol=1e-6, atol=1e-9):
        raise InvalidValueError("robot", model.name, "of the server's limits: described here as it is there")
    return RemoteRobot(connection, model)
