"""The local system's side of RSP: the simulacrum, and the packets that keep the robot's equal to it.

A state machine of values: datagrams and times in, datagrams and outputs out. It knows no socket and no clock.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Final

from typing_extensions import override

from interfaces.rsp import handshake
from interfaces.rsp.errors import RspError
from interfaces.rsp.handshake import Open
from interfaces.rsp.header import MODULUS, Header, PacketType
from interfaces.rsp.layout import ID, PacketDirection
from interfaces.rsp.model.elements import Effector, Event, MemoryCommand, MemoryEvent, RobotModel
from interfaces.rsp.motion_filter import Fastest
from interfaces.rsp.outbox import CommandOutbox, StreamOutbox, ValueOutbox
from interfaces.rsp.outputs import (
    Began,
    EndReason,
    LocalOutput,
    Occurred,
    Refused,
    SessionCore,
    SessionEnded,
    Stored,
    Told,
)
from interfaces.rsp.session import (
    SLACK,
    TAG,
    DropReason,
    Keyring,
    PacketCipher,
    PacketDropped,
    Rank,
    SessionNumbers,
    milliseconds,
)
from vrs.checks import validated, within
from vrs.errors import InvalidValueError


@dataclass(frozen=True, slots=True)
@validated
class PeriodConfig:
    """Within what T is chosen."""

    least: Annotated[float, within(1e-3, 1.0)] = 0.02
    """T on a good link [s], in [0.001, 1]."""
    most: Annotated[float, within(1e-3, 1.0)] = 0.2
    """T at most [s], from `least` to 1."""
    adaptive: bool = True
    """Whether it's fitted at all."""
    window: Annotated[float, within(0.1, 60.0)] = 0.5
    """Over how long a least round trip is taken [s], in [0.1, 60]."""
    base: Annotated[float, within(1.0, 3600.0)] = 60.0
    """Over how long the link's own is looked for [s], in [1, 3600]."""
    queue: Annotated[float, within(1e-3, 10.0)] = 0.05
    """Standing queue that is too long [s], in [0.001, 10]."""
    longer: Annotated[float, within(1.0, 4.0)] = 1.5
    """What T is multiplied by then, in (1, 4]."""
    shorter: Annotated[float, within(0.1, 1.0)] = 0.9
    """And otherwise, in [0.1, 1)."""
    steps: Annotated[int, within(1, 20)] = 8
    """Windows at the longest T in which the queue must have fallen, 1 to 20."""
    rest: Annotated[float, within(0.0, 3600.0)] = 20.0
    """How long T is left at its least after it hadn't [s], in [0, 3600]."""

    def __post_init__(self) -> None:
        if self.most < self.least:
            raise InvalidValueError("most", self.most, f"at least {self.least:g} s, the least period")


class PeriodControl:
    """Chooses T, the period at which a local system sends, to fit the link while it runs; it knows no clock.

    What a sender can change of a link is the queue that it makes itself. The least round trip over half a second,
    less the least over the last minute, is what always waits in queues, whatever the jitter. While that is too
    much and doesn't fall, the period is made longer; where it's little, shorter again, down to what was asked for.
    A link that is slow by itself doesn't get better by fewer packets: if the longest period hasn't helped, the
    least one is taken for a while.
    """

    def __init__(self, config: PeriodConfig | None = None) -> None:
        """Begin with the least period."""
        self._config = PeriodConfig() if config is None else config
        self.T = self._config.least
        """Period [s]."""
        self._base = Fastest(self._config.base)
        self._least = math.inf
        self._until = -math.inf
        self._tried = 0
        self._before = math.inf
        self._rest = self._since = -math.inf

    def round_trip(self, seconds: float, *, now: float) -> None:
        """Take a packet's round trip [s], known at a time [s]."""
        config = self._config
        if not config.adaptive:
            return
        if self._until == -math.inf:
            self._until = now + config.window
        self._base.add(seconds, now)
        self._least = min(self._least, seconds)
        if now < self._until:
            return
        least, self._least = self._least, math.inf
        queue = least - self._base.value
        self._until = now + config.window
        falls, self._before = queue < 0.8 * self._before, queue
        if queue <= config.queue:
            self.T, self._tried = max(config.least, config.shorter * self.T), 0
        elif now >= self._rest and not falls:
            self._slow_down(least, now)

    def _slow_down(self, round_trip: float, now: float) -> None:
        """Make the period longer; at its longest give up when that doesn't help, once it could have been seen."""
        config = self._config
        if config.most > self.T:
            self._since = now
        self._tried = self._tried + 1 if config.most <= self.T else 0
        self.T = min(config.most, config.longer * self.T)
        if self._tried >= config.steps and now - self._since > 2 * round_trip:
            self.T, self._tried, self._rest = config.least, 0, now + config.rest


