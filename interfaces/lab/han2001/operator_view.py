"""Section 3.1: what the posture estimator does to the robot that the operator sees.

The loop is closed: an operator follows a course by where the estimator moves the virtual robot, eq. (8)–(10). On
the same network another one sees it where his commands lead, by dead reckoning: that's the estimator switched off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from typing_extensions import override

from interfaces.lab.claims import OWN_BAR, Cell, Findings, Study, Table, above, at_most
from interfaces.lab.control.operators import Driver, Follower, Wheels
from interfaces.lab.control.study import course, measured
from interfaces.lab.han2001.architectures import ALIKE, CONSTANT, IDEAL, LATE, MICRO, case_of, driven
from interfaces.lab.statistics import Estimate, clustered, median
from interfaces.runs.drive_run import DriveCase, DriveRun
from interfaces.teleop.architectures import Transport
from interfaces.teleop.architectures.compositions import CONTROL
from robots.mobile.chassis import MobileReality
from robots.onboard.driving import Drive, Posture
from vrs.model import Array

PROFILES: Final = ("mon", "thu")
CASES: Final = (*(f"{IDEAL} {profile}" for profile in PROFILES), f"{MICRO} {PROFILES[-1]}")
RECKONED: Final = "dead reckoning"
PROMPT: Final = "no delay"
SLIPPERY: Final = 10.0
"""How much more the robot slips whose model is worse than ours."""
SLIPS: Final = f"slips {SLIPPERY:g} times as much"


class EstimateDriver(Driver):
    """Follows a course by where the posture estimator moves the virtual robot, unless it's switched off."""

    def __init__(self, seed: int, *, sees_estimate: bool) -> None:
        """Take a seed's course."""
        self.line = course("base", np.random.default_rng([seed, 5]))
        (x, y), (dx, dy) = self.line.points[0].tolist(), (self.line.points[1] - self.line.points[0]).tolist()
        self._follower = Follower(self.line, Wheels())
        super().__init__(self._follower, Posture(x, y, math.atan2(dy, dx)), sees_real=False)
        self.sees_estimate = sees_estimate

    @property
    @override
    def finished(self) -> bool:
        """He never is: what he sees may still be moved."""
        return False

    @override
    def drive(self, t: float, posture: Posture, before: Drive) -> Drive:
        """Follow the course; at its end stand, and go on if the robot is moved away from there."""
        self._follower.finished = False
        return super().drive(t, posture, before)


class OperatorView(NamedTuple):
    """Figures of a run [s, then cm]."""

    time: float
    """Until the real robot is at the course's end; as long as the run where it never is."""
    error: float
    """Of the real robot's path from the course, mean."""
    left: float
    """From where the real robot came to rest to the course's end."""
    apart: float
    """Between the real robot and where the estimator has it, in the end."""
    reckoned: float
    """Between the real robot and where the commands lead, in the end."""
    jump: float
    """Largest step of what the estimator moves that no command made."""
    jumped: float
    """All of them together, of a metre that was driven."""


def cases(case: str, seed: int, length: float) -> Iterator[tuple[str, DriveCase, bool]]:
    """What is run: its name, the case, and whether the estimator is on."""
    robot, profile = case.split()
    of = partial(case_of, robot, profile, transport=Transport.STREAM, seed=seed, length=length)
    for who in ("I", "II", "III"):
        yield who, of(architecture=who), True
    if robot == MICRO:
        yield f"II, {ALIKE}", replace(of(architecture="II"), reality=MobileReality.ideal()), True
        usual = MobileReality()
        right, left = (SLIPPERY * slip for slip in usual.slip)
        slips = replace(usual, slip=(right, left), slip_spread=SLIPPERY * usual.slip_spread)
        yield f"II, {SLIPS}", replace(of(architecture="II"), reality=slips), True
        return
    yield f"I, {RECKONED}", of(architecture="I"), False
    if profile == PROFILES[-1]:
        yield f"I, {CONSTANT}", replace(of(architecture="I"), delay=f"constant:{LATE}"), True
        for who in ("I", "III"):
            yield f"{who}, {PROMPT}", replace(of(architecture=who), delay="none"), True
        yield f"I, {RECKONED}, {PROMPT}", replace(of(architecture="I"), delay="none"), False


def jumps(drive: DriveRun) -> Array:
    """Steps of what the estimator moves that no command made, from one command to the next [m], (k,)."""
    every = round(drive.case.constants.period / CONTROL)
    led = drive.virtual[every::every]
    shown = drive.estimated[::every][: len(led)]
    turn = (shown - led)[:-1, 2]
    (x, y), (c, s) = np.diff(led[:, :2], axis=0).T, (np.cos(turn), np.sin(turn))
    commanded = np.column_stack([c * x - s * y, s * x + c * y])
    return np.asarray(np.linalg.norm(np.diff(shown[:, :2], axis=0) - commanded, axis=1))


