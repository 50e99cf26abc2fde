"""Delay profiles: how long packets take one way, by name: constant, measured, gamma, over a route, from a trace.

This file is long, for they are one family: each is a frozen value that starts a source of delays.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path
from statistics import NormalDist
from typing import Annotated, Protocol, TypeAlias

import numpy as np

from interfaces.system import read_within
from vrs.checks import did_you_mean, finite, number_in, validated, within
from vrs.errors import FormatError, InvalidValueError

MAX_DELAY = 3600.0
"""Longest one-way delay that a profile may hold [s]."""
CORRELATION_TIME = 2.0
"""Time constant of a link's congestion, where none is given [s]."""


DelaySource: TypeAlias = Callable[[float, int], float | None]
"""Gives the one-way delay [s], ≥ 0, of the next packet; None when it is lost.

It's given when the packet is sent [s], and its size [byte], 0 where that isn't told; it holds the link's state.
"""


class DelayProfile(Protocol):
    """A way in which a link delays packets."""

    @property
    def name(self) -> str:
        """The profile as the command line spells it."""

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays."""

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of arriving packets does not exceed [s]."""


def share_of(share: float) -> float:
    """Return a share strictly between none and all.

    Raises:
        InvalidValueError: If it isn't in (0, 1).
    """
    if not 0 < finite("share", share, "in (0, 1)") < 1:
        raise InvalidValueError("share", share, "in (0, 1)")
    return share


