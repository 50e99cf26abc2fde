"""Where locations are: the tool's tip in BASE's frame, the last link in the robot's, joints; and ALTER."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from interfaces.val2.errors import ValError
from interfaces.val2.motion.conventions import PUMA, WORDS, ArmConventions
from interfaces.val2.values import NULL, Location, PrecisionPoint, Transformation
from vrs.commands import Alter, Frame
from vrs.errors import InvalidValueError, OutOfLimitsError, UnreachablePoseError
from vrs.model import Array, RobotModel
from vrs.planning.path import rotation_vector, rotations


@dataclass(frozen=True, slots=True)
class Where:
    """Where an arm is."""

    tool: Transformation
    """The tool's tip in the world, in which BASE says where the robot stands."""
    joints: PrecisionPoint
    hand: float
    """Opening of the hand [mm]."""


_MODELS: Final = {"FLIP": "NOFLIP", "NOFLIP": "FLIP"}
"""VAL's FLIP is a negative joint 5, which the model calls NOFLIP."""

_OUTSIDE: Final = re.compile(r"joint (\d) would be at \S+ deg, (\S+ deg) outside its limits \[[^]]*\] deg")
"""What the model says of joint angles, which have other zeros."""
_METRES: Final = re.compile(r"(?<![\w.])(\d+(?:\.\d*)?(?:e[+-]?\d+)?) m\b")
_WRIST: Final = re.compile(r"\b(NO)?FLIP\b")


def in_millimetres(text: str) -> str:
    """A text of the planner, its lengths in VAL's unit."""
    return _METRES.sub(lambda found: f"{1000.0 * float(found[1]):.6g} mm", text)


def location_error(detail: str) -> ValError:
    """A location that the arm can't reach; the model's words of a configuration become VAL's."""
    detail = in_millimetres(detail)
    detail = _OUTSIDE.sub(r"Jt \1 would be \2 outside its limits", detail)
    return ValError("Location out of range", _WRIST.sub(lambda found: _MODELS[found[0]], detail))


@dataclass(frozen=True, slots=True)
class Frames:
    """Tool and base, and the robot between them."""

    model: RobotModel
    tool: Transformation = NULL
    base: Transformation = NULL
    """Where the robot stands in the world in which locations are."""
    conventions: ArmConventions = PUMA

    def tip(self) -> Array:
        """The tool's tip in the frame of the last link, (4, 4) [m]."""
        return self.conventions.tip(self.tool)

    def point(self, q: Array) -> PrecisionPoint:
        """Joints [rad], (6,), as VAL has them."""
        return self.conventions.point(q, self.model.limits)

    def where(self, q: Array, hand: float) -> Where:
        """Where joints [rad], (6,), put the tool."""
        flange = self.conventions.flange_at(self.model.forward(q))
        tip = self.base @ flange @ self.tool
        return Where(tip, self.point(q), hand)

    def pose(self, place: Transformation) -> Array:
        """Pose of the last link in the robot's base frame, (4, 4) [m], that puts the tool at a place."""
        near = place if self.base is NULL else self.base.inverse() @ place
        return self.conventions.link_at(near if self.tool is NULL else near @ self.tool.inverse())

    def place(self, location: Location) -> Transformation:
        """The tool at a location."""
        if isinstance(location, Transformation):
            return location
        return self.where(self.joints(location), 0.0).tool

    def joints(self, point: PrecisionPoint) -> Array:
        """Joints [rad], (6,), of a precision point.

        Raises:
            ValError: If a joint can't go there.
        """
        limits = self.model.limits
        q = self.conventions.joints(point, limits)
        # A limit itself is allowed, whatever the conversion rounds.
        q = np.where(np.abs(q - limits.q_min) < 1e-12, limits.q_min, q)
        q = np.where(np.abs(q - limits.q_max) < 1e-12, limits.q_max, q)
        self._check(q)
        return q

    def _check(self, q: Array) -> None:
        try:
            self.model.limits.check(q)
        except OutOfLimitsError as error:
            limits = self.model.limits
            at, low, high = (self.point(one).joints[error.joint] for one in (q, limits.q_min, limits.q_max))
            named = f" ({self.conventions.names[error.joint]})" if self.conventions.names else ""
            text = f"Jt {error.joint + 1}{named} would be at {at:.6g} deg, allowed are {low:.6g} to {high:.6g}"
            raise location_error(text) from None

    def solve(self, location: Location, near: Array, words: tuple[str, ...]) -> Array:
        """Joints [rad], (6,), that put the tool at a location, in the arm's own configuration but for what's asked.

        Args:
            location: Where to.
            near: Where the arm comes from [rad], (6,).
            words: Configuration words that are asked for, VAL's.

        Raises:
            ValError: If it can't be reached so.
        """
        if isinstance(location, PrecisionPoint):
            return self.joints(location)
        X = self.pose(location)
        try:
            if not words:
                return self.model.inverse_near(X, near)
            asked = " ".join(_MODELS.get(word, word) for word in words)
            own = self.model.configuration(near).split()
            kept = " ".join(
                word for word, pair in zip(own, self.conventions.words, strict=False) if not set(pair) & set(words)
            )
            try:
                return self.model.inverse_near(X, near, f"{asked} {kept}")
            except UnreachablePoseError:
                return self.model.inverse_near(X, near, asked)
        except (UnreachablePoseError, InvalidValueError) as error:
            raise location_error(str(error)) from None

    def configured(self, q: Array) -> tuple[str, ...]:
        """VAL's words of the configuration at joints [rad], (6,)."""
        return tuple(_MODELS.get(word, word) for word in self.model.configuration(q).split())


