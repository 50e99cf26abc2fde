"""Forward kinematics and Jacobian of many joint positions at once.

Source: Denavit-Hartenberg, standard form: A_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(α_i).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robots.puma560.parameters import DH_A, DH_ALPHA, DH_D, DOF
from vrs.model import Array, frozen_array

# Rounded: the twists are right angles, whose cosine is 0 and not 6e-17.
_COS_ALPHA: Final = frozen_array([round(math.cos(alpha)) for alpha in DH_ALPHA])
_SIN_ALPHA: Final = frozen_array([round(math.sin(alpha)) for alpha in DH_ALPHA])
_A: Final = frozen_array(DH_A)
_D: Final = frozen_array(DH_D)


def link_poses(q: Array) -> Array:
    """Return the poses of base and links in the base frame, (k, 7, 4, 4), for q of shape (k, 6) [rad]."""
    c, s = np.cos(q), np.sin(q)
    steps = np.zeros((*q.shape, 4, 4))
    steps[..., 0, 0], steps[..., 1, 0] = c, s
    steps[..., 0, 1], steps[..., 1, 1] = -s * _COS_ALPHA, c * _COS_ALPHA
    steps[..., 0, 2], steps[..., 1, 2] = s * _SIN_ALPHA, -c * _SIN_ALPHA
    steps[..., 2, 1], steps[..., 2, 2] = _SIN_ALPHA, _COS_ALPHA
    steps[..., 0, 3], steps[..., 1, 3] = _A * c, _A * s
    steps[..., 2, 3], steps[..., 3, 3] = _D, 1.0
    poses = np.empty((len(q), DOF + 1, 4, 4))
    poses[:, 0] = np.eye(4)
    for i in range(DOF):
        np.matmul(poses[:, i], steps[:, i], out=poses[:, i + 1])
    return poses


def geometric_jacobian(q: Array) -> Array:
    """Return the Jacobian of the last link's origin in the base frame, (k, 6, 6), for q of shape (k, 6) [rad].

    Rows 0 to 2 are linear [m/rad], rows 3 to 5 angular.
    """
    poses = link_poses(q)
    z = poses[:, :-1, :3, 2].swapaxes(1, 2)
    p = (poses[:, -1:, :3, 3] - poses[:, :-1, :3, 3]).swapaxes(1, 2)
    jacobian = np.empty((len(q), 6, DOF))
    jacobian[:, 0] = z[:, 1] * p[:, 2] - z[:, 2] * p[:, 1]
    jacobian[:, 1] = z[:, 2] * p[:, 0] - z[:, 0] * p[:, 2]
    jacobian[:, 2] = z[:, 0] * p[:, 1] - z[:, 1] * p[:, 0]
    jacobian[:, 3:] = z
    return jacobian
