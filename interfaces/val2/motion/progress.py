"""What the arm has been asked for, and what it waits for."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import MutableMapping
from typing import Final

import numpy as np

from interfaces.stream.control import OVERRULED
from interfaces.teleop.operator import NOT_FOLLOWING
from interfaces.val2.errors import TAKEN, ValError, robot_halted
from interfaces.val2.motion.altering import Alterations
from interfaces.val2.motion.hand import REMEMBERED, Gripped, Hand
from interfaces.val2.motion.pacing import MonitorSpeed
from interfaces.val2.motion.places import Frames, in_millimetres, location_error
from interfaces.val2.motion.robot import Fate, Robot
from interfaces.val2.motion.speeds import Manner, Manners
from interfaces.val2.ports import Where
from interfaces.val2.values import Location
from vrs.commands import Command, MotionCommand
from vrs.model import Array

_POLL: Final = 0.01
"""How often it's looked whether an answer has come [s]."""
_NULL_POLL: Final = 0.05
"""How often it's looked whether the other twin is there [s]."""
_NULL_PATIENCE: Final = 5.0
"""How long NULL waits for it [s]."""
_FINE: Final = math.radians(0.2)
"""100 % of FINE: errors of joints that count as none [rad]."""
_COARSE: Final = math.radians(2.0)
_ELSEWHERE: Final = 1e-5
"""Joints of an end that differ by more from the destination [rad]."""
_RECENT: Final = 4
"""Motions that may be interrupted at once: the one under way, and what is asked for ahead."""


