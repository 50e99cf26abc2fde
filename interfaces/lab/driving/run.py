"""One run of the mobile laboratory: an operator, an architecture, a network and a real robot, in virtual time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeAlias

import numpy as np

from interfaces.lab.driving.operators import Operator, operator
from interfaces.link.conditions import Conditions, LinkConditions
from interfaces.link.link import Link
from interfaces.link.profiles import delay_profile
from interfaces.teleop.architectures import (
    Constants,
    OperatorSite,
    Packet,
    Player,
    Report,
    RobotSite,
    Transport,
    controller,
)
from interfaces.teleop.architectures.equipment import (
    CONTROL,
    POSITIONS,
    SENSING,
    operator_surroundings,
    robot_surroundings,
)
from robots import ipr
from robots.bullet.rooms import Room
from robots.ipr.bare import BareBody
from robots.ipr.chassis import Senses
from robots.ipr.parameters import IPR_LIMITS
from robots.ipr.reality import MobileReality
from robots.ipr.robot import PLACES, Collision, MobileRobot
from robots.onboard.driving import STAND, Posture
from robots.onboard.laser import LaserModel
from vrs.checks import number_in, one_of
from vrs.comparison import PathComparison, summed_up
from vrs.model import Array
from vrs.path_matching import PathMatch, match_paths

AFTER = 5.0
"""A run goes on for the largest delay and this after the operator stopped [s]."""
STOPPING = 1.5
"""So long before the end the operator stops [s]."""
_LEARNED = round(0.5 / CONTROL)
"""The virtual environment is recorded each so many control periods."""
LONGEST_WAIT = 600.0
"""But never longer than this [s]."""
ROBOTS = ("ipr", "micro", "bare")
"""Real robots by name: the paper's two in PyBullet, and the bare kinematic one."""
DriveLink: TypeAlias = Link[Packet, Report]
"""What is between both sites."""


@dataclass(frozen=True, slots=True)
class Case:
    """What is run."""

    architecture: str = "timeline"
    transport: Transport = Transport.DATAGRAMS
    delay: str = "mon"
    """Profile of either direction, as the command line spells it."""
    robot: str = "ipr"
    """`ipr`, `micro` (PyBullet) or `bare`."""
    operator: str = "mixed"
    seed: int = 0
    length: float = 120.0
    """For how long the operator drives [s], in [1, 3600]."""
    constants: Constants = field(default_factory=Constants)
    reality: MobileReality | None = None
    """Of the real robot; all of it unless given."""
    room: str | Room = ""
    """Where it drives, a room or a name of `robots.ipr.robot.PLACES`; the operator's own unless given."""
    position: str = "fused"
    """What tells the real robot where it is: `fused` (odometry and camera), `laser` (odometry and laser on the map
    of its room), `odometry`, or the `truth`."""

    @property
    def group(self) -> tuple[str, str, str, str, str]:
        """Architecture, transport, delay, robot and operator: what it's one of several seeds of."""
        return self.architecture, self.transport.value, self.delay, self.robot, self.operator

    def __post_init__(self) -> None:
        object.__setattr__(self, "transport", Transport(one_of("transport", self.transport, list(Transport))))
        one_of("robot", self.robot, ROBOTS)
        one_of("position", self.position, POSITIONS)
        if isinstance(self.room, str):
            one_of("room", self.room, ("", *PLACES))
        number_in("length", self.length, 1.0, 3600.0, unit=" s")


@dataclass(frozen=True, slots=True, eq=False)
class DriveRun:
    """What happened in a run."""

    case: Case
    t: Array
    """Times [s], (k,)."""
    virtual: Array
    """Postures of the virtual robot, without corrections, (k, 3)."""
    real: Array
    """True postures of the real robot, (k, 3)."""
    measured: Array
    """Postures that the real robot took itself to be at, (k, 3)."""
    estimated: Array
    """Postures that the operator's site thought the real robot would come to, as of the last command, (k, 3)."""
    drives: Array
    """What the real robot was told, v and ω, (k, 2)."""
    offset: Array
    """D [s], (k,); NaN where the architecture has none."""
    delays: Array
    """When each packet was sent and how long it took [s], (p, 2)."""
    touched: tuple[Collision, ...]
    """What the real robot ran into, or who into it."""
    sent_bytes: int
    reported_bytes: int
    """What the real robot sent back."""
    learned: tuple[tuple[float, tuple[tuple[int, int], ...]], ...]
    """Cells that the virtual environment had beside the known map, each half second; empty without one."""

    @property
    def collisions(self) -> int:
        """How many there were."""
        return len(self.touched)

    def limits_passed(self) -> int:
        """How many drives were beyond the robot's limits of speed and acceleration."""
        limits, slack = IPR_LIMITS, 1 + 1e-9
        v, w = self.drives.T
        rise = np.abs(np.diff(v, prepend=0.0)) > limits.a_max * CONTROL * slack + 1e-12
        return int(np.sum(rise | (np.abs(v) > limits.v_max * slack) | (np.abs(w) > limits.w_max * slack)))

    def match(self) -> PathMatch:
        """The real robot's path matched to the virtual one's."""
        return match_paths(self.t, self.virtual[:, :2], self.real[:, :2])

    def compare(self) -> PathComparison:
        """How far the twins were apart."""
        return summed_up(self.match())


def make_robot(case: Case, start: Posture, room: str | Room) -> MobileRobot:
    """The real robot of a case."""
    senses = Senses() if case.architecture in SENSING else Senses(sonar=None)
    if case.position == "laser":
        # The micro-robot's sits on its middle.
        senses = replace(
            senses, laser=LaserModel(forward=0.0, height=0.06) if case.robot == "micro" else LaserModel()
        )
    # The seed's own streams: of the robot, of the network, of the operator.
    rng = np.random.default_rng([case.seed, 1])
    where = room or None
    if case.robot == "bare":
        return BareBody("ipr", start, room=where, reality=case.reality, rng=rng, senses=senses)
    from robots.ipr.body import MobileBody

    return MobileBody(case.robot, start, room=where, reality=case.reality, rng=rng, senses=senses)


def run(case: Case, driver: Operator | None = None, witness: Witness | None = None) -> DriveRun:
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
        return _Run(case, driver, link, body, witness).whole()


class Witness(Protocol):
    """Who notes what happens in a run, and changes nothing of it."""

    def begun(self, case: Case, start: Posture, body: MobileRobot, site: OperatorSite, link: DriveLink) -> None:
        """The run begins; the site and the link tell those who listen."""

    def sent(self, direction: str, now: float, size: int) -> None:
        """A packet of so many bytes goes `forward` or `backward` now [s]."""


class _Run:
    """A run while it goes on."""

    def __init__(
        self, case: Case, driver: Operator, link: DriveLink, body: MobileRobot, witness: Witness | None
    ) -> None:
        self._case, self._driver, self._link, self._body = case, driver, link, body
        model = ipr.model("micro" if case.robot == "micro" else "ipr", period=case.constants.period)
        made = controller(case.architecture, driver.start, case.constants)
        senses = case.architecture in SENSING
        there = operator_surroundings(body.room, body.chassis, driver.start, model) if senses else None
        here = robot_surroundings(body, driver.start, made, CONTROL) if senses else None
        self._site = OperatorSite(model, driver.start, case.transport, surroundings=there)
        position = POSITIONS[case.position](body)
        self._robot = RobotSite(made, position, IPR_LIMITS, period=CONTROL, surroundings=here)
        self._offset = made if isinstance(made, Player) else None
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
