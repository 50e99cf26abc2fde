"""The arm of programs and the monitor: motions become commands on a robot's timeline."""

from __future__ import annotations

import math
from dataclasses import replace

from interfaces.val2.errors import ValError
from interfaces.val2.motion.places import NEST, READY, aligned, behind, shifted
from interfaces.val2.motion.requests import Requests
from interfaces.val2.motion.speeds import Speed, bounded
from interfaces.val2.values import Location, PrecisionPoint, Transformation
from vrs.commands import Cancel, Insertion, JointTarget, Motion, MotionCommand, PoseTarget, Stop
from vrs.engine import Engine
from vrs.model import Array


class Arm(Requests):
    """An `ArmPort` over a robot.

    With CP on, a motion begins while the one before it brakes. One motion is asked for ahead of the one under way.
    """

    # Motions.

    def move(self, target: Location, *, straight: bool, hand: float | bool | None = None, now: float) -> None:
        """MOVE, MOVES, MOVET, MOVEST."""
        self._move(target, straight, now, hand=hand)

    def approach(self, target: Location, distance: float, *, straight: bool, now: float) -> None:
        """APPRO, APPROS."""
        self._move(behind(self._frames.place(target), distance), straight, now)

    def depart(self, distance: float, *, straight: bool, now: float) -> None:
        """DEPART, DEPARTS."""
        self._move(behind(self.destination(now=now).tool, distance), straight, now)

    def drive(self, joint: int, change: float, speed: float, *, now: float) -> None:
        """DRIVE."""
        if joint not in range(1, 7):
            raise ValError("Illegal joint number", f"{joint}: 1 to 6")
        if not 0 < speed < math.inf:
            raise ValError("Illegal value", f"{speed:g}: a speed is above 0 %")
        joints = list(self.destination(now=now).joints.joints)
        joints[joint - 1] += change
        self._move(PrecisionPoint(tuple(joints)), False, now, speed=Speed(speed))

    def draw(self, dx: float, dy: float, dz: float, *, now: float) -> None:
        """DRAW."""
        self._move(shifted(self.destination(now=now).tool, dx, dy, dz), True, now)

    def go_ready(self, *, now: float) -> None:
        """READY."""
        self._move(READY, False, now)

    def nest(self, *, now: float) -> None:
        """NEST."""
        self._move(NEST, False, now)

    def align(self, *, now: float) -> None:
        """ALIGN."""
        self._move(aligned(self.destination(now=now).tool), False, now)

    def delay(self, seconds: float, *, now: float) -> None:
        """DELAY."""
        if not 0 <= seconds < math.inf:
            raise ValError("Illegal value", f"{seconds:g}: a delay is 0 or above")
        self._look(now)
        if self._dry is None:
            self._delay = max(now, self._delay_span()[1]), seconds

    def actuate(self, hand: bool | None, *, now: float) -> None:
        """OPENI, CLOSEI, RELAXI."""
        self._look(now)
        if self._dry is None:
            self._hand.actuate(hand, now)

    def alter(self, values: tuple[float, ...], *, now: float) -> None:
        """ALTOUT; the arm must not be on another motion.

        What was asked for the next motion, its speed and the hand, waits for that.
        """
        self._look(now)
        if self._moves(now):
            raise ValError("Robot is moving", "the path is altered between motions: BREAK comes first")
        if not self.answered(now=now):
            raise ValError("Robot is moving", "what was asked before has no answer yet")
        place = self._alterations.corrected(values, self._frames.where(self._goal(), 0.0).tool)
        if self._dry is not None:
            self._dry = self._frames.solve(place, self._dry, ())
        else:
            rolls = self._continuous and self._delay is None
            ends = self._delay_span()[1]
            command = MotionCommand(
                target=PoseTarget(self._frames.pose(place)),
                execute_at=ends if ends > now else None,
                motion=Motion.LINE,
                insertion=Insertion.APPEND,
                deviation=math.inf if rolls else 0.0,
                pace=bounded(self._pace.pace),
                tool=self._frames.tip(),
            )
            self._correction = self._bound = number = self._send(command, True, now)
            self._recent.append((number, command))
            self._delay = None
        self._alterations.taken(place)

    def _move(
        self,
        target: Location,
        straight: bool,
        now: float,
        *,
        hand: float | bool | None = None,
        speed: Speed | None = None,
    ) -> None:
        """Ask for a motion; nothing is changed where it can't be."""
        self._look(now)
        near, manner = self._goal(), self._manners.next
        turns = not straight and isinstance(target, Transformation)
        words = self._words if turns else ()
        if self._dry is not None:
            self._dry = self._frames.solve(target, near, words)
        else:
            rolls = self._continuous and self._delay is None and self._at is None
            rolls = rolls and set(words) <= set(self._frames.configured(near) if words else ())
            command = MotionCommand(
                target=self._target(target, straight, near, words),
                execute_at=self._start(now),
                speed=self._share(target, straight, near, manner.speed if speed is None else speed),
                motion=Motion.LINE if straight else Motion.JOINT,
                insertion=Insertion.APPEND,
                deviation=math.inf if rolls else 0.0,
                pace=bounded(self._pace.pace),
                acceleration=manner.acceleration,
                tool=self._frames.tip() if straight else None,
            )
            if manner.duration > 0:
                command = self._stretched(command, near, manner.duration)
            number = self._send(command, straight, now)
            self._recent.append((number, command))
            self._bound = number
            self._hand.ask(number, hand)
            self._hand.begin(self._begins, now)
        self._made, self._made_words, self._delay, self._at = manner, words, None, None
        self._manners.taken()
        if turns:
            self._words = ()

    def _target(
        self, target: Location, straight: bool, near: Array, words: tuple[str, ...]
    ) -> JointTarget | PoseTarget:
        if straight and isinstance(target, Transformation):
            return PoseTarget(self._frames.pose(target))
        return JointTarget(self._frames.solve(target, near, words))

    def _start(self, now: float) -> float | None:
        """When the next motion is to begin [s]; None for as soon as it can."""
        ends = self._delay_span()[1]
        if self._at is not None:
            return max(self._at, ends)
        return ends if ends > now else None

    def _share(self, target: Location, straight: bool, near: Array, speed: Speed) -> float:
        model = self.robot.model
        if not straight:
            return speed.share(model)
        tip = self._frames.tip()
        goal = self._frames.pose(self._frames.place(target))
        return speed.line_share(model, model.forward(near) @ tip, goal @ tip)

    def _stretched(self, command: MotionCommand, near: Array, duration: float) -> MotionCommand:
        """The motion at such a pace that it takes as long as DURATION asks, if it would take less."""
        receipt = Engine(self.robot.model, q=near).execute(replace(command, execute_at=None, pace=1.0))
        taken = (receipt.end or 0.0) - (receipt.execute_at or 0.0)
        share = min(1.0, taken / duration) if taken > 0 else 1.0
        return replace(command, pace=bounded(command.pace * share))

    def brake(self, *, now: float) -> None:
        """BRAKE, REACTI, ABORT; what was asked for a motion that hasn't begun is for the next one again."""
        self._look(now)
        self._give_up(now, self.robot.timeline.end)
        if now < self.robot.timeline.end or self._open:
            self._send(Stop(), False, now)

    def give_up(self, *, now: float) -> None:
        """Somebody else commands the arm: what isn't over is for RETRY, and no answer is waited for any more."""
        self._look(now)
        fate = None if self._bound is None else self.robot.fate(self._bound, now=now)
        end = None if fate is None or fate.receipt is None else fate.receipt.end
        self._ahead = tuple(n for n, _ in self._recent if (begins := self._begins(n)) is None or begins > now)
        self._give_up(now, math.inf if end is None else end)
        self._open.clear()

    def withdraw(self, *, now: float) -> None:
        """Take out of the plan what `give_up` found asked for ahead, as far as it has been accepted."""
        ahead, self._ahead = self._ahead, ()
        for number in ahead:
            fate = self.robot.fate(number, now=now)
            receipt = None if fate is None else fate.receipt
            if receipt is not None and receipt.stands:
                self._taken_out.append(self.robot.ask(Cancel(receipt.command_id), now=now))

    def retry(self, *, now: float) -> bool:
        """Ask again for the motion that `brake` interrupted; False if there was none."""
        self._look(now)
        interrupted, self._interrupted = self._interrupted, ()
        for command in interrupted:
            again = replace(command, execute_at=None, pace=bounded(self._pace.pace))
            number = self._send(again, command.motion is Motion.LINE, now)
            self._recent.append((number, again))
            self._bound = number
        return bool(interrupted)

    # The timeline.

    def undo(self, *, now: float) -> str:
        """UNDO."""
        self._look(now)
        self._interrupted, self._delay, self._bound = (), None, None
        self._hand.forget()
        number = self.robot.ask(None, now=now)
        fate = self.robot.fate(number, now=now)
        if fate is None:
            self._open.append((number, False))
            return "The newest command is taken back"
        if fate.reason or fate.receipt is None:
            return "Nothing was taken back" + (f": {fate.reason}" if fate.reason else "")
        return f"Command {fate.receipt.command_id} was taken back"

    def timeline(self, *, now: float) -> list[str]:
        """TIMELINE: number, begin, end and destination of what is scheduled."""
        self._look(now)
        lines = []
        for receipt in self.robot.scheduled(now=now):
            q = receipt.q
            joints = "" if q is None else self._spelled(q)
            lines.append(
                f"{receipt.command_id:6d} {receipt.execute_at:10.3f} {receipt.end:10.3f}  {joints}".rstrip()
            )
        return lines

    def _spelled(self, q: Array) -> str:
        return " ".join(f"{value:8.2f}" for value in self._frames.where(q, 0.0).joints.joints)
