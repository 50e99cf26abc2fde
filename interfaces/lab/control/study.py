"""The study behind `vrs lab control`: the same courses, seeds and networks for who sees what, arm and base.

Whoever sees the virtual robot drives it, and the real one follows its timeline. Whoever sees the real one drives
that: it does what it's told as soon as it hears it, as architecture I has it. Without delay both ways must be as
good: that's what stands beside each claim.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from interfaces.lab.claims import (
    OWN_BAR,
    Claim,
    Findings,
    Paper,
    PaperPart,
    Reproduction,
    Results,
    Study,
    Table,
    at_most,
    interval_said,
)
from interfaces.lab.control.operators import OPERATORS, Course, CourseOperator, Driver, Tool, Wheels, operator
from interfaces.lab.doulgeri.script import HOME, MODEL, tool, twins
from interfaces.lab.driving.run import run
from interfaces.lab.output import BAD, INK, MUTED, REAL, VIRTUAL, draw, legend, write_runs
from interfaces.lab.statistics import Estimate, bootstrap, interval_name, ratio
from interfaces.link import Channel, Conditions, Service, delay_profile
from interfaces.runs.drive_run import DriveCase
from interfaces.teleop.architectures import Transport
from robots.onboard.driving import Posture
from robots.robot import USUAL_BASE, exact_arm
from vrs import Engine, ManualClock, SteerCommand
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

PROMPT: Final = "none"
"""The network without delay: the counterfactual's."""
PROFILES: Final = ("domain", "mon", "wed", "thu")
TAU: Final = 3.3
"""Correlation time of the delays [s]."""
ROBOTS: Final = ("arm", "base")
TWIN: Final = "twin"
"""Who sees the virtual robot: the tracker."""
TRACKER, WAITS = OPERATORS
UNHURRIED: Final = {WAITS: TRACKER}
"""Who does in an operator's place where nothing is late: nobody waits then."""
CLAIMED: Final = {TRACKER: ("error",), WAITS: ("time",)}
"""In what the twin is claimed to be better than an operator; than one's own in both."""
MOST: Final = {"time": 0.75, "error": 0.5}
"""Of an operator's figure who sees the real robot, at most."""
SAID: Final = {"time": "time to the end", "error": "path error, mean,"}
RUNS: Final = 10
DRAWN: Final = "mon"
LONGEST: Final = 120.0
"""Who isn't there by then has failed [s]."""
PERIOD: Final = 0.02
"""Between an arm's inputs [s]."""
WIDE: Final = {"arm": 0.02, "base": 0.15}
"""So near to the course's end the real robot has arrived [m]."""
CASES: Final = tuple(f"{robot}:{profile}" for robot in ROBOTS for profile in (PROMPT, *PROFILES))
Runs: TypeAlias = dict[str, tuple[Results, ...]]
"""By who, a run a seed."""


def course(robot: str, rng: np.random.Generator) -> Course:
    """A line of gentle bends, in front of the robot: 1 m in space for the arm, 8 m in the plane for the base."""
    t = np.linspace(0.0, 1.0, 801)
    waves = np.zeros((len(t), 2))
    for k in (1, 2, 3):
        waves += rng.uniform(-1.0, 1.0, 2) / k * np.sin(math.pi * k * t[:, None])
    waves /= np.abs(waves).max()
    if robot == "base":
        # It begins along the robot's heading.
        return Course(np.column_stack((7.0 * t, waves[:, 0] * t * 2.0)))
    begin = tool(HOME[None])[0]
    return Course(begin + np.column_stack((0.1 * waves[:, 0], 0.5 * t, 0.1 * waves[:, 1])))


def _rng(seed: int, *stream: int) -> np.random.Generator:
    return np.random.default_rng([seed, *stream])


def drive(who: str, profile: str, seed: int) -> Results:
    """Drive the 75 kg robot along a course: `TWIN`, or an operator who sees the real robot."""
    line = course("base", _rng(seed, 5))
    (x, y), (dx, dy) = line.points[0].tolist(), (line.points[1] - line.points[0]).tolist()
    man = operator(TRACKER if who == TWIN else who, line, Wheels())
    driver = Driver(man, Posture(x, y, math.atan2(dy, dx)), sees_real=who != TWIN)
    architecture = "timeline" if who == TWIN else "I"
    case = DriveCase(
        architecture, Transport.DATAGRAMS, network(profile), USUAL_BASE, seed=seed, length=LONGEST
    )  # fmt: skip
    made = run(case, driver)
    return measured("base", line, made.t, made.real[:, :2], man)


def steer(who: str, profile: str, seed: int) -> Results:
    """Steer the arm's tool along a course: `TWIN`, or an operator who sees the real arm."""
    line = course("arm", _rng(seed, 6))
    man = operator(TRACKER if who == TWIN else who, line, Tool())
    way = Conditions(delay=delay_profile(network(profile)), service=Service.DATAGRAM)
    made = steer_virtual if who == TWIN else steer_real
    return measured("arm", line, *made(man, line, way, _rng(seed, 7)), man)


