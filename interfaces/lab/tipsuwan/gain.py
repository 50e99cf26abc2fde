"""Section VI, 3): the gain network against the exact gain, the paper's formulation beside it, and the guard."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from interfaces.lab.claims import OWN_BAR, Cell, Claim, Findings, Study, Table
from interfaces.middleware import (
    Controller,
    Formulation,
    GainNetwork,
    GainScheduler,
    GainSchedulingMiddleware,
    TrainingConfig,
    default_network,
    drive_measure,
    train,
)
from interfaces.middleware.network import errors, examples
from robots.onboard.driving import Drive, Posture
from vrs.clock import WallClock
from vrs.model import Array

EXAMPLES: Final = 200_000
"""Factors and delays that the networks are tested with, of each kind."""
GUARDED: Final = 1_000_000
"""Drives that the guard is tested with, for ten runs; in proportion for others."""
FASTEST: Final = 5.0
"""Largest gain K of the drives: the paper's range [m/s]."""
P99, LARGEST, MOST_J, MOST_TIME = 1e-3, 5e-3, 1.0 + 1e-9, 50e-6
RAW: Final = TrainingConfig(formulation=Formulation.RAW, goal=1e-6, epochs=300, factors=601)
"""As the paper says: A and τ in, K out, to a mean squared error of 1e−6."""
SOURCE: Final = "Section VI, 3)"


def work(study: Study, _case: str) -> Findings:
    """Everything about the gain."""
    rng = np.random.default_rng([study.seed, 11])
    network = default_network()
    networks = {
        "that comes with the package": network,
        f"trained here, seed {study.seed}": train(seed=study.seed),
        "the paper's formulation": train(RAW, seed=study.seed),
    }
    chosen = examples(network.ranges, EXAMPLES, rng)
    found = {name: {kind: errors(one, *given) for kind, given in chosen.items()} for name, one in networks.items()}
    claims = [claim for name in list(networks)[:2] for claim in accuracy_claims(name, found[name])]
    guarded = {kind: guard(network, given, GUARDED * study.runs // 10) for kind, given in chosen.items()}
    claims += [
        Claim(
            f"A {kind}: the guard holds J ≤ ε (1 + 1e-9): largest J / ε − 1", SOURCE, "1e-09 at most",
            worst - 1.0, worst <= MOST_J,
        )
        for kind, (worst, _) in guarded.items()
    ]  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        (name, one.epochs, kind, *found[name][kind].values()) for name, one in networks.items() for kind in chosen
    ]
    columns = ("network", "epochs", "A", "median", "p99", "largest")
    exact = [(kind, f"{100 * share:.1f} %") for kind, (_, share) in guarded.items()]
    tables = (
        Table("gain_errors", "Relative errors of K against the exact root", columns, tuple(rows)),
        Table("guard", "Drives that the guard gave the exact gain", ("A", "of those slowed"), tuple(exact)),
    )
    seconds = step_time(network)
    text = "prediction and scheduling add to a control step [µs]"
    timing = Claim(text, OWN_BAR, "50 at most", 1e6 * seconds, seconds <= MOST_TIME)
    return Findings(tuple(claims), tables, (), (timing,))


def accuracy_claims(name: str, found: dict[str, dict[str, float]]) -> list[Claim]:
    """How near a network's gains are to the exact ones, for each kind of input."""
    claims = []
    for kind, one in found.items():
        for what, bar in (("p99", P99), ("largest", LARGEST)):
            value = one[what]
            text = f"the network {name}, A {kind}: relative error of K, {what} [%]"
            claims.append(Claim(text, f"{SOURCE}; {OWN_BAR}", f"{100 * bar:g} at most", 100 * value, value <= bar))
    return claims


def guard(network: GainNetwork, given: tuple[Array, Array], count: int) -> tuple[float, float]:
    """Largest J / ε of drives on curves of A scheduled for delays τ; and the share that got the exact gain."""
    scheduler = GainScheduler(network.epsilon, network)
    worst = 0.0
    A, tau = (column.tolist() for column in given)
    for k in range(count):
        factor, delay = A[k % len(A)], tau[(k + k // len(A)) % len(tau)]
        slowed = scheduler.schedule(Drive(FASTEST, 2 * factor * FASTEST), delay)
        worst = max(worst, drive_measure(slowed, delay))
    return worst / network.epsilon, scheduler.exact / max(scheduler.slowed, 1)


def step_time(network: GainNetwork, blocks: int = 100) -> float:
    """Median time that the middleware adds to a control step: prediction and scheduling, in blocks of 100 [s]."""
    driving, posture, wall = Drive(1.0, 0.5), Posture(0.0, 0.0, 0.0), WallClock()
    found = []
    for k in range(blocks):
        middleware = behind_a_network(_constant(Drive(2.0, 4.0 * math.sin(k))), network)
        start = wall.now()
        for _ in range(100):
            middleware.drive(posture, driving)
        found.append((wall.now() - start) / 100)
    return float(np.median(found))


def _constant(drive: Drive) -> Controller:
    return lambda _: drive


def behind_a_network(controller: Controller, network: GainNetwork) -> GainSchedulingMiddleware:
    """Return a middleware that has measured ten round trips of 0.21 s or so."""
    middleware = GainSchedulingMiddleware(controller, network=network)
    for k in range(10):
        probe = middleware.to_send(now=0.3 * k)
        if probe is not None:
            middleware.receive(probe.echo(0.3 * k + 0.1), now=0.3 * k + 0.205 + 0.001 * k)
    return middleware
