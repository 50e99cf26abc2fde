"""The study behind `vrs lab control`: the same courses, seeds and networks for who sees what, arm and base.

Everything but what is seen is the same: the real robot follows the operator's timeline.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

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
    beats,
)
from interfaces.lab.control.operators import Course, Driver, Follower, Hand, Stepper, Tool, Wheels
from interfaces.lab.doulgeri.script import HOME, tool, twins
from interfaces.lab.driving.run import run
from interfaces.lab.output import INK, REAL, VIRTUAL, draw, legend, write_runs
from interfaces.lab.statistics import bootstrap
from interfaces.link import Conditions, Service, delay_profile
from interfaces.runs.drive_run import DriveCase
from interfaces.teleop.architectures import Transport
from robots.onboard.driving import Posture
from robots.robot import USUAL_BASE, ArmBody, exact_arm
from vrs import SteerCommand
from vrs.model import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

PROFILES: Final = ("domain", "mon", "wed", "thu")
TAU: Final = 3.3
"""Correlation time of the delays [s]."""
ROBOTS: Final = ("arm", "base")
TWIN, TRACKER, WAITS = "twin", "real, tracker", "real, move and wait"
VIEWS: Final = (TWIN, TRACKER, WAITS)
"""What is seen, and by whom: the virtual robot by the tracker; the real one, late, by the tracker or who waits."""
RUNS: Final = 5
LONGEST: Final = 120.0
"""Who isn't there by then has failed [s]."""
PERIOD: Final = 0.02
"""Between an arm's inputs [s]."""
WIDE: Final = {"arm": 0.02, "base": 0.15}
"""So near to the course's end the real robot has arrived [m]."""


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


def follower(view: str, line: Course, hand: Hand) -> Follower:
    """Who follows it."""
    return (Stepper if view == WAITS else Follower)(line, hand)


def _rng(seed: int, *stream: int) -> np.random.Generator:
    return np.random.default_rng([seed, *stream])


def drive(view: str, profile: str, seed: int) -> Results:
    """Drive the 75 kg robot along a course."""
    line = course("base", _rng(seed, 5))
    (x, y), (dx, dy) = line.points[0].tolist(), (line.points[1] - line.points[0]).tolist()
    who = follower(view, line, Wheels())
    driver = Driver(who, Posture(x, y, math.atan2(dy, dx)), sees_real=view != TWIN)
    case = DriveCase("timeline", Transport.DATAGRAMS, network(profile), USUAL_BASE, seed=seed, length=LONGEST)
    made = run(case, driver)
    return measured("base", line, made.t, made.real[:, :2], who)


def steer(view: str, profile: str, seed: int) -> Results:
    """Steer the arm's tool along a course."""
    with exact_arm(HOME) as body:
        return _steered(view, profile, seed, body)


def _steered(view: str, profile: str, seed: int, body: ArmBody) -> Results:
    line = course("arm", _rng(seed, 6))
    way = Conditions(delay=delay_profile(network(profile)), service=Service.DATAGRAM)
    lab = twins(way, _rng(seed, 7), body=body)
    virtual, who = lab.operator.robot, follower(view, line, Tool())

    def act(now: float) -> None:
        report = lab.operator.report
        seen = HOME if report is None else report.q
        q = virtual.engine.joints(now) if view == TWIN else seen
        speed = who.act(now, tool(q[None])[0])
        if speed.any():
            virtual.execute(SteerCommand(twist=np.concatenate((speed, np.zeros(3))), issued_at=now), now=now)

    end = 0.0
    while not who.finished and end < LONGEST:
        for k in range(50):
            lab.schedule(end + PERIOD * k, act)
        end += 1.0
        lab.run(end)
    lab.run(min(end + 30.0, LONGEST))
    return measured("arm", line, lab.t, tool(lab.reference.q), who)


def network(profile: str) -> str:
    """A profile of delays, as the command line spells it."""
    return f"{profile}@{TAU}"


