"""The robot's side of RSP: packet handler, and the motion, sensor, security and audio processors' protocol.

A state machine of values, as the local system's: it knows no socket, no clock and no body.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Final

from typing_extensions import override

from interfaces.rsp.errors import PacketError
from interfaces.rsp.handshake import SessionClaim, SessionDoor
from interfaces.rsp.header import HALF, MODULUS, STAMPS, Header, PacketType, unwrapped
from interfaces.rsp.layout import ID, PacketDirection
from interfaces.rsp.model.elements import (
    Command,
    Effector,
    MemoryCommand,
    MemoryEvent,
    Module,
    Monitor,
    OnLoss,
    RobotModel,
    Scalar,
)
from interfaces.rsp.motion_filter import MotionFilter, MotionFilterConfig, Values
from interfaces.rsp.outbox import StreamInbox, ValueOutbox
from interfaces.rsp.outputs import (
    Began,
    Commanded,
    EndReason,
    RobotChange,
    RobotOutput,
    SessionCore,
    SessionEnded,
    Stored,
)
from interfaces.rsp.session import SLACK, DropReason, Keyring, PacketDropped
from vrs.checks import validated, within

MOST_EVENTS: Final = 256
"""Events of an element that wait to be told."""


@dataclass(slots=True)
class _Events:
    """Events of one element that are to be told."""

    waiting: deque[bytes] = field(default_factory=deque)
    number: int = 0
    left: int = 0
    """Packets that still tell of the first one."""


class Telling:
    """Keeps what is to be told; a value that the local system is known to have isn't told again."""

    def __init__(self, model: RobotModel, repeats: int) -> None:
        """Begin with nothing asked for.

        Args:
            model: Of the robot.
            repeats: Packets that tell of an event.
        """
        self._repeats = repeats
        self._members = {
            index: frozenset(model.index(member) for member in element.members)
            for index, element in enumerate(model)
            if isinstance(element, Module)
        }
        self.monitors: dict[int, list[int]] = {}
        """Monitors of each effector that has some."""
        for index, element in enumerate(model):
            if isinstance(element, Monitor):
                self.monitors.setdefault(model.index(element.effector), []).append(index)
        self.measured = ValueOutbox()
        """What sensors and monitors say."""
        self._events: dict[int, _Events] = {}
        self._requested: frozenset[int] = frozenset()
        self._bits: frozenset[int] = frozenset()

    def reset(self) -> None:
        """Begin a session: nothing is known or asked for."""
        self._events.clear()
        self._requested = self._bits = frozenset()
        self.measured.forget()

    def occur(self, index: int, payload: bytes) -> bool:
        """Tell of an event; returns whether it will be told: somebody asked for it, and not too many wait."""
        if index not in self._requested:
            return False
        events = self._events.setdefault(index, _Events())
        if len(events.waiting) >= MOST_EVENTS:
            return False
        events.waiting.append(ID.pack(events.number % MODULUS) + payload)
        events.number += 1
        return True

    def ask(self, bits: Iterable[int]) -> None:
        """Take what a packet requests: sensors, monitors, events, and modules, which stand for their members."""
        bits = frozenset(bits)
        if bits == self._bits:
            return
        self._bits = bits
        asked = frozenset().union(
            bits - self._members.keys(), *(self._members[i] for i in bits & self._members.keys())
        )
        self.measured.forget(asked - self._requested)
        self._requested = asked

    def fill(self, payloads: dict[int, bytes], packet: int) -> None:
        """Add what is to be told to a packet of a number."""
        self.measured.fill(payloads, packet, self.measured.unknown & self._requested)
        for index, events in self._events.items():
            if events.waiting:
                payloads[index] = events.waiting[0]
                events.left = (events.left or self._repeats) - 1
                if not events.left:
                    events.waiting.popleft()


