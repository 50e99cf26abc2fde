"""Training of a gain network by the method of Levenberg and Marquardt.

Source: Hagan, Menhaj, Training feedforward networks with the Marquardt algorithm, IEEE Trans. Neural Networks 5,
1994; the weights to begin with after Nguyen, Widrow 1990.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np

from interfaces.middleware.network import Formulation, GainNetwork, Ranges, inputs
from interfaces.middleware.performance import optimal_ways, tolerance
from vrs.checks import integer_in, validated, within
from vrs.model import Array

_LEAST_DAMPING, _MOST_DAMPING = 1e-12, 1e10
_DAMPING_STEP = 10.0


@dataclass(frozen=True, slots=True)
@validated
class TrainingConfig:
    """How a network is trained."""

    epsilon: float = 0.25
    """Tolerance ε of J, in [1e-6, 3]."""
    neurons: Annotated[int, within(1, 1000)] = 20
    """Hidden ones, 1 to 1000."""
    formulation: Formulation = Formulation.LOGARITHMIC
    ranges: Ranges = field(default_factory=Ranges)
    goal: Annotated[float, within(0.0, 1.0)] = 1e-11
    """Mean squared error of the output, scaled to [−1, 1], that ends training, in [0, 1]; the paper's is 1e-6."""
    epochs: Annotated[int, within(1, 100_000)] = 2000
    """Most steps, 1 to 100,000."""
    factors: Annotated[int, within(3, 10_000)] = 121
    """How many quadratic factors A are learned, 3 to 10,000."""
    delays: Annotated[int, within(2, 1000)] = 17
    """At how many delays τ each, 2 to 1000."""

    def __post_init__(self) -> None:
        tolerance(self.epsilon)
        object.__setattr__(self, "formulation", Formulation(self.formulation))


class Errors(NamedTuple):
    """Relative errors of a network's gain against the exact one."""

    median: float
    p99: float
    largest: float


def train(
    config: TrainingConfig | None = None, *, seed: int = 0, progress: Callable[[int, float], None] = lambda *_: None
) -> GainNetwork:
    """Train a network; the same seed gives the same one on the same machine.

    Args:
        config: On what, and for how long.
        seed: Of the weights to begin with, 0 to 2³² − 1.
        progress: Told the epoch and its mean squared error.
    """
    config = TrainingConfig() if config is None else config
    integer_in("seed", seed, 0, 2**32 - 1)
    A, tau, K = lessons(config)
    x, middle_x, half_x = _scaled(inputs(config.formulation, A, tau))
    wanted = np.log(K) if config.formulation is Formulation.LOGARITHMIC else K
    y, middle_y, half_y = _scaled(wanted[:, None])
    weights, epochs = _marquardt(
        _beginning(config.neurons, np.random.default_rng(seed)), x, y[:, 0], config, progress
    )
    return _network(config, weights, (middle_x, half_x), (float(middle_y[0]), float(half_y[0])), seed, epochs)


def lessons(config: TrainingConfig) -> tuple[Array, Array, Array]:
    """What is learned: factors A [1/m], delays τ [s] and exact gains K* [m/s], (k,) each.

    The raw formulation gets even steps over the ranges, as the paper computes them; the logarithmic one Chebyshev's
    nodes of its inputs, as an error is largest at the ends.
    """
    ranges = config.ranges
    if config.formulation is Formulation.RAW:
        factors = np.linspace(-ranges.A_max, ranges.A_max, config.factors)
        delays = np.linspace(ranges.tau_low, ranges.tau_high, config.delays)
    else:
        top = math.asinh(2 * ranges.A_max)
        factors = 0.5 * np.sinh(_nodes(0.0, top, config.factors))
        delays = np.exp(_nodes(math.log(ranges.tau_low), math.log(ranges.tau_high), config.delays))
    ways = optimal_ways(factors, config.epsilon)
    A, tau = np.repeat(factors, len(delays)), np.tile(delays, len(factors))
    return A, tau, np.repeat(ways, len(delays)) / tau


def errors(network: GainNetwork, A: Array, tau: Array) -> Errors:
    """Relative errors of a network at factors A [1/m] and delays τ [s], (k,) each."""
    exact = optimal_ways(A, network.epsilon) / tau
    found = np.abs(network.gains(A, tau) / exact - 1.0)
    return Errors(float(np.median(found)), float(np.quantile(found, 0.99)), float(found.max()))


