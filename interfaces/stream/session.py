"""A client's connection as the server sees it: greeted, bounded, and served by its servlet."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Protocol, TypeAlias

from interfaces.messages import Ask, Broadcast, Follow, Order, Pulse, Want, control
from interfaces.messages.control import (
    Impair,
    Network,
    Ping,
    Pong,
    Problem,
    ProblemCode,
    ProtocolError,
    Role,
    Survey,
    may_send,
)
from interfaces.messages.mobile import MobileWelcome, Plan, Postures, Seen, TaskOrder, Tasks
from interfaces.stream.codec import Encoding, SharedEncoder, Value, decode, sent_by
from interfaces.stream.limits import Allowance, Bucket, ClientLimits, Outbox

if TYPE_CHECKING:
    from interfaces.engine_server.servlet import Servlet
    from interfaces.stream.driving import DriveServlet

POLICY, TOO_LARGE, FAILED, RESTART, TRY_AGAIN = 1008, 1009, 1011, 1012, 1013
"""Close codes of WebSocket (RFC 6455, and IANA's registry)."""

_FORGIVEN = 1.0
"""Bad messages that are forgiven a second."""
_MUTE = 1.0
"""Time between two complaints that a client sends too fast [s]."""

_LOG = logging.getLogger(__name__)

_SENT = sent_by(Role.ADMIN)
"""What some client may send."""

Closing = tuple[int, str]
"""Close code and reason."""
Wish = control.Acquire | control.TakeOver | control.Share | control.Release | control.Resume | control.Beat
"""What a client asks of the lease."""


Welcome: TypeAlias = control.Welcome | MobileWelcome
"""What greets a client: of an arm's site, of a mobile robot's."""
State: TypeAlias = control.State | Postures
"""What is known of the real robot, the same."""


News: TypeAlias = Tasks | Seen | Plan
"""What every client is told when it changes: of each kind the newest counts."""


class SessionState:
    """What a session keeps while its connection is lost: who it is, and its servlet."""

    __slots__ = ("key", "left", "local", "name", "role", "servlet", "session")

    def __init__(self, key: str, name: str, role: Role, *, local: bool = False) -> None:
        self.key, self.name, self.role, self.local = key, name, role, local
        self.servlet: Servlet | DriveServlet
        self.session: HubSession | None = None
        self.left = 0.0
        """When its connection was lost [s]."""


class HubApi(Protocol):
    """What a session needs of the hub."""

    limits: ClientLimits
    encoder: SharedEncoder
    state: State | None
    news: dict[type, News]
    network_version: int

    @property
    def lease_version(self) -> int:
        """Counts the changes of the lease."""

    def commanding(self, seat: SessionState) -> bool:
        """Whether a session has the lease, or shares it."""

    def engine_time(self, now: float) -> float:
        """The engine's time [s]."""

    def greet(
        self, session: HubSession, hello: control.Hello, now: float
    ) -> tuple[SessionState, Welcome] | Problem:
        """Let a client in, or say why not."""

    def wish(self, seat: SessionState, wish: Wish, now: float) -> control.Lease | Problem | None:
        """Do what a client asks of the lease."""

    def lease_for(self, seat: SessionState, answers: int | None = None) -> control.Lease:
        """The lease as a client sees it."""

    def network(self, now: float, answers: int | None = None) -> Network | None:
        """How the way to the robot is; None where there's none."""

    def impair(self, seat: SessionState, wish: Impair, now: float) -> Problem | None:
        """Change the way to the robot; why not, None where it's done."""

    def task(self, seat: SessionState, order: TaskOrder, now: float) -> Tasks | Problem:
        """Let the robot do something by itself: how it is then, or why not."""


class HubSession:
    """One connection. Whatever comes in, others aren't affected; what goes out is bounded."""

    def __init__(
        self, desk: HubApi, encoding: Encoding, spending: tuple[Allowance, Allowance], *, now: float
    ) -> None:
        """Wait for `Hello`.

        Args:
            desk: The hub.
            encoding: How its messages are written.
            spending: What it may cost while it doesn't command, and while it does.
            now: Session time [s].
        """
        self._spending, self._told = spending, 0
        self._wanted: set[Want] = set()
        """What was asked for and is on its way."""
        self.desk, self._limits = desk, desk.limits
        self.encoding = encoding
        self.seat: SessionState | None = None
        self.closing: Closing | None = None
        """Code and reason with which the connection is to be closed, when what waits is sent."""
        self._outbox = Outbox(desk.encoder.encode, encoding, self._limits.waiting)
        self._allowed = Bucket(self._limits.rate, self._limits.burst, now)
        self._excess = Bucket(self._limits.excess / 10, self._limits.excess, now)
        self._bad = Bucket(_FORGIVEN, self._limits.bad, now)
        self._hello_until = now + self._limits.hello
        self._quiet_until = now
        self._lease = -1
        self._network: int | None = None
        """Version of the way to the robot that the client knows; None while it hasn't asked."""
        self._state: State | None = None
        self._news: dict[type, News] = {}
        """What the client was told last, by its kind."""

    @property
    def dropped(self) -> int:
        """Messages for the client that found no room."""
        return self._outbox.dropped

    @property
    def has_more(self) -> bool:
        """Whether `advance` has something at once."""
        return bool(self._outbox)

    @property
    def waiting(self) -> int:
        """Bytes that wait for the client."""
        return self._outbox.waiting

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
        self._news, self._wanted = {}, set()
        self.close(FAILED, ProblemCode.FAILED, f"the server failed at this: {type(error).__name__}")

    @property
    def role(self) -> Role:
        """Of a client that hasn't said hello yet, the least."""
        return Role.VIEWER if self.seat is None else self.seat.role

    @property
    def commands(self) -> bool:
        """Whether it has control, or shares it."""
        return self.seat is not None and self.desk.commanding(self.seat)

    def spend(self, work: float, *, now: float) -> None:
        """Note what the messages of the client have cost.

        Args:
            work: Processor time since the last call [s]; the bytes that it's answered are known here.
            now: Session time [s].
        """
        total = self._outbox.total
        self._spending[self.commands].spend(work, total - self._told, now=now)
        self._told = total

    def wait(self, *, now: float) -> float:
        """How long nothing more of the client is to be looked at [s]; 0 for at once."""
        return 0.0 if self.closing is not None else self._spending[self.commands].wait(now=now)

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
            self._put(Pong(message.number, message.t, now, now))
        elif isinstance(message, Order | Ask | Follow | Want):
            self._serve(seat, message, now)
        elif isinstance(message, Wish):
            answer = self.desk.wish(seat, message, now)
            if isinstance(answer, control.Lease):
                self._lease = self.desk.lease_version
            if answer is not None:
                self._put(answer)
        elif isinstance(message, Survey | Impair):
            self._survey(seat, message, now)
        elif isinstance(message, TaskOrder):
            self._put(self.desk.task(seat, message, now))

    def _survey(self, seat: SessionState, message: Survey | Impair, now: float) -> None:
        """Tell how the way to the robot is, after it was changed where that was asked for."""
        problem = self.desk.impair(seat, message, now) if isinstance(message, Impair) else None
        found = None if problem is not None else self.desk.network(now, message.number)
        if found is not None:
            self._network = self.desk.network_version
            self._put(found)
        else:
            text = "no way to a robot is emulated here"
            self._put(problem or Problem(ProblemCode.NOT_ALLOWED, text, message.number))

    def _greet(self, hello: control.Hello, now: float) -> None:
        found = self.desk.greet(self, hello, now)
        if isinstance(found, Problem):
            self.close(TRY_AGAIN if found.code is ProblemCode.FULL else POLICY, found.code, found.text)
            return
        self.seat, welcome = found
        self._lease = self.desk.lease_version
        self._put(welcome)

    def _serve(self, seat: SessionState, message: Order | Ask | Follow | Want, now: float) -> None:
        if not isinstance(message, Order):
            if self._outbox.is_full:
                return
            if isinstance(message, Want):
                if message in self._wanted:
                    return
                self._wanted.add(message)
        elif not may_send(seat.role, message.sender):
            text = "a viewer commands nothing"
            self._complain(Problem(ProblemCode.NOT_ALLOWED, text, message.number), now)
            return
        seat.servlet.receive(message, now=self.desk.engine_time(now))
        self.look(now=now)

    def look(self, *, now: float) -> None:
        """Put what the servlet has into the outbox; of frames and pulses only the newest waits."""
        seat = self.seat
        if seat is None or self.closing is not None:
            return
        try:
            self._look(seat, now)
        except Exception as error:  # noqa: BLE001 - whatever it is, it ends no more than this connection
            self._fail(error)

    def _look(self, seat: SessionState, now: float) -> None:
        for reply in seat.servlet.advance(now=self.desk.engine_time(now)):
            if isinstance(reply, Broadcast | Pulse):
                self._outbox.put_newest(reply)
                continue
            self._outbox.put(reply)

    def is_due(self, now: float) -> bool:
        """Whether `advance` has something to send, or the connection is to be closed, at now [s]."""
        if self._outbox or self.closing is not None:
            return True
        if self.seat is None:
            return now >= self._hello_until
        if self.desk.lease_version != self._lease or self.desk.state is not self._state:
            return True
        if self._network is not None and self.desk.network_version != self._network:
            return True
        if any(self._news.get(kind) is not news for kind, news in self.desk.news.items()):
            return True
        t = self.seat.servlet.next_deadline()
        return t is not None and t <= self.desk.engine_time(now)

    def next_deadline(self) -> float | None:
        """When `Hello` must have come [s]; afterwards the hub asks `is_due` as often as it makes frames."""
        return self._hello_until if self.seat is None and self.closing is None else None

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
        found = self._outbox.take()
        if not self._outbox:
            self._wanted.clear()
        return found

    def _look_around(self, seat: SessionState, now: float) -> None:
        desk = self.desk
        if desk.lease_version != self._lease:
            self._lease = desk.lease_version
            self._outbox.put_newest(desk.lease_for(seat))
        if self._network is not None and desk.network_version != self._network:
            self._network = desk.network_version
            found = desk.network(now)
            if found is not None:
                self._outbox.put_newest(found)
        if desk.state is not None and desk.state is not self._state:
            self._state = desk.state
            self._outbox.put_newest(desk.state)
        for kind, news in desk.news.items():
            if self._news.get(kind) is not news:
                self._news[kind] = news
                self._outbox.put_newest(news)
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
            self._put(Problem(problem, text, fatal=True))

    def _put(self, message: Value) -> None:
        self._outbox.put(message)

    def _complain(self, problem: Problem, now: float) -> None:
        if self.seat is None:
            late = problem.code is ProblemCode.NOT_ALLOWED
            code = ProblemCode.HELLO_EXPECTED if late else problem.code
            self.close(POLICY, code, f"the first message must be hello: {problem.text}")
        elif self._bad.take(now):
            self._put(problem)
        else:
            self.close(POLICY, problem.code, f"too many messages that can't be taken, the last one: {problem.text}")

    def _slow_down(self, now: float) -> None:
        text = f"at most {self._limits.rate:g} messages a second"
        if not self._excess.take(now):
            self.close(POLICY, ProblemCode.TOO_FAST, text)
        elif now >= self._quiet_until:
            self._quiet_until = now + _MUTE
            self._put(Problem(ProblemCode.TOO_FAST, text))
