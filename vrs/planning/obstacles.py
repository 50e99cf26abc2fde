"""What may bar a path: position limits and singularities, with the joint and the place named."""

from __future__ import annotations

from typing import Final

import numpy as np

from vrs.model import Array, Limits, RobotModel
from vrs.planning.path import Path, stuck
from vrs.tooled import bare

SINGULAR: Final = 100.0
"""Condition number, linear rows of the Jacobian divided by the model's length, above which a path is refused."""

_SLACK: Final = 5e-10
_CLOSE: Final = 0.5


def condition(model: RobotModel, q: Array) -> Array:
    """Condition numbers of the Jacobian at q, (k, n), its linear rows divided by the model's length: (k,).

    Numbers below half of SINGULAR may be given as an upper bound.
    """
    J = bare(model).jacobian(q)
    J[:, :3] /= model.characteristic_length
    if J.shape[1] != J.shape[2]:
        return _exact(J)
    with np.errstate(all="ignore"):
        inverse = _inverse(J)
        bound: Array = np.sqrt((J * J).sum((1, 2)) * (inverse * inverse).sum((1, 2)))
    doubtful = ~(bound < _CLOSE * SINGULAR)
    if doubtful.any():
        bound[doubtful] = _exact(J[doubtful])
    return bound


def _inverse(J: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(J), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.full(J.shape, np.inf)


def _exact(J: Array) -> Array:
    values = np.linalg.svd(J, compute_uv=False)
    with np.errstate(divide="ignore"):
        ratio: Array = values[:, 0] / values[:, -1]
    return ratio


def obstacle(path: Path, s: Array, q: Array, model: RobotModel, limits: Limits) -> str | None:
    """Say what bars a path first; None if nothing does.

    A path may begin at a singularity if it leaves it, its condition number falling until it's below SINGULAR.

    Args:
        path: The path.
        s: Parameters of samples, (k,), increasing, both ends included.
        q: Joints there [rad], (k, n).
        model: The robot.
        limits: Position limits.
    """
    every = np.append(np.arange(0, len(s) - 1, 2), len(s) - 1)
    found = [_limit(path, s, q, limits), _singularity(path, s[every], q[every], model)]
    return min((one for one in found if one is not None), default=(0.0, None))[1]


def _limit(path: Path, s: Array, q: Array, limits: Limits) -> tuple[float, str] | None:
    excess = np.maximum(q - limits.q_max, limits.q_min - q)
    outside = np.flatnonzero((excess > _SLACK).any(1))
    if not len(outside):
        return None
    i = int(outside[0])
    j = int(excess[i].argmax())
    bound = float(limits.q_max[j] if q[i, j] > limits.q_max[j] else limits.q_min[j])
    where = float(s[i])
    if i and excess[i, j] > excess[i - 1, j]:
        where -= float((s[i] - s[i - 1]) * min(excess[i, j] / (excess[i, j] - excess[i - 1, j]), 1.0))
    turn = f"{np.degrees(bound):.6g} deg"
    return where, f"joint {j + 1} would pass its limit of {turn} at {path.course.place(where)}"


def _singularity(path: Path, s: Array, q: Array, model: RobotModel) -> tuple[float, str] | None:
    c = condition(model, q)
    near = np.flatnonzero(c > _CLOSE * SINGULAR)
    if not len(near):
        return None
    # A peak between samples: look closer round each that stands out.
    peaks = [i for i in near if 0 < i < len(c) - 1 and c[i] >= c[i - 1] and c[i] >= c[i + 1]]
    if peaks:
        extra = np.concatenate([np.linspace(s[i - 1], s[i + 1], 19)[1:-1] for i in peaks])
        more = path.value(extra)[:, 0]
        s, q = np.concatenate([s, extra]), np.concatenate([q, more])
        order = np.argsort(s, kind="stable")
        s, q = s[order], q[order]
        c = np.concatenate([c, condition(model, more)])[order]
    above = c > SINGULAR
    if not above.any():
        return None
    leaving = 0
    while leaving < len(c) and above[leaving] and (leaving == 0 or c[leaving] <= c[leaving - 1] * (1.0 + 1e-6)):
        leaving += 1
    bad = np.flatnonzero(above[leaving:])
    if not len(bad):
        return None
    first = leaving + int(bad[0])
    worst = first + int(c[first:].argmax())
    joint = stuck(model, q[first])
    return float(s[first]), (
        f"it passes too near a singularity, where joint {joint + 1} turns too fast, at "
        f"{path.course.place(float(s[first]))}: condition number up to {c[worst]:.3g}, at most {SINGULAR:g} allowed"
    )
