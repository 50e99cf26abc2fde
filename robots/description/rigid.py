"""What a description's arm weighs: a chain of rigid links, and what was assumed for it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robots.chain import Chain, ChainLink, Inertia, quaternion, together
from robots.description.description import Description, Joint, JointKind
from vrs.model import Array

LEAST_MASS: Final = 0.1
"""Mass of a moving link of which none is stated [kg], an assumption."""
LEAST_SIZE: Final = 0.02
"""Radius of the ball by whose inertia one is replaced that is less [m], an assumption."""


def rigid_chain(description: Description, tip: str) -> tuple[Chain, tuple[str, ...]]:
    """The links between the joints that lead to a tip.

    What hangs on other joints is fixed where they rest: at 0, or at the limit that is nearest to it.

    Args:
        description: Of the robot.
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
    notes: list[str] = []
    links = tuple(_link(*joint, together(part), notes) for joint, part in zip(joints, parts, strict=True))
    return Chain(links, placed[tip][1]), tuple(notes)


def _link(joint: Joint, X: Array, inertia: Inertia, notes: list[str]) -> ChainLink:
    mass, centre, tensor = inertia
    if mass <= 0.0:
        mass = LEAST_MASS
        notes.append(f"no link on joint {joint.name} has a mass: {LEAST_MASS:g} kg is assumed")
    least = 0.4 * mass * LEAST_SIZE**2
    if np.linalg.eigvalsh(tensor)[0] < 0.1 * least:
        tensor = tensor + least * np.eye(3)
        notes.append(
            f"links on joint {joint.name} have no inertia about some axis: that of a ball of "
            f"{100 * LEAST_SIZE:g} cm is added"
        )
    effort = joint.effort if joint.effort else math.inf
    if effort == math.inf:
        notes.append(f"joint {joint.name} states no effort: its drive has no limit")
    return ChainLink(
        X[:3, 3],
        quaternion(X[:3, :3]),
        Inertia(mass, centre, tensor),
        axis=joint.axis,
        prismatic=joint.kind is JointKind.PRISMATIC,
        effort=effort,
        armature=joint.armature,
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
