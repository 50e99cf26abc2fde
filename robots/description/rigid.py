"""What a description's arm weighs: a chain of rigid links."""

from __future__ import annotations

import math

import numpy as np

from robots.chain import Chain, ChainLink, Inertia, quaternion, together
from robots.description.description import Description, Joint, JointKind
from vrs.model import Array


def rigid_chain(description: Description, tip: str) -> Chain:
    """The links between the joints that lead to a tip.

    What hangs on other joints is fixed where they rest: at 0, or at the limit that is nearest to it.

    Args:
        description: Of the robot, nothing missing.
        tip: The link that holds loads.

    Returns:
        A link a moving joint.
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
    return Chain(links, placed[tip][1])


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
        x, y, z = joint.axis
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        X[:3, :3] += math.sin(q) * K + (1.0 - math.cos(q)) * (K @ K)
    return X
