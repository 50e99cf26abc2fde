"""The operator's site: a virtual robot that answers at once, and what is known of the real one that follows it.

What is planned, and what of it goes to the real robot, differs between arms and bases: `VirtualArm`, `VirtualBase`.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from interfaces.link.quantiles import LARGEST, SlidingQuantiles
from interfaces.messages import Refusal, RefusalCode
from interfaces.messages.fields import Epoch
from interfaces.messages.recording import CommandRecord
from interfaces.messages.sites import Sample, SiteReport
from vrs.engine import Engine
from vrs.ledger import Receipt
from vrs.model import Array

NOT_FOLLOWING = "the robot doesn't follow"
"""How refusals begin while it doesn't."""


class HaltCause(enum.StrEnum):
    """Why the real robot doesn't follow, as people are told where nothing says more."""

    NOT_MET = "the robot hasn't been met yet"
    """Nothing has come from it."""
    FREE = "nobody has control"
    """Between two drives."""
    STOPPED = "stopped"
    """Somebody stopped it; the next drive begins once both robots rest."""
    BY_ITSELF = "the robot drives by itself"
    """It does what it was told to do by itself."""
    REPORTED = "the robot stopped by itself"
    """It said why."""
    STUCK = "the robot makes no progress"
    """It hears what it's sent, and makes nothing of it."""
    GONE = "there's no robot any more"
    """Nothing that anybody does brings it back."""


class Halt(NamedTuple):
    """That the real robot doesn't follow."""

    cause: HaltCause
    detail: str = ""
    """What is known of it, for people; empty where the cause says it all."""

    @property
    def text(self) -> str:
        """Why, for people."""
        return self.detail or self.cause.value


def text_of(halt: Halt | None) -> str:
    """Why the real robot doesn't follow, for people; empty while it does."""
    return "" if halt is None else halt.text


def not_following(why: str) -> Refusal:
    """What a command is refused with while the robot doesn't follow, for that reason."""
    return Refusal(f"{NOT_FOLLOWING}: {why}", RefusalCode.NOT_FOLLOWING)


class Correction(NamedTuple):
    """The virtual robot was put where the real one is going."""

    t: float
    """When, by the operator's clock [s]."""
    end: float
    """Until when it takes [s]."""
    error: Array
    """By how much it was off, (n,) [rad]; of a base (x, y, θ) [m, m, rad]."""
    reason: str


O = TypeVar("O")  # noqa: E741 - orders
R = TypeVar("R", bound=SiteReport)
O_co = TypeVar("O_co", covariant=True)
R_contra = TypeVar("R_contra", bound=SiteReport, contravariant=True)
T_contra = TypeVar("T_contra", contravariant=True)


class SiteObserver(Protocol[R_contra, T_contra]):
    """Who is told of all that happens, at once: it must not take long, and changes nothing.

    It's told of reports of one kind, and of one kind of timeline.
    """

    def commanded(self, deed: CommandRecord) -> None:
        """The engine was given a command. What raised isn't told: it changed nothing, and took no id."""

    def corrected(self, correction: Correction, truth: T_contra) -> None:
        """The engine's timeline has joined another one."""

    def answered(self, command_id: int, receipt: Receipt, *, now: float) -> None:
        """The robot's engine has answered a command of the operator's: its id there, and the answer."""

    def reported(self, report: R_contra, *, now: float) -> None:
        """A report has come that is newer than all before."""

    def measured(self, samples: Sequence[Sample], *, now: float) -> None:
        """Samples of the robot have come that weren't known: mostly the newest, some of them late."""

    def grasped(self, report: Any, *, now: float) -> None:
        """A report has come with a newer state of an arm's hand and of the things around it."""

    def failed(self, error: Exception) -> None:
        """Being told raised this: nothing more is told."""


class VirtualRobot(Protocol[O_co, R_contra]):
    """What answers the operator at once, and what of that goes to the real robot. Times are the operator's [s]."""

    engine: Engine
    """What the operator's commands make."""
    site: OperatorSite[Any]
    """Where it's the virtual robot; that site says so."""

    def stop(self, *, now: float) -> None:
        """Let both robots come to rest."""

    def rests(self, *, now: float) -> bool:
        """Whether it's at rest by now."""

    @property
    def done(self) -> bool:
        """Whether the real robot is known to have come to rest as well, as far as it has been heard."""

    def shown(self, *, now: float) -> Array:
        """Where it's drawn: joints (n,) [rad], or (x, y, θ) [m, m, rad]."""

    def orders(self, number: int, *, now: float) -> O_co | None:
        """Do what is due by now, and say what is to be sent: the message of that number, or None."""

    def hear(self, report: R_contra, *, new: bool, now: float) -> bool:
        """Look at a report, whatever its epoch and however late; say whether it counts.

        Args:
            report: What has come.
            new: Whether it's newer than all that counted.
            now: [s].
        """

    def take(self, report: R_contra, *, now: float) -> None:
        """Learn from a report that counts."""

    def restart(self, *, now: float) -> str:
        """Begin a new epoch where the real robot stands, see `OperatorSite.begin`; why that can't be."""

    def give_up(self) -> None:
        """Send no more of what was commanded: the real robot doesn't follow."""

    def next_deadline(self) -> float:
        """When there's something to do."""


