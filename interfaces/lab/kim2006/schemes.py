"""Ways to send commands and positions, for comparison with RSP on the same links."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

from interfaces.link.conditions import Service
from interfaces.rsp.local import LocalConfig, LocalCore, LocalState, PeriodConfig
from interfaces.rsp.model.elements import Effector, RobotModel, Sensor
from interfaces.rsp.motion_filter import MotionFilter, MotionFilterConfig
from interfaces.rsp.outputs import Commanded, Told
from interfaces.rsp.robot import RobotConfig, RobotCore
from interfaces.rsp.session import SLACK
from robots.onboard.driving import Posture
from vrs.checks import one_of

Rims = tuple[int, int]
"""Speeds of the left and the right wheel at the rim [mm/s]."""
PERIOD: Final = 0.02
"""T of all schemes [s], the paper's."""
LOSS: Final = 0.5
"""T_loss [s]: after so long without a packet the wheels stop."""
REPEATS: Final = 8
"""How often inputs are sent where they're repeated."""
_HEAD: Final = struct.Struct("!IIB")
"""Number of the newest input, its stamp [ms], how many inputs follow."""
_INPUT: Final = struct.Struct("!hhi")
"""Left and right rim [mm/s], number of the command or −1."""
_UP: Final = struct.Struct("!Iddd")
"""Number, x, y, θ."""
FIXED_DOWN: Final = 1992
"""Size of a packet of one size to the robot [byte]: the paper's largest."""
FIXED_UP: Final = 96
"""And from it [byte]: all of a thin client's sensors."""


class PlainLocal:
    """The local system's end of a scheme without a simulacrum: inputs are repeated, nobody acknowledges anything.

    A packet down has all that RSP's largest could have, whether it's needed or not; the repeated inputs are as
    small as they can be.
    """

    def __init__(self, repeats: int, size: int) -> None:
        """Begin at time 0.

        Args:
            repeats: Inputs in a packet, 1 to 255: each is sent as often.
            size: Of every packet [byte]; 0 for as small as it can be.
        """
        self.seen: Posture | None = None
        """Newest posture that came."""
        self._size = size
        self._recent: deque[bytes] = deque(maxlen=repeats)
        self._rims: Rims = (0, 0)
        self._fires: deque[int] = deque()
        self._number = self._count = 0
        self._next = 0.0
        self._newest = -1

    def write(self, rims: Rims) -> None:
        """Set what the wheels are to do."""
        self._rims = rims

    def fire(self) -> None:
        """Give a command: something that is to be done once."""
        self._fires.append(self._count)
        self._count += 1

    def play(self) -> None:
        """Give a period's music: in a packet of one size there's room for it, whether there's any or not."""

    def receive(self, data: bytes, _now: float) -> None:
        """Take a packet; what is older than the newest is of no use."""
        number, x, y, theta = _UP.unpack_from(data)
        if number > self._newest:
            self._newest, self.seen = number, Posture(x, y, theta)

    def to_send(self, *, now: float) -> list[bytes]:
        """Packets that are due by now [s]."""
        if now < self._next - SLACK:
            return []
        self._next = max(self._next + PERIOD, now + 0.5 * PERIOD)
        self._recent.append(_INPUT.pack(*self._rims, self._fires.popleft() if self._fires else -1))
        self._number += 1
        head = _HEAD.pack(self._number, round(1000 * now), len(self._recent))
        return [(head + b"".join(self._recent)).ljust(self._size, b"\0")]


