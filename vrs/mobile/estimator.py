"""The posture estimator: what the virtual robot knows of where the real one is, and will be.

The operator's side counts its commands. The robot sends its posture with j, the number of commands that it had
*executed* then: command j is its next. Feedback of j corrects the estimate after j commands, and everything
commanded since is replayed from there, eq. (8)–(10).

Source: Han, Kim, Kim, Kim, 2001, section 3.1.
"""

from __future__ import annotations

import enum
from bisect import insort
from collections import deque
from math import cos, sin

from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array
from vrs.errors import InvalidValueError
from vrs.mobile.model import advanced, composed, wrapped
from vrs.model import Array, frozen_array

HISTORY = 8192
"""Commands that are kept: 819 s at ten a second, more than twice the paper's longest delay, 343 s."""

GATHERED = 64
"""Feedback of one index, as of a robot that waits, before the history up to it is closed."""

_Posture = tuple[float, float, float]
_NOWHERE: _Posture = (0.0, 0.0, 0.0)
_Sample = tuple[float, _Posture]
"""The feedback's own number, and the posture."""


class Feedback(enum.StrEnum):
    """What became of feedback."""

    APPLIED = "applied"
    REPEATED = "repeated"
    """It was there before."""
    FORGOTTEN = "forgotten"
    """It's of a command that is no longer kept."""
    UNKNOWN = "unknown"
    """It's of a command that wasn't given yet."""


class _Entry:
    """One command: the estimate before it, what was fed back of that, and where the robot goes from there."""

    __slots__ = ("duration", "estimate", "samples", "v", "w")

    def __init__(self, estimate: _Posture) -> None:
        self.estimate = estimate
        self.samples: list[_Sample] = []
        self.v = self.w = self.duration = 0.0


