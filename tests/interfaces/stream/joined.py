"""A hub and client cores joined in memory, in virtual time, by ways that lose nothing."""

from __future__ import annotations

from interfaces.stream.client import ClientCore, Phase
from interfaces.stream.codec import Encoding
from tests.interfaces.stream.served import make_hub

STEP = 0.005


class Joined:
    """A hub, and clients with connections that can be cut; local clocks run ahead of the session's."""

    def __init__(self, **options) -> None:
        self.hub = make_hub(**options)
        self.now = 0.0
        self.clients: dict[ClientCore, object] = {}
        self.parts: dict[ClientCore, list] = {}
        self.ahead: dict[ClientCore, float] = {}
        self.closed: dict[ClientCore, tuple] = {}

    def client(self, *parts, ahead: float = 100.0, **options) -> ClientCore:
        core = ClientCore(**options)
        self.clients[core] = None
        self.parts[core], self.ahead[core] = list(parts), ahead
        self.plug(core)
        return core

    def plug(self, core: ClientCore) -> None:
        self.clients[core] = self.hub.open(core.encoding, now=self.now)
        core.connected(now=self.now + self.ahead[core])

    def cut(self, core: ClientCore, *, told: bool = True) -> None:
        session, self.clients[core] = self.clients[core], None
        if told:
            self.hub.leave(session, done=False, now=self.now)
        core.disconnected()

    def turn(self) -> None:
        for core, session in self.clients.items():
            local = self.now + self.ahead[core]
            t = core.time(local)
            if core.phase is Phase.OPEN:
                for part in self.parts[core]:
                    part.advance(now=t)
            for data in core.advance(now=local):
                if session is not None:
                    session.receive(data.decode() if core.encoding is Encoding.JSON else data, now=self.now)
        self.hub.advance(now=self.now)
        for core, session in self.clients.items():
            if session is None:
                continue
            for data in session.advance(now=self.now):
                core.receive(data, now=self.now + self.ahead[core])
            if session.closing is not None:
                self.closed[core] = session.closing
                self.cut(core)

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.turn()
            self.now += STEP
        self.turn()

    def time(self, core: ClientCore) -> float:
        t = core.time(self.now + self.ahead[core])
        assert t is not None
        return t

    def wish(self, core: ClientCore, kind, *, epoch=None):
        """Ask something of the lease; the answer after a while."""

        leased = epoch is None and hasattr(kind, "epoch")

        def make(number):
            return kind(number, epoch or core.epoch) if epoch or leased else kind(number)

        number = core.wish(make, now=self.now + self.ahead[core], leased=leased)
        self.run(0.05)
        return core.answer(number)
