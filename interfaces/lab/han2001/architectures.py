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

from interfaces.lab.claims import OWN_BAR, Claim, Findings, Results, Study, Table
from interfaces.lab.driving.output import of_drives
from interfaces.lab.driving.run import run
from interfaces.lab.driving.sweep import LEAST_PROGRESS, comparable
from interfaces.lab.statistics import Estimate, bootstrap, clustered, median
from interfaces.runs.drive_run import DriveCase, DriveRun
from interfaces.teleop.architectures import Transport
from robots.mobile.chassis import MobileReality
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


def _above_zero(text: str, source: str, values: Array, seed: int) -> Claim:
    """It holds if the mean of a figure, (seeds, cases), is surely over zero."""
    estimate = clustered(values, seed)
    return Claim(text, source, "over 0", estimate.value, estimate.low > 0, estimate.interval)


def _papers(study: Study, found: dict[str, Results]) -> tuple[Claim, ...]:
    of = partial(_pooled, found)
    sim, micro, heavy = ([f"{robot} {profile}" for profile in PROFILES] for robot in ROBOTS)
    real, slow = (*micro, *heavy), [case for case in sim if not case.endswith("domain")]
    ii_sim = clustered(of(sim, "II", _largest), study.seed, median)
    iii_real = clustered(of(real, "III", _largest), study.seed, median)
    return (
        _above_zero(
            "I: the path error accumulates, last third less first third [cm]",
            f"{SECTION}.1, Fig. 12(a)", of(sim, "I", lambda one: 100 * one.growth_error), study.seed,
        ),
        Claim(
            "II keeps the path in simulation: median of the largest path error [cm]",
            f"{SECTION}.1, Fig. 12(c)", "under 2", ii_sim.value, ii_sim.high < 2.0, ii_sim.interval,
        ),
        _above_zero(
            "II: the time difference grows (mon, wed, thu), last third less first third [s]",
            f"{SECTION}.1, Fig. 12(d)", of(slow, "II", lambda one: one.growth_late), study.seed,
        ),
        _above_zero(
            "III has a smaller path error than I in simulation: I − III, largest [cm]",
            f"{SECTION}.1, Fig. 12(e)", of(sim, "I", _largest) - of(sim, "III", _largest), study.seed,
        ),
        _above_zero(
            "III has a smaller time difference than II (mon, wed, thu): II − III, mean [s]",
            f"{SECTION}.1, Fig. 12(f)", of(slow, "II", _late) - of(slow, "III", _late), study.seed,
        ),
        _above_zero(
            "II's path error is large in the experiment: micro-robot − simulation, largest [cm]",
            f"{SECTION}.2, Fig. 16(c)", of(micro, "II", _largest) - of(sim, "II", _largest), study.seed,
        ),
        Claim(
            "III's path error stays small in the experiment, both bodies: median of the largest [cm]",
            f"{SECTION}.2, Fig. 16(e)", "under 10", iii_real.value, iii_real.high < 10.0, iii_real.interval,
        ),
        _above_zero(
            "III has a smaller path error than II in the experiment, both bodies: II − III, largest [cm]",
            f"{SECTION}.2, Fig. 16", of(real, "II", _largest) - of(real, "III", _largest), study.seed,
        ),
    )  # fmt: skip


STREAMED: Final = name("timeline", Transport.STREAM)
REPEATED: Final = name("timeline", Transport.DATAGRAMS)
SHARES: Final = {"mon": 0.75, "wed": 0.6, "thu": 0.6}
"""Largest share of III's time difference that `timeline` on datagrams may have."""


def _most(text: str, bar: float, measured: float | Estimate) -> Claim:
    """It must be no more than the bar."""
    value = measured.value if isinstance(measured, Estimate) else measured
    interval = measured.interval if isinstance(measured, Estimate) else None
    return Claim(text, OWN_BAR, f"{bar:.4g} at most", value, value <= bar, interval)


def _largest(one: ArchitectureResult) -> float:
    return 100 * one.worst


def _late(one: ArchitectureResult) -> float:
    return one.late


def _speed(one: ArchitectureResult) -> float:
    return 100 * (one.path.speed_error or 0.0)


def _of_network(study: Study, profile: str, runs: Runs) -> Iterator[Claim]:
    """What III and `timeline` must show on the 75 kg robot under one network."""
    slow = profile != "domain"

    def mean(who: str, value: Callable[[ArchitectureResult], float]) -> float:
        return float(np.mean([value(one) for one in runs[who]]))

    def middle(who: str) -> Estimate:
        return bootstrap([_largest(one) for one in runs[who]], study.seed, median)

    def more(text: str, first: str, second: str, value: Callable[[ArchitectureResult], float]) -> Claim:
        """A figure of the first must be above that of the second, seed by seed."""
        difference = [[value(a) - value(b)] for a, b in zip(runs[first], runs[second], strict=True)]
        text = f"{profile}: {text}: {first} − {second}"
        return _above_zero(text, OWN_BAR, np.array(difference), study.seed)

    yield more("largest path error [cm]", "I", "III", _largest)
    for other in ("I", "II") if slow else ():
        yield more("mean time difference [s]", other, "III", _late)
    for who in (STREAMED, REPEATED):
        # The path, the progress, the speeds and the limits that `timeline` keeps on a transport.
        said, largest = f"{profile}: {who}", middle(who)
        yield _most(f"{said}: largest path error, median [cm]", 2.0, largest)
        yield _most(f"{said}: largest path error, worst seed [cm]", 5.0, max(map(_largest, runs[who])))
        yield _most(f"{said}: its median less III-capped's [cm]", 0.2, largest.value - middle("III-capped").value)
        if profile in ("wed", "thu"):
            share = mean(who, _largest) / mean("III", _largest)
            yield _most(f"{said}: largest path error, mean, as a share of III's", 0.2, share)
        missed = max(1.0 - (one.path.progress or 0.0) for one in runs[who])
        yield _most(f"{said}: largest share of the path not reached", 1.0 - LEAST_PROGRESS, missed)
        if slow:
            yield more("speed-profile error [cm/s]", "III", who, _speed)
        broken = sum(one.collisions + one.limits_passed for one in runs[who])
        yield _most(f"{said}: collisions and limits passed", 0, broken)
    third, streamed, repeated = (mean(who, _late) for who in ("III", STREAMED, REPEATED))
    share_of = "mean time difference as a share of III's"
    yield _most(f"{profile}: {STREAMED}: {share_of}", 1.1, streamed / third)
    if slow:
        yield _most(f"{profile}: {REPEATED}: {share_of}", SHARES[profile], repeated / third)
    else:
        yield _most(f"{profile}: {REPEATED}: mean time difference [s]", 0.5, repeated)


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
