"""A robot as a value: all that the house asks of one; and how one is found by what somebody calls it."""

from __future__ import annotations

import importlib
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple, Protocol, Self, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robots.base import MobileBase, box_shape, upright
from robots.solids import LinkShape
from vrs.checks import did_you_mean, one_of, validated, within
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array, RobotModel

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP: Final = "vrs.robots"
"""Entry points of other packages in this group are robots that are found by their names."""
FOUND: Final[Mapping[str, str]] = {
    "puma560": "robots.puma560.robot:ROBOT",
    "ipr": "robots.ipr.robots:ROBOT",
    "micro": "robots.ipr.robots:MICRO",
    "cubo": "robots.cubo.robot:ROBOT",
}
"""Robots of this package: where each is."""
USUAL: Final = "puma560"
"""The robot unless another is asked for."""
USUAL_BASE: Final = "ipr"
"""The same of mobile robots."""
BARE: Final = "bare"
"""Name of the usual mobile robot with its bare kinematic body."""
USUAL_CLIENT: Final = "cubo"
"""The same of robots that are thin clients."""
IDEAL: Final = "ideal"
"""Body of any arm: it's where its reference is."""
EXACT: Final = "exact"
"""The same by the name that it had before."""
FILES: Final = (".urdf", ".xacro", ".xml", ".mjcf", ".toml")
"""Endings of files that robots are read from."""
NUMBERS: Final = "diff:"
"""What a mobile robot in numbers begins with."""
TIP: Final = "#"
"""What stands between a file and the link at the end of its arm; between a fleet's file and one of its robots."""
_DESCRIBED: Final = "robots.described"
_FLEET: Final = "robots.fleet"
_DRIVER: Final = "robots.driver"
"""What reads them; it stands after this module, and is loaded when it's needed."""
_GOALS = 8
"""So many openings that fingers were told count for where they are: by then they've been at one."""


class Closing:
    """What is closed when its context ends."""

    def close(self) -> None:
        """Give back what it holds; a second call does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Prepared(NamedTuple):
    """References with the feed-forward that belongs to them, (k, n) each."""

    q: Array
    """[rad], of prismatic joints [m]."""
    qd: Array
    """[rad/s], [m/s]."""
    feedforward: Array
    """[N m], [N]."""

    def row(self, i: int) -> Prepared:
        """One of them, (1, n) each."""
        return Prepared(self.q[i : i + 1], self.qd[i : i + 1], self.feedforward[i : i + 1])


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What a block of steps did; row i is the state at the end of step i."""

    q: Array
    """Encoder readings [rad], of prismatic joints [m], (k, n)."""
    qd: Array
    """Joint speeds [rad/s], [m/s], (k, n)."""
    tau: Array
    """Drive torques [N m], forces [N], (k, n), limited; row i acted during step i; (k, 0) without drives."""
    saturated: NDArray[np.int64]
    """Steps in which a drive was at its limit, by joint, (n,)."""


class ArmBody(Protocol):
    """What is real of an arm: it follows references, a row a step."""

    def prepare(self, q_ref: ArrayLike, qd_ref: ArrayLike, qdd_ref: ArrayLike) -> Prepared:
        """Work out beforehand what `follow` needs, of references for the ends of the next steps, (k, n) each."""

    def follow(self, prepared: Prepared) -> Measured:
        """Follow references that were prepared, a step each."""

    def attach(self, mass: float) -> None:
        """Take a load [kg] that the servo doesn't know."""

    def release(self) -> None:
        """Drop the load."""

    @property
    def q(self) -> Array:
        """Where its joints truly are [rad], of prismatic joints [m], (n,), whatever its encoders read."""


class ArmMaker(Protocol):
    """Makes an arm's body, at rest."""

    def __call__(self, q: ArrayLike, *, friction: bool = True, dt: float = 1e-3) -> AbstractContextManager[ArmBody]:
        """Make a body.

        Args:
            q: Joint positions [rad], of prismatic joints [m], (n,).
            friction: Whether its joints have friction.
            dt: Its step [s].
        """


