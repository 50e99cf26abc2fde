"""Control messages: who is there, who may command, what time it is, and how the way to the robot is.

Frozen values, like those of `interfaces.messages`. Times are session times: the operator's, in seconds.

One concept in over 600 lines: all that a hub and its clients say to each other besides commands and timelines.
"""

from __future__ import annotations

import enum
from typing import Annotated, ClassVar, Final, TypeAlias

import msgspec
from msgspec import Meta

from interfaces.messages import fields
from interfaces.messages.fields import (
    MOST_JOINTS,
    Count,
    Distance,
    Epoch,
    Leased,
    Message,
    Name,
    Number,
    Party,
    PointRow,
    Points,
    Rate,
    Span,
    Stamp,
    Text,
    Time,
    Timeout,
    Value,
    Word,
)
from robots.onboard.driving import Drive, Posture
from robots.onboard.lease import LeaseEnd, LeaseState
from robots.things import MOST_SCENE_THINGS, Scene, ThingPose
from vrs.checks import sized_array
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import DriveLimits
from vrs.model import Array, Limits
from vrs.record import Record, Twist, set_field


class Ping(Message, frozen=True, omit_defaults=True, gc=False, tag="ping"):
    """An answer at once, please; it also measures the round trip."""

    sender: ClassVar[Party] = Party.EITHER
    number: Number
    t: Stamp
    """When it left, by the sender's clock [s]."""


class Pong(Message, frozen=True, omit_defaults=True, gc=False, tag="pong"):
    """The answer to a `Ping`."""

    sender: ClassVar[Party] = Party.EITHER
    number: Number
    t: Stamp
    """The ping's."""
    received: Stamp
    """When that arrived, by the answerer's clock [s]."""
    answered: Stamp
    """When this left, by the answerer's clock [s]."""


class LinkFigures(Record, frozen=True, omit_defaults=True, gc=False):
    """Sums over the newest packets."""

    packets: Count = 0
    """Sent in the last `span`, those still under way among them."""
    lost: fields.Share | None = None
    """Share of them; absent: nothing is known."""
    median: Span | None = None
    """Delay of those that arrived [s]."""
    p95: Span | None = None
    """Delay that 95 % of those kept within [s]."""
    span: Span | None = None
    """How long they were sent, up to now [s]."""


class DirectionConditions(Record, frozen=True, omit_defaults=True, gc=False):
    """What is emulated in one direction, as the command line spells it."""

    delay: Word
    """A delay profile: `interfaces.link.delay_profile`."""
    loss: Word = "0"
    """A loss model: `interfaces.link.loss_model`."""
    service: Word = "datagram"
    """`datagram` or `in-order`."""


class Survey(Message, frozen=True, omit_defaults=True, gc=False, tag="survey"):
    """How is the way to the robot? Another answer follows whenever the conditions change."""

    sender: ClassVar[Party] = Party.CLIENT
    number: Number


class Impair(Leased, frozen=True, omit_defaults=True, gc=False, tag="impair"):
    """Other conditions of the emulated way to the robot, from now on."""

    sender: ClassVar[Party] = Party.HOLDER
    number: Number
    epoch: Epoch
    forward: DirectionConditions | None = None
    """To the robot; absent: as it is."""
    backward: DirectionConditions | None = None
    """Back, the same."""


