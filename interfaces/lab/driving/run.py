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
from interfaces.runs.drive_run import DriveCase, DriveLink, DriveRun, Row, Witness, row_of
from interfaces.teleop.architectures import (
    ArchitectureOperatorSite,
    ArchitectureRobotSite,
    TimelineController,
    Transport,
    controller,
)
from interfaces.teleop.architectures.compositions import (
    CONTROL,
    POSITIONS,
    SENSING,
    operator_surroundings,
    robot_surroundings,
)
from robots.bullet.rooms import Room
from robots.ipr.chassis import Senses
from robots.ipr.robot import MobileRobot
from robots.onboard.driving import STAND, Posture
from robots.onboard.laser import LaserModel
from vrs.model import Array

AFTER = 5.0
"""A run goes on for the largest delay and this after the operator stopped [s]."""
STOPPING = 1.5
"""So long before the end the operator stops [s]."""
_LEARNED = round(0.5 / CONTROL)
"""The virtual environment is recorded each so many control periods."""
LONGEST_WAIT = 600.0
"""But never longer than this [s]."""


def make_robot(case: DriveCase, start: Posture, room: str | Room) -> MobileRobot:
    """The real robot of a case."""
    senses = Senses() if case.architecture in SENSING else Senses(sonar=None)
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
        InvalidValueError: If a name or a value isn't allowed.
        FormatError: If a trace or inputs can't be read.
    """
    constants = case.constants
    driver = operator(case.operator, case.seed, constants.period) if driver is None else driver
    link: DriveLink = Link(
        LinkConditions.symmetric(Conditions(delay=delay_profile(case.delay), service=case.transport.service)),
        np.random.default_rng([case.seed, 2]),
    )
    with make_robot(case, driver.start, case.room or driver.room) as body:
        return _DrivingRun(case, driver, link, body, witness).whole()


class _DrivingRun:
    """A run while it goes on."""

    def __init__(
        self, case: DriveCase, driver: Operator, link: DriveLink, body: MobileRobot, witness: Witness | None
    ) -> None:
        self._case, self._driver, self._link, self._body = case, driver, link, body
        model = replace(case.real[0].base, period=case.constants.period)
        made = controller(case.architecture, driver.start, case.constants)
        senses = case.architecture in SENSING
        there = operator_surroundings(body.room, driver.start, model) if senses else None
        here = robot_surroundings(body, driver.start, made, CONTROL) if senses else None
        self._site = ArchitectureOperatorSite(model, driver.start, case.transport, surroundings=there)
        position = POSITIONS[case.position](body)
        self._robot = ArchitectureRobotSite(made, position, body.limits, period=CONTROL, surroundings=here)
        self._offset = made if isinstance(made, TimelineController) else None
        self._waiting = 0
        """Packets on their way that were sent while the operator drove."""
        self._delays: list[tuple[float, float]] = []
        self._largest = 0.0
        self._estimate: list[float] = []
        self._bytes = self._reported = 0
        self._learned: list[tuple[float, tuple[tuple[int, int], ...]]] = []
        self._witness = witness
        if witness is not None:
            witness.begun(case, driver.start, body, self._site, link)

    def whole(self) -> DriveRun:
        """From the start until the real robot could have done all."""
        case = self._case
        every = round(case.constants.period / CONTROL)
        driving = every * round(case.length / case.constants.period)
        end, last = driving, driving + round(LONGEST_WAIT / CONTROL)
        rows: list[tuple[float, ...]] = []
        k = 0
        while k <= end:
            rows.append(self._step(k, send=k % every == 0, driving=k < driving))
            k += 1
            if k > driving:
                end = min(last, k if self._waiting else driving + math.ceil((self._largest + AFTER) / CONTROL))
        return self._made(np.array(rows))

    def _step(self, k: int, *, send: bool, driving: bool) -> tuple[float, ...]:
        """One control period from k on; returns what was so at its start."""
        now, link, robot, body = k * CONTROL, self._link, self._robot, self._body
        if send:
            self._send(now, driving=driving)
        for arrived in link.forward.receive(now):
            if arrived.sent < self._case.length:
                self._waiting -= 1
                self._delays.append((arrived.sent, arrived.arrived - arrived.sent))
                self._largest = max(self._largest, arrived.arrived - arrived.sent)
            robot.receive(arrived.payload, now=now)
        for answer in link.backward.receive(now):
            self._site.receive(answer.payload, now=now)
        around = self._site.surroundings
        if around is not None and k % _LEARNED == 0:
            self._learned.append((now, around.environment.obstacles(now)))
        drive = robot.drive(now=now)
        if send:
            report = robot.report(now=now)
            self._reported += report.size
            self._note("backward", now, report.size)
            link.backward.send(report, now, report.size)
            self._estimate = self._site.estimator.posture.tolist()
        D = None if self._offset is None else self._offset.D
        row = (now, *body.truth, *robot.posture, *drive, math.nan if D is None else D)
        body.drive(drive.v, drive.w, round(CONTROL / body.reality.dt))
        return (*row, *self._estimate)

    def _send(self, now: float, *, driving: bool) -> None:
        """What the operator's site sends in this period, if anything."""
        site, datagrams = self._site, self._case.transport is Transport.DATAGRAMS
        if driving:
            wanted = self._driver.drive(now, site.posture, site.before)
            if now >= self._case.length - STOPPING:
                wanted = STAND
            packet = site.drive(wanted.v, wanted.w, now=now)
        elif datagrams:
            packet = site.repeat()
        else:
            return
        self._bytes += packet.size
        self._note("forward", now, packet.size)
        arrival = self._link.forward.send(packet, now, packet.size)
        # A stream's packet arrives in the end; a datagram that gets no time of arrival is lost.
        self._waiting += driving and (arrival is not None or not datagrams)

    def _note(self, direction: str, now: float, size: int) -> None:
        if self._witness is not None:
            self._witness.sent(direction, now, size)

    def _made(self, rows: Array) -> DriveRun:
        t = rows[:, 0]
        return DriveRun(
            case=self._case,
            t=t,
            virtual=self._site.engine.posture(t),
            real=rows[:, 1:4],
            measured=rows[:, 4:7],
            drives=rows[:, 7:9],
            offset=rows[:, 9],
            estimated=rows[:, 10:13],
            delays=np.array(self._delays).reshape(-1, 2),
            touched=self._body.collisions,
            sent_bytes=self._bytes,
            reported_bytes=self._reported,
            learned=tuple(self._learned),
        )


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
