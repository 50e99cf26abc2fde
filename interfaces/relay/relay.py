"""A relay: it finds a hub on the network, mirrors it, and serves its page and its stream to viewers here."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final
from urllib.parse import quote, unquote, urlsplit

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Route, Router, WebSocketRoute
from starlette.types import Receive, Scope, Send
from typing_extensions import override

from interfaces.messages.control import MOST_RELAYS, Lease, Problem, ProblemCode, ProtocolError, Relays, Role
from interfaces.relay.mirror import Mirror
from interfaces.relay.network import Network
from interfaces.station.page import Station, station_files
from interfaces.station.panels import Offer, panels_of
from interfaces.stream.access import Access
from interfaces.stream.audit import AuditLog
from interfaces.stream.codec import Encoding, encode
from interfaces.stream.hub import RESTART, TRY_AGAIN, Hub, HubConfig
from interfaces.stream.leasing import LeasedRobot
from interfaces.stream.limits import ClientLimits
from interfaces.stream.meshcat.newest import Nodes
from interfaces.stream.meshcat.page import routes as view_routes
from interfaces.stream.server import HEADERS, Endpoint, HubServer, admit, health, may_see
from interfaces.stream.sockets import SocketLimits
from robots.onboard.lease import Ended, Grant
from robots.onboard.lease import Lease as RobotLease
from vrs.clock import WallClock

TURN: Final = 0.05
"""Time between two looks at what is to be asked for [s]."""
AGAIN: Final = 2.0
"""Time after which a hub that can't be relayed is tried again [s]."""
SILENCE: Final = 5.0
"""A hub that isn't heard for so long is gone [s]."""
MOST_VIEWERS: Final = 4096
"""Viewers of a relay."""
LIMITS: Final = ClientLimits(clients=MOST_VIEWERS, address=200.0, others=200.0)
"""Of its viewers: nobody commands here who'd be held up by all of them together."""
SOCKETS: Final = SocketLimits(strangers=MOST_VIEWERS, backlog=MOST_VIEWERS // 4)
"""Of its connections: when another relay ends, all of its viewers come at once."""
UNHEARD: Final = "the robot's server isn't heard"
_WAITING: Final = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><meta http-equiv="refresh" content="2">'
    "<title>VRS teleop</title><p>This relay doesn't hear the robot's server. This page tries again every 2 s.</p>"
)


class _NoRobot(LeasedRobot):
    """Nobody has control at a relay."""

    @property
    @override
    def met(self) -> bool:
        return True

    @override
    def began(self, grant: Grant, *, now: float) -> None: ...

    @override
    def ended(self, ended: Ended, *, now: float) -> None: ...

    @override
    def resume(self, epoch: int, *, now: float) -> str:
        return UNHEARD


@dataclass(frozen=True, slots=True)
class RelayConfig:
    """A relay."""

    site: str = "*"
    """Name of the site to relay; `*`: the first that's there."""
    robot: str = "*"
    """Name of its robot; `*`: the same."""
    page: str = ""
    """Address of this relay's page, for viewers of the others; empty: they aren't told."""
    server: str = "vrs"
    """Name and version of the program."""


