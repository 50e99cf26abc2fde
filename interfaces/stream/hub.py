"""Where all clients of one robot meet: who may command, what is shown to whom, and the sessions."""

from __future__ import annotations

import base64
import math
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import msgspec

from interfaces.engine_server.site import Site, earliest
from interfaces.messages import control
from interfaces.messages.control import PROTOCOL, Impair, Network, Problem, ProblemCode, Role, may_send
from interfaces.messages.drive_sites import RobotTask
from interfaces.messages.mobile import TaskOrder, Tasks
from interfaces.stream.access import Access
from interfaces.stream.codec import Encoding, SharedEncoder
from interfaces.stream.leasing import LeasedRobot, Leasing
from interfaces.stream.limits import Allowances, Bucket, ClientLimits
from interfaces.stream.session import (
    POLICY,
    RESTART,
    TRY_AGAIN,
    HubSession,
    News,
    SessionState,
    State,
    Welcome,
    Wish,
)
from robots.onboard.lease import Lease, LeaseState
from vrs.errors import InvalidValueError, VrsError

if TYPE_CHECKING:
    from interfaces.stream.driving import DriveSite

SWEEP = 0.02
"""Longest time between two looks at what the sessions have to send [s]."""
SURVEYED = 0.1
"""How old what is told of the way to the robot may be [s]."""
CHANGES = 5.0
"""The way to the robot may change so many times a second, for long; twice as often for a moment."""
KEY_BYTES = 16
"""Random bytes of a session's name."""
_OPEN = 4
"""So many times as many connections may be open as there may be clients: some haven't said who they are."""
_KEPT = 16
"""One in so many places of clients is kept for those that may command."""
_SERVED = frozenset({Role.VIEWER, Role.OPERATOR, Role.ADMIN})


class ConditionError(VrsError):
    """A condition of the way to the robot that isn't one of those that are allowed."""

    def __init__(self, field: str, reason: VrsError) -> None:
        self.field = field
        super().__init__(str(reason))


class Emulation(Protocol):
    """The emulated way to the robot."""

    def network(self, *, now: float) -> Network:
        """How it is."""

    def impair(self, wish: Impair, who: str, *, now: float) -> None:
        """Change it.

        Raises:
            ConditionError: If a condition isn't one of those that are allowed; nothing has changed then.
        """


class Workers(Protocol):
    """What lets a robot do something by itself."""

    def order(self, task: RobotTask, *, now: float) -> str:
        """Let it; why it doesn't, empty if it does."""

    def tasks(self, answers: int | None = None) -> Tasks:
        """How it is."""


@dataclass(frozen=True, slots=True)
class HubConfig:
    """How a hub serves."""

    rates: tuple[float, ...] = (60.0, 30.0, 10.0)
    """Rates of the broadcasters [1/s]; a site that has broadcasters keeps its own."""
    state_rate: float = 20.0
    """At most so often are clients told where the real robot is [1/s], 0.1 to 1000."""
    server: str = "vrs"
    """Name and version of the program."""
    instance: str = ""
    """Names this run of it; with another one there's another timeline."""
    limits: ClientLimits = field(default_factory=ClientLimits)

    def __post_init__(self) -> None:
        if not 0.1 <= self.state_rate <= 1000:
            raise InvalidValueError("state_rate", self.state_rate, "0.1 to 1000 times a second")


