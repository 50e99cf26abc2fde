"""A robot's chain as screws, so that a page can place its links by itself."""

from __future__ import annotations

from typing import Any

import numpy as np

from interfaces.station.panels import Offer
from robots.robot import Display, Robot
from vrs.errors import InvalidValueError
from vrs.model import Array, RobotModel

SAME = 1e-9
"""By how much a model may differ from its screws [m, 1]."""


def screws(model: RobotModel) -> tuple[Array, Array]:
    """The product of exponentials of a chain of revolute and prismatic joints.

    Returns:
        Poses of the base and of the links at q = 0, (n + 1, 4, 4), and the joints' screws (ω, v) in the base frame,
        (n, 6): link i stands at exp(S_1 q_1) … exp(S_i q_i) times its pose at zero.

    Raises:
        InvalidValueError: If the model is no such chain.

    Source: Lynch, Park, "Modern Robotics", eq. (4.14).
    """
    n = model.limits.dof
    home = np.asarray(model.links(np.zeros(n)))
    found = []
    for joint in range(n):
        turned = np.asarray(model.links(0.5 * np.eye(n)[joint]))
        A = turned[joint + 1] @ np.linalg.inv(home[joint + 1])
        skew = 0.5 * (A[:3, :3] - A[:3, :3].T)
        axis = np.array([skew[2, 1], skew[0, 2], skew[1, 0]]) / np.sin(0.5)
        if np.linalg.norm(axis) < 0.5:
            found.append(np.concatenate([np.zeros(3), A[:3, 3] / 0.5]))
            continue
        # The translation of exp(S q) is (I − R) p for a point p of the axis, and v = −ω × p.
        point = np.linalg.lstsq(np.eye(3) - A[:3, :3], A[:3, 3], rcond=1e-9)[0]
        found.append(np.concatenate([axis, -np.cross(axis, point)]))
    S = np.array(found)
    q = np.linspace(-0.7, 0.9, n)
    if np.abs(place(home, S, q) - np.asarray(model.links(q))).max() > SAME:
        raise InvalidValueError("model", model.name, "a chain of revolute and prismatic joints")
    return home, S


def place(home: Array, S: Array, q: Array) -> Array:
    """Poses of the base and of the links at q, (n + 1, 4, 4); what `static/chain.js` does.

    Args:
        home: From `screws`.
        S: From `screws`.
        q: Joints [rad, m], (n,).
    """
    X, poses = np.eye(4), [home[0]]
    for k, screw in enumerate(S):
        X = X @ _exp(screw, float(q[k]))
        poses.append(X @ home[k + 1])
    return np.array(poses)


def _exp(screw: Array, q: float) -> Array:
    w, v = screw[:3], screw[3:]
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    sine, versed = np.sin(q), 1.0 - np.cos(q)
    X = np.eye(4)
    X[:3, :3] += sine * W + versed * W @ W
    if np.any(w):
        X[:3, 3] = (q * np.eye(3) + versed * W + (q - sine) * W @ W) @ v
    else:
        X[:3, 3] = q * v
    return X


def described(robot: Robot) -> dict[str, Any]:
    """What a page needs to know of a robot: of which kind its segments are, and how they're drawn.

    Args:
        robot: Of an arm, its chain is told, and the point that is drawn and dragged; of a mobile robot, whether it
            has a display.
    """
    if robot.is_base:
        return {"segments": Offer.ARCS, "name": robot.name, "display": robot.device(Display) is not None}
    home, S = screws(robot.arm)
    gripper, hand = robot.hand, None
    if gripper is not None and gripper.fingers is not None:
        # The fingers' middles are so far from the middle of the hand, beside half of the opening [m].
        hand = {"link": len(home) - 1, "aside": gripper.fingers.thickness / 2}
    return {
        "segments": Offer.POLYNOMIALS,
        "home": [X.T.ravel().tolist() for X in home],
        "screws": S.tolist(),
        "tool": list(robot.tool),
        "joints": list(robot.joints),
        "tool_speed": robot.arm.tool_speed,
        "tool_turn_speed": robot.arm.tool_turn_speed,
        "hand": hand,
    }
