"""What publishes a hub: it looks at it as a client does, and sends what it sees once for all relays."""

from __future__ import annotations

import asyncio
import contextlib
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from typing import Any, Final

import msgspec
from typing_extensions import override

from interfaces.engine_server.servlet import Servlet
from interfaces.messages import Change, Follow, Pulse, ViewForm, Want
from interfaces.messages.control import Ping, Pong, Role
from interfaces.messages.relaying import HubFacts, SceneValues
from interfaces.relay.network import Network
from interfaces.runtime.live.devices import OperatorDevice
from interfaces.stream.codec import Encoding, decode, encode
from interfaces.stream.hub import Hub
from interfaces.stream.leasing import SessionState
from interfaces.stream.meshcat.newest import Newest, ReaderPosition
from interfaces.timer import Turning
from vrs.clock import Clock

MOST_RELAYS: Final = 64
"""Relays whose place in the timeline is kept; the one that asked least lately is forgotten first."""
LOOK: Final = 0.5
"""So often it's looked whether somebody sees the scene [s]."""


class Publisher(OperatorDevice):
    """Publishes a hub's timeline, news, lease and scene, and answers who comes later. It takes no order."""

    name = "relays"

    def __init__(
        self,
        hub: Hub,
        clock: Clock,
        scene: Newest,
        network: Network,
        *,
        key: str,
        page: Mapping[str, Any],
        address: str,
    ) -> None:
        """Without a network.

        Args:
            hub: Whose.
            clock: Session time.
            scene: What its viewers see.
            network: To be opened.
            key: See `network.prefix`.
            page: What pages are told of the robot.
            address: Of the hub's page.
        """
        self._hub, self._clock, self._scene, self._network = hub, clock, scene, network
        self._key, self._page, self._address = key, page, address
        self._instance = hub.config.instance
        self._viewer = SessionState("", "relays", Role.VIEWER, local=True)
        self._servlet = hub.site.servlet()
        self._asking: OrderedDict[str, Servlet] = OrderedDict()
        self._lease, self._news = -1, 0
        self._place: ReaderPosition | None = None
        self._shown = 0
        self.turning = Turning(clock, self._turn, longest=LOOK)
        """Publishes what is new."""
        self._watched: Callable[[], bool] = lambda: False
        self.published = 0
        """Values that were published."""

    @contextlib.asynccontextmanager
    @override
    async def running(self) -> AsyncIterator[Publisher]:
        opening = asyncio.create_task(self._begin())
        try:
            yield self
        finally:
            self.turning.stop()
            opening.cancel()
            await asyncio.gather(opening, return_exceptions=True)
            self._leave_scene()
            await self._network.close()

    async def _begin(self) -> None:
        network, key, instance = self._network, self._key, self._instance
        await network.open()
        hub = self._hub
        if self._servlet.timeline is not None:
            t = hub.engine_time(self._clock.now())
            self._servlet.receive(Follow(1, ViewForm.SEGMENTS), now=t)
            network.answer(f"{key}/timeline", instance, self._tell_timeline)
        network.answer(f"{key}/clock", instance, self._tell_time, at_once=True)
        network.answer(f"{key}/facts", instance, lambda *_: (self._facts(),))
        network.answer(f"{key}/news", instance, lambda *_: map(self._encoded, self._all_news()))
        network.answer(f"{key}/view/scene", instance, lambda *_: (self._scene_since(0),))
        self._watched = network.is_heard(f"{key}/view/scene")
        network.announce(f"{key}/hub/{instance}")
        self.turning.start()

    @override
    def turn(self) -> None:
        self.turning.soon()

    @override
    def health(self) -> dict[str, Any]:
        facts = {"published": self.published, "failures": self._network.failures}
        return {"connected": self._network.connected, "scene": self._place is not None, **facts}

    def _turn(self, now: float) -> float | None:
        """Publish what is new."""
        hub = self._hub
        t = hub.engine_time(now)
        for reply in self._servlet.advance(now=t):
            # What is too long for one change is asked for: its number is in the next pulse.
            if isinstance(reply, Change | Pulse):
                self._put("timeline", self._encoded(reply))
        if hub.leasing.version != self._lease:
            self._lease = hub.leasing.version
            self._put("lease", self._encoded(hub.leasing.seen_by(self._viewer)))
        if hub.news_version != self._news:
            for version, news in hub.news.values():
                if version > self._news:
                    self._put(str(news.__struct_config__.tag), self._encoded(news))
            self._news = hub.news_version
        if self._watched() is (self._place is None):
            self._leave_scene() if self._place is not None else self._join_scene()
        deadline = self._servlet.next_deadline()
        return None if deadline is None else deadline - hub.site.D

    def _put(self, kind: str, data: bytes, *, bulk: bool = False) -> None:
        self._network.put(f"{self._key}/{kind}", data, self._instance, bulk=bulk)
        self.published += 1

    def _encoded(self, message: Any) -> bytes:
        return self._hub.encoder.encode(message, Encoding.MSGPACK)

    def _all_news(self) -> Iterable[Any]:
        return (self._hub.leasing.seen_by(self._viewer), *(news for _, news in self._hub.news.values()))

    def _facts(self) -> bytes:
        hub, config = self._hub, self._hub.config
        welcome = hub.site.welcome(
            session="", role=Role.VIEWER, now=self._clock.now(), lease=hub.leasing.seen_by(self._viewer),
            resumed=False, instance=config.instance, server=config.server,
            lease_timeout=hub.leasing.lease.config.timeout,
        )  # fmt: skip
        return msgspec.msgpack.encode(HubFacts(encode(welcome, Encoding.MSGPACK), dict(self._page), self._address))

    def _tell_time(self, _: str, data: bytes) -> Iterable[bytes]:
        received = self._clock.now()
        ping = decode(data, Encoding.MSGPACK, allowed=Ping)
        return (encode(Pong(ping.number, ping.t, received, self._clock.now()), Encoding.MSGPACK),)

    def _tell_timeline(self, who: str, data: bytes) -> Iterable[bytes]:
        """What a relay lacks of the timeline; each has a place of its own in it."""
        servlet = self._asking.pop(who, None) or self._hub.site.servlet()
        self._asking[who] = servlet
        if len(self._asking) > MOST_RELAYS:
            self._asking.popitem(last=False)
        t = self._hub.engine_time(self._clock.now())
        servlet.receive(decode(data, Encoding.MSGPACK, allowed=Follow | Want), now=t)
        return map(self._encoded, servlet.advance(now=t))

    def _join_scene(self) -> None:
        loop = asyncio.get_running_loop()

        def changed() -> None:
            loop.call_soon(self._draw)

        self._place = self._scene.join(changed)

    def _leave_scene(self) -> None:
        if self._place is not None:
            self._scene.leave(self._place)
        self._place = None

    def _draw(self) -> None:
        """Publish what has changed in the scene."""
        if self._place is not None and self._scene.version > self._shown:
            self._put("view/scene", self._scene_since(self._shown), bulk=True)
            self._shown = self._scene.version

    def _scene_since(self, version: int) -> bytes:
        entries = tuple(self._scene.entries(version))
        return msgspec.msgpack.encode(SceneValues(version, self._scene.version, entries))
