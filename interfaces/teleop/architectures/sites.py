"""The two ends of every architecture, the same for all of them: the operator's site and the robot's."""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from typing import Protocol

from interfaces.link.conditions import Service
from interfaces.link.delivery import Incoming, Outgoing
from interfaces.messages.recording import CommandRecord
from interfaces.messages.sites import MOST_REPEATED, ArchitectureReport, ArcPacket, ArcRow, arc_rows, arcs_of
from interfaces.teleop.architectures.surroundings import OperatorSurroundings, RobotSurroundings
from robots.onboard.driving import STAND, Drive, Posture, kept
from robots.onboard.following import PositionSource
from vrs import DriveCommand, Engine, ManualClock
from vrs.engine import MobileEngine
from vrs.mobile import DriveLimits, MobileModel, PostureEstimator
from vrs.mobile.model import advanced, braking, limited
from vrs.segment import ArcSegment, known_arc

MOST_EARLY = 36_000
"""So far ahead of the one that's missing arcs are kept; what comes beyond is left out, and repeated."""


class Transport(enum.StrEnum):
    """How packets go to the robot; both transports carry the same ones.

    Over an ordered stream each arc goes once, and waits for those before it. In datagrams every arc is repeated
    until the robot has said that it has it, so that any packet that arrives makes up for all that were lost or are
    late.
    """

    STREAM = "stream"
    """An ordered byte stream: a late packet holds back all after it."""
    DATAGRAMS = "datagrams"
    """Datagrams; each repeats what the robot hasn't acknowledged."""

    @property
    def service(self) -> Service:
        """What the link promises about order."""
        return Service.IN_ORDER if self is Transport.STREAM else Service.DATAGRAM


class DriveController(Protocol):
    """Drives the robot by what comes from the operator; it knows no clock and is called once a control period."""

    def receive(self, arcs: Sequence[ArcSegment], packet: ArcPacket, *, now: float) -> None:
        """Take in a packet.

        Args:
            arcs: The operator's arcs whose turn it is now, in order, each once.
            packet: What they came in.
            now: By the robot's clock [s].
        """

    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Say what to drive until the next call.

        Args:
            posture: Where the robot takes itself to be.
            now: By the robot's clock [s].
            v_before: Linear speed that it was told to drive last [m/s].
        """

    executed: int
    """Index j of eq. (9): how many of the operator's commands the robot has executed."""