def steer_virtual(
    man: CourseOperator, line: Course, way: Conditions, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Steer the virtual arm; where the real tool was, at times (k,) [s], (k, 3) [m]."""
    with exact_arm(HOME) as body:
        lab = twins(way, rng, body=body)
        virtual = lab.operator.robot

        def act(now: float) -> None:
            speed = man.act(now, tool(virtual.engine.joints(now)[None])[0])
            if speed.any():
                virtual.execute(_twist(speed, now), now=now)

        end = 0.0
        while end < LONGEST and not (man.finished and _is_there("arm", line, tool(lab.reference.q[-1:])).any()):
            for k in range(50):
                lab.schedule(end + PERIOD * k, act)
            end += 1.0
            lab.run(end)
        return lab.t, tool(lab.reference.q)


def steer_real(man: CourseOperator, line: Course, way: Conditions, rng: np.random.Generator) -> tuple[Array, Array]:
    """Steer the real arm, which does what it's told as soon as it hears it; see `steer_virtual`."""
    there_rng, back_rng = rng.spawn(2)
    there, back = Channel[Array](way, there_rng), Channel[Array](way, back_rng)
    clock = ManualClock(0.0)
    arm = Engine(MODEL, q=HOME, clock=clock)
    seen, seen_at, told_at = HOME, -1.0, -1.0
    t, places = [], []
    for k in range(round(LONGEST / PERIOD)):
        now = k * PERIOD
        clock.advance(now - clock.now())
        for told in there.receive(now):
            # What comes after a newer one is of no use.
            if told.sent > told_at and told.payload.any():
                arm.execute(_twist(told.payload, now))
            told_at = max(told_at, told.sent)
        q = arm.joints(now)
        t.append(now)
        places.append(tool(q[None])[0])
        if _is_there("arm", line, places[-1][None]).any():
            break
        back.send(q, now)
        for report in back.receive(now):
            if report.sent > seen_at:
                seen, seen_at = report.payload, report.sent
        there.send(man.act(now, tool(seen[None])[0]), now)
    return np.array(t), np.array(places)


def _twist(speed: Array, now: float) -> SteerCommand:
    """Steer the tool at a speed (3,) [m/s]."""
    return SteerCommand(twist=np.concatenate((speed, np.zeros(3))), issued_at=now)


def _is_there(robot: str, line: Course, places: Array) -> NDArray[np.bool_]:
    """Whether places (k, d) [m] are at the course's end, (k,)."""
    return np.asarray(np.linalg.norm(places - line.points[-1], axis=1) <= WIDE[robot])


def network(profile: str) -> str:
    """A profile of delays, as the command line spells it."""
    return profile if profile == PROMPT else f"{profile}@{TAU}"


def measured(robot: str, line: Course, t: Array, places: Array, who: CourseOperator) -> Results:
    """What came of it: when the real robot got to the end, and how far it was from the course on its way."""
    there = _is_there(robot, line, places)
    arrived = int(there.argmax()) if there.any() else len(t) - 1
    way = np.concatenate([[0.0], np.linalg.norm(np.diff(places[: arrived + 1], axis=0), axis=1).cumsum()])
    # By its way, not by time: whoever stands and waits is no better for it.
    even = np.linspace(0.0, way[-1], 400)
    off = line.distance(np.column_stack([np.interp(even, way, column[: arrived + 1]) for column in places.T]))
    return Results(
        done=bool(there.any()),
        time=float(t[arrived]) if there.any() else LONGEST,  # until the real robot is there, or it's over [s]
        error=float(off.mean()),  # of the real robot's path from the course [m]
        largest=float(off.max()),
        waited=who.waited,  # [s]
        track=places[: arrived + 1],
        line=line.points,
    )


def work(study: Study, case: str, operators: Sequence[str]) -> Runs:
    """A robot under a network, all seeds, by who follows the course."""
    robot, profile = case.split(":")
    go = steer if robot == "arm" else drive
    chosen = (TWIN, *dict.fromkeys(UNHURRIED.get(who, who) if profile == PROMPT else who for who in operators))
    return {who: tuple(go(who, profile, study.seed + k) for k in range(study.runs)) for who in chosen}


def conclude(study: Study, results: tuple[Runs, ...], operators: Sequence[str]) -> Findings:
    """What seeing the virtual robot is worth, with intervals, and what became of whom."""
    found = dict(zip(CASES, results, strict=True))
    by_robot = {
        robot: {case.split(":")[1]: found[case] for case in CASES if case.startswith(robot)} for robot in ROBOTS
    }
    claims = tuple(claim for robot in ROBOTS for claim in gain_claims(study, robot, by_robot[robot], operators))
    pictures = tuple(
        draw(f"control_{robot}", f"{robot} under {DRAWN}: its way", _paint, robot, by_robot[robot][DRAWN])
        for robot in ROBOTS
    )
    return Findings(claims, (_table(study, found), _gains(study, found)), pictures)


def gain_claims(study: Study, robot: str, found: dict[str, Runs], operators: Sequence[str]) -> tuple[Claim, ...]:
    """What is claimed of a robot, by network: a figure of the twin's as a share of an operator's."""

    def share(profile: str, who: str, figure: str) -> Estimate:
        runs = found[profile]
        return ratio(_values(runs, TWIN, figure), _values(runs, who, figure), study.seed)

    return tuple(
        at_most(
            f"{robot} under {profile}: {SAID[figure]} of who sees the virtual robot, by that of {who}",
            OWN_BAR, MOST[figure], share(profile, who, figure),
            (f"no delay, {UNHURRIED.get(who, who)}", share(PROMPT, UNHURRIED.get(who, who), figure)),
        )
        for profile in PROFILES
        for who in operators
        for figure in CLAIMED.get(who, tuple(MOST))
    )  # fmt: skip


def _values(runs: Runs, who: str, figure: str) -> Array:
    return np.array([getattr(one, figure) for one in runs[who]])


def _table(study: Study, found: dict[str, Runs]) -> Table:
    """A row a robot, network and operator."""
    within = interval_name(study.runs)
    rows = []
    for case, runs in found.items():
        robot, profile = case.split(":")
        for who, made in runs.items():
            time, error = (bootstrap(_values(runs, who, figure), study.seed) for figure in ("time", "error"))
            rows.append((
                ("robot", robot),
                ("network", profile),
                ("who", who),
                ("arrived", sum(one.done for one in made)),
                ("of", len(made)),
                ("time [s]", time.value),
                (f"time, {within} [s]", interval_said(time.interval)),
                ("path error, mean [mm]", 1e3 * error.value),
                (f"path error, {within} [mm]", interval_said([1e3 * end for end in error.interval])),
                ("largest [mm]", 1e3 * max(one.largest for one in made)),
                ("waited [s]", float(_values(runs, who, "waited").mean())),
            ))  # fmt: skip
    return Table.of("control", "who sees what, on the same courses and networks", rows)


def _gains(study: Study, found: dict[str, Runs]) -> Table:
    """What is saved by seeing the virtual robot, seed by seed."""
    within = interval_name(study.runs)
    rows = []
    for case, runs in found.items():
        robot, profile = case.split(":")
        for who in runs:
            if who == TWIN:
                continue
            time, error = (
                bootstrap(scale * (_values(runs, who, figure) - _values(runs, TWIN, figure)), study.seed)
                for figure, scale in (("time", 1.0), ("error", 1e3))
            )
            rows.append((
                ("robot", robot),
                ("network", profile),
                ("beside", who),
                ("time saved [s]", time.value),
                (f"time saved, {within} [s]", interval_said(time.interval)),
                ("path error saved [mm]", error.value),
                (f"path error saved, {within} [mm]", interval_said(error.interval)),
            ))  # fmt: skip
    return Table.of("gains", "what it's worth to see the virtual robot", rows)


def _paint(canvas: Canvas, robot: str, runs: Runs) -> None:
    axes = (0, 1) if robot == "base" else (1, 2)
    ax = canvas.subplots()
    ax.plot(*runs[TWIN][0].line[:, axes].T, color=INK, linestyle=(0, (1, 1)), label="course")
    colours = {TRACKER: BAD, WAITS: REAL, TWIN: VIRTUAL}
    for who, made in reversed(runs.items()):
        ax.plot(*made[0].track[:, axes].T, color=colours.get(who, MUTED), label=who)
    ax.set_aspect("equal", "datalim")
    ax.set(xlabel="xy"[axes[0]] + " [m]", ylabel="yz"[axes[0]] + " [m]")
    legend(ax)


def study_of(operators: Sequence[str] = tuple(OPERATORS)) -> Paper:
    """The study with some operators who see the real robot, as `vrs lab control` runs it.

    Raises:
        InvalidValueError: If there's none of a name, or one's own can't be called.
        FormatError: If the module of one's own can't be imported.
    """
    for who in operators:
        operator(who, course("base", _rng(0)), Wheels())
    given = tuple(operators)
    return Paper(
        "control",
        "The control condition: an operator who sees the real robot, late, beside one who sees the virtual robot",
        (PaperPart("who sees what", partial(work, operators=given), partial(conclude, operators=given), CASES),),
        runs=RUNS,
    )


def write(found: Reproduction, out: Path) -> None:
    """Write summary.json, runs.csv with a row a robot, network and operator, and pictures into a directory.

    Raises:
        FormatError: If it can't hold them.
    """
    write_runs(found, out, [found.findings.tables[0]])
