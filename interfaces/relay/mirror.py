"""What a relay has of a hub elsewhere: its clock, timeline, news and scene; and what is to be asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Final, TypeAlias, cast

import msgspec
from typing_extensions import override

from interfaces.clients.ports import RemotePort
from interfaces.clients.viewer_sources import SegmentSource
from interfaces.engine_server.journal import Journal, TimelineEdit
from interfaces.engine_server.site import Site
from interfaces.link.clock_sync import ClockSync
from interfaces.link.round_trip import RoundTrip
from interfaces.messages import Change, History, Order, Outcome, Pulse, Scene, control
from interfaces.messages.control import MobileWelcome, Ping, Pong, ProtocolError, Welcome
from interfaces.messages.relaying import HubFacts, SceneValues
from interfaces.stream.client import FIRST_PINGS, FIRST_PONGS, FROM_SERVER, QUICK, SHORT, SLOW
from interfaces.stream.codec import Encoding, News, Welcomed, decode, encode
from interfaces.stream.meshcat.newest import Nodes
from vrs.clock import Clock
from vrs.timeline import Timeline

CURRENT: Final = 0.5
"""What was heard of the hub so lately [s] is what it does now; else pages aren't told that it goes on."""
RESEND: Final = 0.25
"""After so long without an answer it's asked again [s], at first."""
Asked: TypeAlias = tuple[str, bytes]
"""Of what kind, and what."""
Told: TypeAlias = News | control.Lease
_TIMELINE = Scene | History | Change | Pulse


class SessionClock:
    """The hub's clock as it's known here."""

    def __init__(self, local: Clock) -> None:
        """Nothing is known yet.

        Args:
            local: This machine's.
        """
        self._local, self._sync = local, ClockSync()
        self._trips: list[RoundTrip] = []
        self._pings, self._due, self._heard = 0, -math.inf, -math.inf

    @property
    def is_known(self) -> bool:
        """Whether it can be read."""
        return self._sync.to_remote(self._local.now()) is not None

    def now(self) -> float:
        """Session time [s]."""
        t = self._sync.to_remote(self._local.now())
        assert t is not None
        return t

    def receive(self, pong: Pong, *, at: float) -> None:
        """Take an answer that came at a local time [s]."""
        at = self._heard = max(at, self._heard)
        if not (pong.t <= at and pong.received <= pong.answered):
            return
        trip = RoundTrip(pong.t, pong.received, pong.answered, at)
        if not self.is_known:
            self._trips.append(trip)
            if len(self._trips) < FIRST_PONGS and trip.delay > SHORT:
                return
            trip = min(self._trips, key=lambda trip: trip.delay)
        self._sync.receive(trip)

    def asked(self) -> Ping | None:
        """What to ask now; None for nothing."""
        now = self._local.now()
        if now < self._due:
            return None
        self._pings += 1
        self._due = now + (QUICK if self._pings < FIRST_PINGS else SLOW)
        return Ping(self._pings, now)


class MirroredJournal(Journal):
    """A journal of edits that another one has written: with its numbers, commands and names."""

    def __init__(self, robot: str, source: SegmentSource, clock: Clock, current: Callable[[], bool]) -> None:
        """Begin with the timeline as it's known.

        Args:
            robot: Name of its model.
            source: What follows the timeline, and has it whole.
            clock: Session time.
            current: Whether it's heard of.
        """
        engine = SimpleNamespace(
            timeline=source.timeline, clock=clock, now=clock.now, model=SimpleNamespace(name=robot), receipts=()
        )
        self._source, self._current = source, current
        super().__init__(cast("Any", engine))
        self.number = source.edit
        self._add_names()

    @property
    @override
    def past(self) -> float:
        return self._source.past

    @property
    @override
    def is_current(self) -> bool:
        return self._current()

    @override
    def look(self) -> int:
        return self.number

    @override
    def carry_out(self, order: Order, *, now: float) -> Outcome:
        return Outcome(order.number, now, None, "a relay carries out nothing")

    def adopt(self, timeline: Timeline, number: int, change: Change | None) -> None:
        """Go on with another timeline; see `SegmentSource`."""
        engine: Any = self.engine
        if change is None:
            # What lies between isn't known.
            self.edits.clear()
            self._add_names()
        elif change.name is not None:
            self.names.append(change.name)
        by = (None, None) if change is None else (change.command_id, change.name)
        edit = TimelineEdit(number, engine.timeline, timeline, by[0], self._source.past, (), by[1])
        self.edits.append(edit)
        engine.timeline, self.number = timeline, number

    def _add_names(self) -> None:
        scene = self._source.scene
        self.names.clear()
        self.names.extend(() if scene is None else scene.names)


class MirroredSite(Site):
    """The site of a robot that is served elsewhere."""

    def __init__(self, welcome: Welcomed, journal: MirroredJournal | None) -> None:
        """Serve what is known of it.

        Args:
            welcome: What the hub says to who comes in.
            journal: Of its timeline; None of a mobile robot.
        """
        self._welcome = welcome
        engine = SimpleNamespace(model=SimpleNamespace(name=welcome.robot))
        super().__init__(cast("Any", SimpleNamespace(engine=engine)) if journal is None else journal)

    @override
    def welcome(self, **facts: Any) -> Welcomed:
        return msgspec.structs.replace(self._welcome, **facts)


