"""Section VI, 3): the gain network against the exact gain, the paper's formulation beside it, and the guard."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
from typing_extensions import override

from interfaces.lab.claims import OWN_BAR, Cell, Claim, Findings, Study, Table, all_of, at_most
from interfaces.lab.tipsuwan.run import (
    NetworkControl,
    NetworkRunSetting,
    PathMeasures,
    behind,
    measured,
    network_of,
    run,
    s_path,
)
from interfaces.lab.tipsuwan.success import reasons
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
from robots.onboard.curve_trackers import QuadraticCurveTracker
from robots.onboard.driving import Drive, Posture
from vrs.clock import WallClock
from vrs.model import Array

EXAMPLES: Final = 200_000
"""Factors and delays that the networks are tested with, of each kind."""
GUARDED: Final = 1_000_000
"""Drives that the guard is tested with, for ten runs; in proportion for others."""
FASTEST: Final = 5.0
"""Largest gain K of the drives: the paper's range [m/s]."""
P99, LARGEST = 1e-3, 5e-3
PRINTED, OURS = "the paper's formulation", "that comes with the package"
RAW: Final = TrainingConfig(formulation=Formulation.RAW, goal=1e-6, epochs=300, factors=31, delays=8)
"""As the paper says: A and τ in, K out, to a mean squared error of 1e−6; on a grid that gets there."""
FINE: Final = replace(RAW, factors=61)
"""A grid twice as fine along A."""
BEGINNINGS: Final = 5
"""Weights that training begins with."""
EPOCHS: Final = 135
"""The paper's."""
PRINTED_PATHS: Final = 3
SOURCE: Final = "Section VI, 3)"


