"""A path of a mobile robot: arcs and pivots with a direction of travel, and how far along it the robot is.

A path has its own sense: s grows along it, θ_d is the direction in which it's travelled (for a robot that reverses,
its heading + π), and what lies on the left of that direction has a positive l. A *stretch* is driven without
standing: it ends where the path pivots, reverses or ends.

`MovingPath.drive` is the path generator: it restores the moving path of the virtual robot from its commands.

Source: Han, Kim, Kim, Kim, section 3.1; the exact arcs are their eq. (4)–(5).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Annotated, NamedTuple, TypeAlias

from robots.onboard.driving import Posture
from vrs.checks import finite, number_in, positive, validated
from vrs.errors import InvalidValueError
from vrs.mobile import advanced, wrapped

_STRAIGHT = 1e-12
"""An arc of less curvature is a line [1/m]."""
_PIVOT_RADIUS = 1e-3
"""Arcs of a smaller radius [m] are driven as turns on the spot; their ends stay exact."""
_EQUAL = 1e-13
"""Curvatures nearer than this [1/m], relatively from 1 on, are one."""


@dataclass(frozen=True, slots=True)
@validated
class Arc:
    """A piece of constant curvature."""

    curvature: float
    """Change of θ_d a metre of way [1/m], to the left of the direction of travel positive."""
    length: Annotated[float, positive("positive metres")]
    """[m], positive."""
    direction: int = 1
    """1 forward, −1 reversing."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "curvature", finite("curvature", self.curvature))
        if isinstance(self.direction, bool) or self.direction not in (1, -1):
            raise InvalidValueError("direction", self.direction, "1 or -1")


@dataclass(frozen=True, slots=True)
class Pivot:
    """A turn on the spot."""

    angle: float
    """[rad], to the left positive, not 0; more than a full turn is driven as one."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "angle", finite("angle", self.angle, "finite radians, not 0"))
        if self.angle == 0:
            raise InvalidValueError("angle", self.angle, "finite radians, not 0")


PathPiece: TypeAlias = Arc | Pivot


class Projection(NamedTuple):
    """Where a robot is beside a path."""

    s: float
    """Way along the path up to the nearest point ahead of what has been passed [m]."""
    x: float
    """The nearest point [m]."""
    y: float
    """[m]."""
    theta_d: float
    """Direction of travel there [rad]."""
    l: float  # noqa: E741
    """How far the robot is beside the line through that point along θ_d [m], left positive."""
    curvature: float
    """There [1/m]."""
    direction: int
    """1 forward, −1 reversing."""
    left: float
    """Δs, way left to the end of the path [m]."""
    to_stop: float
    """Way left in this stretch [m]."""
    turn: float | None
    """On a pivot, how much is left to turn [rad], left positive; else None."""


class _Piece:
    """A piece in its place; the newest one grows."""

    __slots__ = ("amount", "curvature", "direction", "end", "pivots", "s", "start")

    def __init__(self, piece: PathPiece, start: Posture, s: float, direction: int) -> None:
        self.start, self.s = start, s
        self.pivots = isinstance(piece, Pivot)
        self.end = start
        if isinstance(piece, Pivot):
            self.amount, self.curvature, self.direction = piece.angle, 0.0, direction
        else:
            self.amount, self.curvature, self.direction = piece.length, piece.curvature, piece.direction

    @property
    def length(self) -> float:
        return 0.0 if self.pivots else self.amount

    def at(self, way: float) -> Posture:
        """The robot's posture on it, a way [m] from its start."""
        return Posture(*advanced(self.start, self.direction, self.curvature, way))

    def takes(self, piece: PathPiece) -> bool:
        """Whether a piece is the same again."""
        if isinstance(piece, Pivot):
            return self.pivots and self.amount * piece.angle > 0
        near = abs(self.curvature - piece.curvature) <= _EQUAL * max(1.0, abs(piece.curvature))
        return not self.pivots and piece.direction == self.direction and near


