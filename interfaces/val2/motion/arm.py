"""The arm of programs and the monitor: motions become commands on a robot's timeline.

One concept in many lines: what is asked for, how the arm is with it, and what is asked for next share one state.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterable, MutableMapping
from dataclasses import replace
from typing import Final

import numpy as np
from typing_extensions import override

from interfaces.clients.designer import Issued
from interfaces.messages import RefusalCode
from interfaces.teleop.operator import NOT_FOLLOWING
from interfaces.val2.errors import TAKEN, ValError, robot_halted
from interfaces.val2.motion.conventions import ArmConventions, conventions_of
from interfaces.val2.motion.hand import OPEN, REMEMBERED, Gripped, Hand
from interfaces.val2.motion.places import (
    Alterations,
    Frames,
    Where,
    aligned,
    behind,
    in_millimetres,
    location_error,
    shifted,
)
from interfaces.val2.motion.robot import RobotPort
from interfaces.val2.motion.speeds import MonitorSpeed, MotionSettings, SettingsInForce, Speed, bounded, require
from interfaces.val2.rows import numbered
from interfaces.val2.values import Location, PrecisionPoint, Transformation
from robots.robot import Robot
from vrs.commands import (
    Alter,
    Cancel,
    Command,
    Grip,
    Insertion,
    JointTarget,
    Motion,
    MotionCommand,
    PoseTarget,
    Stop,
)
from vrs.engine import Engine
from vrs.ledger import Receipt
from vrs.model import Array
from vrs.planning.altering import DELAY

_POLL: Final = 0.01
"""How often it's looked whether an answer has come [s]."""
_NULL_POLL: Final = 0.05
"""How often it's looked whether the other twin is there [s]."""
_NULL_PATIENCE: Final = 5.0
"""How long NULL waits for it [s]."""
_FINGERS_TAKE: Final = 0.4
"""So long after they were told fingers have come to where they go, or to something in between [s]."""
_FELT_PATIENCE: Final = 5.0
"""How long it's waited to hear of that [s]."""
_FINE: Final = math.radians(0.2)
"""100 % of FINE: errors of joints that count as none [rad]."""
_COARSE: Final = math.radians(2.0)
_ELSEWHERE: Final = 1e-5
"""Joints of an end that differ by more from the destination [rad]."""
_RECENT: Final = 4
"""Motions that may be interrupted at once: the one under way, and what is asked for ahead."""
_RENEWAL: Final = 0.084
"""After how long corrections that add up are asked for again [s], before they'd begin to go back."""
_ALTERED_SPEED: Final = 0.8
"""Share of the nominal speeds that a motion takes at most while ALTER is on."""
_ALTERED_ACCELERATION: Final = 0.5
_LISTED: Final = 256
"""Newest commands that are looked through for what isn't over."""


