"""What a description's arm weighs: a chain of rigid links, and what was assumed of its drives."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robots.chain import Chain, ChainLink, Inertia, quaternion, together
from robots.description.description import Description, Joint, JointKind
from vrs.model import Array

ROTOR_TIME: Final = 0.02
"""In what time a drive with nothing on it reaches its joint's largest speed, where its inertia isn't said [s]."""
ROTOR_MOST: Final = (0.1, 10.0)
"""Inertia that is assumed at most [kg m²], and of prismatic joints [kg]."""


def rigid_chain(description: Description, tip: str) -> tuple[Chain, tuple[str, ...]]:
    """The links between the joints that lead to a tip.

    What hangs on other joints is fixed where they rest: at 0, or at the limit that is nearest to it.

    Args:
        description: Of the robot, nothing missing.
        tip: The link that holds loads.

    Returns:
        The chain, a link a moving joint; and what was assumed, a sentence each.
    """
    moving = {joint.name: k for k, joint in enumerate(j for j in description.chain(tip) if j.moves)}
    placed: dict[str, tuple[int, Array]] = {description.root: (-1, np.eye(4))}
    joints: list[tuple[Joint, Array]] = []
    for joint in description.joints:
        owner, X = placed[joint.parent]
        if joint.name in moving:
            joints.append((joint, X @ joint.X))
            placed[joint.child] = moving[joint.name], np.eye(4)
        else:
            placed[joint.child] = owner, X @ joint.X @ motion(joint, at_rest(joint))
    parts: list[list[Inertia]] = [[] for _ in joints]
    for name, (owner, X) in placed.items():
        if owner >= 0:
            link = description.links[name]
            parts[owner].append(Inertia(link.mass, link.centre, link.inertia).moved(X))
    links = tuple(_link(joint, X, together(part)) for (joint, X), part in zip(joints, parts, strict=True))
    return Chain(links, placed[tip][1]), tuple(_notes([joint for joint, _ in joints]))


def _link(joint: Joint, X: Array, inertia: Inertia) -> ChainLink:
    prismatic, effort = joint.kind is JointKind.PRISMATIC, joint.effort or math.inf
    armature = joint.armature
    if not armature and joint.effort and joint.qd_max:
        armature = min(ROTOR_TIME * joint.effort / joint.qd_max, ROTOR_MOST[prismatic])
    return ChainLink(
        X[:3, 3],
        quaternion(X[:3, :3]),
        inertia,
        axis=joint.axis,
        prismatic=prismatic,
        effort=effort,
        armature=armature,
        viscous=joint.damping,
        coulomb=(joint.friction, -joint.friction),
    )


def _notes(joints: list[Joint]) -> list[str]:
    unlimited = ", ".join(joint.name for joint in joints if not joint.effort)
    rotors = ", ".join(joint.name for joint in joints if joint.effort and not joint.armature)
    notes = (
        [f"{unlimited}: no effort is said; drives have no limit and no inertia of their own."] if unlimited else []
    )
    if rotors:
        notes.append(
            f"{rotors}: no inertia of the drive is said; assumed such that it reaches the joint's speed in "
            f"{1e3 * ROTOR_TIME:g} ms by itself, at most {ROTOR_MOST[0]:g} kg m² or {ROTOR_MOST[1]:g} kg."
        )
    return notes


def at_rest(joint: Joint) -> float:
    """Where a joint stands that nobody moves: at 0, or at the limit that is nearest to it."""
    if joint.kind is JointKind.FIXED:
        return 0.0
    if joint.mimic is not None:
        return joint.mimic.offset
    low = -math.inf if joint.q_min is None else joint.q_min
    high = math.inf if joint.q_max is None else joint.q_max
    return min(max(0.0, low), high)


def motion(joint: Joint, q: float) -> Array:
    """Pose of the child's frame that a joint value makes of the one at 0, (4, 4)."""
    X = np.eye(4)
    if joint.kind is JointKind.PRISMATIC:
        X[:3, 3] = q * joint.axis
    elif joint.kind is not JointKind.FIXED:
        x, y, z = joint.axis
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        X[:3, :3] += math.sin(q) * K + (1.0 - math.cos(q)) * (K @ K)
    return X
