"""Section 4: path error and time difference of the architectures, in simulation and in experiment.

The paper's simulation is a robot like the model; its experiment the micro-robot under an overhead camera. Both are
run here, the 75 kg robot in PyBullet too, each under four of the measured networks. `III-capped` and `timeline` are
ours, beside them.

The micro-robot drives to scale: its path and speeds are the 75 kg robot's by the ratio of their lengths, and so is
all that the field takes in metres. What is measured of it is given as of a robot of 52 cm.
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
    none_of,
)
from interfaces.lab.driving.operators import Operator, operator
from interfaces.lab.driving.output import of_drives
from interfaces.lab.driving.run import run
from interfaces.lab.driving.sweep import LEAST_PROGRESS, comparable
from interfaces.lab.han2001.rivals import Blind, OpenLoop, Patient, Unqueued
from interfaces.lab.statistics import Estimate, bootstrap, clustered, median
from interfaces.runs.drive_run import DriveCase, DriveRun
from interfaces.teleop.architectures import Constants, Transport
from robots.ipr.model import IPR_LENGTH, MICRO_SIDE
from robots.mobile.chassis import MobileReality
from robots.onboard.driving import Drive, Posture
from robots.onboard.path_following import PathFollowingConfig
from robots.robot import USUAL_BASE, Robot, load
from vrs.comparison import PathComparison, summed_up
from vrs.model import Array

PROFILES: Final = ("domain", "mon", "wed", "thu")
TAU: Final = "3.3"
"""Correlation time of the delays [s]: 0.97 over a tenth of a second."""
IDEAL: Final = "model"
MICRO: Final = "micro"
ROBOTS: Final = (IDEAL, MICRO, "ipr")
"""The robot that is like its model, and the two in PyBullet."""
COMPOSITIONS: Final = (
    ("I", Transport.STREAM),
    ("II", Transport.STREAM),
    ("III", Transport.STREAM),
    ("III-capped", Transport.STREAM),
    ("timeline", Transport.STREAM),
    ("timeline", Transport.DATAGRAMS),
)
PRINTED: Final = COMPOSITIONS[:3]
"""The paper's, which is all that the micro-robot is driven by."""
CASES: Final = tuple(f"{robot} {profile}" for robot in ROBOTS for profile in PROFILES)
OPEN_LOOP, UNQUEUED, BLIND, PATIENT = (
    f"{each.__module__}:{each.__name__}" for each in (OpenLoop, Unqueued, Blind, Patient)
)
"""As `vrs lab --architecture` spells them."""
INSTEAD: Final = {
    OPEN_LOOP: "timeline without its tracker",
    UNQUEUED: "III without its command queue",
    BLIND: "III without the robot's posture",
    PATIENT: "timeline that waits for all packets",
}
"""What stands in a mechanism's place."""
UNHURRIED: Final = "III with T in place of T_p"
JUMPS: Final = "speeds jump"
"""Of a robot like its model that keeps no limit of its acceleration."""
CONSTANT: Final = "constant delay"
ALIKE: Final = "as its model"
"""Of a micro-robot whose wheels roll without slip, and are as they should be."""
LATE: Final = 0.5
"""A constant delay [s]."""
SCALE: Final = IPR_LENGTH / MICRO_SIDE
"""How much longer the 75 kg robot is than the micro-robot."""
FIELD: Final = PathFollowingConfig()
MINIATURE: Final = Constants(
    following=replace(
        FIELD, g=FIELD.g * SCALE ** (1 / FIELD.c), l_floor=FIELD.l_floor / SCALE, cruise=FIELD.cruise / SCALE,
        arrival=FIELD.arrival / SCALE,
    )
)  # fmt: skip
"""The same field for lengths of a miniature."""
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
    return INSTEAD.get(architecture) or (
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
    case = DriveCase(architecture, transport, f"{profile}@{TAU}", named, seed=seed, length=length)
    return replace(case, constants=MINIATURE) if robot == MICRO else case


class MiniatureOperator:
    """Drives a small robot as another drives a large one; on a bare table."""

    room = ""

    def __init__(self, who: Operator) -> None:
        """Take the other."""
        self._who = who
        self.start = _scaled(who.start, 1 / SCALE)
        self.sees_estimate = getattr(who, "sees_estimate", False)

    @property
    def finished(self) -> bool:
        """Whether he drives no more."""
        return getattr(self._who, "finished", False)

    def drive(self, t: float, posture: Posture, before: Drive) -> Drive:
        """Drive as he would."""
        v, w = self._who.drive(t, _scaled(posture, SCALE), Drive(SCALE * before.v, before.w))
        return Drive(v / SCALE, w)


def _scaled(posture: Posture, scale: float) -> Posture:
    return Posture(scale * posture.x, scale * posture.y, posture.theta)


def driven(case: DriveCase, driver: Operator | None = None) -> DriveRun:
    """Run a case; the micro-robot to scale, and what it did as of a robot of the other's length.

    Args:
        case: What to run.
        driver: Who drives a robot of that length, instead of the case's operator.
    """
    if not case.robot.startswith(MICRO):
        return run(case, driver)
    who = operator(case.operator, case.seed, case.constants.period) if driver is None else driver
    drive, larger = run(case, MiniatureOperator(who)), np.array([SCALE, SCALE, 1.0])
    moved = {each: larger * getattr(drive, each) for each in ("virtual", "real", "estimated")}
    return replace(drive, **moved)


def rivals(case: str, seed: int, length: float, body: str) -> Iterator[tuple[str, DriveCase]]:
    """What else is run of a case, by name: what a claim's mechanism is switched off in, or its rival."""
    robot, profile = case.split()
    of = partial(case_of, robot, profile, seed=seed, length=length, body=body)
    last = profile == PROFILES[-1]
    third = of("III", Transport.STREAM)
    if last and robot != MICRO:
        yield name(UNQUEUED, Transport.STREAM), of(UNQUEUED, Transport.STREAM)
        T = third.constants.period
        yield UNHURRIED, replace(third, constants=Constants(processing=T))
    if last and robot != IDEAL:
        yield name(BLIND, Transport.STREAM), of(BLIND, Transport.STREAM)
    if robot == "ipr":
        for who in ("III", OPEN_LOOP):
            yield name(who, Transport.DATAGRAMS), of(who, Transport.DATAGRAMS)
        if last:
            yield name(PATIENT, Transport.DATAGRAMS), of(PATIENT, Transport.DATAGRAMS)
            for transport in Transport:
                steady = replace(of("III", transport), delay=f"constant:{LATE}")
                yield f"{name('III', transport)}, {CONSTANT}", steady
    elif robot == IDEAL:
        for who in ("I", "II"):
            yield f"{who}, {JUMPS}", replace(of(who, Transport.STREAM), known=_unlimited())
            if profile == PROFILES[0]:
                yield f"{who}, {CONSTANT}", replace(of(who, Transport.STREAM), delay=f"constant:{LATE}")
    elif last:
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
    for architecture, transport in PRINTED if robot == MICRO else COMPOSITIONS:
        found = []
        for k in range(study.runs):
            seed = study.seed + k
            drive = driven(case_of(robot, profile, architecture, transport, seed, study.length, study.body))
            found.append(seen(drive))
            if k == 0 and case in DRAWN:
                first[name(architecture, transport)] = drive
        runs[name(architecture, transport)] = tuple(found)
    others = [dict(rivals(case, study.seed + k, study.length, study.body)) for k in range(study.runs)]
    for who in others[0]:
        runs[who] = tuple(seen(driven(each[who])) for each in others)
    return Results(runs=runs, first=first)


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """The paper's claims, then ours."""
    found: dict[str, Results] = dict(zip(CASES, results, strict=True))
    figures = []
    for case in DRAWN:
        robot, profile = case.split()
        scale = f" × {SCALE:.2f}" if robot == MICRO else ""
        drawn = of_drives(found[case].first, f"{robot}{scale}, {profile}, seed {study.seed}")
        figures += [replace(picture, name=f"{robot}_{picture.name}") for picture in drawn]
    ours = (claim for profile in PROFILES for claim in _of_network(study, profile, found[f"ipr {profile}"].runs))
    claims = (*_papers(study, found), *_rivalled(study, found), *ours)
    return Findings(claims, (_table(found),), tuple(figures))


def _pooled(
    found: dict[str, Results],
    cases: Sequence[str],
    who: str,
    value: Callable[[ArchitectureResult], float],
) -> Array:
    """A figure of every run of some cases, (seeds, cases): a seed's operator and his way are the same in all."""
    return np.array([[value(one) for one in found[case].runs[who]] for case in cases]).T


def _papers(study: Study, found: dict[str, Results]) -> tuple[Claim, ...]:
    of = partial(_pooled, found)
    sim, micro, heavy = ([f"{robot} {profile}" for profile in PROFILES] for robot in ROBOTS)
    real, slow = (*micro, *heavy), [case for case in sim if not case.endswith("domain")]
    steady, last, both = sim[:1], [micro[-1]], [micro[-1], heavy[-1]]

    def middle(cases: Sequence[str], who: str) -> Estimate:
        return clustered(of(cases, who, _largest), study.seed, median)

    def mean(values: Array) -> Estimate:
        return clustered(values, study.seed)

    less = partial(_less, found, study.seed)
    jumping = f"II, {JUMPS}"
    return (
        above(
            "I: the path error accumulates, last third less first third [cm]",
            f"{SECTION}.1, Fig. 12(a)", 5.0, mean(of(sim, "I", _growth)),
            (f"a constant delay of {LATE} s", mean(of(steady, f"I, {CONSTANT}", _growth))),
        ),
        at_most(
            "II keeps the path in simulation, where speeds jump: median of the largest path error [cm]",
            f"{SECTION}.1, Fig. 12(c)", 2.0, middle(sim, jumping), ("I", middle(sim, f"I, {JUMPS}")),
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
        less(
            "III has a smaller path error than I in simulation: I − III, largest [cm]",
            f"{SECTION}.1, Fig. 12(e)", _largest, sim, "III", ("I",), (sim[-1:], INSTEAD[UNQUEUED]),
        ),
        less(
            "III has a smaller time difference than II (mon, wed, thu): II − III, mean [s]",
            f"{SECTION}.1, Fig. 12(f)", _late, slow, "III", ("II",), (sim[-1:], UNHURRIED),
        ),
        above(
            "II's path error is large in the experiment: micro-robot − simulation where speeds jump, largest [cm]",
            f"{SECTION}.2, Fig. 16(c)", 10.0, mean(of(micro, "II", _largest) - of(sim, jumping, _largest)),
            (
                "a micro-robot that is like its model",
                mean(of(last, f"II, {ALIKE}", _largest) - of(sim[-1:], jumping, _largest)),
            ),
        ),
        at_most(
            "III's path error stays small in the experiment, both bodies: median of the largest [cm]",
            f"{SECTION}.2, Fig. 16(e)", 10.0, middle(real, "III"), ("II", middle(real, "II")),
        ),
        less(
            "III has a smaller path error than II in the experiment, both bodies: II − III, largest [cm]",
            f"{SECTION}.2, Fig. 16", _largest, real, "III", ("II",), (both, INSTEAD[BLIND]),
        ),
    )  # fmt: skip


def _less(
    found: dict[str, Results],
    seed: int,
    text: str,
    source: str,
    value: Callable[[ArchitectureResult], float],
    cases: Sequence[str],
    who: str,
    than: Sequence[str],
    without: tuple[Sequence[str], str],
) -> Claim:
    """A claim that a figure is surely less than all of some others', seed by seed.

    Args:
        found: All runs.
        seed: Of the resampling.
        text: What is claimed.
        source: Where.
        value: The figure.
        cases: Of which runs.
        who: Whose.
        than: The others.
        without: Cases in which the mechanism is off, and who drives there in its place.
    """

    def saved(those: Sequence[str], whose: str) -> Estimate:
        others = np.min([_pooled(found, those, other, value) for other in than], axis=0)
        return clustered(others - _pooled(found, those, whose, value), seed)

    where, instead = without
    return above(text, source, 0.0, saved(cases, who), (instead, saved(where, instead)))


def _rivalled(study: Study, found: dict[str, Results]) -> tuple[Claim, ...]:
    """What III and `timeline` do better than others on the 75 kg robot, under all networks together."""
    heavy = [f"ipr {profile}" for profile in PROFILES]
    slow, last = heavy[1:], heavy[-1:]
    less = partial(_less, found, study.seed)
    third = THIRD_REPEATED
    steady = clustered(
        _pooled(found, last, f"III, {CONSTANT}", _late) - _pooled(found, last, f"{third}, {CONSTANT}", _late),
        study.seed,
    )
    sooner = clustered(_pooled(found, slow, "III", _late) - _pooled(found, slow, third, _late), study.seed)
    return (
        less(
            "75 kg: III has a smaller path error than I: I − III, largest [cm]", OWN_BAR, _largest, heavy, "III",
            ("I",), (last, INSTEAD[UNQUEUED]),
        ),
        less(
            "75 kg: III has a smaller time difference than I and II (mon, wed, thu): the lesser − III, mean [s]",
            OWN_BAR, _late, slow, "III", ("I", "II"), (last, UNHURRIED),
        ),
        above(
            f"75 kg: III is sooner on datagrams (mon, wed, thu): time difference, III − {third}, mean [s]",
            OWN_BAR, 0.0, sooner, (f"a constant delay of {LATE} s", steady),
        ),
        less(
            f"75 kg: timeline is sooner than III on the same datagrams: {third} − {REPEATED}, mean [s]",
            OWN_BAR, _late, heavy, REPEATED, (third,), (last, INSTEAD[PATIENT]),
        ),
        *(
            less(
                f"75 kg: {who} keeps the operator's speeds better than III (mon, wed, thu): III − {who} [cm/s]",
                OWN_BAR, _speed, slow, who, ("III",), (slow, "III-capped"),
            )
            for who in (STREAMED, REPEATED)
        ),
    )  # fmt: skip


STREAMED: Final = name("timeline", Transport.STREAM)
REPEATED: Final = name("timeline", Transport.DATAGRAMS)
THIRD_REPEATED: Final = name("III", Transport.DATAGRAMS)
UNTRACKED: Final = INSTEAD[OPEN_LOOP]


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

    def kept(who: str, text: str, bar: float, figure: Callable[[str], float], rival: str = UNTRACKED) -> Claim:
        """A figure must keep a bar that a rival's doesn't."""
        return at_most(f"{profile}: {who}: {text}", OWN_BAR, bar, figure(who), (rival, figure(rival)))

    over, largest, late = middle("III-capped").value, mean("III", _largest), mean("III", _late)
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
        yield none_of(
            f"{profile}: {who}: collisions and limits passed", OWN_BAR, sum(map(_broken, runs[who])),
            (UNTRACKED, sum(map(_broken, runs[UNTRACKED]))),
        )  # fmt: skip
    # A stream makes everybody wait alike: where packets are late, that it's no worse is all that's claimed there.
    text = "mean time difference as a share of III's"
    bar, rival = (1.1, "II") if slow else (0.9, "III-capped")
    yield kept(STREAMED, text, bar, lambda one: mean(one, _late) / late, rival)


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
