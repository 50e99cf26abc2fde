"""What is asked for the motions to come, and at once."""

from __future__ import annotations

import math

from interfaces.val2.errors import ValError
from interfaces.val2.motion.places import with_word
from interfaces.val2.motion.progress import Progress
from interfaces.val2.motion.speeds import Speed
from interfaces.val2.values import Transformation


class Requests(Progress):
    """Speeds, tolerances, the hand, the frames: what motions are made with."""

    # For the next motion, or those after it.

    def set_hand(self, hand: bool | None) -> None:
        """OPEN, CLOSE, RELAX."""
        self._hand.wanted, self._hand.relax = hand, hand is None

    def set_speed(self, speed: float, *, turn: float | None, unit: str, always: bool) -> None:
        """SPEED."""
        self._manners.set_speed(speed, turn, unit, always)

    def fastest(self, unit: str) -> float:
        """The greatest program speed that counts."""
        return 1.0 / Speed(1.0, unit).linear_share(self.robot.model)

    def set_acceleration(self, up: float, down: float) -> None:
        """ACCEL."""
        self._manners.set_acceleration(up, down)

    def set_duration(self, seconds: float, *, always: bool) -> None:
        """DURATION."""
        self._manners.set_duration(seconds, always)

    def set_tolerance(self, percent: float | None, *, fine: bool, always: bool) -> None:
        """COARSE, FINE."""
        self._manners.set_tolerance(percent, fine, always)

    def tolerance(self) -> tuple[bool, float]:
        """Whether it's FINE, and its percentage."""
        return self._manners.next.fine, self._manners.next.tolerance

    def set_nulling(self, on: bool, *, always: bool) -> None:
        """NULL, NONULL."""
        self._manners.set_nulling(on, always)

    def set_configuration(self, word: str) -> None:
        """RIGHTY, LEFTY, ABOVE, BELOW, FLIP, NOFLIP."""
        self._words = with_word(self._words, word)

    # At once.

    def set_tool(self, tool: Transformation) -> None:
        """TOOL."""
        self._frame(self._frames.with_tool(tool))

    def tool(self) -> Transformation:
        """The tool transformation."""
        return self._frames.tool

    def set_base(self, base: Transformation) -> None:
        """BASE."""
        self._frame(self._frames.with_base(base))

    def base(self) -> Transformation:
        """The base transformation."""
        return self._frames.base

    def set_monitor_speed(self, percent: float, *, now: float) -> None:
        """Monitor speed, at most 100: time alone is stretched."""
        if not 0 < percent < math.inf:
            raise ValError("Illegal value", f"{percent:g}: a speed is above 0 %")
        self._look(now)
        self._pace.set(percent, now=now)

    def monitor_speed(self) -> float:
        """The monitor speed [%]."""
        return self._pace.wanted

    def set_continuous_path(self, on: bool) -> None:
        """ENABLE CP, DISABLE CP."""
        self._continuous = on

    def set_dry_run(self, on: bool) -> None:
        """ENABLE DRY.RUN."""
        if on and self._dry is None:
            self._dry = self.robot.timeline.final()
        elif not on:
            self._dry = None

    def at(self, t: float | None) -> None:
        """AT."""
        if t is not None and not math.isfinite(t):
            raise ValError("Illegal value", "a time is finite")
        self._at = t

    def set_alter(self, mode: int | None, *, now: float) -> None:
        """ALTER, NOALTER."""
        self._look(now)
        self._alterations.set(mode)

    def begin_program(self) -> None:
        """EXECUTE."""
        self._manners.reset()
        self._hand.wanted, self._hand.relax = None, False
        self._words, self._at, self._interrupted = (), None, ()
        self._alterations.set(None)
