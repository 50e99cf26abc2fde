"""Section 4: path error and time difference of the architectures, in simulation and in experiment.

The paper's simulation is a robot like the model; its experiment the micro-robot under an overhead camera. Both are
run here, the 75 kg robot in PyBullet too, each under four of the measured networks. `III-capped` and `timeline` are
ours, beside them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from interfaces.lab.claims import (
    OWN_BAR,
    Claim,
    Findings,
    Results,
    Study,
    Table,
    above,
    at_most,
    beats,
    none_of,
)
from interfaces.lab.driving.output import of_drives
from interfaces.lab.driving.run import run
from interfaces.lab.driving.sweep import LEAST_PROGRESS, comparable
from interfaces.lab.han2001.rivals import OpenLoop
from interfaces.lab.statistics import Estimate, bootstrap, clustered, median
from interfaces.runs.drive_run import DriveCase, DriveRun
from interfaces.teleop.architectures import Transport
from robots.mobile.chassis import MobileReality
from robots.robot import USUAL_BASE, Robot, load
from vrs.comparison import PathComparison, summed_up
from vrs.model import Array

PROFILES: Final = ("domain", "mon", "wed", "thu")
TAU: Final = "3.3"
"""Correlation time of the delays [s]: 0.97 over a tenth of a second."""
IDEAL: Final = "model"
ROBOTS: Final = (IDEAL, "micro", "ipr")
"""The robot that is like its model, and the two in PyBullet."""
COMPOSITIONS: Final = (
    ("I", Transport.STREAM),
    ("II", Transport.STREAM),
    ("III", Transport.STREAM),
    ("III-capped", Transport.STREAM),
    ("timeline", Transport.STREAM),
    ("timeline", Transport.DATAGRAMS),
)
CASES: Final = tuple(f"{robot} {profile}" for robot in ROBOTS for profile in PROFILES)
OPEN_LOOP: Final = f"{OpenLoop.__module__}:{OpenLoop.__name__}"
JUMPS: Final = "speeds jump"
"""Of a robot like its model that keeps no limit of its acceleration."""
CONSTANT: Final = "constant delay"
ALIKE: Final = "as its model"
"""Of a micro-robot whose wheels roll without slip, and are as they should be."""
LATE: Final = 0.5
"""A constant delay [s]."""
SECTION: Final = "Section 4"


class ArchitectureResult(NamedTuple):
    """Figures of a run."""

    path: PathComparison
    growth_error: float
    """Mean path error in the last third less that in the first [m]."""
    growth_late: float
    """Mean time difference in the last third of the path less that in the first [s]."""
    collisions: int
    limits_passed: int

    @property
    def late(self) -> float:
        """Mean time difference, or its bound [s]."""
        found = comparable(self.path, "time_difference_mean")
        return math.inf if found is None else found

    @property
    def worst(self) -> float:
        """Largest path error [m]."""
        return self.path.path_error_max or 0.0


Runs: TypeAlias = dict[str, tuple[ArchitectureResult, ...]]
"""By composition, a run a seed."""


def name(architecture: str, transport: Transport) -> str:
    """A composition in words."""
    if architecture == OPEN_LOOP:
        return "timeline without its tracker"
    return (
        architecture
        if transport is Transport.STREAM and architecture != "timeline"
        else f"{architecture}, {transport}"
    )


def case_of(
    robot: str, profile: str, architecture: str, transport: Transport, seed: int, length: float, body: str = ""
) -> DriveCase:
    """A run of the table; the bodies in physics in another world than the usual one where it's named."""
    if robot == IDEAL:
        reality = MobileReality.ideal(dt=1 / 60)
        return DriveCase(
            architecture, transport, f"{profile}@{TAU}", "bare", seed=seed, length=length, reality=reality
        )
    named = f"{robot}@{body}" if body else robot
    return DriveCase(architecture, transport, f"{profile}@{TAU}", named, seed=seed, length=length)


