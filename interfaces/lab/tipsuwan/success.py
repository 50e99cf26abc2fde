"""Section VII: how often the middleware brings a robot to the end of its path, also on shorter ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from interfaces.lab.claims import OWN_BAR, Cell, Claim, Counterfactual, Figure, Findings, Study, Table
from interfaces.lab.output import BAD, GOOD, INK, LINE, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.lab.statistics import clustered
from interfaces.lab.tipsuwan.run import (
    EVERY,
    ROBOTS,
    SHORTER,
    SLOWEST,
    T_PRED,
    DriveTrace,
    NetworkControl,
    NetworkRunSetting,
    PathMeasures,
    agent,
    beside,
    measured,
    network_of,
    no_delay,
    predicted_time,
    run,
    s_path,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

    from robots.onboard.curve import Curve

PATHS: Final = 20
LEAST_SHARE: Final = 0.95
"""Of the runs, in which everything that is claimed must be so."""
MOST_RATIO: Final = 0.4
"""Largest mean error with the middleware, as a share of that without."""
SOURCE: Final = f"Section VII, Fig. 7; {OWN_BAR}"
CASES: Final = tuple(f"{robot} {path}" for robot in ROBOTS for path in range(PATHS))
IDEAL: Final = "no delay"
LABELS: Final = {
    NetworkControl.DIRECT: "without middleware",
    NetworkControl.EXACT: "middleware, exact gain",
    NetworkControl.NETWORK: "middleware, network",
    NetworkControl.UNSCHEDULED: "middleware that doesn't slow down",
    NetworkControl.PREDICTIVE: "model-predictive control",
}
BEHIND: Final = (NetworkControl.NETWORK, NetworkControl.EXACT)
"""What success is asked of."""


class PathSuccess(NamedTuple):
    """Of one robot on one path."""

    t_pred: float
    """For the longest median round trip [s]."""
    ideal: PathMeasures
    """Without delay."""
    runs: dict[NetworkControl, tuple[PathMeasures, ...]]
    """A run a delay seed."""
    tracks: dict[str, DriveTrace]
    """Those of the first path and seed, for the picture; none but there."""


def succeeds(ideal: PathMeasures, without: PathMeasures, behind: PathMeasures) -> bool:
    """Whether the claim is so: it arrives without delay, not with delay alone, and with middleware well."""
    arrivals = ideal.arrived and behind.arrived and not without.arrived
    return arrivals and behind.error <= MOST_RATIO * without.error


def work(study: Study, case: str) -> PathSuccess:
    """All controls and delay seeds of a robot on a path."""
    robot, path = case.split()
    found = ran(study, robot, s_path(1000 * study.seed + int(path)), tuple(NetworkControl))
    return found if path == "0" else found._replace(tracks={})


def ran(study: Study, robot: str, curve: Curve, controls: Sequence[NetworkControl]) -> PathSuccess:
    """Some controls and all delay seeds of a robot on a path."""
    setting = NetworkRunSetting(length=study.length, body=study.body)
    ideal = run(
        curve, agent(NetworkControl.DIRECT, curve, setting), no_delay(), study.seed, robot=robot, setting=setting
    )
    runs: dict[NetworkControl, list[PathMeasures]] = {}
    tracks = {IDEAL: ideal}
    for k in range(study.seed, study.seed + study.runs):
        for control in controls:
            track = run(
                curve, agent(control, curve, setting, robot), network_of(k), k, robot=robot, setting=setting
            )
            runs.setdefault(control, []).append(measured(track))
            tracks.setdefault(LABELS[control], track)
    found = {control: tuple(them) for control, them in runs.items()}
    return PathSuccess(predicted_time(curve, SLOWEST, setting.middleware.epsilon), measured(ideal), found, tracks)


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """Shares of success, what became of every control, and Fig. 7."""
    found: dict[str, PathSuccess] = dict(zip(CASES, results, strict=True))
    claims: list[Claim] = []
    tables: list[Table] = []
    figures: list[Figure] = []
    for robot in ROBOTS:
        paths = [found[case] for case in CASES if case.split()[0] == robot]
        claims += [claim(robot, control, paths, T_PRED, study.seed) for control in BEHIND]
        tables += [controls(robot, paths), _paths(robot, paths)]
        tracks = found[f"{robot} 0"].tracks
        if tracks:
            figures.append(success_figure(robot, tracks))
    return Findings(tuple(claims), tuple(tables), tuple(figures))


def _successes(path: PathSuccess, control: NetworkControl) -> list[float]:
    """1 for each delay seed with which the claim is so, else 0."""
    pairs = zip(path.runs[NetworkControl.DIRECT], path.runs[control], strict=True)
    return [float(succeeds(path.ideal, without, behind)) for without, behind in pairs]


def claim(
    robot: str, control: NetworkControl, paths: Sequence[PathSuccess], within: tuple[float, float], seed: int
) -> Claim:
    """Whether enough of the runs succeed."""
    # All paths have the same networks, and one that is quick lets a robot without middleware arrive on many.
    shares, rival = (
        clustered(np.transpose([_successes(path, who) for path in paths]), seed)
        for who in (control, NetworkControl.UNSCHEDULED)
    )
    text = (
        f"{robot}, {LABELS[control]}: no delay arrives, delay without middleware doesn't, with it does, with at "
        f"most {MOST_RATIO:g} of its mean error: share of {PATHS} paths × networks, T_pred {within[0]:g} to "
        f"{within[1]:g} s"
    )
    without = Counterfactual(
        LABELS[NetworkControl.UNSCHEDULED], rival.value, rival.high >= LEAST_SHARE, rival.interval
    )
    met = shares.low >= LEAST_SHARE
    return Claim(text, SOURCE, f"{LEAST_SHARE:g} or more", shares.value, met, shares.interval, without)


def controls(robot: str, paths: Sequence[PathSuccess], name: str = "controls", title: str = "") -> Table:
    """A row a control: arrivals, times, errors, and reasons of failure."""
    runs = {IDEAL: [path.ideal for path in paths]}
    for control in paths[0].runs:
        runs[LABELS[control]] = [one for path in paths for one in path.runs[control]]
    without = np.mean([one.error for one in runs[LABELS[NetworkControl.DIRECT]]])
    rows: list[tuple[Cell, ...]] = []
    for label, them in runs.items():
        arrived = [one.seconds for one in them if one.arrived]
        errors = [one.error for one in them]
        rows.append((
            label, len(arrived) / len(them), float(np.median(arrived)) if arrived else None,
            100 * float(np.mean(errors)), float(np.mean(errors) / without),
            float(np.mean([one.progress for one in them])), reasons(them),
        ))  # fmt: skip
    columns = (
        "control", "arrived", "after, median [s]", "mean error [cm]", "share of that without", "path made",
        "why not",
    )  # fmt: skip
    said = f"{robot}: what became of the runs{title} (link loss: hold)"
    return Table(f"{robot}_{name}", said, columns, tuple(rows))


def _paths(robot: str, paths: Sequence[PathSuccess]) -> Table:
    """A row a path: its predicted time, the share of success, and how the robot without middleware failed."""
    rows = []
    for k, path in enumerate(paths):
        without = path.runs[NetworkControl.DIRECT]
        good = np.mean(_successes(path, NetworkControl.NETWORK))
        made = float(np.mean([one.progress for one in without]))
        slowest = max(one.seconds for one in path.runs[NetworkControl.NETWORK])
        rows.append((k, path.t_pred, float(good), slowest, made, reasons(without)))
    columns = ("path", "T_pred [s]", "success", "longest with [s]", "path made without", "why not")
    return Table(f"{robot}_paths", f"{robot}: path by path", columns, tuple(rows))


def reasons(runs: Sequence[PathMeasures]) -> str:
    """How many runs failed for which reason, the most frequent one first."""
    counted = Counter(one.reason for one in runs if not one.arrived)
    return ", ".join(f"{why} {many}" for why, many in counted.most_common())


COLOURS: Final = {
    IDEAL: GOOD,
    LABELS[NetworkControl.DIRECT]: BAD,
    LABELS[NetworkControl.EXACT]: MUTED,
    LABELS[NetworkControl.NETWORK]: VIRTUAL,
    LABELS[NetworkControl.UNSCHEDULED]: LINE,
    LABELS[NetworkControl.PREDICTIVE]: REAL,
}


def success_figure(robot: str, tracks: dict[str, DriveTrace]) -> Figure:
    """The paths that a robot drove, beside the one that it was to follow."""

    def paint(canvas: Canvas) -> None:
        left, right = canvas.subplots(1, 2)
        left.plot(*tracks[IDEAL].curve.table[1].T, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), label="path")
        for name in (
            LABELS[NetworkControl.DIRECT],
            IDEAL,
            LABELS[NetworkControl.NETWORK],
            LABELS[NetworkControl.PREDICTIVE],
        ):
            track = tracks[name]
            away = 100 * np.abs(beside(track)[0])
            left.plot(*track.postures[:, :2].T, color=COLOURS[name], label=name, linewidth=1.1)
            right.plot(EVERY * np.arange(len(away)), away, color=COLOURS[name], label=name, linewidth=1.1)
        left.set_aspect("equal", adjustable="datalim")
        left.set(xlabel="x [m]", ylabel="y [m]")
        right.set(xlabel="time [s]", ylabel="distance from the path [cm]", ylim=(0, None))
        legend(left, place="lower left")

    return draw(f"fig7_{robot}", f"{robot}: an S path over a network, Fig. 7", paint, height=3.4)


SHORTER_ROBOT: Final = "kinematic"
SHORTER_CONTROLS: Final = (NetworkControl.DIRECT, NetworkControl.NETWORK, NetworkControl.UNSCHEDULED)
SHORTER_CASES: Final = tuple(str(path) for path in range(PATHS))


def work_shorter(study: Study, case: str) -> PathSuccess:
    """Both controls and all delay seeds on a path."""
    found = ran(study, SHORTER_ROBOT, s_path(1000 * study.seed + int(case), within=SHORTER), SHORTER_CONTROLS)
    return found._replace(tracks={})


def conclude_shorter(study: Study, results: tuple[Any, ...]) -> Findings:
    """The share of success, and what became of both controls."""
    paths: list[PathSuccess] = list(results)
    table = controls(SHORTER_ROBOT, paths, "shorter", f", T_pred {SHORTER[0]:g} to {SHORTER[1]:g} s")
    return Findings((claim(SHORTER_ROBOT, NetworkControl.NETWORK, paths, SHORTER, study.seed),), (table,), ())
