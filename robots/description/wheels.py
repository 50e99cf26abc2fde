"""Wheels of a description: joints that turn without end, and whose links touch the floor in pairs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robots.description.description import Description, Joint, JointKind, corners_of
from robots.description.numbers import BaseNumbers
from robots.description.rigid import carried
from robots.solids import LinkShape
from vrs.errors import InvalidValueError
from vrs.model import Array

_LEVEL: Final = 0.2
"""Sine of the steepest slope of an axle."""
_NEAR: Final = 0.15
"""By how much of its radius a wheel may be off the floor, or a pair be askew."""
_MOST_ARM: Final = 2
"""Most other joints behind each other of a base: a sensor that pans and tilts. More are an arm."""


@dataclass(frozen=True, slots=True, eq=False)
class WheeledBase:
    """A mobile robot that a description is of."""

    numbers: BaseNumbers
    """As far as the description says them; the sizes, from its shapes."""
    shapes: tuple[LinkShape, ...]
    """What it looks like."""
    frames: Array
    """Where the shapes are in the robot's frame, (m, 4, 4): amid the driven axle, on the floor, x forward."""
    notes: tuple[str, ...]
    """What was assumed, a sentence each."""


@dataclass(frozen=True, slots=True, eq=False)
class _Wheel:
    joint: Joint
    centre: Array
    """[m], (3,), in the root's frame."""
    axis: Array
    """Unit vector, (3,), in the same."""
    radius: float
    """[m]."""
    width: float
    """[m]."""

    @property
    def lowest(self) -> float:
        return float(self.centre[2]) - self.radius


def placed(description: Description) -> dict[str, Array]:
    """Poses of all links in the root's frame where joints are at 0, or as near as their limits allow, (4, 4)."""
    return {name: X for name, (_, X) in carried(description, ()).items()}


def wheeled(description: Description, stated: BaseNumbers) -> WheeledBase | None:
    """Return the mobile robot that a description is of; None where it has no wheels in pairs, or has an arm.

    Args:
        description: What the robot is.
        stated: What's stated of it; that counts more than what is measured.

    Raises:
        InvalidValueError: If wheels are steered.
    """
    poses = placed(description)
    every = _wheels(description, poses)
    wheels = [wheel for wheel in every if not any(above.moves for above in description.chain(wheel.joint.parent))]
    turned = {wheel.joint.name for wheel in wheels}
    others = max(
        (
            sum(joint.moves and joint.name not in turned for joint in description.chain(leaf))
            for leaf in description.leaves()
        ),
        default=0,
    )
    if not wheels or others > _MOST_ARM:
        return None
    floor = min(wheel.lowest for wheel in wheels)
    standing = [wheel for wheel in wheels if wheel.lowest - floor < _NEAR * wheel.radius]
    left, right = _sides(standing)
    pairs = [(one, other) for one in left for other in right if _is_pair(one, other)]
    if not pairs:
        return None
    steering = [
        f"{above.name} steers {wheel.joint.name}"
        for wheel in every
        for above in description.chain(wheel.joint.parent)
        if _steers(above, poses) and wheel.lowest - floor < _NEAR * wheel.radius
    ]
    if steering:
        allowed = f"driven by its two sides, without steered wheels; {', '.join(steering)}"
        raise InvalidValueError("robot", description.name, allowed)
    return _based(description, poses, pairs, floor, stated)


def _wheels(description: Description, poses: dict[str, Array]) -> list[_Wheel]:
    found = []
    for joint in description.joints:
        endless = joint.kind is JointKind.CONTINUOUS or (joint.kind is JointKind.REVOLUTE and joint.q_min is None)
        X = poses[joint.child]
        axis = X[:3, :3] @ joint.axis
        if not endless or joint.mimic is not None or abs(axis[2]) > _LEVEL:
            continue
        link = description.links[joint.child]
        corners = corners_of(link.shapes or link.collisions)
        if not len(corners):
            continue
        along = corners @ joint.axis
        radius = float(np.linalg.norm(corners - np.outer(along, joint.axis), axis=1).max())
        centre = X[:3, :3] @ (joint.axis * 0.5 * (along.min() + along.max())) + X[:3, 3]
        found.append(_Wheel(joint, centre, axis, radius, float(np.ptp(along))))
    return found


def _steers(joint: Joint, poses: dict[str, Array]) -> bool:
    """Whether a joint turns what hangs on it about a vertical axis, within limits; a caster has none."""
    upright = abs(float((poses[joint.child][:3, :3] @ joint.axis)[2])) > 1 - _LEVEL
    return joint.kind is JointKind.REVOLUTE and joint.q_min is not None and upright


