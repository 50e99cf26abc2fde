"""The gain network: a feed-forward neural network that gives the largest gain K* of a factor A and a delay τ.

One hidden layer of tanh neurons and a linear output. Tipsuwan and Chow feed it A and τ and read K
(`Formulation.RAW`). K* spans four decades: with asinh(2|A|) and ln τ in and ln K out (`Formulation.LOGARITHMIC`),
the same twenty neurons err by relative hundredths of a percent, and never give a gain that isn't positive.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from interfaces.middleware.performance import optimal_ways, tolerance
from interfaces.system import read_within
from vrs.checks import finite, integer_in, validated, within
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array

SCHEMA: Final = "vrs-gain-network/1"
MOST_NEURONS: Final = 1000
MOST_BYTES: Final = 1024 * 1024
DEFAULT_FILE: Final = Path(__file__).parent / "gain_network.json"
"""The network that comes with the package: ε = 0.25, the paper's ranges."""


class Formulation(enum.StrEnum):
    """What goes in and what comes out."""

    LOGARITHMIC = "logarithmic"
    """asinh(2|A|) and ln τ in, ln K out."""
    RAW = "raw"
    """A and τ in, K out: the paper's."""


@dataclass(frozen=True, slots=True)
@validated
class Ranges:
    """What a network is trained on."""

    A_max: Annotated[float, within(1e-3, 1e6)] = 300.0
    """Largest |A| [1/m], in [1e-3, 1e6]."""
    tau_low: Annotated[float, within(1e-4, 100.0, "s")] = 0.1
    """Smallest delay [s], in [1e-4, 100]."""
    tau_high: float = 0.8
    """Largest delay [s], above tau_low, at most 1000."""

    def __post_init__(self) -> None:
        if not self.tau_low < finite("tau_high", self.tau_high) <= 1000.0:
            raise InvalidValueError("tau_high", self.tau_high, f"in ({self.tau_low:g}, 1000] s")


