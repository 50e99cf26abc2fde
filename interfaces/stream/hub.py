"""Where all clients of one robot meet: who may command, what is shown to whom, and each client's connection.

Both are one concept: a connection asks the hub about all that it may do, and is told by it all there is.
"""

from __future__ import annotations

import base64
import logging
import math
import secrets
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

import msgspec

from interfaces.engine_server.site import Site, earliest
from interfaces.messages import Ask, Broadcast, Follow, Order, Pulse, Refusal, Want, control
from interfaces.messages.control import (
    PROTOCOL,
    Corrected,
    Impair,
    Network,
    PathCorrection,
    Ping,
    Pong,
    Postures,
    Present,
    Problem,
    ProblemCode,
    ProtocolError,
    Role,
    Survey,
    Who,
    covers,
    may_send,
)
from interfaces.messages.jobs import RobotTask, TaskOrder, Tasks
from interfaces.stream.access import ENDED, Access, Admission
from interfaces.stream.audit import AuditLog
from interfaces.stream.codec import Encoding, News, SharedEncoder, Value, Welcomed, decode, sent_by
from interfaces.stream.invitations import Membership, is_code
from interfaces.stream.leasing import Classroom, LeasedRobot, Leasing, SessionState, Wish
from interfaces.stream.limits import Allowance, Allowances, Bucket, ClientLimits, Outbox
from robots.onboard.lease import Lease, LeaseState
from vrs.errors import InvalidValueError, VrsError
from vrs.model import Array

POLICY, TOO_LARGE, FAILED, RESTART, TRY_AGAIN = 1008, 1009, 1011, 1012, 1013
"""Close codes of WebSocket (RFC 6455, and IANA's registry)."""

SWEEP = 0.02
"""Longest time between two looks at what the sessions have to send [s]."""
MOST_HANDED_ON = 256
"""Corrections that are with the client whose program they're for, at most."""
PEOPLE = 1.0
"""So often it's looked whether somebody's token has ended [s]."""
PRESENCE = 0.2
"""At most so often are clients told who is here [s]."""
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
_FORGIVEN = 1.0
"""Bad messages of a client that are forgiven a second."""
HELD_UP = 0.25
"""A client is told that its messages wait so long or longer [s]."""
_MUTE = 1.0
"""Time between two complaints that a client sends too fast [s]."""
_SERVED = frozenset({Role.VIEWER, Role.OPERATOR, Role.ADMIN})
_SENT = sent_by(Role.ADMIN)
"""What some client may send."""

_NO_TIMELINE = "a mobile robot's postures are told to every client: there's nothing to follow, ask or want"

_LOG = logging.getLogger(__name__)

State: TypeAlias = control.State | Postures
"""What is known of the real robot: of an arm, of a mobile robot."""


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


class PathAlterer(Protocol):
    """What lets clients correct the path of a program that asks for that."""

    def correct(self, channel: int, offset: Array, at: float, *, now: float) -> str:
        """Correct it.

        Args:
            channel: Of the program's.
            offset: As in `PathCorrection`.
            at: For when it's meant [s].
            now: Session time [s].

        Returns:
            What keeps the arm from following in time; empty where nothing does.

        Raises:
            VrsError: If no program alters its path on that channel, or it can't be.
        """


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
    in_order: bool = False
    """Whether operators get control in the order in which they connect: they queue for it from then on."""
    relays: str = ""
    """Where the robot is served that this hub only relays: whoever comes here watches. Empty: it's served here."""

    def __post_init__(self) -> None:
        if not 0.1 <= self.state_rate <= 1000:
            raise InvalidValueError("state_rate", self.state_rate, "0.1 to 1000 times a second")


