"""What a description of a robot says, whatever its format: links, joints, named poses; and what was assumed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

import numpy as np

from robots.solids import LinkShape
from vrs.errors import InvalidValueError
from vrs.model import Array


class JointKind(Enum):
    """How a joint moves."""

    REVOLUTE = "revolute"
    """It turns between limits."""
    CONTINUOUS = "continuous"
    """It turns without limits."""
    PRISMATIC = "prismatic"
    FIXED = "fixed"


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A rigid body, in its own frame."""

    name: str
    mass: float = 0.0
    """[kg]; 0 where nothing is said."""
    centre: Array = field(default_factory=lambda: np.zeros(3))
    """Centre of mass [m], (3,)."""
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """About the centre of mass, along the link's axes [kg m²], (3, 3)."""
    shapes: tuple[LinkShape, ...] = ()
    """What it looks like."""
    collisions: tuple[LinkShape, ...] = ()
    """What it touches with; convex pieces."""


def corners_of(shapes: Sequence[LinkShape]) -> Array:
    """Corners of shapes in one frame, (n, 3) [m]."""
    return np.concatenate([shape.vertices for shape in shapes]) if shapes else np.zeros((0, 3))


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: its value is multiplier · q + offset."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """How a child link moves in its parent's frame: X_PC(q) = X · motion(axis, q)."""

    name: str
    kind: JointKind
    parent: str
    child: str
    X: Array = field(default_factory=lambda: np.eye(4))
    """Pose of the child's frame in the parent's at q = 0, (4, 4)."""
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    """Unit vector in the child's frame, (3,)."""
    q_min: float | None = None
    """[rad], of prismatic joints [m]; None where nothing is said, as of the others below."""
    q_max: float | None = None
    qd_max: float | None = None
    """[rad/s], [m/s]."""
    qdd_max: float | None = None
    """[rad/s²], [m/s²]."""
    qddd_max: float | None = None
    """[rad/s³], [m/s³]."""
    effort: float | None = None
    """Largest torque [N m] or force [N]."""
    damping: float = 0.0
    """Viscous friction [N m s/rad], [N s/m]."""
    friction: float = 0.0
    """Coulomb friction [N m], [N]."""
    armature: float | None = None
    """Inertia of the drive at the joint [kg m²], mass [kg]."""
    mimic: Mimic | None = None

    @property
    def moves(self) -> bool:
        """Whether it has a value of its own."""
        return self.kind is not JointKind.FIXED and self.mimic is None


@dataclass(frozen=True, slots=True, eq=False)
class Description:
    """A tree of links and joints."""

    name: str
    links: Mapping[str, Link]
    joints: tuple[Joint, ...]
    """Parents before children."""
    poses: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Named poses: values of joints by their names."""
    tips: Mapping[str, str] = field(default_factory=dict)
    """Named groups that are chains: the tip of each."""
    hand: tuple[str, ...] = ()
    """Joints of the end effector, where the SRDF says which; empty where nothing is said."""
    tip: str = ""
    """The link at the end of the arm; empty where nobody has chosen."""
    tool_speed: float | None = None
    """Nominal linear speed of the tool [m/s]; None where nothing is said."""
    tool_turn_speed: float | None = None
    """Nominal angular speed of the tool [rad/s]; None where nothing is said."""
    point: tuple[float, float, float] | None = None
    """Where a gripper holds, in the tip's frame [m]; None where nothing is said."""
    gravity: float = 9.81
    """Free fall along -z of the root [m/s²]."""
    notes: tuple[str, ...] = ()
    """What was missing or can't be, what was assumed for it, and how it's stated; a sentence each."""

    @property
    def root(self) -> str:
        """The link that has no parent."""
        children = {joint.child for joint in self.joints}
        return next(name for name in self.links if name not in children)

    def joint_above(self, link: str) -> Joint | None:
        """The joint that a link hangs on; None of the root."""
        return next((joint for joint in self.joints if joint.child == link), None)

    def leaves(self) -> tuple[str, ...]:
        """Links that carry no other."""
        parents = {joint.parent for joint in self.joints}
        return tuple(name for name in self.links if name not in parents)

    def chain(self, tip: str) -> tuple[Joint, ...]:
        """The joints from the root to a link, in that order, fixed ones among them.

        Raises:
            InvalidValueError: If there's no such link.
        """
        if tip not in self.links:
            raise InvalidValueError("tip", tip, f"a link of {self.name}: {', '.join(self.links)}")
        found: list[Joint] = []
        joint = self.joint_above(tip)
        while joint is not None:
            found.append(joint)
            joint = self.joint_above(joint.parent)
        return tuple(reversed(found))


MOST_JOINTS: Final = 12
"""Joints of an arm that move by themselves."""
