"""Control messages: who is there, who may command, what time it is, and how the way to the robot is.

Frozen values, like those of `interfaces.messages`. Times are session times: the operator's, in seconds.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, TypeAlias

from robots.onboard.lease import LeaseEnd, LeaseState
from vrs.errors import FormatError
from vrs.model import Array, Limits


@dataclass(frozen=True, slots=True)
class Ping:
    """Either side: an answer at once, please; it also measures the round trip."""

    kind: ClassVar[str] = "ping"
    version: ClassVar[int] = 1
    number: int
    t: float
    """When it left, by the sender's clock [s]."""


@dataclass(frozen=True, slots=True)
class Pong:
    """Either side: the answer to a `Ping`."""

    kind: ClassVar[str] = "pong"
    version: ClassVar[int] = 1
    number: int
    t: float
    """The ping's."""
    received: float
    """When that arrived, by the answerer's clock [s]."""
    answered: float
    """When this left, by the answerer's clock [s]."""


@dataclass(frozen=True, slots=True)
class LinkFigures:
    """Sums over the newest packets."""

    packets: int
    """So many were sent, those that are still under way among them."""
    lost: float | None
    """Share of them that was lost; None of none."""
    median: float | None
    """Of the time between sending and delivery of those that arrived [s]; None where none did."""
    p95: float | None
    """Delay that 95 % of those kept within [s]."""
    span: float | None = None
    """Over how long they were sent, up to now [s]; None where that isn't known."""


@dataclass(frozen=True, slots=True)
class DirectionConditions:
    """What is emulated in one direction, as the command line spells it."""

    delay: str
    """A delay profile: `interfaces.link.delay_profile`."""
    loss: str = "0"
    """A loss model: `interfaces.link.loss_model`."""
    service: str = "datagram"
    """`datagram` or `in-order`."""


@dataclass(frozen=True, slots=True)
class Survey:
    """Client: how is the way to the robot? Changes of it are told from then on."""

    kind: ClassVar[str] = "survey"
    version: ClassVar[int] = 1
    number: int


@dataclass(frozen=True, slots=True)
class Impair:
    """Holder: other conditions of the emulated way to the robot, from now on."""

    kind: ClassVar[str] = "impair"
    version: ClassVar[int] = 1
    number: int
    epoch: int
    forward: DirectionConditions | None = None
    """To the robot; None leaves them as they are."""
    backward: DirectionConditions | None = None
    """Back."""


@dataclass(frozen=True, slots=True)
class Network:
    """Server: how the way to the robot is."""

    kind: ClassVar[str] = "network"
    version: ClassVar[int] = 1
    forward: DirectionConditions
    """What is emulated to the robot."""
    backward: DirectionConditions
    """What is emulated back."""
    there: LinkFigures
    """What was measured of the emulation to the robot, since it changed last."""
    back: LinkFigures
    """The same of the way back."""
    round_trip: LinkFigures
    """Of whole round trips between the sites, with the network beneath; nothing is known of losses."""
    seed: int = 0
    """Of what is random in the emulation."""
    changed_at: float | None = None
    """Session time when the conditions changed last [s]; None if they never did."""
    changed_by: str = ""
    """Name of who changed them."""
    robot: str = ""
    """Where the robot's site is."""
    problem: str = ""
    """Why there's no connection to it; empty while there is one."""
    clock: float | None = None
    """Bound on the error of what the robot takes for session time [s]."""
    link_loss: str = ""
    """What the robot does when nothing is heard, `halt` or `hold`; empty while that isn't known."""
    timeout: float | None = None
    """So long after the last message that counts it does that [s]."""
    max_age: float | None = None
    """Older messages don't count under `halt` [s]."""
    offset: float | None = None
    """D, where it's fixed [s]; None where it adapts, or isn't known."""
    advice: str = ""
    """What is likely to go wrong under these conditions, for people."""
    answers: int | None = None
    """Number of the receiver's request that this answers."""


PROTOCOL = 1
"""Version of the protocol."""
OVERRULED = "no lease: another session of it has given a command since; share it again"
"""Refusal of an order of a session whose share has ended so."""


class Role(enum.StrEnum):
    """What a client may do."""

    VIEWER = "viewer"
    """Follow and ask."""
    OPERATOR = "operator"
    """Command as well, while it holds the lease."""
    ADMIN = "admin"
    """Take the lease over as well."""
    SITE = "site"
    """The operator's site, at the robot's."""