@dataclass(frozen=True, slots=True)
class ConstantDelay:
    """Every packet takes equally long."""

    name: str
    delay: float
    """One-way delay [s], in [0, 3600]."""

    def __post_init__(self) -> None:
        number_in("delay", self.delay, 0.0, MAX_DELAY, "seconds")

    def source(self, _rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays; nothing about them is random."""
        return lambda _now, _size: self.delay

    def quantile(self, _share: float) -> float:
        """The delay, for every share [s]."""
        return self.delay


SHORTEST = 1e-6
"""Shortest one but 0 [s]."""


def correlation_time(value: float) -> float:
    """Check a correlation time [s]; 0 means independent draws.

    Raises:
        InvalidValueError: If it isn't 0 or in [1e-6, 3600].
    """
    if number_in("correlation time", value, 0.0, MAX_DELAY, "seconds") == 0:
        return value
    return number_in("correlation time", value, SHORTEST, MAX_DELAY, "0, or seconds")


def congestion(rng: np.random.Generator, tau: float) -> Callable[[float], float]:
    """A standard normal variable z(t) with the autocorrelation exp(−|Δt|/τ), sampled as time goes on.

    Args:
        rng: Source of the randomness; one standard normal a sample.
        tau: Correlation time τ [s]; 0 makes every sample independent, two at the same instant too.

    Returns:
        Gives the value at a time [s]; a time before the last one counts as that one.
    """
    z, last = 0.0, -math.inf

    def at(now: float) -> float:
        nonlocal z, last
        rho = math.exp(-max(0.0, now - last) / tau) if tau > 0 else 0.0
        z = rho * z + math.sqrt(1.0 - rho * rho) * float(rng.standard_normal())
        last = max(now, last)
        return z

    return at


LEAST_MEAN = 1e-6
"""Least mean of what's above the smallest delay [s]: of nearly nothing no share can be worked out."""


@dataclass(frozen=True, slots=True)
class GammaDelay:
    """A smallest delay plus a gamma variable; above 3600 s it is clipped.

    The correlation is that of a normal variable z(t) behind it: the delay is the quantile of Φ(z).
    """

    name: str
    mean: float
    """Mean one-way delay [s], at least 1 µs above low, at most 3600."""
    deviation: float
    """Standard deviation [s], from 1/1000 to 10 times mean − low."""
    low: float = 0.0
    """Smallest delay [s], in [0, mean)."""
    correlation_time: float = CORRELATION_TIME
    """Correlation time of z [s], in [0, 3600]; 0 makes the draws independent."""

    def __post_init__(self) -> None:
        number_in("smallest delay", self.low, 0.0, MAX_DELAY, "seconds")
        if not self.low < number_in("mean delay", self.mean, 0.0, MAX_DELAY, "seconds"):
            raise InvalidValueError("mean delay", self.mean, f"more than the smallest, {self.low:g} s")
        above = number_in("mean delay above the smallest", self.mean - self.low, LEAST_MEAN, MAX_DELAY, "seconds")
        number_in("standard deviation", self.deviation, above / 1e3, above * 10, "seconds")
        correlation_time(self.correlation_time)

    @property
    def shape(self) -> float:
        """Shape parameter k of the gamma variable."""
        return ((self.mean - self.low) / self.deviation) ** 2

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays from the stationary distribution."""
        z_at = congestion(rng, self.correlation_time)

        def draw(now: float, _size: int) -> float | None:
            z = z_at(now) / math.sqrt(2.0)
            return self.delay_at(0.5 * math.erfc(-z), 0.5 * math.erfc(z))

        return draw

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of packets does not exceed [s]; share in (0, 1)."""
        return self.delay_at(share_of(share), 1.0 - share)

    def delay_at(self, below: float, above: float) -> float:
        """Delay [s] with the shares `below` and `above` = 1 − below on either side of it."""
        from scipy.special import gammainccinv, gammaincinv

        value = gammaincinv(self.shape, below) if below <= above else gammainccinv(self.shape, above)
        return min(self.low + float(value) * (self.mean - self.low) / self.shape, MAX_DELAY)


@dataclass(frozen=True, slots=True)
@validated
class HeavyTailedDelay:
    """Clipped log-normal delay with correlated congestion.

    d = min + min(L, max − min) with L log-normal; ln L is a first-order autoregression.
    """

    name: str
    mu: Annotated[float, within(-50.0, 50.0)]
    """Mean of ln L, L in milliseconds; in [−50, 50]."""
    sigma: float
    """Standard deviation of ln L, in (0, 10]."""
    low: float
    """Smallest delay [s], ≥ 0."""
    high: float
    """Largest delay [s], in (low, 3600]."""
    correlation_time: float = CORRELATION_TIME
    """Time constant of the autoregression of ln L [s], in [0, 3600]; 0 makes the draws independent."""

    def __post_init__(self) -> None:
        if number_in("sigma", self.sigma, 0.0, 10.0) == 0:
            raise InvalidValueError("sigma", self.sigma, "in (0, 10]")
        number_in("low", self.low, 0.0, MAX_DELAY, "seconds")
        if not self.low < number_in("high", self.high, 0.0, MAX_DELAY, "seconds"):
            raise InvalidValueError("high", self.high, f"more than low, {self.low} s")
        correlation_time(self.correlation_time)

    def delay(self, z: float) -> float:
        """Delay [s] where ln L lies z standard deviations above its mean."""
        return self.low + min(math.exp(self.mu + self.sigma * z) / 1e3, self.high - self.low)

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays from the stationary distribution."""
        z_at = congestion(rng, self.correlation_time)
        return lambda now, _size: self.delay(z_at(now))

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of packets does not exceed [s]; share in (0, 1)."""
        return self.delay(NormalDist().inv_cdf(share_of(share)))


MEASURED = {
    profile.name: profile
    for profile in (
        HeavyTailedDelay("domain", 0.82, 1.94, 0.006, 0.89),
        HeavyTailedDelay("country", 5.23, 2.62, 0.039, 343.0),
        HeavyTailedDelay("mon", 4.52, 1.89, 0.048, 15.0),
        HeavyTailedDelay("tue", 6.24, 2.40, 0.045, 343.0),
        HeavyTailedDelay("wed", 4.60, 2.38, 0.044, 154.0),
        HeavyTailedDelay("thu", 4.72, 2.14, 0.045, 68.0),
        HeavyTailedDelay("fri", 4.69, 2.01, 0.049, 35.0),
    )
}
"""The rows by name: table 1's regions, table 2's days, of Han, Kim, Kim and Kim (2001).

The parameters are those for which mean and standard deviation of d match the rows *after* clipping.
"""


LIGHT_SPEED = 299_792_458.0
"""Speed of light in vacuum, C of eq. (7) [m/s]; in fibre it is about 2e8."""
MAX_HOPS = 256
MAX_MESSAGE = 65_535
"""Longest message [byte]."""


@dataclass(frozen=True, slots=True)
class Hop:
    """One term of the sum: a length of link and the node at its end."""

    length: float = 0.0
    """Length l_i of the link [m], in [0, 1e12]."""
    routing: float = 0.0
    """Time t_i^R that the node needs for any packet [s], in [0, 3600]."""
    load: float = 0.0
    """Mean of the time t_i^L(k) that the node's load costs [s], in [0, 3600]; exponentially distributed."""
    bandwidth: float = math.inf
    """Bandwidth b_i of the link [bit/s], from 1 up; infinite when the message's size costs nothing."""

    def __post_init__(self) -> None:
        number_in("length of a link", self.length, 0.0, 1e12, "metres")
        number_in("routing time", self.routing, 0.0, MAX_DELAY, "seconds")
        number_in("mean load", self.load, 0.0, MAX_DELAY, "seconds")
        if self.bandwidth != math.inf and finite("bandwidth of a link", self.bandwidth, "bit/s ≥ 1") < 1:
            raise InvalidValueError("bandwidth of a link", self.bandwidth, "bit/s ≥ 1")


@dataclass(frozen=True, slots=True)
class RouteDelay:
    """Eq. (7): d_N from the route and the message's size, d_L(k) from the load of its nodes.

    The load of a node is exponentially distributed, like the wait behind random traffic, independent of the
    other nodes' and correlated in time: half the squared length of a two-dimensional normal vector that
    turns slowly is exponential, and its autocorrelation is exp(−|Δt|/τ).

    Source: Han, Kim, Kim and Kim (2001), eq. (7): T_d(k) = Σ (l_i/C + t_i^R + t_i^L(k) + M/b_i) = d_N + d_L(k).
    """

    name: str
    hops: tuple[Hop, ...]
    """The terms of the sum, 1 to 256."""
    message: int = 64
    """Size M of a message whose size isn't told, and of those that `quantile` is about [byte]; 0 to 65535."""
    speed: float = LIGHT_SPEED
    """Propagation speed [m/s], in [1, 3e8]."""
    correlation_time: float = CORRELATION_TIME
    """Correlation time τ of the load [s], in [0, 3600]; 0 makes the draws independent."""

    def __post_init__(self) -> None:
        if not 1 <= len(self.hops) <= MAX_HOPS:
            raise InvalidValueError("hops", len(self.hops), f"1 to {MAX_HOPS}")
        number_in("message", self.message, 0, MAX_MESSAGE, "bytes")
        number_in("propagation speed", self.speed, 1.0, 3e8, "m/s")
        correlation_time(self.correlation_time)
        number_in("fixed delay of the route", self.fixed(), 0.0, MAX_DELAY, "seconds")

    @classmethod
    def uniform(
        cls, name: str, distance: float, nodes: int, routing: float, load: float, bandwidth: float, tau: float
    ) -> RouteDelay:
        """A route over equal nodes, in nodes + 1 equal links, as the sum from i = 0 to n counts them.

        Args:
            name: The profile as the command line spells it.
            distance: Length of the whole route [m].
            nodes: Number n of nodes, 0 to 255.
            routing: Each node's t^R [s].
            load: Mean of each node's t^L [s].
            bandwidth: Each link's [bit/s].
            tau: Correlation time of the load [s].
        """
        number_in("nodes", nodes, 0, MAX_HOPS - 1)
        hop = Hop(distance / (nodes + 1), routing, load, bandwidth)
        return cls(name, (hop,) * (nodes + 1), correlation_time=tau)

    def fixed(self, size: int = 0) -> float:
        """d_N of a message of `size` bytes [s]; 0 stands for a size that isn't told."""
        base, per_bit = self.parts()
        return base + 8.0 * (size or self.message) * per_bit

    def parts(self) -> tuple[float, float]:
        """Distance and routing of d_N [s], and what each bit of the message adds [s]."""
        base = math.fsum(hop.length / self.speed + hop.routing for hop in self.hops)
        return base, math.fsum(1.0 / hop.bandwidth for hop in self.hops)

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays from the stationary distribution."""
        base, per_bit = self.parts()
        half_means = 0.5 * np.array([hop.load for hop in self.hops])
        vectors, last, tau = np.zeros((2, len(self.hops))), -math.inf, self.correlation_time

        def draw(now: float, size: int) -> float | None:
            nonlocal vectors, last
            rho = math.exp(-0.5 * max(0.0, now - last) / tau) if tau > 0 else 0.0
            vectors = rho * vectors + math.sqrt(1.0 - rho * rho) * rng.standard_normal(vectors.shape)
            last = max(now, last)
            load = float(half_means @ (vectors**2).sum(axis=0))
            return min(base + 8.0 * (size or self.message) * per_bit + load, MAX_DELAY)

        return draw

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of nominal messages does not exceed [s]; share in (0, 1)."""
        loads = np.array([hop.load for hop in self.hops if hop.load > 0])
        share_of(share)
        return min(self.fixed() + (_sum_quantile(loads, share) if loads.size else 0.0), MAX_DELAY)


def _sum_quantile(means: np.ndarray[tuple[int], np.dtype[np.float64]], share: float) -> float:
    """Quantile of a sum of independent exponential variables: a chain of phases, passed one after the other."""
    if (means == means[0]).all():
        from scipy.special import gammaincinv

        return float(gammaincinv(len(means), share) * means[0])
    from scipy.linalg import expm
    from scipy.optimize import brentq

    rates = 1.0 / means
    generator = np.diag(-rates) + np.diag(rates[:-1], 1)

    def excess(t: float) -> float:
        return float(expm(generator * t)[0].sum()) - (1.0 - share)

    high = float(means.sum()) / (1.0 - share)
    return float(brentq(excess, 0.0, high, xtol=1e-12 * high, rtol=1e-12))


COLUMN = "delay_s"
MAX_BYTES = 64 * 1024 * 1024


@dataclass(frozen=True, slots=True)
class TraceDelay:
    """Recorded delays, a row a packet; after the last row the first comes again."""

    name: str
    delays: tuple[float | None, ...]
    """One-way delays [s], in [0, 3600]; None is a lost packet. Not empty."""

    def __post_init__(self) -> None:
        if not self.delays:
            raise InvalidValueError("delays", self.delays, "at least one row")
        for delay in self.delays:
            if delay is not None:
                number_in("delay", delay, 0.0, MAX_DELAY, "seconds")

    def source(self, _rng: np.random.Generator) -> DelaySource:
        """Start at the first row."""
        rows = cycle(self.delays)
        return lambda _now, _size: next(rows)

    def quantile(self, share: float) -> float:
        """Smallest recorded delay that the share of arriving packets keeps within [s]; 0 if none arrives."""
        arriving = sorted(d for d in self.delays if d is not None)
        return arriving[max(0, math.ceil(share_of(share) * len(arriving)) - 1)] if arriving else 0.0


def read_trace(path: Path, *, longest: float) -> tuple[float | None, ...]:
    """Read the delays of a CSV file.

    An empty cell, quoted or not, and a bare empty line each are a lost packet.

    Args:
        path: A CSV file whose header names a `delay_s` column [s].
        longest: Largest delay allowed [s].

    Returns:
        One-way delays [s], None for a lost packet; at least one row.

    Raises:
        FormatError: If the file can't be read, or a row holds anything else.
    """
    try:
        text = read_within(path, MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FormatError(str(path), "isn't UTF-8 text") from None
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = [cell.strip() for cell in next(rows, [])]
        if COLUMN not in header:
            raise FormatError(f"{path}:1", f"the header must name a {COLUMN} column; given: {header}")
        column = header.index(COLUMN)
        delays = [_delay(row, column, len(header), f"{path}:{rows.line_num}", longest) for row in rows]
    except csv.Error as error:
        raise FormatError(f"{path}:{rows.line_num}", f"isn't CSV: {error}") from None
    if not delays:
        raise FormatError(str(path), "must hold at least one row below its header")
    return tuple(delays)


def _delay(row: list[str], column: int, width: int, where: str, longest: float) -> float | None:
    if len(row) != width and any(cell.strip() for cell in (row if len(row) < width else row[width:])):
        # A decimal comma, or a line that was cut: neither is a delay, nor a lost packet.
        raise FormatError(where, f"must have {width} cells, as the header has; has {len(row)}: {row[:8]}")
    cell = row[column].strip() if column < len(row) else ""
    if not cell:
        return None
    try:
        delay = float(cell)
    except ValueError:
        delay = math.nan
    if not 0 <= delay <= longest:
        allowed = f"seconds in [0, {longest:g}], or empty for a lost packet"
        raise FormatError(where, f"{COLUMN} must be {allowed}; given: {cell!r}")
    return delay


LUNAR_ROUND_TRIP = 2.56
"""Earth to Moon and back [s]."""

ALLOWED = (
    f"none, constant:S (S seconds in [0, {MAX_DELAY:g}]), {', '.join(MEASURED)}, gamma:MEAN,SD[,MIN] (s), "
    "route:DISTANCE,NODES,ROUTING,LOAD,BANDWIDTH (m, count, s, s, bit/s), lunar, "
    "or trace:FILE.csv with a delay_s column; the measured rows, gamma and route may end in @TAU "
    f"(correlation time in s, {CORRELATION_TIME:g} without it, 0 for independent draws)"
)
"""What a delay profile may be, in words."""
KINDS = ("none", "constant", *MEASURED, "gamma", "route", "lunar", "trace")
"""How a delay profile begins."""


def delay_profile(text: str) -> DelayProfile:
    """Read a delay profile as the command line spells it.

    Args:
        text: `none`, `constant:S`, `domain`, `country`, `mon` to `fri`, `gamma:MEAN,SD[,MIN]`,
            `route:DISTANCE,NODES,ROUTING,LOAD,BANDWIDTH`, `lunar` or `trace:FILE.csv`. The measured rows,
            gamma and route may carry a correlation time in seconds: `thu@20`; `thu@0` draws independently.

    Returns:
        The profile; its delays are one way.

    Raises:
        InvalidValueError: If text is none of these.
        FormatError: If a trace file can't be read as one.
    """
    kind, colon, argument = text.partition(":")
    if text == "none":
        return ConstantDelay(text, 0.0)
    if text == "lunar":
        return ConstantDelay(text, LUNAR_ROUND_TRIP / 2)
    if kind == "trace" and argument:
        return TraceDelay(text, read_trace(Path(argument), longest=MAX_DELAY))
    try:
        return _spelled(text, kind, argument if colon else None)
    except InvalidValueError as error:
        raise InvalidValueError("delay profile", text, f"{ALLOWED} ({error})") from None
    except (ValueError, KeyError, TypeError):
        raise InvalidValueError("delay profile", text, ALLOWED, did_you_mean(text, KINDS)) from None


def _spelled(text: str, kind: str, argument: str | None) -> DelayProfile:
    """Read a profile with numbers; any ValueError, KeyError or TypeError means that it isn't one."""
    if kind == "constant":
        return ConstantDelay(text, float(argument or "none"))
    body, at, tau_text = (kind if argument is None else argument).partition("@")
    tau = float(tau_text) if at else CORRELATION_TIME
    if argument is not None:
        return _PARAMETRIC[kind](text, body.split(","), tau)
    return replace(MEASURED[body], name=text, correlation_time=tau) if at else MEASURED[body]


def _gamma(text: str, parts: list[str], tau: float) -> DelayProfile:
    mean, deviation, low = (float(part) for part in (parts if len(parts) == 3 else [*parts, "0"]))
    return GammaDelay(text, mean, deviation, low, tau)


def _route(text: str, parts: list[str], tau: float) -> DelayProfile:
    distance, nodes, routing, load, bandwidth = parts
    numbers = float(routing), float(load), float(bandwidth)
    return RouteDelay.uniform(text, float(distance), int(nodes), *numbers, tau)


_PARAMETRIC: dict[str, Callable[[str, list[str], float], DelayProfile]] = {"gamma": _gamma, "route": _route}