def rivals(case: str, seed: int, length: float, body: str) -> Iterator[tuple[str, DriveCase]]:
    """What else is run of a case, by name: what a claim's mechanism is switched off in, or its rival."""
    robot, profile = case.split()
    of = partial(case_of, robot, profile, seed=seed, length=length, body=body)
    if robot == "ipr":
        for who in ("III", OPEN_LOOP):
            yield name(who, Transport.DATAGRAMS), of(who, Transport.DATAGRAMS)
    elif robot == IDEAL:
        for who in ("I", "II"):
            yield f"{who}, {JUMPS}", replace(of(who, Transport.STREAM), known=_unlimited())
            if profile == PROFILES[0]:
                yield f"{who}, {CONSTANT}", replace(of(who, Transport.STREAM), delay=f"constant:{LATE}")
    elif profile == PROFILES[-1]:
        yield f"II, {ALIKE}", replace(of("II", Transport.STREAM), reality=MobileReality.ideal())


def _unlimited() -> Robot:
    """The usual mobile robot, if its speeds could jump."""
    robot = load(USUAL_BASE)
    limits = replace(robot.base.limits, a_max=100.0)
    return replace(robot, model=replace(robot.base, limits=limits))


def seen(drive: DriveRun) -> ArchitectureResult:
    """Sum up a run."""
    match = drive.match()
    driven = match.distance[match.t <= drive.case.length]
    late = match.time_difference[1]
    return ArchitectureResult(
        summed_up(match), growth(driven), growth(late), drive.collisions, drive.limits_passed()
    )  # fmt: skip


def growth(values: Array) -> float:
    """How much larger the mean of the last third is than that of the first."""
    third = len(values) // 3
    return float(values[-third:].mean() - values[:third].mean()) if third else 0.0


DRAWN: Final = ("model thu", "micro thu")
"""Cases whose first runs are drawn: like Figures 11, 12 and 15, 16."""


def work(study: Study, case: str) -> Results:
    """All compositions and seeds of a case; and of a case that is drawn the first seed's runs."""
    robot, profile = case.split()
    runs: Runs = {}
    first: dict[str, DriveRun] = {}
    for architecture, transport in COMPOSITIONS:
        found = []
        for k in range(study.runs):
            seed = study.seed + k
            drive = run(case_of(robot, profile, architecture, transport, seed, study.length, study.body))
            found.append(seen(drive))
            if k == 0 and case in DRAWN:
                first[name(architecture, transport)] = drive
        runs[name(architecture, transport)] = tuple(found)
    others = [dict(rivals(case, study.seed + k, study.length, study.body)) for k in range(study.runs)]
    for who in others[0]:
        runs[who] = tuple(seen(run(each[who])) for each in others)
    return Results(runs=runs, first=first)


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """The paper's claims, then ours."""
    found: dict[str, Results] = dict(zip(CASES, results, strict=True))
    figures = []
    for case in DRAWN:
        robot, profile = case.split()
        drawn = of_drives(found[case].first, f"{robot}, {profile}, seed {study.seed}")
        figures += [replace(picture, name=f"{robot}_{picture.name}") for picture in drawn]
    ours = (claim for profile in PROFILES for claim in _of_network(study, profile, found[f"ipr {profile}"].runs))
    claims = (*_papers(study, found), *ours)
    return Findings(claims, (_table(found),), tuple(figures))


def _pooled(
    found: dict[str, Results],
    cases: Sequence[str],
    who: str,
    value: Callable[[ArchitectureResult], float],
) -> Array:
    """A figure of every run of some cases, (seeds, cases): a seed's operator and his way are the same in all."""
    return np.array([[value(one) for one in found[case].runs[who]] for case in cases]).T


def _beats(text: str, source: str, rival: tuple[str, Array], ours: Array, seed: int) -> Claim:
    """A claim that a figure, (seeds, cases), is surely less than a rival's, seed by seed."""
    what, theirs = rival
    return beats(text, source, clustered(theirs - ours, seed), (f"{what} itself", clustered(theirs, seed)))


