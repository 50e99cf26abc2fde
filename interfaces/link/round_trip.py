"""Round trips and relative one-way delays: probes, their echoes, and what these say about the link.

The prober sends `Probe`s, the other side answers each with `Probe.echo`, the prober matches them. The stamps are
NTP's: t0 sent by A, t1 received by B, t2 sent by B, t3 received by A; t0 and t3 in A's clock, t1 and t2 in B's.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Annotated

from interfaces.link.quantiles import LARGEST, MAX_CAPACITY, SlidingQuantiles
from vrs.checks import at_least, finite, not_before, positive, validated, within
from vrs.errors import InvalidValueError

SEQUENCE_NUMBERS = 1 << 16
"""Sequence numbers run from 0 to one less than this, and begin again."""
SESSIONS = 1 << 32


@dataclass(frozen=True, slots=True)
class Probe:
    """A question that the other side answers at once."""

    session: int
    """Who asks, in [0, 2**32): random, so that echoes of an earlier life aren't taken for ours."""
    sequence: int
    """In [0, 65536), wrapping."""
    sent: float
    """t0: time of sending in the prober's clock [s]."""

    def echo(self, received: float, replied: float | None = None) -> Echo:
        """Answer the probe.

        The two stamps must belong to one unbroken run of the clock: read it once (the default), or add the time
        since then of a clock that doesn't step. A step between them would look like a faster link.

        Args:
            received: t1, time of arrival in the answering side's clock [s].
            replied: t2, time of answering in the same clock [s], ≥ received; by default received.
        """
        return Echo(self.session, self.sequence, self.sent, received, received if replied is None else replied)


@dataclass(frozen=True, slots=True)
class Echo:
    """The answer to a probe."""

    session: int
    sequence: int
    sent: float
    """t0, as the probe had it [s]."""
    received: float
    """t1 in the answering side's clock [s]."""
    replied: float
    """t2 in the answering side's clock [s]."""


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """A probe that came back."""

    sent: float
    """t0 [s]."""
    received: float
    """t1 [s], in the other side's clock."""
    replied: float
    """t2 [s], in the other side's clock, ≥ received."""
    arrived: float
    """t3 [s], ≥ sent."""

    @property
    def delay(self) -> float:
        """Time on the link, there and back [s], ≥ 0: (t3 − t0) − (t2 − t1)."""
        return max(0.0, (self.arrived - self.sent) - (self.replied - self.received))


class EchoRefusal(enum.StrEnum):
    """Why an echo was of no use."""

    FOREIGN = "foreign"
    """It answers somebody else's probe."""
    UNEXPECTED = "unexpected"
    """No such probe is in flight: a duplicate, or later than the timeout."""
    IMPOSSIBLE = "impossible"
    """Its stamps can't be true: not finite, beyond 1e12 s, answered before received, or held longer than away."""


@dataclass(frozen=True, slots=True)
@validated
class WindowConfig:
    """What statistics of delays look back on."""

    capacity: Annotated[int, within(1, MAX_CAPACITY)] = 1000
    """Most delays kept, in [1, 100,000]."""
    horizon: float = 60.0
    """Age at which a delay is forgotten [s], > 0; infinite for never."""
    smoothing: Annotated[float, at_least(1.0, "a finite number of messages, at least 1")] = 16.0
    """Time constant of the jitter [messages], ≥ 1; RFC 3550 has 16."""

    def __post_init__(self) -> None:
        if not self.horizon > 0:
            raise InvalidValueError("horizon", self.horizon, "seconds > 0")