class ExactArm:
    """A body with no dynamics: it is where its reference is, whatever it holds."""

    def __init__(self, q: ArrayLike = ()) -> None:
        """Stand at joints [rad], (n,)."""
        self._q: Array = np.asarray(q, dtype=np.float64)

    @property
    def q(self) -> Array:
        """Where it is [rad], (n,)."""
        return self._q

    def prepare(self, q_ref: ArrayLike, qd_ref: ArrayLike, _qdd_ref: ArrayLike) -> Prepared:
        """Take references as they are."""
        q, qd = np.asarray(q_ref), np.asarray(qd_ref)
        return Prepared(q, qd, np.empty((len(q), 0)))

    def follow(self, prepared: Prepared) -> Measured:
        """Go where they are."""
        self._q = prepared.q[-1] if len(prepared.q) else self._q
        return Measured(*prepared, np.zeros(prepared.q.shape[1], dtype=np.int64))

    def attach(self, mass: float) -> None:
        """Take a load, which changes nothing."""

    def release(self) -> None:
        """Drop the load, which changes nothing."""


@contextmanager
def exact_arm(q: ArrayLike, **_: object) -> Iterator[ArmBody]:
    """Make a body that follows exactly."""
    yield ExactArm(q)


@dataclass(frozen=True, slots=True)
class Appearance:
    """What a robot looks like."""

    shapes: Callable[[], Sequence[LinkShape]]
    """Makes its shapes: of an arm one for the base and one a link, in their frames."""
    poses: Callable[[ArrayLike], Array]
    """Says where the shapes are, (m, 4, 4), at joints (n,), or at a posture (x, y, θ), (3,)."""


@dataclass(frozen=True, slots=True)
@validated
class Fingers:
    """Two parallel fingers that move together, along x of the hand, and reach out along its z."""

    stroke: Annotated[float, within(0.001, 1.0, "m")]
    """How far they open [m]."""
    force: Annotated[float, within(0.1, 10_000.0, "N")]
    """With which each of them presses at most [N]."""
    speed: Annotated[float, within(0.001, 10.0, "m/s")]
    """At which the hand opens and closes at most [m/s]."""
    thickness: Annotated[float, within(0.001, 0.2, "m")]
    """Of a finger, along x [m]."""
    width: Annotated[float, within(0.001, 0.2, "m")]
    """Of a finger, along y [m]."""
    length: Annotated[float, within(0.001, 0.5, "m")]
    """Of a finger, from where the hand is fastened, along z [m]."""

    def goal(self, goals: Sequence[tuple[float, float]], t: float) -> float:
        """The opening that they're to go to at a time [s], of what they were told: times [s] and openings [m]."""
        told = next((opening for at, opening in reversed(goals) if at <= t), self.stroke)
        return min(told, self.stroke)

    def opening(self, goals: Sequence[tuple[float, float]], t: float) -> float:
        """How far they're open at a time [s] with nothing in between [m]; see `goal`. They begin open."""
        known = [goal for goal in goals if goal[0] <= t][-_GOALS:]
        opening = min(known[0][1], self.stroke) if known else self.stroke
        for (start, told), end in zip(known, [*(at for at, _ in known[1:]), t], strict=False):
            most, left = self.speed * max(end - start, 0.0), min(told, self.stroke) - opening
            opening += min(max(left, -most), most)
        return opening


@dataclass(frozen=True, slots=True, eq=False)
class Gripper:
    """A hand that takes and drops loads."""

    point: tuple[float, float, float]
    """The point of the tool that is drawn and dragged, in the last link's frame [m]."""
    fingers: Fingers | None = None
    """With which it grasps things; None of a hand that only takes loads."""
    pose: Array | None = None
    """Of the hand in the last link's frame, (4, 4): fingers close along x and reach out along z; at `point`, and
    turned as the link is, unless given."""
    shapes: tuple[LinkShape, ...] = ()
    """What both fingers look like, that of positive x first, about their middles; unless given, they and a palm are
    drawn as boxes."""

    @property
    def X_LH(self) -> Array:
        """Pose of the hand in the last link's frame, (4, 4)."""
        if self.pose is not None:
            return self.pose
        X = np.eye(4)
        X[:3, 3] = self.point
        return X


@dataclass(frozen=True, slots=True)
class Display:
    """A screen that shows messages."""

    size: tuple[float, float]
    """Width and height [m]."""
    pose: Callable[[], Array]
    """Its pose in the robot's frame, (4, 4): x out of it, y to its left."""


@dataclass(frozen=True, slots=True)
class HeadCamera:
    """A camera that pans and tilts, and that pictures are made with."""

    neck: tuple[float, float, float]
    """Where both axes cross, in the robot's frame [m]."""
    reach: float
    """How far the lens is before that [m]."""
    body: Callable[[], LinkShape]
    """What it may see of the robot, in the robot's frame."""


