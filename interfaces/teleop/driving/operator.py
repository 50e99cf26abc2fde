"""The operator's site of a mobile robot, live: wishes become a command each T, at once on the virtual robot."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from itertools import islice
from typing import Final, NamedTuple, TypeAlias

from interfaces.link.delivery import Outgoing
from interfaces.link.quantiles import SlidingQuantiles
from interfaces.messages.drive_sites import (
    HALT,
    ArcPacket,
    Doing,
    DriveOrders,
    DriveReport,
    Errand,
    RobotTask,
    SensedPoints,
    TaskReport,
    arc_rows,
)
from interfaces.messages.fields import Epoch
from interfaces.teleop.architectures import ArchitectureOperatorSite, OperatorSurroundings, Transport
from interfaces.teleop.connection import SiteLine
from interfaces.teleop.halt import Halt, HaltCause, not_following
from robots.onboard.driving import STAND, Drive, Posture, is_still
from vrs.checks import finite, normal
from vrs.mobile import MobileModel
from vrs.mobile.model import braking
from vrs.segment import ArcSegment

BACK, AHEAD = 8, 60
"""How many pieces of the path behind the place before, and ahead of it, are looked at."""
KEPT = 12_000
"""Pieces that are kept: ten minutes of a command's two a tenth of a second."""
_SAME = 1e-6
"""Places nearer than this are one [m]."""
_STANDS, _REACHED = 0.15, 0.04
"""A path stands where it stays for longer [s], and a robot has reached that from so near [m]."""


class Deviation(NamedTuple):
    """How a robot is on its path."""

    path_error: float
    """Distance from the nearest place of the path near the one before [m]."""
    time_difference: float
    """How much later than the path's it is there [s], ≥ 0."""


class _Point(NamedTuple):
    t: float
    x: float
    y: float
    left: float
    """When the path goes on from here [s]: later than t where it stands."""


class PathDeviation:
    """Matches postures to a path that grows: how far a robot is from it, and how much later.

    The laboratory matches whole paths afterwards (`vrs.comparison`); live, each measured posture is matched to the
    nearest place of the path near the place before.
    """

    def __init__(self, t: float, posture: Posture) -> None:
        """Begin a path at a time [s] and a place."""
        self._points: deque[_Point] = deque([_Point(t, posture.x, posture.y, t)])
        self._at = 0
        self.place = t
        """Time on the path of the newest match [s]."""

    def add(self, arc: ArcSegment) -> None:
        """Let the path go on by an arc."""
        for t in (arc.start + 0.5 * arc.duration, arc.end):
            x, y, _ = (float(value) for value in arc.value(t))
            last = self._points[-1]
            if math.hypot(x - last.x, y - last.y) <= _SAME:
                self._points[-1] = last._replace(left=t)
            else:
                self._points.append(_Point(t, x, y, t))
        while len(self._points) > KEPT:
            self._points.popleft()
            self._at = max(self._at - 1, 0)

    def match(self, posture: Posture, measured_at: float) -> Deviation:
        """Where a robot is on the path.

        Args:
            posture: Of the robot.
            measured_at: When it was there [s], by the path's clock.
        """
        first = max(self._at - BACK, 0)
        near = list(islice(self._points, first, self._at + AHEAD))
        best, found, at = math.inf, near[0], 0
        for k, point in enumerate(near):
            place = point if k + 1 == len(near) else _beside(point, near[k + 1], posture)
            distance = math.hypot(place.x - posture.x, place.y - posture.y)
            if distance < best:
                best, found, at = distance, place, k
        self._at, self.place = first + at, found.t
        # Near to where the path stands a robot is there, whatever the noise of its posture says.
        stands = (p for p in near[at : at + 4] if p.left - p.t > _STANDS)
        reached = [p for p in stands if math.hypot(p.x - found.x, p.y - found.y) < _REACHED]
        if reached and reached[-1] is self._points[-1]:
            return Deviation(best, 0.0)
        return Deviation(best, max(0.0, measured_at - max([found.left, *(p.left for p in reached)])))


