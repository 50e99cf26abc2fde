"""Control messages: who is there, who may command, what time it is, and how the way to the robot is.

Frozen values, like those of `interfaces.messages`. Times are session times: the operator's, in seconds.
"""

from __future__ import annotations

import enum
from typing import Annotated, ClassVar, TypeAlias

from msgspec import Meta

from interfaces.messages import fields
from interfaces.messages.fields import (
    MOST_JOINTS,
    Count,
    Epoch,
    Leased,
    Message,
    Name,
    Number,
    Rate,
    Span,
    Stamp,
    Text,
    Time,
    Timeout,
    Value,
    Wire,
    Word,
)
from robots.onboard.lease import LeaseEnd, LeaseState
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array, Limits


class Ping(Message, frozen=True, omit_defaults=True, gc=False, tag="ping"):
    """Either side: an answer at once, please; it also measures the round trip."""

    number: Number
    t: Stamp
    """When it left, by the sender's clock [s]."""


class Pong(Message, frozen=True, omit_defaults=True, gc=False, tag="pong"):
    """Either side: the answer to a `Ping`."""

    number: Number
    t: Stamp
    """The ping's."""
    received: Stamp
    """When that arrived, by the answerer's clock [s]."""
    answered: Stamp
    """When this left, by the answerer's clock [s]."""


class LinkFigures(Wire, frozen=True, omit_defaults=True, gc=False):
    """Sums over the newest packets."""

    packets: Count = 0
    """So many were sent, those that are still under way among them."""
    lost: fields.Share | None = None
    """Share of them that was lost; None of none."""
    median: Span | None = None
    """Of the time between sending and delivery of those that arrived [s]; None where none did."""
    p95: Span | None = None
    """Delay that 95 % of those kept within [s]."""
    span: Span | None = None
    """Over how long they were sent, up to now [s]; None where that isn't known."""


class DirectionConditions(Wire, frozen=True, omit_defaults=True, gc=False):
    """What is emulated in one direction, as the command line spells it."""

    delay: Word
    """A delay profile: `interfaces.link.delay_profile`."""
    loss: Word = "0"
    """A loss model: `interfaces.link.loss_model`."""
    service: Word = "datagram"
    """`datagram` or `in-order`."""


class Survey(Message, frozen=True, omit_defaults=True, gc=False, tag="survey"):
    """Client: how is the way to the robot? Changes of it are told from then on."""

    number: Number


class Impair(Leased, frozen=True, omit_defaults=True, gc=False, tag="impair"):
    """Holder: other conditions of the emulated way to the robot, from now on."""

    number: Number
    epoch: Epoch
    forward: DirectionConditions | None = None
    """To the robot; None leaves them as they are."""
    backward: DirectionConditions | None = None
    """Back."""


class Network(Message, frozen=True, omit_defaults=True, gc=False, tag="network"):
    """Server: how the way to the robot is."""

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
    seed: Count = 0
    """Of what is random in the emulation."""
    changed_at: Time | None = None
    """Session time when the conditions changed last [s]; None if they never did."""
    changed_by: Word = ""
    """Name of who changed them."""
    robot: Word = ""
    """Where the robot's site is."""
    problem: Text = ""
    """Why there's no connection to it; empty while there is one."""
    clock: Span | None = None
    """Bound on the error of what the robot takes for session time [s]."""
    link_loss: Word = ""
    """What the robot does when nothing is heard, `halt` or `hold`; empty while that isn't known."""
    timeout: Span | None = None
    """So long after the last message that counts it does that [s]."""
    max_age: Span | None = None
    """Older messages don't count under `halt` [s]."""
    offset: Time | None = None
    """D, where it's fixed [s]; None where it adapts, or isn't known."""
    advice: Text = ""
    """What is likely to go wrong under these conditions, for people."""
    answers: Number | None = None
    """Number of the receiver's request that this answers."""


Poses = Annotated[dict[Name, Array], Meta(max_length=100)]
MOST_MESSAGES = 64
"""Messages to the robot that a state tells of, at most."""
MOST_LATE = 128
"""Measurements that a state tells late, at most."""
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


class Hello(Message, frozen=True, omit_defaults=True, gc=False, tag="hello"):
    """Client: who it is; its first message."""

    secrets: ClassVar[tuple[str, ...]] = ("token", "session")
    protocol: Number
    """Highest version that it speaks."""

    role: Role
    name: Name
    """For people, 1 to 100 characters."""
    token: Word | None = None
    session: Word | None = None
    """An earlier session of this client, to go on with."""
    link_loss: Word | None = None
    """Of an operator's site: what the robot is to do when nothing is heard, `halt` or `hold`; None leaves it to the
    robot."""


class Lease(Leased, frozen=True, omit_defaults=True, gc=False, tag="lease"):
    """Server: who may command; sent when it changes."""

    state: LeaseState
    epoch: Epoch | None = None
    """Of the lease in force; told to its holder only, and to those who share it."""
    holder: Name | None = None
    """Name of who has it."""
    yours: bool = False
    """Whether the receiver has it, and keeps it."""
    answers: Number | None = None
    """Number of the receiver's request that this answers."""
    ended: LeaseEnd | None = None
    """How the lease before ended; None if there was none."""
    shared: bool = False
    """Whether the receiver shares it: it commands under the epoch, but doesn't keep it."""

    @property
    def commands(self) -> bool:
        """Whether the receiver's commands count."""
        return self.state is LeaseState.HELD and (self.yours or self.shared)