class Network(Message, frozen=True, omit_defaults=True, gc=False, tag="network"):
    """How the way to the robot is."""

    sender: ClassVar[Party] = Party.SERVER
    forward: DirectionConditions
    """What is emulated to the robot, as in `Impair`."""
    backward: DirectionConditions
    """What is emulated back."""
    there: LinkFigures
    """What it did to the packets of the last 30 s, since it changed: `packets` sent in the last `span` [s], those
    still under way among them; `lost`: share of them; `median`, `p95`: delay of those that arrived [s]. Absent
    where nothing is known."""
    back: LinkFigures
    """The same of the way back."""
    round_trip: LinkFigures
    """The same, without `lost` and `span`, of round trips between the sites with the network beneath."""
    seed: Count = 0
    """Of what is random in the emulation."""
    changed_at: Time | None = None
    """Session time of the last change [s]; absent: there was none."""
    changed_by: Word = ""
    """Name of who made it."""
    robot: Word = ""
    """Where the robot's site is."""
    problem: Text = ""
    """Why there's no connection to it."""
    clock: Span | None = None
    """By how much the robot may err about session time [s]."""
    link_loss: Word = ""
    """What the robot does when nothing is heard, `halt` or `hold`; empty while that isn't known."""
    timeout: Span | None = None
    """So long after the last message that counts it does that [s]."""
    max_age: Span | None = None
    """Older messages don't count under `halt` [s]."""
    offset: Time | None = None
    """D, where it's fixed [s]; absent: it adapts, or isn't known."""
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


_PARTIES = {
    Role.VIEWER: {Party.EITHER, Party.CLIENT},
    Role.OPERATOR: {Party.EITHER, Party.CLIENT, Party.OPERATOR, Party.HOLDER},
    Role.ADMIN: {Party.EITHER, Party.CLIENT, Party.OPERATOR, Party.HOLDER, Party.ADMIN},
    Role.SITE: {Party.EITHER, Party.SITE},
}


def may_send(role: Role, sender: Party) -> bool:
    """Whether a client of a role may send what such a sender sends."""
    return sender in _PARTIES[role]


def covers(role: Role, other: Role) -> bool:
    """Whether a client of a role may send all that one of another may."""
    return _PARTIES[role] >= _PARTIES[other]


class ProblemCode(enum.StrEnum):
    """Why a message wasn't taken, or a connection ends."""

    MALFORMED = "malformed"
    """No msgpack or JSON, no map with a `type`, or the wrong kind of frame."""
    UNKNOWN_TYPE = "unknown-type"
    """A type that this version doesn't know."""
    NOT_ALLOWED = "not-allowed"
    """A type that may not come here, or not from this role."""
    OUT_OF_RANGE = "out-of-range"
    """A field is missing, of the wrong type, or out of its range; the text says which."""
    TOO_LARGE = "too-large"
    """Longer than messages may be; see below."""
    TOO_FAST = "too-fast"
    """More messages a second than are looked at, see below; or what they cost is more than the client, or its
    address, may spend: they wait, and are taken later."""
    HELLO_EXPECTED = "hello-expected"
    """The first message wasn't `hello`."""
    HELLO_LATE = "hello-late"
    """`hello` didn't come in 2 s."""
    VERSION = "version"
    """No common version of the protocol."""
    REFUSED = "refused"
    """The token isn't right for the role, or has ended, which may come later, or the code isn't one that counts."""
    FULL = "full"
    """Too many clients."""
    LEASE = "lease"
    """It's held, it's ending, it's offered to somebody else, or only an admin may do that; the text says which."""
    STALE_EPOCH = "stale-epoch"
    """The epoch isn't the one in force."""
    STOPPING = "stopping"
    """The server goes."""
    UNHEARD = "unheard"
    """A relay doesn't hear the robot's server: connect again later."""
    FAILED = "failed"
    """The server failed at this client's message, and closes its connection: connect again."""


class Hello(Message, frozen=True, omit_defaults=True, gc=False, tag="hello"):
    """Who it is; its first message."""

    sender: ClassVar[Party] = Party.CLIENT
    secrets: ClassVar[tuple[str, ...]] = ("token", "session")
    protocol: Number
    """Highest version that the client speaks: 1."""

    role: Role
    """What it wants to do; `site` is for sites."""
    name: Name
    """For people."""
    token: Word | None = None
    """Of the role. Needed off loopback, and always for `admin`. In a class a code will do."""
    session: Word | None = None
    """Of an earlier `Welcome`, to go on with it."""
    link_loss: Word | None = None
    """Of an operator's site: what the robot is to do when nothing fresh is heard, `halt` or `hold`; absent: the
    robot's own."""
    alters: bool = False
    """Whether it runs programs whose path others may correct: while it has control, their `correct` comes to it."""
    datagrams: bool = False
    """Of an operator's site: whether it takes datagrams, too."""