class GainNetwork(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A trained network, as a value and as it stands in a file."""

    schema: str
    """`SCHEMA`."""
    formulation: Formulation
    epsilon: float
    """Tolerance ε of J that it was trained for, in [1e-6, 3]."""
    A_max: float
    """Largest |A| that it was trained on [1/m]; beyond this and outside of the delays it says nothing."""
    tau_low: float
    """Smallest delay [s]."""
    tau_high: float
    """Largest delay [s]."""
    seed: int
    """Of the weights that it began with."""
    epochs: int
    """How long it was trained."""
    neurons: tuple[tuple[float, float, float, float], ...]
    """Of each hidden neuron the weights of both inputs, the bias, and the weight of its output."""
    bias: float
    """Of the output."""

    def __post_init__(self) -> None:
        tolerance(self.epsilon)
        if not 1 <= len(self.neurons) <= MOST_NEURONS:
            raise InvalidValueError("neurons", len(self.neurons), f"1 to {MOST_NEURONS} rows")
        for row in self.neurons:
            if len(row) != 4 or not all(math.isfinite(weight) for weight in row):
                raise InvalidValueError("neurons", row, "rows of four finite numbers")
        finite("bias", self.bias)
        Ranges(self.A_max, self.tau_low, self.tau_high)

    @property
    def ranges(self) -> Ranges:
        """What it was trained on."""
        return Ranges(self.A_max, self.tau_low, self.tau_high)

    def covers(self, A: float, tau: float) -> bool:
        """Whether it was trained on such a factor A [1/m] and delay τ [s]."""
        return abs(A) <= self.A_max and self.tau_low <= tau <= self.tau_high

    def gain(self, A: float, tau: float) -> float:
        """Return what it takes K* to be [m/s].

        Args:
            A: Quadratic factor [1/m].
            tau: Delay [s], positive.
        """
        logarithmic = self.formulation is Formulation.LOGARITHMIC
        if logarithmic:
            A, tau = math.asinh(2 * abs(A)), math.log(tau)
        tanh = math.tanh
        total = self.bias
        for of_A, of_tau, bias, out in self.neurons:
            total += out * tanh(of_A * A + of_tau * tau + bias)
        return math.exp(total) if logarithmic else total

    def gains(self, A: ArrayLike, tau: ArrayLike) -> Array:
        """Return what it takes K* to be of arrays of A [1/m] and τ [s] of one shape (k,)."""
        weights = np.array(self.neurons)
        hidden = np.tanh(inputs(self.formulation, A, tau) @ weights[:, :2].T + weights[:, 2])
        out: Array = hidden @ weights[:, 3] + self.bias
        return np.exp(out) if self.formulation is Formulation.LOGARITHMIC else out

    def to_json(self) -> str:
        """The whole network as a document, every digit kept."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1).decode() + "\n"


def inputs(formulation: Formulation, A: ArrayLike, tau: ArrayLike) -> Array:
    """What goes into a network of factors A [1/m] and delays τ [s], (k,) each: (k, 2)."""
    columns = np.asarray(A, dtype=np.float64), np.asarray(tau, dtype=np.float64)
    if formulation is Formulation.RAW:
        return np.stack(columns, -1)
    return np.stack([np.arcsinh(2 * np.abs(columns[0])), np.log(columns[1])], -1)


def read_network(text: bytes | str, where: str = "network") -> GainNetwork:
    """Read a network.

    Args:
        text: A document, as `GainNetwork.to_json` writes it.
        where: What it's called in errors.

    Raises:
        FormatError: If it isn't one.
    """
    try:
        found = msgspec.json.decode(text, type=GainNetwork)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        if isinstance(error.__cause__, InvalidValueError):
            raise FormatError(where, str(error.__cause__)) from None
        raise FormatError(where, f"isn't a gain network: {error}") from None
    if found.schema != SCHEMA:
        raise FormatError(where, f"its schema must be {SCHEMA!r}; given: {found.schema!r}")
    return found


def load_network(path: Path | str) -> GainNetwork:
    """Read a network from a file; raises as `read_network`."""
    path = Path(path)
    return read_network(read_within(path, MOST_BYTES), path.name)


@cache
def default_network() -> GainNetwork:
    """Return the network that comes with the package."""
    return load_network(DEFAULT_FILE)


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


def train(
    config: TrainingConfig | None = None, *, seed: int = 0, progress: Callable[[int, float], None] = lambda *_: None
) -> GainNetwork:
    """Train a network; the same seed gives the same one on the same machine.

    Args:
        config: On what, and for how long.
        seed: Of the weights to begin with, 0 to 2³² − 1.
        progress: Told the epoch and its mean squared error.

    Source: Hagan, Menhaj, Training feedforward networks with the Marquardt algorithm, IEEE Trans. Neural Networks
    5, 1994; the weights to begin with after Nguyen, Widrow 1990.
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


def errors(network: GainNetwork, A: Array, tau: Array) -> dict[str, float]:
    """Relative errors of a network at factors A [1/m] and delays τ [s], (k,) each: `median`, `p99`, `largest`."""
    exact = optimal_ways(A, network.epsilon) / tau
    found = np.abs(network.gains(A, tau) / exact - 1.0)
    p99 = float(np.quantile(found, 0.99))
    return {"median": float(np.median(found)), "p99": p99, "largest": float(found.max())}


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


def forward_pass(weights: Array, x: Array) -> tuple[Array, Array]:
    """Hidden values (k, n) and outputs (k,)."""
    hidden = np.tanh(x @ weights[:-1, :2].T + weights[:-1, 2])
    return hidden, hidden @ weights[:-1, 3] + weights[-1, 0]


def jacobian(weights: Array, x: Array, hidden: Array) -> Array:
    """Derivatives of the outputs by all weights, (k, 4 n + 1)."""
    inner = (1.0 - hidden * hidden) * weights[:-1, 3]
    columns = np.stack([inner * x[:, :1], inner * x[:, 1:], inner, hidden], -1)
    return np.concatenate([columns.reshape(len(x), -1), np.ones((len(x), 1))], 1)


def _marquardt(
    weights: Array, x: Array, y: Array, config: TrainingConfig, progress: Callable[[int, float], None]
) -> tuple[Array, int]:
    """Least squares from the first weights on; returns the last ones, and how many steps they took."""
    hidden, out = forward_pass(weights, x)
    error = float(np.mean((out - y) ** 2))
    damping, epoch = 1e-3, 0
    while epoch < config.epochs and error > config.goal and damping < _MOST_DAMPING:
        epoch += 1
        J = jacobian(weights, x, hidden)
        normal, slope = J.T @ J, J.T @ (out - y)
        while damping < _MOST_DAMPING:
            step = np.linalg.solve(normal + damping * np.eye(len(normal)), slope)
            tried = weights.copy()
            tried[:-1] -= step[:-1].reshape(-1, 4)
            tried[-1, 0] -= step[-1]
            tried_hidden, tried_out = forward_pass(tried, x)
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
        schema=SCHEMA,
        formulation=config.formulation,
        epsilon=config.epsilon,
        **asdict(config.ranges),
        seed=seed,
        epochs=epochs,
        neurons=tuple((a, b, c, d) for a, b, c, d in rows.tolist()),
        bias=float(weights[-1, 0]) * y[1] + y[0],
    )
