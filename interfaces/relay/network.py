"""The Zenoh network between a hub and its relays: closed unless asked, and its threads kept out of the loop."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import quote

from interfaces.stream.codec import LARGEST
from interfaces.system import is_loopback
from vrs.clock import Clock
from vrs.errors import FormatError, InvalidValueError, VrsError

if TYPE_CHECKING:
    import zenoh

_ENDPOINT: Final = re.compile(r"(tcp|tls|quic)/(\[[0-9a-f:.]+\]|[a-z0-9_.-]+):([0-9]{1,5})", re.IGNORECASE)
LARGEST_VALUE: Final = 64 << 20
"""Longest that anything may be that comes by the network [B]."""
PATIENCE: Final = 2.0
"""So long an answer is waited for [s]; then it's asked for again."""
ATTEMPT: Final = 1.0
"""So long an attempt to connect may take, and so long it's waited between two [s]."""
MOST_QUERIES: Final = 64
"""Queries that are being answered at once; more aren't."""
SMALL_WAIT: Final = 100
"""So long what is published may wait for room in the queue [µs]; then it's dropped, and asked for again."""
TOLD: Final = 20
"""Failures of which the log tells."""

_LOG = logging.getLogger(__name__)


class NoZenohError(VrsError):
    """Zenoh isn't installed."""

    def __init__(self) -> None:
        super().__init__("relays need Zenoh: pip install 'vrs-teleop[zenoh]'")


@dataclass(frozen=True, slots=True)
class NetworkConfig:
    """How a session is connected. Nothing is discovered by multicast or gossip, and clients don't listen."""

    connect: tuple[str, ...] = ()
    """Endpoints of routers, as Zenoh spells them: `tcp/127.0.0.1:7447`."""
    listen: tuple[str, ...] = ()
    """Of a router: where others come."""
    file: Path | None = None
    """More of Zenoh's own configuration, JSON5: certificates, users; None for nothing."""

    def __post_init__(self) -> None:
        for endpoint in (*self.connect, *self.listen):
            found = _ENDPOINT.fullmatch(endpoint)
            if found is None or not 0 < int(found[3]) < 65536:
                raise InvalidValueError("zenoh", endpoint, "an endpoint, as tcp/127.0.0.1:7447 or tls/HOST:PORT")
            if found[1].lower() == "tcp" and not is_loopback(found[2].strip("[]")):
                raise InvalidValueError("zenoh", endpoint, "tls/ or quic/ off this machine; tcp/ is for loopback")

    def zenoh(self) -> zenoh.Config:
        """The same for Zenoh.

        Raises:
            NoZenohError: If it isn't installed.
            FormatError: If the file can't be used.
        """
        try:
            import zenoh
        except ImportError:
            raise NoZenohError from None
        try:
            config = zenoh.Config() if self.file is None else zenoh.Config.from_file(self.file)
        except zenoh.ZError as error:
            raise FormatError(f"Zenoh configuration {self.file}", str(error)) from None
        for key, value in {
            "mode": "router" if self.listen else "client",
            "connect/endpoints": self.connect,
            "connect/timeout_ms": int(1000 * ATTEMPT),
            "connect/exit_on_failure": not self.listen,
            "listen/endpoints": self.listen,
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": False,
            "adminspace/enabled": False,
            "transport/link/rx/max_message_size": LARGEST_VALUE,
            "transport/link/tx/queue/congestion_control/drop/wait_before_drop": SMALL_WAIT,
            "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": 10 * SMALL_WAIT,
        }.items():
            config.insert_json5(key, json.dumps(value))
        return config


def prefix(site: str, robot: str) -> str:
    """The key below which everything of a robot is: names are quoted as in addresses."""
    return f"vrs/{quote(site, safe='')}/{quote(robot, safe='')}"