def work(study: Study, _case: str) -> Findings:
    """Everything about the gain."""
    rng = np.random.default_rng([study.seed, 11])
    network = default_network()
    printed = _trained(study, RAW)[0]
    networks = {
        OURS: network,
        f"trained here, seed {study.seed}": train(seed=study.seed),
        PRINTED: printed,
    }
    chosen = examples(network.ranges, EXAMPLES, rng)
    found = {name: {kind: errors(one, *given) for kind, given in chosen.items()} for name, one in networks.items()}
    claims = [claim for name in list(networks)[:2] for claim in accuracy_claims(name, found[name], found[PRINTED])]
    guarded = {kind: guard(network, given, GUARDED * study.runs // 10) for kind, given in chosen.items()}
    claims += [
        at_most(
            f"A {kind}: the guard holds J ≤ ε (1 + 1e-9): largest J / ε − 1", SOURCE, 1e-9, worst - 1.0,
            ("the network alone", unguarded(network, chosen[kind]) - 1.0),
        )
        for kind, (worst, _) in guarded.items()
    ]  # fmt: skip
    loops = {loop: in_the_loop(study, networks[loop[0]], guarded=loop[1]) for loop in LOOPS}
    claims += printed_claims(study, loops[PRINTED, False])
    rows: list[tuple[Cell, ...]] = [
        (name, one.epochs, kind, *found[name][kind].values()) for name, one in networks.items() for kind in chosen
    ]
    columns = ("network", "epochs", "A", "median", "p99", "largest")
    exact = [(kind, f"{100 * share:.1f} %") for kind, (_, share) in guarded.items()]
    tables = (
        Table("gain_errors", "Relative errors of K against the exact root", columns, tuple(rows)),
        Table("guard", "Drives that the guard gave the exact gain", ("A", "of those slowed"), tuple(exact)),
        Table.of(
            "loops", "Networks in the loop, alone and behind the guard",
            [loop_row(*loop, made) for loop, made in loops.items()],
        ),
    )  # fmt: skip
    seconds = step_time(network)
    text = "prediction and scheduling add to a control step [µs]"
    timing = at_most(text, OWN_BAR, 50, 1e6 * seconds)
    return Findings(tuple(claims), tables, (), (timing,))


@cache
def _trained(study: Study, grid: TrainingConfig) -> tuple[GainNetwork, ...]:
    """Networks of some beginnings, the quickest first."""
    seeds = range(study.seed, study.seed + BEGINNINGS)
    return tuple(sorted((train(grid, seed=seed) for seed in seeds), key=lambda one: one.epochs))


LOOPS: Final = ((PRINTED, False), (PRINTED, True), (OURS, False), (OURS, True))
"""Networks in the loop, alone and behind the guard that gives the exact root where J would be over ε."""


def in_the_loop(study: Study, network: GainNetwork | None, *, guarded: bool = True) -> tuple[PathMeasures, ...]:
    """What becomes of the kinematic robot on some paths, slowed down by a network; without middleware if None."""
    setting, found = NetworkRunSetting(length=study.length), []
    control = NetworkControl.DIRECT if network is None else NetworkControl.NETWORK
    for k in range(PRINTED_PATHS):
        curve = s_path(1000 * study.seed + k)
        driver = behind(control, QuadraticCurveTracker(curve, setting.tracker).control, setting.middleware)
        if network is not None:
            scheduler = GainScheduler if guarded else PrintedScheduler
            driver.scheduler = scheduler(driver.scheduler.epsilon, network)
        found.append(measured(run(curve, driver, network_of(k), k, setting=setting)))
    return tuple(found)


def loop_row(name: str, guarded: bool, made: tuple[PathMeasures, ...]) -> tuple[tuple[str, Cell], ...]:
    """What became of a network in the loop."""
    return (
        ("network", name),
        ("guard", "yes" if guarded else "no"),
        ("arrived", sum(one.arrived for one in made)),
        ("of", len(made)),
        ("mean error [cm]", 100 * float(np.mean([one.error for one in made]))),
        ("path made", float(np.mean([one.progress for one in made]))),
        ("why not", reasons(made)),
    )


def printed_claims(study: Study, alone: tuple[PathMeasures, ...]) -> tuple[Claim, ...]:
    """What the paper says of its network: how long it's trained, and that it brings a robot to its path's end.

    Args:
        study: How much is measured.
        alone: What became of the robot that the paper's network slowed down, and nothing else.
    """
    epochs, others = (float(np.median([one.epochs for one in _trained(study, grid)])) for grid in (RAW, FINE))

    return (
        at_most(
            f"the paper's formulation gets to a mean squared error of {RAW.goal:g}, on a grid of {RAW.factors} × "
            f"{RAW.delays}: epochs, median of {BEGINNINGS} beginnings",
            SOURCE, 2 * EPOCHS, epochs, (f"{FINE.factors} × {FINE.delays}, {FINE.epochs} at most", others),
            note=f", twice the paper's {EPOCHS}",
        ),
        all_of(
            "the network in the paper's formulation, and nothing else, brings the kinematic robot to the end: of "
            f"{PRINTED_PATHS} paths",
            f"{SOURCE}; Fig. 7", sum(one.arrived for one in alone), PRINTED_PATHS,
            ("without middleware", sum(one.arrived for one in in_the_loop(study, None))),
        ),
    )  # fmt: skip


class PrintedScheduler(GainScheduler):
    """What the paper prints: the network's gain as it comes, whatever J is then."""

    def __init__(self, epsilon: float, network: GainNetwork) -> None:
        """Take the tolerance and a network for it."""
        super().__init__(epsilon, network)
        self._gains = network

    @override
    def schedule(self, drive: Drive, tau: float) -> Drive:
        """Drive at the network's gain where J is over ε."""
        if drive_measure(drive, tau) <= self.epsilon or drive.v == 0.0:
            return drive
        share = self._gains.gain(0.5 * drive.w / drive.v, tau) / abs(drive.v)
        return Drive(drive.v * share, drive.w * share)


def accuracy_claims(
    name: str, found: dict[str, dict[str, float]], printed: dict[str, dict[str, float]]
) -> list[Claim]:
    """How near a network's gains are to the exact ones, for each kind of input, and the paper's formulation's."""
    claims = []
    for kind, one in found.items():
        for what, bar in (("p99", P99), ("largest", LARGEST)):
            value = one[what]
            text = f"the network {name}, A {kind}: relative error of K, {what} [%]"
            without = PRINTED, 100 * printed[kind][what]
            claims.append(
                at_most(text, f"{SOURCE}; {OWN_BAR}", round(100 * bar, 6), 100 * value, without, slack=1e-9)
            )
    return claims


def unguarded(network: GainNetwork, given: tuple[Array, Array]) -> float:
    """Largest J / ε of drives at the gains that a network alone gives."""
    A, tau = given
    drives = zip(A.tolist(), tau.tolist(), network.gains(A, tau).tolist(), strict=True)
    return max(drive_measure(Drive(K, 2 * factor * K), delay) for factor, delay, K in drives) / network.epsilon


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