class Progress:
    """How far an arm is with what was asked of it."""

    def __init__(
        self,
        robot: Robot,
        *,
        parameters: MutableMapping[str, float] | None = None,
        gripped: Gripped | None = None,
    ) -> None:
        """Command a robot.

        Args:
            robot: The robot.
            parameters: Shared with the interpreter; of them HAND.TIME [s] is read.
            gripped: Is told when the hand takes hold of something or lets go [s].
        """
        self.robot = robot
        self.parameters: MutableMapping[str, float] = {} if parameters is None else parameters
        self._frames = Frames(robot.model)
        self._framed = deque([(-math.inf, self._frames)], maxlen=REMEMBERED)
        """Since when TOOL and BASE have been which [s]."""
        self._manners = Manners()
        self._hand = Hand(self.parameters, gripped)
        self._alterations = Alterations()
        self._pace = MonitorSpeed(robot)
        self._continuous = True
        self._dry: Array | None = None
        """Where a dry run would be by now [rad], (6,); None outside of one."""
        self._words: tuple[str, ...] = ()
        self._at: float | None = None
        self._delay: tuple[float, float] | None = None
        """When a DELAY may begin at the earliest, and how long it lasts [s]."""
        self._open: list[tuple[int, bool]] = []
        """What has no answer yet, and whether it's a straight line."""
        self._recent: deque[tuple[int, MotionCommand]] = deque(maxlen=_RECENT)
        self._interrupted: tuple[MotionCommand, ...] = ()
        self._ahead: tuple[int, ...] = ()
        """What was asked for ahead when somebody else took the arm over."""
        self._taken_out: list[int] = []
        """What was asked for to take those out of the plan, and has no answer."""
        self._bound: int | None = None
        """The motion at whose destination the arm is to arrive; None where it's stopped, or has arrived."""
        self._correction: int | None = None
        """The newest correction by ALTOUT."""
        self._made = Manner()
        """How the newest motion was asked for."""
        self._made_words: tuple[str, ...] = ()
        self._now = -math.inf

    # Where it is.

    def here(self, *, now: float) -> Where:
        """Where the operator's arm is."""
        return self.past(now, now=now)

    def destination(self, *, now: float) -> Where:
        """Where it goes."""
        self._look(now)
        return self._frames.where(self._goal(), self._hand.goal)

    def real(self, *, now: float) -> Where | None:
        """Where the other twin was measured last."""
        q = self.robot.real(now=now)
        return None if q is None else self._frames.where(q, self._hand.opening(now))

    def past(self, t: float, *, now: float) -> Where:
        """Where the arm was, or will be, at a time [s]: with the tool, the base and the hand as they were then."""
        self._look(now)
        frames = self._framed[max(bisect_right(self._framed, t, key=lambda since: since[0]) - 1, 0)][1]
        return frames.where(self.robot.timeline.sample(t), self._hand.opening(t, self._begins))

    def _frame(self, frames: Frames) -> None:
        """Let tool and base be others from now on."""
        self._frames = frames
        self._framed.append((self._now, frames))

    def _goal(self) -> Array:
        """Joints at the destination [rad], (6,)."""
        return self.robot.timeline.final() if self._dry is None else self._dry

    def reaches(self, location: Location, *, now: float) -> bool:
        """Whether a motion could go there."""
        self._look(now)
        try:
            self._frames.solve(location, self._goal(), ())
        except ValError:
            return False
        return True

    # What it waits for.

    def _look(self, now: float) -> None:
        self._now = now
        self._pace.advance(now=now)
        self._taken_out = [n for n in self._taken_out if self.robot.fate(n, now=now) is None]
        self._hand.begin(self._begins, now)

    def _begins(self, number: int) -> float | None:
        """When a motion begins [s]; None while that's unknown. One that was taken back has begun."""
        fate = self.robot.fate(number, now=self._now)
        if fate is None:
            return None
        receipt = fate.receipt
        known = receipt is not None and receipt.execute_at is not None and not receipt.undone
        return receipt.execute_at if receipt is not None and known else self._now

    def _delay_span(self) -> tuple[float, float]:
        """When the DELAY begins and ends [s]; in the past where there's none."""
        if self._delay is None:
            return -math.inf, -math.inf
        earliest, seconds = self._delay
        begin = max(earliest, self.robot.timeline.end)
        return begin, begin + seconds

    def answered(self, *, now: float) -> bool:
        """Whether all that was asked has been answered."""
        self._look(now)
        while self._open:
            number, straight = self._open[0]
            fate = self.robot.fate(number, now=now)
            if fate is None:
                return False
            self._open.pop(0)
            if fate.reason:
                raise _refusal(fate, straight)
        self._follow_up(now)
        return not self._pace.waits

    def _follow_up(self, now: float) -> None:
        """See that nothing else has stopped the arm.

        Raises:
            ValError: If the real arm stopped on the way, or the way ends somewhere else. RETRY is for the motion.
        """
        if self._bound is None or (fate := self.robot.fate(self._bound, now=now)) is None:
            return
        receipt, why = fate.receipt, self.robot.trouble()
        if receipt is None or receipt.q is None or receipt.undone:
            self._bound = None
            return
        ends = math.inf if receipt.end is None else receipt.end
        if why and now < ends:
            self._give_up(now, ends)
            raise ValError("Motion interrupted", f"the real arm has stopped: {why}")
        if now >= self._end():
            if self.robot.lost:
                self._give_up(now, math.inf)
                raise ValError("Motion interrupted", "there's no connection: where the arm is isn't known")
            if np.abs(self.robot.timeline.final() - receipt.q).max() > _ELSEWHERE:
                self._give_up(now, math.inf)
                raise ValError("Motion interrupted", "the arm was stopped before its destination")
            self._bound = None

    def _give_up(self, now: float, end: float) -> None:
        """Ask for nothing more; what isn't over is for RETRY, what was for a motion to come is for the next one.

        Args:
            now: Session time [s].
            end: When the newest motion ends, or would [s].
        """
        motions = [(command, self._begins(number)) for number, command in self._recent]
        ends = [math.inf if begins is None else begins for _, begins in motions[1:]] + [end]
        self._interrupted = tuple(
            command
            for (command, begins), over in zip(motions, ends, strict=False)
            if begins is not None and begins <= now < over
        )
        if self._moves(-math.inf) and (motions[-1][1] is None or motions[-1][1] > now):
            self._manners.next, self._words = self._made, self._made_words
            self._hand.give_back()
        self._recent.clear()
        self._delay = self._at = self._bound = None

    def ready(self, *, now: float) -> bool:
        """Whether the next motion may be asked for: the last has begun, and all has been answered."""
        return self.answered(now=now) and self._begun(now)

    def _begun(self, now: float) -> bool:
        last = self._begins(self._recent[-1][0]) if self._recent else -math.inf
        return last is not None and last <= now and self._delay_span()[0] <= now

    def settled(self, *, now: float) -> bool:
        """Whether the arm stands at its destination, and the hand has done what it was told."""
        if not self.answered(now=now) or self._hand.waits:
            return False
        return now >= max(self._end(), self._hand.end) and self._nulled(now)

    def _end(self) -> float:
        return max(self.robot.timeline.end, self._delay_span()[1])

    def _nulled(self, now: float) -> bool:
        """Whether the other twin is there, where a motion was to end so."""
        q = self.robot.real(now=now) if self._made.nulling and self._dry is None else None
        if q is None or now >= self._end() + _NULL_PATIENCE:
            return True
        allowed = (_FINE if self._made.fine else _COARSE) * self._made.tolerance / 100.0
        return bool(np.abs(q - self.robot.timeline.final()).max() <= allowed)

    def next_deadline(self) -> float:
        """When any of these may change by itself [s]; infinity for never."""
        now, (delayed, ends) = self._now, self._delay_span()
        times = [self.robot.timeline.end, self._hand.end, self._pace.next_deadline(), delayed, ends]
        if self._bound is not None:
            times.append(now + self.robot.looks)
        if self._recent:
            begins = self._begins(self._recent[-1][0])
            times.append(now + _POLL if begins is None else begins)
        if self._open or self._pace.waits:
            times.append(now + _POLL)
        if self._made.nulling and now >= self._end() and not self._nulled(now):
            times.append(now + _NULL_POLL)
        return min((t for t in times if t > now), default=math.inf)

    def _moves(self, now: float) -> bool:
        """Whether the arm is on a motion that a program or the monitor asked for, and no correction by ALTOUT."""
        return bool(self._recent) and self._recent[-1][0] != self._correction and now < self.robot.timeline.end

    def _send(self, command: Command | None, straight: bool, now: float) -> int:
        number = self.robot.ask(command, now=now)
        fate = self.robot.fate(number, now=now)
        if fate is None:
            self._open.append((number, straight))
        elif fate.reason:
            raise _refusal(fate, straight)
        return number


def _refusal(fate: Fate, straight: bool) -> ValError:
    """What a refusal is in VAL's words."""
    if fate.refusal == OVERRULED:
        return ValError("Motion interrupted", TAKEN)
    if fate.receipt is None:
        return ValError("Command refused", fate.reason)
    if fate.reason.startswith(NOT_FOLLOWING):
        why = fate.reason.removeprefix(f"{NOT_FOLLOWING}: ").removesuffix("; resume first")
        return robot_halted(why)
    if straight:
        return ValError(
            "Straight line not possible", in_millimetres(fate.reason.removeprefix("no straight line: "))
        )
    return location_error(fate.reason)