class Lease(Leased, frozen=True, omit_defaults=True, gc=False, tag="lease"):
    """Who may command; sent when it changes."""

    sender: ClassVar[Party] = Party.SERVER
    state: LeaseState
    """`ending`: it's over, and the robot isn't at rest yet; ask again later."""
    epoch: Epoch | None = None
    """Of the lease in force; told to the holder, and to who shares it."""
    holder: Name | None = None
    """Name of the holder."""
    yours: bool = False
    """Whether the receiver holds it."""
    answers: Number | None = None
    """Number of the receiver's request that this answers."""
    ended: LeaseEnd | None = None
    """How the one before ended; absent: there was none."""
    shared: bool = False
    """Whether the receiver shares it: it commands under the epoch, but doesn't keep it."""
    member: Count = 0
    """In a class, the receiver's number in `Present`; 0: there's no class."""
    waiting: Count = 0
    """In a class, the receiver's place in the queue, from 1; 0: it isn't in it."""
    offered_until: Time | None = None
    """In a class: the lease is offered to the receiver, to be acquired until then [s]; absent: it isn't."""

    @property
    def commands(self) -> bool:
        """Whether the receiver's commands count."""
        return self.state is LeaseState.HELD and (self.yours or self.shared)


class Welcome(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="welcome"):
    """The client may go on; what there is."""

    sender: ClassVar[Party] = Party.SERVER
    secrets: ClassVar[tuple[str, ...]] = ("session",)
    protocol: Number
    """Version of the protocol that is spoken."""

    session: Word
    """Secret: names this session, for a later `Hello`."""
    role: Role
    """What the client may do."""
    robot: Word
    """Name of its model."""
    dof: Annotated[int, Meta(ge=1, le=MOST_JOINTS)]
    """Its joints, n."""
    limits: Limits
    """Position [rad], speed, acceleration, jerk [rad/s, /s², /s³]."""
    poses: Poses
    """Named joint values [rad]."""
    now: Time
    """Session time when this was sent [s]."""
    lease: Lease
    """As it is now."""
    lease_timeout: Timeout
    """It expires so long after the last beat or order [s]."""
    rates: Annotated[tuple[Rate, ...], Meta(max_length=100)] = ()
    """Rates at which frames are broadcast [1/s]."""
    resumed: bool = False
    """Whether the session that was asked for goes on."""
    instance: Word = ""
    """Names this run of the server; with another one the timeline is another: forget all."""
    server: Word = ""
    """Name and version of the program."""

    def __post_init__(self) -> None:
        widths = {len(q) for q in self.poses.values()} | {self.limits.dof}
        if widths != {self.dof}:
            raise InvalidValueError("dof", self.dof, f"as wide as limits and poses, {sorted(widths)}")


Positive = Annotated[float, Meta(gt=0, le=1e9)]


HOLDS: Final = 0.3
"""A drive order counts for so long after it was issued [s]: who says nothing more stops."""