@dataclass(frozen=True, slots=True)
class ThinClient:
    """The robot plans nothing: RSP addresses its effectors and sensors by bindings."""

    model: Path
    """Its robot model, XMI."""
    moves: tuple[str, ...]
    """Bindings of its effectors."""
    sound_rate: int = 48_800
    """Samples a second of what its speaker plays, 16 bits each, little endian: 1952 bytes in 20 ms. Chosen."""


_D = TypeVar("_D")


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """All that the house asks of a robot."""

    name: str
    """Short name, as people and recordings know it."""
    model: RobotModel | MobileBase
    """What an engine needs: limits, named poses, kinematics; or, of a base, its limits and wheels."""
    appearance: Appearance | None = None
    """None draws a base as a box, an arm as its frames and traces."""
    bodies: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    """What can be real of it, by name, the usual one first. Of an arm an `ArmMaker` each; of a base what makes a
    `robots.mobile.robot.MobileRobot` in a room, with the rng, limits and senses that it's given."""
    devices: tuple[object, ...] = ()
    """What it carries: `Gripper`, `Display`, `HeadCamera`, `ThinClient`, `robots.onboard.laser.LaserModel`."""
    joints: tuple[str, ...] = ()
    """Names of an arm's joints, where they have any beside their numbers."""
    found_by: str = ""
    """What `load` finds it by, so that other processes can; empty for one that was made up on the spot."""

    @property
    def is_base(self) -> bool:
        """Whether it's a mobile robot, and no arm."""
        return isinstance(self.model, MobileBase)

    @property
    def recorded_by(self) -> str:
        """What recordings have to find it by, beside its name: that of a file or numbers, else nothing."""
        return self.found_by if described(self.found_by) else ""

    @property
    def arm(self) -> RobotModel:
        """The model of an arm.

        Raises:
            InvalidValueError: If the robot is none.
        """
        if isinstance(self.model, MobileBase):
            raise InvalidValueError("robot", self.name, "an arm; this one is a mobile robot")
        return self.model

    @property
    def base(self) -> MobileBase:
        """The model of a mobile robot.

        Raises:
            InvalidValueError: If the robot is none.
        """
        if not isinstance(self.model, MobileBase):
            raise InvalidValueError("robot", self.name, "a mobile robot; this one is an arm")
        return self.model

    @property
    def tool(self) -> tuple[float, float, float]:
        """The point of an arm's tool, in the last link's frame [m]."""
        gripper = self.device(Gripper)
        return (0.0, 0.0, 0.0) if gripper is None else gripper.point

    @property
    def hand(self) -> Gripper | None:
        """Its gripper, where that has fingers; else None."""
        gripper = self.device(Gripper)
        return None if gripper is None or gripper.fingers is None else gripper

    @property
    def stroke(self) -> float:
        """How far its fingers open [m]; infinite of a hand without, which is just open."""
        return math.inf if self.hand is None or self.hand.fingers is None else self.hand.fingers.stroke

    def shapes(self) -> tuple[LinkShape, ...]:
        """Its shapes; without an appearance a mobile robot is a box, and an arm has none."""
        if self.appearance is None:
            return (box_shape(self.base.body),) if self.is_base else ()
        return tuple(self.appearance.shapes())

    def placed(self, where: ArrayLike) -> Array:
        """Poses of its shapes, (m, 4, 4), at joints (n,) or at a posture (x, y, θ), (3,)."""
        if self.appearance is None:
            return upright(*np.asarray(where).tolist())[None] if self.is_base else np.empty((0, 4, 4))
        return self.appearance.poses(where)

    def device(self, kind: type[_D]) -> _D | None:
        """What it carries of a kind; None where it carries none."""
        return next((device for device in self.devices if isinstance(device, kind)), None)

    @property
    def usual_body(self) -> str:
        """Name of the body that it has unless another is asked for."""
        return next(iter(self.bodies), IDEAL)

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of all its bodies, the usual one first; drivers aside."""
        return tuple(dict.fromkeys((*self.bodies, *(() if self.is_base else (IDEAL,)))))

    def has_body(self, name: str) -> bool:
        """Whether it has a body of a name: see `body_name`."""
        return name in self.bodies or (not self.is_base and (name in {IDEAL, EXACT} or is_driver(name)))

    def body_name(self, name: str = "") -> str:
        """Name of a body that it has.

        Args:
            name: One of `bodies`, of an arm also `ideal`, or `exact` for that; or `MODULE:NAME`, which makes a
                driver of its hardware (`robots.driver`). The usual one unless given.

        Raises:
            InvalidValueError: If it has no such body.
        """
        asked = IDEAL if name == EXACT else name or self.usual_body
        if is_driver(asked) and not self.is_base:
            return asked
        return one_of(f"body of {self.name}", asked, self.body_names)

    def with_body(self, name: str) -> Self:
        """The same robot, of which another body is the usual one; see `body_name`.

        Raises:
            InvalidValueError: If it has no such body, or it's hardware, which follows no virtual time.
        """
        chosen = self.body_name(name)
        if is_driver(chosen):
            raise InvalidValueError("body", name, "a simulated one: hardware runs live, in serve and robot")
        return replace(self, bodies={chosen: self.body(chosen), **self.bodies})

    def body(self, name: str = "") -> Callable[..., Any]:
        """What makes a body: of an arm an `ArmMaker`.

        Args:
            name: See `body_name`.

        Raises:
            InvalidValueError: If it has no such body.
        """
        chosen = self.body_name(name)
        if is_driver(chosen):
            driver = importlib.import_module(_DRIVER)
            return partial(driver.driver_arm, driver.load_driver(chosen))
        return {**self.bodies, IDEAL: exact_arm}[chosen]


def is_driver(body: str) -> bool:
    """Whether a body's name is that of what makes a driver, `MODULE:NAME`."""
    return ":" in body


