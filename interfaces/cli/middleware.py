"""`vrs middleware`: train a gain network, and say how good it is."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.options import On, bars, option
from interfaces.system import written
from vrs.errors import FormatError

if TYPE_CHECKING:
    from interfaces.middleware import GainNetwork, TrainingConfig

EXAMPLES = 100_000
"""Factors and delays that a network is tested with, of each kind."""

middleware = typer.Typer(name="middleware", help="The network middleware of a mobile robot: its gain network.")


@middleware.callback()
def _root() -> None:
    """The network middleware of a mobile robot: its gain network."""


@middleware.command(short_help="Train it, and test it against the exact gain")
def train(
    out: Annotated[Path, option("FILE", "Where the network goes, as JSON.")],
    seed: Annotated[int, option("N", "Seed of the weights to begin with.", min=0, max=2**32 - 1)] = 0,
    epsilon: Annotated[float, option("E", "Tolerance of the measure J.", min=1e-6, max=3)] = 0.25,
    neurons: Annotated[int, option("N", "Hidden ones.", min=1, max=1000)] = 20,
    epochs: Annotated[int, option("N", "Most steps of training.", min=1, max=100_000)] = 2000,
    on: On = "",
    as_json: Annotated[bool, option("--json", "Write what was found on standard output.")] = False,
) -> None:
    """Train the network that says how fast a robot may go, and test it against the exact gain."""
    from interfaces.middleware import TrainingConfig

    _hold(out)
    network = _trained(TrainingConfig(epsilon=epsilon, neurons=neurons, epochs=epochs), seed, on)
    with written(out, "can't hold the network"):
        out.write_text(network.to_json(), encoding="utf-8")
    found = _tested(network)
    if as_json:
        import json

        summary = {"file": str(out), "seed": seed, "epsilon": epsilon, "epochs": network.epochs, "errors": found}
        typer.echo(json.dumps(summary, indent=2))
        return
    for kind, one in found.items():
        typer.echo(f"A {kind}: relative error of K p99 {one['p99']:.1e}, largest {one['largest']:.1e}")
    typer.echo(f"Wrote {out} after {network.epochs} epochs")


def _hold(out: Path) -> None:
    """See to it that a long training isn't for nothing."""
    if out.is_dir() or not out.absolute().parent.is_dir():
        raise FormatError(str(out), "must be a file in a directory that exists")


def _trained(config: TrainingConfig, seed: int, on: str) -> GainNetwork:
    from interfaces.middleware import train

    if on:
        from interfaces.lab.executors import executor
        from interfaces.lab.runner import pooled

        with executor(on, lambda said: typer.echo(f"vrs: {said}", err=True)) as who:
            return pooled([(partial(train, config, seed=seed), ())], workers=who)[0]
    with bars("training", "mean squared error {task.fields[error]:.1e}") as bar:
        task = bar.add_task("training", total=config.epochs, error=math.inf)
        return train(config, seed=seed, progress=lambda k, error: bar.update(task, completed=k, error=error))


def _tested(network: GainNetwork) -> dict[str, dict[str, float]]:
    import numpy as np

    from interfaces.middleware.network import errors, examples

    chosen = examples(network.ranges, EXAMPLES, np.random.default_rng([network.seed, 1]))
    return {kind: errors(network, *given) for kind, given in chosen.items()}