class PostureEstimator:
    """Estimates the real robot's posture from the commands given and from late postures of it.

    It doesn't matter in what order feedback comes: the estimate is as if it had come in the order of j. Memory is
    bounded: so many commands, and so many feedbacks of one j.
    """

    def __init__(
        self, posture: ArrayLike, *, gain: ArrayLike = 0.5, period: float = 0.1, history: int = HISTORY
    ) -> None:
        """Begin where the robot is thought to be.

        Args:
            posture: (x, y, θ) [m, m, rad], (3,).
            gain: K_e in [0, 1]: the share of the difference that one feedback takes away; one for all or one each
                for x, y and θ.
            period: T, what a command lasts unless it says otherwise [s].
            history: Commands that are kept, at least 1.

        Raises:
            InvalidValueError: If one of them isn't sound.
        """
        x, y, theta = finite_array("posture", posture, (3,), "three finite numbers (x, y, θ)").tolist()
        gains = finite_array("gain", gain, None, "in [0, 1], one number or three")
        if gains.shape not in ((), (3,)) or not ((gains >= 0) & (gains <= 1)).all():
            raise InvalidValueError("gain", gain, "in [0, 1], one number or three")
        if isinstance(history, bool) or not isinstance(history, int) or history < 1:
            raise InvalidValueError("history", history, "an integer from 1")
        self._gain: _Posture = (*gains.tolist(),) if gains.ndim else (float(gains),) * 3
        self._period = _duration(period)
        self._entries: deque[_Entry] = deque([_Entry((x, y, theta))])
        self._history = history
        self.oldest = 0
        """The lowest j of which feedback still counts."""
        self._known = 0
        """Up to this index estimates stand in the entries; beyond it there's no feedback."""
        self._newest = -1
        """The highest index of which there's feedback."""
        self._stale: int | None = None
        """From this index on they must be made anew, up to `_known`."""
        self._ahead: _Posture = (0.0, 0.0, 0.0)
        """The last entry as seen from entry `_known`: what is commanded beyond it moves as a rigid body."""

    @property
    def count(self) -> int:
        """i: commands given so far; the next one has this index."""
        return self.oldest + len(self._entries) - 1

    @property
    def posture(self) -> Array:
        """The estimate after all commands given, (x, y, θ) [m, m, rad], (3,)."""
        return frozen_array(self._last())

    def estimate(self, index: int) -> Array:
        """The corrected estimate after so many commands, (3,).

        Raises:
            InvalidValueError: If it's not kept.
        """
        if not self.oldest <= index <= self.count:
            raise InvalidValueError("index", index, f"from {self.oldest} to {self.count}")
        self._settle()
        if index <= self._known:
            return frozen_array(self._corrected(self._entries[index - self.oldest])[0])
        posture = self._entries[self._known - self.oldest].estimate
        for k in range(self._known, index):
            entry = self._entries[k - self.oldest]
            posture = advanced(posture, entry.v, entry.w, entry.duration)
        return frozen_array(posture)

    def command(self, v: float, w: float, duration: float | None = None) -> int:
        """Take a command into account that is given to the robot.

        Args:
            v: Linear speed [m/s].
            w: Angular speed [rad/s].
            duration: [s]; None is the period.

        Returns:
            Its index, from 0.
        """
        v, w = finite("v", v), finite("w", w)
        lasting = self._period if duration is None else _duration(duration)
        entry = self._entries[-1]
        entry.v, entry.w, entry.duration = v, w, lasting
        index = self.count
        if entry.samples:
            self._settle()
        self._entries.append(_Entry(_NOWHERE))
        if entry.samples:
            # What was fed back of the last entry turns the arc after it.
            self._known = index + 1
            self._entries[-1].estimate = self._after(entry)
        else:
            self._ahead = advanced(self._ahead, v, w, lasting)
        if len(self._entries) > self._history + 1:
            self._settle()
            self._move_on(self.oldest + 1)
            self._entries.popleft()
            self.oldest += 1
        return index

    def feedback(self, index: int, posture: ArrayLike, number: float | None = None) -> Feedback:
        """Correct the history with where the robot was, and replay what was commanded since.

        Args:
            index: j, how many commands the robot had executed.
            posture: Where it was then, (x, y, θ) [m, m, rad], (3,); θ with any number of turns.
            number: The feedback's own number or stamp, which rises: with it, a robot that waits corrects the
                estimate with each of its equal feedbacks. Without it, a feedback like another is that one again.

        Raises:
            InvalidValueError: If the posture or the index isn't sound; nothing is changed.
        """
        x, y, theta = finite_array("posture", posture, (3,), "three finite numbers (x, y, θ)").tolist()
        if isinstance(index, bool) or not isinstance(index, int):
            raise InvalidValueError("index", index, "an integer from 0")
        if index > self.count or index < 0:
            return Feedback.UNKNOWN
        if index < self.oldest:
            return Feedback.FORGOTTEN
        place = index - self.oldest
        entry = self._entries[place]
        measured = x, y, theta
        if number is None:
            if any(sample[1] == measured for sample in entry.samples):
                return Feedback.REPEATED
            entry.samples.append((entry.samples[-1][0] if entry.samples else 0.0, measured))
        else:
            stamp = finite("number", number)
            if any(sample[0] == stamp for sample in entry.samples):
                return Feedback.REPEATED
            insort(entry.samples, (stamp, measured))
        if len(entry.samples) > GATHERED:
            self._settle()
            self._close(place)
        self._newest = max(self._newest, index)
        self._stale = index if self._stale is None else min(self._stale, index)
        return Feedback.APPLIED

    def _last(self) -> _Posture:
        """The estimate after all commands."""
        self._settle()
        if self._known == self.count:
            return self._corrected(self._entries[-1])[0]
        return composed(self._entries[-1 - (self.count - self._known)].estimate, self._ahead)

    def _settle(self) -> None:
        """Make the estimates anew that feedback has changed."""
        stale, self._stale = self._stale, None
        if stale is None:
            return
        self._move_on(min(self._newest + 1, self.count))
        for index in range(max(stale, self.oldest), self._known):
            place = index - self.oldest
            self._entries[place + 1].estimate = self._after(self._entries[place])

    def _move_on(self, index: int) -> None:
        """Let estimates stand in the entries up to an index, if it's further than before."""
        while self._known < index:
            place = self._known - self.oldest
            entry = self._entries[place]
            self._entries[place + 1].estimate = self._after(entry)
            self._ahead = _without(self._ahead, entry)
            self._known += 1

    def _close(self, place: int) -> None:
        """Take what was fed back of a command for good, and forget what came before."""
        entry = self._entries[place]
        first, newest = entry.samples[:-1], entry.samples[-1:]
        entry.samples = first
        entry.estimate = self._corrected(entry)[0]
        entry.samples = newest
        for _ in range(place):
            self._entries.popleft()
        self.oldest += place

    def _corrected(self, entry: _Entry) -> tuple[_Posture, float]:
        """The estimate with what was fed back, and the heading from which the next arc starts [rad]."""
        x, y, theta = entry.estimate
        if not entry.samples:
            return entry.estimate, theta
        kx, ky, kt = self._gain
        for _, (mx, my, mt) in entry.samples:
            x += kx * (mx - x)
            y += ky * (my - y)
            theta += kt * wrapped(mt - theta)
        return (x, y, theta), mt

    def _after(self, entry: _Entry) -> _Posture:
        """Eq. (9) where there's feedback, else eq. (6); the arc is turned by the measured heading."""
        posture, heading = self._corrected(entry)
        return advanced(posture, entry.v, entry.w, entry.duration, heading)


def _without(ahead: _Posture, entry: _Entry) -> _Posture:
    """A posture as seen from the end of an arc, of one as seen from its start."""
    x, y, turn = advanced((0.0, 0.0, 0.0), entry.v, entry.w, entry.duration)
    c, s = cos(turn), sin(turn)
    dx, dy = ahead[0] - x, ahead[1] - y
    return c * dx + s * dy, c * dy - s * dx, ahead[2] - turn


def _duration(value: float) -> float:
    duration = finite("duration", value, "positive seconds")
    if duration <= 0:
        raise InvalidValueError("duration", value, "positive seconds")
    return duration