class ProblemCode(enum.StrEnum):
    """Why a message wasn't taken, or a connection ends."""

    MALFORMED = "malformed"
    """No msgpack, no JSON, or no map with a type."""
    UNKNOWN_TYPE = "unknown-type"
    """A type that this version doesn't know."""
    NOT_ALLOWED = "not-allowed"
    """A type that may not come here, or not from this role."""
    OUT_OF_RANGE = "out-of-range"
    """A field that's missing, of the wrong type, or out of its range."""
    TOO_LARGE = "too-large"
    """Longer than messages may be."""
    TOO_FAST = "too-fast"
    """More messages a second than are looked at."""
    HELLO_EXPECTED = "hello-expected"
    """The first message wasn't `Hello`."""
    HELLO_LATE = "hello-late"
    """`Hello` didn't come in time."""
    VERSION = "version"
    """No common version of the protocol."""
    REFUSED = "refused"
    """The token isn't right for the role."""
    FULL = "full"
    """Too many clients."""
    LEASE = "lease"
    """The lease is held, is ending, or can't be had; the text says which."""
    STALE_EPOCH = "stale-epoch"
    """The epoch isn't that of the lease in force."""
    STOPPING = "stopping"
    """The server goes."""
    FAILED = "failed"
    """The server failed at this client's message; nobody else is affected."""


@dataclass(frozen=True, slots=True)
class Hello:
    """Client: who it is; its first message."""

    kind: ClassVar[str] = "hello"
    version: ClassVar[int] = 1
    role: Role
    name: str
    """For people, 1 to 100 characters."""
    token: str | None = field(default=None, repr=False)
    session: str | None = field(default=None, repr=False)
    """An earlier session of this client, to go on with."""
    protocol: int = PROTOCOL
    link_loss: str | None = None
    """Of an operator's site: what the robot is to do when nothing is heard, `halt` or `hold`; None leaves it to the
    robot."""


@dataclass(frozen=True, slots=True)
class Lease:
    """Server: who may command; sent when it changes."""

    kind: ClassVar[str] = "lease"
    version: ClassVar[int] = 1
    state: LeaseState
    epoch: int | None = None
    """Of the lease in force; told to its holder only, and to those who share it."""
    holder: str | None = None
    """Name of who has it."""
    yours: bool = False
    """Whether the receiver has it, and keeps it."""
    answers: int | None = None
    """Number of the receiver's request that this answers."""
    ended: LeaseEnd | None = None
    """How the lease before ended; None if there was none."""
    shared: bool = False
    """Whether the receiver shares it: it commands under the epoch, but doesn't keep it."""

    @property
    def commands(self) -> bool:
        """Whether the receiver's commands count."""
        return self.state is LeaseState.HELD and (self.yours or self.shared)


@dataclass(frozen=True, slots=True, eq=False)
class Welcome:
    """Server: the client may go on; what there is."""

    kind: ClassVar[str] = "welcome"
    version: ClassVar[int] = 1
    session: str = field(repr=False)
    """Names this session, for a later `Hello`; nobody else may know it."""
    role: Role
    robot: str
    """Name of the robot's model."""
    limits: Limits
    poses: Mapping[str, Array]
    """Named poses, joints [rad], (n,)."""
    now: float
    """Session time [s]."""
    lease: Lease
    rates: tuple[float, ...] = ()
    """Rates of the broadcasters [1/s]."""
    resumed: bool = False
    """Whether the session that was asked for goes on."""
    instance: str = ""
    """Names this run of the server; with another one, there's another timeline."""
    server: str = ""
    """Name and version of the program."""
    lease_timeout: float = 2.0
    """A lease expires so long after the last beat [s]."""
    protocol: int = PROTOCOL

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", MappingProxyType(dict(self.poses)))


