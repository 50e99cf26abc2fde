"""Inverse kinematics of many poses at once: the formulas of `robots.puma560.branches` on arrays."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robots.puma560.branches import (
    COS_E3,
    FOREARM,
    FOUR_SIDES,
    MERGE_ELBOW,
    MERGE_SHOULDER,
    MERGE_WRIST,
    ORTHONORMAL,
    REACH_MAX,
    REACH_MIN,
    RESIDUAL_MAX,
    SIN_E3,
    Asked,
)
from robots.puma560.parameters import A2, A3, D3, D4, DOF
from vrs.checks import finite_array
from vrs.errors import InvalidValueError
from vrs.model import Array

BRANCHES = (
    "RIGHTY ABOVE NOFLIP",
    "RIGHTY ABOVE FLIP",
    "RIGHTY BELOW NOFLIP",
    "RIGHTY BELOW FLIP",
    "LEFTY ABOVE NOFLIP",
    "LEFTY ABOVE FLIP",
    "LEFTY BELOW NOFLIP",
    "LEFTY BELOW FLIP",
)
"""What the second axis of `inverse_batch` runs over."""

CHUNK = 1024
"""Poses solved at a time; their arrays fit into a core's cache."""

_ALLOWED = "finite homogeneous transforms, (k, 4, 4), their rotations orthonormal to 1e-6"


def inverse_batch(X: ArrayLike) -> Array:
    """Return the principal joint solutions of many poses, each checked forward to 1e-9.

    Args:
        X: Poses of the last link in the base frame, (k, 4, 4).

    Returns:
        Joint values in (−π, π] [rad], (k, 8, 6), the second axis as in BRANCHES; NaN where a branch doesn't
        exist, or is one with another that comes before it. Limits aren't considered. Where joints 4 and 6
        share an axis, q4 is 0.

    Raises:
        InvalidValueError: If X has another shape, or holds NaN, infinity, or what isn't a transform.
    """
    R, p = _checked(X)
    q = np.empty((p.shape[1], 8, DOF))
    for start in range(0, len(q), CHUNK):
        part = slice(start, start + CHUNK)
        q[part] = _solved(R[:, :, part], p[:, part])
    return q


def _solved(R: Array, p: Array) -> Array:
    """Return the solutions of rotations, (3, 3, k), and positions, (3, k): (k, 8, 6)."""
    out = np.empty((2, 2, 2, DOF, p.shape[1]))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        triangle, closed = _triangles(p)
        u, sin_e, _ = triangle
        for (i, righty), (j, above) in product(enumerate((True, False)), repeat=2):
            first, second = out[i, j]
            turns = _one_arm(p, triangle, righty, above, first)
            error, M = _placed(p, R, turns)
            q4, straight = _fourth(M)
            turns = _wrists(M, np.where(straight, 0.0, q4), straight, first)
            first[4] = np.where(straight, np.abs(first[4]), first[4])
            # On the sines and cosines whose angles are returned; one check does for both wrists of an arm,
            # which differ by exact half turns.
            exists = closed & (error + _turned(M, turns) <= RESIDUAL_MAX**2)
            exists &= (u > 0.0) | righty
            exists &= (sin_e > 0.0) | above
            second[:] = first
            second[4] *= -1.0
            second[[3, 5]] -= np.copysign(np.pi, first[[3, 5]])
            np.copyto(first, np.nan, where=~exists)
            np.copyto(second, np.nan, where=~exists | straight)
    return out.reshape(8, DOF, -1).transpose(2, 0, 1)


def _checked(X: ArrayLike) -> tuple[Array, Array]:
    """Return the nearest orthonormal rotations, (3, 3, k), and the positions, (3, k).

    Components come first, so that every operation runs over contiguous poses.
    """
    poses = finite_array("X", X, None, _ALLOWED)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise InvalidValueError("X", X, _ALLOWED)
    rows = np.array(poses.transpose(1, 2, 0), order="C")
    R = rows[:3, :3]
    n, o, a = R.swapaxes(0, 1)
    skew = np.zeros(len(poses))
    for u, v, dot in ((n, n, 1.0), (o, o, 1.0), (a, a, 1.0), (n, o, 0.0), (n, a, 0.0), (o, a, 0.0)):
        np.maximum(skew, np.abs(u[0] * v[0] + u[1] * v[1] + u[2] * v[2] - dot), out=skew)
    volume = a[0] * (n[1] * o[2] - n[2] * o[1])
    volume += a[1] * (n[2] * o[0] - n[0] * o[2])
    volume += a[2] * (n[0] * o[1] - n[1] * o[0])
    bottom = np.abs(rows[3] - np.array([[0.0], [0.0], [0.0], [1.0]]))
    if not ((skew <= ORTHONORMAL).all() and (volume > 0).all() and (bottom <= ORTHONORMAL).all()):
        raise InvalidValueError("X", X, _ALLOWED)
    rough = skew > 1e-14
    if rough.any():
        U, _, Vt = np.linalg.svd(poses[rough, :3, :3])
        R[:, :, rough] = (U @ Vt).transpose(1, 2, 0)
    return R, rows[:3, 3]


