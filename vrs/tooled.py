"""A robot seen through a tool: its poses are those of a frame fixed to the last link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vrs.model import Array, Limits, RobotModel


@dataclass(frozen=True, slots=True, eq=False)
class Tooled:
    """A robot model whose `forward`, `jacobian` and inverses are of the tool; joints and links stay what they are.

    Attributes of the arm itself, such as how near it is to a singularity, are asked of `arm`.
    """

    arm: RobotModel
    """The robot."""
    tool: Array
    """Pose of the tool in the frame of the last link, (4, 4)."""
    to_link: Array
    """Pose of the last link in the tool's frame, (4, 4)."""

    @property
    def name(self) -> str:
        """The arm's."""
        return self.arm.name

    @property
    def limits(self) -> Limits:
        """The arm's."""
        return self.arm.limits

    @property
    def poses(self) -> Mapping[str, Array]:
        """The arm's named joint positions, each (n,) [rad]."""
        return self.arm.poses

    @property
    def tool_speed(self) -> float:
        """Nominal linear speed of the tool [m/s]."""
        return self.arm.tool_speed

    @property
    def tool_turn_speed(self) -> float:
        """Nominal angular speed of the tool [rad/s]."""
        return self.arm.tool_turn_speed

    @property
    def characteristic_length(self) -> float:
        """The arm's [m]."""
        return self.arm.characteristic_length

    def forward(self, q: ArrayLike) -> Array:
        """Pose of the tool in the base frame, (4, 4), or (k, 4, 4) for q of shape (k, n)."""
        return self.arm.forward(q) @ self.tool

    def links(self, q: ArrayLike) -> Array:
        """See `RobotModel.links`: of the arm alone."""
        return self.arm.links(q)

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobian of the tool in the base frame, (6, n) or (k, 6, n)."""
        J = np.array(self.arm.jacobian(q))
        arm = self.arm.forward(q)[..., :3, :3] @ self.tool[:3, 3]
        J[..., :3, :] += np.cross(J[..., 3:, :], arm[..., :, None], axis=-2)
        return J

    def inverse(self, X: ArrayLike, within_limits: bool = True) -> Array:
        """Every joint solution of one pose of the tool, (m, n); m is 0 where none exists."""
        return self.arm.inverse(np.asarray(X) @ self.to_link, within_limits)

    def inverse_near(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """See `RobotModel.inverse_near`; X is a pose of the tool."""
        return self.arm.inverse_near(np.asarray(X) @ self.to_link, q, configuration)

    def follow(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """See `RobotModel.follow`; X are poses of the tool."""
        return self.arm.follow(np.asarray(X) @ self.to_link, q, configuration)

    def configuration(self, q: ArrayLike) -> str:
        """The arm's at q."""
        return self.arm.configuration(q)


def tooled(model: RobotModel, tool: Array | None) -> RobotModel:
    """The model seen through a tool, (4, 4); itself where there's none."""
    if tool is None:
        return model
    # Its own rotation may be orthonormal to 1e-6 only, which would show at the end of a line.
    U, _, Vt = np.linalg.svd(tool[:3, :3])
    R, p = U @ Vt, tool[:3, 3]
    there, back = np.eye(4), np.eye(4)
    there[:3, :3], there[:3, 3] = R, p
    back[:3, :3], back[:3, 3] = R.T, -R.T @ p
    return Tooled(model, there, back)


def bare(model: RobotModel) -> RobotModel:
    """The robot itself, without a tool that it may be seen through."""
    return model.arm if isinstance(model, Tooled) else model
