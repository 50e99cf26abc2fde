"""The schemes by name: which ends they have, and on what transport."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final

from interfaces.link.conditions import Service
from interfaces.rsp.local import LocalConfig
from interfaces.rsp.model.robot_model import RobotModel
from interfaces.rsp.motion_filter import MotionFilterConfig
from interfaces.rsp.period import PeriodConfig
from interfaces.rsp.robot import RobotConfig
from interfaces.rsp.schemes.ends import LocalEnd, RobotEnd
from interfaces.rsp.schemes.plain import FIXED_DOWN, FIXED_UP, PlainLocal, PlainRobot
from interfaces.rsp.schemes.simulacrum import RspLocal, RspRobot
from vrs.checks import one_of, validated, within

UDP_HEADER: Final = 28
"""IPv4 and UDP [byte]."""
TCP_HEADER: Final = 40
"""IPv4 and TCP without options [byte]."""


@dataclass(frozen=True, slots=True)
@validated
class SchemeConfig:
    """What all schemes share."""

    period: Annotated[float, within(1e-3, 1.0, "s")] = 0.02
    """T [s], in [0.001, 1]; the paper's 20 ms."""
    loss: Annotated[float, within(0.1, 2.0, "s")] = 0.5
    """T_loss [s], in [0.1, 2]."""
    repeat: Annotated[int, within(1, 255)] = 8
    """How often inputs are sent where they're repeated, 1 to 255."""
    adaptive: bool = False
    """Whether RSP fits T to the link."""


@dataclass(frozen=True, slots=True)
class Scheme:
    """A way to send."""

    name: str
    service: Service
    header: int
    """What the network adds to a packet [byte]."""
    ends: Callable[[RobotModel, SchemeConfig, Callable[[int], bytes]], tuple[LocalEnd, RobotEnd]]
    """Makes both ends; the last argument gives random bytes."""


def _rsp(
    model: RobotModel, config: SchemeConfig, random_bytes: Callable[[int], bytes]
) -> tuple[LocalEnd, RobotEnd]:
    period = PeriodConfig(least=config.period, adaptive=config.adaptive)
    local = RspLocal(model, random_bytes, LocalConfig(period=period, lifetime=120.0))
    robot = RspRobot(model, random_bytes, RobotConfig(loss=config.loss, period=config.period, lifetime=120.0))
    # The session is opened beforehand, as a TCP connection is: the comparison begins after that.
    for _ in range(2):
        for data in local.to_send(now=0.0):
            robot.receive(data, now=0.0)
        for data in robot.to_send(now=0.0):
            local.receive(data, now=0.0)
    return local, robot


def _plain(
    repeat: bool, down: int, up: int
) -> Callable[[RobotModel, SchemeConfig, Callable[[int], bytes]], tuple[LocalEnd, RobotEnd]]:
    def made(model: RobotModel, config: SchemeConfig, _: object) -> tuple[LocalEnd, RobotEnd]:
        local = PlainLocal(config.period, config.repeat if repeat else 1, down)
        return local, PlainRobot(model, config.period, up, config.loss, MotionFilterConfig())

    return made


SCHEMES: Final[dict[str, Scheme]] = {
    each.name: each
    for each in (
        Scheme("rsp", Service.DATAGRAM, UDP_HEADER, _rsp),
        Scheme("fixed", Service.DATAGRAM, UDP_HEADER, _plain(False, FIXED_DOWN, FIXED_UP)),
        Scheme("tcp", Service.IN_ORDER, TCP_HEADER, _plain(False, FIXED_DOWN, FIXED_UP)),
        Scheme("repeated", Service.DATAGRAM, UDP_HEADER, _plain(True, 0, 0)),
    )
}
"""RSP; packets of one size on UDP, on TCP; inputs repeated without acknowledgement."""


def scheme(name: str) -> Scheme:
    """The scheme of a name.

    Raises:
        InvalidValueError: If there's none.
    """
    return SCHEMES[one_of("scheme", name, SCHEMES)]