class Welcome(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="welcome"):
    """Server: the client may go on; what there is."""

    secrets: ClassVar[tuple[str, ...]] = ("session",)
    protocol: Number
    """Version of the protocol that is spoken."""

    session: Word
    """Names this session, for a later `Hello`; nobody else may know it."""
    role: Role
    robot: Word
    """Name of the robot's model."""
    dof: Annotated[int, Meta(ge=1, le=MOST_JOINTS)]
    """Its joints, n."""
    limits: Limits
    poses: Poses
    """Named poses, joints [rad], (n,)."""
    now: Time
    """Session time [s]."""
    lease: Lease
    lease_timeout: Timeout
    """A lease expires so long after the last beat [s]."""
    rates: Annotated[tuple[Rate, ...], Meta(max_length=100)] = ()
    """Rates of the broadcasters [1/s]."""
    resumed: bool = False
    """Whether the session that was asked for goes on."""
    instance: Word = ""
    """Names this run of the server; with another one, there's another timeline."""
    server: Word = ""
    """Name and version of the program."""

    def __post_init__(self) -> None:
        widths = {len(q) for q in self.poses.values()} | {self.limits.dof}
        if widths != {self.dof}:
            raise InvalidValueError("dof", self.dof, f"as wide as limits and poses, {sorted(widths)}")


class Attached(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="attached"):
    """Robot: follows the operator's site that said hello; what it is and how it behaves."""

    protocol: Number
    """Version of the protocol that is spoken."""

    robot: Word
    """Name of the robot's model."""
    q: Array
    """Measured joints [rad], (n,); of a mobile robot its posture, x, y, θ [m, m, rad]."""
    link_loss: Word
    """What it does when nothing is heard: `halt` or `hold`."""
    timeout: Timeout
    """So long after the last message that counts it begins to stop under `halt` [s]."""
    offset: Time | None = None
    """The robot's timeline less the session's time, where it's fixed [s]; None where it adapts."""
    instance: Word = ""
    """Names this run of the robot's site."""
    server: Word = ""
    """Name and version of the program."""
    max_age: Timeout | None = None
    """Older messages don't count under `halt` [s]; None where that isn't known, or under `hold`."""
    architecture: Word = ""
    """Of a mobile robot: what it does with the operator's path, by name."""
    room: Word = ""
    """Of a mobile robot: name of the room that it drives in."""


class Acquire(Message, frozen=True, omit_defaults=True, gc=False, tag="acquire"):
    """Client: the lease, please, if it's free."""

    number: Number


class TakeOver(Message, frozen=True, omit_defaults=True, gc=False, tag="take-over"):
    """Admin: the lease, please, whoever has it. The robot stops in between."""

    number: Number


class Release(Leased, frozen=True, omit_defaults=True, gc=False, tag="release"):
    """Holder: gives the lease back."""

    number: Number
    epoch: Epoch


class Share(Message, frozen=True, omit_defaults=True, gc=False, tag="share"):
    """Client: the epoch of the lease that a session of the same person has, please."""

    secrets: ClassVar[tuple[str, ...]] = ("session",)

    number: Number
    session: Word
    """The holder's, from its `Welcome`: whoever knows it was told by the holder."""


class Resume(Leased, frozen=True, omit_defaults=True, gc=False, tag="resume"):
    """Holder: the robot may go on after it stopped by itself."""

    number: Number
    epoch: Epoch


class Beat(Leased, frozen=True, omit_defaults=True, gc=False, tag="beat"):
    """Holder: is still there."""

    epoch: Epoch


class Problem(Message, frozen=True, omit_defaults=True, gc=False, tag="problem"):
    """Either side: what can't be taken, to its sender."""

    code: ProblemCode
    text: Text
    """For people."""
    number: Number | None = None
    """Number of what it's about, where that's known."""
    fatal: bool = False
    """Whether the connection ends."""


class State(Leased, frozen=True, omit_defaults=True, gc=False, eq=False, tag="state"):
    """Server: the real robot as it was last heard of; the newest one counts."""

    number: Number
    t: Time
    """Session time when it was measured [s]."""
    q: Array
    """Measured joints [rad], (n,)."""
    play: Time
    """Time on the robot's timeline that it plays [s]."""
    pace: Value
    """How fast it plays; 1 is as planned."""
    D: Time
    """The robot's timeline less session time [s]."""
    following_error: Value
    """Largest difference of a joint from its reference [rad]."""
    epoch: Epoch | None = None
    """That it follows; None for none."""
    connected: bool = True
    """Whether the robot's site is heard of."""
    halted: Text = ""
    """Why it stopped by itself; empty while it follows."""
    corrections: Count = 0
    """How often the virtual robot was put where the real one goes."""
    reference: Array | None = None
    """What the robot's own timeline asked for at t [rad], (n,); None where it hasn't said."""
    round_trip: Value | None = None
    """Newest time that a message to the robot and the answer were under way [s]; None before the first."""
    messages: Annotated[tuple[tuple[Time, Time | None], ...], Meta(max_length=MOST_MESSAGES)] = ()
    """Messages to the robot of which the emulated link told since the state before: when each was sent, and when it
    arrived [s]; None for one that was lost."""
    late: Annotated[tuple[tuple[Time, Array], ...], Meta(max_length=MOST_LATE)] = ()
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
