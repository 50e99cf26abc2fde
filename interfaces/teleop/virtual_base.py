"""The virtual base: wishes become a command each T, at once on the virtual robot; the real one follows its arcs."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice
from typing import Final, TypeAlias

import numpy as np
from typing_extensions import override

from interfaces.link.delivery import Outgoing
from interfaces.messages import Order, Outcome, RefusalCode
from interfaces.messages.control import HOLDS, SensedPoints
from interfaces.messages.jobs import HALT, Doing, Errand, RobotTask, TaskReport
from interfaces.messages.recording import CommandRecord
from interfaces.messages.sites import ArcPacket, DriveOrders, DriveReport, Sample
from interfaces.teleop.architectures import ArchitectureOperatorSite, OperatorSurroundings, Transport
from interfaces.teleop.connection import SiteLine
from interfaces.teleop.deviation import Deviation, PathDeviation
from interfaces.teleop.operator import Correction, Halt, HaltCause, OperatorSite, VirtualRobot, not_following
from robots.onboard.driving import STAND, Drive, Posture, is_still
from vrs.checks import finite, normal
from vrs.commands import DriveCommand, Stop
from vrs.engine import MobileEngine
from vrs.mobile import MobileModel
from vrs.mobile.model import braking
from vrs.model import Array, frozen_array
from vrs.segment import known_arc

COMMANDS: Final = "a mobile robot is driven and stopped: drive and stop are what can be ordered"
AT_ONCE: Final = "a live drive begins as it comes: leave out execute_at"
"""Why a client's order isn't carried out."""
MOVING: Final = "the robot isn't at rest yet"
"""Why it can't go on."""
ERRANDS: Final = 4
"""So many that the robot isn't known to have are sent at once."""
WAITS: Final = 5.0
"""What is given while the robot comes to rest waits so long for that [s]."""
EPOCH_TIMEOUT: Final = 4.0
"""So long, and twice the usual round trip, a robot has to follow a new epoch [s]."""