class MobileWelcome(Message, frozen=True, omit_defaults=True, gc=False, tag="mobile-welcome"):
    """The client may go on; what there is."""

    sender: ClassVar[Party] = Party.SERVER
    secrets: ClassVar[tuple[str, ...]] = ("session",)
    protocol: Number
    """Version of the protocol that is spoken."""

    session: Word
    """Secret: names this session, for a later `Hello`."""
    role: Role
    """What the client may do."""
    robot: Word
    """Name of the robot's model."""
    limits: DriveLimits
    """`v_max` [m/s], `w_max` [rad/s], `a_max` [m/s²], `alpha_max` [rad/s²]."""
    period: Positive
    """T: the virtual robot takes a command so often [s]."""
    holds: Positive
    """A `drive` order counts for so long after it was issued [s]."""
    now: Time
    """Session time [s]."""
    lease: Lease
    """As it is now."""
    lease_timeout: Timeout
    """It expires so long after the last beat or order [s]."""
    resumed: bool = False
    """Whether the session that was asked for goes on."""
    instance: Word = ""
    """Names this run of the server; with another one forget all."""
    server: Word = ""
    """Name and version of the program."""
    room: Word = ""
    """Name of the room."""


class Attached(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="attached"):
    """Follows the operator's site that said hello; what it is and how it behaves."""

    sender: ClassVar[Party] = Party.ROBOT
    secrets: ClassVar[tuple[str, ...]] = ("datagrams",)
    protocol: Number
    """Version of the protocol that is spoken."""

    robot: Word
    """Name of the robot's model."""
    q: Array
    """Measured joints [rad]; of a mobile robot its posture, x, y, θ [m, m, rad]."""
    link_loss: Word
    """What it does when nothing is heard, `halt` or `hold`."""
    timeout: Timeout
    """So long after the last message that counts it begins to stop under `halt` [s]."""
    offset: Time | None = None
    """The robot's timeline less session time [s]; absent: it adapts."""
    instance: Word = ""
    """Names this run of the robot's site."""
    server: Word = ""
    """Name and version of the program."""
    max_age: Timeout | None = None
    """Older messages don't count under `halt` [s]; absent: not known, or `hold`."""
    architecture: Word = ""
    """Of a mobile robot: what it does with the operator's path, by name."""
    room: Word = ""
    """Of a mobile robot: name of the room that it drives in."""
    estimates: bool = False
    """Of a mobile robot: whether its virtual one is drawn where the posture estimator has it."""
    scene: Scene | None = None
    """Of an arm: what is around it, as it was at first; absent: nothing that it could grasp."""
    datagrams: Word = ""
    """Secret of this connection's datagrams; empty: there are none."""


class Acquire(Message, frozen=True, omit_defaults=True, gc=False, tag="acquire"):
    """The lease, if it's free."""

    sender: ClassVar[Party] = Party.OPERATOR
    number: Number


class TakeOver(Message, frozen=True, omit_defaults=True, gc=False, tag="take-over"):
    """The lease, whoever has it; the robot is stopped first."""

    sender: ClassVar[Party] = Party.ADMIN
    number: Number


class Release(Leased, frozen=True, omit_defaults=True, gc=False, tag="release"):
    """Gives it back; who shares it leaves it, and the robot goes on."""

    sender: ClassVar[Party] = Party.HOLDER
    number: Number
    epoch: Epoch


class Share(Message, frozen=True, omit_defaults=True, gc=False, tag="share"):
    """Commands under the lease of that session, too."""

    sender: ClassVar[Party] = Party.OPERATOR
    secrets: ClassVar[tuple[str, ...]] = ("session",)

    number: Number
    session: Word
    """The holder's, from its `Welcome`: whoever knows it was told by the holder."""


class RequestControl(Message, frozen=True, omit_defaults=True, gc=False, tag="request-control"):
    """In a class: the lease if it's offered, or free and nobody waits for it; else a place in the queue."""

    sender: ClassVar[Party] = Party.OPERATOR
    number: Number


class Withdraw(Message, frozen=True, omit_defaults=True, gc=False, tag="withdraw"):
    """In a class: gives a place in the queue up, and what is offered."""

    sender: ClassVar[Party] = Party.OPERATOR
    number: Number
    member: Number | None = None
    """Whose place, by the number in `Present`; absent: one's own. Only an admin takes others out of the queue."""


