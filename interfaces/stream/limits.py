"""How much a client may send, and how much may wait for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from vrs.checks import validated, within


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

    __slots__ = ("_at", "_most", "_rate", "_tokens")

    def __init__(self, rate: float, most: float, now: float) -> None:
        """Begin full.

        Args:
            rate: Tokens a second.
            most: Most tokens that are kept.
            now: [s].
        """
        self._rate, self._most, self._tokens, self._at = rate, most, most, now

    def take(self, now: float) -> bool:
        """Take a token at now [s]; whether there was one."""
        if now > self._at:
            self._tokens = min(self._most, self._tokens + self._rate * (now - self._at))
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

    __slots__ = ("_at", "_burst", "_rates", "_spent")

    def __init__(self, work: float, volume: float, now: float, *, burst: float = AT_ONCE) -> None:
        """Begin with nothing spent.

        Args:
            work: Share of the processor's time.
            volume: Bytes a second.
            now: [s].
            burst: What comes in this time may be spent at once [s].
        """
        self._rates, self._burst, self._at = (work, volume), burst, now
        self._spent = [0.0, 0.0]

    def spend(self, work: float, size: float, *, now: float) -> None:
        """Take processor time [s] and bytes."""
        past, self._at = max(now - self._at, 0.0), max(now, self._at)
        for kind, (rate, taken) in enumerate(zip(self._rates, (work, size), strict=True)):
            self._spent[kind] = max(self._spent[kind] - rate * past, 0.0) + taken

    def wait(self, *, now: float) -> float:
        """How long until something may be spent again [s]; 0 for now."""
        past = max(now - self._at, 0.0)
        debts = (spent / rate - past - self._burst for spent, rate in zip(self._spent, self._rates, strict=True))
        return max(0.0, *debts)


class Allowances:
    """What each client may spend, and those of an address, and all, together; who commands waits for nobody."""

    def __init__(self, limits: ClientLimits, now: float) -> None:
        """Begin with nothing spent, at now [s]."""
        self._limits = limits
        self._others = self._of(limits.others, now, COMMON)
        self._addresses: dict[str, tuple[Allowance, int]] = {}

    def _of(self, times: float, now: float, burst: float = AT_ONCE) -> Allowance:
        return Allowance(times * self._limits.work, times * self._limits.volume, now, burst=burst)

    def join(self, address: str, *, now: float) -> Spending:
        """Give a client of an address what it may spend."""
        shared, clients = self._addresses.get(address) or (self._of(self._limits.address, now, COMMON), 0)
        self._addresses[address] = shared, clients + 1
        return Spending(self._of(1.0, now), self._of(self._limits.commands, now), (shared, self._others))

    def leave(self, address: str) -> None:
        """Take it back."""
        shared, clients = self._addresses.pop(address)
        if clients > 1:
            self._addresses[address] = shared, clients - 1


class Spending:
    """What one client may spend."""

    __slots__ = ("_commanding", "_own", "_shared")

    def __init__(self, own: Allowance, commanding: Allowance, shared: tuple[Allowance, ...]) -> None:
        self._own, self._commanding, self._shared = own, commanding, shared

    def _counts(self, commands: bool) -> tuple[Allowance, ...]:
        return (self._commanding,) if commands else (self._own, *self._shared)

    def spend(self, work: float, size: float, *, commands: bool, now: float) -> None:
        """Take processor time [s] and bytes, for one that commands or doesn't."""
        for allowance in self._counts(commands):
            allowance.spend(work, size, now=now)

    def wait(self, *, commands: bool, now: float) -> float:
        """How long it has to wait before its next message is looked at [s]."""
        return max(allowance.wait(now=now) for allowance in self._counts(commands))