def _papers(study: Study, found: dict[str, Results]) -> tuple[Claim, ...]:
    of = partial(_pooled, found)
    sim, micro, heavy = ([f"{robot} {profile}" for profile in PROFILES] for robot in ROBOTS)
    real, slow = (*micro, *heavy), [case for case in sim if not case.endswith("domain")]
    steady, last = sim[:1], [micro[-1]]

    def middle(cases: Sequence[str], who: str) -> Estimate:
        return clustered(of(cases, who, _largest), study.seed, median)

    def mean(values: Array) -> Estimate:
        return clustered(values, study.seed)

    return (
        above(
            "I: the path error accumulates, last third less first third [cm]",
            f"{SECTION}.1, Fig. 12(a)", 5.0, mean(of(sim, "I", _growth)),
            (f"a constant delay of {LATE} s", mean(of(steady, f"I, {CONSTANT}", _growth))),
        ),
        at_most(
            "II keeps the path in simulation, where speeds jump: median of the largest path error [cm]",
            f"{SECTION}.1, Fig. 12(c)", 2.0, middle(sim, f"II, {JUMPS}"), ("I", middle(sim, f"I, {JUMPS}")),
        ),
        at_most(
            "and so does a robot with a limit of its acceleration: median of the largest path error [cm]",
            f"{SECTION}.1, Fig. 12(c); {OWN_BAR}", 2.0, middle(sim, "II"), ("I", middle(sim, "I")),
        ),
        above(
            "II: the time difference grows (mon, wed, thu), last third less first third [s]",
            f"{SECTION}.1, Fig. 12(d)", 1.0, mean(of(slow, "II", lambda one: one.growth_late)),
            (f"a constant delay of {LATE} s", mean(of(steady, f"II, {CONSTANT}", lambda one: one.growth_late))),
        ),
        _beats(
            "III has a smaller path error than I in simulation: I − III, largest [cm]",
            f"{SECTION}.1, Fig. 12(e)", ("I", of(sim, "I", _largest)), of(sim, "III", _largest), study.seed,
        ),
        _beats(
            "III has a smaller time difference than II (mon, wed, thu): II − III, mean [s]",
            f"{SECTION}.1, Fig. 12(f)", ("II", of(slow, "II", _late)), of(slow, "III", _late), study.seed,
        ),
        above(
            "II's path error is large in the experiment: micro-robot − simulation, largest [cm]",
            f"{SECTION}.2, Fig. 16(c)", 10.0, mean(of(micro, "II", _largest) - of(sim, "II", _largest)),
            (
                "a micro-robot that is like its model",
                mean(of(last, f"II, {ALIKE}", _largest) - of(sim[-1:], "II", _largest)),
            ),
        ),
        at_most(
            "III's path error stays small in the experiment, both bodies: median of the largest [cm]",
            f"{SECTION}.2, Fig. 16(e)", 10.0, middle(real, "III"), ("II", middle(real, "II")),
        ),
        _beats(
            "III has a smaller path error than II in the experiment, both bodies: II − III, largest [cm]",
            f"{SECTION}.2, Fig. 16", ("II", of(real, "II", _largest)), of(real, "III", _largest), study.seed,
        ),
    )  # fmt: skip


STREAMED: Final = name("timeline", Transport.STREAM)
REPEATED: Final = name("timeline", Transport.DATAGRAMS)
THIRD_REPEATED: Final = name("III", Transport.DATAGRAMS)
UNTRACKED: Final = name(OPEN_LOOP, Transport.DATAGRAMS)


def _largest(one: ArchitectureResult) -> float:
    return 100 * one.worst


def _growth(one: ArchitectureResult) -> float:
    return 100 * one.growth_error


def _late(one: ArchitectureResult) -> float:
    return one.late


def _speed(one: ArchitectureResult) -> float:
    return 100 * (one.path.speed_error or 0.0)


def _missed(one: ArchitectureResult) -> float:
    return 1.0 - (one.path.progress or 0.0)


def _broken(one: ArchitectureResult) -> int:
    return one.collisions + one.limits_passed


