"""Geometry θ, limits and named poses of the PUMA 560.

Lengths and signs are those of the Robotics Toolbox's `Puma560` in standard Denavit-Hartenberg form; the base
frame is at the shoulder, so the Toolbox's pedestal isn't in d1.

Source: Corke, Armstrong-Hélouvry, "A search for consensus among model parameters reported for the PUMA 560
robot", ICRA 1994.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from vrs.model import Array, Limits, frozen_array

DOF: Final = 6
"""Number of joints."""

A2: Final = 0.4318
"""Length of the upper arm, shoulder to elbow [m]."""
A3: Final = 0.0203
"""Offset of the forearm's axis from the elbow [m]."""
D3: Final = 0.15005
"""Lateral offset of the wrist centre from the waist axis [m]."""
D4: Final = 0.4318
"""Length of the forearm, elbow to wrist centre [m]."""

DH_A: Final = (0.0, A2, A3, 0.0, 0.0, 0.0)
"""Link lengths a [m]."""
DH_ALPHA: Final = (math.pi / 2, 0.0, -math.pi / 2, math.pi / 2, -math.pi / 2, 0.0)
"""Link twists α [rad]."""
DH_D: Final = (0.0, 0.0, D3, D4, 0.0, 0.0)
"""Joint offsets d [m]."""

PEDESTAL: Final = 26.45 * 0.0254
"""Height of the shoulder over the mounting surface [m]; the Toolbox's d1, not part of `forward`."""
FLANGE: Final = 0.05625
"""Distance of the mounting flange from the wrist centre [m]; a tool, not part of `forward`."""

TOOL_SPEED: Final = 0.5
"""Nominal linear speed of the tool [m/s], an assumption."""
TOOL_TURN_SPEED: Final = math.pi / 2
"""Nominal angular speed of the tool [rad/s], an assumption: what the slow joints, 1 to 3, about manage."""

Q_MIN_DEG: Final = (-160.0, -45.0, -225.0, -110.0, -100.0, -266.0)
"""Lowest joint positions [deg]."""
Q_MAX_DEG: Final = (160.0, 225.0, 45.0, 170.0, 100.0, 266.0)
"""Highest joint positions [deg]."""
QD_MAX_DEG: Final = (82.0, 74.0, 122.0, 228.0, 241.0, 228.0)
"""Largest joint speeds [deg/s], an assumption: sources differ."""
ACCELERATION_TIME: Final = 0.25
"""Time from rest to the largest speed [s]; it sets the largest accelerations, an assumption."""


def default_limits() -> Limits:
    """Return the documented limits; the jerk is that of `vrs.model.Limits`, also an assumption."""
    qd_max = np.radians(QD_MAX_DEG)
    return Limits(
        q_min=np.radians(Q_MIN_DEG),
        q_max=np.radians(Q_MAX_DEG),
        qd_max=qd_max,
        qdd_max=qd_max / ACCELERATION_TIME,
    )


POSES: Final[Mapping[str, Array]] = MappingProxyType(
    {
        "ready": frozen_array((0.0, math.pi / 2, -math.pi / 2, 0.0, 0.0, 0.0)),
        "zero": frozen_array((0.0,) * DOF),
        "nominal": frozen_array((0.0, math.pi / 4, -math.pi, 0.0, math.pi / 4, 0.0)),
        "stretch": frozen_array((0.0, 0.0, -math.pi / 2, 0.0, 0.0, 0.0)),
    }
)
"""Named joint positions [rad], (6,): the Toolbox's qr, qz, qn and qs."""