class GiveControl(Message, frozen=True, omit_defaults=True, gc=False, tag="give-control"):
    """In a class: takes the lease from whoever has it, and offers it to somebody, before all who wait."""

    sender: ClassVar[Party] = Party.ADMIN
    number: Number
    member: Number
    """To whom, by the number in `Present`."""


class Who(Message, frozen=True, omit_defaults=True, gc=False, tag="who"):
    """In a class: who is here? Another answer follows whenever that changes."""

    sender: ClassVar[Party] = Party.CLIENT
    number: Number


MOST_PRESENT = 100
"""Clients that a list of those present names."""


class Member(Record, frozen=True, omit_defaults=True, gc=False):
    """A client of a class."""

    number: Number
    """Its own, as long as its session goes on."""
    name: Name
    """No two have the same."""
    role: Role
    waiting: Count = 0
    """Its place in the queue, from 1; 0: it isn't in it."""


class Present(Message, frozen=True, omit_defaults=True, gc=False, tag="present"):
    """Who is here; the newest one counts."""

    sender: ClassVar[Party] = Party.SERVER
    members: Annotated[tuple[Member, ...], Meta(max_length=MOST_PRESENT)] = ()
    """Who has the lease comes first, then who waits, in order, then the others."""
    others: Count = 0
    """So many more are here."""
    holder: Count = 0
    """Number of who has the lease; 0: nobody of them."""
    offered: Count = 0
    """Number of who it's offered to; 0: nobody."""
    offered_until: Time | None = None
    """The offer stands until then [s]."""
    answers: Number | None = None
    """Number of the receiver's request that this answers."""


class Resume(Leased, frozen=True, omit_defaults=True, gc=False, tag="resume"):
    """The robot goes on after it stopped by itself."""

    sender: ClassVar[Party] = Party.HOLDER
    number: Number
    epoch: Epoch


class Beat(Leased, frozen=True, omit_defaults=True, gc=False, tag="beat"):
    """Keeps it; send one every 0.5 s. It expires after `lease_timeout` without beat or order."""

    sender: ClassVar[Party] = Party.HOLDER
    epoch: Epoch


class Problem(Message, frozen=True, omit_defaults=True, gc=False, tag="problem"):
    """What can't be taken, to its sender."""

    sender: ClassVar[Party] = Party.EITHER
    code: ProblemCode
    """Why; see below."""
    text: Text
    """For people."""
    number: Number | None = None
    """Of what it's about, where that's known."""
    fatal: bool = False
    """Whether the connection ends."""
    field: Word = ""
    """Of an `Impair`: which of `delay`, `loss` and `service` it's about; empty where it's none of them."""


class HandReport(Record, frozen=True, omit_defaults=True, gc=False):
    """A hand with fingers as it was measured, and what it can reach."""

    opening: Distance
    """Between the fingers [m]."""
    goal: Distance
    """What they were told to go to, as far as they go [m]."""
    holds: Count | None = None
    """Which of the things that move both fingers press on, from 0, as in the scene; absent: none."""
    things: Annotated[tuple[tuple[Count, ThingPose], ...], Meta(max_length=MOST_SCENE_THINGS)] = ()
    """[number, pose]: where things are that have moved lately, x, y, z [m] and a quaternion x, y, z, w in the arm's
    base frame; now and then all of them."""


