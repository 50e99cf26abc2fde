"""What arms with more, or fewer, than six joints do with a task of six rows.

An arm with more joints stays as near to where it was as the task allows. Joints count more the nearer they are to
their limits, so that others move instead: the motion along a task is that of least weighted size. Source: Chan,
Dubey, A weighted least-norm solution based scheme for avoiding joint limits, 1995, with a weight that is the same
towards a limit and away from it, so that what the arm does along a path depends on the path alone.

An arm with fewer joints follows the position first, and the turn as far as that leaves it free.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import numpy as np

from vrs.model import Array, Limits

TASK: Final = 6
"""Rows of a pose: three of position, three of orientation."""
_STEEP: Final = 10.0
"""What the ninth power of the share counts beside the share itself."""


def stretched(q: Array, limits: Limits) -> Array:
    """Joint values on a scale that stretches towards the limits, (n,) or (k, n): its steps are equally dear.

    It's the integral of `stiffness`.
    """
    return scaled(q, limits)[0]


def stiffness(q: Array, limits: Limits) -> Array:
    """How much dearer a joint's motion is where it is than amid its range, (n,) or (k, n): 1 to 91 at a limit."""
    return scaled(q, limits)[1]


def scaled(q: Array, limits: Limits) -> tuple[Array, Array]:
    """Return both, `stretched` and `stiffness`."""
    half = 0.5 * (limits.q_max - limits.q_min)
    # From -1 at the lower limit to 1 at the upper one.
    x = (q - limits.q_min) / half - 1.0
    y = x * x
    y *= y
    y *= y
    return half * (x + _STEEP * (y * x)), 1.0 + 9.0 * _STEEP * y


def units(prismatic: Collection[int], n: int, length: float) -> Array:
    """What a joint's motion is divided by to be compared with others', (n,): 1, of prismatic ones a length [m]."""
    return np.where(np.isin(np.arange(n), list(prismatic)), length, 1.0)