def inverse_along(X: Array, q: Array, wanted: Asked) -> Array:
    """Return the joint solutions of poses in a row that go on from q, in one branch.

    Args:
        X: Poses of the last link in the base frame, (k, 4, 4), close enough together for turns to be told.
        q: Joint values to go on from, (6,) [rad].
        wanted: Signs righty, above and noflip; None for the wrist means the one whose joint 4 is nearer to q's
            at the first pose where the wrist isn't straight.

    Returns:
        Joint values [rad], (k, 6), turns counted on from q; NaN from the first pose on that isn't reached to 1e-9.
        Where joints 4 and 6 share an axis, joint 4 stays where the pose before left it.
    """
    righty, above, noflip = wanted
    R, p = X[:, :3, :3].transpose(1, 2, 0), X[:, :3, 3].T
    # Components in rows of their own, for contiguous operations.
    R, p = np.ascontiguousarray(R), np.ascontiguousarray(p)
    out = np.empty((DOF, len(X)))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        triangle, closed = _triangles(p)
        turns = _one_arm(p, triangle, righty is not False, above is not False, out)
        error, M = _placed(p, R, turns)
        q4, straight = _fourth(M)
        if noflip is None:
            free = np.flatnonzero(~straight)
            noflip = not len(free) or bool(np.cos(q4[free[0]] - q[3]) >= 0)
        for i in np.flatnonzero(straight):
            q4[i] = q4[i - 1] if i else q[3] - (0.0 if noflip else np.pi)
        error = error + _turned(M, _wrists(M, q4, straight, out))
    if not noflip:
        out[3] += np.pi
        out[4] *= -1.0
        out[5] += np.pi
    lost = np.flatnonzero(~(closed & (error <= RESIDUAL_MAX**2)))
    steps = np.diff(out, axis=1, prepend=q[:, None])
    steps[~np.isfinite(steps)] = 0.0
    out -= 2.0 * np.pi * np.cumsum(np.round(steps / (2.0 * np.pi)), axis=1)
    if len(lost):
        out[:, lost[0] :] = np.nan
    return np.ascontiguousarray(out.T)


def _triangles(p: Array) -> tuple[tuple[Array, Array, Array], NDArray[np.bool_]]:
    """Return |u|, |sin e| and cos e of wrist centres, (3, k) [m], and whether the triangles close, (k,)."""
    px, py, pz = p
    r = np.sqrt(px * px + py * py)
    u = np.sqrt(np.maximum((r - D3) * (r + D3), 0.0))
    u[u < MERGE_SHOULDER] = 0.0
    w = np.sqrt(u * u + pz * pz)
    outer, inner = (REACH_MAX - w) * (REACH_MAX + w), (w - REACH_MIN) * (w + REACH_MIN)
    sin_e = 2 * np.sqrt(np.maximum(outer, 0.0) * np.maximum(inner, 0.0)) / FOUR_SIDES
    merged = sin_e < MERGE_ELBOW
    sin_e[merged] = 0.0
    cos_e = np.where(merged, np.where(inner > outer, 1.0, -1.0), (inner - outer) / FOUR_SIDES)
    closed: NDArray[np.bool_] = (r >= D3 - RESIDUAL_MAX) & (w >= REACH_MIN - RESIDUAL_MAX)
    return (u, sin_e, cos_e), closed & (w <= REACH_MAX + RESIDUAL_MAX)