@dataclass(frozen=True, slots=True)
@validated
class RobotConfig:
    """How a robot's side works."""

    loss: Annotated[float, within(0.1, 2.0)] = 0.5
    """T_loss [s], in [0.1, 2]: after so long without a packet what rests on loss does so."""
    idle: Annotated[float, within(0.1, 60.0)] = 2.0
    """After so long without a packet anybody may open a session instead [s], in [0.1, 60]."""
    lifetime: Annotated[float, within(1.0, 120.0)] = 60.0
    """A session in which nothing came for so long ends [s], in [1, 120]."""
    period: Annotated[float, within(1e-3, 1.0)] = 0.02
    """Between its packets until it knows the local system's T, which it then keeps to [s], in [0.001, 1]."""
    longest: Annotated[float, within(1e-3, 10.0)] = 1.0
    """T that it follows at most [s], in [0.001, 10]."""
    repeats: Annotated[int, within(1, 100)] = 3
    """Packets that tell of an event, 1 to 100: nobody acknowledges it."""
    timeout: Annotated[float, within(1e-3, 10.0)] = 0.1
    """Least time before a memory event is sent again [s], in [0.001, 10]; twice the round trip where that's
    more."""
    takeover: bool = True
    """Whether anybody may take over by force where there are no keys; with keys only an admin may."""
    filter: MotionFilterConfig = field(default_factory=MotionFilterConfig)
    """How motion is played."""