def view(case: DriveCase, *, sees_estimate: bool) -> OperatorView:
    """Run a case, and sum it up."""
    driver = EstimateDriver(case.seed, sees_estimate=sees_estimate)
    drive = driven(case, driver)
    came = measured("base", driver.line, drive.t, drive.real[:, :2], driver.who)
    real, steps = drive.real[-1, :2], jumps(drive)
    way = float(np.linalg.norm(np.diff(drive.virtual[:, :2], axis=0), axis=1).sum())
    off = (0.01 * came.time, came.error, *(
        math.dist(real, other) for other in (driver.line.points[-1], drive.estimated[-1, :2], drive.virtual[-1, :2])
    ), steps.max(), steps.sum() / max(way, 1e-9))  # fmt: skip
    return OperatorView(*(100 * float(figure) for figure in off))


def work(study: Study, case: str) -> dict[str, tuple[OperatorView, ...]]:
    """All that is run of a case, by name, a run a seed."""
    found: dict[str, list[OperatorView]] = {}
    for seed in range(study.seed, study.seed + study.runs):
        for who, one, estimated in cases(case, seed, study.length):
            found.setdefault(who, []).append(view(one, sees_estimate=estimated))
    return {who: tuple(runs) for who, runs in found.items()}


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """The paper's claims, and the table of all that was run."""
    found = dict(zip(CASES, results, strict=True))
    model, micro = CASES[:-1], CASES[-1:]
    last = model[-1:]

    def of(those: Sequence[str], who: str, figure: str) -> Array:
        return np.array([[getattr(one, figure) for one in found[case][who]] for case in those]).T

    def middle(those: Sequence[str], who: str, figure: str) -> Estimate:
        return clustered(of(those, who, figure), study.seed, median)

    def saved(those: Sequence[str], who: str, than: str, figure: str) -> Estimate:
        return clustered(of(those, than, figure) - of(those, who, figure), study.seed)

    claims = (
        at_most(
            "I: the estimator corrects the error between both robots: how far they're apart in the end, median "
            "[cm]",
            f"Section 3.1, eq. (8)–(10); {OWN_BAR}", 2.0, middle(model, "I", "apart"),
            (f"{RECKONED}, of the same runs", middle(model, "I", "reckoned")),
        ),
        above(
            f"I: and so brings the real robot nearer to the course's end: {RECKONED} − estimator [cm]",
            f"Section 3.1; {OWN_BAR}", 10.0, saved(model, "I", f"I, {RECKONED}", "left"),
            (PROMPT, saved(last, f"I, {PROMPT}", f"I, {RECKONED}, {PROMPT}", "left")),
        ),
        above(
            "I: but the recovery takes too long: the real robot is at the course's end later than III's: "
            "I − III, mean [s]",
            "Section 3.1", 0.0, saved(model, "III", "I", "time"),
            (PROMPT, saved(last, f"III, {PROMPT}", f"I, {PROMPT}", "time")),
        ),
        above(
            "I: feedback makes the virtual robot jump: its largest jump, median [cm]",
            f"Section 4.2; {OWN_BAR}", 10.0, middle(model, "I", "jump"),
            (f"a constant delay of {LATE} s", middle(last, f"I, {CONSTANT}", "jump")),
        ),
        at_most(
            "III: it hardly jumps, in simulation: largest jump, median [cm]",
            f"Section 3.1, Fig. 9; {OWN_BAR}", 10.0, middle(model, "III", "jump"),
            ("I", middle(model, "I", "jump")),
        ),
        at_most(
            "III: it hardly jumps, in the experiment: largest jump, median [cm]",
            f"Section 4.2; {OWN_BAR}", 10.0, middle(micro, "III", "jump"), ("I", middle(micro, "I", "jump")),
        ),
        above(
            "II: feedback makes the virtual robot jump in the experiment: largest jump, median [cm]",
            f"Section 4.2; {OWN_BAR}", 10.0, middle(micro, "II", "jump"),
            ("a micro-robot that is like its model", middle(micro, f"II, {ALIKE}", "jump")),
        ),
        above(
            f"II: the same of a micro-robot that slips {SLIPPERY:g} times as much: largest jump, median [cm]",
            f"Section 4.2; {OWN_BAR}", 10.0, middle(micro, f"II, {SLIPS}", "jump"),
            ("a micro-robot that is like its model", middle(micro, f"II, {ALIKE}", "jump")),
        ),
    )  # fmt: skip
    return Findings(claims, (_table(found),))


SAID: Final = {
    "time": "real robot there after [s]",
    "error": "off the course, mean [cm]",
    "left": "from its end in the end [cm]",
    "apart": "robots apart in the end [cm]",
    "reckoned": "by dead reckoning [cm]",
    "jump": "largest jump [cm]",
    "jumped": "jumps of a metre [cm]",
}


def _table(found: dict[str, dict[str, tuple[OperatorView, ...]]]) -> Table:
    rows = []
    for case, made in found.items():
        robot, profile = case.split()
        for who, runs in made.items():
            row: list[tuple[str, Cell]] = [("robot", robot), ("network", profile), ("architecture", who)]
            rows.append(
                row + [(text, float(np.median([getattr(one, of) for one in runs]))) for of, text in SAID.items()]
            )
    return Table.of("operator_view", "Closed loop by what the operator sees, medians", rows)
