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
class Measured:
    """Sums over the newest packets of which the fate is known."""

    packets: int
    lost: float | None
    """Share of them that was lost; None of none."""
    median: float | None
    """Of the time between sending and delivery of those that arrived [s]; None where none did."""
    p95: float | None
    """Delay that 95 % of those kept within [s]."""


class Gauge:
    """Remembers what became of the newest packets; `add` fits `PacketLog.told`."""

    def __init__(self) -> None:
        self._known: deque[tuple[float, float | None]] = deque(maxlen=MOST)
        self.since = -math.inf
        """Only packets that were sent from here on count [s]."""

    def add(self, record: PacketRecord) -> None:
        """Take in what became of a packet; second copies don't count."""
        if not record.copy:
            self._known.append((record.sent, None if record.arrived is None else record.arrived - record.sent))

    def measured(self, *, now: float) -> Measured:
        """What is known of the packets whose fate was sealed in the last 30 s.

        Args:
            now: Time [s].
        """
        since, oldest = self.since, now - WINDOW
        counts = [delay for sent, delay in self._known if sent >= since and sent + (delay or 0.0) >= oldest]
        delays = sorted(delay for delay in counts if delay is not None)
        lost = 1.0 - len(delays) / len(counts) if counts else None
        return Measured(len(counts), lost, _quantile(delays, 0.5), _quantile(delays, 0.95))


def _quantile(values: list[float], share: float) -> float | None:
    """The smallest of ascending values that a share of them doesn't exceed."""
    return values[max(0, math.ceil(share * len(values)) - 1)] if values else None