@dataclass(frozen=True, slots=True, eq=False)
class Attached:
    """Robot: follows the operator's site that said hello; what it is and how it behaves."""

    kind: ClassVar[str] = "attached"
    version: ClassVar[int] = 1
    robot: str
    """Name of the robot's model."""
    q: Array
    """Measured joints [rad], (n,); of a mobile robot its posture, x, y, θ [m, m, rad]."""
    link_loss: str
    """What it does when nothing is heard: `halt` or `hold`."""
    timeout: float
    """So long after the last message that counts it begins to stop under `halt` [s]."""
    offset: float | None = None
    """The robot's timeline less the session's time, where it's fixed [s]; None where it adapts."""
    instance: str = ""
    """Names this run of the robot's site."""
    server: str = ""
    """Name and version of the program."""
    protocol: int = PROTOCOL
    max_age: float | None = None
    """Older messages don't count under `halt` [s]; None where that isn't known, or under `hold`."""
    architecture: str = ""
    """Of a mobile robot: what it does with the operator's path, by name."""
    room: str = ""
    """Of a mobile robot: name of the room that it drives in."""


@dataclass(frozen=True, slots=True)
class Acquire:
    """Client: the lease, please, if it's free."""

    kind: ClassVar[str] = "acquire"
    version: ClassVar[int] = 1
    number: int


@dataclass(frozen=True, slots=True)
class TakeOver:
    """Admin: the lease, please, whoever has it. The robot stops in between."""

    kind: ClassVar[str] = "take-over"
    version: ClassVar[int] = 1
    number: int


@dataclass(frozen=True, slots=True)
class Release:
    """Holder: gives the lease back."""

    kind: ClassVar[str] = "release"
    version: ClassVar[int] = 1
    number: int
    epoch: int


@dataclass(frozen=True, slots=True)
class Share:
    """Client: the epoch of the lease that a session of the same person has, please."""

    kind: ClassVar[str] = "share"
    version: ClassVar[int] = 1
    number: int
    session: str = field(repr=False)
    """The holder's, from its `Welcome`: whoever knows it was told by the holder."""


@dataclass(frozen=True, slots=True)
class Resume:
    """Holder: the robot may go on after it stopped by itself."""

    kind: ClassVar[str] = "resume"
    version: ClassVar[int] = 1
    number: int
    epoch: int


@dataclass(frozen=True, slots=True)
class Beat:
    """Holder: is still there."""

    kind: ClassVar[str] = "beat"
    version: ClassVar[int] = 1
    epoch: int


@dataclass(frozen=True, slots=True)
class Problem:
    """Either side: what can't be taken, to its sender."""

    kind: ClassVar[str] = "problem"
    version: ClassVar[int] = 1
    code: ProblemCode
    text: str
    """For people."""
    number: int | None = None
    """Number of what it's about, where that's known."""
    fatal: bool = False
    """Whether the connection ends."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Server: the real robot as it was last heard of; the newest one counts."""

    kind: ClassVar[str] = "state"
    version: ClassVar[int] = 1
    number: int
    t: float
    """Session time when it was measured [s]."""
    q: Array
    """Measured joints [rad], (n,)."""
    play: float
    """Time on the robot's timeline that it plays [s]."""
    pace: float
    """How fast it plays; 1 is as planned."""
    D: float
    """The robot's timeline less session time [s]."""
    following_error: float
    """Largest difference of a joint from its reference [rad]."""
    epoch: int = 0
    """Epoch that it follows; 0 for none."""
    connected: bool = True
    """Whether the robot's site is heard of."""
    halted: str = ""
    """Why it stopped by itself; empty while it follows."""
    corrections: int = 0
    """How often the virtual robot was put where the real one goes."""
    reference: Array | None = None
    """What the robot's own timeline asked for at t [rad], (n,); None where it hasn't said."""
    round_trip: float | None = None
    """Newest time that a message to the robot and the answer were under way [s]; None before the first."""
    messages: tuple[tuple[float, float | None], ...] = ()
    """Messages to the robot of which the emulated link told since the state before: when each was sent, and when it
    arrived [s]; None for one that was lost."""
    late: tuple[tuple[float, Array], ...] = ()
    """Measurements that came late: session time [s], and joints [rad], (n,). Some are told twice."""


Question: TypeAlias = (
    Hello | Ping | Pong | Acquire | TakeOver | Share | Release | Resume | Beat | Survey | Impair | Problem
)
"""Control messages that a client sends."""
Notice: TypeAlias = Welcome | Attached | Lease | Ping | Pong | Problem | State | Network
"""Control messages that a server sends."""


class ProtocolError(FormatError):
    """Bytes that are no message, or none that may come here: the sender's fault, and nothing has changed."""

    def __init__(self, code: ProblemCode, text: str) -> None:
        self.code, self.text = code, text
        super().__init__("message", f"{text} ({code})")
