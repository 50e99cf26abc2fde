"""The client's end of the protocol without sockets: greeting, clocks, lease, orders carried out once."""

from __future__ import annotations

import enum
import math
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import msgspec

from interfaces.clients.ports import RemotePort
from interfaces.engine_server.site import earliest
from interfaces.link.clock_sync import ClockSync
from interfaces.link.round_trip import RoundTrip
from interfaces.messages import Order, Outcome, Reply, Request, control
from interfaces.messages.control import (
    Impair,
    MobileWelcome,
    Network,
    Notice,
    Ping,
    Pong,
    ProblemCode,
    Role,
    Survey,
)
from interfaces.messages.fields import Epoch
from interfaces.messages.jobs import TaskOrder, Tasks
from interfaces.stream.codec import LARGEST, Encoding, News, Value, Welcomed, decode, encode

FROM_SERVER = 4 * LARGEST
"""Longest message of a server that is read [bytes]."""
FIRST_PINGS, QUICK, SLOW = 8, 0.03, 1.0
"""So many pings come so soon after each other [s], the later ones so [s]."""
FIRST_PONGS, SHORT = 4, 0.002
"""The clock is set by the quickest of so many round trips, or the first that's so short [s]; then it's slewed."""
SILENCE = 5.0
"""A server that isn't heard for so long is given up [s]."""
BEATS = 4
"""Beats in the time after which a lease without any expires."""
KEPT = 1024
"""Orders whose epoch is kept; the oldest is forgotten first."""
UNKNOWN = "unknown: the session was lost before an answer came"
"""Refusal of an order that may have been carried out."""

_FATAL = frozenset({ProblemCode.REFUSED, ProblemCode.VERSION, ProblemCode.HELLO_EXPECTED})
"""Problems that a new connection would meet again."""

Asked: TypeAlias = control.LeaseWish | Survey | Impair | TaskOrder | control.PathCorrection | control.Who
"""What a client may wish for."""
Ask: TypeAlias = Callable[[int], Asked]
"""Makes a wish of its number."""
Replied: TypeAlias = control.Lease | control.Problem | control.Corrected | Network | Tasks | control.Present
"""What answers one."""

_COMING = Reply | Notice | Welcomed | News
"""What a server may say."""
_OTHERWISE: dict[type, str] = {
    MobileWelcome: "the mobile robot {} is driven here, not an arm; docs/protocol.md says how",
    control.Welcome: "the arm {} is served here, not a mobile robot: use interfaces.connect",
}
"""Why a client doesn't stay that expects the other."""


class Phase(enum.StrEnum):
    """Where a client is."""

    LOST = "lost"
    """There's no connection."""
    GREETING = "greeting"
    """Hello is sent, or about to be."""
    OPEN = "open"
    """The server said welcome, and the clocks are known."""
    CLOSED = "closed"
    """The server doesn't want this client; `problem` says why."""


