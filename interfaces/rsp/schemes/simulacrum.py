"""RSP as a scheme: both cores, with CUBO's own model."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from typing_extensions import override

from interfaces.rsp.local import LocalConfig, LocalCore, LocalState
from interfaces.rsp.model.elements import Sensor
from interfaces.rsp.model.robot_model import RobotModel
from interfaces.rsp.outputs import Commanded, Told
from interfaces.rsp.robot import RobotConfig, RobotCore
from interfaces.rsp.schemes.ends import LocalEnd, ReportedPosition, Rims, RobotEnd

_ADDRESS: Final = b"local"


class RspLocal(LocalEnd):
    """The local system's end."""

    def __init__(self, model: RobotModel, random_bytes: Callable[[int], bytes], config: LocalConfig) -> None:
        """Open a session at time 0, and ask for the position."""
        self.core = LocalCore(model, random_bytes, config)
        self.core.open(now=0.0)
        self.seen: ReportedPosition | None = None
        self._left, self._right = model.index("left_wheel"), model.index("right_wheel")
        self._fire, self._position = model.index("ir_fire"), model.index("position")
        self.core.request(self._position, True)
        sensor = model.elements[self._position]
        assert isinstance(sensor, Sensor)
        self._sensor = sensor
        self._number = 0
        self._waiting: list[bytes] = []

    @override
    def write(self, rims: Rims, *, now: float) -> None:
        for index, rim in zip((self._left, self._right), rims, strict=True):
            self.core.write(index, rim.to_bytes(2, "big", signed=True))

    def fire(self, *, now: float) -> None:  # noqa: ARG002 - as other ends
        """See `LocalEnd`; before there's a session it waits."""
        self._waiting.append(bytes([self._number % 256]))
        self._number += 1

    @override
    def receive(self, data: bytes, *, now: float) -> None:
        self.core.receive(data, now=now)
        for output in self.core.take():
            if isinstance(output, Told) and output.index == self._position:
                scale = self._sensor.scale
                x, y, theta = self._sensor.format.unpack(output.payload)
                self.seen = ReportedPosition(scale * x, scale * y, scale * theta)

    @override
    def to_send(self, *, now: float) -> list[bytes]:
        if self.core.state is LocalState.OPEN:
            for values in self._waiting:
                self.core.command(self._fire, values)
            self._waiting.clear()
        return self.core.to_send(now=now)


class RspRobot(RobotEnd):
    """The robot's end."""

    def __init__(self, model: RobotModel, random_bytes: Callable[[int], bytes], config: RobotConfig) -> None:
        """Wait for a session."""
        self.core = RobotCore(model, random_bytes, config)
        self._left, self._right = model.index("left_wheel"), model.index("right_wheel")
        self._position = model.index("position")
        sensor = model.elements[self._position]
        assert isinstance(sensor, Sensor)
        self._sensor = sensor
        self._commands: list[int] = []

    @override
    def receive(self, data: bytes, *, now: float) -> None:
        self.core.receive(data, _ADDRESS, now=now)

    @override
    def drive(self, *, now: float) -> Rims:
        self.core.effectors(now=now)
        self._commands += [output.id for output in self.core.take() if isinstance(output, Commanded)]
        left, right = (self.core.motion.given(index)[0] for index in (self._left, self._right))
        return int(left), int(right)

    @override
    def fired(self) -> list[int]:
        found, self._commands = self._commands, []
        return found

    @override
    def measure(self, position: ReportedPosition) -> None:
        raw = (round(value / self._sensor.scale) for value in position)
        self.core.measure(self._position, self._sensor.format.pack(*raw))

    @override
    def to_send(self, *, now: float) -> list[bytes]:
        return [data for data, _ in self.core.to_send(now=now)]

    @property
    def stamp(self) -> float | None:
        """See `RobotEnd`: an effector that isn't in a packet is as it was when that was made."""
        return self.core.motion.playing