def measured(robot: str, line: Course, t: Array, places: Array, who: Follower) -> Results:
    """What came of it: when the real robot got to the end, and how far it was from the course on its way."""
    there = np.linalg.norm(places - line.points[-1], axis=1) <= WIDE[robot]
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


CASES: Final = tuple(f"{robot}:{profile}" for robot in ROBOTS for profile in PROFILES)


def work(study: Study, case: str) -> dict[str, tuple[Results, ...]]:
    """A robot under a network, all seeds, by what is seen."""
    robot, profile = case.split(":")
    go = steer if robot == "arm" else drive
    return {view: tuple(go(view, profile, study.seed + k) for k in range(study.runs)) for view in VIEWS}


def conclude(study: Study, results: tuple[dict[str, tuple[Results, ...]], ...]) -> Findings:
    """The twin's gain in time and in path, with intervals, and a row a view."""
    found = dict(zip(CASES, results, strict=True))
    claims = tuple(claim for case, runs in found.items() for claim in _gains(study, case, runs))
    rows = [
        (
            ("robot", case.split(":")[0]),
            ("network", case.split(":")[1]),
            ("sees", view),
            ("arrived", sum(one.done for one in runs)),
            ("of", len(runs)),
            ("time [s]", float(np.mean([one.time for one in runs]))),
            ("path error, mean [mm]", 1e3 * float(np.mean([one.error for one in runs]))),
            ("largest [mm]", 1e3 * max(one.largest for one in runs)),
            ("waited [s]", float(np.mean([one.waited for one in runs]))),
        )
        for case, views in found.items()
        for view, runs in views.items()
    ]
    pictures = tuple(
        draw(
            f"control_{robot}",
            f"{robot} under mon: what the real robot drove",
            _paint,
            robot,
            found[f"{robot}:mon"],
        )
        for robot in ROBOTS
    )
    return Findings(
        claims, (Table.of("control", "who sees what, on the same courses and networks", rows),), pictures
    )


def _gains(study: Study, case: str, runs: dict[str, tuple[Results, ...]]) -> list[Claim]:
    """How much quicker than who moves and waits, and how much nearer to the course than the tracker."""
    said = case.replace(":", " under ")

    def saved(text: str, view: str, name: str, scale: float = 1.0) -> Claim:
        ours, theirs = (np.array([scale * getattr(one, name) for one in runs[who]]) for who in (TWIN, view))
        text = f"{said}: {text}"
        return beats(text, OWN_BAR, bootstrap(theirs - ours, study.seed), (view, bootstrap(theirs, study.seed)))

    return [
        saved("time saved by seeing the virtual robot [s]", WAITS, "time"),
        saved("path error saved by seeing the virtual robot, mean [mm]", TRACKER, "error", 1e3),
    ]


def _paint(canvas: Canvas, robot: str, views: dict[str, tuple[Results, ...]]) -> None:
    axes = (0, 1) if robot == "base" else (1, 2)
    ax = canvas.subplots()
    ax.plot(*views[TWIN][0].line[:, axes].T, color=INK, linestyle=(0, (1, 1)), label="course")
    for view, colour in ((TRACKER, "#b3261e"), (WAITS, REAL), (TWIN, VIRTUAL)):
        ax.plot(*views[view][0].track[:, axes].T, color=colour, label=view)
    ax.set_aspect("equal", "datalim")
    ax.set(xlabel="xy"[axes[0]] + " [m]", ylabel="yz"[axes[0]] + " [m]")
    legend(ax)


PAPER: Final = Paper(
    "control",
    "The control condition: an operator who sees the real robot, late, beside one who sees the virtual robot",
    (PaperPart("who sees what", work, conclude, CASES),),
    runs=RUNS,
)
"""As `vrs lab control` runs it."""


def write(found: Reproduction, out: Path) -> None:
    """Write summary.json, runs.csv with a row a view, and the pictures into an existing directory.

    Raises:
        FormatError: If it can't hold them.
    """
    write_runs(found, out, [found.findings.tables[0]])
