"""Section VI: the middleware is put before controllers that nobody changed for it.

A robot that goes slowly is bothered less by any delay. So beside each there's the same controller without
middleware, its speeds all scaled by one number: without delay it would take as long as behind the middleware.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any, Final

import numpy as np

from interfaces.lab.claims import OWN_BAR, Cell, Claim, Findings, Study, Table, above
from interfaces.lab.statistics import Estimate, bootstrap
from interfaces.lab.tipsuwan.run import (
    LIFTED,
    ROBOTS,
    NetworkControl,
    NetworkRunSetting,
    PathMeasures,
    behind,
    measured,
    network_of,
    no_delay,
    run,
    s_path,
)
from interfaces.lab.tipsuwan.success import reasons
from interfaces.middleware import Controller
from robots.onboard.curve import Curve
from robots.onboard.curve_trackers import PurePursuit, PurePursuitConfig, QuadraticCurveTracker
from robots.onboard.driving import Drive, Posture
from robots.onboard.path import Arc, MovingPath
from robots.onboard.path_following import PathFollowingConfig, PathFollowingController

SPEED: Final = 1.2
"""Of pure pursuit, and largest of the uni-vector field [m/s]."""
PIECE: Final = 0.05
"""Of the path of arcs that the uni-vector field follows [m]."""
PATHS: Final = 4
SLOW: Final = "without, as slow"
"""Whose speeds are all scaled."""


def _tracker(curve: Curve, setting: NetworkRunSetting) -> Controller:
    return QuadraticCurveTracker(curve, setting.tracker).control


def _pursuit(curve: Curve, _setting: NetworkRunSetting) -> Controller:
    return PurePursuit(curve, PurePursuitConfig(SPEED, most_turning=LIFTED.w_max)).control


def _field(curve: Curve, setting: NetworkRunSetting) -> Controller:
    """The uni-vector controller on a path of arcs along the curve."""
    path = arcs_of(curve)
    config = PathFollowingConfig(period=setting.period, cruise=SPEED, limits=LIFTED)
    return PathFollowingController(path, config).control


def arcs_of(curve: Curve) -> MovingPath:
    """A path of arcs, each as long as the next along the curve and turning by as much."""
    count = math.ceil(curve.length / PIECE)
    step = curve.length / count
    places = [curve.at(k * step) for k in range(count + 1)]
    start = places[0]
    path = MovingPath((start.x, start.y, start.theta))
    for place, after in pairwise(places):
        path.append(Arc(math.remainder(after.theta - place.theta, math.tau) / step, step))
    return path


CONTROLLERS: Final[dict[str, Callable[[Curve, NetworkRunSetting], Controller]]] = {
    "quadratic curve": _tracker,
    "uni-vector field": _field,
    "pure pursuit": _pursuit,
}
"""What makes each controller for a path."""
CASES: Final = tuple(f"{robot}/{name}" for robot in ROBOTS for name in CONTROLLERS)


def work(study: Study, case: str) -> dict[str, tuple[PathMeasures, ...]]:
    """A controller on a robot, a run a path: without delay, with it, behind the middleware, and as slow without."""
    robot, name = case.split("/")
    setting = NetworkRunSetting(length=study.length, body=study.body)
    found: dict[str, list[PathMeasures]] = {}
    for path in range(min(PATHS, study.runs)):
        number = 1000 * study.seed + path
        curve, network, pace = s_path(number), network_of(number), 1.0
        for way, control, delay in (
            ("no delay", NetworkControl.DIRECT, no_delay()),
            ("without", NetworkControl.DIRECT, network),
            ("with", NetworkControl.NETWORK, network),
            (SLOW, NetworkControl.DIRECT, network),
        ):
            if way == SLOW:
                pace = min(1.0, found["no delay"][-1].seconds / found["with"][-1].seconds)
            driver = behind(control, paced(CONTROLLERS[name](curve, setting), pace), setting.middleware)
            track = run(curve, driver, delay, number, robot=robot, setting=setting)
            found.setdefault(way, []).append(measured(track))
    return {way: tuple(runs) for way, runs in found.items()}


def paced(controller: Controller, pace: float) -> Controller:
    """A controller whose speeds are all scaled by one number, so that its curves stay as they are."""

    def drive(posture: Posture) -> Drive:
        v, w = controller(posture)
        return Drive(pace * v, pace * w)

    return drive


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """What the middleware does for each of the controllers."""
    found: dict[str, dict[str, tuple[PathMeasures, ...]]] = dict(zip(CASES, results, strict=True))
    made = [wrapping_claims(case, runs, study.seed) for case, runs in found.items()]
    claims = tuple(claim for kind in zip(*made, strict=True) for claim in kind)
    rows: list[tuple[Cell, ...]] = []
    for case, runs in found.items():
        for way, them in runs.items():
            arrived = float(np.mean([one.arrived for one in them]))
            rows.append((*case.split("/"), way, arrived, _mean_error(them), reasons(them)))
    columns = ("robot", "controller", "middleware", "arrived", "mean error [cm]", "why not")
    return Findings(claims, (Table("wrapping", "Controllers behind the middleware", columns, tuple(rows)),))


def _mean_error(runs: tuple[PathMeasures, ...]) -> float:
    return 100 * float(np.mean([one.error for one in runs]))


def wrapping_claims(case: str, runs: dict[str, tuple[PathMeasures, ...]], seed: int) -> tuple[Claim, Claim]:
    """What the middleware takes away of one robot's and controller's error; and that just going slowly doesn't."""
    robot, name = case.split("/")

    def saved(way: str, than: str) -> Estimate:
        pairs = zip(runs[way], runs[than], strict=True)
        return bootstrap([100 * (other.error - one.error) for one, other in pairs], seed)

    less = f"{robot}, {name}: mean error is less with the middleware than"
    return (
        above(f"{less} without: the difference [cm]", "Section VI", 0.0, saved("with", "without"),
              (SLOW, saved(SLOW, "without"))),
        above(f"{less} {SLOW}: the difference [cm]", OWN_BAR, 0.0, saved("with", SLOW),
              ("without it, at full speed", saved("without", SLOW))),
    )  # fmt: skip