class PlainRobot:
    """The robot's end."""

    def __init__(self, model: RobotModel, size: int) -> None:
        """Begin at time 0.

        Args:
            model: Of the robot, for its filter.
            size: Of every packet [byte]; 0 for as small as it can be.
        """
        self._left, self._right = model.index("left_wheel"), model.index("right_wheel")
        assert isinstance(model.elements[self._left], Effector)
        self._filter = MotionFilter(model, MotionFilterConfig())
        self._size = size
        self._heard: float | None = None
        self._newest = self._told = 0
        self._commands: list[int] = []
        self._posture = Posture(0.0, 0.0, 0.0)
        self._number = 0
        self._next = 0.0

    def receive(self, data: bytes, *, now: float) -> None:
        """Take a packet; inputs that came are skipped, those that were lost and are repeated aren't."""
        number, stamp, count = _HEAD.unpack_from(data)
        if number <= self._newest:
            return
        for k in range(max(self._newest + 1, number - count + 1), number + 1):
            at = _HEAD.size + (count - 1 - (number - k)) * _INPUT.size
            left, right, command = _INPUT.unpack_from(data, at)
            if command >= 0:
                self._commands.append(command)
            told = {self._left: (float(left),), self._right: (float(right),)}
            self._filter.receive(1e-3 * stamp - (number - k) * PERIOD, told, now=now, fresh=k == number)
        self._newest, self._heard = number, now

    def drive(self, *, now: float) -> Rims:
        """What the wheels do from now on [s]."""
        self._filter.play(now)
        if self._heard is None or now - self._heard >= LOSS:
            return 0, 0
        left, right = (self._filter.given(index)[0] for index in (self._left, self._right))
        return int(left), int(right)

    def fired(self) -> list[int]:
        """Numbers of the commands that came since the last call, from 0."""
        found, self._commands = self._commands, []
        return found

    def measure(self, posture: Posture) -> None:
        """Set where the robot is."""
        self._posture = posture

    def to_send(self, *, now: float) -> list[bytes]:
        """Packets that are due by now [s]."""
        if self._heard is None or now < self._next - SLACK:
            return []
        self._next = max(self._next + PERIOD, now + 0.5 * PERIOD)
        self._number += 1
        return [_UP.pack(self._number, *self._posture).ljust(self._size, b"\0")]

    @property
    def stamp(self) -> float | None:
        """When what the wheels do was given, on the local system's clock [s]; None before anything came."""
        return self._filter.playing


_ADDRESS: Final = b"local"


class RspLocal:
    """The local system's end."""

    def __init__(self, model: RobotModel, random_bytes: Callable[[int], bytes], config: LocalConfig) -> None:
        """Open a session at time 0, and ask for the position."""
        self.core = LocalCore(model, random_bytes, config)
        self.core.open(now=0.0)
        self.seen: Posture | None = None
        """Newest posture that came."""
        self._left, self._right = model.index("left_wheel"), model.index("right_wheel")
        self._fire, self._position = model.index("ir_fire"), model.index("position")
        self._speaker = model.index("speaker")
        self.core.request(self._position, True)
        sensor = model.elements[self._position]
        assert isinstance(sensor, Sensor)
        self._sensor = sensor
        self._number = 0
        self._waiting: list[bytes] = []

    def write(self, rims: Rims) -> None:
        """Set what the wheels are to do."""
        for index, rim in zip((self._left, self._right), rims, strict=True):
            self.core.write(index, rim.to_bytes(2, "big", signed=True))

    def fire(self) -> None:
        """Give a command: something that is to be done once; before there's a session it waits."""
        self._waiting.append(bytes([self._number % 256]))
        self._number += 1

    def play(self) -> None:
        """Give a period's music; what the robot has no buffer for is left out."""
        if self.core.streams.credit > len(self.core.streams):
            speaker = self.core.model.elements[self._speaker]
            assert isinstance(speaker, Effector)
            self.core.play(self._speaker, bytes(speaker.stream))

    def receive(self, data: bytes, now: float) -> None:
        """Take a packet."""
        self.core.receive(data, now=now)
        for output in self.core.take():
            if isinstance(output, Told) and output.index == self._position:
                scale = self._sensor.scale
                x, y, theta = self._sensor.format.unpack(output.payload)
                self.seen = Posture(scale * x, scale * y, scale * theta)

    def to_send(self, *, now: float) -> list[bytes]:
        """Packets that are due by now [s]."""
        if self.core.state is LocalState.OPEN:
            for values in self._waiting:
                self.core.command(self._fire, values)
            self._waiting.clear()
        return self.core.to_send(now=now)