MOST_PATIENCE: Final = 600.0
"""Most of a local system's patience [s]."""


class LocalState(enum.StrEnum):
    """Where a local system is."""

    CLOSED = "closed"
    OPENING = "opening"
    OPEN = "open"
    ENDING = "ending"


@dataclass(frozen=True, slots=True)
@validated
class LocalConfig:
    """How a local system sends."""

    period: PeriodConfig = field(default_factory=PeriodConfig)
    """T, and how it's fitted."""
    retry: Annotated[float, within(0.01, 10.0, "s")] = 0.25
    """How often it asks for a session, or for its end [s], in [0.01, 10]."""
    patience: Annotated[float, within(0.1, MOST_PATIENCE, "s")] = 5.0
    """After so long without an answer it gives up asking [s], in [0.1, 600]."""
    lifetime: Annotated[float, within(1.0, 120.0, "s")] = 60.0
    """A session in which nothing came for so long is lost [s], in [1, 120]: numbers mustn't go round in a
    silence."""
    timeout: Annotated[float, within(1e-3, 10.0, "s")] = 0.1
    """Least time before a memory command is sent again [s], in [0.001, 10]; twice the round trip where that's
    more."""


class LocalCore(SessionCore[LocalOutput]):
    """The local system of one robot."""

    way = PacketDirection.DOWN

    def __init__(
        self,
        model: RobotModel,
        random_bytes: Callable[[int], bytes],
        config: LocalConfig | None = None,
        *,
        keys: Keyring | None = None,
        rank: Rank = Rank.OPERATOR,
    ) -> None:
        """Begin closed.

        Args:
            model: Of the robot.
            random_bytes: So many bytes that nobody can guess.
            config: How it sends.
            keys: Packets are sealed with these, and only sealed ones are taken; without, all is in the clear.
            rank: As whom it opens.

        Raises:
            InvalidValueError: If the keys have none for that rank.
        """
        if keys is not None and rank not in keys:
            raise InvalidValueError("rank", rank.name.lower(), "one that there's a key for")
        self._config = LocalConfig() if config is None else config
        super().__init__(model, self._config.timeout, sealed=keys is not None)
        self._keys, self._rank, self._random = keys, rank, random_bytes
        self.state = LocalState.CLOSED
        self.period = PeriodControl(self._config.period)
        self.opening = Open(rank, False, bytes(TAG))
        self.numbers: SessionNumbers | None = None
        """Of the session; None where there's none."""
        self._next = self._until = math.inf
        self._heard = -math.inf
        self._active: set[int] = set()
        self._requested: set[int] = set()
        self._reset()

    def _reset(self) -> None:
        self._renew()
        self.command_outbox = CommandOutbox()
        self._values = ValueOutbox()
        self._events: dict[int, int] = {}
        self._clears = 0
        self.streams = StreamOutbox(self.model.buffers)

    @property
    def round_trip(self) -> float | None:
        """Smoothed, the robot's own period included [s]; None before the first."""
        return self.packet_round_trip.smoothed

    # What the simulacrum is told.

    def open(self, *, now: float, takeover: bool = False) -> None:
        """Ask for a session.

        Args:
            now: [s].
            takeover: Whether another's session is to end for it; with keys only an admin may.

        Raises:
            RspError: If there is one, or it's asked for.
        """
        if self.state is not LocalState.CLOSED:
            raise RspError(f"the session is {self.state.value} already")
        self._reset()
        self.opening = Open(self._rank, takeover, self._random(TAG))
        self.state, self.numbers = LocalState.OPENING, SessionNumbers(self.model.id, 0)
        self._next, self._until = now, now + self._config.patience

    def end(self, *, now: float) -> None:
        """End the session; what isn't acknowledged by now is reported as failed."""
        if self.state is LocalState.OPEN:
            self.state, self._next, self._until = LocalState.ENDING, now, now + self._config.patience
        elif self.state is LocalState.OPENING:
            self._close(EndReason.CLOSED)

    def write(self, index: int, payload: bytes) -> None:
        """Set an effector's values, as they are on the wire."""
        self._values.put(index, payload)

    def activate(self, index: int, on: bool) -> None:
        """Let an effector's values be in every packet, or only until the robot has them."""
        (self._active.add if on else self._active.discard)(index)

    def request(self, index: int, on: bool) -> None:
        """Ask for a sensor, a monitor, an event or a module's members from now on, or no more."""
        (self._requested.add if on else self._requested.discard)(index)

    def command(self, index: int, values: bytes) -> int:
        """Give a command; returns its ID, by which it's settled.

        Raises:
            FullError: If too many wait.
        """
        return self.command_outbox.put(index, values)

    def play(self, index: int, data: bytes) -> None:
        """Send data to a stream.

        Raises:
            FullError: If too much waits.
        """
        element = self.model.elements[index]
        assert isinstance(element, Effector)
        self.streams.put(index, data, element.stream)

    def clear(self) -> None:
        """Drop what waits to be played, here and at the robot."""
        self._clears = (self._clears + 1) % 256
        self.streams.clear()

    # Packets.

    def to_send(self, *, now: float) -> list[bytes]:
        """Datagrams that are due by now [s]."""
        self.waiting_outputs += self.memory_outbox.expire(now)
        if self.state is LocalState.OPEN and now - self._heard >= self._config.lifetime:
            self._close(EndReason.LOST)
        if self.state is LocalState.CLOSED or now < self._next - SLACK:
            return []
        session = self.numbers
        assert session is not None
        if self.state is not LocalState.OPEN and now >= self._until:
            self._close(EndReason.CLOSED if self.state is LocalState.ENDING else EndReason.LOST)
            return []
        if self.state is LocalState.OPENING:
            self._next = now + self._config.retry
            head = Header(self.model.id, False, PacketType.OPEN, 0, milliseconds(now), 0, MODULUS - 1, 0)
            return [
                handshake.sent(PacketType.OPEN, handshake.encode_open(self.opening), head, self._keys, self._rank)
            ]
        if self.state is LocalState.ENDING:
            self._next = now + self._config.retry
            return [session.make(PacketType.END, b"", now)]
        # From the time that was due, so that T is kept; not from one long past.
        self._next = max(self._next + self.period.T, now + 0.5 * self.period.T)
        return [self._down(session, now)]

    def next_deadline(self) -> float | None:
        """When something is to be sent [s]; None while closed."""
        return None if self.state is LocalState.CLOSED else self._next

    def _down(self, session: SessionNumbers, now: float) -> bytes:
        number = session.number
        payloads: dict[int, bytes] = dict.fromkeys(self._requested, b"")
        self._values.fill(payloads, number, self._values.unknown | self._active)
        self.command_outbox.fill(payloads, number)
        self._fill(payloads, number, now)
        self.streams.fill(payloads, number, self.layout.left(payloads))
        return session.make(PacketType.DOWN, self.layout.join(payloads), now, self._clears)

    @override
    def _receive(self, head: Header, data: bytes, address: bytes, now: float) -> None:
        session = self.numbers
        if session is None or head.type not in _EXPECTED[self.state]:
            raise PacketDropped(DropReason.UNEXPECTED)
        if self.state is LocalState.OPENING:
            self._answered(head, data, now)
            return
        if head.session != session.id:
            raise PacketDropped(DropReason.SESSION)
        body, number = session.take(head, data)
        if head.type is PacketType.ENDED:
            session.newest, self._heard = number, now
            self._close(EndReason.CLOSED if self.state is LocalState.ENDING else EndReason.TAKEN)
            return
        payloads = self.layout.split(body, PacketDirection.UP)
        session.newest, self._heard = number, now
        self._acknowledged(session.acknowledged(head), head, now)
        self._told(payloads)

    def _answered(self, head: Header, data: bytes, now: float) -> None:
        """Take an answer of the handshake."""
        body, rank = handshake.received(data, self._keys, (self._rank,))
        if rank is None:
            raise PacketDropped(DropReason.AUTHENTICATION)
        if head.type is PacketType.REFUSED:
            nonce, refusal = handshake.decode_refused(body)
            if nonce != self.opening.nonce:
                raise PacketDropped(DropReason.SESSION)
            self.waiting_outputs.append(Refused(refusal))
            self.state, self.numbers = LocalState.CLOSED, None
            return
        nonce, given = handshake.decode_answer(body)
        if nonce != self.opening.nonce:
            raise PacketDropped(DropReason.SESSION)
        if head.type is PacketType.CHALLENGE:
            if self.opening.cookie == handshake.NO_COOKIE:
                # Somebody is there: the second round trip has as much time as the first.
                self._until = now + self._config.patience
            if self.opening.cookie != given:
                self.opening, self._next = self.opening._replace(cookie=given), now
            return
        cipher = None
        if self._keys is not None:
            down, up = self._keys.session(self._rank, nonce + given, head.session)
            cipher = PacketCipher(down, up)
        self.numbers = SessionNumbers(self.model.id, head.session, cipher)
        self.state, self._heard, self._next = LocalState.OPEN, now, now
        self.waiting_outputs.append(Began(head.session))

    def _acknowledged(self, last: int, head: Header, now: float) -> None:
        """Take what the robot has of ours."""
        self.waiting_outputs += self.command_outbox.acknowledge(last)
        self._inbox.heard(last)
        self.streams.report(head.buffers, last)
        self._values.acknowledge(last)
        seconds = self.packet_round_trip.acknowledged(last, now)
        if seconds is not None:
            self.period.round_trip(seconds, now=now)

    def _told(self, payloads: dict[int, bytes]) -> None:
        stored = []
        for index, payload in payloads.items():
            element = self.model.elements[index]
            match element:
                case MemoryCommand():
                    self.waiting_outputs += self.memory_outbox.acknowledge(index, payload)
                case MemoryEvent():
                    stored.append((index, payload))
                case Event():
                    self._occurred(index, payload)
                case _:
                    self.waiting_outputs.append(Told(index, payload))
        self.waiting_outputs += [Stored(*item) for item in self._inbox.receive(stored)] if stored else []

    def _occurred(self, index: int, payload: bytes) -> None:
        """An event comes several times; its ID says which it is."""
        number = ID.unpack_from(payload)[0]
        ahead = (number - self._events.get(index, MODULUS - 1)) % MODULUS
        if 0 < ahead < MODULUS // 2:
            self._events[index] = number
            self.waiting_outputs.append(Occurred(index, number, payload[ID.size :]))

    def _close(self, reason: EndReason) -> None:
        session = 0 if self.numbers is None else self.numbers.id
        self.waiting_outputs += [
            *self.command_outbox.drain(),
            *self.memory_outbox.drain(),
            SessionEnded(session, reason),
        ]
        self.state, self.numbers = LocalState.CLOSED, None


_EXPECTED: Final = {
    LocalState.CLOSED: frozenset[PacketType](),
    LocalState.OPENING: frozenset({PacketType.CHALLENGE, PacketType.OPENED, PacketType.REFUSED}),
    LocalState.OPEN: frozenset({PacketType.UP, PacketType.ENDED}),
    LocalState.ENDING: frozenset({PacketType.ENDED}),
}
"""What comes in each state."""
