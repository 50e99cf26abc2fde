"""Which links of a description move as one, where they are, and what its arm weighs: a chain of rigid links."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robots.chain import Chain, ChainLink, Inertia, about, quaternion, together
from robots.description.description import Description, Joint, JointKind
from vrs.model import Array


def carried(description: Description, moving: Sequence[str]) -> dict[str, tuple[int, Array]]:
    """Which joint each link goes with, and where it is in the frame that this joint moves.

    What hangs on other joints is fixed where they rest: at 0, or at the limit that is nearest to it.

    Args:
        description: Of the robot.
        moving: Names of the joints that move.

    Returns:
        By link the number of the joint, −1 for those that stay with the root, and a pose, (4, 4).
    """
    found: dict[str, tuple[int, Array]] = {description.root: (-1, np.eye(4))}
    for joint in description.joints:
        owner, X = found[joint.parent]
        if joint.name in moving:
            found[joint.child] = moving.index(joint.name), np.eye(4)
        else:
            found[joint.child] = owner, X @ joint.X @ motion(joint, at_rest(joint))
    return found


def rigid_chain(description: Description, tip: str) -> Chain:
    """The links between the joints that lead to a tip.

    Args:
        description: Of the robot, nothing missing.
        tip: The link that holds loads.

    Returns:
        A link a moving joint.
    """
    moving = [joint for joint in description.chain(tip) if joint.moves]
    placed = carried(description, [joint.name for joint in moving])
    parts: list[list[Inertia]] = [[] for _ in moving]
    for name, (owner, X) in placed.items():
        if owner >= 0:
            link = description.links[name]
            parts[owner].append(Inertia(link.mass, link.centre, link.inertia).moved(X))
    links = [
        _link(joint, placed[joint.parent][1] @ joint.X, together(part))
        for joint, part in zip(moving, parts, strict=True)
    ]
    return Chain(tuple(links), placed[tip][1])


def _link(joint: Joint, X: Array, inertia: Inertia) -> ChainLink:
    return ChainLink(
        X[:3, 3],
        quaternion(X[:3, :3]),
        inertia,
        axis=joint.axis,
        prismatic=joint.kind is JointKind.PRISMATIC,
        effort=joint.effort or math.inf,
        armature=joint.armature or 0.0,
        viscous=joint.damping,
        coulomb=(joint.friction, -joint.friction),
    )


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
        X[:3, :3] = about(joint.axis, np.array(q))
    return X
