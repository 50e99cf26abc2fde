"""Schemes without a simulacrum: packets of one size, and inputs that are repeated; nobody acknowledges anything.

A packet down has all that RSP's largest could have, whether it's needed or not; the repeated inputs are as small as
they can be. The robot's end plays motion by the same filter and watchdog as RSP's.
"""

from __future__ import annotations

import struct
from collections import deque
from typing import Final

from typing_extensions import override

from interfaces.rsp.model.elements import Effector
from interfaces.rsp.model.robot_model import RobotModel
from interfaces.rsp.motion_filter import MotionFilter, MotionFilterConfig
from interfaces.rsp.schemes.ends import LocalEnd, ReportedPosition, Rims, RobotEnd
from interfaces.rsp.session import SLACK

_HEAD: Final = struct.Struct("!IIB")
"""Number of the newest input, its stamp [ms], how many inputs follow."""
_INPUT: Final = struct.Struct("!hhi")
"""Left and right rim [mm/s], number of the command or −1."""
_UP: Final = struct.Struct("!Iddd")
"""Number, x, y, θ."""
FIXED_DOWN: Final = 1992
"""Size of a packet of one size to the robot [byte]: the paper's largest."""
FIXED_UP: Final = 96
"""And from it [byte]: all of CUBO's sensors."""


class PlainLocal(LocalEnd):
    """The local system's end."""

    def __init__(self, period: float, repeat: int, size: int) -> None:
        """Begin at time 0.

        Args:
            period: T [s].
            repeat: Inputs in a packet, 1 to 255: each is sent as often.
            size: Of every packet [byte]; 0 for as small as it can be.
        """
        self.seen: ReportedPosition | None = None
        self._T, self._size = period, size
        self._recent: deque[bytes] = deque(maxlen=repeat)
        self._rims: Rims = (0, 0)
        self._fires: deque[int] = deque()
        self._number = self._count = 0
        self._next = 0.0
        self._newest = -1

    @override
    def write(self, rims: Rims, *, now: float) -> None:
        self._rims = rims

    @override
    def fire(self, *, now: float) -> None:
        self._fires.append(self._count)
        self._count += 1

    def receive(self, data: bytes, *, now: float) -> None:  # noqa: ARG002 - as other ends
        """See `LocalEnd`; what is older than the newest is of no use."""
        number, x, y, theta = _UP.unpack_from(data)
        if number > self._newest:
            self._newest, self.seen = number, ReportedPosition(x, y, theta)

    @override
    def to_send(self, *, now: float) -> list[bytes]:
        if now < self._next - SLACK:
            return []
        self._next = max(self._next + self._T, now + 0.5 * self._T)
        self._recent.append(_INPUT.pack(*self._rims, self._fires.popleft() if self._fires else -1))
        self._number += 1
        head = _HEAD.pack(self._number, round(1000 * now), len(self._recent))
        return [(head + b"".join(self._recent)).ljust(self._size, b"\0")]


class PlainRobot(RobotEnd):
    """The robot's end."""

    def __init__(
        self, model: RobotModel, period: float, size: int, loss: float, config: MotionFilterConfig
    ) -> None:
        """Begin at time 0.

        Args:
            model: Of the robot, for its filter.
            period: T [s].
            size: Of every packet [byte]; 0 for as small as it can be.
            loss: T_loss [s]: after so long without a packet the wheels stop.
            config: Of the filter.
        """
        self._left, self._right = model.index("left_wheel"), model.index("right_wheel")
        assert isinstance(model.elements[self._left], Effector)
        self._filter = MotionFilter(model, config)
        self._T, self._size, self._loss = period, size, loss
        self._heard: float | None = None
        self._newest = self._told = 0
        self._commands: list[int] = []
        self._position = ReportedPosition(0.0, 0.0, 0.0)
        self._number = 0
        self._next = 0.0

    def receive(self, data: bytes, *, now: float) -> None:
        """See `RobotEnd`; inputs that came are skipped, those that were lost and are repeated aren't."""
        number, stamp, count = _HEAD.unpack_from(data)
        if number <= self._newest:
            return
        for k in range(max(self._newest + 1, number - count + 1), number + 1):
            at = _HEAD.size + (count - 1 - (number - k)) * _INPUT.size
            left, right, command = _INPUT.unpack_from(data, at)
            if command >= 0:
                self._commands.append(command)
            told = {self._left: (float(left),), self._right: (float(right),)}
            self._filter.receive(1e-3 * stamp - (number - k) * self._T, told, now=now, fresh=k == number)
        self._newest, self._heard = number, now

    @override
    def drive(self, *, now: float) -> Rims:
        self._filter.play(now)
        if self._heard is None or now - self._heard >= self._loss:
            return 0, 0
        left, right = (self._filter.given(index)[0] for index in (self._left, self._right))
        return int(left), int(right)

    @override
    def fired(self) -> list[int]:
        found, self._commands = self._commands, []
        return found

    @override
    def measure(self, position: ReportedPosition) -> None:
        self._position = position

    @override
    def to_send(self, *, now: float) -> list[bytes]:
        if self._heard is None or now < self._next - SLACK:
            return []
        self._next = max(self._next + self._T, now + 0.5 * self._T)
        self._number += 1
        return [_UP.pack(self._number, *self._position).ljust(self._size, b"\0")]

    @property
    @override
    def stamp(self) -> float | None:
        return self._filter.playing
