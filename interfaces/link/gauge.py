"""What one direction of a link does to packets, as it was measured on the newest of them."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from interfaces.link.packets import PacketRecord

WINDOW = 30.0
"""How far back is measured [s]."""
MOST = 4096
"""Packets that are kept, at most."""


@dataclass(frozen=True, slots=True)
class LinkFigures:
    """Sums over the newest packets."""

    packets: int
    """So many were sent, those that are still under way among them."""
    lost: float | None
    """Share of them that was lost; None of none."""
    median: float | None
    """Of the time between sending and delivery of those that arrived [s]; None where none did."""
    p95: float | None
    """Delay that 95 % of those kept within [s]."""
    span: float | None = None
    """Over how long they were sent, up to now [s]; None where that isn't known."""


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