def _beside(a: _Point, b: _Point, posture: Posture) -> _Point:
    """The place on the piece from a to b that is nearest to a posture; b itself is the next piece's."""
    x, y = b.x - a.x, b.y - a.y
    share = ((posture.x - a.x) * x + (posture.y - a.y) * y) / (x * x + y * y)
    if not 0.0 < share < 1.0:
        return a
    t = a.left + share * (b.t - a.left)
    return _Point(t, a.x + share * x, a.y + share * y, t)


MOVING: Final = "the robot isn't at rest yet"
"""Why it can't go on."""
HOLDS: Final = 0.3
"""A wish counts for so long [s]: who says nothing more stops."""
ERRANDS: Final = 4
"""So many that the robot isn't known to have are sent at once."""
WAITS: Final = 5.0
"""What is given while the robot comes to rest waits so long for that [s]."""
EPOCH_TIMEOUT: Final = 4.0
"""So long, and twice the usual round trip, a robot has to follow a new epoch [s]."""


class DrivingOperator:
    """The virtual robot, driven by what is wished, and what the real one says. Times are the operator's [s]."""

    def __init__(
        self,
        model: MobileModel,
        posture: Posture,
        *,
        now: float,
        around: Callable[[Posture], OperatorSurroundings | None] = lambda _: None,
    ) -> None:
        """Stand, until the real robot has been met.

        Args:
            model: The virtual robot.
            posture: Where it's shown until then.
            now: [s].
            around: Makes what the virtual robot avoids, for a drive that begins at a posture.
        """
        self._model, self._around = model, around
        self.halted: Halt | None = Halt(HaltCause.NOT_MET)
        """Why the real robot doesn't follow; None while it does."""
        self.gone = ""
        """Why there's no robot any more, whatever anybody does; empty while there may be one."""
        self.epoch = 1
        self.steps = 0
        """Commands since the drive began."""
        self.epochs = 0
        """How often the virtual robot was put where the real one stands."""
        self.report: DriveReport | None = None
        """The newest that counts."""
        self.deviation: Deviation | None = None
        """Of the newest report; None before the first of an epoch."""
        self.round_trip: float | None = None
        self.round_trips = SlidingQuantiles(1000, 120.0)
        self.tasks: TaskReport | None = None
        """How far the robot is with what it does by itself; None before it has said."""
        self.sight: SensedPoints | None = None
        """What it saw last."""
        self._errands: Outgoing[Errand] = Outgoing()
        self._later: tuple[tuple[float, tuple[RobotTask, ...]], ...] = ()
        """What it's to be told when the next drive has begun, and when that was given [s]."""
        self._now = now
        self._prompt = False
        """Whether something is to be sent at once."""
        self._measured_since = -math.inf
        self._packets = 0
        self._wish, self._until = STAND, -math.inf
        self._over = 0
        """Number of the first packet that said that the drive is over; 0 while it isn't."""
        self._set(posture, now)

    def _set(self, posture: Posture, now: float) -> None:
        """Begin a drive at a posture."""
        self.began, self.start = now, posture
        self.steps = self._over = 0
        self._heard = now
        self.site = ArchitectureOperatorSite(
            self._model, posture, Transport.DATAGRAMS, surroundings=self._around(posture)
        )
        self.path = PathDeviation(0.0, posture)
        self.deviation = None

    @property
    def period(self) -> float:
        """T, between two commands [s]."""
        return self._model.period

    def wish(self, v: float, w: float, *, issued_at: float, now: float, lasts: float = HOLDS) -> str:
        """Drive so from the next command on, as far as the limits allow, for a while.

        Args:
            v: Linear speed [m/s].
            w: Angular speed [rad/s].
            issued_at: When that was wished; older than it holds, it moves nothing [s].
            now: [s].
            lasts: For how long from then on [s], at most `HOLDS`.

        Returns:
            That the robot doesn't follow, and why; empty if it counts.
        """
        finite("v", v)
        finite("w", w)
        if self.gone:
            return not_following(self.gone).text
        if self.cause is HaltCause.BY_ITSELF and (v or w):
            # Who takes the wheel drives: first the robot comes to rest.
            self.stop()
        if self.halted is not None:
            return not_following(self.halted.text).text
        self._wish, self._until = Drive(v, w), min(issued_at, now) + min(lasts, HOLDS)
        return ""

    def stop(self) -> None:
        """Let both robots brake at once, each along its arc: the drive is over, with what's left of its path.

        What the real one does by itself is over as well.
        """
        self._later = ()
        if self.doing is not Doing.NOTHING:
            self._send(HALT)
            self.halted = None
        self.halt(Halt(HaltCause.STOPPED))

    @property
    def cause(self) -> HaltCause | None:
        """Why the real robot doesn't follow, in a word; None while it does."""
        return None if self.halted is None else self.halted.cause

    @property
    def doing(self) -> Doing:
        """What the real robot does by itself, as far as is known; something, while it may have been told to."""
        report = self.report
        told = any(not errand.task.stops for errand in self._errands.waiting.values())
        if told and self.cause is HaltCause.BY_ITSELF:
            return Doing.JOBS
        return Doing.NOTHING if report is None else report.doing

    def order(self, *tasks: RobotTask) -> str:
        """Let the real robot do something by itself; the virtual one comes to rest, and follows it then.

        Args:
            tasks: What, in this order.

        Returns:
            Why not; empty if it's told to.
        """
        if self.gone:
            return not_following(self.gone).text
        if self.report is None:
            return HaltCause.NOT_MET.value
        if not all(task.stops for task in tasks):
            if self.cause is HaltCause.STOPPED:
                # It's told once it has come to rest, and the next drive has begun.
                self._later = *self._later, (self._now, tasks)
                return ""
            if self.halted is not None and self.cause is not HaltCause.BY_ITSELF:
                return not_following(self.halted.text).text
            self.halt(Halt(HaltCause.BY_ITSELF))
        self._send(*tasks)
        return ""

    def _send(self, *tasks: RobotTask) -> None:
        """Send errands, until the robot has them; one that stops everything overrules what it hasn't heard yet."""
        for task in tasks:
            if task.halt is not None:
                self._errands.waiting.clear()
            self._errands.add(Errand(self._errands.count + 1, task))
        self._prompt = True

    @property
    def stands(self) -> bool:
        """Whether the virtual robot's newest command is to stand."""
        return self.site.before == STAND

    @property
    def done(self) -> bool:
        """Whether a drive that's over has come to its end: both robots stand, and the real one knows it."""
        report = self.report
        if report is None or not self.stands:
            return self.stands
        knows = bool(report.halted) or (report.echo is not None and 0 < self._over <= report.echo[0])
        if report.doing is not Doing.NOTHING or (self._errands.waiting and report.epoch == self.epoch):
            return False
        return is_still(report.drive) and (knows or report.epoch != self.epoch or not self.epochs)

    def resume(self, *, now: float) -> str:
        """Begin a drive where the real robot stands; why that can't be, empty if it does."""
        report = self.report
        if self.gone or report is None:
            return self.gone or HaltCause.NOT_MET.value
        if self.halted is None:
            return ""
        if report.doing is not Doing.NOTHING and not self._errands.waiting:
            self.halted = Halt(HaltCause.BY_ITSELF)
            return ""
        if not self.done:
            return MOVING
        self._errands.waiting.clear()
        self.epoch += 1
        self.epochs += 1
        self.halted, self._wish, self._until = None, STAND, -math.inf
        self._set(report.posture, now)
        later, self._later = self._later, ()
        for given, tasks in later:
            if now <= given + WAITS:
                self.order(*tasks)
        return ""

    def halt(self, why: Halt) -> None:
        """Let the drive be over; the virtual robot comes to rest."""
        if self.halted is None:
            self.halted = why
            self._until = -math.inf
            self._later = ()

    def advance(self, *, now: float) -> tuple[DriveOrders, ...]:
        """Do what is due by now [s], and say what is to be sent."""
        self._now = now
        packet: ArcPacket | None = None
        while now >= self._due - 1e-9:
            packet = self._step()
        if packet is None:
            if (not self.halted or self._over) and not self._prompt:
                return ()
            # That a drive is over is said at once.
            packet = ArcPacket((), 0.0)
        behind = self.report is not None and (self.report.epoch or 0) < self.epoch
        if self.cause in {None, HaltCause.BY_ITSELF} and self.report is not None and behind:
            usual = self.round_trips.quantile(0.95) or 0.0
            if now > self.began + EPOCH_TIMEOUT + 2.0 * usual:
                self.halted = None
                why = self.report.refused or "the robot doesn't take up the new drive"
                self.halt(Halt(HaltCause.STUCK, why))
        self._packets += 1
        if self.halted and not self._over:
            self._over = self._packets
        self._prompt = False
        # What it's to do by itself belongs to a drive, too: that must have begun.
        begins = self.cause is HaltCause.BY_ITSELF and behind
        start = None if self.halted is not None and not begins else self.start
        return (
            DriveOrders(
                epoch=Epoch(self.epoch),
                number=self._packets,
                sent_at=now,
                began=self.began,
                complete_until=packet.complete_until,
                start=None if start is None else Posture(*map(normal, start)),
                runs=tuple((first, arc_rows(arcs)) for first, arcs in packet.runs),
                tail=arc_rows(packet.tail),
                errands=tuple(islice(self._errands.waiting.values(), ERRANDS)),
            ),
        )

    @property
    def next_t(self) -> float:
        """Time of the next command, from the drive's beginning [s]: what surrounds the virtual robot goes by it."""
        return self.steps * self._model.period

    @property
    def _due(self) -> float:
        return self.began + self.next_t

    def _step(self) -> ArcPacket:
        """One command; of a drive that's over the virtual robot only comes to rest."""
        t = self.next_t
        wished = self._wish if self.began + t < self._until else self._braked()
        self.steps += 1
        if self.halted and self.stands:
            return ArcPacket((), 0.0)
        packet = self.site.drive(wished.v, wished.w, now=t)
        v, w = self.site.before
        x, y, theta = self.site.engine.posture(t).tolist()
        self.path.add(ArcSegment(t, self._model.period, (x, y, theta), v, w))
        return ArcPacket((), 0.0) if self.halted else packet

    def _braked(self) -> Drive:
        """The next command on the way to rest, along the arc."""
        steps = braking(self.site.before, self._model.period, self._model.limits)
        return Drive(*steps[0]) if steps else STAND

    def next_deadline(self) -> float:
        """When there's something to do [s]."""
        return self._due

    def receive(self, report: DriveReport, *, now: float) -> None:
        """Take in a report of the robot."""
        if self.report is not None and report.number <= self.report.number:
            return
        self._heard = now
        if self.report is None:
            self._set(report.posture, now)
            self.halted = Halt(HaltCause.FREE)
        self.report = report
        self.tasks = self.tasks if report.tasks is None else report.tasks
        self.sight = self.sight if report.sight is None else report.sight
        if report.echo is not None and report.epoch == self.epoch:
            _, sent, arrived = report.echo
            self.round_trip = now - sent - (report.sent_at - arrived)
            if sent >= self._measured_since:
                self.round_trips.add(self.round_trip, now=now)
        if report.epoch != self.epoch:
            return
        self._errands.acknowledge(report.errand)
        if report.halted:
            # What it was told and hasn't begun isn't to begin after a stop.
            waiting = self._errands.waiting
            self._errands.waiting = {number: errand for number, errand in waiting.items() if errand.task.stops}
            if self.cause is HaltCause.BY_ITSELF:
                self.halted = None
            self.halt(Halt(HaltCause.REPORTED, report.halted))
        elif self.cause is HaltCause.BY_ITSELF:
            if not self._errands.waiting and report.doing is Doing.NOTHING:
                # The next drive begins where it has come to.
                self.halted = Halt(HaltCause.STOPPED)
        elif report.report is not None:
            self.site.receive(report.report, now=self.next_t)
            self.deviation = self.path.match(report.posture, report.measured_at - self.began)

    def heard_ago(self, now: float) -> float:
        """How long ago the newest report came [s]."""
        return max(0.0, now - self._heard)

    def measure_anew(self, *, now: float) -> None:
        """Forget the round trips of messages that were sent before now [s]: the way is another one."""
        self.round_trips.clear()
        self._measured_since = now

    def virtual(self, now: float) -> Posture:
        """Where the virtual robot is [s]; of one that drives by itself, where it takes itself to be."""
        if self.report is not None and self.report.doing is not Doing.NOTHING:
            return self.report.posture
        return Posture(*self.site.engine.timeline.sample(now - self.began).tolist())


DriveLine: TypeAlias = SiteLine[DrivingOperator, DriveOrders, DriveReport]
"""To a mobile robot."""
