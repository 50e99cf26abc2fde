"""Loss models: their share, the length of their bursts, their text."""

from __future__ import annotations

import math

import numpy as np
import pytest

from interfaces.link import BernoulliLoss, Conditions, GilbertElliottLoss, LinkConditions, Service, loss_model
from vrs.errors import InvalidValueError

PACKETS = 60_000


def losses(model, count=PACKETS, seed=4):
    source = model.source(np.random.default_rng(seed))
    return np.array([source() for _ in range(count)])


def runs(lost):
    """Lengths of the bursts of losses."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], lost.astype(int), [0]))))
    return edges[1::2] - edges[::2]


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_independent_losses_have_their_share_and_no_memory(share):
    lost = losses(BernoulliLoss(share))
    error = 5 * math.sqrt(share * (1 - share) / PACKETS)
    assert lost.mean() == pytest.approx(share, abs=error)
    assert np.mean(lost[1:] & lost[:-1]) == pytest.approx(share**2, abs=2 * error)


@pytest.mark.parametrize(("share", "length"), [(0.05, 4.0), (0.3, 1.0), (0.6, 20.0)])
def test_bursts_have_the_asked_share_and_mean_length(share, length):
    model = GilbertElliottLoss.bursts(share, length)
    assert model.share == pytest.approx(share, rel=1e-12)
    lost = losses(model)
    # The state is a Markov chain with correlation 1 − enter − leave from a packet to the next.
    rho = max(0.0, 1.0 - model.enter - model.leave)
    n = PACKETS * (1 - rho) / (1 + rho)
    assert lost.mean() == pytest.approx(share, abs=5 * math.sqrt(share * (1 - share) / n))
    bursts = runs(lost)
    deviation = math.sqrt(length * (length - 1)) + 1e-9  # geometric
    assert bursts.mean() == pytest.approx(length, abs=5 * deviation / math.sqrt(bursts.size) + 1e-12)


def test_both_states_may_lose():
    model = GilbertElliottLoss(0.1, 0.3, loss_bad=0.8, loss_good=0.01)
    expected = 0.25 * 0.8 + 0.75 * 0.01
    assert model.share == pytest.approx(expected)
    assert losses(model).mean() == pytest.approx(
        expected, abs=5 * math.sqrt(expected * (1 - expected) * 4 / PACKETS)
    )


def test_the_first_packet_meets_the_stationary_state():
    model = GilbertElliottLoss.bursts(0.4, 1000.0)
    first = [model.source(np.random.default_rng(seed))() for seed in range(2000)]
    assert np.mean(first) == pytest.approx(0.4, abs=5 * math.sqrt(0.24 / 2000))


def test_losses_as_text():
    assert loss_model("0.1") == BernoulliLoss(0.1)
    assert loss_model("burst:0.1,5") == GilbertElliottLoss.bursts(0.1, 5.0)


@pytest.mark.parametrize(
    "text",
    ["", "x", "-0.1", "1.1", "nan", "inf", "burst:", "burst:0.1", "burst:0.1,0.5", "burst:1,5", "burst:0.9,2",
     "burst:0.1,5,6", "gust:0.1,5", "burst:nan,5", "burst"],
)  # fmt: skip
def test_bad_losses_name_what_is_allowed(text):
    with pytest.raises(InvalidValueError, match=r"loss must be a probability P .*burst:P,N"):
        loss_model(text)


@pytest.mark.parametrize(
    "changes",
    [
        {"duplicate": 1.1}, {"duplicate": math.nan}, {"reorder": -0.1}, {"reorder_by": -1.0}, {"bandwidth": 0.0},
        {"bandwidth": math.nan}, {"queue_packets": 0}, {"queue_packets": 1.5}, {"queue_bytes": 0}, {"capacity": 0},
        {"capacity": True}, {"service": "pigeon"}, {"retransmit_after": 0.0}, {"attempts": 0}, {"loss": 0.1},
    ],
)  # fmt: skip
def test_conditions_are_checked(changes):
    with pytest.raises(InvalidValueError):
        Conditions(**changes)


def test_conditions_are_values():
    conditions = Conditions(service="in-order", loss=BernoulliLoss(0.1))
    assert conditions.service is Service.IN_ORDER
    link = LinkConditions.symmetric(conditions)
    assert link.forward == link.backward == conditions
    with pytest.raises(AttributeError):
        conditions.duplicate = 0.5