class HubSession:
    """One connection. Whatever comes in, others aren't affected; what goes out is bounded."""

    def __init__(self, hub: Hub, encoding: Encoding, spending: tuple[Allowance, Allowance], *, now: float) -> None:
        """Wait for `Hello`.

        Args:
            hub: Which it's a connection of.
            encoding: How its messages are written.
            spending: What it may cost while it doesn't command, and while it does.
            now: Session time [s].
        """
        self._spending, self._spent = spending, 0
        self._wanted: set[Want] = set()
        """What was asked for and is on its way."""
        self.hub, self._limits = hub, hub.limits
        self.encoding = encoding
        self.seat: SessionState | None = None
        self.closing: tuple[int, str] | None = None
        """Close code and reason with which the connection is to be closed, when what waits is sent."""
        self.outbox = Outbox(hub.encoder.encode, encoding, self._limits.waiting)
        """What waits for the client."""
        self._allowed = Bucket(self._limits.rate, self._limits.burst, now)
        self._excess = Bucket(self._limits.excess / 10, self._limits.excess, now)
        self._bad = Bucket(_FORGIVEN, self._limits.bad, now)
        self._hello_until = now + self._limits.hello
        self._quiet_until = now
        self._lease = -1
        """Version of the lease that the client knows."""
        self._network: int | None = None
        """The same of the way to the robot; None while it hasn't asked."""
        self._present: int | None = None
        """The same of who is here."""
        self._news = 0
        """The same of what all are told."""

    def receive(self, data: bytes | str, *, now: float) -> None:
        """Take a frame of the client; bytes for msgpack, text for JSON.

        Args:
            data: What has come.
            now: Session time [s].
        """
        try:
            self._hear(data, now)
        except Exception as error:  # noqa: BLE001 - whatever it is, it ends no more than this connection
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        """Something raised that nobody expects: this connection ends, and no other."""
        _LOG.exception("a client's connection is closed")
        self._wanted.clear()
        self.close(FAILED, ProblemCode.FAILED, f"the server failed at this: {type(error).__name__}")

    @property
    def role(self) -> Role:
        """Of a client that hasn't said hello yet, the least."""
        return Role.VIEWER if self.seat is None else self.seat.role

    @property
    def commands(self) -> bool:
        """Whether it has control, or shares it."""
        return self.seat is not None and self.hub.leasing.commanding(self.seat)

    def spend(self, work: float, *, now: float) -> None:
        """Note what the messages of the client have cost.

        Args:
            work: Processor time since the last call [s]; the bytes that it's answered are known here.
            now: Session time [s].
        """
        total = self.outbox.total
        self._spending[self.commands].spend(work, total - self._spent, now=now)
        self._spent = total

    def wait(self, *, now: float) -> float:
        """How long nothing more of the client is to be looked at [s]; 0 for at once."""
        return 0.0 if self.closing is not None else self._spending[self.commands].wait(now=now)

    def say_waiting(self, wait: float, *, now: float) -> bool:
        """Tell a client, once in a while, that its messages wait because of what it has spent.

        Args:
            wait: For how long [s]; a moment isn't worth a word.
            now: Session time [s].

        Returns:
            Whether there's something to send.
        """
        if wait < HELD_UP or now < self._quiet_until or self.closing is not None:
            return False
        self._quiet_until = now + _MUTE
        text = "more is asked than this client, or its address, may spend of the server: its messages wait"
        return self.outbox.put(Problem(ProblemCode.TOO_FAST, text))

    def _hear(self, data: bytes | str, now: float) -> None:
        if self.closing is not None:
            return
        if not self._allowed.take(now):
            self._slow_down(now)
            return
        if len(data) > self._limits.size:
            self.close(TOO_LARGE, ProblemCode.TOO_LARGE, f"at most {self._limits.size} bytes a message")
            return
        try:
            if isinstance(data, str) is not (self.encoding is Encoding.JSON):
                raise ProtocolError(ProblemCode.MALFORMED, "JSON comes as text, msgpack as bytes")
            raw = data.encode("utf-8", "surrogatepass") if isinstance(data, str) else data
            # Who may send what of it in which role is for those to say who answer.
            allowed = control.Hello if self.seat is None else _SENT
            message = decode(raw, self.encoding, allowed=allowed, largest=self._limits.size)
        except ProtocolError as error:
            self._complain(Problem(error.code, error.text), now)
            return
        if self.seat is None:
            self._greet(message, now)
        else:
            self._take(self.seat, message, now)

    def _take(self, seat: SessionState, message: Value, now: float) -> None:
        if isinstance(message, Ping):
            self.outbox.put(Pong(message.number, message.t, now, now))
        elif isinstance(message, Order | Ask | Follow | Want):
            self._serve(seat, message, now)
        elif isinstance(message, Wish):
            answer = self.hub.leasing.wish(seat, message, now)
            if isinstance(answer, control.Lease):
                self._lease = self.hub.leasing.version
            if answer is not None:
                self._answer(seat, message, answer)
        elif isinstance(message, Who):
            self._say_who(message, now)
        elif isinstance(message, Survey | Impair):
            self._survey(seat, message, now)
        elif isinstance(message, TaskOrder):
            self._answer(seat, message, self.hub.task(seat, message, now))
        elif isinstance(message, PathCorrection):
            if (corrected := self.hub.correct(seat, message, now)) is not None:
                self._answer(seat, message, corrected)
        elif isinstance(message, Corrected | Problem):
            self.hub.corrected(seat, message)

    def _answer(self, seat: SessionState, asked: Value, answer: Value) -> None:
        """Answer what a client asks; what is refused is noted, but for a beat: one may come after the end."""
        if isinstance(answer, Problem) and not isinstance(asked, control.Beat):
            self.hub.note_refused(seat, str(asked.__struct_config__.tag), answer.text)
        self.outbox.put(answer)

    def _say_who(self, message: Who, now: float) -> None:
        """Tell who is here, and from now on when that changes."""
        hub = self.hub
        if hub.leasing.classroom is None:
            text = "there's no class here: nobody asks who it is"
            self.outbox.put(Problem(ProblemCode.NOT_ALLOWED, text, message.number))
            return
        hub.note_present(now)
        self._present = hub.present_version
        self.outbox.put(msgspec.structs.replace(hub.present, answers=message.number))

    def _survey(self, seat: SessionState, message: Survey | Impair, now: float) -> None:
        """Tell how the way to the robot is, after it was changed where that was asked for."""
        problem = self.hub.impair(seat, message, now) if isinstance(message, Impair) else None
        found = None if problem is not None else self.hub.network(now, message.number)
        if found is not None:
            self._network = self.hub.network_version
            self.outbox.put(found)
        else:
            text = "no way to a robot is emulated here"
            self._answer(seat, message, problem or Problem(ProblemCode.NOT_ALLOWED, text, message.number))

    def _greet(self, hello: control.Hello, now: float) -> None:
        found = self.hub.greet(self, hello, now)
        if isinstance(found, Problem):
            self.hub.note_stranger(self, hello, found.text)
            later = found.code in {ProblemCode.FULL, ProblemCode.TOO_FAST}
            self.close(TRY_AGAIN if later else POLICY, found.code, found.text)
            return
        self.seat, welcome = found
        self._lease = self.hub.leasing.version
        self.outbox.put(welcome)

    def _serve(self, seat: SessionState, message: Order | Ask | Follow | Want, now: float) -> None:
        if not isinstance(message, Order):
            if seat.servlet.timeline is None:
                self.outbox.put(Problem(ProblemCode.NOT_ALLOWED, _NO_TIMELINE, getattr(message, "number", None)))
                return
            if self.outbox.is_full:
                return
            if isinstance(message, Want):
                if message in self._wanted:
                    return
                self._wanted.add(message)
        elif not may_send(seat.role, message.sender):
            text = "a viewer commands nothing"
            self.hub.note_refused(seat, "order", text)
            self._complain(Problem(ProblemCode.NOT_ALLOWED, text, message.number), now)
            return
        seat.servlet.receive(message, now=self.hub.engine_time(now))
        self.look(now=now)

    def look(self, *, now: float) -> None:
        """Put what the servlet has into the outbox; of frames and pulses only the newest waits."""
        seat = self.seat
        if seat is None or self.closing is not None:
            return
        try:
            for reply in seat.servlet.advance(now=self.hub.engine_time(now)):
                if isinstance(reply, Broadcast | Pulse):
                    self.outbox.put_newest(reply)
                else:
                    self.outbox.put(reply)
        except Exception as error:  # noqa: BLE001 - whatever it is, it ends no more than this connection
            self._fail(error)

    def is_due(self, now: float) -> bool:
        """Whether `advance` has something to send, or the connection is to be closed, at now [s]."""
        if self.outbox or self.closing is not None:
            return True
        if self.seat is None:
            return now >= self._hello_until
        hub = self.hub
        if hub.leasing.version != self._lease or hub.news_version != self._news:
            return True
        if self._network is not None and hub.network_version != self._network:
            return True
        if self._present is not None and hub.present_version != self._present:
            return True
        t = self.seat.servlet.next_deadline()
        return t is not None and t <= hub.engine_time(now)

    def advance(self, *, now: float) -> tuple[bytes, ...]:
        """What is to be sent next, some 16 KiB at once; a transport that can't send doesn't call.

        Args:
            now: Session time [s].
        """
        if self.closing is None:
            if self.seat is not None:
                try:
                    self._look_around(self.seat, now)
                except Exception as error:  # noqa: BLE001 - whatever it is, it ends no more than this connection
                    self._fail(error)
            elif now >= self._hello_until:
                self.close(POLICY, ProblemCode.HELLO_LATE, f"hello must come within {self._limits.hello:g} s")
        found = self.outbox.take()
        if not self.outbox:
            self._wanted.clear()
        return found

    def _look_around(self, seat: SessionState, now: float) -> None:
        hub = self.hub
        if hub.leasing.version != self._lease:
            self._lease = hub.leasing.version
            self.outbox.put_newest(hub.leasing.seen_by(seat))
        if self._network is not None and hub.network_version != self._network:
            self._network = hub.network_version
            found = hub.network(now)
            if found is not None:
                self.outbox.put_newest(found)
        if self._present is not None and hub.present_version != self._present:
            self._present = hub.present_version
            self.outbox.put_newest(hub.present)
        if hub.news_version != self._news:
            for version, news in hub.news.values():
                if version > self._news:
                    self.outbox.put_newest(news)
            self._news = hub.news_version
        self.look(now=now)

    def close(self, code: int, problem: ProblemCode, text: str) -> None:
        """Close the connection, with a last word.

        Args:
            code: Close code of WebSocket.
            problem: Why.
            text: Why, for people.
        """
        if self.closing is None:
            self.closing = code, text
            self.outbox.put(Problem(problem, text, fatal=True))

    def _complain(self, problem: Problem, now: float) -> None:
        if self.seat is None:
            late = problem.code is ProblemCode.NOT_ALLOWED
            code = ProblemCode.HELLO_EXPECTED if late else problem.code
            self.close(POLICY, code, f"the first message must be hello: {problem.text}")
        elif self._bad.take(now):
            self.outbox.put(problem)
        else:
            self.close(POLICY, problem.code, f"too many messages that can't be taken, the last one: {problem.text}")

    def _slow_down(self, now: float) -> None:
        text = f"at most {self._limits.rate:g} messages a second"
        if not self._excess.take(now):
            self.close(POLICY, ProblemCode.TOO_FAST, text)
        elif now >= self._quiet_until:
            self._quiet_until = now + _MUTE
            self.outbox.put(Problem(ProblemCode.TOO_FAST, text))


