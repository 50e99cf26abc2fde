"""Which packets get lost: independently, or in bursts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np

from vrs.checks import number_in, validated, within
from vrs.errors import InvalidValueError

LossSource: TypeAlias = Callable[[], bool]
"""Says whether the next packet is lost; it holds the state of the link."""


@dataclass(frozen=True, slots=True)
class BernoulliLoss:
    """Every packet is lost with the same probability, whatever happened to the others."""

    share: float
    """Probability of loss, in [0, 1]."""

    def __post_init__(self) -> None:
        number_in("loss", self.share, 0.0, 1.0)

    def source(self, rng: np.random.Generator) -> LossSource:
        """Start a sequence of packets."""
        return lambda: bool(rng.random() < self.share)


@dataclass(frozen=True, slots=True)
@validated
class GilbertElliottLoss:
    """Two states, good and bad, that change from packet to packet: losses come in bursts.

    Source: E. N. Gilbert (1960); E. O. Elliott (1963), Bell System Technical Journal 39 and 42.
    """

    enter: Annotated[float, within(0.0, 1.0)]
    """Probability that the packet after a good one is bad, in [0, 1]."""
    leave: Annotated[float, within(0.0, 1.0)]
    """Probability that the packet after a bad one is good, in (0, 1]."""
    loss_bad: Annotated[float, within(0.0, 1.0)] = 1.0
    """Probability of loss in the bad state, in [0, 1]."""
    loss_good: Annotated[float, within(0.0, 1.0)] = 0.0
    """Probability of loss in the good state, in [0, 1]."""

    def __post_init__(self) -> None:
        if self.leave == 0:
            raise InvalidValueError("leave", self.leave, "in (0, 1]")

    @classmethod
    def bursts(cls, share: float, length: float) -> GilbertElliottLoss:
        """Losses of a given share in bursts of a given mean length.

        Args:
            share: Share of packets lost in the long run, in [0, 1).
            length: Mean number of packets lost in a row, ≥ 1 and ≥ share / (1 − share).
        """
        number_in("length of a burst", length, 1.0, 1e6, "packets")
        if not number_in("loss", share, 0.0, 1.0) < 1:
            raise InvalidValueError("loss", share, "in [0, 1)")
        enter = share / ((1.0 - share) * length)
        if enter > 1:
            raise InvalidValueError("length of a burst", length, f"at least {share / (1.0 - share):g} packets")
        return cls(enter, 1.0 / length)

    @property
    def share(self) -> float:
        """Share of packets lost in the long run."""
        bad = self.enter / (self.enter + self.leave)
        return bad * self.loss_bad + (1.0 - bad) * self.loss_good

    def source(self, rng: np.random.Generator) -> LossSource:
        """Start a sequence of packets in the stationary distribution of the states."""
        bad = bool(rng.random() < self.enter / (self.enter + self.leave))

        def lost() -> bool:
            nonlocal bad
            found = bool(rng.random() < (self.loss_bad if bad else self.loss_good))
            bad ^= bool(rng.random() < (self.leave if bad else self.enter))
            return found

        return lost


LossModel: TypeAlias = BernoulliLoss | GilbertElliottLoss
ALLOWED = "a probability P in [0, 1], or burst:P,N: a share P lost in bursts of N packets on average (N ≥ 1)"
"""What a loss model may be, in words."""


def loss_model(text: str) -> LossModel:
    """Read a loss model as the command line spells it: `P`, or `burst:P,N`.

    Raises:
        InvalidValueError: If text is neither.
    """
    kind, colon, argument = text.partition(":")
    try:
        if not colon:
            return BernoulliLoss(float(text))
        share, length = (float(part) for part in argument.split(","))
        if kind == "burst":
            return GilbertElliottLoss.bursts(share, length)
    except InvalidValueError as error:
        raise InvalidValueError("loss", text, f"{ALLOWED} ({error})") from None
    except ValueError:
        pass
    raise InvalidValueError("loss", text, ALLOWED)


def spelled_loss(model: LossModel) -> str:
    """A loss model as the command line spells it; in other words where it can't."""
    if isinstance(model, BernoulliLoss):
        return f"{model.share:g}"
    if (model.loss_bad, model.loss_good) == (1.0, 0.0):
        return f"burst:{model.share:g},{1.0 / model.leave:g}"
    return f"bursts, {model.share:g} in the long run"