@dataclass(frozen=True, slots=True)
@validated
class ProbeConfig:
    """How a link is probed."""

    period: Annotated[float, positive("finite seconds > 0")] = 0.1
    """Time between probes [s], > 0."""
    timeout: Annotated[float, positive("finite seconds > 0")] = 5.0
    """Time after which a probe counts as lost [s], > 0; a later echo is refused."""
    most_in_flight: Annotated[int, within(1, SEQUENCE_NUMBERS // 2)] = 256
    """Most probes that wait for their echo, in [1, 32768]; no more are sent meanwhile."""
    window: WindowConfig = field(default_factory=WindowConfig)
    """What the statistics look back on."""


class DelayStatistics(SlidingQuantiles):
    """Quantiles, mean and jitter of a run of delays [s], all of one kind."""

    def __init__(self, config: WindowConfig | None = None) -> None:
        self.config = config or WindowConfig()
        super().__init__(self.config.capacity, self.config.horizon)
        self._jitter = 0.0
        self._last: float | None = None

    def add(self, value: float, *, now: float) -> None:
        """Take in a delay [s]; see `SlidingQuantiles.add`."""
        super().add(value, now=now)
        if self._last is not None:
            self._jitter += (abs(value - self._last) - self._jitter) / self.config.smoothing
        self._last = value

    def clear(self) -> None:
        """Forget everything, as when the clock that the delays were measured with has stepped."""
        super().clear()
        self._jitter, self._last = 0.0, None

    @property
    def jitter(self) -> float:
        """Interarrival jitter [s]: J ← J + (|D| − J) / 16, D the change from one delay to the next to arrive.

        A constant offset between the clocks of the two sides cancels. Source: RFC 3550, section 6.4.1.
        """
        return self._jitter


class RoundTripEstimator:
    """Probes a link and keeps statistics of the round trips.

    A state machine without input or output: when `next_deadline` has come call `to_send`, and hand every echo to
    `receive`. Each probe counts once, whatever the link does to it: in order or not, once or twice, late or never.

    Args:
        session: Random number in [0, 2**32), new for each life of an estimator.
        config: How to probe.
        start: When the first probe is due [s].

    Raises:
        InvalidValueError: If session or start is out of range.
    """

    def __init__(self, session: int, config: ProbeConfig | None = None, *, start: float = 0.0) -> None:
        if isinstance(session, bool) or not isinstance(session, int) or not 0 <= session < SESSIONS:
            raise InvalidValueError("session", session, f"an integer in [0, {SESSIONS})")
        self.config = config or ProbeConfig()
        self._session = session
        self._due = finite("start", start, "finite seconds")
        self._now = -math.inf
        self._sequence = 0
        self.in_flight: dict[int, float] = {}
        """When each packet was sent [s], by sequence number, of those that haven't come back."""
        self.delays = DelayStatistics(self.config.window)
        """Round trips of the window [s]."""
        self.sent = self.returned = self.lost = self.refused = 0
        """Probes so far: sent, back in time, given up as lost; and echoes that were of no use."""

    def next_deadline(self) -> float:
        """When `to_send` has something to do [s]: a probe is due or one in flight is lost. May have passed."""
        if not self.in_flight:
            return self._due
        expiry = next(iter(self.in_flight.values())) + self.config.timeout
        return expiry if len(self.in_flight) >= self.config.most_in_flight else min(expiry, self._due)

    def to_send(self, *, now: float) -> Probe | None:
        """Give up on probes whose time is over, and give the next if it's due: one, however late the call.

        Args:
            now: Time [s], not before that of any call before.

        Raises:
            InvalidValueError: If now isn't finite or runs back.
        """
        self._advance(now)
        if now < self._due or len(self.in_flight) >= self.config.most_in_flight:
            return None
        while self._sequence in self.in_flight:
            self._sequence = (self._sequence + 1) % SEQUENCE_NUMBERS
        probe = Probe(self._session, self._sequence, now)
        self.in_flight[self._sequence] = now
        self._sequence = (self._sequence + 1) % SEQUENCE_NUMBERS
        self.sent += 1
        due = self._due + self.config.period
        self._due = due if due > now else now + self.config.period
        return probe

    def receive(self, echo: Echo, *, now: float) -> RoundTrip | EchoRefusal:
        """Take an echo.

        Args:
            echo: From the link.
            now: Time of its arrival [s], not before that of any call before.

        Returns:
            The round trip, also for `ClockSync`; or why the echo was refused, nothing but a counter being changed.

        Raises:
            InvalidValueError: If now isn't finite or runs back.
        """
        self._advance(now)
        refusal = self._refuse(echo, now)
        if refusal is not None:
            self.refused += 1
            return refusal
        trip = RoundTrip(self.in_flight.pop(echo.sequence), echo.received, echo.replied, now)
        self.returned += 1
        self.delays.add(trip.delay, now=now)
        return trip

    def _refuse(self, echo: Echo, now: float) -> EchoRefusal | None:
        if echo.session != self._session:
            return EchoRefusal.FOREIGN
        sent = self.in_flight.get(echo.sequence)
        if sent is None or sent != echo.sent:
            return EchoRefusal.UNEXPECTED
        if not (abs(echo.received) <= LARGEST and abs(echo.replied) <= LARGEST):
            return EchoRefusal.IMPOSSIBLE
        held = echo.replied - echo.received
        # The other clock may run faster than ours, by less than a hundredth; a reading has its rounding.
        rounding = 4 * math.ulp(max(abs(echo.received), abs(echo.replied), abs(now)))
        return None if 0 <= held <= (now - sent) * 1.01 + rounding else EchoRefusal.IMPOSSIBLE

    def _advance(self, now: float) -> None:
        self._now = not_before("now", now, self._now, "at least {}, the time of the last call")
        while self.in_flight:
            sequence, sent = next(iter(self.in_flight.items()))
            if now < sent + self.config.timeout:
                break
            del self.in_flight[sequence]
            self.lost += 1