class State(Leased, frozen=True, omit_defaults=True, gc=False, eq=False, tag="state"):
    """The real robot as it was last heard of; the newest one counts."""

    sender: ClassVar[Party] = Party.SERVER
    number: Number
    """Counts up."""
    t: Time
    """Session time of the measurement [s]."""
    q: Array
    """Measured joints [rad]."""
    play: Time
    """Time on the timeline that it plays [s]."""
    pace: Value
    """How fast; 1: as planned, 0: it waits."""
    D: Time
    """The robot's timeline less session time [s]."""
    following_error: Value
    """Largest deviation of a joint from its reference [rad]."""
    epoch: Epoch | None = None
    """Of the lease that it follows; absent: none."""
    connected: bool = True
    """Whether the robot is heard of."""
    halted: Text = ""
    """Why it stopped by itself: it takes no command until the holder sends `Resume`, once it's at rest."""
    corrections: Count = 0
    """How often the virtual robot was put where the real one goes."""
    reference: Array | None = None
    """What the robot's own timeline asked for at `t` [rad]; absent: it hasn't said. Equal to the virtual robot at
    `play` unless the two plans have parted."""
    round_trip: Value | None = None
    """Newest time that a message to the robot and the answer were under way, what the robot took in between left
    out [s]; absent before the first."""
    messages: Annotated[tuple[tuple[Time, Time | None], ...], Meta(max_length=MOST_MESSAGES)] = ()
    """[sent, arrived]: messages to the robot that the emulated link has delivered or lost (null) since the state
    before, session time [s]. What the real network adds isn't in it."""
    late: Annotated[tuple[tuple[Time, Array], ...], Meta(max_length=MOST_LATE)] = ()
    """[t, joints]: measurements that came after later ones, one of six; each for 0.2 s, so some come twice."""
    hand: HandReport | None = None
    """Its hand, and the things around it, measured with `q`; absent where it's in no scene."""


class Postures(Leased, frozen=True, omit_defaults=True, gc=False, tag="postures"):
    """Where both robots are; the newest one counts."""

    sender: ClassVar[Party] = Party.SERVER
    number: Number
    """Counts up."""
    now: Time
    """Session time when it was made [s]."""
    virtual: Posture
    """Of the virtual robot, now [m, m, rad]."""
    command: Drive
    """What it drives [m/s, rad/s]."""
    estimate: Posture
    """Where the real robot is thought to come to with all commands so far (the posture estimator). Source: Han et
    al., eq. (8)–(10)."""
    t: Time | None = None
    """Session time of the newest measurement [s]; absent before the first, as the next two."""
    real: Posture | None = None
    """Where the real robot took itself to be."""
    drive: Drive | None = None
    """What its motors are told."""
    D: Time | None = None
    """The time of the path that it's to play less session time, by the clock as the robot has it, without what
    braking needs [s]; absent where its architecture has none."""
    starved: bool = False
    """Whether it's slower than it should be, as it knows nothing newer."""
    path_error: Distance | None = None
    """Distance from the nearest place of the virtual robot's path near the one before [m]; absent while it doesn't
    follow."""
    time_difference: Distance | None = None
    """How much later it is there [s]; 0 where both stand."""
    epoch: Epoch | None = None
    """Of the drive that it follows; absent: none."""
    connected: bool = True
    """Whether the robot is heard of."""
    halted: Text = ""
    """As in `state`."""
    drives: Count = 0
    """How often the virtual robot was put where the real one stood: a drive begins with each lease and `Resume`,
    and after a stop."""
    round_trip: Value | None = None
    """As in `state`."""
    messages: Annotated[tuple[tuple[Time, Time | None], ...], Meta(max_length=MOST_MESSAGES)] = ()
    """As in `state`."""
    drawn: Posture | None = None
    """Where the virtual robot is drawn, where the posture estimator has it now; absent where that's `virtual`, as
    in architectures without one."""


Variance = Annotated[float, Meta(ge=-1e9, le=1e9)]
"""[m²]."""
Doubt = tuple[Variance, Variance, Variance]


class SensedPoints(Record, frozen=True, omit_defaults=True, gc=False):
    """What a robot sees of its surroundings."""

    time: Stamp
    """By the robot's own clock [s]."""
    points: Points = ()
    """Where its laser's beams ended, on the map [m]."""
    doubt: Doubt | None = None
    """Of its place: variance of x, covariance, variance of y [m²]; None where nobody knows."""


