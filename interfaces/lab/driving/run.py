"""One run of the mobile laboratory, in virtual time: an operator, an architecture, a network and a real robot."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from interfaces.lab.driving.operators import Operator, operator
from interfaces.link.conditions import Conditions, LinkConditions
from interfaces.link.delays import delay_profile
from interfaces.link.link import Link
from interfaces.runs.drive_run import KNOWN, SENSED, DriveCase, DriveLink, DriveRun, Row, Witness, row_of
from interfaces.teleop.architectures import (
    ArchitectureRobotSite,
    TimelineController,
    Transport,
    architecture,
    controller,
)
from interfaces.teleop.architectures.compositions import (
    CONTROL,
    POSITIONS,
    operator_surroundings,
    robot_surroundings,
)
from interfaces.teleop.following_base import DrivenConfig, FollowingBase
from interfaces.teleop.operator import OperatorSite
from interfaces.teleop.virtual_base import VirtualBase
from robots.mobile.chassis import Senses
from robots.mobile.robot import MobileRobot
from robots.onboard.driving import STAND, Posture
from robots.onboard.laser import LaserModel
from robots.rooms import Room
from vrs.errors import InvalidValueError

AFTER = 5.0
"""A run goes on for the largest delay and this after the operator stopped [s]."""
STOPPING = 1.5
"""So long before the end the operator stops [s]."""
BEAT = 1e-3
"""Whenever the real robot may report, it does [s]."""
_LEARNED = round(0.5 / CONTROL)
"""The virtual environment is recorded each so many control periods."""
LONGEST_WAIT = 600.0
"""But never longer than this [s]."""


def make_robot(case: DriveCase, start: Posture, room: str | Room) -> MobileRobot:
    """The real robot of a case."""
    senses = Senses() if architecture(case.architecture).senses else Senses(sonar=None)
    if case.position == "laser":
        senses = replace(senses, laser=case.real[0].device(LaserModel) or LaserModel())
    # The seed's own streams: of the robot, of the network, of the operator.
    rng = np.random.default_rng([case.seed, 1])
    where = room or None
    robot, body = case.real
    limits = robot.base.limits
    made: MobileRobot = robot.body(body)(
        start, room=where, reality=case.reality, rng=rng, senses=senses, limits=limits
    )
    return made


def run(case: DriveCase, driver: Operator | None = None, witness: Witness | None = None) -> DriveRun:
    """Run a case; the same case gives the same to the last bit.

    Args:
        case: What to run.
        driver: Who drives, instead of the case's operator.
        witness: Who notes what happens.

    Raises:
        InvalidValueError: If a name or a value isn't allowed, or the real robot has to stop by itself.
        FormatError: If a trace or inputs can't be read.
    """
    constants = case.constants
    driver = operator(case.operator, case.seed, constants.period) if driver is None else driver
    link: DriveLink = Link(
        LinkConditions.symmetric(Conditions(delay=delay_profile(case.delay), service=case.transport.service)),
        np.random.default_rng([case.seed, 2]),
    )
    with make_robot(case, driver.start, case.room or driver.room) as body:
        return _driven(case, driver, link, body, witness)


def _driven(
    case: DriveCase, driver: Operator, link: DriveLink, body: MobileRobot, witness: Witness | None
) -> DriveRun:
    """Drive from the start until the real robot could have done all."""
    constants = case.constants
    model = replace(case.real[0].base, period=constants.period)
    made = controller(case.architecture, driver.start, constants)
    senses = architecture(case.architecture).senses
    held = case.environment or (SENSED if senses else "")
    there = operator_surroundings(body.room, driver.start, model, learns=held != KNOWN) if held else None
    here = robot_surroundings(body, driver.start, made, CONTROL) if senses else None
    virtual = VirtualBase(
        model, driver.start, now=0.0, around=lambda _: there, transport=case.transport, matched=False
    )
    operator, site = OperatorSite(virtual), virtual.architecture
    position = POSITIONS[case.position](body)
    followed = ArchitectureRobotSite(made, position, body.limits, period=CONTROL, surroundings=here)
    robot = FollowingBase(lambda *_: followed, position, body.limits, now=0.0, config=DrivenConfig(CONTROL, BEAT))
    if witness is not None:
        witness.begun(case, driver.start, body, site, link)
    steps = round(CONTROL / body.reality.dt)
    every = round(constants.period / CONTROL)
    driving = every * round(case.length / constants.period)
    end, last = driving, driving + round(LONGEST_WAIT / CONTROL)
    # Packets on their way that were sent while the operator drove.
    waiting = 0
    largest, delays = 0.0, list[tuple[float, float]]()
    sent_bytes = reported_bytes = 0
    learned: list[tuple[float, tuple[tuple[int, int], ...]]] = []
    estimate: list[float] = []
    rows: list[tuple[float, ...]] = []
    k = 0
    while k <= end:
        now, send = k * CONTROL, k % every == 0
        virtual.ended = k >= driving
        if send and not virtual.ended:
            wanted = driver.drive(now, _seen(driver, operator), site.before)
            if getattr(driver, "finished", False):
                driving = k + every
            wanted = STAND if now >= case.length - STOPPING else wanted
            virtual.wish(wanted.v, wanted.w, issued_at=now, now=now)
        for orders in operator.advance(now=now):
            if k == 0:
                # Here the sites have met before: the robot waits for no packet to begin.
                robot.begin(orders, now)
            if virtual.ended and case.transport is not Transport.DATAGRAMS:
                continue
            size = orders.size
            sent_bytes += size
            if witness is not None:
                witness.sent("forward", now, size)
            arrival = link.forward.send(orders, now, size)
            # A stream's packet arrives in the end; a datagram that gets no time of arrival is lost.
            waiting += k < driving and (arrival is not None or case.transport is not Transport.DATAGRAMS)
        for arrived in link.forward.receive(now):
            if arrived.sent < driving * CONTROL:
                waiting -= 1
                delays.append((arrived.sent, arrived.arrived - arrived.sent))
                largest = max(largest, arrived.arrived - arrived.sent)
            robot.receive(arrived.payload, now=now)
        for answer in link.backward.receive(now):
            operator.receive(answer.payload, now=now)
        if there is not None and k % _LEARNED == 0:
            learned.append((now, there.environment.obstacles(virtual.surrounded_at(now))))
        drive = robot.drive(now=now)
        if robot.halted:
            raise InvalidValueError("architecture", case.architecture, f"one that drives on: {robot.halted}")
        for report in robot.advance(now=now) if send else ():
            assert report.report is not None
            size = report.report.size
            reported_bytes += size
            if witness is not None:
                witness.sent("backward", now, size)
            link.backward.send(report, now, size)
            estimate = site.estimator.posture.tolist()
        D = made.D if isinstance(made, TimelineController) else None
        rows.append((now, *body.truth, *followed.posture, *drive, math.nan if D is None else D, *estimate))
        body.drive(drive.v, drive.w, steps)
        k += 1
        if k > driving:
            end = min(last, k if waiting else driving + math.ceil((largest + AFTER) / CONTROL))
    table = np.array(rows)
    return DriveRun(
        case=case,
        t=table[:, 0],
        virtual=site.engine.posture(table[:, 0]),
        real=table[:, 1:4],
        measured=table[:, 4:7],
        drives=table[:, 7:9],
        offset=table[:, 9],
        estimated=table[:, 10:13],
        delays=np.array(delays).reshape(-1, 2),
        touched=body.collisions,
        sent_bytes=sent_bytes,
        reported_bytes=reported_bytes,
        learned=tuple(learned),
    )


def _seen(driver: Operator, site: OperatorSite[VirtualBase]) -> Posture:
    """Where an operator sees the robot that he looks at."""
    virtual = site.robot.architecture
    if getattr(driver, "sees_estimate", False):
        return Posture(*virtual.estimator.posture.tolist())
    if not getattr(driver, "sees_real", False):
        return virtual.posture
    newest = site.report
    return driver.start if newest is None or newest.report is None else Posture(*newest.report.posture)


FOLDER: Final = "runs"
"""Where recordings are, below the results."""
LONGEST: Final = 24
"""Characters of a part of a name."""
_FILES: Final = ("trace:", "inputs:")
_PLAIN: Final = re.compile(r"[A-Za-z0-9.+@:-]+\Z")
_OTHERS: Final = re.compile(r"[^A-Za-z0-9.+-]")


def measure_recorded(case: DriveCase, keep: bool, path: Path | None) -> tuple[Row, DriveRun | None, str]:
    """Run a case.

    Args:
        case: What to run.
        keep: Whether all of it is kept, as it's to be drawn.
        path: Where its recording goes, if there's to be one.

    Returns:
        Its figures; all of it, where that's kept; and why its recording isn't there, empty where it is, or wasn't
        asked for.
    """
    if path is None:
        drive, problem = run(case), ""
    else:
        from interfaces.recording.run_recorders import DriveRecorder

        recorder = DriveRecorder(path)
        drive = run(case, witness=recorder)
        recorder.finish(drive)
        problem = recorder.problem
    return row_of(drive), drive if keep else None, problem


def paths(chosen: Sequence[DriveCase], out: Path) -> list[Path | None]:
    """Where recordings of cases go; of equal cases the first one's is kept."""
    found: list[Path | None] = []
    for case in chosen:
        path = out / FOLDER / f"{name_of(case)}.mcap"
        found.append(None if path in found else path)
    return found


def name_of(case: DriveCase) -> str:
    """What a case's recording is called: its architecture, transport, delay, robot, operator and seed.

    What no file name should have becomes `_`; of what is a file, or too long, its end stays and some digits that
    tell it from others.
    """
    parts = case.group
    return "-".join([*(_part(part) for part in parts), str(case.seed)])


def _part(text: str) -> str:
    plain = _OTHERS.sub("_", text)
    if _PLAIN.match(text) and len(text) <= LONGEST and not text.startswith(_FILES):
        return plain
    digest = hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:8]
    kind = text.partition(":")[0] + "_" if text.startswith(_FILES) else ""
    return f"{kind}{_OTHERS.sub('_', Path(text.partition(':')[2] or text).stem)[-12:]}_{digest}"