def with_word(words: tuple[str, ...], word: str) -> tuple[str, ...]:
    """What is asked for of the configuration, with another word; the word before it of the pair is dropped."""
    for pair in WORDS:
        if word in pair:
            return (*(other for other in words if other not in pair), word)
    raise ValError("Illegal value", f"{word}: a configuration is {', '.join(w for pair in WORDS for w in pair)}")


def aligned(place: Transformation) -> Transformation:
    """The same place with the tool's axis along the world axis that's nearest, turned the shortest way."""
    X = np.array(place.X)
    z = X[:3, 2]
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(z)))
    axis[k] = 1.0 if z[k] > 0 else -1.0
    v, c = np.cross(z, axis), float(z @ axis)
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    X[:3, :3] = (np.eye(3) + K + K @ K / (1.0 + c)) @ X[:3, :3]
    return Transformation(X)


def behind(place: Transformation, distance: float) -> Transformation:
    """The place at a distance [mm] back along the tool's axis."""
    X = np.array(place.X)
    X[:3, 3] -= distance * X[:3, 2]
    return Transformation(X)


def shifted(place: Transformation, dx: float, dy: float, dz: float) -> Transformation:
    """The place shifted along the axes of its frame [mm]."""
    X = np.array(place.X)
    X[:3, 3] += (dx, dy, dz)
    return Transformation(X)


ALTER_PERIOD: Final = 0.028
"""How long a program takes for a correction by ALTOUT at least [s], as in VAL-II."""
CUMULATIVE: Final = 1
"""Bit of the mode: each correction adds to those before."""
WORLD: Final = 2
"""Bit of the mode: along the axes of BASE, not the tool's."""
MODES: Final = range(4)
_SAME: Final = 1e-6
"""Elements of poses nearer than this are one [mm]."""


class Alterations:
    """Where corrections since ALTER lead: an arm that stands, to a place; one on its way, off what is planned."""

    def __init__(self) -> None:
        self.mode: int | None = None
        """None while the path isn't altered."""
        self.channel = 0
        """By which corrections come from elsewhere."""
        self.since = -math.inf
        """When ALTER was said [s]."""
        self._nominal: Transformation | None = None
        """Where the tool would be without corrections."""
        self._newest: Transformation | None = None
        """Where the newest correction leads."""
        self.on_way: Transformation | None = None
        """What is added on the way to what's planned; None while nothing is."""
        self.ends = False
        """Whether it's over when the arm stands."""

    def set(self, mode: int | None, channel: int = 0, since: float = -math.inf) -> None:
        """Begin, or end with None.

        Raises:
            ValError: If there's no such mode.
        """
        if mode is not None and mode not in MODES:
            detail = f"mode {mode}: {MODES[0]} to {MODES[-1]}; 1 is cumulative, 2 along world axes, 3 both"
            raise ValError("Illegal value", detail)
        self.mode, self.channel, self.since, self.ends = mode, channel, since, False
        self._nominal = self._newest = self.on_way = None

    @property
    def cumulative(self) -> bool:
        """Whether each correction adds to those before."""
        return self.mode is not None and bool(self.mode & CUMULATIVE)

    def corrected(self, values: tuple[float, ...], destination: Transformation) -> Transformation:
        """The tool's place after a correction.

        Without CUMULATIVE a correction counts from the uncorrected place: where the tool was going before the first
        correction, or since something else has moved it.

        Args:
            values: X, Y, Z [mm], and the turn of the tip: a rotation vector's x, y, z [deg].
            destination: Where the tool goes.

        Raises:
            ValError: If the path isn't altered, or the values aren't six finite numbers.
        """
        mode, asked = self._asked(values)
        before = self._newest
        if before is None or np.abs(before.X - destination.X).max() > _SAME:
            before = self._nominal = destination
        start = before if mode & CUMULATIVE or self._nominal is None else self._nominal
        return _moved(start, asked, world=bool(mode & WORLD))

    def taken(self, place: Transformation) -> None:
        """A correction was asked for that leads to a place."""
        self._newest = place

    def added(self, values: tuple[float, ...]) -> Transformation:
        """What is to be added to the tool's planned place from a correction on, as `corrected` takes it."""
        mode, asked = self._asked(values)
        start = self.on_way if mode & CUMULATIVE and self.on_way is not None else NULL
        return _moved(start, asked, world=bool(mode & WORLD))

    def _asked(self, values: tuple[float, ...]) -> tuple[int, Array]:
        if self.mode is None:
            raise ValError("Path isn't altered", "ALTER comes first")
        asked = np.array(values, dtype=np.float64)
        if asked.shape != (6,) or not np.isfinite(asked).all():
            raise ValError("Illegal value", "a correction is X, Y, Z [mm] and three turns [deg]")
        return self.mode, asked

    def command(self, offset: Transformation, frames: Frames) -> Alter:
        """What adds it to the path."""
        way = np.concatenate([offset.X[:3, 3] / 1000.0, rotation_vector(offset.X[:3, :3])])
        in_world = self.mode is not None and bool(self.mode & WORLD)
        if in_world:
            R = frames.conventions.X_BW[:3, :3] @ frames.base.X[:3, :3].T
            way = np.concatenate([R @ way[:3], R @ way[3:]])
        frame = Frame.BASE if in_world else Frame.TOOL
        return Alter(way, frame, frames.tip(), stays=self.cumulative)


def _moved(start: Transformation, asked: Array, *, world: bool) -> Transformation:
    """A place after a correction, six numbers [mm, deg], along the axes of its frame or its own."""
    X, turn = np.array(start.X), rotations(np.radians(asked[None, 3:]))[0]
    if world:
        X[:3, :3] = turn @ X[:3, :3]
        X[:3, 3] += asked[:3]
    else:
        X[:3, 3] += X[:3, :3] @ asked[:3]
        X[:3, :3] = X[:3, :3] @ turn
    return Transformation(X)