V_co = TypeVar("V_co", bound=VirtualRobot[Any, Any], covariant=True)


class OperatorSite(Generic[V_co]):
    """What runs beside the operator, all but the page. Times are his session's [s]."""

    def __init__(self, robot: V_co, *, halted: Halt | None = None) -> None:
        """Start with both robots at rest.

        Args:
            robot: The virtual one, which no other site has.
            halted: Why the real one can't be commanded yet, where it's yet to be met; its report says where it is.
        """
        self.robot = robot
        """The virtual robot."""
        self.listener: SiteObserver[Any, Any] | None = None
        """Who is told of all that happens here."""
        self.epoch = Epoch(1)
        self.halted = halted
        """Why the real robot doesn't follow; None while it does."""
        self.gone = ""
        """Why there's no robot any more, whatever anybody does; empty while there may be one."""
        self.round_trip: float | None = None
        """How long the newest message that was answered, and the answer, were under way [s]."""
        self.round_trips = SlidingQuantiles(1000, 120.0)
        """Between the sites, of the newest messages [s]."""
        self.heard = -math.inf
        """When the newest report came that counts [s]."""
        self._measured_since = -math.inf
        self._packets = 0
        self._report: Any = None
        robot.site = self

    @property
    def cause(self) -> HaltCause | None:
        """Why the real robot doesn't follow, in a word; None while it does."""
        return None if self.halted is None else self.halted.cause

    @property
    def report(self: OperatorSite[VirtualRobot[Any, R]]) -> R | None:
        """The newest that counts."""
        report: R | None = self._report
        return report

    def inform(self, tell: Callable[[SiteObserver[Any, Any]], None]) -> None:
        """Tell who listens, if anybody does; one that fails hears no more, and what it was told of stands."""
        listener = self.listener
        if listener is None:
            return
        try:
            tell(listener)
        except Exception as error:  # noqa: BLE001 - whatever it is, the robot goes on
            self.listener = None
            listener.failed(error)

    def advance(self: OperatorSite[VirtualRobot[O, Any]], *, now: float) -> tuple[O, ...]:
        """Do what is due by now, and say what is to be sent."""
        orders = self.robot.orders(self._packets + 1, now=now)
        if orders is None:
            return ()
        self._packets += 1
        return (orders,)

    def next_deadline(self) -> float:
        """When there's something to do."""
        return self.robot.next_deadline()

    def receive(self: OperatorSite[VirtualRobot[Any, R]], report: R, *, now: float) -> None:
        """Take in a report of the robot; where it was measured counts whatever the epoch, and however late."""
        new = self._report is None or report.number > self._report.number
        if not self.robot.hear(report, new=new, now=now):
            return
        self._report, self.heard = report, now
        self.inform(lambda listener: listener.reported(report, now=now))
        self._measure(report, now)
        self.robot.take(report, now=now)

    def _measure(self, report: SiteReport, now: float) -> None:
        """Learn from a report how long messages are under way."""
        if report.echo is None or report.epoch != self.epoch:
            return
        _, sent, arrived = report.echo
        round_trip = now - sent - (report.sent_at - arrived)
        if abs(round_trip) > LARGEST:
            # No clock that we sent says so.
            return
        self.round_trip = round_trip
        if sent >= self._measured_since:
            self.round_trips.add(round_trip, now=now)

    def measure_anew(self, *, now: float) -> None:
        """Forget the round trips of messages that were sent before now: the way is another one."""
        self.round_trips.clear()
        self._measured_since = now

    def halt(self, why: Halt) -> None:
        """Command the real robot no more until somebody resumes; where it has halted already, nothing changes."""
        if self.halted is None:
            self.halted = why
            self.robot.give_up()

    def resume(self, *, now: float) -> str:
        """Begin a new epoch after a halt.

        Returns:
            Why it can't be yet; empty if it's done.
        """
        return self.gone or self.robot.restart(now=now)

    def begin(self) -> None:
        """Count the next epoch: what the virtual robot says from now on is of that one, and is followed."""
        self.epoch = Epoch(self.epoch + 1)
        self.halted = None
