"""The robot's centre C beside the middle M of its driving axle: D ahead of it, eq. (2).

Everything else here counts from M. The IPR's axle is 6 cm ahead of its centre, so its D is −0.06 m. Eq. (1) is
`vrs.mobile.speeds`.

Source: Kim, Han, Kim, Kim 2002, section 2.2.
"""

from __future__ import annotations

import math

import numpy as np

from vrs.model import Array


def centre_rates(theta: float, D: float) -> Array:
    """What speeds (v, ω) of M make of C's posture: (x, y, θ)' = this times (v, ω), (3, 2).

    Args:
        theta: Heading [rad].
        D: How far C is ahead of M [m].

    Source: eq. (2).
    """
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -D * s], [s, D * c], [0.0, 1.0]])


def centre_of(posture: tuple[float, float, float], D: float) -> tuple[float, float, float]:
    """The posture of C where M is at a posture (x, y, θ) [m, m, rad]; with −D the other way round."""
    x, y, theta = posture
    return x + D * math.cos(theta), y + D * math.sin(theta), theta
