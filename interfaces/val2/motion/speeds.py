"""How fast motions go: VAL's program speed, accelerations and durations, and the monitor speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from interfaces.val2.errors import ValError
from interfaces.val2.motion.places import with_word
from interfaces.val2.motion.robot import RobotPort
from vrs.commands import ScaleTime
from vrs.model import Array, RobotModel

SLOWEST: Final = 1e-3
"""Least share of a speed."""
INCH: Final = 25.4
"""[mm]."""


def require(holds: bool, value: float | None, allowed: str) -> None:
    """See that a value is one that may be.

    Raises:
        ValError: If it isn't.
    """
    if not holds:
        raise ValError("Illegal value", f"{value:g}: {allowed}")


@dataclass(frozen=True, slots=True)
class Speed:
    """A program speed."""

    value: float = 100.0
    """In its unit."""
    unit: str = "%"
    """`%`, `MMPS` or `IPS`."""
    turn: float = 100.0
    """Of turning [%], for straight lines."""

    def linear_share(self, model: RobotModel) -> float:
        """Share of the tool's nominal speed."""
        if self.unit == "%":
            return self.value / 100.0
        return self.value * (INCH if self.unit == "IPS" else 1.0) / 1000.0 / model.tool_speed

    def share(self, model: RobotModel) -> float:
        """Share of the nominal speeds for a joint-interpolated motion."""
        return bounded(self.linear_share(model))

    def line_share(self, model: RobotModel, start: Array, goal: Array) -> float:
        """Share of the nominal speeds for a straight line between poses of the tool's tip, (4, 4) [m].

        It's the share at which neither way nor turn is faster than it may be.
        """
        way = float(np.linalg.norm(goal[:3, 3] - start[:3, 3])) / model.tool_speed
        cosine = 0.5 * (float(np.sum(goal[:3, :3] * start[:3, :3])) - 1.0)
        turn = math.acos(min(max(cosine, -1.0), 1.0)) / model.tool_turn_speed
        slowest = max(way / self.linear_share(model), turn / (self.turn / 100.0))
        return bounded(max(way, turn) / slowest) if slowest > 0 else self.share(model)


def bounded(share: float) -> float:
    """A share between the least and all of it."""
    return min(max(share, SLOWEST), 1.0)


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """How a motion is made."""

    speed: Speed = Speed()
    acceleration: float = 1.0
    """Share of the limits, in [0.01, 1]."""
    duration: float = 0.0
    """Least time that it takes [s]; 0 for none."""
    fine: bool = False
    tolerance: float = 100.0
    """How near counts as there [%]."""
    nulling: bool = False
    """Whether its end waits for the other twin."""
    words: tuple[str, ...] = ()
    """What is asked for of the configuration."""
    single: bool = False
    """Whether joint 6 stays within half a turn, of a joint-interpolated motion to a transformation."""
    hand: float | bool | None = None
    """What the hand does as it begins: an opening [mm], open or closed; None for nothing."""
    relaxes: bool = False
    """Whether the hand is relaxed then."""


class SettingsInForce:
    """What holds for the next motion, and what for all after it."""

    def __init__(self) -> None:
        self.always = self.next = MotionSettings()

    def set_hand(self, hand: float | bool | None) -> None:
        """OPEN, CLOSE, RELAX, or to an opening [mm]: with the next motion."""
        self._change(False, hand=hand, relaxes=hand is None)

    def set_configuration(self, word: str) -> None:
        """RIGHTY, LEFTY, ABOVE, BELOW, FLIP, NOFLIP: at the next joint-interpolated motion to a transformation."""
        self._change(False, words=with_word(self.next.words, word))

    def set_turns(self, single: bool, always: bool) -> None:
        """SINGLE, MULTIPLE."""
        self._change(always, single=single)

    def _change(self, always: bool, **changes: object) -> None:
        self.next = replace(self.next, **changes)  # type: ignore[arg-type]
        if always:
            self.always = replace(self.always, **changes)  # type: ignore[arg-type]

    def set_speed(self, speed: float, turn: float | None, unit: str, always: bool) -> None:
        """SPEED; in percent it's the speed of turning, too, unless that's given."""
        for value in (speed, turn):
            require(value is None or 0 < value < math.inf, value, "a speed is above 0")
        if turn is None:
            turn = speed if unit == "%" else 100.0
        self._change(always, speed=Speed(speed, unit, turn))

    def set_acceleration(self, up: float, down: float) -> None:
        """ACCEL; the smaller counts for both."""
        for value in (up, down):
            require(0 < value < math.inf, value, "an acceleration is above 0")
        self._change(True, acceleration=min(max(min(up, down) / 100.0, 0.01), 1.0))

    def set_duration(self, seconds: float, always: bool) -> None:
        """DURATION."""
        require(0 <= seconds < math.inf, seconds, "a duration is 0 or above")
        self._change(always, duration=seconds)

    def set_tolerance(self, percent: float | None, fine: bool, always: bool) -> None:
        """COARSE, FINE."""
        percent = 100.0 if percent is None else percent
        require(0 < percent < math.inf, percent, "a tolerance is above 0 %")
        self._change(always, fine=fine, tolerance=percent)

    def set_nulling(self, on: bool, always: bool) -> None:
        """NULL, NONULL."""
        self._change(always, nulling=on)


_AGAIN: Final = 0.05
"""After how long a change that was refused is asked for again at the earliest [s]."""


class MonitorSpeed:
    """The monitor speed that is wanted, and that which the timeline has.

    The way to a slower pace takes a while, during which a faster one may be refused; it's asked for again then.
    """

    def __init__(self, robot: RobotPort) -> None:
        self._robot = robot
        self.wanted = self._held = self._asked = 100.0
        self._number: int | None = None
        self._changed = self._again = -math.inf

    @property
    def pace(self) -> float:
        """Of motions that are asked for now."""
        return self._held / 100.0

    @property
    def waits(self) -> bool:
        """Whether a change has no answer yet."""
        return self._number is not None

    def set(self, percent: float, *, now: float) -> None:
        """Want another speed [%], above 0; at most 100 count."""
        self.wanted, self._again = min(max(percent, 0.1), 100.0), now
        self.advance(now=now)

    def advance(self, *, now: float) -> None:
        """Take the answer to what was asked, and ask for what is wanted."""
        self._hear(now)
        if self.wanted == self._held or self.waits or now < self._again:
            return
        if now >= self._robot.timeline.end:
            self._held = self.wanted
            return
        self._asked = self.wanted
        self._number = self._robot.ask(ScaleTime(self.wanted / self._held), now=now)
        self._hear(now)

    def _hear(self, now: float) -> None:
        outcome = None if self._number is None else self._robot.outcome(self._number, now=now)
        if outcome is None:
            return
        self._number = None
        if outcome.reason:
            self._again = max(self._changed, now + _AGAIN)
        else:
            self._held = self._asked
            self._changed = now if outcome.receipt is None or outcome.receipt.end is None else outcome.receipt.end

    def next_deadline(self) -> float:
        """When something is to be asked for again [s]; infinity for never."""
        return self._again if self.wanted != self._held and not self.waits else math.inf