class Relay:
    """An ASGI application, which serves whatever hub is there now. Enter `running` in its loop."""

    def __init__(
        self,
        config: RelayConfig,
        network: Network,
        access: Access,
        clock: WallClock,
        *,
        audit: AuditLog | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Serve nothing yet.

        Args:
            config: The relay.
            network: To be opened.
            access: Who may come in.
            clock: This machine's.
            audit: Where it's written who isn't let in.
            say: Is told what happens, for people.
        """
        self.config, self._network, self._access, self._clock = config, network, access, clock
        self._audit, self._say = audit, say
        self._who = secrets.token_hex(8)
        self.nodes = Nodes(MOST_VIEWERS)
        """The scene."""
        self._view = view_routes(self.nodes, authorize=partial(admit, access, Role.VIEWER))
        self._waiting = Router([
            Route("/health", self._say_unheard), WebSocketRoute("/ws", Endpoint(self._refuse)), station_files(),
            *self._view, Route("/", self._say_waiting),
        ])  # fmt: skip
        self._serving: Router = self._waiting
        self._key = ""
        self._present: dict[str, None] = {}
        """Instances of the hub that are there, the newest last."""
        self._others: dict[str, None] = {}
        """Addresses of the other relays' pages."""
        self._life: asyncio.Task[None] | None = None
        self.hub: Hub | None = None
        """What is served to viewers; None without a hub elsewhere."""
        self.mirror: Mirror | None = None
        """What is known of the hub; None without one."""
        self._stopping = False
        self.served = 0
        """Hubs so far, and how often one was silent."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer as the hub that is there would, as far as viewers are concerned."""
        await self._serving(scope, receive, send)

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[Relay]:
        """Find hubs, and serve them, meanwhile."""
        opening = asyncio.create_task(self._begin())
        try:
            yield self
        finally:
            self._stopping = True
            for task in (opening, self._life):
                if task is not None:
                    task.cancel()
                    await asyncio.gather(task, return_exceptions=True)
            await self._network.close()

    async def _begin(self) -> None:
        site, robot = (
            name if name == "*" else quote(name, safe="") for name in (self.config.site, self.config.robot)
        )
        await self._network.open()
        self._network.watch(f"vrs/{site}/{robot}/hub/*", self._noted_hub)

    def _noted_hub(self, key: str, there: bool) -> None:
        """A hub has come, or gone."""
        base, _, instance = key.rpartition("/hub/")
        if not self._key and there:
            self._key = base
            if self.config.page:
                self._network.announce(f"{base}/relay/{quote(self.config.page, safe='')}")
            self._network.watch(f"{base}/relay/*", self._noted_relay)
        if base != self._key:
            self._say(f"{unquote(base)} is there, too; it isn't relayed: --site and --robot name one")
            return
        self._present.pop(instance, None)
        if there:
            self._present[instance] = None
        current = next(reversed(self._present), None)
        serving = None if self.mirror is None else self.mirror.welcome.instance
        if current is None or current != serving:
            self._renew(current)

    def _noted_relay(self, key: str, there: bool) -> None:
        """Another relay has come, or gone."""
        page = unquote(key.rpartition("/")[2])
        own = urlsplit(self.config.page)
        if (
            page == self.config.page
            or len(page) > 200
            or urlsplit(page).scheme not in {"https", own.scheme or "http"}
        ):
            return
        self._others.pop(page, None)
        # Whoever is cut off from the network hasn't seen the others go.
        if there or not self._network.connected:
            self._others[page] = None
        if self.hub is not None:
            self.hub.tell(self._relays)

    @property
    def _relays(self) -> Relays:
        return Relays(tuple(list(self._others)[-MOST_RELAYS:]))

    def _renew(self, instance: str | None) -> None:
        """Begin anew with another hub, or with none."""
        if self._life is not None:
            self._life.cancel()
        self._life = None
        if instance is not None:
            self._life = asyncio.create_task(self._follow(instance))

    async def _follow(self, instance: str) -> None:
        """Mirror a hub and serve it, until this is cancelled or the hub is silent; then again."""
        while True:
            try:
                await self._mirror(instance)
            except ProtocolError as error:
                self._say(f"{unquote(self._key)} can't be relayed: {error}")
                await asyncio.sleep(AGAIN)

    async def _mirror(self, instance: str) -> None:
        network, key = self._network, self._key
        came: asyncio.Queue[tuple[str, bytes, float]] = asyncio.Queue()

        def ask(kind: str, payload: bytes = b"") -> None:
            network.ask(f"{key}/{kind}", payload, instance, self._who, lambda *heard: came.put_nowait(heard))

        facts = None
        while facts is None:
            ask("facts")
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(1.0):
                    while (heard := await came.get())[0] != "facts":
                        pass
                    facts = heard[1]
        mirror = self.mirror = Mirror(facts, self._clock, self.nodes)
        server: HubServer | None = None

        def take(kind: str, data: bytes, at: float) -> None:
            mirror.receive(kind, data, at=at)
            turn()

        def turn() -> None:
            if self.mirror is not mirror:
                return
            for kind, payload in mirror.advance():
                network.ask(
                    f"{key}/{'view/scene' if kind == 'scene' else kind}", payload, instance, self._who, take
                )
            if self.hub is not None and server is not None:
                self._pass_on(mirror, self.hub)
                server.kick()

        async with contextlib.AsyncExitStack() as stack:
            stack.callback(self._forget)
            stack.callback(network.hear(f"{key}/*", instance, take))
            looking = stack.enter_context(contextlib.ExitStack())
            looked = False
            while self._clock.now() < mirror.heard + SILENCE:
                # Only what somebody looks at is drawn, and sent.
                if looked is (self.nodes.readers == 0):
                    looked = not looked
                    looking.close()
                    if looked:
                        looking.callback(network.hear(f"{key}/view/scene", instance, take))
                        mirror.look()
                turn()
                if server is None and mirror.site is not None:
                    hub = self.hub = self._made(mirror)
                    server = HubServer(hub, mirror.clock, health=self._health)
                    await stack.enter_async_context(server.running())
                    stack.callback(self._end, hub)
                    self._serving = Router([*server.routes, *self._view, *self._station(mirror).routes])
                    self.served += 1
                    self._say(f"{unquote(key)} is relayed; control is to be had at {mirror.facts.address}")
                await asyncio.sleep(TURN)

    def _pass_on(self, mirror: Mirror, hub: Hub) -> None:
        """Tell viewers what is new."""
        told, mirror.told = mirror.told, []
        for news in told:
            if isinstance(news, Lease):
                hub.leasing.show(news)
            else:
                hub.tell(news)

    def _made(self, mirror: Mirror) -> Hub:
        """A hub of viewers."""
        assert mirror.site is not None
        welcome = mirror.welcome
        config = HubConfig(
            rates=getattr(welcome, "rates", ()), server=self.config.server, instance=welcome.instance,
            relays=mirror.facts.address, limits=LIMITS,
        )  # fmt: skip
        hub = Hub(mirror.site, RobotLease(), self._access, _NoRobot(), config=config, audit=self._audit)
        self._pass_on(mirror, hub)
        hub.tell(self._relays)
        return hub

    def _station(self, mirror: Mirror) -> Station:
        """The page for viewers."""
        page = mirror.facts.page
        offers = {Offer.ARCS, Offer.JOBS} if page.get("segments") == Offer.ARCS else {Offer.POLYNOMIALS}
        return Station(page, panels_of(offers, relayed=True), relays=mirror.facts.address)

    def _end(self, hub: Hub) -> None:
        """Serve nobody any more: who is here waits where the hub is gone, else goes to another relay."""
        self._serving = self._waiting
        gone = self._network.connected and not self._stopping
        text = UNHEARD if gone else "this relay stops" if self._stopping else "this relay has lost its network"
        self._say(text)
        for session in hub.sessions:
            session.close(RESTART, ProblemCode.UNHEARD if gone else ProblemCode.STOPPING, text)

    def _forget(self) -> None:
        self.hub = self.mirror = None

    def _health(self) -> dict[str, Any]:
        mirror = self.mirror
        assert mirror is not None
        return {
            "ok": mirror.is_current, "relays": mirror.facts.address, "others": list(self._others),
            "gaps": mirror.gaps, "bad": mirror.bad, "silent": self._clock.now() - mirror.heard, "hubs": self.served,
            "edit": mirror.site.look() if mirror.site is not None else 0,
        }  # fmt: skip

    async def _say_unheard(self, request: Request) -> Response:
        facts = {"ok": False, "problem": UNHEARD, "connected": self._network.connected}
        return health(facts, False, may_see(request, self._access, Role.VIEWER))

    async def _say_waiting(self, _: Request) -> Response:
        return HTMLResponse(_WAITING, 503, HEADERS)

    async def _refuse(self, encoding: Encoding, _scope: Scope, _receive: Receive, send: Send) -> None:
        """Tell a client why there's nothing here."""
        data = encode(Problem(ProblemCode.UNHEARD, UNHEARD, fatal=True), encoding)
        text = {"bytes": data} if encoding is Encoding.MSGPACK else {"text": data.decode()}
        await send({"type": "websocket.send", **text})
        await send({"type": "websocket.close", "code": TRY_AGAIN, "reason": UNHEARD})
