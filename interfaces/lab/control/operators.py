"""Who follows a course by what he sees: continuously, or in steps with waits. He knows no delay.

The tracker is the crossover model: he turns an error into a speed at a gain, a reaction time after he saw it.
Whoever sees late does best by moving as far as he dares, then waiting to see what came of it.

Source: McRuer, Jex, A review of quasi-linear pilot models, IEEE Trans. Human Factors in Electronics 8, 1967;
Ferrell, Remote manipulation with transmission delay, IEEE Trans. Human Factors in Electronics 6, 1965.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Final, Protocol, TypeAlias

import numpy as np
from typing_extensions import override

from interfaces.system import checked, is_own, own
from robots.onboard.driving import STAND, Drive, Posture
from vrs.checks import one_of
from vrs.mobile import wrapped
from vrs.model import Array

REACTION: Final = 0.2
"""From what is seen to what is done about it [s]."""
NEAR: Final = 0.1
"""So near to the course's end he is there: as a share of a step."""
DONE: Final = 0.5
"""So much of a step may be left where he takes it as made, as a share."""
STILL: Final = 0.02
"""What he sees move by less than this is at rest: as a share of a step."""
SETTLED: Final = 0.3
"""It has to be at rest for so long [s]."""
PATIENCE: Final = 5.0
"""Where he has seen nothing move for so long, the step was lost or cut short, and he makes another [s]."""


class Course:
    """A line to be followed, in the plane or in space."""

    def __init__(self, points: Array) -> None:
        """Take points (k, d) [m], near to each other."""
        self.points = points
        self.way: Array = np.concatenate([[0.0], np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum()])
        """From the beginning to each point [m], (k,)."""
        self.length = float(self.way[-1])

    def at(self, s: float) -> Array:
        """The point so far along it [m], (d,); the ends beyond."""
        return np.array([np.interp(s, self.way, column) for column in self.points.T])

    def nearest(self, point: Array, low: float = 0.0, high: float = math.inf) -> float:
        """How far along the point nearest to one (d,) is, of those from `low` to `high` [m]."""
        first, last = np.searchsorted(self.way, (low, high))
        piece = self.points[first : max(last, first + 1)]
        return float(self.way[first + int(np.linalg.norm(piece - point, axis=1).argmin())])

    def distance(self, points: Array) -> Array:
        """From points (m, d) to the line [m], (m,)."""
        return np.array([float(np.linalg.norm(self.points - point, axis=1).min()) for point in points])


View: TypeAlias = Array
"""What is seen of a robot: its place, and of a mobile one its heading behind that."""


class Hand(ABC):
    """How a kind of robot is moved: what makes it go to a point."""

    step: float
    """How far is dared without seeing [m]."""
    ahead: float
    """How far ahead on the course the tracker aims [m]."""
    rest: Array
    """What lets it stand."""

    @abstractmethod
    def toward(self, seen: View, aim: Array, left: float) -> Array:
        """What makes the robot go to a point, from what is seen of it, with so much of the course left [m]."""

    @abstractmethod
    def moves(self, seen: View, aim: Array) -> list[tuple[float, Array]]:
        """What brings it there without looking: for how long [s], and what."""

    @abstractmethod
    def place(self, seen: View) -> Array:
        """Where it is seen."""


class CourseOperator(Protocol):
    """Who follows a course by what he sees."""

    @property
    def finished(self) -> bool:
        """Whether he has seen the robot at the course's end."""

    @property
    def waited(self) -> float:
        """For how long he did nothing but wait [s]."""

    def act(self, t: float, seen: View) -> Array:
        """What he does from a time on [s], who sees this now: speeds as his `Hand` has them."""


class Follower:
    """Follows a course to its end without a pause."""

    def __init__(self, course: Course, hand: Hand) -> None:
        """Begin at the course's first point."""
        self._course, self._hand = course, hand
        self._seen: deque[tuple[float, View]] = deque()
        self._s = 0.0
        self.finished = False
        """Whether he has seen the robot at the end."""
        self.waited = 0.0
        """For how long he did nothing but wait [s]."""
        self._now = self._elapsed = 0.0

    def act(self, t: float, seen: View) -> Array:
        """What he does from a time on [s], who sees this now."""
        self._seen.append((t, seen))
        while len(self._seen) > 1 and self._seen[1][0] <= t - REACTION + 1e-9:
            self._seen.popleft()
        self._now, self._elapsed = t, t - self._now
        known = self._seen[0][1]
        place = self._hand.place(known)
        # Where he is on it he knows from before: a course may cross itself.
        self._s = self._course.nearest(place, self._s - 0.5 * self._hand.step, self._s + 2.5 * self._hand.step)
        left = self._course.length - self._s
        if left + float(np.linalg.norm(place - self._course.points[-1])) < NEAR * self._hand.step:
            self.finished = True
        return self._hand.rest if self.finished else self._chosen(known, left)

    def _chosen(self, seen: View, left: float) -> Array:
        return self._hand.toward(seen, self._course.at(self._s + self._hand.ahead), left)


