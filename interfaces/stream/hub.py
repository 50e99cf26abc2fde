"""Where all clients of one robot meet: who may command, what is shown to whom, and the sessions."""

from __future__ import annotations

import base64
import math
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

from interfaces.messages import Order
from interfaces.ports import earliest
from interfaces.site import Site
from interfaces.stream import control
from interfaces.stream.access import Access
from interfaces.stream.codec import Encoding, SharedEncoder
from interfaces.stream.control import PROTOCOL, Problem, ProblemCode, Role
from interfaces.stream.limits import Limits
from interfaces.stream.session import POLICY, RESTART, TRY_AGAIN, Seat, Session, Wish
from robots.onboard.lease import Ended, Grant, Lease, LeaseEnd, LeaseRefusal, LeaseState
from vrs.errors import InvalidValueError

SWEEP = 0.02
"""Longest time between two looks at what the sessions have to send [s]."""
KEY_BYTES = 16
"""Random bytes of a session's name."""
_SERVED = frozenset({Role.VIEWER, Role.OPERATOR, Role.ADMIN})


class Robot(Protocol):
    """What the lease does to the robot."""

    def began(self, grant: Grant, *, now: float) -> None:
        """A lease has begun: its epoch's commands count from now on."""

    def ended(self, ended: Ended, *, now: float) -> None:
        """A lease has ended: stop the robot, and say `Hub.stopped` when it's at rest."""

    def resume(self, epoch: int, *, now: float) -> str:
        """Let a robot go on that stopped by itself; why it can't, empty if it does."""


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
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if not 0.1 <= self.state_rate <= 1000:
            raise InvalidValueError("state_rate", self.state_rate, "0.1 to 1000 times a second")


_REASONS = {
    LeaseRefusal.INVALID: "a holder's name has 1 to 100 characters",
    LeaseRefusal.HELD: "somebody has the lease",
    LeaseRefusal.ENDING: "the robot isn't at rest yet: ask again",
    LeaseRefusal.NOT_ADMIN: "only an admin may take over",
    LeaseRefusal.STALE_EPOCH: "this isn't the epoch of the lease in force",
    LeaseRefusal.EXHAUSTED: "there are no epochs left",
}


