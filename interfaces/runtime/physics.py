"""A body in a process of its own, fed with references ahead of time, so that nothing here can delay a tick."""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Annotated, Protocol, Self, TypeAlias

import numpy as np

from interfaces.messages.control import Ping
from interfaces.messages.sites import Report
from interfaces.pipes import MessageSocket, start
from interfaces.runtime.physics_messages import (
    MESSAGE_MOST,
    ROWS_MOST,
    Attach,
    Close,
    Fault,
    Grips,
    Measurement,
    News,
    Order,
    PhysicsReady,
    PhysicsSetup,
    ReleaseLoad,
    Rows,
    decode_news,
    encode,
)
from interfaces.teleop import JointReference, RobotHost
from robots.bullet.grasping import fingered
from robots.robot import IDEAL, Robot, is_driver
from robots.things import Scene
from vrs.checks import finite_array, number_in, validated, within
from vrs.clock import WallClock
from vrs.errors import InvalidValueError, VrsError
from vrs.model import Array

TICK = 0.001
"""Length of a tick [s]."""
HORIZON = 0.5
"""How far ahead of a decision its rows reach [s], if the arm doesn't rest before."""
SILENCE = 0.2
"""Time without a report after which that is told [s]."""

_AHEAD = ROWS_MOST // 2
"""Most ticks ahead, and most that are given once more."""
_START_TIME = 60.0
"""How long the process may take to start [s]."""
_END_TIME = 2.0
"""How long it may take to come to rest and end [s]."""
_STATUS_TIME = 0.05
"""How long to wait for the exit status of a process that has closed its socket [s]."""


@dataclass(frozen=True, slots=True, eq=False)
@validated
class PhysicsConfig:
    """Which body, and where it stands."""

    robot: Robot
    """Whose; found by `robots.load`, unless the body is ideal."""
    q: Array
    """Where it stands [rad], of prismatic joints [m], (n,), within the limits."""
    body: str = ""
    """Which of its bodies; the usual one unless given."""
    friction: bool = True
    """Whether its joints have friction."""
    every: Annotated[int, within(1, 1000)] = 10
    """Ticks from one report to the next, in [1, 1000]."""
    scene: Scene | None = None
    """What is around it, of a robot whose gripper has fingers; None for nothing that it could grasp."""

    def __post_init__(self) -> None:
        limits = self.robot.arm.limits
        q = finite_array("q", self.q, (limits.dof,), f"finite joint values [rad], shape ({limits.dof},)")
        limits.check(q, self.robot.arm.prismatic)
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "body", self.robot.body_name(self.body))
        if self.scene is not None:
            fingered(self.robot)
            if is_driver(self.body):
                raise InvalidValueError("scene", self.body, "left out of a driver's body: hardware has its own")
        if (self.body != IDEAL or self.scene is not None) and not self.robot.found_by:
            raise InvalidValueError("robot", self.robot.name, "one that robots.load finds, as its process does")
        if isinstance(self.every, bool) or not isinstance(self.every, int):
            raise InvalidValueError("every", self.every, "a whole number in [1, 1000]")


@dataclass(frozen=True, slots=True)
class Silent:
    """The process has said nothing for a while: it stands still, or this machine is overloaded."""

    since: float
    """When it last did, by the robot's clock [s]."""


@dataclass(frozen=True, slots=True)
class ProcessEnded:
    """The process is no more."""

    status: int | None
    """Its exit status, negative for the signal that ended it; None if the system doesn't know it yet."""


Event: TypeAlias = PhysicsReady | Measurement | Fault | Silent | ProcessEnded