def module_of(what: str, kind: str) -> tuple[ModuleType, str]:
    """Import the module of `MODULE:NAME`, which may lie in the working directory.

    Args:
        what: It.
        kind: What it's to be, for the messages.

    Returns:
        The module, and the name.

    Raises:
        FormatError: If it can't be imported; whatever it raised is in the message.
    """
    where, _, name = what.partition(":")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    # A stranger's module may raise anything.
    try:
        return importlib.import_module(where), name
    except Exception as error:
        raise FormatError(what, f"can't be imported as {kind}: {type(error).__name__}: {error}") from error


def names() -> tuple[str, ...]:
    """Names by which robots are found: those of this package, then those of entry points."""
    return *FOUND, *sorted({point.name for point in added()} - FOUND.keys())


def load(what: str) -> Robot:
    """Find a robot.

    Args:
        what: Its name (see `names`); a URDF, xacro or MJCF file, with `#LINK` after it for the link at the end of
            its arm; a TOML file of a mobile robot's numbers, or those as `diff:wheelbase=0.4,wheel=0.1`;
            `FLEET.toml#NAME` for one of a fleet (`robots.fleet`); or `MODULE:NAME` of a `Robot` of one's own, whose
            module may lie in the working directory.

    Raises:
        InvalidValueError: If there's no such robot, or what is there isn't one.
        FormatError: If its file can't be read, or its module can't be imported.
    """
    if of_fleet(what):
        return cast("Robot", importlib.import_module(_FLEET).member(what))
    if described(what):
        return cast("Robot", importlib.import_module(_DESCRIBED).robot_of(what))
    where, colon, name = what.partition(":")
    own = bool(colon and where and name.isidentifier())
    point = next((point for point in added() if point.name == what), None)
    reference = what if own else FOUND.get(what) or (None if point is None else point.value)
    if reference is None:
        allowed = f"one of {', '.join(names())}, a file ({', '.join(FILES)}), diff:…, or MODULE:NAME of your own"
        raise InvalidValueError("robot", what, allowed, did_you_mean(what, names()))
    module, name = module_of(reference, "a robot")
    robot = getattr(module, name, None)
    if not isinstance(robot, Robot):
        there = ", ".join(sorted(key for key, value in vars(module).items() if isinstance(value, Robot))) or "none"
        raise InvalidValueError(f"robot in {module.__name__}", name, f"a Robot there ({there})")
    return replace(robot, found_by=what)


def of_fleet(what: str) -> bool:
    """Whether a robot that's asked for is one of a fleet's, be it there or not."""
    file, hashed, _ = what.rpartition(TIP)
    return bool(hashed) and Path(file).suffix.lower() == ".toml"


def described(what: str) -> bool:
    """Whether a robot that's asked for is one of numbers or of a file, be it there or not."""
    ends = {Path(part).suffix.lower() for part in (what, what.rpartition("#")[0])}
    return what.startswith(NUMBERS) or not ends.isdisjoint(FILES)


@lru_cache(maxsize=1)
def added() -> tuple[EntryPoint, ...]:
    """Robots of other packages."""
    from importlib.metadata import entry_points

    return tuple(entry_points(group=GROUP))