def _of_network(study: Study, profile: str, runs: Runs) -> Iterator[Claim]:
    """What III and `timeline` must show on the 75 kg robot under one network."""
    slow = profile != "domain"

    def values(who: str, value: Callable[[ArchitectureResult], float]) -> Array:
        return np.array([[value(one)] for one in runs[who]])

    def mean(who: str, value: Callable[[ArchitectureResult], float]) -> float:
        return float(values(who, value).mean())

    def middle(who: str) -> Estimate:
        return bootstrap([_largest(one) for one in runs[who]], study.seed, median)

    def less(text: str, who: str, rival: str, value: Callable[[ArchitectureResult], float]) -> Claim:
        """A figure must be below a rival's, seed by seed."""
        text = f"{profile}: {text}: {rival} − {who}"
        return _beats(text, OWN_BAR, (rival, values(rival, value)), values(who, value), study.seed)

    def kept(who: str, text: str, bar: float, figure: Callable[[str], float], rival: str = UNTRACKED) -> Claim:
        """A figure must keep a bar that a rival's doesn't."""
        return at_most(f"{profile}: {who}: {text}", OWN_BAR, bar, figure(who), (rival, figure(rival)))

    over, largest, late = middle("III-capped").value, mean("III", _largest), mean("III", _late)
    yield less("largest path error [cm]", "III", "I", _largest)
    for other in ("I", "II") if slow else ():
        yield less("mean time difference [s]", "III", other, _late)
    for who in (STREAMED, REPEATED):
        # The path, the progress, the speeds and the limits that `timeline` keeps on a transport.
        yield at_most(
            f"{profile}: {who}: largest path error, median [cm]", OWN_BAR, 2.0, middle(who).value,
            (UNTRACKED, middle(UNTRACKED)),
        )  # fmt: skip
        yield kept(who, "largest path error, worst seed [cm]", 5.0, lambda one: values(one, _largest).max())
        yield kept(who, "its median less III-capped's [cm]", 0.2, lambda one: middle(one).value - over)
        missed = round(1.0 - LEAST_PROGRESS, 4)
        yield kept(
            who, "largest share of the path not reached", missed, lambda one: values(one, _missed).max(), "I"
        )
        if profile in ("wed", "thu"):
            text = "largest path error, mean, as a share of III's"
            yield kept(who, text, 0.2, lambda one: mean(one, _largest) / largest)
        if slow:
            yield less("speed-profile error [cm/s]", who, "III", _speed)
        yield none_of(
            f"{profile}: {who}: collisions and limits passed", OWN_BAR, sum(map(_broken, runs[who])),
            (UNTRACKED, sum(map(_broken, runs[UNTRACKED]))),
        )  # fmt: skip
    if slow:
        # A stream makes everybody wait alike: that it's no worse is all that's claimed there.
        text = "mean time difference as a share of III's"
        yield kept(STREAMED, text, 1.1, lambda one: mean(one, _late) / late, "II")
        yield less("mean time difference [s]", THIRD_REPEATED, "III", _late)
    else:
        yield less("mean time difference [s]", STREAMED, "III", _late)
    yield less("mean time difference [s]", REPEATED, THIRD_REPEATED, _late)


def _table(found: dict[str, Results]) -> Table:
    rows = []
    for case in CASES:
        robot, profile = case.split()
        for who, runs in found[case].runs.items():
            largest = [_largest(one) for one in runs]
            rows.append(
                (
                    ("robot", robot),
                    ("network", profile),
                    ("architecture", who),
                    ("largest path error, median [cm]", float(np.median(largest))),
                    ("worst [cm]", max(largest)),
                    (
                        "path error, mean [cm]",
                        float(np.mean([100 * (one.path.path_error_mean or 0.0) for one in runs])),
                    ),
                    ("time difference [s]", float(np.mean([one.late for one in runs]))),
                    ("speed error [cm/s]", float(np.mean([_speed(one) for one in runs]))),
                    ("least progress", float(min(one.path.progress or 0.0 for one in runs))),
                    ("collisions", sum(one.collisions for one in runs)),
                )
            )
    return Table.of("architectures", f"Architectures, correlation time {TAU} s", rows)
