"""The emulated way to the robot, as clients ask about it, are told of it, and change it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from interfaces.link.gauge import LinkFigures


@dataclass(frozen=True, slots=True)
class DirectionConditions:
    """What is emulated in one direction, as the command line spells it."""

    delay: str
    """A delay profile: `interfaces.link.delay_profile`."""
    loss: str = "0"
    """A loss model: `interfaces.link.loss_model`."""
    service: str = "datagram"
    """`datagram` or `in-order`."""


@dataclass(frozen=True, slots=True)
class Survey:
    """Client: how is the way to the robot? Changes of it are told from then on."""

    kind: ClassVar[str] = "survey"
    version: ClassVar[int] = 1
    number: int


@dataclass(frozen=True, slots=True)
class Impair:
    """Holder: other conditions of the emulated way to the robot, from now on."""

    kind: ClassVar[str] = "impair"
    version: ClassVar[int] = 1
    number: int
    epoch: int
    forward: DirectionConditions | None = None
    """To the robot; None leaves them as they are."""
    backward: DirectionConditions | None = None
    """Back."""


@dataclass(frozen=True, slots=True)
class Network:
    """Server: how the way to the robot is."""

    kind: ClassVar[str] = "network"
    version: ClassVar[int] = 1
    forward: DirectionConditions
    """What is emulated to the robot."""
    backward: DirectionConditions
    """What is emulated back."""
    there: LinkFigures
    """What was measured of the emulation to the robot, since it changed last."""
    back: LinkFigures
    """The same of the way back."""
    round_trip: LinkFigures
    """Of whole round trips between the sites, with the network beneath; nothing is known of losses."""
    seed: int = 0
    """Of what is random in the emulation."""
    changed_at: float | None = None
    """Session time when the conditions changed last [s]; None if they never did."""
    changed_by: str = ""
    """Name of who changed them."""
    robot: str = ""
    """Where the robot's site is."""
    problem: str = ""
    """Why there's no connection to it; empty while there is one."""
    clock: float | None = None
    """Bound on the error of what the robot takes for session time [s]."""
    link_loss: str = ""
    """What the robot does when nothing is heard, `halt` or `hold`; empty while that isn't known."""
    timeout: float | None = None
    """So long after the last message that counts it does that [s]."""
    max_age: float | None = None
    """Older messages don't count under `halt` [s]."""
    offset: float | None = None
    """D, where it's fixed [s]; None where it adapts, or isn't known."""
    advice: str = ""
    """What is likely to go wrong under these conditions, for people."""
    answers: int | None = None
    """Number of the receiver's request that this answers."""
