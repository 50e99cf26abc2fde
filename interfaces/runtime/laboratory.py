"""Virtual time: the loop that everything runs in there, and the laboratory, both sites and the link in it."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Sequence
from itertools import count
from typing import Protocol, TypeAlias

import numpy as np

from interfaces.engine_server.site import earliest
from interfaces.link import Link, LinkConditions
from interfaces.messages.sites import Orders, Report
from interfaces.teleop.following_arm import FollowingArm, JointReference
from interfaces.teleop.operator import OperatorSite
from interfaces.teleop.virtual_arm import VirtualArm
from robots.bullet.grasping import GraspingArm, HandState
from robots.onboard.playout import PlayState
from robots.robot import ArmBody
from vrs.checks import finite
from vrs.errors import InvalidValueError
from vrs.ledger import Receipt
from vrs.model import Array

PATIENCE = 1000
"""Turns without any time passing, after which something is wrong."""


class VirtualPart(Protocol):
    """Anything that runs in virtual time."""

    def advance(self, *, now: float) -> object:
        """Do what is due at now [s]."""

    def next_deadline(self) -> float | None:
        """When it wants to be called next [s]; None for not before something arrives."""


def run_parts(parts: Sequence[VirtualPart], *, now: float, until: float) -> float:
    """Let virtual time pass: at each deadline the parts that are due have their turn, until all are quiet.

    At the beginning and at the end all have a turn.

    Args:
        parts: In the order of their turns: sites first, then transports, then clients.
        now: Time to begin at [s].
        until: Time to end at [s].

    Returns:
        The time reached: `until`.

    Raises:
        InvalidValueError: If the parts don't become quiet.
    """
    due, again = parts, 0
    while True:
        for part in due:
            part.advance(now=now)
        deadlines = [math.inf if (t := part.next_deadline()) is None else t for part in parts]
        upcoming = min(deadlines, default=math.inf)
        if upcoming > now:
            if now >= until:
                return now
            now, again = min(upcoming, until), 0
        elif (again := again + 1) > PATIENCE:
            raise InvalidValueError("deadline", upcoming, f"after {now} s, when its part has advanced")
        due = parts if now >= until else [part for part, t in zip(parts, deadlines, strict=True) if t <= now]


_BLOCK = 100
"""Ticks that are passed together while nothing needs to know where the body is."""
_SAME = 1e-9
"""Times nearer than this [s] are one."""

Action: TypeAlias = Callable[[float], None]
"""What is done at a time, which it's told [s]."""