MOST_THINGS = 1000
"""Outlines of a map."""
MOST_CORNERS = 64
"""Of an outline."""
Outline = Annotated[tuple[PointRow, ...], Meta(max_length=MOST_CORNERS)]


class Seen(Message, SensedPoints, frozen=True, omit_defaults=True, gc=False, tag="seen"):
    """What the robot sees of its surroundings; the newest one counts."""

    sender: ClassVar[Party] = Party.SERVER


class Plan(Message, frozen=True, omit_defaults=True, gc=False, tag="plan"):
    """The known map of where the robot drives."""

    sender: ClassVar[Party] = Party.SERVER
    size: PointRow
    """Length and width of the floor [m]."""
    things: Annotated[tuple[Outline, ...], Meta(max_length=MOST_THINGS)] = ()
    """Outlines of what the map knows [m]."""
    via: Points = ()
    """Via points [m]."""
    robot: tuple[Distance, Distance, Distance] = msgspec.field(default_factory=lambda: (0.0, 0.0, 0.0))
    """What it reaches ahead and back from its axle, and its width [m]."""


class PathCorrection(Leased, frozen=True, omit_defaults=True, gc=False, eq=False, tag="correct"):
    """Correct the path that a program alters on a channel. The answer is a `Corrected` or a `Problem`.

    The server hands it on to a client with `alters` that has control, which answers the server in its turn.
    """

    sender: ClassVar[Party] = Party.EITHER
    number: Number
    """The sender's own; the answer has it, too."""
    channel: Annotated[int, Meta(ge=0, le=255)]
    """Of the program's ALTER."""
    offset: Twist
    """Translation [m], then rotation vector [rad], (6,): along which axes, and whether it adds up, says ALTER."""
    epoch: Epoch | None = None
    """Of who has control, or shares it; others may correct a program of a client with `alters`."""
    at: Time | None = None
    """For when it's meant [s], within 0.2 s of now; absent: for when it comes."""

    def __post_init__(self) -> None:
        allowed = "a translation [m] and a rotation vector [rad], (6,)"
        set_field(self, "offset", sized_array("offset", self.offset, (6,), allowed))
        super().__post_init__()


class Corrected(Message, frozen=True, omit_defaults=True, gc=False, tag="corrected"):
    """A correction is on the path."""

    sender: ClassVar[Party] = Party.EITHER
    number: Number
    """Of the `PathCorrection`."""
    late: Text = ""
    """What keeps the arm from following in time; empty where nothing does."""


MOST_RELAYS = 64
"""Other relays that a viewer is told of."""


class Relays(Message, frozen=True, omit_defaults=True, gc=False, tag="relays"):
    """Sent by a relay: where else the same is relayed. The newest one counts."""

    sender: ClassVar[Party] = Party.SERVER
    pages: Annotated[tuple[Word, ...], Meta(max_length=MOST_RELAYS)] = ()
    """Addresses of the other relays' pages, by http or https."""


QueueWish: TypeAlias = RequestControl | Withdraw | GiveControl
"""What a client of a class asks of the queue."""
LeaseWish: TypeAlias = Acquire | TakeOver | Share | Release | Resume | QueueWish
"""What a client asks of the lease; a `Lease` or a `Problem` answers it."""
Question: TypeAlias = (
    Hello | Ping | Pong | LeaseWish | Beat | Survey | Impair | Problem | PathCorrection | Corrected | Who
)
"""Control messages that a client sends."""
Notice: TypeAlias = (
    Welcome
    | Attached
    | Lease
    | Ping
    | Pong
    | Problem
    | State
    | Network
    | PathCorrection
    | Corrected
    | Present
    | Relays
)
"""Control messages that a server sends."""


class ProtocolError(FormatError):
    """Bytes that are no message, or none that may come here: the sender's fault, and nothing has changed."""

    def __init__(self, code: ProblemCode, text: str) -> None:
        self.code, self.text = code, text
        super().__init__("message", f"{text} ({code})")