class ClientCore:
    """One client of a server: bytes in, bytes out, over as many connections as it takes.

    `port` is what a Designer, Observer or Viewer is given; their time is the session's, see `time`. Orders get the
    epoch of the lease that was held when they were sent first, so that none is carried out under a later one.
    Where a lost connection's session goes on, orders without an answer are sent again, and carried out once.
    Where it doesn't, they are answered with the refusal `UNKNOWN`.
    """

    def __init__(
        self,
        *,
        expects: type[Welcomed] = control.Welcome,
        role: Role = Role.OPERATOR,
        name: str = "client",
        token: str | None = None,
        encoding: Encoding = Encoding.MSGPACK,
        alters: bool = False,
    ) -> None:
        """Begin without a connection.

        Args:
            expects: What greets it: of an arm's server, or of a mobile robot's.
            role: What it wants to do.
            name: For people, 1 to 100 characters.
            token: What the role needs.
            encoding: How its messages are written.
            alters: See `control.Hello`.
        """
        self._expects = expects
        self._hello = control.Hello(control.PROTOCOL, Role(role), name, token, alters=alters)
        self.encoding = Encoding(encoding)
        self.port = RemotePort()
        self.sync = ClockSync()
        """Session time by the local clock."""
        self.phase = Phase.LOST
        self.problem: control.Problem | None = None
        """What the server said last of a message that it couldn't take."""
        self.welcome: Welcomed | None = None
        self.lease: control.Lease | None = None
        self.newest: dict[type, Any] = {}
        """What was told of the robot and the way to it, the newest of each kind of `News`."""
        self.corrections: deque[control.PathCorrection] = deque(maxlen=KEPT)
        """What others want of the path of a program here, to be taken and answered."""
        self.sessions = 0
        """Sessions so far; a further one begins with nothing that was followed, and perhaps another timeline."""
        self.lapses = 0
        """How often its commands have ceased to count."""
        self._out: list[bytes] = []
        self._wishes = 0
        self._answers: OrderedDict[int, Replied | None] = OrderedDict()
        self._orders: OrderedDict[int, Order] = OrderedDict()
        self._newest = self._base = 0
        self._pings = 0
        self._trips: list[RoundTrip] = []
        self._ping_due = self._beat_due = math.inf
        self._heard = 0.0

    @property
    def epoch(self) -> int:
        """Epoch of the lease that it holds or shares; 0 without one."""
        lease = self.lease
        return lease.epoch or 0 if lease is not None and lease.commands else 0

    def time(self, now: float) -> float | None:
        """Session time [s] at the local time now [s]; None before the first round trip."""
        return self.sync.to_remote(now)

    def connected(self, *, now: float) -> None:
        """A connection stands."""
        session = None if self.welcome is None else self.welcome.session
        self.phase = Phase.GREETING
        self._heard = now
        self._out = [encode(msgspec.structs.replace(self._hello, session=session), self.encoding)]

    def disconnected(self) -> None:
        """The connection is gone; who waits for the answer to a wish isn't told any more."""
        if self.phase is not Phase.CLOSED:
            self.phase = Phase.LOST
        self._out.clear()
        self._ping_due = math.inf
        lost = control.Problem(ProblemCode.STOPPING, "the connection was lost before an answer came")
        for number, answer in self._answers.items():
            self._answers[number] = answer or msgspec.structs.replace(lost, number=number)

    def is_silent(self, now: float) -> bool:
        """Whether the server wasn't heard for too long; the connection is then to be given up."""
        return self.phase in {Phase.GREETING, Phase.OPEN} and now >= self._heard + SILENCE

    def wish(self, ask: Ask, *, now: float, leased: bool = False) -> int:
        """Ask something of the lease, or of the way to the robot.

        Args:
            ask: Makes the message, of the wish's number.
            now: Local time [s].
            leased: Whether only who has the lease may ask that.

        Returns:
            Number of the wish, for `answer`.
        """
        self._wishes += 1
        number = self._wishes
        self._answers[number] = None
        if len(self._answers) > KEPT:
            self._answers.popitem(last=False)
        if self.phase is not Phase.OPEN:
            text = "there's no connection"
            self._answers[number] = control.Problem(ProblemCode.STOPPING, text, number)
        elif leased and not self.epoch:
            text = "this client has no lease"
            self._answers[number] = control.Problem(ProblemCode.STALE_EPOCH, text, number)
        else:
            self._send(ask(number))
        if self._beat_due < math.inf:
            self._beat_due = min(self._beat_due, now)
        return number

    def correct(self, answer: control.Corrected | control.Problem) -> None:
        """Answer one of `corrections`; without a connection nobody waits for that."""
        if self.phase is Phase.OPEN:
            self._send(answer)

    def answer(self, number: int) -> Replied | None:
        """What the server answered; None while it hasn't."""
        return self._answers.get(number)

    def receive(self, data: bytes | str, *, now: float) -> None:
        """Take a frame of the server.

        Args:
            data: What has come.
            now: Local time [s].

        Raises:
            ProtocolError: If it's none of the protocol's; the connection is then to be given up.
        """
        raw = data.encode() if isinstance(data, str) else data
        message = decode(raw, self.encoding, allowed=_COMING, largest=FROM_SERVER)
        self._heard = now
        self._take(message, now)

    def _take(self, message: Value, now: float) -> None:
        if isinstance(message, Welcomed):
            self._begin(message, now)
        elif isinstance(message, Ping):
            t = self.time(now)
            self._send(Pong(message.number, message.t, now if t is None else t, now if t is None else t))
        elif isinstance(message, Pong):
            self._measure(message, now)
        elif isinstance(message, control.Lease):
            self._note(message, now)
        elif isinstance(message, control.Problem):
            self._complain(message)
        elif isinstance(message, control.PathCorrection):
            self.corrections.append(message)
        elif isinstance(message, control.Corrected):
            self._settle(message.number, message)
        elif isinstance(message, News):
            self.newest[type(message)] = message
            if isinstance(message, Network | Tasks | control.Present):
                self._settle(message.answers, message)
        else:
            self._hand_on(message, now)  # type: ignore[arg-type]

    def _begin(self, welcome: Welcomed, now: float) -> None:
        if not isinstance(welcome, self._expects):
            text = _OTHERWISE[type(welcome)].format(welcome.robot)
            self._complain(control.Problem(ProblemCode.REFUSED, text, fatal=True))
            return
        before, self.welcome = self.welcome, welcome
        if not welcome.resumed:
            self.sessions += 1
            lost = [number for number in self._orders if number <= self._newest]
            self._base = self._newest
            for number in lost:
                del self._orders[number]
                self.port.receive(Outcome(number, welcome.now, None, UNKNOWN), now=welcome.now)
        if before is not None and before.instance != welcome.instance:
            self.sync = ClockSync()
        self._pings, self._ping_due = 0, now
        self._trips.clear()
        self._note(welcome.lease, now)

    def _measure(self, pong: Pong, now: float) -> None:
        if not (pong.t <= now and pong.received <= pong.answered):
            return
        trip = RoundTrip(pong.t, pong.received, pong.answered, now)
        if self.sync.to_remote(now) is None:
            self._trips.append(trip)
            if len(self._trips) < FIRST_PONGS and trip.delay > SHORT:
                return
            trip = min(self._trips, key=lambda trip: trip.delay)
            self._trips.clear()
        self.sync.receive(trip)
        if self.phase is Phase.GREETING:
            self.phase = Phase.OPEN
            for order in self._orders.values():
                self._transmit(order)

    def _note(self, lease: control.Lease, now: float) -> None:
        held = self.epoch
        self.lease = lease
        if self.epoch != held:
            self._beat_due = now if self.epoch and lease.yours else math.inf
            self.lapses += held > 0
        self._settle(lease.answers, lease)

    def _complain(self, problem: control.Problem) -> None:
        self.problem = problem
        self._settle(problem.number, problem)
        if problem.fatal and problem.code in _FATAL:
            self.phase = Phase.CLOSED

    def _settle(self, number: int | None, answer: Replied) -> None:
        if number is not None and number in self._answers and self._answers[number] is None:
            self._answers[number] = answer

    def _hand_on(self, reply: Reply, now: float) -> None:
        if isinstance(reply, Outcome):
            reply = replace(reply, number=reply.number + self._base)
            self._orders.pop(reply.number, None)
        t = self.time(now)
        if t is not None:
            self.port.receive(reply, now=t)

    def advance(self, *, now: float) -> tuple[bytes, ...]:
        """What is to be sent now; nothing without a connection.

        Args:
            now: Local time [s].
        """
        requests = self.port.advance(now=now)
        if self.phase is Phase.OPEN:
            for request in requests:
                self._pass(request)
            if now >= self._beat_due and self.epoch and self.welcome is not None:
                self._send(control.Beat(Epoch(self.epoch)))
                self._beat_due = now + self.welcome.lease_timeout / BEATS
        else:
            for request in requests:
                if isinstance(request, Order):
                    self._stamped(request)
        if self.phase is not Phase.LOST and now >= self._ping_due:
            self._pings += 1
            self._send(Ping(self._pings, now))
            self._ping_due = now + (QUICK if self._pings < FIRST_PINGS else SLOW)
        out, self._out = tuple(self._out), []
        return out

    def _pass(self, request: Request) -> None:
        if isinstance(request, Order):
            self._transmit(self._stamped(request))
        else:
            self._send(request)

    def _stamped(self, order: Order) -> Order:
        """The order with the epoch that it had when it was seen first."""
        known = self._orders.get(order.number)
        if known is None:
            known = self._orders[order.number] = replace(order, epoch=Epoch(self.epoch) if self.epoch else None)
            if len(self._orders) > KEPT:
                self._orders.popitem(last=False)
        return known

    def _transmit(self, order: Order) -> None:
        self._newest = max(self._newest, order.number)
        self._send(replace(order, number=order.number - self._base))

    def _send(self, message: Request | control.Question | TaskOrder) -> None:
        self._out.append(encode(message, self.encoding))

    def next_deadline(self) -> float | None:
        """When to call `advance` or `is_silent` [s], by the local clock; −∞ for at once."""
        if self._out or self.port.next_deadline() is not None:
            return -math.inf
        if self.phase in {Phase.LOST, Phase.CLOSED}:
            return None
        return earliest(self._ping_due, self._beat_due, self._heard + SILENCE)