def examples(ranges: Ranges, count: int, rng: np.random.Generator) -> dict[str, tuple[Array, Array]]:
    """Factors A and delays τ to test a network with, (count,) each: A uniform, and log-uniform down to 0."""
    tau = rng.uniform(ranges.tau_low, ranges.tau_high, (2, count))
    uniform = rng.uniform(-ranges.A_max, ranges.A_max, count)
    decades = ranges.A_max * 10.0 ** rng.uniform(-12.0, 0.0, count) * rng.choice((-1.0, 1.0), count)
    decades[0] = 0.0
    return {"uniform": (uniform, tau[0]), "log-uniform": (decades, tau[1])}


def _nodes(low: float, high: float, count: int) -> Array:
    """Chebyshev's extrema in a range, both ends included."""
    nodes: Array = low + 0.5 * (high - low) * (1.0 - np.cos(np.linspace(0.0, math.pi, count)))
    return nodes


def _scaled(columns: Array) -> tuple[Array, Array, Array]:
    """Columns scaled to [−1, 1], and the middle and half of their ranges."""
    low, high = columns.min(axis=0), columns.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return (columns - middle) / half, middle, half


def _beginning(neurons: int, rng: np.random.Generator) -> Array:
    """Rows of a neuron's two weights, bias and output weight; the last row begins with the output's bias."""
    weights = np.zeros((neurons + 1, 4))
    direction = rng.uniform(-1.0, 1.0, (neurons, 2))
    size = 0.7 * math.sqrt(neurons)
    weights[:-1, :2] = size * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    weights[:-1, 2] = rng.uniform(-size, size, neurons)
    weights[:-1, 3] = rng.uniform(-0.5, 0.5, neurons)
    return weights


def _output(weights: Array, x: Array) -> tuple[Array, Array]:
    """Hidden values (k, n) and outputs (k,)."""
    hidden = np.tanh(x @ weights[:-1, :2].T + weights[:-1, 2])
    return hidden, hidden @ weights[:-1, 3] + weights[-1, 0]


def _jacobian(weights: Array, x: Array, hidden: Array) -> Array:
    """Derivatives of the outputs by all weights, (k, 4 n + 1)."""
    inner = (1.0 - hidden * hidden) * weights[:-1, 3]
    columns = np.stack([inner * x[:, :1], inner * x[:, 1:], inner, hidden], -1)
    return np.concatenate([columns.reshape(len(x), -1), np.ones((len(x), 1))], 1)


def _marquardt(
    weights: Array, x: Array, y: Array, config: TrainingConfig, progress: Callable[[int, float], None]
) -> tuple[Array, int]:
    """Least squares from the first weights on; returns the last ones, and how many steps they took."""
    hidden, out = _output(weights, x)
    error = float(np.mean((out - y) ** 2))
    damping, epoch = 1e-3, 0
    while epoch < config.epochs and error > config.goal and damping < _MOST_DAMPING:
        epoch += 1
        J = _jacobian(weights, x, hidden)
        normal, slope = J.T @ J, J.T @ (out - y)
        while damping < _MOST_DAMPING:
            step = np.linalg.solve(normal + damping * np.eye(len(normal)), slope)
            tried = weights.copy()
            tried[:-1] -= step[:-1].reshape(-1, 4)
            tried[-1, 0] -= step[-1]
            tried_hidden, tried_out = _output(tried, x)
            tried_error = float(np.mean((tried_out - y) ** 2))
            if tried_error < error:
                weights, hidden, out, error = tried, tried_hidden, tried_out, tried_error
                damping = max(damping / _DAMPING_STEP, _LEAST_DAMPING)
                break
            damping *= _DAMPING_STEP
        progress(epoch, error)
    return weights, epoch


def _network(
    config: TrainingConfig, weights: Array, x: tuple[Array, Array], y: tuple[float, float], seed: int, epochs: int
) -> GainNetwork:
    """The network with the scales of inputs and output in its weights."""
    middle, half = x
    rows = weights[:-1].copy()
    rows[:, :2] /= half
    rows[:, 2] -= rows[:, :2] @ middle
    rows[:, 3] *= y[1]
    return GainNetwork(
        epsilon=config.epsilon,
        neurons=tuple((a, b, c, d) for a, b, c, d in rows.tolist()),
        bias=float(weights[-1, 0]) * y[1] + y[0],
        formulation=config.formulation,
        ranges=config.ranges,
        seed=seed,
        epochs=epochs,
    )