class Hub:
    """All sessions at one site. It's given the time, and whatever comes; shells do the sockets.

    Frames are made once for all; what changes the timeline reaches every follower at the next `advance`.
    """

    def __init__(
        self,
        site: Site,
        lease: Lease,
        access: Access,
        robot: LeasedRobot,
        *,
        config: HubConfig | None = None,
        emulation: Emulation | None = None,
        workers: Workers | None = None,
        audit: AuditLog | None = None,
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
            audit: Where who has control is written, and what is refused; nowhere unless given.
            random_bytes: So many bytes that nobody can guess, to name sessions.
        """
        self.config = HubConfig() if config is None else config
        self.limits = self.config.limits
        self.encoder = SharedEncoder(256)
        """What all clients get is written once."""
        self.site, self.access = site, access
        in_order = self.config.in_order
        classroom = Classroom() if in_order or access.invitations is not None else None
        self.audit = audit
        """Where who has control is written, and what is refused."""
        self.leasing = Leasing(lease, robot, self.limits.sharers, classroom, in_order=in_order, note=self._note)
        """Who may command."""
        self.present = Present()
        """Who is here of a class, as its clients are told."""
        self.present_version = 0
        """Counts its changes."""
        self._present_of, self._present_due = (0, 0), -math.inf
        self._random = random_bytes
        if not site.broadcasters:
            for rate in self.config.rates:
                site.broadcast(rate)
        self._workers = workers
        self.alterer: PathAlterer | None = None
        """What a client's corrections of the path go to; None where no programs run."""
        self._handed_on: OrderedDict[int, tuple[SessionState, SessionState, int]] = OrderedDict()
        """Corrections that a client with programs is to answer, by their numbers: it, whose and which they are."""
        self._numbered = 0
        self.news: dict[type, tuple[int, News]] = {}
        """What every client is told when it changes, by its kind, with its version."""
        self.news_version = 0
        """Counts its changes."""
        self._shown: State | None = None
        """Of the real robot, what clients are told next."""
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
        self._served: dict[SessionState, HubSession] = {}
        """The sessions that have a connection, with it."""
        self._edit = site.look()
        self._sweep = self._people_due = -math.inf
        self._now = self._t = -math.inf

    def _note(self, event: str, seat: SessionState | None, **facts: str) -> None:
        if self.audit is not None:
            self.audit.note(event, robot=self.site.robot, **self._who(seat), **facts)

    def note_stranger(self, session: HubSession, hello: control.Hello, why: str) -> None:
        """Note that a client wasn't let in."""
        if self.audit is not None:
            address = self._opened.get(session, "")
            self.audit.refused(
                robot=self.site.robot, what="hello", why=why, who=hello.name, role=hello.role.value, address=address
            )

    def note_refused(self, seat: SessionState, what: str, why: str) -> None:
        """Note that a session was refused something."""
        if self.audit is not None:
            self.audit.refused(robot=self.site.robot, what=what, why=why, **self._who(seat))

    def _who(self, seat: SessionState | None) -> dict[str, str]:
        if seat is None:
            return {}
        session = self._served.get(seat)
        address = "" if session is None else self._opened.get(session, "")
        person = {"person": seat.person} if seat.person else {}
        return {"who": seat.name, **person, "role": seat.role.value, "address": address}

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
        return self.leasing.lease.state

    def commands(self, key: str, epoch: int, *, now: float) -> bool:
        """Whether a session has the lease, in that epoch, at now [s].

        Args:
            key: The session's name, which nobody else knows.
            epoch: Of the lease.
            now: Session time [s].
        """
        seat = self._seats.get(key)
        return seat is not None and seat.role is not Role.VIEWER and self.leasing.admits(seat, epoch, now)

    def let_acquire(self, key: str, *, now: float) -> None:
        """Ask for the lease in the place of a session that has a connection."""
        seat = self._seats.get(key)
        if seat is not None and seat in self._served:
            self.leasing.wish(seat, control.Acquire(1), now)

    def stopped(self, *, now: float) -> None:
        """Say that the robot is at rest after a lease ended, and takes no command."""
        self.leasing.stopped(now=now)

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
        if seat is None:
            return
        del self._served[seat]
        seat.left = now
        self.leasing.note(seat, here=False)
        # In a class, who loads the page again keeps its place in the queue.
        if (done and not seat.member) or seat.role is Role.VIEWER:
            self._forget(seat)
        self._tidy(now)

    def _tidy(self, now: float) -> None:
        """Forget sessions that were left long ago, or too many; not that of the lease's holder."""
        absent = [
            seat for seat in self._seats.values() if seat not in self._served and seat is not self.leasing.holder
        ]
        absent.sort(key=lambda seat: seat.left)
        surplus = len(absent) - self.limits.absent
        for place, seat in enumerate(absent):
            if place < surplus or now >= seat.left + self.limits.absence:
                self._forget(seat)

    def _forget(self, seat: SessionState) -> None:
        seat.servlet.close()
        self._seats.pop(seat.key, None)
        self.leasing.forget(seat)

    def show(self, state: State) -> None:
        """Tell every client the newest that is known of the real robot, no oftener than they are to be told."""
        self._shown = state

    def tell(self, news: News) -> None:
        """Let every client know what there is now, in place of what was told of that kind before."""
        self.news_version += 1
        self.news[type(news)] = self.news_version, news

    def close(self, text: str = "the server stops") -> tuple[HubSession, ...]:
        """End every session; those that have a last word to send."""
        for session in self._sessions:
            session.close(RESTART, ProblemCode.STOPPING, text)
        return self.sessions

    def advance(self, *, now: float) -> tuple[HubSession, ...]:
        """Make the frames that are due at now [s]; the sessions whose `advance` is to be called."""
        self._now, self._sweep = now, now + SWEEP
        self._t = self.site.time(now)
        if self.audit is not None:
            self.audit.advance()
        self.leasing.turn(now)
        self.site.advance(now=now)
        if self._shown is not None and now >= self._state_due:
            self.tell(self._shown)
            self._shown, self._state_due = None, now + 1.0 / self.config.state_rate
        if now >= self._people_due:
            self._people_due = now + PEOPLE
            self._end_people()
        self.note_present(now)
        edit, before = self.site.look(), self._edit
        self._edit = edit
        if edit != before:
            for session in self._sessions:
                session.look(now=now)
        if len(self._seats) > len(self._sessions):
            self._tidy(now)
        return tuple(session for session in self._sessions if session.is_due(now))

    def _end_people(self) -> None:
        """Close the connections of people whose tokens have ended."""
        for seat, session in self._served.items():
            if not seat.counts():
                self.note_refused(seat, "token", ENDED)
                session.close(POLICY, ProblemCode.REFUSED, ENDED)

    def note_present(self, now: float) -> None:
        """Note who is here of a class, where that has changed; not too often, however many ask."""
        room = self.leasing.classroom
        if room is None or now < self._present_due or self._present_of == (self.leasing.version, room.version):
            return
        self._present_of, self._present_due = (self.leasing.version, room.version), now + PRESENCE
        self.present = self.leasing.present()
        self.present_version += 1

    def next_deadline(self) -> float | None:
        """When to call `advance` next [s]; None for not before something arrives."""
        sweep = self._sweep if self._sessions else None
        return earliest(self.site.next_deadline(), self.leasing.lease.next_deadline(), sweep)

    def engine_time(self, now: float) -> float:
        """The engine's time [s] at the session time now [s]."""
        if now > self._now:
            self._now, self._t = now, self.site.time(now)
        return self._t

    def greet(
        self, session: HubSession, hello: control.Hello, now: float
    ) -> tuple[SessionState, Welcomed] | Problem:
        """Let a client in, or say why not; see `HubSession`."""
        if hello.protocol != PROTOCOL:
            return Problem(ProblemCode.VERSION, f"this server speaks version {PROTOCOL} of the protocol")
        member = self._member(hello, self._opened[session], now)
        if isinstance(member, Problem):
            return member
        role = hello.role if member is None or covers(member.role, hello.role) else member.role
        admission = Admission() if member is not None else self.access.admit(role, hello.token)
        refusal = admission.refusal
        if not refusal and role not in _SERVED:
            refusal = f"nothing is here for the role {role}"
        if self.config.relays and role is not Role.VIEWER:
            refusal = f"this is a relay for viewers: control is to be had at {self.config.relays}"
        if refusal:
            return Problem(ProblemCode.REFUSED, refusal)
        seat = self._seats.get(hello.session or "")
        resumed = seat is not None and seat.role is role
        if seat is None or not resumed:
            if full := self._full(role):
                return Problem(ProblemCode.FULL, full)
            seat = self._seat(hello.name, role)
            self._seats[seat.key] = seat
            self.leasing.enter(seat)
        elif (before := self._served.get(seat)) is not None:
            before.close(POLICY, ProblemCode.REFUSED, "the session is continued by another connection")
            before.seat = None
        if member is not None and self.access.invitations is not None:
            self.access.invitations.remember(seat.key, member)
        seat.alters, seat.person, seat.counts = hello.alters, admission.person, admission.counts
        self._served[seat] = session
        self.leasing.note(seat, here=True)
        return seat, self._welcome(seat, resumed, now)

    def _member(self, hello: control.Hello, address: str, now: float) -> Membership | Problem | None:
        """What a code gives to a client of a class, now or before; None of who shows none."""
        invitations = self.access.invitations
        if invitations is None:
            return None
        known = invitations.member(hello.session) or invitations.member(hello.token)
        if hello.token is None or not is_code(hello.token):
            return known
        if not invitations.may_try(address, now=now):
            text = "too many codes were tried: wait some seconds, and try again"
            return known or Problem(ProblemCode.TOO_FAST, text)
        text = "this code doesn't count, or not any more: take the one that's shown now"
        return invitations.redeem(hello.token, now=now) or known or Problem(ProblemCode.REFUSED, text)

    def _full(self, role: Role) -> str:
        """Why there's no place for one more; empty if there is. Who goes on with a session has its place."""
        most = self.limits.clients - (self.limits.clients // _KEPT if role is Role.VIEWER else 0)
        if len(self._served) < most:
            return ""
        return f"there are {most} clients already"

    def join(self, name: str) -> SessionState:
        """Let in a client in this process: an operator without a connection, whose lease needs no beats."""
        return self._seat(name, Role.OPERATOR, local=True)

    def _seat(self, name: str, role: Role, *, local: bool = False) -> SessionState:
        key = base64.urlsafe_b64encode(self._random(KEY_BYTES)).rstrip(b"=").decode("ascii")
        seat = SessionState(key, name, role, local=local)
        seat.servlet = self.site.servlet(admit=lambda order: self._refusal(seat, order))
        return seat

    def _refusal(self, seat: SessionState, order: Order) -> Refusal | None:
        refusal = self.leasing.refusal(seat, order, self._now)
        if refusal is not None:
            self.note_refused(seat, "order", refusal.text)
        return refusal

    def _welcome(self, seat: SessionState, resumed: bool, now: float) -> Welcomed:
        config = self.config
        return self.site.welcome(
            session=seat.key, role=seat.role, now=now, lease=self.leasing.seen_by(seat), resumed=resumed,
            instance=config.instance, server=config.server, lease_timeout=self.leasing.lease.config.timeout,
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
        if not self.leasing.admits(seat, wish.epoch, now):
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
        if not self.leasing.admits(seat, order.epoch or 0, now):
            text = "only who has control tells the robot what to do"
            return Problem(ProblemCode.STALE_EPOCH, text, order.number)
        refusal = self._workers.order(order.task, now=now)
        if refusal:
            return Problem(ProblemCode.OUT_OF_RANGE, refusal, order.number)
        return self._workers.tasks(order.number)

    def correct(self, seat: SessionState, wish: PathCorrection, now: float) -> Corrected | Problem | None:
        """Let who commands correct the path of a program that asks for that; or say why not.

        An operator corrects the path of another client's program, where that has control and said so; None: it was
        handed on, and `corrected` has the answer.
        """
        if not covers(seat.role, Role.OPERATOR):
            return Problem(ProblemCode.NOT_ALLOWED, "a viewer corrects nothing", wish.number)
        leasing = self.leasing
        if (runner := leasing.holder) is not None and runner is not seat and runner.alters:
            return self._hand_on(seat, runner, wish, now)
        if not leasing.commanding(seat) or leasing.lease.refused(wish.epoch or 0, now=now) is not None:
            text = "only who has control, or shares it, corrects the path"
            return Problem(ProblemCode.STALE_EPOCH, text, wish.number)
        if self.alterer is None:
            return Problem(ProblemCode.NOT_ALLOWED, "no program alters its path here", wish.number)
        try:
            late = self.alterer.correct(wish.channel, wish.offset, now if wish.at is None else wish.at, now=now)
        except VrsError as error:
            return Problem(ProblemCode.OUT_OF_RANGE, str(error), wish.number)
        return Corrected(wish.number, late)

    def _hand_on(
        self, seat: SessionState, runner: SessionState, wish: PathCorrection, now: float
    ) -> Problem | None:
        """Let the client whose program it is correct its path."""
        session = self._served.get(runner)
        if session is None or session.outbox.is_full:
            text = f"{runner.name}, whose program it is, can't be reached"
            return Problem(ProblemCode.OUT_OF_RANGE, text, wish.number)
        self._numbered += 1
        self._handed_on[self._numbered] = runner, seat, wish.number
        if len(self._handed_on) > MOST_HANDED_ON:
            self._handed_on.popitem(last=False)
        at = now if wish.at is None else wish.at
        session.outbox.put(PathCorrection(self._numbered, wish.channel, wish.offset, None, at))
        return None

    def corrected(self, runner: SessionState, answer: Corrected | Problem) -> None:
        """Tell who asked what came of a correction that was handed on; what answers none is passed over."""
        known = self._handed_on.get(answer.number or 0)
        if known is None or known[0] is not runner:
            return
        _, seat, number = self._handed_on.pop(answer.number or 0)
        if (session := self._served.get(seat)) is not None:
            session.outbox.put(msgspec.structs.replace(answer, number=number))
