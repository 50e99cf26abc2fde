"""What stands and lies around an arm: boxes and cylinders on a floor, as values, from small TOML or JSON files.

    floor = -0.672

    [[things]]
    name = "table"
    box = [0.5, 0.7, 0.04]
    at = [0.5, 0.1, -0.42]

    [[things]]
    name = "red box"
    box = [0.05, 0.05, 0.06]
    at = [0.45, 0.15, -0.37]
    mass = 0.3
    friction = 0.7
    turn_deg = 20

Lengths in metres and masses in kilograms, in the arm's base frame; a thing without a mass never moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import msgspec
import numpy as np
from msgspec import Meta, field
from msgspec.structs import replace

from robots.chain import rotation
from robots.solids import Builder, LinkShape
from vrs.checks import bounded_text
from vrs.errors import FormatError
from vrs.model import Array
from vrs.record import Record

MOST_SCENE_THINGS: Final = 32
"""Things of a scene."""
STIRRED: Final = 2e-4
"""A thing has moved whose place or turn is off by more than this [m, 1] from what was known of it."""
_MOST_BYTES: Final = 64 * 1024
_COLOURS: Final = (
    (0.80, 0.25, 0.20), (0.22, 0.45, 0.75), (0.25, 0.60, 0.35), (0.85, 0.62, 0.15), (0.50, 0.35, 0.65),
)  # fmt: skip
"""Of things that move, in turn."""
_FIXED: Final = (0.62, 0.56, 0.48)

Length = Annotated[float, Meta(ge=-10, le=10)]
"""[m]."""
Size = Annotated[float, Meta(ge=1e-3, le=10)]
"""[m]."""
Place = tuple[Length, Length, Length]
"""x, y, z [m]."""
Share = Annotated[float, Meta(ge=0, le=1)]
Turn = Annotated[float, Meta(ge=-2, le=2)]
ThingPose = tuple[float, float, float, Turn, Turn, Turn, Turn]
"""x, y, z of a thing's middle in the base frame [m], and its turn as a quaternion x, y, z, w."""


class Thing(Record, frozen=True, omit_defaults=True, gc=False, forbid_unknown_fields=True):
    """A box or a cylinder; without a mass it never moves."""

    name: Annotated[str, Meta(min_length=1, max_length=60)]
    at: Place
    """Its middle, in the arm's base frame [m]."""
    box: tuple[Size, Size, Size] | None = None
    """Length, width and height [m]."""
    cylinder: tuple[Size, Size] | None = None
    """Radius and height [m], instead of a box."""
    mass: Annotated[float, Meta(ge=1e-3, le=50)] | None = None
    """[kg]."""
    friction: Annotated[float, Meta(ge=0, le=2)] = field(default_factory=lambda: 0.6)
    """Coefficient of Coulomb friction with the fingers, the floor and what doesn't move; two things that touch have
    the product of theirs."""
    turn_deg: Annotated[float, Meta(ge=-360, le=360)] = field(default_factory=float)
    """About the vertical [deg]."""
    colour: tuple[Share, Share, Share] | None = None
    """Red, green, blue, 0 to 1."""

    def __post_init__(self) -> None:
        if (self.box is None) == (self.cylinder is None):
            raise ValueError("a thing is either a box, three lengths, or a cylinder, radius and height")

    @property
    def half(self) -> tuple[float, float, float]:
        """Half of its extent along its own axes [m]."""
        if self.cylinder is not None:
            radius, height = self.cylinder
            return radius, radius, height / 2
        assert self.box is not None
        length, width, height = self.box
        return length / 2, width / 2, height / 2

    @property
    def pose(self) -> ThingPose:
        """Where it is at first."""
        angle = math.radians(self.turn_deg)
        return *self.at, 0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)

    def reach(self, direction: Array) -> float:
        """How far it reaches from its middle in a direction along its own axes, a unit vector, (3,) [m]."""
        if self.cylinder is not None:
            radius, height = self.cylinder
            return float(radius * np.hypot(*direction[:2]) + height / 2 * abs(direction[2]))
        return float(np.abs(direction) @ self.half)

    def shape(self) -> LinkShape:
        """What it looks like, about its middle."""
        import trimesh

        if self.box is not None:
            body = trimesh.creation.box(extents=self.box)
        else:
            assert self.cylinder is not None
            body = trimesh.creation.cylinder(radius=self.cylinder[0], height=self.cylinder[1], sections=48)
        build = Builder(self.name, _FIXED if self.colour is None else self.colour)
        build.add(body)
        return build.shape()


class Scene(Record, frozen=True, omit_defaults=True, gc=False, forbid_unknown_fields=True):
    """A floor, and what is on it."""

    floor: Length
    """Height of the floor in the arm's base frame [m]."""
    things: Annotated[tuple[Thing, ...], Meta(max_length=MOST_SCENE_THINGS)] = ()

    if TYPE_CHECKING:

        def __init__(self, floor: float, things: Sequence[Thing] = ()) -> None: ...

    def __post_init__(self) -> None:
        names = [thing.name for thing in self.things]
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise ValueError(f"each thing has a name of its own; {', '.join(sorted(twice))} is there twice")

    @property
    def coloured(self) -> Scene:
        """The same, its things in colours that tell them apart where they have none."""
        moving = [thing for thing in self.things if thing.mass is not None]
        painted = {thing.name: _COLOURS[k % len(_COLOURS)] for k, thing in enumerate(moving)}
        things = (replace(one, colour=one.colour or painted.get(one.name, _FIXED)) for one in self.things)
        return Scene(self.floor, tuple(things))


def has_moved(known: ThingPose | None, pose: ThingPose) -> bool:
    """Whether a thing is elsewhere than was known, by more than `STIRRED`; one of which nothing was known is."""
    return known is None or max(abs(a - b) for a, b in zip(pose, known, strict=True)) > STIRRED


def pose_matrix(pose: Sequence[float]) -> Array:
    """A pose of position and quaternion, (7,), as a matrix, (4, 4)."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation(pose[3:]), pose[:3]
    return X


def read_scene(path: Path) -> Scene:
    """Read a scene: TOML, or JSON of a file whose name ends so.

    Raises:
        FormatError: If it can't be read, or isn't one; the message says where, and what is allowed.
    """
    try:
        text = bounded_text(path, _MOST_BYTES)
        decode = msgspec.json.decode if path.suffix.lower() == ".json" else msgspec.toml.decode
        return decode(text, type=Scene)
    except OSError as error:
        raise FormatError(str(path), error.strerror or str(error)) from None
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise FormatError(str(path), str(error)) from None
