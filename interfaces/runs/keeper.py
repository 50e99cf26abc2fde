"""Who writes a run in the laboratory down while it goes on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from interfaces.link import PacketRecord
from interfaces.runs.twin_run import CommandPacket, RunEvent, TwinRun
from interfaces.teleop import OperatorSite
from vrs.model import Array, RobotModel


@dataclass(frozen=True, slots=True, eq=False)
class RunFacts:
    """What is known of a run before it begins; the fields of `TwinRun` of the same names."""

    model: RobotModel
    start: Array
    """Joints at the start [rad], (n,)."""
    title: str
    seed: int
    delay: str
    offset: str
    service: str
    link_loss: str
    step: float
    """Period of the record [s]."""


class Turn(NamedTuple):
    """What has become known of a run since the turn before."""

    now: float
    """User time reached [s]."""
    first: int
    """Number of the first row; row k is of the user time k · step."""
    play: Array
    """Play time in each row [s], (k,)."""
    q_real: Array
    """Measured joints [rad], (k, n)."""
    q_reference: Array
    """What was asked of the body [rad], (k, n)."""
    there: tuple[PacketRecord, ...]
    """What became of messages to the robot."""
    back: tuple[PacketRecord, ...]
    """The same of those to the operator."""
    events: tuple[RunEvent, ...]
    packets: tuple[tuple[int, CommandPacket], ...]
    """Of commands that the robot has answered, with their places in the order of sending, from 1."""


class RunKeeper(Protocol):
    """Writes a run down. It may listen to the operator's site."""

    def begin(self, facts: RunFacts, operator: OperatorSite) -> None:
        """A run begins: nothing was commanded yet."""

    def turn(self, turn: Turn) -> None:
        """Some time has passed."""

    def end(self, run: TwinRun) -> None:
        """The run is over."""
