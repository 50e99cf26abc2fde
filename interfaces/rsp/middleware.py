"""The local middleware around a `LocalCore`: Robot Environment data buffer and Robot Device Manager.

Any thread may call it; whoever runs the link calls `Middleware.advance`. Listeners are called by that thread, after
the lock is given back.

Source: Kim, Suh, Kim, Oh, Fig. 2.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

from interfaces.rsp.handshake import SessionRefusal
from interfaces.rsp.layout import Layout
from interfaces.rsp.local import LocalCore, LocalState
from interfaces.rsp.outbox import DeliveryOutcome, Settled
from interfaces.rsp.outputs import Began, EndReason, LocalOutput, Occurred, Refused, SessionEnded, Stored, Told
from vrs.checks import finite
from vrs.clock import Clock

_MOST_KEPT: Final = 256
"""Events and memory events that wait for somebody to fetch them, of an element; the oldest go."""
_MOST_OUTCOMES: Final = 8192
_LOG: Final = logging.getLogger(__name__)


class Middleware:
    """What all devices of one robot share."""

    def __init__(self, core: LocalCore, clock: Clock) -> None:
        """Take the core, and the clock of its times."""
        self.core, self.clock, self.model = core, clock, core.model
        self.layout: Layout = core.layout
        self.changed = threading.Condition(threading.RLock())
        """Guards the core, and is notified whenever something came."""
        self.refused: SessionRefusal | None = None
        """Why the robot gave no session, the last time."""
        self.ended: EndReason | None = None
        """Why the last session ended."""
        self._told: dict[int, tuple[int, bytes]] = {}
        """How often what sensors and monitors say has changed, as the robot repeats it; and the newest payload."""
        self._came: dict[int, deque[bytes]] = {}
        self._listeners: dict[int, list[Callable[[bytes], None]]] = {}
        self._outcomes: dict[tuple[int, int], DeliveryOutcome] = {}

    def advance(self, datagrams: Sequence[bytes], *, now: float) -> list[bytes]:
        """Take what came, and return what is to be sent, as of now [s]."""
        with self.changed:
            for data in datagrams:
                self.core.receive(data, now=now)
            sent = self.core.to_send(now=now)
            outputs = self.core.take()
            calls = [call for output in outputs for call in self._note(output)]
            if outputs:
                self.changed.notify_all()
        for listener, payload in calls:
            try:
                listener(payload)
            except Exception:  # noqa: BLE001 - somebody else's code; the link goes on
                _LOG.exception("a listener of %s failed", self.model.name)
        return sent

    def wait_for(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until a condition holds, but no longer than a time [s]; returns whether it does."""
        with self.changed:
            return self.changed.wait_for(condition, finite("timeout", timeout, "finite seconds"))

    @property
    def is_open(self) -> bool:
        """Whether there is a session."""
        return self.core.state is LocalState.OPEN

    def payload(self, index: int) -> tuple[int, bytes | None]:
        """How often what a sensor or monitor says has changed, and what it said last."""
        with self.changed:
            return self._told.get(index, (0, None))

    def came(self, index: int) -> bytes | None:
        """The oldest event or memory event that nobody fetched."""
        with self.changed:
            waiting = self._came.get(index)
            return waiting.popleft() if waiting else None

    def outcome(self, index: int, number: int) -> DeliveryOutcome | None:
        """What became of a command or memory command; None while nobody knows."""
        with self.changed:
            return self._outcomes.get((index, number))

    def listen(self, index: int, listener: Callable[[bytes], None]) -> Callable[[], None]:
        """Let something be called with each payload of an element; returns what ends that."""
        with self.changed:
            self._listeners.setdefault(index, []).append(listener)

        def end() -> None:
            with self.changed:
                if listener in self._listeners[index]:
                    self._listeners[index].remove(listener)

        return end

    def _note(self, output: LocalOutput) -> list[tuple[Callable[[bytes], None], bytes]]:
        """Keep what happened; returns the listeners to be called, with what."""
        match output:
            case Told(index=index, payload=payload):
                count, before = self._told.get(index, (0, None))
                self._told[index] = count + (payload != before), payload
            case Occurred(index=index, payload=payload) | Stored(index=index, data=payload):
                self._came.setdefault(index, deque(maxlen=_MOST_KEPT)).append(payload)
            case Settled(index=index, id=number, outcome=outcome):
                self._outcomes[index, number] = outcome
                if len(self._outcomes) > _MOST_OUTCOMES:
                    del self._outcomes[next(iter(self._outcomes))]
                return []
            case Refused(reason=refusal):
                self.refused = refusal
                return []
            case SessionEnded(reason=reason):
                self.ended = reason
                return []
            case Began():
                self._told.clear()
                self._outcomes.clear()
                return []
        return [(listener, payload) for listener in tuple(self._listeners.get(index, ()))]