class Laboratory:
    """An operator's site, a robot's site and the link between them under one virtual clock.

    Everything happens in the order of its time; what happens at the same time, in the order: link, agenda, sites.
    """

    def __init__(
        self,
        operator: OperatorSite[VirtualArm],
        robot: FollowingArm,
        conditions: LinkConditions,
        rng: np.random.Generator,
        *,
        now: float = 0.0,
        tick: float = 0.02,
        every: int = 1,
        body: ArmBody | None = None,
    ) -> None:
        """Put everything in its place.

        Args:
            operator: The operator's site.
            robot: The robot's site.
            conditions: What the link does.
            rng: Source of everything random in it.
            now: Time to begin with [s].
            tick: Period of the body [s].
            every: Ticks from one row of the record to the next, ≥ 1.
            body: What follows the robot's references; without one the robot is where its reference is.
        """
        self.operator, self.robot = operator, robot
        self.link: Link[Orders, Report] = Link(conditions, rng)
        self.now = finite("now", now, "finite seconds")
        if not finite("tick", tick, "seconds > 0") > 0:
            raise InvalidValueError("tick", tick, "seconds > 0")
        if isinstance(every, bool) or not isinstance(every, int) or every < 1:
            raise InvalidValueError("every", every, "a whole number ≥ 1")
        self._tick, self._every, self._body = tick, every, body
        self._start, self._ticks = now, 0
        self._told = math.inf
        """What the hand was told last [m]."""
        self.arrivals: dict[tuple[int, int], float] = {}
        """When each entry of the operator's log first reached the robot [s], by epoch and number."""
        self.answers: dict[tuple[int, int], Receipt] = {}
        """What the robot's engine answered when it carried out an entry, by epoch and number."""
        self.halts: dict[int, tuple[float, str]] = {}
        """When and why the robot stopped by itself [s], by epoch."""
        self._agenda: list[tuple[float, int, Action]] = []
        self._cues: list[tuple[float, int, Action]] = []
        self._order = count()
        self._play: list[Array] = []
        self._followed: list[JointReference] = []
        self._measured: list[Array] = []
        self.hands: list[tuple[float, HandState]] = []
        """When the hand and the things around it were measured [s], and how; none of a body without."""

    def schedule(self, t: float, action: Action) -> None:
        """Let something be done at a time [s]."""
        heapq.heappush(self._agenda, (t, next(self._order), action))

    def cue(self, p: float, action: Action) -> None:
        """Let something be done to the body when the robot's play time passes p [s]; the action is told when."""
        heapq.heappush(self._cues, (p, next(self._order), action))

    def run(self, until: float) -> None:
        """Let time pass until `until` [s]."""
        run_parts([self], now=self.now, until=until)
        self._pass(until, at_once=True)

    def next_deadline(self) -> float | None:
        """When something happens next [s]."""
        sites = self.operator.next_deadline(), self.robot.next_deadline()
        return earliest(*sites, self.link.next_deadline(), self._agenda[0][0] if self._agenda else None)

    def advance(self, *, now: float) -> None:
        """Let everything happen that happens at now [s]."""
        # The robot's site, and what is planned, may ask where the body is.
        asked = self.robot.next_deadline() <= now or (bool(self._agenda) and self._agenda[0][0] <= now)
        self._pass(now, at_once=self._body is not None and asked)
        for delivery in self.link.forward.receive(now):
            for entry in delivery.payload.entries:
                self.arrivals.setdefault((delivery.payload.epoch, entry.number), now)
            self.robot.receive(delivery.payload, now=now)
        for answer in self.link.backward.receive(now):
            self.operator.receive(answer.payload, now=now)
        while self._agenda and self._agenda[0][0] <= now:
            heapq.heappop(self._agenda)[2](now)
        for orders in self.operator.advance(now=now):
            self.link.forward.send(orders, now)
        for report in self.robot.advance(now=now):
            for number, receipt in report.receipts:
                self.answers.setdefault((report.epoch, number), receipt)
            if report.halted:
                self.halts.setdefault(report.epoch, (now, report.halted))
            self.link.backward.send(report, now)

    def _pass(self, now: float, *, at_once: bool = False) -> None:
        """Let time pass in which nothing happens.

        What is over never changes: ticks may wait until there are many, or until somebody asks where the body is.
        """
        self.now = now
        last = math.floor((now - self._start) / self._tick + _SAME)
        if last - self._ticks < (1 if at_once else _BLOCK):
            return
        while self._ticks < last:
            t: Array = self._start + self._tick * np.arange(self._ticks + 1, last + 1, dtype=np.float64)
            play = self.robot.play_at(t)
            cue = self._next_cue(play)
            self._follow(t[:cue], PlayState(*(column[:cue] for column in play)))
            if cue is not None:
                p, _, action = heapq.heappop(self._cues)
                early = (play.p[cue] - p) / play.pace[cue] if play.pace[cue] > 0 else self._tick
                action(float(t[cue]) - min(max(early, 0.0), self._tick))

    def _next_cue(self, play: PlayState) -> int | None:
        """The first of the ticks at which the next cue has passed; None if there's none."""
        if not self._cues:
            return None
        index = int(np.searchsorted(play.p, self._cues[0][0] + _SAME, side="right"))
        return index if index < len(play.p) else None

    def _follow(self, t: Array, play: PlayState) -> None:
        """Write down the next ticks, at times (m,) [s]; a body follows its references."""
        if not len(t):
            return
        first, self._ticks = self._ticks + 1, self._ticks + len(t)
        rows = slice(-first % self._every, None, self._every)
        self._play.append(np.column_stack((t[rows], *(column[rows] for column in play))))
        if self._body is not None:
            reference = self.robot.reference(play)
            measured = self._moved(t, play, reference)
            self._followed.append(JointReference(*(column[rows].copy() for column in reference)))
            self._measured.append(measured[rows].copy())
            self.robot.measured(measured[-1], now=float(t[-1]))

    def _moved(self, t: Array, play: PlayState, reference: JointReference) -> Array:
        """Let body and hand follow what they're told for times (m,) [s]; measured joints [rad], (m, n)."""
        body = self._body
        assert body is not None
        if not isinstance(body, GraspingArm):
            return body.follow(body.prepare(*reference)).q
        # A tick's end is a row of the record where its number is a multiple; the hand is told before its tick.
        openings, first = self.robot.openings(play), self._ticks - len(t)
        told = np.flatnonzero(openings != np.concatenate([[self._told], openings[:-1]]))
        rows = np.arange(-(first + 1) % self._every, len(t), self._every) + 1
        measured, start = [], 0
        for end in sorted({*told.tolist(), *rows.tolist(), len(t)}):
            if end > start:
                measured.append(body.follow(body.prepare(*(part[start:end] for part in reference))).q)
                self.hands.append((float(t[end - 1]), body.state()))
                self.robot.hand(self.hands[-1][1])
            if end < len(t) and openings[end] != self._told:
                self._told = float(openings[end])
                body.grip(self._told)
            start = end
        return np.concatenate(measured)

    def blocks(self, since: int) -> Iterator[tuple[Array, Array, Array]]:
        """What a body's record got, block by block: rows of `play`, references and measured joints [rad], (k, n).

        Args:
            since: How many blocks are known.
        """
        references = (reference.q for reference in self._followed[since:])
        return zip(self._play[since:], references, self._measured[since:], strict=True)

    @property
    def t(self) -> Array:
        """Times of the record [s], (k,)."""
        rows = np.arange(self._every, self._ticks + 1, self._every, dtype=np.float64)
        t: Array = self._start + self._tick * rows
        return t

    @property
    def play(self) -> Array:
        """Time [s], play time p [s], pace and rate [1/s] in each row of the record, (k, 4)."""
        return np.concatenate(self._play) if self._play else np.empty((0, 4))

    @property
    def reference(self) -> JointReference:
        """What the robot's site asked of its body, (k, n) each."""
        if self._body is None:
            _, p, pace, rate = self.play.T
            return self.robot.reference(PlayState(p, pace, rate))
        return JointReference(*(np.concatenate([r[i] for r in self._followed]) for i in range(3)))

    @property
    def measured(self) -> Array:
        """Measured joints [rad], (k, n)."""
        return self.reference.q if self._body is None else np.concatenate(self._measured)
