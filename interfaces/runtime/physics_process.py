"""The process that runs a body at each tick: `python -m interfaces.runtime.physics_process DESCRIPTOR`.

It ends when its parent does: its socket then says so, or the operating system gives it another parent.
"""

from __future__ import annotations

import gc
import os
import socket
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Event

from interfaces.pipes import MessageSocket
from interfaces.runtime.physics_messages import (
    MESSAGE_MOST,
    Measurement,
    News,
    PhysicsSetup,
    decode_order,
    encode,
)
from interfaces.runtime.tick_loop import Moved, TickLoop
from interfaces.system import hasten
from robots.bullet.grasping import GraspingArm, grasping
from robots.robot import IDEAL, ArmBody, Prepared, exact_arm, load
from vrs.clock import WallClock
from vrs.errors import FormatError
from vrs.model import Array

_SETUP_TIME = 10.0
"""How long to wait for the first message [s]."""
_LOOK = 0.1
"""How often it's looked who the parent is [s]."""
_LAST_WORDS = 0.2
"""How long the last message may take [s]."""
_UNSENT_MOST = 64
"""Most messages that wait until the parent reads."""


class BodyTicks:
    """An arm's body, a tick at a time."""

    def __init__(self, arm: ArmBody) -> None:
        self.arm = arm
        self.hand = arm if isinstance(arm, GraspingArm) else None
        """Its hand; None where it has none that grasps."""

    def prepare(self, rows: Array) -> Sequence[Prepared]:
        """Work out the feed-forward."""
        prepared = self.arm.prepare(*rows.transpose(1, 0, 2))
        return [prepared.row(i) for i in range(len(rows))]

    def step(self, prepared: Prepared) -> Moved:
        """Let the servo and the physics act for a tick."""
        measured = self.arm.follow(prepared)
        return Moved(measured.q[0].tolist(), measured.qd[0].tolist(), measured.tau[0].tolist())

    def attach(self, mass: float) -> None:
        """Take a load that the servo doesn't know."""
        self.arm.attach(mass)

    def release(self) -> None:
        """Drop the load."""
        self.arm.release()


@contextmanager
def tick_body(setup: PhysicsSetup) -> Iterator[BodyTicks]:
    """Make the body that the parent wants."""
    make = exact_arm if setup.body == IDEAL else load(setup.robot).body(setup.body)
    if setup.scene is not None:
        make = grasping(make, load(setup.robot), setup.scene)
    with make(setup.q, friction=setup.friction, dt=setup.tick) as arm:
        yield BodyTicks(arm)


class ParentSocket:
    """The socket to the parent; nothing waits for it."""

    def __init__(self, connection: MessageSocket, process: int) -> None:
        self._socket, self.process = connection, process
        self._come: deque[bytes] = deque()
        self.unsent: deque[News] = deque(maxlen=_UNSENT_MOST)
        self.gone = False

    def wait(self, seconds: float) -> bytes | None:
        """Wait for a message, no longer than this [s]; None if there's none."""
        if not self._come and self.gone:
            Event().wait(max(seconds, 0.0))
        elif not self._come and self._socket.wait(seconds):
            self._come.extend(self._socket.receive())
            self.gone = self._socket.ended
        return self._come.popleft() if self._come else None

    def tell(self, news: list[News]) -> None:
        """Send what there is; of what doesn't fit only the measurements are lost."""
        self.unsent.extend(news)
        while self.unsent and not self.gone:
            message = self.unsent.popleft()
            if not self._socket.send(encode(message)):
                self.gone = self.gone or self._socket.ended
                kept = [m for m in (message, *self.unsent) if not isinstance(m, Measurement)]
                self.unsent = deque(kept, maxlen=_UNSENT_MOST)
                return

    def look(self) -> None:
        """Notice that the parent has ended, even if somebody else has inherited its end of the socket."""
        self.gone = self.gone or os.getppid() != self.process


def run(connection: socket.socket) -> int:
    """Run the body until the parent has ended or says so, and it rests.

    Args:
        connection: To the parent; its first message is the setup.

    Returns:
        The exit status: 0, 1 if the body failed, 2 if there was no setup.
    """
    messages = MessageSocket(connection, MESSAGE_MOST)
    parent, since, data = ParentSocket(messages, os.getppid()), WallClock(), None
    while data is None and not parent.gone and since.now() < _SETUP_TIME:
        data = parent.wait(_SETUP_TIME - since.now())
    try:
        setup = None if data is None else decode_order(data)
    except FormatError:
        return 2
    if not isinstance(setup, PhysicsSetup):
        return 2
    clock, parent.process = WallClock.since(setup.origin), setup.parent
    with tick_body(setup) as body:
        realtime = hasten(2)
        # What is there now stays: the collector needn't look through it again and again between two ticks.
        gc.collect()
        gc.freeze()
        loop = TickLoop(
            body,
            setup.joint_limits(),
            setup.q,
            tick=setup.tick,
            every=setup.every,
            now=clock.now(),
            realtime=realtime,
            prismatic=setup.prismatic,
            hand=body.hand,
        )
        _tick(loop, parent, clock)
    messages.flush(_LAST_WORDS)
    parent.tell(loop.take())
    messages.flush(_LAST_WORDS)
    return 1 if loop.failed else 0


def _tick(loop: TickLoop, parent: ParentSocket, clock: WallClock) -> None:
    look = clock.now()
    while not loop.finished:
        data = parent.wait(loop.next_deadline() - clock.now())
        if data is not None:
            try:
                loop.receive(decode_order(data))
            except FormatError as problem:
                loop.refuse(str(problem))
        now = clock.now()
        if now >= look:
            look = now + _LOOK
            parent.look()
        if parent.gone:
            loop.leave()
        loop.advance(now=now)
        if not loop.finished:
            parent.tell(loop.take())


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as _connection:
        _status = run(_connection)
    # Nothing is left to tidy up, and the Toolbox's extensions would write what they leak to the terminal.
    os._exit(_status)
