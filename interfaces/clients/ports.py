"""Ports: by which clients reach an engine, here or elsewhere. A client sees no difference but the delay."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import OrderedDict, deque
from typing import Any, Generic, Protocol, TypeVar

from interfaces.engine_server.site import Site, earliest
from interfaces.link.delivery import Resending
from interfaces.link.link import Channel
from interfaces.messages import Reply, Request
from vrs.engine import Engine

REMEMBERED = 4096
"""Answers that a client keeps; the oldest is forgotten first."""

OUTBOX = 1024
"""Requests that wait to be sent; the oldest is dropped first, and sent again by the client."""


class Client(Protocol):
    """What takes replies."""

    def receive(self, message: Reply, *, now: float) -> None:
        """Take a reply at the user's time now [s]; those for others are passed over."""


class RemotePort:
    """The client's end of a connection: a transport takes what is sent by it, and brings what arrives."""

    def __init__(self) -> None:
        self._clients: tuple[Client, ...] = ()
        self._outbox: deque[Request] = deque(maxlen=OUTBOX)
        self._number = self._order_number = 0

    def join(self, client: Client) -> None:
        """Let a client have every reply."""
        self._clients = (*self._clients, client)

    def leave(self, client: Client) -> None:
        """Let it have none any more."""
        self._clients = tuple(other for other in self._clients if other is not client)

    def number(self) -> int:
        """A new number for a question, or for following."""
        self._number += 1
        return self._number

    def order_number(self) -> int:
        """A new number for an order; they follow each other without a gap."""
        self._order_number += 1
        return self._order_number

    def send(self, message: Request, *, now: float) -> None:  # noqa: ARG002 - a transport has its own time
        """Put a request on its way at the user's time now [s]."""
        self._outbox.append(message)

    def receive(self, message: Reply, *, now: float) -> None:
        """Take a reply that arrives at the user's time now [s]."""
        for client in self._clients:
            client.receive(message, now=now)

    def advance(self, *, now: float) -> tuple[Request, ...]:  # noqa: ARG002 - what waits is due
        """What is to be sent."""
        requests = tuple(self._outbox)
        self._outbox.clear()
        return requests

    def next_deadline(self) -> float | None:
        """−∞ where something is to be sent, else None."""
        return float("-inf") if self._outbox else None


class LocalPort(RemotePort):
    """A port to an engine in this process: what it answers, it answers at once."""

    def __init__(self, engine: Engine | Site, *, lead: float = 0.0) -> None:
        """Reach an engine, or the site that others reach too.

        Args:
            engine: The engine, or its site.
            lead: How far ahead of the engine's time answers to questions without a time are [s].
        """
        super().__init__()
        self.site = engine if isinstance(engine, Site) else Site(engine)
        self.servlet = self.site.servlet(lead=lead)

    def send(self, message: Request, *, now: float) -> None:
        """Let the engine have a request now."""
        self.servlet.receive(message, now=self.site.time(now))
        self.advance(now=now)

    def advance(self, *, now: float) -> tuple[Request, ...]:
        """Bring what has come of itself, as frames and changes do; nothing is to be sent."""
        for reply in self.servlet.advance(now=self.site.time(now)):
            self.receive(reply, now=now)
        return ()

    def next_deadline(self) -> float | None:
        """When something comes of itself [s]."""
        t = self.servlet.next_deadline()
        return None if t is None else t - self.site.D


def port_to(engine: RemotePort | Engine) -> tuple[RemotePort, LocalPort | None]:
    """The port itself, or one to an engine in this process, which whoever made it advances."""
    if isinstance(engine, Engine):
        own = LocalPort(engine)
        return own, own
    return engine, None


M = TypeVar("M", bound=Request)
T = TypeVar("T")


class Asking(ABC, Generic[M, T]):
    """What sends requests by a port, each again until it's answered, and keeps what it heard, by number."""

    def __init__(self, engine: RemotePort | Engine, resend: float) -> None:
        """Reach an engine.

        Args:
            engine: A port, or an engine in this process.
            resend: After how long without an answer a request is sent again [s], at first; longer and longer then.
        """
        self._port, self._own = port_to(engine)
        self._port.join(self)
        self._open: Resending[M] = Resending(resend)
        self._kept: OrderedDict[int, T] = OrderedDict()
        self._news: OrderedDict[int, None] = OrderedDict()

    @abstractmethod
    def receive(self, message: Reply, *, now: float) -> None:
        """Take a reply at the user's time now [s]; those for others are passed over."""

    def _keep(self, number: int, known: T, *, news: bool = True) -> None:
        """Keep what is known of a request, and tell of it at the next `advance` where it's news."""
        self._kept[number] = known
        if news:
            self._news[number] = None
        for kept in (self._kept, self._news):
            if len(kept) > REMEMBERED:
                kept.popitem(last=False)

    def advance(self, *, now: float) -> tuple[T, ...]:
        """Send again what has no answer; what was heard since the last call."""
        if self._own is not None:
            self._own.advance(now=now)
        for request in self._open.due(now):
            self._port.send(request, now=now)
        news = tuple(self._kept[number] for number in self._news if number in self._kept)
        self._news.clear()
        return news

    def next_deadline(self) -> float | None:
        """When something is sent again [s]; −∞ where something was heard, None for nothing to do."""
        if self._news:
            return -math.inf
        return earliest(self._open.next_deadline(), None if self._own is None else self._own.next_deadline())

    def close(self) -> None:
        """Listen no more."""
        self._port.leave(self)


class MemoryTransport:
    """A remote port and the servlet at a site, joined by two directions of an emulated link.

    Args:
        site: Where the engine is.
        forward: The way there.
        backward: The way back.
        lead: How far ahead of the engine's time answers to questions without a time are [s].
        most: Packets on the way back beyond which nothing more is sent: frames then wait in their slot, where
            newer ones take their place.
    """

    def __init__(
        self, site: Site, forward: Channel[Any], backward: Channel[Any], *, lead: float = 0.0, most: int = 256
    ) -> None:
        self.port = RemotePort()
        self.servlet = site.servlet(lead=lead)
        self._site, self._forward, self._backward, self._most = site, forward, backward, most

    def advance(self, *, now: float) -> None:
        """Move what is due at the users' time now [s], in both directions."""
        for request in self.port.advance(now=now):
            self._forward.send(request, now)
        t = self._site.time(now)
        for delivery in self._forward.receive(now):
            self.servlet.receive(delivery.payload, now=t)
        if self._backward.in_flight() < self._most:
            for reply in self.servlet.advance(now=t):
                self._backward.send(reply, now)
        for delivery in self._backward.receive(now):
            self.port.receive(delivery.payload, now=now)

    def next_deadline(self) -> float | None:
        """When something arrives or is to be sent [s]."""
        t = self.servlet.next_deadline() if self._backward.in_flight() < self._most else None
        own = None if t is None else t - self._site.D
        ways = self._forward.next_deadline(), self._backward.next_deadline()
        return earliest(*ways, self.port.next_deadline(), own)
