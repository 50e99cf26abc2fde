"""An arm of a description: forward kinematics alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robots.description.description import Description, JointKind
from vrs.model import Array, Limits


def arm_model(description: Description, tip: str) -> Any:
    """Return the model of the arm up to a link."""
    return ArmModel(description, tip)


class ArmModel:
    """Kinematics and limits."""

    def __init__(self, description: Description, tip: str) -> None:
        chain = description.chain(tip)
        self._chain = chain
        moving = [j for j in chain if j.moves]
        self.name = description.name
        self.limits = Limits(
            *(
                np.array([getattr(j, k) for j in moving])
                for k in ("q_min", "q_max", "qd_max", "qdd_max", "qddd_max")
            )
        )
        self.prismatic = tuple(k for k, j in enumerate(moving) if j.kind is JointKind.PRISMATIC)
        self.tool_speed = description.tool_speed
        self.tool_turn_speed = description.tool_turn_speed
        self.characteristic_length = 0.5
        self.poses: Mapping[str, Array] = {
            name: np.array([pose.get(j.name, 0.0) for j in moving]) for name, pose in description.poses.items()
        }

    def links(self, q: ArrayLike) -> Array:
        """Poses of base and links."""
        q = np.asarray(q, dtype=float)
        X = np.zeros((*q.shape[:-1], 4, 4)) + np.eye(4)
        found, k = [X], 0
        for joint in self._chain:
            X = X @ joint.X
            if joint.moves:
                X = X @ _motions(joint.axis, q[..., k], joint.kind is JointKind.PRISMATIC)
                k += 1
                found.append(X)
            else:
                found[-1] = X if k else found[-1]
        return np.stack(found, axis=-3)

    def forward(self, q: ArrayLike) -> Array:
        """Pose of the tip."""
        return np.asarray(self.links(q)[..., -1, :, :])


def _motions(axis: Array, q: Array, slides: bool) -> Array:
    X = np.zeros((*q.shape, 4, 4)) + np.eye(4)
    if slides:
        X[..., :3, 3] = q[..., None] * axis
    else:
        W = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        X[..., :3, :3] += np.sin(q)[..., None, None] * W + (1 - np.cos(q))[..., None, None] * (W @ W)
    return X