class Stepper(Follower):
    """Moves a step, and waits until he sees it done."""

    def __init__(self, course: Course, hand: Hand) -> None:
        """Begin at the course's first point."""
        super().__init__(course, hand)
        self._moves: deque[tuple[float, Array]] = deque()
        self._aim: Array | None = None
        self._last: tuple[float, View] | None = None
        self._until = 0.0

    @override
    def _chosen(self, seen: View, left: float) -> Array:
        now, step = self._now, self._hand.step
        if self._last is None or float(np.abs(seen - self._last[1]).max()) > STILL * step:
            self._last = now, seen
        if not self._moves and self._done(seen, now - self._last[0]):
            self._aim, begin = self._course.at(self._s + step), now
            for lasting, what in self._hand.moves(seen, self._aim):
                begin += lasting
                self._moves.append((begin, what))
            self._until = begin
        while self._moves and self._moves[0][0] <= now + 1e-9:
            self._moves.popleft()
        if self._moves:
            return self._moves[0][1]
        self.waited += self._elapsed
        return self._hand.rest

    def _done(self, seen: View, still: float) -> bool:
        """Whether he sees that the last step has been made, and the robot at rest, for so long [s]."""
        if self._aim is None or min(still, self._now - self._until) >= PATIENCE:
            return True
        left = float(np.linalg.norm(self._hand.place(seen) - self._aim))
        return left < DONE * self._hand.step and still >= SETTLED


class Wheels(Hand):
    """A mobile robot's: pursuit of a point ahead at a cruising speed; or a turn on the spot and a line."""

    step, ahead, rest = 0.5, 0.35, np.zeros(2)
    cruise: Final = 0.3
    """[m/s]; with that look-ahead the loop crosses over at √2 · 0.3 / 0.35 = 1.2 rad/s."""
    turning: Final = 0.5
    """Largest angular speed [rad/s]."""
    braking: Final = 0.3
    """[m/s²]."""

    @override
    def place(self, seen: View) -> Array:
        return seen[:2]

    def _aside(self, seen: View, aim: Array) -> tuple[float, float]:
        """How far the point is [m], and how far aside [rad]."""
        dx, dy = (aim - seen[:2]).tolist()
        return math.hypot(dx, dy), wrapped(math.atan2(dy, dx) - float(seen[2]))

    @override
    def toward(self, seen: View, aim: Array, left: float) -> Array:
        far, aside = self._aside(seen, aim)
        if abs(aside) > 1.2:
            return np.array([0.0, math.copysign(self.turning, aside)])
        v = min(self.cruise, math.sqrt(2 * self.braking * max(left, 0.01)))
        w = 2.0 * math.sin(aside) / max(far, 0.1) * v
        return np.array([v, min(max(w, -self.turning), self.turning)])

    @override
    def moves(self, seen: View, aim: Array) -> list[tuple[float, Array]]:
        far, aside = self._aside(seen, aim)
        turn = math.copysign(self.turning, aside)
        return [
            (abs(aside) / self.turning, np.array([0.0, turn])),
            (far / self.cruise, np.array([self.cruise, 0.0])),
        ]


class Tool(Hand):
    """An arm's tool: speed in proportion to how far it is from the point, or a straight line at one speed."""

    step, ahead, rest = 0.06, 0.032, np.zeros(3)
    gain: Final = 2.5
    """Where the loop crosses over [1/s]: with that look-ahead the tool goes at 0.08 m/s."""

    @override
    def place(self, seen: View) -> Array:
        return seen

    @override
    def toward(self, seen: View, aim: Array, left: float) -> Array:
        speed: Array = self.gain * (aim - seen)
        return speed * min(1.0, self.gain * self.ahead / max(float(np.linalg.norm(speed)), 1e-9))

    @override
    def moves(self, seen: View, aim: Array) -> list[tuple[float, Array]]:
        way: Array = aim - seen
        far = max(float(np.linalg.norm(way)), 1e-6)
        fast = self.gain * self.ahead
        return [(far / fast, way * (fast / far))]


OPERATORS: Final[dict[str, Callable[[Course, Hand], CourseOperator]]] = {
    "tracker": Follower,
    "move-and-wait": Stepper,
}
"""By the names that the command line has."""


def operator(name: str, course: Course, hand: Hand) -> CourseOperator:
    """Make an operator, who begins at a course's first point.

    Args:
        name: One of `OPERATORS`, or `module:name` of one's own, which is called with the course and the hand.
        course: What he's to follow.
        hand: How the robot is moved.

    Raises:
        InvalidValueError: If there's none of that name, or it makes something else.
        FormatError: If the module can't be imported.
    """
    if is_own(name):
        made: CourseOperator = own("operator", name, ("course", "hand"))(course, hand)
        checked("operator", name, made, ("act", "finished", "waited"))
        return made
    return OPERATORS[one_of("operator", name, OPERATORS, "or MODULE:NAME of your own")](course, hand)


class Driver:
    """One of them as a mobile robot's operator; see `interfaces.lab.driving.operators.Operator`."""

    room = ""

    def __init__(self, who: CourseOperator, start: Posture, *, sees_real: bool) -> None:
        """Let him begin.

        Args:
            who: Who drives.
            start: Where both robots begin.
            sees_real: Whether he sees the real robot, where it was reported last, instead of the virtual one.
        """
        self.who, self.start, self.sees_real = who, start, sees_real

    @property
    def finished(self) -> bool:
        """Whether he's done."""
        return self.who.finished

    def drive(self, t: float, posture: Posture, _before: Drive) -> Drive:
        """See `Operator`."""
        v, w = self.who.act(t, np.array(posture)).tolist()
        return Drive(v, w) if v or w else STAND