class Hub:
    """All sessions at one site. It's given the time, and whatever comes; shells do the sockets.

    Frames are made once for all; what changes the timeline reaches every follower at the next `advance`.
    """

    def __init__(
        self,
        site: Site | DriveSite,
        lease: Lease,
        access: Access,
        robot: LeasedRobot,
        *,
        config: HubConfig | None = None,
        emulation: Emulation | None = None,
        workers: Workers | None = None,
        random_bytes: Callable[[int], bytes] = secrets.token_bytes,
    ) -> None:
        """Serve nobody yet.

        Args:
            site: The virtual robot's.
            lease: The robot's; nobody else calls it.
            access: Who gets which role.
            robot: What the lease does to the robot.
            config: How to serve.
            emulation: The way to the robot, where one is emulated.
            workers: What lets the robot do something by itself, where it can.
            random_bytes: So many bytes that nobody can guess, to name sessions.
        """
        self.config = HubConfig() if config is None else config
        self.limits = self.config.limits
        self.encoder = SharedEncoder(256)
        """What all clients get is written once."""
        self.site, self.access = site, access
        self._leasing = Leasing(lease, robot, self.limits.sharers)
        self._random = random_bytes
        if not site.broadcasters:
            for rate in self.config.rates:
                site.broadcast(rate)
        self.state: State | None = None
        """The real robot, as clients are told."""
        self._newest: State | None = None
        self._workers = workers
        self.news: dict[type, News] = {}
        """What every client is told when it changes, by its kind."""
        self._state_due = -math.inf
        self.network_version = 0
        """Counts the changes of the way to the robot."""
        self.emulation = emulation
        self._changes = Bucket(CHANGES, 2 * CHANGES, 0.0)
        self._sessions: dict[HubSession, None] = {}
        self._opened: dict[HubSession, str] = {}
        self._allowances = Allowances(self.limits, 0.0)
        self._surveyed: tuple[float, int, Network | None] = (-math.inf, 0, None)
        self._seats: dict[str, SessionState] = {}
        self._edit = site.look()
        self._sweep = -math.inf
        self._now = self._t = -math.inf

    @property
    def sessions(self) -> tuple[HubSession, ...]:
        """Those with a connection."""
        return tuple(self._sessions)

    @property
    def seats(self) -> int:
        """Sessions that were greeted, with those whose connection was lost."""
        return len(self._seats)

    @property
    def lease_state(self) -> LeaseState:
        """Where the lease is."""
        return self._leasing.state

    @property
    def lease_version(self) -> int:
        """Counts the changes of the lease."""
        return self._leasing.version

    def lease_for(self, seat: SessionState, answers: int | None = None) -> control.Lease:
        """The lease as a client sees it, perhaps as an answer to its request of that number."""
        return self._leasing.seen_by(seat, answers)

    def wish(self, seat: SessionState, wish: Wish, now: float) -> control.Lease | Problem | None:
        """Do what a client asks of the lease; the answer, None for a beat that counts."""
        return self._leasing.wish(seat, wish, now)

    def commands(self, key: str, epoch: int, *, now: float) -> bool:
        """Whether a session has the lease, in that epoch, at now [s].

        Args:
            key: The session's name, which nobody else knows.
            epoch: Of the lease.
            now: Session time [s].
        """
        seat = self._seats.get(key)
        return seat is not None and seat.role is not Role.VIEWER and self._leasing.admits(seat, epoch, now)

    def commanding(self, seat: SessionState) -> bool:
        """Whether a session has the lease, or shares it."""
        return self._leasing.commanding(seat)

    def let_acquire(self, key: str, *, now: float) -> None:
        """Ask for the lease in the place of a session that has a connection."""
        seat = self._seats.get(key)
        if seat is not None and seat.session is not None:
            self.wish(seat, control.Acquire(1), now)

    def stopped(self, *, now: float) -> None:
        """Say that the robot is at rest after a lease ended, and takes no command."""
        self._leasing.stopped(now=now)

    def open(self, encoding: Encoding, *, now: float, address: str = "") -> HubSession:
        """Take a connection; with too many, one that's closed at once.

        Args:
            encoding: How its messages are written.
            now: Session time [s].
            address: Where it comes from: what clients cost is counted by address, too.
        """
        session = HubSession(self, encoding, self._allowances.join(address, now=now), now=now)
        self._opened[session] = address
        if len(self._sessions) >= _OPEN * self.limits.clients:
            session.close(TRY_AGAIN, ProblemCode.FULL, f"there are {len(self._sessions)} connections already")
        else:
            self._sessions[session] = None
        return session

    def leave(self, session: HubSession, *, done: bool, now: float) -> None:
        """Note that a connection is gone.

        Args:
            session: Whose.
            done: Whether the client said that it's done; an operator that didn't may continue its session.
            now: Session time [s].
        """
        self._sessions.pop(session, None)
        self._allowances.leave(self._opened.pop(session))
        seat = session.seat
        if seat is None or seat.session is not session:
            return
        seat.session, seat.left = None, now
        if done or seat.role is Role.VIEWER:
            self._forget(seat)
        self._tidy(now)

    def _tidy(self, now: float) -> None:
        """Forget sessions that were left long ago, or too many; not that of the lease's holder."""
        absent = [
            seat for seat in self._seats.values() if seat.session is None and seat is not self._leasing.holder
        ]
        absent.sort(key=lambda seat: seat.left)
        surplus = len(absent) - self.limits.absent
        for place, seat in enumerate(absent):
            if place < surplus or now >= seat.left + self.limits.absence:
                self._forget(seat)

    def _forget(self, seat: SessionState) -> None:
        seat.servlet.close()
        self._seats.pop(seat.key, None)
        self._leasing.forget(seat)

    def show(self, state: State) -> None:
        """Take the newest that is known of the real robot."""
        self._newest = state

    def tell(self, news: News) -> None:
        """Let every client know what there is now, in place of what was told of that kind before."""
        self.news[type(news)] = news

    def close(self, text: str = "the server stops") -> tuple[HubSession, ...]:
        """End every session; those that have a last word to send."""
        for session in self._sessions:
            session.close(RESTART, ProblemCode.STOPPING, text)
        return self.sessions

    def advance(self, *, now: float) -> tuple[HubSession, ...]:
        """Make the frames that are due at now [s]; the sessions whose `advance` is to be called."""
        self._now, self._sweep = now, now + SWEEP
        self._t = self.site.time(now)
        self._leasing.turn(now)
        self.site.advance(now=now)
        if self._newest is not self.state and now >= self._state_due:
            self.state, self._state_due = self._newest, now + 1.0 / self.config.state_rate
        edit, before = self.site.look(), self._edit
        self._edit = edit
        if edit != before:
            for session in self._sessions:
                session.look(now=now)
        if len(self._seats) > len(self._sessions):
            self._tidy(now)
        return tuple(session for session in self._sessions if session.is_due(now))

    def next_deadline(self) -> float | None:
        """When to call `advance` next [s]; None for not before something arrives."""
        sweep = self._sweep if self._sessions else None
        return earliest(self.site.next_deadline(), self._leasing.next_deadline(), sweep)

    def engine_time(self, now: float) -> float:
        """The engine's time [s] at the session time now [s]."""
        if now > self._now:
            self._now, self._t = now, self.site.time(now)
        return self._t

    def greet(
        self, session: HubSession, hello: control.Hello, now: float
    ) -> tuple[SessionState, Welcome] | Problem:
        """Let a client in, or say why not; see `HubSession`."""
        if hello.protocol != PROTOCOL:
            return Problem(ProblemCode.VERSION, f"this server speaks version {PROTOCOL} of the protocol")
        refusal = self.access.refusal(hello.role, hello.token)
        if not refusal and hello.role not in _SERVED:
            refusal = f"nothing is here for the role {hello.role}"
        if refusal:
            return Problem(ProblemCode.REFUSED, refusal)
        seat = self._seats.get(hello.session or "")
        resumed = seat is not None and seat.role is hello.role
        if seat is None or not resumed:
            if full := self._full(hello.role):
                return Problem(ProblemCode.FULL, full)
            seat = self._seat(hello)
        elif seat.session is not None:
            seat.session.close(POLICY, ProblemCode.REFUSED, "the session is continued by another connection")
            seat.session.seat = None
        welcome = self._welcome(seat, resumed, now)
        seat.session = session
        return seat, welcome

    def _full(self, role: Role) -> str:
        """Why there's no place for one more; empty if there is. Who goes on with a session has its place."""
        most = self.limits.clients - (self.limits.clients // _KEPT if role is Role.VIEWER else 0)
        if sum(seat.session is not None for seat in self._seats.values()) < most:
            return ""
        return f"there are {most} clients already"

    def join(self, name: str) -> SessionState:
        """Let in a client in this process: an operator without a connection, whose lease needs no beats."""
        return self._made(SessionState(self._key(), name, Role.OPERATOR, local=True))

    def _seat(self, hello: control.Hello) -> SessionState:
        seat = self._made(SessionState(self._key(), hello.name, hello.role))
        self._seats[seat.key] = seat
        return seat

    def _made(self, seat: SessionState) -> SessionState:
        seat.servlet = self.site.servlet(admit=lambda order: self._leasing.refusal(seat, order, self._now))
        return seat

    def _key(self) -> str:
        return base64.urlsafe_b64encode(self._random(KEY_BYTES)).rstrip(b"=").decode("ascii")

    def _welcome(self, seat: SessionState, resumed: bool, now: float) -> Welcome:
        config = self.config
        return self.site.welcome(
            session=seat.key, role=seat.role, now=now, lease=self.lease_for(seat), resumed=resumed,
            instance=config.instance, server=config.server, lease_timeout=self._leasing.timeout,
        )  # fmt: skip

    def network(self, now: float, answers: int | None = None) -> Network | None:
        """How the way to the robot is, worked out now and then for all who ask; None where none is emulated."""
        if self.emulation is None:
            return None
        at, version, found = self._surveyed
        if found is None or version != self.network_version or now >= at + SURVEYED:
            found = self.emulation.network(now=now)
            self._surveyed = now, self.network_version, found
        return found if found is None or answers is None else msgspec.structs.replace(found, answers=answers)

    def impair(self, seat: SessionState, wish: Impair, now: float) -> Problem | None:
        """Let the holder of the lease change the way to the robot; why not, None where it's done."""
        if self.emulation is None:
            return Problem(ProblemCode.NOT_ALLOWED, "no way to a robot is emulated here", wish.number)
        if not may_send(seat.role, wish.sender):
            return Problem(ProblemCode.NOT_ALLOWED, "a viewer changes nothing", wish.number)
        if not self._leasing.admits(seat, wish.epoch, now):
            text = "only who has control changes the way to the robot"
            return Problem(ProblemCode.STALE_EPOCH, text, wish.number)
        if not self._changes.take(now):
            text = f"the way to the robot changes at most {CHANGES:g} times a second"
            return Problem(ProblemCode.TOO_FAST, text, wish.number)
        try:
            self.emulation.impair(wish, seat.name, now=now)
        except ConditionError as error:
            return Problem(ProblemCode.OUT_OF_RANGE, str(error), wish.number, field=error.field)
        except VrsError as error:
            return Problem(ProblemCode.OUT_OF_RANGE, str(error), wish.number)
        self.network_version += 1
        return None

    def task(self, seat: SessionState, order: TaskOrder, now: float) -> Tasks | Problem:
        """Let the holder of the lease have the robot do something by itself: how it is then, or why not."""
        if self._workers is None:
            return Problem(ProblemCode.NOT_ALLOWED, "this robot does nothing by itself", order.number)
        if not may_send(seat.role, order.sender):
            return Problem(ProblemCode.NOT_ALLOWED, "a viewer commands nothing", order.number)
        if not self._leasing.admits(seat, order.epoch or 0, now):
            text = "only who has control tells the robot what to do"
            return Problem(ProblemCode.STALE_EPOCH, text, order.number)
        refusal = self._workers.order(order.task, now=now)
        if refusal:
            return Problem(ProblemCode.OUT_OF_RANGE, refusal, order.number)
        return self._workers.tasks(order.number)