class PhysicsStartError(VrsError):
    """The process of the physics couldn't be started."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"the physics didn't start: {problem}")


class PhysicsProcess:
    """The process, seen from its parent: nothing here waits, but for `close`.

    A driver calls `poll` when the descriptor can be read and when `next_deadline` has come.
    """

    def __init__(self, config: PhysicsConfig, clock: WallClock) -> None:
        """Start it; it takes references once it has said that it's ready.

        Args:
            config: Which body.
            clock: The robot's clock, which the process then reads, too.

        Raises:
            PhysicsStartError: If it can't be started.
        """
        limits = config.robot.arm.limits
        self._n, self._run = limits.dof, 0
        self._heard, self._ready, self._silent = clock.now(), False, False
        self._ended: ProcessEnded | None = None
        try:
            self._process, connection = start("interfaces.runtime.physics_process")
        except OSError as problem:
            raise PhysicsStartError(str(problem)) from problem
        self._socket = MessageSocket(connection, MESSAGE_MOST)
        bounds = (limits.q_min, limits.q_max, limits.qd_max, limits.qdd_max, limits.qddd_max)
        self._send(
            PhysicsSetup(
                config.robot.found_by, config.body, config.friction, TICK, config.every, clock.origin, os.getpid(),
                tuple(config.q.tolist()), tuple(tuple(bound.tolist()) for bound in bounds),  # type: ignore[arg-type]
                tuple(config.robot.arm.prismatic), config.scene,
            )
        )  # fmt: skip

    @property
    def pid(self) -> int:
        """The process's id."""
        return self._process.pid

    def fileno(self) -> int:
        """The descriptor that can be read when there's something to `poll`."""
        return self._socket.fileno()

    def feed(self, reference: JointReference, start: int, *, placed: bool = False, grips: Grips = ()) -> bool:
        """Give references, which count for their ticks and instead of all that was given for later ones.

        After the last one its position is held, if it's at rest; if it's not, the body brakes and tells a fault.

        Args:
            reference: A row a tick, 1 to `ROWS_MOST` of them.
            start: Tick of the first.
            placed: Whether the reference may jump to the first row, which is at rest where the body was measured.
            grips: What the hand is told at ticks from the first on; a body without one passes it over.

        Returns:
            Whether they were sent: not before it's ready, and not when it has ended or doesn't read.

        Raises:
            InvalidValueError: If the shape isn't (k, n) three times.
        """
        shape = np.shape(reference.q)
        if len(shape) != 2 or not 1 <= shape[0] <= ROWS_MOST or shape[1] != self._n:
            raise InvalidValueError("reference", shape, f"1 to {ROWS_MOST} rows of {self._n} joints")
        if any(np.shape(part) != shape for part in reference):
            raise InvalidValueError("reference", [np.shape(part) for part in reference], "of one shape")
        rows = np.stack(reference, axis=1).astype(np.float64, copy=False)
        return self._ready and self._send(Rows(self._run, start, placed, rows.tobytes(), grips))

    def acknowledge(self, fault: Fault) -> None:
        """Let what is fed from now on count: it begins where the fault's stop rests; see `References.restart`."""
        self._run = max(self._run, fault.number)

    def attach(self, mass: float) -> bool:
        """Let the body take a load [kg]; returns whether that was sent.

        Raises:
            InvalidValueError: If no load has that mass.
        """
        from robots.simulated import Payload

        return self._send(Attach(Payload(mass=mass).mass))

    def release(self) -> bool:
        """Let the body drop its load; returns whether that was sent."""
        return self._send(ReleaseLoad())

    def poll(self, *, now: float) -> tuple[Event, ...]:
        """Take in what the process said, and notice if it says nothing or has ended.

        Args:
            now: By the robot's clock [s].
        """
        events: list[Event] = []
        for data in () if self._ended is not None else self._socket.receive():
            news: News = decode_news(data)
            self._heard, self._silent = now, False
            self._ready = self._ready or isinstance(news, PhysicsReady)
            events.append(news)
        if self._ended is None and self._socket.ended:
            events.append(self._end())
        if self._ended is None and not self._silent and now - self._heard > self._patience:
            if not self._ready:
                self._process.kill()
            self._silent = True
            events.append(Silent(self._heard))
        return tuple(events)

    def next_deadline(self) -> float:
        """When to poll even if nothing can be read, by the robot's clock [s]."""
        return math.inf if self._silent or self._ended is not None else self._heard + self._patience + 1e-6

    @property
    def _patience(self) -> float:
        return SILENCE if self._ready else _START_TIME

    def close(self) -> None:
        """Let the body come to rest and the process end; it's killed if it doesn't. A second call does nothing."""
        self._send(Close())
        try:
            self._process.wait(_END_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._ended = self._ended or ProcessEnded(self._process.returncode)
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _end(self) -> ProcessEnded:
        """The process has closed its end of the socket."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_STATUS_TIME)
        self._ended = ProcessEnded(self._process.returncode)
        return self._ended

    def _send(self, order: Order) -> bool:
        """Send a message, if there's room for it."""
        return self._ended is None and self._socket.send(encode(order))


class References:
    """What the body is to follow, ahead of time: what is decided, and what follows if nobody decides more."""

    def __init__(
        self,
        reference: Callable[[Array], JointReference],
        *,
        now: float,
        tick: float = TICK,
        horizon: float = HORIZON,
    ) -> None:
        """Begin with the first tick after now.

        Args:
            reference: What it's to follow at ascending times of the robot's clock [s], (k,), if no more is heard.
            now: For when was decided: the wall clock's time plus the lead [s].
            tick: Length of a tick [s].
            horizon: How far to look ahead [s], if the arm doesn't rest for good before; at most 500 ticks.
        """
        self._reference, self._tick = reference, tick
        self._count = round(number_in("horizon", horizon, tick, _AHEAD * tick) / tick)
        self._next = self._after(now)

    def restart(self, *, now: float) -> None:
        """Leave out what was before now [s]: after a fault the body holds, and follows from here on."""
        self._next = self._after(now)

    def take(self, *, now: float) -> tuple[int, JointReference]:
        """Say what to `feed`: from where it was last taken on, as all that was decided since may differ.

        Args:
            now: For when was decided [s].

        Returns:
            The first tick, and a row for it and each one after it.
        """
        following = self._after(now)
        first = max(self._next, following - _AHEAD)
        self._next = following
        t: Array = self._tick * np.arange(first, following + self._count, dtype=np.float64)
        reference = self._reference(t)
        moving = np.flatnonzero(reference.qd.any(axis=1) | reference.qdd.any(axis=1))
        count = min(int(moving[-1]) + 2 if len(moving) else 1, len(t))
        return first, JointReference(*(part[:count] for part in reference))

    def _after(self, now: float) -> int:
        return math.floor(now / self._tick + 1e-9) + 1


FEED = 0.1
"""Longest time between two lots of references [s]."""


class Fed(Protocol):
    """What takes references; see `PhysicsProcess`."""

    def feed(self, reference: JointReference, start: int, *, placed: bool = False, grips: Grips = ()) -> bool:
        """Give references from a tick on, and what the hand is told."""

    def acknowledge(self, fault: Fault) -> None:
        """Let what is fed from now on count."""


class Feeder:
    """Lets a host do what is due, and feeds a body what it's to do; reads no clock.

    Whatever is decided, the body has before the ticks for which it counts. It's fed what follows if nobody looks
    again. So it's also fed where something fell due, though no message came: what is decided then may be another
    course, as that the arm needn't brake yet.
    """

    def __init__(self, host: RobotHost, body: Fed, *, now: float, grasps: bool = False) -> None:
        """Begin to feed.

        Args:
            host: What decides, its lead ahead.
            body: What follows.
            now: By the robot's clock [s].
            grasps: Whether the body has a hand that's to be told, too.
        """
        self._host, self._body, self._grasps = host, body, grasps
        self._references = References(host.reference, now=self._ahead(now))
        self._fed, self._stale, self._placed = -math.inf, True, False
        self._fault: Fault | None = None

    def decided(self) -> None:
        """Something was decided, or is about to be: feed at the next `advance`."""
        self._stale = True

    def placed(self, *, now: float) -> None:
        """The arm is held where it was measured: its references may jump there."""
        self._references.restart(now=self._ahead(now))
        self._stale = self._placed = True

    def failed(self, fault: Fault) -> None:
        """The body comes to rest by itself: nothing is fed until it does."""
        self._fault = fault

    def advance(self, *, now: float) -> tuple[Report | Ping, ...]:
        """Do what is due by now [s], and feed the body; say what is to be sent to the operator."""
        self._stale = self._stale or self._host.next_deadline() <= now
        messages = self._host.advance(now=now)
        if self._fault is not None and now >= self._fault.rest_tick * TICK:
            # It rests, and references begin there.
            self._body.acknowledge(self._fault)
            self._references.restart(now=self._ahead(now))
            self._fault, self._stale = None, True
        if self._stale or now >= self._fed + FEED:
            self._feed(now)
        return messages

    def next_deadline(self) -> float:
        """When to `advance` even if nothing comes, by the robot's clock [s]."""
        return min(self._host.next_deadline(), self._fed + FEED)

    def _feed(self, now: float) -> None:
        """Give the body its references, from where it has them for certain."""
        if self._fault is None:
            first, rows = self._references.take(now=self._ahead(now))
            self._body.feed(rows, first, placed=self._placed, grips=self._grips(first) if self._grasps else ())
            self._placed = False
        self._fed, self._stale = now, False

    def _grips(self, first: int) -> Grips:
        """What the hand is told from a tick on, and when that changes."""
        t: Array = TICK * np.arange(first, first + _AHEAD, dtype=np.float64)
        openings = self._host.openings(t)
        changes = np.flatnonzero(np.concatenate([[True], openings[1:] != openings[:-1]]))
        return tuple(zip((first + changes).tolist(), openings[changes].tolist(), strict=True))

    def _ahead(self, now: float) -> float:
        """For when of the body's time is decided at now [s]."""
        return now + self._host.config.lead