class Arm(SettingsInForce):
    """The arm of a robot, as programs and the monitor see it.

    Every method that asks for something raises ValError where that can't be, and then has changed nothing. Times
    are session time [s]. Whoever asks for a motion asks `ready` first; where the robot is elsewhere, the answer to
    what was asked comes later, and `answered` says when.

    With CP on, a motion begins while the one before it brakes. One motion is asked for ahead of the one under way.
    """

    def __init__(
        self,
        robot: RobotPort,
        *,
        conventions: ArmConventions | None = None,
        parameters: MutableMapping[str, float] | None = None,
        gripped: Gripped | None = None,
    ) -> None:
        """Command a robot.

        Args:
            robot: The robot.
            conventions: What VAL's numbers mean on it; what they mean on its model alone unless given.
            parameters: Shared with the interpreter; of them HAND.TIME [s] is read.
            gripped: Is told when the hand takes hold of something or lets go [s].
        """
        super().__init__()
        self.robot = robot
        self.parameters: MutableMapping[str, float] = {} if parameters is None else parameters
        bare = Robot(robot.model.name, robot.model)
        self._frames = Frames(robot.model, conventions=conventions or conventions_of(bare))
        self._frames_since = deque([(-math.inf, self._frames)], maxlen=REMEMBERED)
        """Since when TOOL and BASE have been which [s]."""
        self._hand = Hand(self.parameters, gripped, self._grip if robot.has_fingers else None)
        self._gripped_at = -math.inf
        """When fingers were told something last [s]."""
        self._alterations = Alterations()
        self._pace = MonitorSpeed(robot)
        self._continuous = True
        self._dry: Array | None = None
        """Where a dry run would be by now [rad], (6,); None outside of one."""
        self._at: float | None = None
        self._delay: tuple[float, float] | None = None
        """When a DELAY may begin at the earliest, and how long it lasts [s]."""
        self._unanswered: deque[int] = deque()
        """What has no answer yet."""
        self._recent: deque[tuple[int, MotionCommand]] = deque(maxlen=_RECENT)
        self._interrupted: tuple[MotionCommand, ...] = ()
        self._asked_ahead: tuple[int, ...] = ()
        """What was asked for ahead when somebody else took the arm over."""
        self._awaited: int | None = None
        """The motion at whose destination the arm is to arrive; None where it's stopped, or has arrived."""
        self._correction: int | None = None
        """The newest correction by ALTOUT of an arm that stands."""
        self._altered_at = -math.inf
        """For when the newest correction on the way was meant [s]."""
        self._planned: Array | None = None
        """Where the newest motion goes without corrections on the way [rad], (6,); None where there are none."""
        self._last_settings = MotionSettings()
        """How the newest motion was asked for."""
        self._now = -math.inf

    # Where it is.

    def here(self, *, now: float) -> Where:
        """Where the operator's arm is, the virtual one; its hand is as open as the real one was measured to be."""
        here, hand = self.past(now, now=now), self.robot.other.hand
        return replace(here, hand=1000.0 * hand.opening) if hand is not None and self._measured() else here

    def felt(self, *, now: float) -> bool:
        """Whether it's known where the fingers came to, or it has been waited for that for long enough."""
        self._update(now)
        return self.robot.other.hand is None or self._measured() or now >= self._gripped_at + _FELT_PATIENCE

    def _measured(self) -> bool:
        """Whether the real fingers were measured when they had done what they were told last."""
        return self.robot.other.hand_at >= self._gripped_at + _FINGERS_TAKE

    def _grip(self, opening: float | None) -> None:
        """Let the fingers go to an opening [mm]; None: to where they are."""
        hand = self.robot.other.hand
        if opening is None:
            opening = 1000.0 * hand.opening if hand is not None else self._hand.opening(self._now)
        command = Grip(math.inf if opening >= OPEN else opening / 1000.0)
        self._gripped_at = self._now
        self._unanswered.append(self.robot.ask(command, now=self._now))

    def destination(self, *, now: float) -> Where:
        """Where it goes: where it is, if it goes nowhere."""
        self._update(now)
        return self._frames.where(self._goal(), self._hand.goal)

    def real(self, *, now: float) -> Where | None:
        """Where the other twin was measured last; None where there's none."""
        q = self.robot.other.q
        return None if q is None else self._frames.where(q, self._hand.opening(now))

    def past(self, t: float, *, now: float) -> Where:
        """REWIND, ours: where the arm was at a time [s]."""
        self._update(now)
        frames = self._frames_since[max(bisect_right(self._frames_since, t, key=lambda since: since[0]) - 1, 0)][1]
        return frames.where(self.robot.timeline.sample(t), self._hand.opening(t, self._begins))

    def _set_frames(self, frames: Frames) -> None:
        """Let tool and base be others from now on."""
        self._frames = frames
        self._frames_since.append((self._now, frames))

    def _goal(self) -> Array:
        """Joints at the destination [rad], (6,), without what corrections on the way add."""
        if self._dry is not None:
            return self._dry
        if self._planned is None:
            return self.robot.timeline.final()
        receipt = self._newest()
        return self._planned if receipt is None or receipt.q is None else receipt.q

    def reaches(self, location: Location, *, now: float) -> bool:
        """Whether a motion could go there: INRANGE."""
        self._update(now)
        try:
            self._frames.solve(location, self._goal(), ())
        except ValError:
            return False
        return True

    # What it waits for.

    def _update(self, now: float) -> None:
        self._now = now
        self._pace.advance(now=now)
        self._hand.begin(self._begins, now)

    def _begins(self, number: int) -> float | None:
        """When a motion begins [s]; None while that's unknown. One that was taken back has begun."""
        outcome = self.robot.outcome(number, now=self._now)
        if outcome is None:
            return None
        receipt = outcome.receipt
        known = receipt is not None and receipt.execute_at is not None and not receipt.undone
        return receipt.execute_at if receipt is not None and known else self._now

    def _delay_span(self) -> tuple[float, float]:
        """When the DELAY begins and ends [s]; in the past where there's none."""
        if self._delay is None:
            return -math.inf, -math.inf
        earliest, seconds = self._delay
        begin = max(earliest, self._motion_end())
        return begin, begin + seconds

    def answered(self, *, now: float) -> bool:
        """Whether all that was asked has been answered.

        Raises:
            ValError: If it was refused; once, and then it counts as answered.
        """
        self._update(now)
        while self._unanswered:
            outcome = self.robot.outcome(self._unanswered[0], now=now)
            if outcome is None:
                return False
            self._unanswered.popleft()
            if outcome.reason:
                raise _refusal(outcome)
        self._check_interrupted(now)
        return not self._pace.waits

    def _check_interrupted(self, now: float) -> None:
        """See that nothing else has stopped the arm.

        Raises:
            ValError: If the real arm stopped on the way, or the way ends somewhere else. RETRY is for the motion.
        """
        if self._awaited is None or (outcome := self.robot.outcome(self._awaited, now=now)) is None:
            return
        receipt, why = outcome.receipt, self.robot.other.halted
        if receipt is None or receipt.q is None or receipt.undone:
            self._awaited = None
            return
        ends = math.inf if receipt.end is None else receipt.end
        if why and now < ends:
            self._give_up(now, ends)
            raise ValError("Motion interrupted", f"the real arm has stopped: {why}")
        altered = self._alterations.on_way is not None
        if now >= self._end() or (altered and not receipt.stands):
            if self.robot.lost:
                self._give_up(now, math.inf)
                raise ValError("Motion interrupted", "there's no connection: where the arm is isn't known")
            away = np.abs(self.robot.timeline.final() - receipt.q).max() > _ELSEWHERE
            if not receipt.stands if altered else away:
                self._give_up(now, math.inf)
                raise ValError("Motion interrupted", "the arm was stopped before its destination")
            self._awaited = None

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
            self.next = self._last_settings
            self._hand.forget()
        self._recent.clear()
        self._delay = self._at = self._awaited = self._planned = self._alterations.on_way = None

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
        return max(self._motion_end(), self._delay_span()[1])

    def _motion_end(self) -> float:
        """When the newest motion ends [s]; with what corrections on the way last where none more are to come."""
        if self._alterations.on_way is None or self._alterations.ends:
            return self.robot.timeline.end
        return self.robot.timeline.end if self._newest() is None else self._arrival()

    def _nulled(self, now: float) -> bool:
        """Whether the other twin is there, where a motion was to end so."""
        q = self.robot.other.q if self._last_settings.nulling and self._dry is None else None
        if q is None or now >= self._end() + _NULL_PATIENCE:
            return True
        allowed = (_FINE if self._last_settings.fine else _COARSE) * self._last_settings.tolerance / 100.0
        return bool(np.abs(q - self.robot.timeline.final()).max() <= allowed)

    def next_deadline(self) -> float:
        """When any of these may change by itself [s]; infinity for never."""
        now, (delayed, ends) = self._now, self._delay_span()
        times = [self._motion_end(), self._hand.end, self._pace.next_deadline(), delayed, ends, self.renewal()]
        if self._awaited is not None:
            times.append(now + self.robot.fault_poll_interval)
        if self._recent:
            begins = self._begins(self._recent[-1][0])
            times.append(now + _POLL if begins is None else begins)
        if self._unanswered or self._pace.waits:
            times.append(now + _POLL)
        if self._last_settings.nulling and now >= self._end() and not self._nulled(now):
            times.append(now + _NULL_POLL)
        return min((t for t in times if t > now), default=math.inf)

    def renewal(self) -> float:
        """When `renew` has something to do [s]; infinity for never."""
        alterations = self._alterations
        if alterations.on_way is None:
            return self._arrival() if alterations.ends else math.inf
        if self._goes_on():
            return self._altered_at + _RENEWAL
        return math.inf if alterations.cumulative and not alterations.ends else self.robot.timeline.end

    def renew(self, *, now: float) -> None:
        """Let corrections that add up stay on the path while it goes on; forget those that are gone."""
        now = self._now = max(now, self._now)
        if now < self.renewal():
            return
        offset = self._alterations.on_way
        if offset is not None and self._goes_on():
            self._add(offset, now, now)
        else:
            self._keep(now)

    def _goes_on(self) -> bool:
        """Whether the arm is on a motion on which corrections that add up wouldn't stay by themselves."""
        return self._alterations.cumulative and self._altered_at + DELAY < self._arrival()

    def _over(self, now: float) -> bool:
        """Whether NOALTER has ended corrections on the way: the arm has arrived."""
        return self._alterations.ends and now >= self._arrival()

    def _arrival(self) -> float:
        """When the newest motion ends, whatever corrections on the way last [s]; in the past where there's none."""
        receipt = self._newest()
        return -math.inf if receipt is None or receipt.end is None or not receipt.stands else receipt.end

    def _newest(self) -> Receipt | None:
        """Of the newest motion; None while that's unknown."""
        outcome = self.robot.outcome(self._recent[-1][0], now=self._now) if self._recent else None
        return None if outcome is None else outcome.receipt

    def _keep(self, now: float) -> None:
        """The path goes on from where corrections on the way have led."""
        alterations = self._alterations
        if alterations.on_way is not None and alterations.cumulative:
            self.robot.ask(Alter(), now=now)
            # It has arrived, though elsewhere.
            self._awaited = None if self._arrival() > -math.inf else self._awaited
        alterations.on_way = self._planned = None
        if alterations.ends:
            alterations.set(None)

    def _add(self, offset: Transformation, given: float, now: float) -> Issued | None:
        """Add corrections to the path on the way; what came of it, None while nothing was heard."""
        if self._alterations.on_way is None:
            self._planned = self.robot.timeline.final()
        command = replace(self._alterations.command(offset, self._frames), issued_at=given)
        number = self.robot.ask(command, now=now)
        self._alterations.on_way, self._altered_at = offset, given
        return self.robot.outcome(number, now=now)

    def _moves(self, now: float) -> bool:
        """Whether the arm is on a motion that a program or the monitor asked for, and no correction by ALTOUT."""
        return bool(self._recent) and self._recent[-1][0] != self._correction and now < self.robot.timeline.end

    def _send(self, command: Command, now: float) -> int:
        number = self.robot.ask(command, now=now)
        outcome = self.robot.outcome(number, now=now)
        if outcome is None:
            self._unanswered.append(number)
        elif outcome.reason:
            raise _refusal(outcome)
        return number

    def _go(self, command: MotionCommand, now: float) -> int:
        """Ask for a motion, at whose destination the arm is to arrive."""
        number = self._awaited = self._send(command, now)
        self._recent.append((number, command))
        return number

    # Motions.

    def move(self, target: Location, *, straight: bool, hand: float | bool | None = None, now: float) -> None:
        """MOVE, MOVES; with a hand MOVET, MOVEST: an opening [mm], or open or closed."""
        self._move(target, straight, now, hand=hand)

    def approach(self, target: Location, distance: float, *, straight: bool, now: float) -> None:
        """APPRO, APPROS: to a distance [mm] behind a location along its tool axis."""
        self._move(behind(self._frames.place(target), distance), straight, now)

    def depart(self, distance: float, *, straight: bool, now: float) -> None:
        """DEPART, DEPARTS: back from the destination along its tool axis [mm]."""
        self._move(behind(self.destination(now=now).tool, distance), straight, now)

    def drive(self, joint: int, change: float, speed: float, *, now: float) -> None:
        """DRIVE: turn a joint, 1 to 6, by a change [deg] at a speed [%]."""
        numbered("joint", joint)
        require(0 < speed < math.inf, speed, "a speed is above 0 %")
        joints = list(self.destination(now=now).joints.joints)
        joints[joint - 1] += change
        self._move(PrecisionPoint(tuple(joints)), False, now, speed=Speed(speed))

    def draw(self, dx: float, dy: float, dz: float, *, now: float) -> None:
        """DRAW: straight by a way in world axes [mm] from the destination."""
        self._move(shifted(self.destination(now=now).tool, dx, dy, dz), True, now)

    def go_ready(self, *, now: float) -> None:
        """READY."""
        self._move(self._frames.conventions.ready, False, now)

    def nest(self, *, now: float) -> None:
        """NEST."""
        self._move(self._frames.conventions.nest, False, now)

    def align(self, *, now: float) -> None:
        """ALIGN: turn the tool's axis to the nearest world axis."""
        self._move(aligned(self.destination(now=now).tool), False, now)

    def delay(self, seconds: float, *, now: float) -> None:
        """DELAY: stand still for a time [s], as a motion."""
        require(0 <= seconds < math.inf, seconds, "a delay is 0 or above")
        self._update(now)
        if self._dry is None:
            self._delay = max(now, self._delay_span()[1]), seconds

    def actuate(self, hand: float | bool | None, *, now: float) -> None:
        """OPENI (True, or an opening [mm]), CLOSEI (False, or one), RELAXI (None): now, where the arm stands.

        `settled` waits for it.
        """
        self._update(now)
        if self._dry is None:
            self._hand.actuate(hand, now)

    def alter(self, values: tuple[float, ...], *, now: float) -> str:
        """ALTOUT: on the way a correction of the path; of an arm that stands, a motion.

        What was asked for the next motion, its speed and the hand, waits for that.

        Returns:
            What keeps the arm from following in time; empty where nothing does, or while that isn't known.
        """
        self._update(now)
        self.renew(now=now)
        if self._alterations.on_way is not None or self._moves(now):
            outcome = self.correct(values, given=now, now=now)
            if outcome is not None and outcome.reason:
                raise ValError("Path can't be altered so", in_millimetres(outcome.reason))
            return "" if outcome is None or outcome.receipt is None else outcome.receipt.hindrance
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
            self._correction = self._go(command, now)
            self._delay = None
        self._alterations.taken(place)
        return ""

    def correct(self, values: tuple[float, ...], *, given: float, now: float) -> Issued | None:
        """Correct the path on the way, as ALTOUT does while the arm moves; wherever it is.

        Args:
            values: X, Y, Z [mm], and the turn of the tip: a rotation vector's x, y, z [deg].
            given: When the correction was made [s].
            now: Session time [s].

        Returns:
            What came of it; None while nothing was heard.

        Raises:
            ValError: If the path isn't altered, or the values aren't six finite numbers.
        """
        self._update(now)
        if self._over(now):
            raise ValError("Path isn't altered", "NOALTER has ended it")
        offset = self._alterations.added(values)
        if self._dry is not None:
            return None
        return self._add(offset, given, now)

    def altering(self, channel: int, *, now: float) -> bool:
        """Whether the path is altered by corrections that come on a channel."""
        return self.altered_since(now=now) is not None and self._alterations.channel == channel

    def altered_since(self, *, now: float) -> float | None:
        """Since when the path is altered [s]; None while it isn't."""
        self.renew(now=now)
        return None if self._alterations.mode is None or self._over(self._now) else self._alterations.since

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
        self._update(now)
        turns = not straight and isinstance(target, Transformation)
        near, words = self._goal(), self.next.words
        manner = self.next if hand is None else replace(self.next, hand=hand)
        manner = manner if turns else replace(manner, words=())
        if self._dry is not None:
            self._dry = self._frames.solve(target, near, manner.words)
        else:
            rolls = self._continuous and self._delay is None and self._at is None
            rolls = rolls and set(manner.words) <= set(self._frames.configured(near) if manner.words else ())
            command = MotionCommand(
                target=PoseTarget(self._frames.pose(target))
                if straight and isinstance(target, Transformation)
                else JointTarget(self._solved(target, near, manner)),
                execute_at=self._start(now),
                speed=self._speed_share(target, straight, near, manner.speed if speed is None else speed),
                motion=Motion.LINE if straight else Motion.JOINT,
                insertion=Insertion.APPEND,
                deviation=math.inf if rolls else 0.0,
                pace=bounded(self._pace.pace),
                acceleration=manner.acceleration,
                tool=self._frames.tip() if straight else None,
            )
            if self._alterations.mode is not None:
                # What is left of the limits is for corrections on the way.
                command = replace(
                    command,
                    speed=min(command.speed, _ALTERED_SPEED),
                    acceleration=min(command.acceleration, _ALTERED_ACCELERATION),
                )
            if manner.duration > 0:
                command = self._stretched(command, near, manner.duration)
            number = self._go(command, now)
            if manner.hand is not None or manner.relaxes:
                self._hand.ask(number, manner.hand)
            self._hand.begin(self._begins, now)
        self._last_settings, self._delay, self._at = manner, None, None
        self.next = self.always if turns else replace(self.always, words=words)

    def _solved(self, target: Location, near: Array, manner: MotionSettings) -> Array:
        q = self._frames.solve(target, near, manner.words)
        if manner.single and isinstance(target, Transformation):
            turned = np.array(q)
            turned[5] = math.remainder(q[5], 2.0 * math.pi)
            limits = self.robot.model.limits
            q = turned if limits.q_min[5] <= turned[5] <= limits.q_max[5] else q
        return q

    def _start(self, now: float) -> float | None:
        """When the next motion is to begin [s]; None for as soon as it can."""
        ends = self._delay_span()[1]
        if self._at is not None:
            return max(self._at, ends)
        return ends if ends > now else None

    def _speed_share(self, target: Location, straight: bool, near: Array, speed: Speed) -> float:
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
        self._update(now)
        self._give_up(now, self.robot.timeline.end)
        if now < self.robot.timeline.end or self._unanswered:
            self._send(Stop(), now)

    def give_up(self, *, now: float) -> None:
        """Somebody else commands the arm: what isn't over is for RETRY, and no answer is waited for any more."""
        self._update(now)
        outcome = None if self._awaited is None else self.robot.outcome(self._awaited, now=now)
        end = None if outcome is None or outcome.receipt is None else outcome.receipt.end
        self._asked_ahead = tuple(n for n, _ in self._recent if (begins := self._begins(n)) is None or begins > now)
        self._give_up(now, math.inf if end is None else end)
        self._unanswered.clear()

    def withdraw(self, *, now: float) -> None:
        """Take out of the plan what `give_up` found asked for ahead, as far as it has been accepted."""
        ahead, self._asked_ahead = self._asked_ahead, ()
        for number in ahead:
            outcome = self.robot.outcome(number, now=now)
            receipt = None if outcome is None else outcome.receipt
            if receipt is not None and receipt.stands:
                self.robot.ask(Cancel(receipt.command_id), now=now)

    def retry(self, *, now: float) -> bool:
        """Ask again for the motion that `brake` interrupted; False if there was none."""
        self._update(now)
        interrupted, self._interrupted = self._interrupted, ()
        for command in interrupted:
            again = replace(command, execute_at=None, pace=bounded(self._pace.pace))
            self._go(again, now)
        return bool(interrupted)

    # The timeline.

    def undo(self, *, now: float) -> str:
        """UNDO, ours: take back the newest command; what became of it, one line."""
        self._update(now)
        self._interrupted, self._delay, self._awaited = (), None, None
        self._planned = self._alterations.on_way = None
        self._hand.forget()
        self.next = replace(self.next, hand=None, relaxes=False)
        number = self.robot.ask(None, now=now)
        outcome = self.robot.outcome(number, now=now)
        if outcome is None:
            self._unanswered.append(number)
            return "The newest command is taken back"
        if outcome.reason or outcome.receipt is None:
            return "Nothing was taken back" + (f": {outcome.reason}" if outcome.reason else "")
        return f"Command {outcome.receipt.command_id} was taken back"

    def timeline(self, *, now: float) -> list[str]:
        """TIMELINE: number, begin, end and destination of what is scheduled."""
        self._update(now)
        lines = []
        newest = self.robot.newest
        outcomes = (self.robot.outcome(n, now=now) for n in range(max(newest - _LISTED, 0) + 1, newest + 1))
        for receipt in _standing((o.receipt for o in outcomes if o is not None and o.receipt is not None), now):
            joints = ""
            if receipt.q is not None:
                at = self._frames.where(receipt.q, 0.0).joints
                joints = " ".join(f"{value:8.2f}" for value in at.joints)
            lines.append(
                f"{receipt.command_id:6d} {receipt.execute_at:10.3f} {receipt.end:10.3f}  {joints}".rstrip()
            )
        return lines

    # For the next motion, or those after it.

    def fastest(self, unit: str) -> float:
        """The greatest program speed that counts, in a unit of `%`, `MMPS` or `IPS`."""
        return 1.0 / Speed(1.0, unit).linear_share(self.robot.model)

    def tolerance(self) -> tuple[bool, float]:
        """Whether FINE is in force, and its percentage."""
        return self.next.fine, self.next.tolerance

    @override
    def set_configuration(self, word: str) -> None:
        if not self._frames.conventions.words:
            said = f"{word}: {self.robot.model.name} has no names of configurations; allowed: MOVE #point"
            raise ValError("Not available", said)
        super().set_configuration(word)

    # At once.

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of its joints; none where they have numbers alone."""
        return self._frames.conventions.names

    def set_tool(self, tool: Transformation) -> None:
        """TOOL."""
        self._set_frames(replace(self._frames, tool=tool))

    def tool(self) -> Transformation:
        """The tool transformation."""
        return self._frames.tool

    def set_base(self, base: Transformation) -> None:
        """BASE: where the robot stands in the world in which locations are."""
        self._set_frames(replace(self._frames, base=base))

    def base(self) -> Transformation:
        """The base transformation."""
        return self._frames.base

    def set_monitor_speed(self, percent: float, *, now: float) -> None:
        """Monitor speed, at most 100: time alone is stretched."""
        require(0 < percent < math.inf, percent, "a speed is above 0 %")
        self._update(now)
        self._pace.set(percent, now=now)

    def monitor_speed(self) -> float:
        """The monitor speed [%]."""
        return self._pace.wanted

    def set_continuous_path(self, on: bool) -> None:
        """ENABLE CP, DISABLE CP."""
        self._continuous = on

    def set_dry_run(self, on: bool) -> None:
        """ENABLE DRY.RUN: motions take no time and move nothing."""
        if on and self._dry is None:
            self._dry = self.robot.timeline.final()
        elif not on:
            self._dry = None

    def at(self, t: float | None) -> None:
        """AT, ours: execution time of the next motion [s]; None for as soon as it can."""
        if t is not None and not math.isfinite(t):
            raise ValError("Illegal value", "a time is finite")
        self._at = t

    def set_alter(self, mode: int | None, channel: int = 0, *, now: float) -> None:
        """ALTER with a mode's bits (1: cumulative, 2: world axes, those of BASE), NOALTER with None.

        What corrections on the way add up to stays until the arm stands.
        """
        self._update(now)
        alterations = self._alterations
        if mode is None and alterations.mode is not None:
            alterations.ends = True
            self.renew(now=now)
            return
        if alterations.on_way is not None:
            self._keep(now)
        alterations.set(mode, channel, self._now)

    def begin_program(self) -> None:
        """EXECUTE: speeds, tolerances and requests are as at the beginning."""
        self.always = self.next = MotionSettings()
        self._at, self._interrupted = None, ()
        if self._alterations.on_way is not None:
            self._keep(self._now)
        self._alterations.set(None)


def _refusal(outcome: Issued) -> ValError:
    """What a refusal is in VAL's words."""
    if outcome.code is RefusalCode.OVERRULED:
        return ValError("Motion interrupted", TAKEN)
    if outcome.receipt is None:
        return ValError("Command refused", outcome.reason)
    if outcome.code is RefusalCode.NOT_FOLLOWING:
        why = outcome.reason.removeprefix(f"{NOT_FOLLOWING}: ").removesuffix("; resume first")
        return robot_halted(why)
    if isinstance(outcome.command, MotionCommand) and outcome.command.motion is Motion.LINE:
        return ValError(
            "Straight line not possible", in_millimetres(outcome.reason.removeprefix("no straight line: "))
        )
    return location_error(outcome.reason)


def _standing(receipts: Iterable[Receipt], now: float) -> tuple[Receipt, ...]:
    """Those that are to be carried out and aren't over at a time [s], in the order of their beginning."""
    known = {receipt.command_id: receipt for receipt in receipts if receipt.end is not None and not receipt.undone}
    chosen = []
    for receipt in known.values():
        by = known.get(receipt.superseded_by or 0)
        # One that the next begins before it's over gives way to that; anything else drops it.
        if by is not None and by.q is not None and receipt.q is not None:
            after = known.get(by.superseded_by or 0, by)
            begins = min(by.execute_at or 0.0, after.execute_at or 0.0)
            lasting = replace(receipt, end=begins)
        elif receipt.superseded_by is None:
            lasting = receipt
        else:
            continue
        if (lasting.end or 0.0) > now:
            chosen.append(lasting)
    return tuple(sorted(chosen, key=lambda receipt: (receipt.execute_at or 0.0, receipt.command_id)))
