"""The record of one run of the twins: what both robots did, in the user's time."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from interfaces.teleop import Correction
from vrs.clock import ManualClock
from vrs.commands import Cancel, Command, InsertVia, Lateness, Retime
from vrs.comparison import measured_rows
from vrs.engine import Engine
from vrs.errors import InvalidValueError, VrsError
from vrs.ledger import Receipt
from vrs.model import Array, RobotModel, frozen_array
from vrs.timeline import Timeline


@dataclass(frozen=True, slots=True)
class CommandPacket:
    """One motion command on its way across the link."""

    command_id: int
    """Id that the operator's engine gave the command, from 1."""
    sent: float
    """User time of sending [s]."""
    arrived: float | None
    """User time at which it first arrived [s]; None when it never did."""
    real_id: int | None = None
    """Id that the real robot's engine gave the command; None when it never arrived."""
    lost: bool = False
    """Whether the link lost the first message with it; later messages repeat it."""


@dataclass(frozen=True, slots=True, order=True)
class RunEvent:
    """Something that happened to the real robot or the link."""

    t: float
    """User time [s]."""
    kind: str
    """`payload`, `release`, `late`, `lost`, `slowed`, `waited`, `corrected`, `halted`, `diverged`, `unfinished`."""
    text: str
    """What happened, one line."""


@dataclass(frozen=True, slots=True, eq=False)
class TwinSamples:
    """Where both robots were whenever the real one was measured; the joints as in `TwinRun`, (m, n)."""

    t: Array
    """User time [s], (m,), ascending."""
    q_virtual: Array
    q_shown: Array
    q_matched: Array
    q_real: Array
    q_reference: Array


@dataclass(frozen=True, slots=True, eq=False)
class TwinRun:
    """Both twins over one run, sampled on a common grid of user time.

    At user time t the real robot is where its timeline is at the play time p(t) = t + D(t). With D = −D_f all along
    that is the paper's clock offset (Doulgeri, Zikos, Delopoulos, section IV-A); adaptive, D follows the network.
    Equal timeline time compares the real robot at t with the virtual one at p(t).
    """

    model: RobotModel
    """The robot that both twins are."""
    title: str
    """Title of the plan."""
    seed: int
    """Seed of everything random in the run."""
    delay: str
    """Delay profile, as it was asked for."""
    offset: str
    """How D was chosen: `adaptive`, or `fixed:S` for D = −S."""
    service: str
    """Order of delivery on the link: `datagram` or `in-order`."""
    link_loss: str
    """What the robot does when messages stay away: `hold` stops, and goes on when they come again."""
    t: Array
    """User time [s], (k,), evenly spaced, ascending."""
    play: Array
    """Play time p of the real robot at user time t, on the timeline [s], (k,), never descending."""
    q_virtual: Array
    """Joints of the virtual robot at user time t, as the commands make it [rad], (k, n)."""
    q_shown: Array
    """Joints of the virtual robot that the user saw, corrections included [rad], (k, n)."""
    q_matched: Array
    """Joints of the virtual robot, as the commands make it, at timeline time p(t) [rad], (k, n)."""
    q_real: Array
    """Joints of the real robot as measured at user time t [rad], (k, n); rows of NaN where nothing was measured."""
    q_reference: Array
    """What the real robot's own timeline asked for at that moment [rad], (k, n)."""
    receipts_virtual: tuple[Receipt, ...]
    """Receipts of the operator's engine."""
    receipts_real: tuple[Receipt, ...]
    """Receipts of the real robot's engine."""
    packets: tuple[CommandPacket, ...]
    """Every command that was sent, in the order of sending."""
    messages: Array
    """Every message to the robot, heartbeats too: when it was sent and arrived, user time [s], (m, 2); NaN for one
    that was lost or was still under way at the end."""
    corrections: tuple[Correction, ...]
    """When the virtual robot was put where the real one was going."""
    events: tuple[RunEvent, ...]
    """Everything else that happened, by time, kind and text."""
    samples: TwinSamples | None = None
    """Where both robots were whenever the real one was measured; None where that's on the grid."""
    gap_s: float = 0.0
    """For how long nothing was measured of the real robot, between its first and its last sample [s]."""

    def __post_init__(self) -> None:
        for name in ("t", "play", "messages"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        if self.t.ndim != 1 or len(self.t) < 2 or not (np.diff(self.t) > 0).all():
            raise InvalidValueError("t", self.t.shape, "at least two ascending times, shape (k,)")
        if self.play.shape != self.t.shape or (np.diff(self.play) < 0).any():
            raise InvalidValueError("play", self.play.shape, f"never descending, of shape {self.t.shape}")
        if self.messages.ndim != 2 or self.messages.shape[1] != 2:
            raise InvalidValueError("messages", self.messages.shape, "of shape (m, 2)")
        for name in ("q_virtual", "q_shown", "q_matched", "q_real", "q_reference"):
            value = frozen_array(getattr(self, name))
            if value.ndim != 2 or len(value) != len(self.t):
                raise InvalidValueError(name, value.shape, f"of shape ({len(self.t)}, n)")
            object.__setattr__(self, name, value)

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Whether the real robot was measured at user time t, (k,): figures are of those rows alone."""
        return measured_rows(self.q_real)

    @property
    def at_samples(self) -> TwinSamples:
        """Where both robots were whenever the real one was measured."""
        if self.samples is not None:
            return self.samples
        joints = (self.q_virtual, self.q_shown, self.q_matched, self.q_real, self.q_reference)
        return TwinSamples(self.t[self.measured], *(q[self.measured] for q in joints))

    @property
    def dt(self) -> float:
        """Step of the grid [s]."""
        return float(self.t[1] - self.t[0])

    @property
    def D(self) -> Array:
        """Clock offset of the real robot, play time less user time [s], (k,)."""
        return self.play - self.t


def commands_alone(
    model: RobotModel,
    start: Array,
    sent: Iterable[tuple[float, Command | None, Receipt | None]],
    *,
    now: float = 0.0,
) -> Timeline:
    """What commands make of a virtual robot that nothing corrects.

    Args:
        model: The robot.
        start: Joints at the start [rad], (n,).
        sent: What the engine that was corrected took: when [s], the command (None for an undo), and its receipt.
        now: When that engine began [s].
    """
    clock = ManualClock(now)
    engine = Engine(model, q=start, clock=clock, lateness=Lateness.POSTPONE)
    return carried_out(engine, clock, sent)


def carried_out(
    engine: Engine, clock: ManualClock, sent: Iterable[tuple[float, Command | None, Receipt | None]]
) -> Timeline:
    """What commands make of an engine; see `commands_alone`."""
    for at, command, receipt in sent:
        clock.set(at)
        # Edits name commands by the ids that these got, and some ids were given to what was refused.
        if command is not None and receipt is not None and not isinstance(command, Retime | Cancel | InsertVia):
            engine.count_from(receipt.command_id - 1)
        with suppress(VrsError):
            engine.undo() if command is None else engine.execute(command)  # type: ignore[arg-type]
    return engine.timeline
