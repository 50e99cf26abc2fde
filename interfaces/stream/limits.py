"""How much a client may send, how much may wait for it, and how many connections may stay unauthenticated."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Annotated, Generic, TypeVar

from interfaces.stream.codec import Encoding, Value
from vrs.checks import number_in, validated, within


@dataclass(frozen=True, slots=True)
@validated
class ClientLimits:
    """Bounds of one client, and of all."""

    clients: Annotated[int, within(1, 100_000)] = 1024
    """Most clients at once, 1 to 100,000."""
    size: Annotated[int, within(256, 1 << 20)] = 65536
    """Largest message of a client [bytes], 256 to 1,048,576."""
    rate: Annotated[float, within(1, 1e5)] = 500.0
    """Messages a second that a client may send for long, 1 to 100,000."""
    burst: Annotated[float, within(1, 1e5)] = 1000.0
    """Messages that it may send at once, 1 to 100,000."""
    excess: Annotated[float, within(1, 1e5)] = 100.0
    """Messages beyond that, passed over, before it's closed, 1 to 100,000; a tenth is forgiven a second."""
    bad: Annotated[float, within(1, 1000)] = 20.0
    """Messages that can't be taken before it's closed, 1 to 1000; one a second is forgiven."""
    hello: Annotated[float, within(0.1, 60)] = 2.0
    """Time for the first message [s], 0.1 to 60."""
    waiting: Annotated[int, within(1024, 1 << 24)] = 131072
    """Bytes that may wait for a client before what's for it is dropped, 1024 to 16,777,216."""
    absence: Annotated[float, within(0, 3600)] = 30.0
    """How long after its connection was lost an operator's session can be continued [s], 0 to 3600."""
    sharers: Annotated[int, within(0, 1000)] = 8
    """Most sessions that share one lease with its holder, 0 to 1000."""
    absent: Annotated[int, within(0, 100_000)] = 64
    """Most sessions that are kept so; the oldest goes first, 0 to 100,000."""
    work: Annotated[float, within(1e-3, 1)] = 0.03
    """Share of the processor's time that a client's messages may take for long, 0.001 to 1."""
    volume: Annotated[float, within(1e4, 1e9)] = 4e6
    """Bytes a second that it may be answered for long, 1e4 to 1e9."""
    address: Annotated[float, within(1, 1000)] = 8.0
    """So many times as much may all clients of an address take that don't command, 1 to 1000."""
    others: Annotated[float, within(1, 1000)] = 10.0
    """The same of all clients that don't command, 1 to 1000."""
    commands: Annotated[float, within(1, 1000)] = 15.0
    """The same of each client that commands, 1 to 1000."""


class Bucket:
    """Tokens that come at a rate, up to so many: who takes one may go on."""

    __slots__ = ("_at", "_rate", "_tokens", "most")

    def __init__(self, rate: float, most: float, now: float) -> None:
        """Begin full.

        Args:
            rate: Tokens a second.
            most: Most tokens that are kept.
            now: [s].
        """
        self._rate, self.most, self._tokens, self._at = rate, most, most, now

    def take(self, now: float) -> bool:
        """Take a token at now [s]; whether there was one."""
        if now > self._at:
            self._tokens = min(self.most, self._tokens + self._rate * (now - self._at))
            self._at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True


AT_ONCE = 2.0
"""What comes in this time [s] may be spent at once."""
COMMON = 0.2
"""The same of what many share [s]: so long may a crowd hold up nobody else."""


class Allowance:
    """Processor time and bytes that come at a rate; what's spent is known afterwards: waiting makes up for it."""

    __slots__ = ("_at", "_burst", "_rates", "_shared", "_spent")

    def __init__(
        self, work: float, volume: float, now: float, *, burst: float = AT_ONCE, shared: tuple[Allowance, ...] = ()
    ) -> None:
        """Begin with nothing spent.

        Args:
            work: Share of the processor's time.
            volume: Bytes a second.
            now: [s].
            burst: What comes in this time may be spent at once [s].
            shared: What is spent with it, and waited for: others' allowances, too.
        """
        self._rates, self._burst, self._at, self._shared = (work, volume), burst, now, shared
        self._spent = [0.0, 0.0]

    def spend(self, work: float, size: float, *, now: float) -> None:
        """Take processor time [s] and bytes."""
        past, self._at = max(now - self._at, 0.0), max(now, self._at)
        for kind, (rate, taken) in enumerate(zip(self._rates, (work, size), strict=True)):
            self._spent[kind] = max(self._spent[kind] - rate * past, 0.0) + taken
        for allowance in self._shared:
            allowance.spend(work, size, now=now)

    def wait(self, *, now: float) -> float:
        """How long until something may be spent again [s]; 0 for now."""
        past = max(now - self._at, 0.0)
        debts = (spent / rate - past - self._burst for spent, rate in zip(self._spent, self._rates, strict=True))
        return max(0.0, *debts, *(allowance.wait(now=now) for allowance in self._shared))


class Allowances:
    """What each client may spend, and those of an address, and all, together; who commands waits for nobody."""

    def __init__(self, limits: ClientLimits, now: float) -> None:
        """Begin with nothing spent, at now [s]."""
        self._limits = limits
        self._others = self._of(limits.others, now, COMMON)
        self._addresses: dict[str, tuple[Allowance, int]] = {}

    def _of(
        self, times: float, now: float, burst: float = AT_ONCE, shared: tuple[Allowance, ...] = ()
    ) -> Allowance:
        return Allowance(times * self._limits.work, times * self._limits.volume, now, burst=burst, shared=shared)

    def join(self, address: str, *, now: float) -> tuple[Allowance, Allowance]:
        """Give a client of an address what it may spend: while it doesn't command, and while it does."""
        shared, clients = self._addresses.get(address) or (self._of(self._limits.address, now, COMMON), 0)
        self._addresses[address] = shared, clients + 1
        return self._of(1.0, now, shared=(shared, self._others)), self._of(self._limits.commands, now)

    def leave(self, address: str) -> None:
        """Take it back."""
        shared, clients = self._addresses.pop(address)
        if clients > 1:
            self._addresses[address] = shared, clients - 1


