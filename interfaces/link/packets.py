"""What became of packets: records, totals, and figures of the newest."""

from __future__ import annotations

import enum
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from interfaces.messages.control import LinkFigures

MAX_RECORDS = 10_000
"""Records kept until they are taken; the oldest are dropped first."""


class LossReason(enum.StrEnum):
    """Why a packet didn't arrive."""

    ON_THE_WAY = "loss"
    """The loss model or the trace took it."""
    QUEUE = "queue"
    """The queue before the bandwidth was full."""
    CAPACITY = "capacity"
    """The emulation holds no more packets."""
    GIVEN_UP = "given-up"
    """It was sent as often as an in-order service may, and lost each time."""


@dataclass(frozen=True, slots=True)
class PacketRecord:
    """One packet, or the second copy of one."""

    number: int
    """Its number among the packets sent in this direction, from 0."""
    size: int
    """Its size [byte]."""
    sent: float
    """When it was sent [s]."""
    arrived: float | None
    """When it was delivered [s]; None when it was lost."""
    lost: LossReason | None = None
    """Why it was lost; None when it arrived."""
    copy: bool = False
    """Whether it is the second copy of a packet."""
    attempts: int = 1
    """How often it was sent: more than once on an in-order service that lost it."""


@dataclass(slots=True)
class Totals:
    """Sums over all packets of one direction.

    sent + copies = arrived + discarded + the losses + those on their way.
    """

    sent: int = 0
    """Packets sent."""
    copies: int = 0
    """Second copies that the link made."""
    arrived: int = 0
    """Deliveries, copies included."""
    discarded: int = 0
    """Second copies that an in-order service discarded."""
    lost: dict[str, int] = field(default_factory=dict)
    """Packets lost, by reason; reasons that didn't occur aren't listed."""
    resent: int = 0
    """Times that an in-order service sent a packet again."""
    bytes_sent: int = 0
    bytes_arrived: int = 0
    delay_mean: float | None = None
    """Mean time between sending and delivery of what arrived [s]; None before the first."""
    delay_min: float | None = None
    """Shortest [s]."""
    delay_max: float | None = None
    """Longest [s]."""
    forgotten: int = 0
    """Records that nobody took in time."""


class PacketLog:
    """Records of packets, bounded, and their totals.

    Args:
        keep: Most records kept until `take`; the totals know of all.
    """

    def __init__(self, keep: int = MAX_RECORDS) -> None:
        self._records: deque[PacketRecord] = deque(maxlen=keep)
        self.sums = Totals()
        """The sums so far, to be added to; see `totals`."""
        self._delay_sum = 0.0
        self.told: Callable[[PacketRecord], None] | None = None
        """Is told what became of each packet, at once."""

    def sent(self, size: int) -> int:
        """Count a packet of `size` bytes that was sent, and return its number, from 0."""
        self.sums.sent += 1
        self.sums.bytes_sent += size
        return self.sums.sent - 1

    def settle(self, record: PacketRecord) -> None:
        """Keep what became of a packet."""
        totals = self.sums
        totals.forgotten += len(self._records) == self._records.maxlen
        self._records.append(record)
        if self.told is not None:
            self.told(record)
        if record.lost is not None:
            totals.lost[record.lost.value] = totals.lost.get(record.lost.value, 0) + 1
        elif record.arrived is not None:
            delay = record.arrived - record.sent
            totals.arrived += 1
            totals.bytes_arrived += record.size
            self._delay_sum += delay
            totals.delay_mean = self._delay_sum / totals.arrived
            totals.delay_min = delay if totals.delay_min is None else min(totals.delay_min, delay)
            totals.delay_max = delay if totals.delay_max is None else max(totals.delay_max, delay)

    def take(self) -> tuple[PacketRecord, ...]:
        """Hand over the records since the last call, in the order in which they became known."""
        records = tuple(self._records)
        self._records.clear()
        return records

    def totals(self) -> Totals:
        """The sums so far."""
        return replace(self.sums, lost=dict(sorted(self.sums.lost.items())))


WINDOW = 30.0
"""How far back is measured [s]."""
MOST = 4096
"""Packets that are kept, at most."""


class Gauge:
    """Remembers what became of the newest packets; `add` fits `PacketLog.told`."""

    def __init__(self) -> None:
        self._known: deque[PacketRecord] = deque(maxlen=MOST)
        self.since = -math.inf
        """Only packets that were sent from here on count [s]."""

    def add(self, record: PacketRecord) -> None:
        """Take in what became of a packet; second copies don't count."""
        if not record.copy:
            self._known.append(record)

    def measured(self, *, now: float) -> LinkFigures:
        """What is known of the packets of the last 30 s.

        Losses are counted among those that were sent in that time. A packet that is lost is known at once, one that
        arrives only then: what lies between the numbers that are known is under way, and isn't lost. Delays are of
        those that arrived in that time.

        Args:
            now: Time [s].
        """
        oldest = now - WINDOW
        known = [record for record in self._known if record.sent >= self.since]
        sent = [record for record in known if record.sent >= oldest]
        numbers = [record.number for record in sent]
        packets = max(numbers) - min(numbers) + 1 if numbers else 0
        lost = sum(record.arrived is None for record in sent) / packets if packets else None
        delays = sorted(r.arrived - r.sent for r in known if r.arrived is not None and r.arrived >= oldest)
        span = max(0.0, min(WINDOW, now - self.since))
        return LinkFigures(packets, lost, _quantile(delays, 0.5), _quantile(delays, 0.95), span)


def _quantile(values: list[float], share: float) -> float | None:
    """The smallest of ascending values that a share of them doesn't exceed."""
    return values[max(0, math.ceil(share * len(values)) - 1)] if values else None