class Network:
    """A session of a Zenoh network for an asyncio loop: what its threads hear is taken in the loop.

    What is heard is named by the last part of its key. Every value carries the instance of the hub that it's of.
    """

    def __init__(self, config: NetworkConfig, clock: Clock) -> None:
        """Without a session.

        Args:
            config: How to connect.
            clock: Tells when something came.

        Raises:
            NoZenohError, FormatError: See `NetworkConfig.zenoh`.
        """
        self.config, self._clock = config.zenoh(), clock
        self._session: zenoh.Session | None = None
        self._kept: list[Any] = []
        """What is declared: Zenoh forgets what nobody keeps."""
        self._answering: set[asyncio.Future[None]] = set()
        self.failures = 0
        """What Zenoh refused to do."""

    async def open(self) -> None:
        """Connect; it's tried until it's done."""
        import zenoh

        while self._session is None:
            try:
                self._session = await asyncio.to_thread(zenoh.open, self.config)
            except zenoh.ZError as error:
                self._failed(error)
                await asyncio.sleep(ATTEMPT)

    async def close(self) -> None:
        """End the session, and all that it has declared."""
        session, self._session = self._session, None
        self._kept.clear()
        if session is not None:
            await asyncio.to_thread(session.close)

    @property
    def connected(self) -> bool:
        """Whether there's a router."""
        return self._session is not None and bool(self._session.info.routers_zid())

    def _failed(self, error: Exception) -> None:
        self.failures += 1
        if self.failures <= TOLD:
            _LOG.warning("Zenoh: %s", str(error).partition(" at /")[0])

    def put(self, key: str, data: bytes, instance: str, *, bulk: bool = False) -> None:
        """Publish a value; without room for it it's dropped.

        Args:
            key: Its key.
            data: The value.
            instance: Of the hub.
            bulk: Whether it may wait for others.
        """
        import zenoh

        if self._session is None:
            return
        priority = zenoh.Priority.DATA_LOW if bulk else zenoh.Priority.INTERACTIVE_HIGH
        try:
            self._session.put(
                key, data, congestion_control=zenoh.CongestionControl.DROP, priority=priority, express=not bulk,
                attachment=instance.encode(),
            )  # fmt: skip
        except zenoh.ZError as error:
            self._failed(error)

    def is_heard(self, key: str) -> Callable[[], bool]:
        """What says whether somebody listens to a key."""
        assert self._session is not None
        publisher = self._session.declare_publisher(key)
        self._kept.append(publisher)
        return lambda: bool(publisher.matching_status.matching)

    def hear(self, key: str, instance: str, heard: Callable[[str, bytes, float], None]) -> Callable[[], None]:
        """Listen to what a hub publishes, until what is returned is called.

        Args:
            key: A key, or a pattern of keys.
            instance: Of the hub.
            heard: Is called in the loop with a key's last part, the value, and when it came.
        """
        assert self._session is not None
        subscriber = self._session.declare_subscriber(key, self._handler(instance, heard))

        def end() -> None:
            if self._session is not None:
                subscriber.undeclare()

        return end

    def ask(
        self, key: str, payload: bytes, instance: str, who: str, heard: Callable[[str, bytes, float], None]
    ) -> None:
        """Ask a hub; each answer is heard.

        Args:
            key: Of what is asked for.
            payload: What is asked.
            instance: Of the hub.
            who: Names the asker.
            heard: See `hear`.
        """
        import zenoh

        handler = self._handler(instance, heard)

        def replied(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                handler(reply.ok)

        if self._session is None:
            return
        try:
            self._session.get(
                f"{key}?instance={instance};who={who}", replied, payload=payload, timeout=PATIENCE,
                consolidation=zenoh.ConsolidationMode.NONE, priority=zenoh.Priority.INTERACTIVE_HIGH,
            )  # fmt: skip
        except zenoh.ZError as error:
            self._failed(error)

    def _handler(self, instance: str, heard: Callable[[str, bytes, float], None]) -> Callable[[zenoh.Sample], None]:
        loop, clock, mark = asyncio.get_running_loop(), self._clock, instance.encode()

        def handle(sample: zenoh.Sample) -> None:
            at = clock.now()
            if sample.attachment is None or sample.attachment.to_bytes() != mark:
                return
            kind = str(sample.key_expr).rpartition("/")[2]
            _in_loop(loop, heard, kind, sample.payload.to_bytes(), at)

        return handle

    def answer(
        self, key: str, instance: str, answer: Callable[[str, bytes], Iterable[bytes]], *, at_once: bool = False
    ) -> None:
        """Answer those who ask for a key and mean this hub.

        Args:
            key: The key.
            instance: Of the hub.
            answer: Makes the answers to who asks, and what; called in the loop.
            at_once: Call it in Zenoh's thread.
        """
        assert self._session is not None
        loop = asyncio.get_running_loop()

        def reply(query: zenoh.Query, answers: Sequence[bytes]) -> None:
            with query, contextlib.suppress(Exception):
                for data in answers:
                    query.reply(key, data, attachment=instance.encode())

        def begin(query: zenoh.Query, who: str, data: bytes) -> None:
            if len(self._answering) >= MOST_QUERIES:
                query.drop()
                return
            try:
                answers = tuple(answer(who, data))
            except Exception as error:  # noqa: BLE001 - whoever asks what can't be answered gets no answer
                self._failed(error)
                query.drop()
                return
            done = loop.run_in_executor(None, reply, query, answers)
            self._answering.add(done)
            done.add_done_callback(self._answering.discard)

        def asked(query: zenoh.Query) -> None:
            size = 0 if query.payload is None else len(query.payload)
            if query.parameters.get("instance") != instance or size > LARGEST:
                query.drop()
                return
            data = b"" if query.payload is None else query.payload.to_bytes()
            who = str(query.parameters.get("who", ""))[:100]
            if not at_once:
                _in_loop(loop, begin, query, who, data)
                return
            with contextlib.suppress(VrsError):
                reply(query, tuple(answer(who, data)))

        self._kept.append(self._session.declare_queryable(key, asked))

    def announce(self, key: str) -> None:
        """Be present under a key as long as there's a session."""
        assert self._session is not None
        self._kept.append(self._session.liveliness().declare_token(key))

    def watch(self, key: str, changed: Callable[[str, bool], None]) -> None:
        """Follow who is present.

        Args:
            key: A pattern of keys.
            changed: Is called in the loop with a key, and whether it's there.
        """
        import zenoh

        assert self._session is not None
        loop = asyncio.get_running_loop()

        def handle(sample: zenoh.Sample) -> None:
            _in_loop(loop, changed, str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._kept.append(self._session.liveliness().declare_subscriber(key, handle, history=True))


def _in_loop(loop: asyncio.AbstractEventLoop, function: Callable[..., None], *given: Any) -> None:
    """Call something in a loop, unless that has ended."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(function, *given)
