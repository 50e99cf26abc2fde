"""What runs near an engine, under a clock that is shifted by D; and what a hub serves of a robot, of any."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from interfaces.engine_server.broadcast import Broadcaster
from interfaces.engine_server.journal import Journal
from interfaces.engine_server.servlet import Commander, Servlet
from interfaces.messages import Order, Refusal, control
from vrs.checks import finite
from vrs.clock import ManualClock
from vrs.engine import Engine, MobileEngine
from vrs.errors import InvalidValueError


def earliest(*times: float | None) -> float | None:
    """The earliest of some deadlines [s]; None where there's none."""
    return min((t for t in times if t is not None), default=None)


def engine_time(t_user: float, D: float) -> float:
    """t_e = t_u + D [s] in whole nanoseconds, rounded down. Source: Doulgeri et al., section IV-A.

    In floats (t + D_f) − D_f may lie a rounding error after t, and a command just in time would count as late.
    """
    return math.floor((t_user + D) * 1e9) / 1e9


class Site:
    """An engine with its journal, broadcasters and servlets under one clock; or a robot that is driven live."""

    def __init__(self, robot: Engine | Commander, *, D: float = 0.0, room: str = "") -> None:
        """Gather round a robot.

        Args:
            robot: An engine under a `ManualClock`, which this site then moves; under another clock, or none, D is
                that clock's affair. Or who carries out orders and has no timeline to be followed.
            D: How far the engine's clock is ahead of the users' [s]; −D_f and +D_b are the paper's choices. It may
                be changed, but the engine's clock never runs back: it stands until time has caught up.
            room: Where a mobile robot drives, for people.
        """
        self._commander = Journal(robot) if isinstance(robot, Engine) else robot
        self.journal = self._commander if isinstance(self._commander, Journal) else None
        """Of the engine's timeline; None where none is to be followed."""
        self.D = finite("D", D, "finite seconds")
        self._room = room
        self._broadcasters: list[Broadcaster] = []

    @property
    def engine(self) -> Engine:
        """What carries out commands."""
        return self._commander.engine

    @property
    def broadcasters(self) -> tuple[Broadcaster, ...]:
        """The broadcasters, in the order in which they were made."""
        return tuple(self._broadcasters)

    @property
    def robot(self) -> str:
        """Name of the robot's model."""
        return self.engine.model.name

    def broadcast(self, rate: float, *, lead: float = 0.0) -> Broadcaster:
        """Add a broadcaster; see there.

        Raises:
            InvalidValueError: If the rate isn't allowed, or there's no timeline.
        """
        if self.journal is None:
            raise InvalidValueError("rate", rate, "none: a mobile robot has no frames")
        self._broadcasters.append(Broadcaster(self.journal, rate=rate, lead=lead))
        return self._broadcasters[-1]

    def servlet(self, *, lead: float = 0.0, admit: Callable[[Order], Refusal | None] | None = None) -> Servlet:
        """Make the server submodule of one more client, which finds the broadcasters that are there now."""
        return Servlet(self._commander, lead=lead, broadcasters=self._broadcasters, admit=admit)

    def look(self) -> int:
        """Number of the newest edit; 0 where no timeline is to be followed."""
        return 0 if self.journal is None else self.journal.look()

    def welcome(self, **facts: Any) -> control.Welcome | control.MobileWelcome:
        """What a client of a server is told that is let in: the facts that every client is told, and these."""
        engine = self.engine
        if isinstance(engine, MobileEngine):
            return control.MobileWelcome(
                protocol=control.PROTOCOL,
                robot=engine.model.name,
                limits=engine.model.limits,
                period=engine.model.period,
                holds=control.HOLDS,
                room=self._room,
                **facts,
            )
        model = engine.model
        return control.Welcome(
            protocol=control.PROTOCOL,
            robot=model.name,
            dof=model.limits.dof,
            limits=model.limits,
            poses=dict(model.poses),
            rates=tuple(broadcaster.rate for broadcaster in self._broadcasters),
            **facts,
        )

    def time(self, now: float) -> float:
        """The engine's time [s] when the users' clock shows now [s]; moves a manual clock on to it.

        An offline engine has no time of its own: its plan is looked at by the users'; so is what is driven live.
        """
        clock = None if self.journal is None else self.engine.clock
        if clock is None:
            return now
        if isinstance(clock, ManualClock):
            clock.set(max(clock.now(), engine_time(now, self.D)))
        return self.engine.now()

    def advance(self, *, now: float) -> None:
        """Make the frames that are due at the users' time now [s]."""
        t = self.time(now)
        for broadcaster in self._broadcasters:
            broadcaster.advance(now=t)

    def next_deadline(self) -> float | None:
        """When the next frame is due [s], in the users' time; None without a broadcaster that has begun."""
        times = [broadcaster.next_deadline() for broadcaster in self._broadcasters]
        return min((t - self.D for t in times if t is not None), default=None)