class Mirror:
    """One hub as a relay has it. Times are this machine's unless it's said otherwise."""

    def __init__(self, facts: bytes, local: Clock, nodes: Nodes) -> None:
        """Begin with what a hub says of itself.

        Args:
            facts: `HubFacts` as they came.
            local: This machine's clock.
            nodes: Takes the scene.

        Raises:
            ProtocolError: If they aren't such.
        """
        self.facts = unpacked(facts, HubFacts)
        self.welcome: Welcomed = decode(
            self.facts.welcome, Encoding.MSGPACK, allowed=Welcome | MobileWelcome, largest=FROM_SERVER
        )
        self.clock = SessionClock(local)
        """Session time."""
        self.site: MirroredSite | None = None
        """What is served; None until all is known."""
        self.told: list[Told] = []
        """News and leases that came since this was emptied."""
        self.heard = local.now()
        """When anything was heard last [s]."""
        self.bad = 0
        """Values that couldn't be taken."""
        self._local, self._nodes = local, nodes
        self._port = RemotePort()
        self._source = SegmentSource(self._port, resend=RESEND, applied=self._applied)
        self._port.join(self._source)
        self._journal: MirroredJournal | None = None
        self._scene, self._scene_gaps, self._scene_lacks, self._has_news = 0, 0, False, False
        self._due = -math.inf

    @property
    def gaps(self) -> int:
        """How often something was missing, and asked for."""
        return self._source.gaps + self._scene_gaps

    @property
    def is_current(self) -> bool:
        """Whether the hub is heard."""
        return self._local.now() < self.heard + CURRENT

    def receive(self, kind: str, data: bytes, *, at: float) -> None:
        """Take what was published or answered; what is no such thing is counted and passed over.

        Args:
            kind: Last part of its key.
            data: The value.
            at: When it came [s].
        """
        try:
            self._take(kind, data, at)
        except ProtocolError:
            self.bad += 1
            return
        # A hub that hangs tells the time still; of a mobile robot at rest nothing else comes.
        if kind != "clock" or isinstance(self.welcome, MobileWelcome):
            self.heard = max(self.heard, at)

    def _take(self, kind: str, data: bytes, at: float) -> None:
        if kind == "clock":
            self.clock.receive(decode(data, Encoding.MSGPACK, allowed=Pong), at=at)
        elif kind == "scene":
            self._show(unpacked(data, SceneValues))
        elif kind == "timeline":
            message = decode(data, Encoding.MSGPACK, allowed=_TIMELINE, largest=FROM_SERVER)
            if self.clock.is_known:
                self._port.receive(message, now=self.clock.now())
        elif kind != "facts":
            self.told.append(decode(data, Encoding.MSGPACK, allowed=Told, largest=FROM_SERVER))
            self._has_news |= kind == "news"

    def _show(self, scene: SceneValues) -> None:
        if scene.since > self._scene:
            if not self._scene_lacks:
                self._scene_lacks, self._due = True, -math.inf
                self._scene_gaps += 1
            return
        if scene.version > self._scene:
            for key, data in scene.values:
                self._nodes.put(key, data)
            self._nodes.wake()
            self._scene, self._scene_lacks = scene.version, False

    def _applied(self, timeline: Timeline, number: int, change: Change | None) -> None:
        if self._journal is not None:
            self._journal.adopt(timeline, number, change)

    def look(self) -> None:
        """Somebody looks at the scene from now on: it's to be fetched as a whole."""
        self._scene_lacks, self._due = True, -math.inf

    def advance(self) -> tuple[Asked, ...]:
        """What is to be asked for now."""
        asked: list[Asked] = []
        ping = self.clock.asked()
        if ping is not None:
            asked.append(("clock", encode(ping, Encoding.MSGPACK)))
        if not self.clock.is_known:
            return tuple(asked)
        now = self.clock.now()
        if isinstance(self.welcome, Welcome):
            self._source.advance(now=now)
            asked += (("timeline", encode(message, Encoding.MSGPACK)) for message in self._port.advance(now=now))
        if self._local.now() >= self._due and (self._scene_lacks or not self._has_news):
            self._due = self._local.now() + 4 * RESEND
            asked += [
                (kind, b"") for kind, lacks in (("scene", self._scene_lacks), ("news", not self._has_news)) if lacks
            ]
        if self.site is None:
            self._begin()
        return tuple(asked)

    def _begin(self) -> None:
        """Serve, once all is known."""
        if not self._has_news:
            return
        if isinstance(self.welcome, Welcome):
            if self._source.timeline is None:
                return
            self._journal = MirroredJournal(self.welcome.robot, self._source, self.clock, lambda: self.is_current)
        self.site = MirroredSite(self.welcome, self._journal)


def unpacked(data: bytes, kind: type[Any]) -> Any:
    """A value as msgpack.

    Raises:
        ProtocolError: If it's none of that kind.
    """
    try:
        return msgspec.msgpack.decode(data, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ProtocolError(control.ProblemCode.MALFORMED, str(error)) from None