def _across(wheels: list[_Wheel]) -> Array:
    """The direction of the axles, level, to the left of whoever looks along +x as far as that can be."""
    axis = wheels[0].axis.copy()
    axis[2] = 0.0
    axis /= np.linalg.norm(axis)
    # Forward is across × up; it's along +x rather than −x, else along +y.
    forward = np.cross(axis, (0.0, 0.0, 1.0))
    return axis if (forward[0], forward[1]) > (1e-9, 0.0) or (abs(forward[0]) <= 1e-9 and forward[1] > 0) else -axis


def _sides(wheels: list[_Wheel]) -> tuple[list[_Wheel], list[_Wheel]]:
    """The wheels on the left and on the right of the middle between all."""
    across = _across(wheels)
    places = [float(wheel.centre @ across) for wheel in wheels]
    middle = 0.5 * (min(places) + max(places))
    return (
        [wheel for wheel, place in zip(wheels, places, strict=True) if place > middle],
        [wheel for wheel, place in zip(wheels, places, strict=True) if place < middle],
    )


def _is_pair(left: _Wheel, right: _Wheel) -> bool:
    """Whether two wheels are of one size, on one axle."""
    off = left.centre - right.centre
    across = left.axis
    askew = float(np.linalg.norm(off - (off @ across) * across))
    near = _NEAR * left.radius
    return (
        abs(left.radius - right.radius) < near and askew < near and abs(float(left.axis @ right.axis)) > 1 - _LEVEL
    )


def _based(
    description: Description,
    poses: dict[str, Array],
    pairs: list[tuple[_Wheel, _Wheel]],
    floor: float,
    stated: BaseNumbers,
) -> WheeledBase:
    driven = [wheel for pair in pairs for wheel in pair]
    left, right = (np.mean([pair[side].centre for pair in pairs], axis=0) for side in (0, 1))
    across = _across([wheel for pair in pairs for wheel in pair])
    X_WR = np.eye(4)
    X_WR[:3, 0], X_WR[:3, 1], X_WR[:3, 3] = np.cross(across, (0.0, 0.0, 1.0)), across, 0.5 * (left + right)
    X_WR[2, 3] = floor
    X_RW = np.linalg.inv(X_WR)
    shapes: list[LinkShape] = []
    frames: list[Array] = []
    for name, link in description.links.items():
        shapes += link.shapes
        frames += [X_RW @ poses[name]] * len(link.shapes)
    ends = [
        shape.vertices @ (X_RW @ poses[name])[:3, :3].T + (X_RW @ poses[name])[:3, 3]
        for name, link in description.links.items()
        for shape in (*link.shapes, *link.collisions)
    ]
    corners = np.concatenate(ends)
    low, high = corners.min(axis=0), corners.max(axis=0)
    wheelbase = float((left - right) @ across)
    radius = float(np.mean([wheel.radius for wheel in driven]))
    speeds = [wheel.joint.qd_max for wheel in driven if wheel.joint.qd_max]
    mass = sum(link.mass for link in description.links.values())
    measured = {
        "wheelbase": wheelbase,
        "wheel": radius,
        "length": float(high[0] - low[0]),
        "width": float(high[1] - low[1]),
        "height": float(high[2]),
        "axle": -float(high[0] + low[0]) / 2,
        "mass": mass or None,
        "v": min(speeds) * radius if len(speeds) == len(driven) else None,
    }
    fields = {name: getattr(stated, name) for name in BaseNumbers.__struct_fields__}
    numbers = {name: measured.get(name) if value is None else value for name, value in fields.items()}
    names = ", ".join(wheel.joint.name for wheel in driven)
    notes = [f"It's a mobile robot, as {names} are wheels that touch the floor in pairs."]
    if len(pairs) > 1:
        notes.append(
            f"It has {len(pairs)} axles: it's driven as on one amid them, with one wheel on either side; how they "
            "skid isn't modelled. A wheelbase wider than the real one, stated as [base] wheelbase, comes near it."
        )
    rest = [
        joint.name
        for joint in description.joints
        if joint.moves and joint.name not in {w.joint.name for w in driven}
    ]
    if rest:
        notes.append(f"{', '.join(rest)}: these joints aren't driven; they stay where they are.")
    return WheeledBase(BaseNumbers(**numbers), tuple(shapes), np.array(frames).reshape(-1, 4, 4), tuple(notes))