class RspRobot:
    """The robot's end."""

    def __init__(self, model: RobotModel, random_bytes: Callable[[int], bytes], config: RobotConfig) -> None:
        """Wait for a session."""
        self.core = RobotCore(model, random_bytes, config)
        self._left, self._right = model.index("left_wheel"), model.index("right_wheel")
        self._position, self._speaker = model.index("position"), model.index("speaker")
        sensor = model.elements[self._position]
        assert isinstance(sensor, Sensor)
        self._sensor = sensor
        self._commands: list[int] = []

    def receive(self, data: bytes, *, now: float) -> None:
        """Take a packet."""
        self.core.receive(data, _ADDRESS, now=now)

    def drive(self, *, now: float) -> Rims:
        """What the wheels do from now on [s]."""
        self.core.effectors(now=now)
        self.core.streams.take(self._speaker)
        self._commands += [output.id for output in self.core.take() if isinstance(output, Commanded)]
        left, right = (self.core.motion.given(index)[0] for index in (self._left, self._right))
        return int(left), int(right)

    def fired(self) -> list[int]:
        """Numbers of the commands that came since the last call, from 0."""
        found, self._commands = self._commands, []
        return found

    def measure(self, posture: Posture) -> None:
        """Set where the robot is."""
        raw = (round(value / self._sensor.scale) for value in posture)
        self.core.measure(self._position, self._sensor.format.pack(*raw))

    def to_send(self, *, now: float) -> list[bytes]:
        """Packets that are due by now [s]."""
        return [data for data, _ in self.core.to_send(now=now)]

    @property
    def stamp(self) -> float | None:
        """When what wheels do was given [s]: an effector that isn't in a packet is as it was when that was made."""
        return self.core.motion.playing


UDP_HEADER: Final = 28
"""IPv4 and UDP [byte]."""
TCP_HEADER: Final = 40
"""IPv4 and TCP without options [byte]."""


Ends: TypeAlias = tuple[PlainLocal | RspLocal, PlainRobot | RspRobot]
"""The local system's end and the robot's."""


@dataclass(frozen=True, slots=True)
class Scheme:
    """A way to send."""

    name: str
    service: Service
    header: int
    """What the network adds to a packet [byte]."""
    ends: Callable[[RobotModel, Callable[[int], bytes], bool], Ends]
    """Makes both ends, of what gives random bytes, and whether RSP fits T to the link."""
    least: tuple[int, int] = (0, 0)
    """Packets to the robot and from it are filled up to these sizes [byte]."""


def _rsp(model: RobotModel, random_bytes: Callable[[int], bytes], adaptive: bool) -> Ends:
    period = PeriodConfig(least=PERIOD, adaptive=adaptive)
    local = RspLocal(model, random_bytes, LocalConfig(period=period, lifetime=120.0))
    robot = RspRobot(model, random_bytes, RobotConfig(loss=LOSS, period=PERIOD, lifetime=120.0))
    # The session is opened beforehand, as a TCP connection is: the comparison begins after that.
    for _ in range(2):
        for data in local.to_send(now=0.0):
            robot.receive(data, now=0.0)
        for data in robot.to_send(now=0.0):
            local.receive(data, 0.0)
    return local, robot


def _plain(repeats: int, down: int, up: int) -> Callable[[RobotModel, Callable[[int], bytes], bool], Ends]:
    return lambda model, _, __: (PlainLocal(repeats, down), PlainRobot(model, up))


SCHEMES: Final[dict[str, Scheme]] = {
    each.name: each
    for each in (
        Scheme("rsp", Service.DATAGRAM, UDP_HEADER, _rsp),
        Scheme("fixed", Service.DATAGRAM, UDP_HEADER, _plain(1, FIXED_DOWN, FIXED_UP)),
        Scheme("tcp", Service.IN_ORDER, TCP_HEADER, _plain(1, FIXED_DOWN, FIXED_UP)),
        Scheme("repeated", Service.DATAGRAM, UDP_HEADER, _plain(REPEATS, 0, 0)),
        Scheme("stream", Service.IN_ORDER, TCP_HEADER, _rsp),
        Scheme("padded", Service.DATAGRAM, UDP_HEADER, _rsp, (FIXED_DOWN, FIXED_UP)),
    )
}
"""RSP; packets of one size on UDP, on TCP; inputs repeated without acknowledgement; RSP's packets on TCP, and RSP's
packets on UDP that are filled up to one size."""


def scheme(name: str) -> Scheme:
    """The scheme of a name.

    Raises:
        InvalidValueError: If there's none.
    """
    return SCHEMES[one_of("scheme", name, SCHEMES)]