class Hub:
    """All sessions at one site. It's given the time, and whatever comes; shells do the sockets.

    Frames are made once for all; what changes the timeline reaches every follower at the next `advance`.
    """

    def __init__(
        self,
        site: Site,
        lease: Lease,
        access: Access,
        robot: Robot,
        *,
        config: HubConfig | None = None,
        random_bytes: Callable[[int], bytes] = secrets.token_bytes,
    ) -> None:
        """Serve nobody yet.

        Args:
            site: The virtual robot's.
            lease: The robot's; nobody else calls it.
            access: Who gets which role.
            robot: What the lease does to the robot.
            config: How to serve.
            random_bytes: So many bytes that nobody can guess, to name sessions.
        """
        self.config = HubConfig() if config is None else config
        self.limits = self.config.limits
        self.encoder = SharedEncoder(256)
        """What all clients get is written once."""
        self.site, self.access = site, access
        self._lease, self._robot, self._random = lease, robot, random_bytes
        if not site.broadcasters:
            for rate in self.config.rates:
                site.broadcast(rate)
        self.state: control.State | None = None
        """The real robot, as clients are told."""
        self._newest: control.State | None = None
        self._state_due = -math.inf
        self.lease_version = 0
        """Counts the changes of the lease."""
        self._ended: LeaseEnd | None = None
        self._holder: Seat | None = None
        self._taker: Seat | None = None
        self._sessions: dict[Session, None] = {}
        self._seats: dict[str, Seat] = {}
        self._edit = site.journal.look()
        self._sweep = -math.inf
        self._now = self._t = -math.inf

    @property
    def sessions(self) -> tuple[Session, ...]:
        """Those with a connection."""
        return tuple(self._sessions)

    @property
    def seats(self) -> int:
        """Sessions that were greeted, with those whose connection was lost."""
        return len(self._seats)

    @property
    def lease_state(self) -> LeaseState:
        """Where the lease is."""
        return self._lease.state

    def open(self, encoding: Encoding, *, now: float) -> Session:
        """Take a connection; with too many, one that's closed at once.

        Args:
            encoding: How its messages are written.
            now: Session time [s].
        """
        session = Session(self, encoding, now=now)
        if len(self._sessions) >= self.limits.clients:
            session.close(TRY_AGAIN, ProblemCode.FULL, f"there are {self.limits.clients} clients already")
        else:
            self._sessions[session] = None
        return session

    def leave(self, session: Session, *, done: bool, now: float) -> None:
        """Note that a connection is gone.

        Args:
            session: Whose.
            done: Whether the client said that it's done; an operator that didn't may continue its session.
            now: Session time [s].
        """
        self._sessions.pop(session, None)
        seat = session.seat
        if seat is None or seat.session is not session:
            return
        seat.session, seat.left = None, now
        if done or seat.role is Role.VIEWER:
            self._forget(seat)
        self._tidy(now)

    def _tidy(self, now: float) -> None:
        """Forget sessions that were left long ago, or too many; not that of the lease's holder."""
        absent = [seat for seat in self._seats.values() if seat.session is None and seat is not self._holder]
        absent.sort(key=lambda seat: seat.left)
        surplus = len(absent) - self.limits.absent
        for place, seat in enumerate(absent):
            if place < surplus or now >= seat.left + self.limits.absence:
                self._forget(seat)

    def _forget(self, seat: Seat) -> None:
        seat.servlet.close()
        self._seats.pop(seat.key, None)

    def show(self, state: control.State) -> None:
        """Take the newest that is known of the real robot."""
        self._newest = state

    def stopped(self, *, now: float) -> None:
        """Say that the robot is at rest after a lease ended, and takes no command."""
        was = self._lease.state
        grant = self._lease.stopped(now=now)
        if self._lease.state is was:
            return
        taker, self._taker = self._taker, None
        self.lease_version += 1
        if isinstance(grant, Grant):
            self._holder = taker
            self._robot.began(grant, now=now)

    def close(self, text: str = "the server stops") -> tuple[Session, ...]:
        """End every session; those that have a last word to send."""
        for session in self._sessions:
            session.close(RESTART, ProblemCode.STOPPING, text)
        return self.sessions

    def advance(self, *, now: float) -> tuple[Session, ...]:
        """Make the frames that are due at now [s]; the sessions whose `advance` is to be called."""
        self._now, self._sweep = now, now + SWEEP
        self._t = self.site.time(now)
        self._turn(now)
        self.site.advance(now=now)
        if self._newest is not self.state and now >= self._state_due:
            self.state, self._state_due = self._newest, now + 1.0 / self.config.state_rate
        edit, before = self.site.journal.look(), self._edit
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
        return earliest(self.site.next_deadline(), self._lease.next_deadline(), sweep)

    def engine_time(self, now: float) -> float:
        """The engine's time [s] at the session time now [s]."""
        if now > self._now:
            self._now, self._t = now, self.site.time(now)
        return self._t

    def greet(self, session: Session, hello: control.Hello, now: float) -> tuple[Seat, control.Welcome] | Problem:
        """Let a client in, or say why not; see `Session`."""
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
            seat = self._seat(hello)
        elif seat.session is not None:
            seat.session.close(POLICY, ProblemCode.REFUSED, "the session is continued by another connection")
            seat.session.seat = None
        seat.session = session
        return seat, self._welcome(seat, resumed, now)

    def _seat(self, hello: control.Hello) -> Seat:
        key = base64.urlsafe_b64encode(self._random(KEY_BYTES)).rstrip(b"=").decode("ascii")
        seat = self._seats[key] = Seat(key, hello.name, hello.role)
        seat.servlet = self.site.servlet(admit=partial(self._refusal, seat))
        return seat

    def _welcome(self, seat: Seat, resumed: bool, now: float) -> control.Welcome:
        model = self.site.engine.model
        return control.Welcome(
            session=seat.key,
            role=seat.role,
            robot=model.name,
            limits=model.limits,
            poses=model.poses,
            now=now,
            lease=self.lease_for(seat),
            rates=tuple(broadcaster.rate for broadcaster in self.site.broadcasters),
            resumed=resumed,
            instance=self.config.instance,
            server=self.config.server,
            lease_timeout=self._lease.config.timeout,
        )

    def _refusal(self, seat: Seat, order: Order) -> str:
        """Why an order isn't carried out now; empty if it is."""
        if seat is not self._holder:
            return "no lease: acquire it first"
        if self._lease.heard(order.epoch, now=self._now) is not None:
            return f"no lease: epoch {order.epoch} isn't in force"
        return ""

    def wish(self, seat: Seat, wish: Wish, now: float) -> control.Lease | Problem | None:
        """Do what a client asks of the lease; the answer, None for a beat that counts."""
        number = None if isinstance(wish, control.Beat) else wish.number
        if seat.role is Role.VIEWER:
            return Problem(ProblemCode.NOT_ALLOWED, "a viewer has no lease", number)
        if isinstance(wish, control.Acquire | control.TakeOver):
            refusal = self._ask(seat, isinstance(wish, control.TakeOver), now)
        elif seat is not self._holder:
            refusal = LeaseRefusal.STALE_EPOCH
        elif isinstance(wish, control.Release):
            refusal = self._lease.release(wish.epoch, now=now)
        else:
            refusal = self._lease.heard(wish.epoch, now=now)
        self._turn(now)
        if refusal is None and isinstance(wish, control.Resume):
            text = self._robot.resume(wish.epoch, now=now)
            if text:
                return Problem(ProblemCode.LEASE, text, number)
        if refusal is not None:
            stale = refusal is LeaseRefusal.STALE_EPOCH
            code = ProblemCode.STALE_EPOCH if stale else ProblemCode.LEASE
            return Problem(code, _REASONS[refusal], number)
        return None if number is None else self.lease_for(seat, number)

    def _ask(self, seat: Seat, force: bool, now: float) -> LeaseRefusal | None:
        """Ask for the lease; who has it already keeps it."""
        self._turn(now)
        admin = seat.role is Role.ADMIN
        if force and not admin:
            return LeaseRefusal.NOT_ADMIN
        if seat is self._holder:
            return None
        lease, name = self._lease, seat.name
        answer = lease.take_over(name, admin=admin, now=now) if force else lease.acquire(name, now=now)
        if isinstance(answer, LeaseRefusal):
            return answer
        self.lease_version += 1
        if isinstance(answer, Grant):
            self._holder = seat
            self._robot.began(answer, now=now)
        else:
            self._taker = seat
        return None

    def _turn(self, now: float) -> None:
        """Stop the robot if the lease has ended."""
        ended = self._lease.advance(now=now)
        if ended is not None:
            self._holder, self._ended = None, ended.why
            self.lease_version += 1
            self._robot.ended(ended, now=now)

    def lease_for(self, seat: Seat, answers: int | None = None) -> control.Lease:
        """The lease as a client sees it: its epoch is told to its holder only."""
        lease, yours = self._lease, seat is self._holder
        epoch = lease.epoch if yours else None
        return control.Lease(lease.state, epoch, lease.holder, yours, answers, self._ended)