def _one_arm(
    p: Array, triangle: tuple[Array, Array, Array], righty: bool, above: bool, out: Array
) -> tuple[Array, ...]:
    """Fill in joints 1 to 3 of one arm.

    Args:
        p: Wrist centres, (3, k) [m].
        triangle: |u|, |sin e| and cos e, (k,) each.
        righty: Shoulder.
        above: Elbow.
        out: Joint values, (6, k) [rad], written.

    Returns:
        Cosine and sine of q1, of q2 and of q2 + q3, (k,) each.
    """
    px, py, pz = p
    u, sin_e, cos_e = triangle
    if not righty:
        u = -u
    if righty == above:
        sin_e = -sin_e
    x, y = px * u - py * D3, py * u + px * D3
    out[0], (c1, s1) = np.arctan2(y, x), _unit(x, y)
    kx, ky = A2 + FOREARM * cos_e, FOREARM * sin_e
    x, y = u * kx + pz * ky, pz * kx - u * ky
    out[1], (c2, s2) = np.arctan2(y, x), _unit(x, y)
    c3, s3 = cos_e * COS_E3 + sin_e * SIN_E3, sin_e * COS_E3 - cos_e * SIN_E3
    out[2] = np.arctan2(s3, c3)
    return c1, s1, c2, s2, c2 * c3 - s2 * s3, s2 * c3 + c2 * s3


def _unit(x: Array, y: Array) -> tuple[Array, Array]:
    """Return cosine and sine of the direction (x, y)."""
    h: Array = np.sqrt(x * x + y * y)
    return x / h, y / h


def _placed(p: Array, R: Array, turns: tuple[Array, ...]) -> tuple[Array, Array]:
    """Return how far the arms miss the wrist centre, squared, (k,) [m²], and R in their last frames.

    Args:
        p: Wrist centres, (3, k) [m].
        R: Rotations, (3, 3, k).
        turns: Cosine and sine of q1, of q2 and of q2 + q3, (k,) each.

    Returns:
        The squares, and the wanted rotations of the wrists, (3, 3, k).
    """
    c1, s1, c2, s2, c23, s23 = turns
    u = A2 * c2 + A3 * c23 - D4 * s23
    v = A2 * s2 + A3 * s23 + D4 * c23
    error: Array = (c1 * u + s1 * D3 - p[0]) ** 2 + (s1 * u - c1 * D3 - p[1]) ** 2 + (v - p[2]) ** 2
    M = np.empty((3, 3, *v.shape))
    for j in range(3):
        t = c1 * R[0, j] + s1 * R[1, j]
        M[0, j] = c23 * t + s23 * R[2, j]
        M[1, j] = c1 * R[1, j] - s1 * R[0, j]
        M[2, j] = c23 * R[2, j] - s23 * t
    return error, M


def _fourth(M: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return joint 4 of wrists that aren't flipped, (k,) [rad], and where they're straight, so that it's free."""
    x, y = M[0, 2], M[1, 2]
    return np.arctan2(y, x), np.sqrt(x * x + y * y) < MERGE_WRIST


def _wrists(M: Array, q4: Array, straight: NDArray[np.bool_], out: Array) -> tuple[Array, ...]:
    """Fill in joints 4 to 6 of wrists that aren't flipped.

    Joint 5 follows from the joint 4 that was taken; joint 6 from both, so that rounding in joint 4 cancels.

    Args:
        M: Rotations of the last link in the forearm's frame, (3, 3, k).
        q4: Joint 4, (k,) [rad].
        straight: Where joints 4 and 6 share an axis, (k,).
        out: Joint values, (6, k) [rad], written.

    Returns:
        Cosine and sine of q4, q5 and q6, (k,) each.
    """
    c4, s4 = np.cos(q4), np.sin(q4)
    x, y, z = M[0, 2], M[1, 2], M[2, 2]
    c5, s5 = _unit(z, -np.where(straight, 0.0, np.sqrt(x * x + y * y)))
    c6, s6 = _unit(c4 * M[1, 1] - s4 * M[0, 1], c4 * M[1, 0] - s4 * M[0, 0])
    out[3], out[4], out[5] = q4, np.arctan2(s5, c5), np.arctan2(s6, c6)
    return c4, s4, c5, s5, c6, s6


def _turned(M: Array, turns: tuple[Array, ...]) -> Array:
    """Return the sum of squares of the differences of M and the wrists' rotations, (k,).

    Args:
        M: Rotations of the last link in the forearm's frame, (3, 3, k).
        turns: Cosine and sine of q4, q5 and q6, (k,) each.
    """
    c4, s4, c5, s5, c6, s6 = turns
    c45, s45 = c4 * c5, s4 * c5
    rotation = (
        (c45 * c6 - s4 * s6, -c45 * s6 - s4 * c6, -c4 * s5),
        (s45 * c6 + c4 * s6, c4 * c6 - s45 * s6, -s4 * s5),
        (s5 * c6, -s5 * s6, c5),
    )
    total = np.zeros(c4.shape)
    for i in range(3):
        for j in range(3):
            difference = rotation[i][j] - M[i, j]
            total += difference * difference
    return total