class VirtualBase(VirtualRobot[DriveOrders, DriveReport]):
    """A mobile robot that is driven by what is wished, and what the real one says. Times are the operator's [s]."""

    engine: MobileEngine
    site: OperatorSite[VirtualBase]

    def __init__(
        self,
        model: MobileModel,
        posture: Posture,
        *,
        now: float,
        around: Callable[[Posture], OperatorSurroundings | None] = lambda _: None,
        transport: Transport = Transport.DATAGRAMS,
        matched: bool = True,
    ) -> None:
        """Stand; where the site says so, until the real robot has been met.

        Args:
            model: The robot.
            posture: Where it's shown until then.
            now: [s].
            around: Makes what it avoids, for a drive that begins at a posture.
            transport: How its path goes to the real robot.
            matched: Whether the real robot is matched to the path at each report, see `deviation`.
        """
        self._matched = matched
        self._model, self._around, self._transport = model, around, transport
        self.ended = False
        """Whether nothing is commanded any more: the real robot is only sent what it lacks of the path."""
        self.steps = 0
        """Commands since the drive began."""
        self.epochs = 0
        """How often it was put where the real one stands."""
        self.deviation: Deviation | None = None
        """Of the newest report; None before the first of an epoch."""
        self.tasks: TaskReport | None = None
        """How far the real robot is with what it does by itself; None before it has said."""
        self.sight: SensedPoints | None = None
        """What it saw last."""
        self.estimating = False
        """Whether the real robot's architecture has a posture estimator, see `Architecture.estimates`."""
        self._errands: Outgoing[Errand] = Outgoing()
        self._later: tuple[tuple[float, tuple[RobotTask, ...]], ...] = ()
        """What it's to be told when the next drive has begun, and when that was given [s]."""
        self._now = now
        self._prompt = False
        """Whether something is to be sent at once."""
        self._wish, self._until = STAND, -math.inf
        self._over = 0
        """Number of the first packet that said that the drive is over; 0 while it isn't."""
        self._set(posture, now)

    def _set(self, posture: Posture, now: float) -> None:
        """Begin a drive at a posture."""
        self.began, self.start = now, Posture(*map(normal, posture))
        self.steps = self._over = 0
        self.architecture = ArchitectureOperatorSite(
            self._model, posture, self._transport, start=now, surroundings=self._around(posture)
        )
        self.architecture.listener = self._told
        self.engine = self.architecture.engine
        """What the commands of this drive make; the next drive has another one."""
        self.path = PathDeviation(now, posture)
        self.deviation = None

    def _told(self, deed: CommandRecord) -> None:
        self.site.inform(lambda listener: listener.commanded(deed))

    def _put(self, posture: Posture, now: float, reason: str) -> None:
        """Begin a drive at a posture where the real robot is, and tell of it."""
        error, newest = np.subtract(self.virtual(now), posture), self.engine.newest
        self._set(posture, now)
        # Ids of commands are the session's, not a drive's.
        self.engine.count_from(newest)
        correction, truth = Correction(now, now, frozen_array(error), reason), self.engine.timeline
        self.site.inform(lambda listener: listener.corrected(correction, truth))

    @property
    def period(self) -> float:
        """T, between two commands [s]."""
        return self._model.period

    def carry_out(self, order: Order, *, now: float) -> Outcome:
        """Drive or stop as a client orders, see `interfaces.engine_server.servlet.Commander`."""
        command, refusal, code = order.command, "", RefusalCode.OTHER
        if isinstance(command, Stop):
            self.stop(now=now)
        elif not isinstance(command, DriveCommand):
            refusal = COMMANDS
        elif command.execute_at is not None:
            refusal = AT_ONCE
        else:
            issued = now if command.issued_at is None else command.issued_at
            refusal = self.wish(command.v, command.w, issued_at=issued, now=now, lasts=command.duration)
            code = RefusalCode.NOT_FOLLOWING if refusal else code
        return Outcome(order.number, now, None, refusal, code=code)

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
        site = self.site
        if site.gone:
            return not_following(site.gone).text
        if site.cause is HaltCause.BY_ITSELF and (v or w):
            # Who takes the wheel drives: first the robot comes to rest.
            self.stop(now=now)
        if site.halted is not None:
            return not_following(site.halted.text).text
        self._wish, self._until = Drive(v, w), min(issued_at, now) + min(lasts, HOLDS)
        return ""

    @override
    def stop(self, *, now: float) -> None:
        """Let both robots brake at once, each along its arc: the drive is over, with what's left of its path.

        What the real one does by itself is over as well.
        """
        self._later = ()
        if self.doing is not Doing.NOTHING:
            self._send(HALT)
            self.site.halted = None
        self.site.halt(Halt(HaltCause.STOPPED))

    @property
    def doing(self) -> Doing:
        """What the real robot does by itself, as far as is known; something, while it may have been told to."""
        report = self.site.report
        told = any(not errand.task.stops for errand in self._errands.waiting.values())
        if told and self.site.cause is HaltCause.BY_ITSELF:
            return Doing.JOBS
        return Doing.NOTHING if report is None else report.doing

    def order(self, *tasks: RobotTask) -> str:
        """Let the real robot do something by itself; the virtual one comes to rest, and follows it then.

        Args:
            tasks: What, in this order.

        Returns:
            Why not; empty if it's told to.
        """
        site = self.site
        if site.gone:
            return not_following(site.gone).text
        if site.report is None:
            return HaltCause.NOT_MET.value
        if not all(task.stops for task in tasks):
            if site.cause is HaltCause.STOPPED:
                # It's told once it has come to rest, and the next drive has begun.
                self._later = *self._later, (self._now, tasks)
                return ""
            if site.halted is not None and site.cause is not HaltCause.BY_ITSELF:
                return not_following(site.halted.text).text
            site.halt(Halt(HaltCause.BY_ITSELF))
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
        return self.architecture.before == STAND

    @override
    def rests(self, *, now: float) -> bool:
        return self.stands

    @property
    @override
    def done(self) -> bool:
        """Whether a drive that's over has come to its end: both robots stand, and the real one knows it."""
        epoch, report = self.site.epoch, self.site.report
        if report is None or not self.stands:
            return self.stands
        knows = bool(report.halted) or (report.echo is not None and 0 < self._over <= report.echo[0])
        if report.doing is not Doing.NOTHING or (self._errands.waiting and report.epoch == epoch):
            return False
        return is_still(report.drive) and (knows or report.epoch != epoch or not self.epochs)

    @override
    def shown(self, *, now: float) -> Array:
        """Where it's drawn: where the posture estimator has it, in an architecture that has one."""
        doing = self.site.report is not None and self.site.report.doing is not Doing.NOTHING
        return np.array(self.architecture.estimated(now) if self.estimating and not doing else self.virtual(now))

    @override
    def restart(self, *, now: float) -> str:
        site, report = self.site, self.site.report
        if report is None:
            return HaltCause.NOT_MET.value
        if site.halted is None:
            return ""
        if report.doing is not Doing.NOTHING and not self._errands.waiting:
            site.halted = Halt(HaltCause.BY_ITSELF)
            return ""
        if not self.done:
            return MOVING
        self._errands.waiting.clear()
        site.begin()
        self.epochs += 1
        self._wish, self._until = STAND, -math.inf
        self._put(report.posture, now, "a drive begins where the real robot stands")
        later, self._later = self._later, ()
        for given, tasks in later:
            if now <= given + WAITS:
                self.order(*tasks)
        return ""

    @override
    def give_up(self) -> None:
        """Come to rest."""
        self._until = -math.inf
        self._later = ()

    @override
    def orders(self, number: int, *, now: float) -> DriveOrders | None:
        site = self.site
        self._now = now
        packet: ArcPacket | None = None
        while now >= self.next_t - 1e-9:
            packet = self._step()
        if packet is None:
            if (not site.halted or self._over) and not self._prompt:
                return None
            # That a drive is over is said at once.
            packet = ArcPacket()
        behind = site.report is not None and (site.report.epoch or 0) < site.epoch
        if behind and site.report is not None and site.cause in {None, HaltCause.BY_ITSELF}:
            usual = site.round_trips.quantile(0.95) or 0.0
            if now > self.began + EPOCH_TIMEOUT + 2.0 * usual:
                site.halted = None
                why = site.report.refused or "the robot doesn't take up the new drive"
                site.halt(Halt(HaltCause.STUCK, why))
        if site.halted and not self._over:
            self._over = number
        self._prompt = False
        # What it's to do by itself belongs to a drive, too: that must have begun.
        begins = site.cause is HaltCause.BY_ITSELF and behind
        start = None if site.halted is not None and not begins else self.start
        return DriveOrders(
            epoch=site.epoch,
            number=number,
            sent_at=now,
            began=self.began,
            complete_until=packet.complete_until,
            start=start,
            runs=packet.runs,
            tail=packet.tail,
            errands=tuple(islice(self._errands.waiting.values(), ERRANDS)),
        )

    @property
    def next_t(self) -> float:
        """Time of the next command [s]."""
        return self.began + self.steps * self._model.period

    def surrounded_at(self, now: float) -> float:
        """Time that its surroundings go by [s], never back: now, from the newest command to the next."""
        T = self._model.period
        return min(max(now, self.began + max(self.steps - 1, 0) * T), self.began + self.steps * T)

    def _step(self) -> ArcPacket:
        """One command; of a drive that's over the virtual robot only comes to rest."""
        t = self.next_t
        wished = self._wish if t < self._until else self._braked()
        self.steps += 1
        if self.ended:
            return self.architecture.repeat()
        if self.site.halted and self.stands:
            return ArcPacket()
        here = self.architecture.posture
        packet = self.architecture.drive(wished.v, wished.w, now=t)
        if self._matched:
            self.path.add(known_arc(t, self._model.period, here, *self.architecture.before))
        return ArcPacket() if self.site.halted else packet

    def _braked(self) -> Drive:
        """The next command on the way to rest, along the arc."""
        steps = braking(self.architecture.before, self._model.period, self._model.limits)
        return Drive(*steps[0]) if steps else STAND

    @override
    def next_deadline(self) -> float:
        return self.next_t

    @override
    def hear(self, report: DriveReport, *, new: bool, now: float) -> bool:
        site, known = self.site, self.site.report
        if report.report is not None and report.epoch == site.epoch and site.cause is not HaltCause.BY_ITSELF:
            self.architecture.receive(report.report, now=self.surrounded_at(now))
        if not new:
            return False
        if site.cause is HaltCause.NOT_MET:
            self._put(report.posture, now, "the real robot has been met")
            site.halted = Halt(HaltCause.FREE)
        if known is None or report.measured_at > known.measured_at:
            play = report.measured_at if report.play is None else self.began + report.play
            t, posture = report.measured_at, report.posture
            site.inform(lambda told: told.measured((Sample(0, t, play, frozen_array(posture)),), now=now))
        return True

    @override
    def take(self, report: DriveReport, *, now: float) -> None:
        site = self.site
        self.tasks = self.tasks if report.tasks is None else report.tasks
        self.sight = self.sight if report.sight is None else report.sight
        if report.epoch != site.epoch:
            return
        self._errands.acknowledge(report.errand)
        if report.halted:
            # What it was told and hasn't begun isn't to begin after a stop.
            waiting = self._errands.waiting
            self._errands.waiting = {number: errand for number, errand in waiting.items() if errand.task.stops}
            if site.cause is HaltCause.BY_ITSELF:
                site.halted = None
            site.halt(Halt(HaltCause.REPORTED, report.halted))
        elif site.cause is HaltCause.BY_ITSELF:
            if not self._errands.waiting and report.doing is Doing.NOTHING:
                # The next drive begins where it has come to.
                site.halted = Halt(HaltCause.STOPPED)
        elif report.report is not None and self._matched:
            self.deviation = self.path.match(report.posture, report.measured_at)

    def virtual(self, now: float) -> Posture:
        """Where the virtual robot is [s]; of one that drives by itself, where it takes itself to be."""
        report = self.site.report
        if report is not None and report.doing is not Doing.NOTHING:
            return report.posture
        return Posture(*self.engine.timeline.sample(now).tolist())


DriveLine: TypeAlias = SiteLine[VirtualBase, DriveOrders, DriveReport]
"""To a mobile robot."""