class MovingPath:
    """A path that grows at its end and is forgotten where it has been passed."""

    def __init__(self, start: tuple[float, float, float], *, capacity: int = 36_000) -> None:
        """Begin with a point.

        Args:
            start: Posture (x, y, θ) of the robot there [m, m, rad].
            capacity: Most pieces ahead, at least 1; equal pieces in a row are one.

        Raises:
            InvalidValueError: If a value isn't finite, or the capacity isn't positive.
        """
        if isinstance(capacity, bool) or not isinstance(capacity, int) or capacity < 1:
            raise InvalidValueError("capacity", capacity, "a positive integer")
        self._capacity = capacity
        self._pieces: deque[_Piece] = deque()
        self.end = Posture(*(finite("start", value) for value in start))
        """The robot's posture at the end of the path."""
        self.length = 0.0
        """Way from the path's beginning to its end, with what is forgotten [m]."""
        self._stops: deque[float] = deque()
        self._at = 0.0
        self._theta: float | None = None
        """Heading at the last look at a pivot."""

    def __len__(self) -> int:
        """How many pieces are kept."""
        return len(self._pieces)

    def append(self, piece: PathPiece, *, end: Posture | None = None) -> bool:
        """Add a piece at the end.

        Args:
            piece: To be added; one like the last makes that longer.
            end: The robot's posture at its end, where the caller knows it better; by default that of the piece.

        Returns:
            Whether there was room. If not, the path stays as it was.
        """
        last = self._pieces[-1] if self._pieces else None
        if last is not None and last.takes(piece):
            last.amount += piece.angle if isinstance(piece, Pivot) else piece.length
        elif len(self._pieces) >= self._capacity:
            return False
        else:
            added = _Piece(piece, self.end, self.length, last.direction if last is not None else 1)
            if last is not None and not last.pivots and (added.pivots or added.direction != last.direction):
                self._stops.append(self.length)
            self._pieces.append(added)
            last = added
        if isinstance(piece, Arc):
            self.length += piece.length
        if end is None:
            turned = last.start._replace(theta=last.start.theta + last.amount)
            end = turned if last.pivots else last.at(last.amount)
        last.end = self.end = end
        return True

    def drive(self, v: float, w: float, *, duration: float) -> bool:
        """Add what a command adds to the virtual robot's path, which is at the end of this one.

        Args:
            v: Linear speed [m/s].
            w: Angular speed [rad/s].
            duration: How long the virtual robot drove it [s].

        Returns:
            Whether the path had room; if not, it's as it was, and what follows would begin elsewhere: stop, and
            begin a new path.

        Raises:
            InvalidValueError: If a value isn't finite, or a time isn't positive.
        """
        v = number_in("v", v, -100.0, 100.0, unit=" m/s")
        w = number_in("w", w, -1000.0, 1000.0, unit=" rad/s")
        T = number_in("duration", duration, 1e-9, 86_400.0, unit=" s")
        # Where a speed is tiny, its product with T may be 0 in floating point.
        if abs(v) <= _PIVOT_RADIUS * abs(w):
            piece: PathPiece | None = Pivot(w * T) if w * T else None
        else:
            piece = Arc(w / abs(v), abs(v) * T, 1 if v > 0 else -1) if abs(v) * T else None
        return piece is None or self.append(piece, end=Posture(*advanced(self.end, v, w, T)))

    def locate(self, posture: tuple[float, float, float]) -> Projection:
        """Find the nearest point ahead of what has been passed; what is before it counts as passed from now on.

        The search goes on from the last point for as long as the path comes nearer, and never past a pivot or a
        reversal: where the path crosses itself, or comes back beside itself, it isn't mistaken for its other part.

        Args:
            posture: Where the robot is, (x, y, θ) [m, m, rad].
        """
        x, y, theta = posture
        pieces = self._pieces
        if not pieces:
            return self._beside(x, y, self.end, 0.0, 0.0, 1, None)
        piece = pieces[0]
        while not piece.pivots:
            self._at = _nearest(piece, self._at, x, y)
            if self._at < piece.amount or len(pieces) == 1 or self._stands_after(piece):
                place = piece.at(self._at)
                return self._beside(x, y, place, piece.s + self._at, piece.curvature, piece.direction, None)
            self._next()
            piece = pieces[0]
        if self._theta is None:
            self._at = wrapped(theta - piece.start.theta)
        else:
            self._at += wrapped(theta - self._theta)
        self._theta = theta
        return self._beside(x, y, piece.end, piece.s, 0.0, piece.direction, piece.amount - self._at)

    def pass_stop(self) -> bool:
        """Take the stretch, or the pivot, as driven, and go on with what comes after it.

        Returns:
            Whether anything comes after it. At the path's end nothing changes.
        """
        if len(self._pieces) < 2:
            return False
        if not self._pieces[0].pivots:
            if not self._stops:
                return False
            while not self._stands_after(self._pieces[0]):
                self._next()
            self._stops.popleft()
        self._next()
        return True

    def ahead(self, distance: float) -> Iterator[tuple[float, float]]:
        """Yield how far [m] the pieces of this stretch are, the present one first, and their curvature [1/m].

        Args:
            distance: Up to how far from the last nearest point [m].
        """
        if not self._pieces:
            return
        s = self._pieces[0].s + (0.0 if self._pieces[0].pivots else self._at)
        stop = self._stops[0] if self._stops else math.inf
        for i, piece in enumerate(self._pieces):
            if piece.pivots or piece.s >= stop or piece.s - s > distance:
                return
            yield (max(piece.s - s, 0.0) if i else 0.0), piece.curvature

    def pieces(self) -> list[PathPiece]:
        """What isn't forgotten, as values."""
        return [Pivot(p.amount) if p.pivots else Arc(p.curvature, p.amount, p.direction) for p in self._pieces]

    def _stands_after(self, piece: _Piece) -> bool:
        after = next(islice(self._pieces, 1, None), None)
        return after is not None and (after.pivots or after.direction != piece.direction)

    def _next(self) -> None:
        self._pieces.popleft()
        self._at, self._theta = 0.0, None

    def _beside(
        self, x: float, y: float, place: Posture, s: float, curvature: float, direction: int, turn: float | None
    ) -> Projection:
        theta_d = place.theta if direction > 0 else place.theta + math.pi
        lateral = (y - place.y) * math.cos(theta_d) - (x - place.x) * math.sin(theta_d)
        left = self.length - s
        to_stop = 0.0 if turn is not None else (self._stops[0] - s if self._stops else left)
        return Projection(s, place.x, place.y, theta_d, lateral, curvature, direction, left, to_stop, turn)


def _nearest(piece: _Piece, at: float, x: float, y: float) -> float:
    """Follow an arc from a way on it [m] for as long as it comes nearer to a point; exact."""
    here = piece.at(at)
    theta_d = here.theta if piece.direction > 0 else here.theta + math.pi
    dx, dy = x - here.x, y - here.y
    cos, sin = math.cos(theta_d), math.sin(theta_d)
    along, left = cos * dx + sin * dy, cos * dy - sin * dx
    curvature = piece.curvature
    # From the centre of the arc: as the curvature goes to 0, the angle over it goes to `along`.
    bent = abs(curvature) > _STRAIGHT
    way = math.atan2(curvature * along, 1 - curvature * left) / curvature if bent else along
    return min(at + max(way, 0.0), piece.amount)
