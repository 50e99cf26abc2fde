"""A run of the twins: its facts, its record in the user's time, who writes it down, and its events."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from interfaces.link import ConstantDelay, DelayProfile, PacketRecord
from interfaces.link.delays import MAX_DELAY
from interfaces.messages.recording import Begin, CommandPacket, RunEvent
from interfaces.teleop import Correction, OperatorSite, VirtualArm
from robots.bullet.grasping import HandState
from robots.robot import Robot
from robots.things import Scene
from vrs.clock import ManualClock
from vrs.commands import Cancel, Command, InsertVia, Lateness, Retime
from vrs.comparison import measured_rows
from vrs.engine import Engine
from vrs.errors import InvalidValueError, VrsError
from vrs.ledger import Receipt, Status
from vrs.model import Array, RobotModel, for_people, frozen_array
from vrs.timeline import Timeline

QUANTILE = 0.95
"""Share of packets that a fixed offset covers where it's taken from a random profile."""
STEP = 0.02
"""What that offset is rounded up to [s]."""
ADAPTIVE = "adaptive"
FIXED = "fixed"
_ALLOWED = f"'adaptive', 'fixed', or 'fixed:S' with S seconds in [0, {MAX_DELAY:g}], as in fixed:0.5"


def fixed_offset(text: str, profile: DelayProfile) -> float | None:
    """Read a choice of offset.

    Args:
        text: `adaptive`; `fixed` for D = −D_f from the profile; `fixed:S` for D = −S.
        profile: The link's delay.

    Returns:
        D [s], ≤ 0; None for an offset that adapts.

    Raises:
        InvalidValueError: If it's none of these.
    """
    if text == ADAPTIVE:
        return None
    if text == FIXED:
        return -covered(profile)
    kind, _, number = text.partition(":")
    try:
        behind = float(number) if kind == FIXED else math.nan
    except ValueError:
        behind = math.nan
    if not 0 <= behind <= MAX_DELAY:
        raise InvalidValueError("offset", text, _ALLOWED)
    return -behind


def covered(profile: DelayProfile) -> float:
    """D_f [s]: the constant delay, or the 95 % quantile rounded up to a step of the record."""
    if isinstance(profile, ConstantDelay):
        return profile.delay
    return STEP * math.ceil(profile.quantile(QUANTILE) / STEP - 1e-9)


def spelled(D: float | None) -> str:
    """The choice as the command line spells it."""
    return ADAPTIVE if D is None else f"{FIXED}:{-D:.9g}"


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

    robot: Robot
    """The arm that both twins are."""
    session: Begin
    """How it was set up."""
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
    def model(self) -> RobotModel:
        """The arm's kinematics and limits."""
        return self.robot.arm

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
    model: RobotModel, start: Array, sent: Iterable[tuple[float, Command | None, Receipt | None]]
) -> Timeline:
    """What commands make of a virtual robot that nothing corrects.

    Args:
        model: The robot.
        start: Joints at the start [rad], (n,).
        sent: What the engine that was corrected took: when [s], the command (None for an undo), and its receipt.
    """
    clock = ManualClock(0.0)
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
            engine.undo() if command is None else engine.execute(command)
    return engine.timeline


NEAR = 0.3
"""Waits that are nearer than this [s] are told as one."""
LEAST = 0.02
"""A wait by which D grew less than this [s] isn't told."""
_SAME = 1e-9
"""Times nearer than this [s] are one."""


