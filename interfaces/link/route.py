"""The parts of a delay: distance, nodes, load, message over bandwidth.

Source: Han, Kim, Kim and Kim (2001), eq. (7): T_d(k) = Σ (l_i/C + t_i^R + t_i^L(k) + M/b_i) = d_N + d_L(k).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from interfaces.link.congestion import correlation_time
from interfaces.link.delay import CORRELATION_TIME, MAX_DELAY, DelaySource, share_of
from vrs.checks import number_in
from vrs.commands import finite
from vrs.errors import InvalidValueError

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
        cls,
        name: str,
        *,
        distance: float,
        nodes: int,
        routing: float,
        load: float,
        bandwidth: float,
        tau: float = CORRELATION_TIME,
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
        return _LoadState(self, rng)

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


class _LoadState:
    """State of the load of one route."""

    def __init__(self, profile: RouteDelay, rng: np.random.Generator) -> None:
        self._profile, self._rng = profile, rng
        self._base, self._per_bit = profile.parts()
        self._half_means = 0.5 * np.array([hop.load for hop in profile.hops])
        self._vectors = np.zeros((2, len(profile.hops)))
        self._last: float | None = None

    def draw(self, now: float, size: int = 0) -> float | None:
        gap = math.inf if self._last is None else max(0.0, now - self._last)
        tau = self._profile.correlation_time
        rho = math.exp(-0.5 * gap / tau) if tau > 0 else 0.0
        fresh = self._rng.standard_normal(self._vectors.shape)
        self._vectors = rho * self._vectors + math.sqrt(1.0 - rho * rho) * fresh
        self._last = now if self._last is None else max(now, self._last)
        load = float(self._half_means @ (self._vectors**2).sum(axis=0))
        fixed = self._base + 8.0 * (size or self._profile.message) * self._per_bit
        return min(fixed + load, MAX_DELAY)