C = TypeVar("C", bound=Hashable)


class Strangers(Generic[C]):
    """Connections of one door: which are still unauthenticated, and by when each must have done its next step.

    A new connection always gets in: if there are too many strangers, one of them gives way, the oldest of those
    whose address has at least its share of the room. Who is known (`know`) never gives way.
    """

    def __init__(self, most: int) -> None:
        """Begin with nobody.

        Args:
            most: Most strangers at a time, 1 to 100,000.
        """
        self.most = int(number_in("most", most, 1, 100_000))
        self._addresses: dict[C, str] = {}
        """Of each stranger, the oldest first."""
        self._each: Counter[str] = Counter()
        self._until: dict[C, float] = {}
        self.gave_way = 0
        """Strangers that gave way to newer ones."""

    def __iter__(self) -> Iterator[C]:
        return iter(tuple(self._addresses))

    def __len__(self) -> int:
        return len(self._addresses)

    def add(self, connection: C, address: str, *, until: float) -> C | None:
        """Take a connection; the one that is to be cut off for it, if one is.

        Args:
            connection: A new one.
            address: Where it comes from.
            until: When its next step must be done [s].
        """
        gives_way = self._oldest(address) if len(self._addresses) >= self.most else None
        if gives_way is not None:
            self.gave_way += 1
            self.discard(gives_way)
        self._addresses[connection] = address
        self._each[address] += 1
        self._until[connection] = until
        return gives_way

    def _oldest(self, coming: str) -> C:
        share = self.most / (len(self._each) + (coming not in self._each))
        return next(one for one, address in self._addresses.items() if self._each[address] >= share)

    def expect(self, connection: C, *, until: float = math.inf) -> None:
        """Set when a connection's next step must be done [s]; infinity where nothing is waited for."""
        if connection in self._until:
            self._until[connection] = until

    def renew(self, connection: C, *, until: float = math.inf) -> None:
        """Count a stranger as the newest, for it has done a step; then as `expect`."""
        address = self._addresses.pop(connection, None)
        if address is not None:
            self._addresses[connection] = address
        self.expect(connection, until=until)

    def know(self, connection: C) -> None:
        """Note that a connection has shown who it is: it's no stranger any more, and nothing is waited for."""
        self._forget(connection)
        self.expect(connection)

    def discard(self, connection: C) -> None:
        """Note that a connection is gone."""
        self._forget(connection)
        self._until.pop(connection, None)

    def _forget(self, connection: C) -> None:
        address = self._addresses.pop(connection, None)
        if address is not None:
            self._each[address] -= 1
            if not self._each[address]:
                del self._each[address]

    def overdue(self, now: float) -> list[C]:
        """The connections that haven't done their step in time; they are to be cut off.

        Args:
            now: [s].
        """
        return [connection for connection, until in self._until.items() if until <= now]


BATCH = 16384
"""Bytes beyond which nothing more is taken at once."""


class Outbox:
    """Messages in their order, and behind them the newest of each kind of which only the newest counts.

    What finds no room is dropped, and counted: the client asks for it again.
    """

    __slots__ = ("_encode", "_encoding", "_limit", "_newest", "_queue", "_waiting", "dropped", "total")

    def __init__(self, encode: Callable[[Value, Encoding], bytes], encoding: Encoding, limit: int) -> None:
        """Begin empty.

        Args:
            encode: Writes a message; that of a `SharedEncoder`, where many clients get the same.
            encoding: The client's.
            limit: Bytes that may wait, but for a message that waits alone.
        """
        self._encode, self._encoding, self._limit = encode, encoding, limit
        self._queue: deque[bytes] = deque()
        self._newest: dict[type[Value], Value] = {}
        self._waiting = 0
        self.dropped = 0
        """Messages that found no room."""
        self.total = 0
        """Bytes that were put so far, without those of which only the newest counts."""

    def __bool__(self) -> bool:
        return bool(self._queue or self._newest)

    @property
    def waiting(self) -> int:
        """Bytes that wait, without those of which only the newest counts."""
        return self._waiting

    @property
    def is_full(self) -> bool:
        """Whether there's no room for anything."""
        return self._waiting >= self._limit

    def put(self, message: Value) -> bool:
        """Put a message behind those that wait; whether there was room. For one alone there always is."""
        data = b"" if self.is_full else self._encode(message, self._encoding)
        if self.is_full or (self._queue and self._waiting + len(data) > self._limit):
            self.dropped += 1
            return False
        self._queue.append(data)
        self._waiting += len(data)
        self.total += len(data)
        return True

    def put_newest(self, message: Value) -> None:
        """Put a message in the place of what's there of its kind."""
        self._newest[type(message)] = message

    def take(self) -> tuple[bytes, ...]:
        """Take what is sent next: some 16 KiB of what waits, or if that's all, the newest too."""
        found: list[bytes] = []
        size = 0
        while self._queue and size < BATCH:
            data = self._queue.popleft()
            size += len(data)
            found.append(data)
        self._waiting -= size
        if not self._queue and self._newest:
            found.extend(self._encode(message, self._encoding) for message in self._newest.values())
            self._newest.clear()
        return tuple(found)