def command_events(
    packet: CommandPacket, sent: Receipt, answer: Receipt | None, *, play_at: Callable[[float], float]
) -> Iterator[RunEvent]:
    """Tell where a command was lost, late or refused at the robot.

    Args:
        packet: Its way across the link.
        sent: What the operator's engine answered.
        answer: What the robot's engine answered; None where it wasn't carried out.
        play_at: Play time of the robot at a user time [s].
    """
    command = packet.command_id
    if packet.lost:
        fate = (
            "" if packet.arrived is None else f", and came {packet.arrived - packet.sent:.3f} s after it was sent"
        )
        yield RunEvent(packet.sent, "lost", f"the message with command {command} was lost on the link{fate}")
    if answer is None or packet.arrived is None:
        return
    asked = sent.execute_at
    if answer.status is Status.REJECTED or answer.execute_at is None or asked is None:
        text = f"the real robot rejected command {command}: {answer.reason}"
        yield RunEvent(packet.arrived, "diverged", text)
    elif answer.execute_at > asked + _SAME:
        late = play_at(packet.arrived) - asked
        why = f"came {late:.3f} s too late" if late > 0 else "met a plan that had changed"
        text = f"command {command} {why}: executed at {answer.execute_at:.3f} s instead of {asked:.3f} s"
        yield RunEvent(packet.arrived, "late", text)


def waits(t: Array, play: Array, q_reference: Array, *, slowest: float) -> Iterator[RunEvent]:
    """Tell when the robot slowed down or waited, since messages were late.

    Args:
        t: User time [s], (k,), evenly spaced.
        play: Play time [s], (k,).
        q_reference: What was asked of the body [rad], (k, n).
        slowest: Pace that correcting D alone doesn't fall below.
    """
    step = float(t[1] - t[0])
    slow = np.diff(play) < (slowest - 1e-6) * step
    begun = np.flatnonzero(np.diff(play) > 0)
    slow[: begun[0] if len(begun) else len(slow)] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(np.int8)))
    spans: list[tuple[int, int]] = []
    for low, high in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if spans and t[low] - t[spans[-1][1]] < NEAR:
            spans[-1] = spans[-1][0], high
        else:
            spans.append((low, high))
    for low, high in spans:
        grown = float((t[high] - t[low]) - (play[high] - play[low]))
        if grown < LEAST:
            continue
        moving = (q_reference[high] != q_reference[low]).any()
        what = "slowed down" if moving else "waited at rest"
        text = (
            f"messages were late: the real robot {what} until {t[high]:.2f} s, and is {grown:.3f} s further behind"
        )
        yield RunEvent(float(t[low]), "slowed" if moving else "waited", text)


def correction_events(corrections: Sequence[Correction], prismatic: Collection[int]) -> Iterator[RunEvent]:
    """Tell when the virtual robot was put where the real one was going."""
    for made in corrections:
        yield RunEvent(made.t, "corrected", correction_text(made.end, made.error, made.reason, prismatic))


def correction_text(end: float, error: Array, reason: str, prismatic: Collection[int]) -> str:
    """Say that the virtual robot was put where the real one was going.

    Args:
        end: Until when it took [s].
        error: By how much it was off [rad], of prismatic joints [m], (n,).
        reason: Why.
        prismatic: Which joints are, from 0.
    """
    joint = int(np.abs(error).argmax())
    off, unit = for_people(joint, abs(float(error[joint])), prismatic)
    where = f"joint {joint + 1} was {off:.3g}{'°' if unit == 'deg' else f' {unit}'} off"
    return f"the virtual robot joined the real one's plan until {end:.2f} s ({where}): {reason}"


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
    packets: tuple[CommandPacket, ...]
    """Of commands that the robot has answered."""
    hands: tuple[tuple[float, HandState], ...] = ()
    """When the hand and the things around it were measured [s], and how; none of a robot without."""
    scene: Scene | None = None
    """What is around the robot; None where nothing is that it could grasp."""


class RunKeeper(Protocol):
    """Writes a run down. It may listen to the operator's site."""

    def begin(self, begin: Begin, operator: OperatorSite[VirtualArm]) -> None:
        """A run begins, set up so: nothing was commanded yet."""

    def turn(self, turn: Turn) -> None:
        """Some time has passed."""

    def end(self, run: TwinRun) -> None:
        """The run is over."""