class ArchitectureOperatorSite:
    """The virtual robot, which answers at once; the posture estimator; and what is sent."""

    def __init__(
        self,
        model: MobileModel,
        posture: Posture,
        transport: Transport,
        *,
        start: float = 0.0,
        gain: float = 0.5,
        surroundings: OperatorSurroundings | None = None,
    ) -> None:
        """Begin at rest.

        Args:
            model: The virtual robot.
            posture: Where both robots begin.
            transport: How packets go.
            start: When they begin [s].
            gain: K_e of the posture estimator, in [0, 1].
            surroundings: The virtual environment that the virtual robot avoids, in the extended architecture.
        """
        self._clock = ManualClock(start)
        engine = Engine(model, posture=posture, clock=self._clock)
        assert isinstance(engine, MobileEngine)
        self.engine: MobileEngine = engine
        """The virtual robot: what the operator's commands make, without corrections."""
        self.estimator = PostureEstimator(posture, gain=gain, period=model.period)
        """Where the real robot is thought to be after all commands."""
        self._transport = transport
        self._began = start
        self._arcs: Outgoing[ArcRow] = Outgoing()
        self.posture = posture
        """Where the virtual robot is after all commands."""
        self._model = model
        self.surroundings = surroundings
        """What the virtual robot avoids, if anything."""
        self.listener: Callable[[CommandRecord], object] | None = None
        """Is told of each command at once."""
        self.before = STAND
        """What was driven last."""

    def drive(self, v: float, w: float, *, now: float) -> ArcPacket:
        """Carry out a command of the operator, as far as the limits allow.

        Args:
            v: Linear speed that he wants [m/s].
            w: Angular speed that he wants [rad/s].
            now: When it begins [s]: where the one before it ended, or later.

        Returns:
            What goes to the robot.
        """
        period = self._model.period
        if self.surroundings is not None:
            v, w = self.surroundings.command(Drive(v, w), self.before, self.posture, now=now)
        v, w = self.before = Drive(*limited((v, w), self.before, period, self._model.limits))
        self._clock.advance(now - self._clock.now())
        start = max(self.engine.timeline.end, now)
        command = DriveCommand(v, w, period, execute_at=start)
        receipt = self.engine.execute(command)
        if self.listener is not None:
            self.listener(CommandRecord(0, self._clock.now(), command, receipt))
        self.estimator.command(v, w)
        arc = known_arc(start, period, self.posture, v, w, receipt.command_id)
        self.posture = Posture(*advanced(self.posture, v, w, period))
        row, *tail = arc_rows((arc, *self._tail(arc)), self._began)
        self._arcs.add(row)
        return self._packet(arc.end, tail)

    def estimated(self, t: float) -> Posture:
        """Where the virtual robot is when the posture estimator moves it, eq. (8)–(10).

        Args:
            t: While the newest command lasts, or after it [s].
        """
        count, left = self.estimator.count, self.engine.timeline.end - t
        if not count or left <= 0:
            return Posture(*self.estimator.posture.tolist())
        begun = max(0.0, self._model.period - left)
        return Posture(*advanced(self.estimator.estimate(count - 1).tolist(), *self.before, begun))

    def repeat(self) -> ArcPacket:
        """What goes to the robot while the operator gives no command."""
        return self._packet(self.engine.timeline.end)

    def receive(self, report: ArchitectureReport, *, now: float) -> None:
        """Correct the estimate, repeat no more what has arrived, and learn what changed around the robot [s]."""
        if self.surroundings is not None and report.seen_at is not None:
            self.surroundings.receive(report.cells, report.seen_at, now=now)
        self._arcs.acknowledge(report.received)
        self.estimator.feedback(report.executed, report.posture, report.number)

    def _packet(self, complete_until: float, tail: Sequence[ArcRow] = ()) -> ArcPacket:
        """Make a packet of what the robot may lack; arcs are numbered from 0 in it.

        Args:
            complete_until: Up to when the path is final [s].
            tail: The braking after it.
        """
        first, arcs, half = self._arcs.acknowledged, tuple(self._arcs.waiting.values()), MOST_REPEATED // 2
        runs = [(first, arcs)] if arcs else []
        if self._transport is Transport.STREAM:
            self._arcs.acknowledge(self._arcs.count)
        elif len(arcs) > MOST_REPEATED:
            runs = [(first, arcs[:half]), (self._arcs.count - half, arcs[-half:])]
        return ArcPacket(tuple(runs), complete_until - self._began, tuple(tail))

    def _tail(self, arc: ArcSegment) -> list[ArcSegment]:
        """How the virtual robot brakes, unless the operator goes on."""
        start, posture, T = arc.end, self.posture, self._model.period
        tail = []
        for v, w in braking((arc.v, arc.w), T, self._model.limits):
            tail.append(known_arc(start, T, posture, v, w))
            start, posture = start + T, Posture(*advanced(posture, v, w, T))
        return tail


class ArchitectureRobotSite:
    """Takes packets, knows where the robot is, lets the architecture's controller drive, and reports."""

    def __init__(
        self,
        controller: DriveController,
        position: PositionSource,
        limits: DriveLimits,
        *,
        period: float,
        surroundings: RobotSurroundings | None = None,
    ) -> None:
        """Begin at rest.

        Args:
            controller: The architecture.
            position: What tells where the robot is.
            limits: That every drive keeps, whatever the controller says.
            period: Between two drives [s].
            surroundings: Sonar, its supervisor and obstacle avoidance, in the extended architecture.
        """
        self.controller = controller
        self._surroundings = surroundings
        self._position, self._limits, self._period = position, limits, period
        self._arcs: Incoming[ArcRow] = Incoming(MOST_EARLY)
        self._drive = Drive(0.0, 0.0)
        self._reports = 0
        self.posture = position.posture()
        """Where the robot took itself to be at the last drive."""

    def receive(self, packet: ArcPacket, *, now: float) -> None:
        """Take in a packet [s]."""
        due = [row for first, rows in packet.runs for row in self._arcs.take(first + 1, rows)]
        self.controller.receive(arcs_of(due), packet, now=now)

    def drive(self, *, now: float) -> Drive:
        """What to drive for the next period."""
        self.posture = self._position.posture()
        wanted = self.controller.control(self.posture, now=now, v_before=self._drive.v)
        if self._surroundings is not None:
            wanted = self._surroundings.drive(wanted, self.posture, now=now, v_before=self._drive.v)
        self._drive = kept(wanted.v, wanted.w, self._drive.v, self._period, self._limits)
        return self._drive

    def report(self, *, now: float) -> ArchitectureReport:
        """What goes back to the operator now [s]."""
        self._reports += 1
        done = self._reports, self.controller.executed, self.posture, self._arcs.count
        if self._surroundings is None:
            return ArchitectureReport(*done)
        return ArchitectureReport(*done, now, self._surroundings.supervisor.changes(now=now))
