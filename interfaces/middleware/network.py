"""The gain network: a feed-forward neural network that gives the largest gain K* of a factor A and a delay τ.

One hidden layer of tanh neurons and a linear output. Tipsuwan and Chow feed it A and τ and read K
(`Formulation.RAW`). K* spans four decades: with asinh(2|A|) and ln τ in and ln K out (`Formulation.LOGARITHMIC`),
the same twenty neurons err by relative hundredths of a percent, and never give a gain that isn't positive.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from interfaces.middleware.performance import tolerance
from interfaces.system import read_within
from vrs.checks import finite, validated, within
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


@dataclass(frozen=True, slots=True)
class GainNetwork:
    """A trained network, as a value."""

    epsilon: float
    """Tolerance ε of J that it was trained for, in [1e-6, 3]."""
    neurons: tuple[tuple[float, float, float, float], ...]
    """Of each hidden neuron the weights of both inputs, the bias, and the weight of its output."""
    bias: float
    """Of the output."""
    formulation: Formulation = Formulation.LOGARITHMIC
    ranges: Ranges = field(default_factory=Ranges)
    """Outside of these it says nothing."""
    seed: int = 0
    """Of the weights that it began with."""
    epochs: int = 0
    """How long it was trained."""

    def __post_init__(self) -> None:
        tolerance(self.epsilon)
        if not 1 <= len(self.neurons) <= MOST_NEURONS:
            raise InvalidValueError("neurons", len(self.neurons), f"1 to {MOST_NEURONS} rows")
        for row in self.neurons:
            if len(row) != 4 or not all(math.isfinite(weight) for weight in row):
                raise InvalidValueError("neurons", row, "rows of four finite numbers")
        finite("bias", self.bias)

    def covers(self, A: float, tau: float) -> bool:
        """Whether it was trained on such a factor A [1/m] and delay τ [s]."""
        ranges = self.ranges
        return abs(A) <= ranges.A_max and ranges.tau_low <= tau <= ranges.tau_high

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
        document = _Document(
            schema=SCHEMA,
            formulation=self.formulation.value,
            epsilon=self.epsilon,
            A_max=self.ranges.A_max,
            tau_low=self.ranges.tau_low,
            tau_high=self.ranges.tau_high,
            seed=self.seed,
            epochs=self.epochs,
            neurons=list(self.neurons),
            bias=self.bias,
        )
        return msgspec.json.format(msgspec.json.encode(document), indent=1).decode() + "\n"


class _Document(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """A network in a file."""

    schema: str
    formulation: str
    epsilon: float
    A_max: float
    tau_low: float
    tau_high: float
    seed: int
    epochs: int
    neurons: list[tuple[float, float, float, float]]
    bias: float


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
        found = msgspec.json.decode(text, type=_Document)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise FormatError(where, f"isn't a gain network: {error}") from None
    if found.schema != SCHEMA:
        raise FormatError(where, f"its schema must be {SCHEMA!r}; given: {found.schema!r}")
    try:
        return GainNetwork(
            epsilon=found.epsilon,
            neurons=tuple(found.neurons),
            bias=found.bias,
            formulation=Formulation(found.formulation),
            ranges=Ranges(found.A_max, found.tau_low, found.tau_high),
            seed=found.seed,
            epochs=found.epochs,
        )
    except ValueError as error:
        raise FormatError(where, str(error)) from None


def load_network(path: Path | str) -> GainNetwork:
    """Read a network from a file; raises as `read_network`."""
    path = Path(path)
    return read_network(read_within(path, MOST_BYTES), path.name)


@cache
def default_network() -> GainNetwork:
    """Return the network that comes with the package."""
    return load_network(DEFAULT_FILE)