class RobotCore(SessionCore[RobotOutput]):
    """One robot's side."""

    way = PacketDirection.UP

    def __init__(
        self,
        model: RobotModel,
        random_bytes: Callable[[int], bytes],
        config: RobotConfig | None = None,
        *,
        keys: Keyring | None = None,
    ) -> None:
        """Wait for a session.

        Args:
            model: Of the robot.
            random_bytes: So many bytes that nobody can guess.
            config: How it works.
            keys: Of who may open a session; everything is sealed then, and only then.
        """
        self._config = RobotConfig() if config is None else config
        super().__init__(model, self._config.timeout, sealed=keys is not None)
        self.door = SessionDoor(
            model.id, random_bytes, keys, idle=self._config.idle, takeover=self._config.takeover
        )
        self.motion = MotionFilter(model, self._config.filter)
        self.streams = StreamInbox(model.buffers)
        self._formats = {i: e.format for i, e in enumerate(model) if isinstance(e, Effector) and not e.stream}
        self._limits = {i: e.wire_limits for i, e in enumerate(model) if isinstance(e, Effector)}
        self._floats = {i: e for i, e in enumerate(model) if isinstance(e, Command) and e.type is Scalar.F32}
        self.claim: SessionClaim | None = None
        """The session that has the robot."""
        self._over: SessionClaim | None = None
        """The last session that ended: whoever didn't hear that asks again."""
        self.stopping = False
        """Whether the robot has to come to rest before a new session's packets count: answer with `rested`."""
        self._telling = Telling(model, self._config.repeats)
        self._answers: list[tuple[bytes, bytes]] = []
        self._changed: set[int] = set()
        """Effectors that do something else, but not because they were told to."""
        self._reset(0.0)
        for index in self._formats:
            self._monitor(index)

    def _reset(self, now: float) -> None:
        """Forget a session; effectors keep what they do, but for those that rest on loss."""
        given = {index: self.motion.given(index) for index in self._formats}
        self.motion, self.streams = MotionFilter(self.model, self._config.filter), StreamInbox(self.model.buffers)
        for index, values in given.items():
            if not self._rests(index):
                self.motion.set(index, values)
        self._changed |= {index for index in self._formats if self.motion.given(index) != given[index]}
        self._command = -1
        self._renew()
        self._telling.reset()
        self._clears = 0
        self._told: dict[int, Values] = {}
        self._lost = False
        self.heard = self._next = now
        self._stamp: int | None = None
        self._T = self._config.period

    @property
    def session(self) -> int | None:
        """ID of the session in force; None without one."""
        return None if self.claim is None else self.claim.session.id

    # What the body says.

    def measure(self, index: int, payload: bytes) -> None:
        """Set what a sensor says, as it is on the wire."""
        self._telling.measured.put(index, payload)

    def occur(self, index: int, payload: bytes) -> bool:
        """Tell of an event, its values as they are on the wire; returns whether it will be told.

        It isn't if nobody asked for it, or too many wait.
        """
        return self._telling.occur(index, payload)

    def rested(self) -> None:
        """The body is at rest: a new session's packets count from now on."""
        self.stopping = False

    def effectors(self, *, now: float) -> dict[int, Values]:
        """What effectors are to do from now on [s], of those for which it changed; the watchdog is looked at."""
        self._watch(now)
        forced = {index: self.motion.given(index) for index in self._changed}
        self._changed.clear()
        played = self.motion.play(now) if not self._lost and self.claim is not None else {}
        changed = forced | played
        for index in changed:
            self._monitor(index)
        return changed

    # Packets.

    def to_send(self, *, now: float) -> list[tuple[bytes, bytes]]:
        """Datagrams that are due by now [s], each with its address."""
        self._watch(now)
        answers, self._answers = self._answers, []
        self.waiting_outputs += self.memory_outbox.expire(now)
        claim = self.claim
        if claim is None or now < self._next - SLACK:
            return answers
        self._next = max(self._next + self._T, now + 0.5 * self._T)
        return [*answers, (self._up(claim, now), claim.address)]

    def next_deadline(self) -> float | None:
        """When something is to be sent [s]; None without a session."""
        if self._answers:
            return -math.inf
        return None if self.claim is None else self._next

    @override
    def _receive(self, head: Header, data: bytes, address: bytes, now: float) -> None:
        if head.type is PacketType.OPEN:
            held = None if self.claim is None else self.heard
            self._answers += self.door.opened(head, data, address, held, now=now)
            return
        if head.type not in (PacketType.DOWN, PacketType.END):
            raise PacketDropped(DropReason.UNEXPECTED)
        claim = self._claim_of(head, address)
        body, number = claim.session.take(head, data)
        if claim not in (self.claim, self._over):
            self._begin(claim, now)
        if self.stopping and claim is self.claim:
            raise PacketDropped(DropReason.STOPPING)
        if head.type is PacketType.END:
            claim.session.newest = number
            self._answers.append((claim.session.make(PacketType.ENDED, b"", now), claim.address))
            if claim is self.claim:
                self._end(EndReason.CLOSED, now)
            return
        payloads = self.layout.split(body, PacketDirection.DOWN)
        told = self._values(payloads)
        before, claim.session.newest = claim.session.newest, number
        self._paced(head, number - before)
        self._carry_out(claim, head, payloads, told, now)

    def _claim_of(self, head: Header, address: bytes) -> SessionClaim:
        """Whose packet it may be: of the session in force, of one that was given, or the end of the last one again.

        Raises:
            Dropped: If it's nobody's.
        """
        for claim in (self.claim, self.door.pending, self._over if head.type is PacketType.END else None):
            if claim is not None and claim.fits(head, address):
                return claim
        raise PacketDropped(DropReason.SESSION)

    def _begin(self, claim: SessionClaim, now: float) -> None:
        """A session proved to be there: it's in force, and an older one is over."""
        old = self.claim
        if old is not None:
            over = old.session
            self._answers += [(over.make(PacketType.ENDED, b"", now), old.address) for _ in range(3)]
            self._end(EndReason.TAKEN, now)
            self.stopping = True
        self.door.pending, self.claim = None, claim
        self._reset(now)
        self.waiting_outputs.append(Began(claim.session.id))

    def _end(self, reason: EndReason, now: float) -> None:
        assert self.claim is not None
        self.waiting_outputs += [
            *self.memory_outbox.drain(),
            SessionEnded(self.claim.session.id, reason),
            RobotChange.CLEARED,
        ]
        self._over, self.claim = self.claim, None
        self._reset(now)

    def _values(self, payloads: Mapping[int, bytes]) -> dict[int, Values]:
        """The effectors' values of a packet.

        Raises:
            PacketError: If one isn't finite or within the effector's limits, or a command's isn't finite; nothing
                of the packet counts then.
        """
        told = {}
        for index, payload in payloads.items():
            shape = self._formats.get(index)
            if shape is not None:
                values, (low, high) = shape.unpack(payload), self._limits[index]
                if not all(low <= value <= high for value in values):
                    raise PacketError(f"values of {self.model.elements[index].name} beyond its limits")
                told[index] = values
            elif index in self._floats:
                command = self._floats[index]
                if not all(map(math.isfinite, command.format.unpack_from(payload, ID.size))):
                    raise PacketError(f"values of {command.name} that aren't finite")
        return told

    def _paced(self, head: Header, ahead: int) -> None:
        """Keep to the local system's T: what its stamps are apart."""
        stamp = head.stamp
        if self._stamp is not None and 0 < ahead < HALF:
            T = 1e-3 * ((stamp - self._stamp) % STAMPS) / ahead
            self._T += 0.25 * (min(max(T, 1e-3), self._config.longest) - self._T)
        self._stamp = stamp

    def _carry_out(
        self,
        claim: SessionClaim,
        head: Header,
        payloads: Mapping[int, bytes],
        told: Mapping[int, Values],
        now: float,
    ) -> None:
        self.heard = now
        if self._lost:
            self._find(told)
        last = claim.session.acknowledged(head)
        self._inbox.heard(last)
        self._telling.measured.acknowledge(last)
        self.packet_round_trip.acknowledged(last, now)
        if head.buffers != self._clears:
            self._clears = head.buffers
            self.streams.clear()
            self.waiting_outputs.append(RobotChange.CLEARED)
        claim.stamp = unwrapped(head.stamp, claim.stamp, STAMPS)
        self.motion.receive(1e-3 * claim.stamp, told, now=now)
        self._told |= told
        commands, stored, asked = [], [], set()
        for index, payload in payloads.items():
            element = self.model.elements[index]
            match element:
                case Effector(stream=size) if size:
                    self.streams.receive(index, payload)
                case Effector():
                    pass
                case Command():
                    number = unwrapped(ID.unpack_from(payload)[0], self._command)
                    commands.append((number, index, payload[ID.size :]))
                case MemoryCommand():
                    stored.append((index, payload))
                case MemoryEvent():
                    self.waiting_outputs += self.memory_outbox.acknowledge(index, payload)
                case _:
                    asked.add(index)
        self._execute(commands)
        if stored:
            self.waiting_outputs += [Stored(*item) for item in self._inbox.receive(stored)]
        self._telling.ask(asked)

    def _execute(self, commands: list[tuple[int, int, bytes]]) -> None:
        """Carry out the commands that are newer than all before, in order."""
        for number, index, values in sorted(commands):
            if number > self._command:
                self._command = number
                self.waiting_outputs.append(Commanded(index, number, values))

    def _up(self, claim: SessionClaim, now: float) -> bytes:
        number = claim.session.number
        payloads: dict[int, bytes] = {}
        self._telling.fill(payloads, number)
        self._fill(payloads, number, now)
        return claim.session.make(PacketType.UP, self.layout.join(payloads), now, min(self.streams.free, 255))

    def _watch(self, now: float) -> None:
        """Rest what rests on loss, and end what is lost for good."""
        if self.claim is None:
            return
        silent = now - self.heard
        if silent >= self._config.lifetime:
            self._end(EndReason.LOST, now)
        elif silent >= self._config.loss and not self._lost:
            self._lost = True
            for index in self._formats:
                if self._rests(index):
                    element = self.model.elements[index]
                    assert isinstance(element, Effector)
                    self.motion.set(index, (element.initial,) * element.count)
                    self._changed.add(index)
            self.waiting_outputs.append(RobotChange.LINK_LOST)

    def _find(self, told: Mapping[int, Values]) -> None:
        """Go on with what was told last: the local system takes it as known; but for what is told anew."""
        self._lost = False
        for index, values in self._told.items():
            if self._rests(index) and index not in told:
                self.motion.set(index, values)
                self._changed.add(index)
        self.waiting_outputs.append(RobotChange.LINK_RESTORED)

    def _rests(self, index: int) -> bool:
        element = self.model.elements[index]
        return isinstance(element, Effector) and element.on_loss is OnLoss.REST

    def _monitor(self, index: int) -> None:
        """Let the monitors of an effector say what it does."""
        for watching in self._telling.monitors.get(index, ()):
            effector = self.model.elements[index]
            assert isinstance(effector, Effector)
            self.measure(watching, effector.pack(self.motion.given(index)))
