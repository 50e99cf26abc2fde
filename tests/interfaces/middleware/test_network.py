"""Gain networks: that the one in the package is good, that training makes good ones, and what is no network."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from interfaces.middleware.network import (
    DEFAULT_FILE,
    SCHEMA,
    Formulation,
    Ranges,
    TrainingConfig,
    default_network,
    errors,
    examples,
    forward_pass,
    jacobian,
    lessons,
    load_network,
    read_network,
    train,
)
from interfaces.middleware.performance import optimal_gain
from vrs.errors import FormatError, InvalidValueError

SMALL = TrainingConfig(neurons=8, epochs=60, factors=41, delays=7)


@pytest.mark.parametrize("seed", [5, 6])
def test_the_network_in_the_package_is_as_good_as_is_asked(seed):
    network = default_network()
    assert len(network.neurons) == 20
    assert (network.epsilon, network.ranges) == (0.25, Ranges(300.0, 0.1, 0.8))
    for A, tau in examples(network.ranges, 20_000, np.random.default_rng(seed)).values():
        found = errors(network, A, tau)
        assert found["p99"] <= 1e-3
        assert found["largest"] <= 5e-3
        assert found["p99"] < 2e-4


def test_at_the_ends_of_its_ranges_too():
    network = default_network()
    for A in (0.0, 1e-300, -300.0, 300.0):
        for tau in (0.1, 0.8):
            assert network.covers(A, tau)
            assert network.gain(A, tau) == pytest.approx(optimal_gain(A, tau, 0.25), rel=5e-3)
    assert not network.covers(301.0, 0.2)
    assert not network.covers(math.nan, 0.2)
    assert not network.covers(1.0, 0.09)


def test_one_by_one_and_as_arrays_the_same():
    for network in (default_network(), train(replace(SMALL, formulation=Formulation.RAW))):
        A, tau = examples(network.ranges, 50, np.random.default_rng(1))["log-uniform"]
        single = [network.gain(*given) for given in zip(A.tolist(), tau.tolist(), strict=True)]
        assert np.allclose(network.gains(A, tau), single, rtol=1e-12)


def test_training_repeats_tells_and_gets_better():
    told = []
    network = train(SMALL, seed=3, progress=lambda epoch, error: told.append((epoch, error)))
    assert network == train(SMALL, seed=3)
    assert network != train(SMALL, seed=4)
    assert [epoch for epoch, _ in told] == list(range(1, network.epochs + 1))
    assert told[-1][1] < 1e-3 * told[0][1]
    assert all(after <= before for (_, before), (_, after) in pairwise(told))
    A, tau = examples(network.ranges, 5000, np.random.default_rng(0))["uniform"]
    assert errors(network, A, tau)["p99"] < 0.1


def test_the_papers_formulation_is_far_off():
    raw = train(TrainingConfig(formulation=Formulation.RAW, goal=1e-6, epochs=60, factors=301), seed=0)
    A, tau = examples(raw.ranges, 5000, np.random.default_rng(0))["uniform"]
    assert errors(raw, A, tau)["p99"] > 0.5


def test_another_tolerance_and_ranges_are_learned():
    config = replace(SMALL, epsilon=1.0, ranges=Ranges(20.0, 0.02, 2.0), epochs=150)
    network = train(config)
    A, tau = examples(network.ranges, 5000, np.random.default_rng(2))["uniform"]
    assert errors(network, A, tau)["p99"] < 0.05
    assert optimal_gain(3.0, 0.5, 1.0) == pytest.approx(network.gain(3.0, 0.5), rel=0.05)


def test_what_is_learned_is_exact():
    A, tau, K = lessons(SMALL)
    assert len(A) == 41 * 7
    assert (A.min(), A.max()) == pytest.approx((0.0, 300.0))
    assert (tau.min(), tau.max()) == pytest.approx((0.1, 0.8))
    k = np.random.default_rng(0).integers(0, len(A), 20)
    assert K[k] == pytest.approx([optimal_gain(*given, 0.25) for given in zip(A[k], tau[k], strict=True)])


def test_the_jacobian_is_the_outputs_derivative():
    rng = np.random.default_rng(0)
    weights, x = rng.normal(size=(6, 4)), rng.uniform(-1, 1, (9, 2))
    J = jacobian(weights, x, forward_pass(weights, x)[0])
    for column in range(21):
        step = np.zeros_like(weights)
        step.flat[column] = 1e-6
        difference = (forward_pass(weights + step, x)[1] - forward_pass(weights - step, x)[1]) / 2e-6
        assert J[:, column] == pytest.approx(difference, abs=1e-8)


def test_a_network_is_read_as_it_was_written(tmp_path):
    network = train(replace(SMALL, epochs=3))
    path = tmp_path / "net.json"
    path.write_text(network.to_json())
    assert load_network(path) == network
    assert json.loads(network.to_json())["schema"] == SCHEMA
    assert DEFAULT_FILE.read_text() == default_network().to_json()


def changed(**fields):
    return json.dumps(json.loads(default_network().to_json()) | fields)


@pytest.mark.parametrize(("text", "said"), [
    ("", "isn't a gain network"),
    ("[]", "isn't a gain network"),
    (b"\xff", "isn't a gain network"),
    (changed(more=1), "unknown field"),
    (changed(schema="vrs-gain-network/2"), "its schema must be 'vrs-gain-network/1'"),
    (changed(epsilon=7), "epsilon must be"),
    (changed(epsilon="much"), "isn't a gain network"),
    (changed(formulation="magic"), "magic"),
    (changed(tau_high=0.05), "tau_high must be"),
    (changed(A_max=-1), "A_max must be"),
    (changed(neurons=[]), "neurons must be"),
    (changed(neurons=[[1, 2, 3]]), "isn't a gain network"),
    (changed(neurons=[[1, 2, 3, 4]] * 1001), "neurons must be"),
])  # fmt: skip
def test_what_is_no_network(text, said):
    with pytest.raises(FormatError, match=r"^a\.json: ") as caught:
        read_network(text, "a.json")
    assert said in str(caught.value)


def test_a_network_is_made_of_finite_numbers():
    for bad in ({"neurons": ((math.nan, 0.0, 0.0, 0.0),)}, {"bias": math.inf}):
        with pytest.raises(InvalidValueError):
            msgspec.structs.replace(default_network(), **bad)


@pytest.mark.parametrize("bad", [
    {"neurons": 0}, {"epochs": 1.5}, {"goal": -1.0}, {"factors": 2}, {"delays": 1}, {"epsilon": 9.0},
    {"formulation": "x"},
])  # fmt: skip
def test_impossible_trainings_are_refused(bad):
    with pytest.raises(ValueError, match=next(iter(bad)) if "formulation" not in bad else "x"):
        TrainingConfig(**bad)
