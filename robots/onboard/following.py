"""Whether a robot is where it was commanded to be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array
from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array


@dataclass(frozen=True, slots=True, eq=False)
class Tolerance:
    """How far a robot may stay away from its command."""

    joints: Array
    """Largest error of each joint [rad], (n,), positive."""
    tool: float | None
    """Largest distance of the tool from where it should be [m], positive; None asks for none."""

    def __init__(self, joints: ArrayLike, tool: float | None = None) -> None:
        """Take joints [rad], (n,), and the tool's distance [m].

        Raises:
            InvalidValueError: If a value isn't finite and positive.
        """
        allowed = "positive errors [rad], shape (n,)"
        array = finite_array("joints", joints, None, allowed)
        if array.ndim != 1 or len(array) == 0 or not (array > 0).all():
            raise InvalidValueError("joints", joints, allowed)
        if tool is not None:
            tool = finite("tool", tool, "None or a positive distance [m]")
            if tool <= 0:
                raise InvalidValueError("tool", tool, "None or a positive distance [m]")
        object.__setattr__(self, "joints", array)
        object.__setattr__(self, "tool", tool)


@dataclass(frozen=True, slots=True, eq=False)
class FollowingAbort:
    """A robot didn't follow: what, by how much and when, of the first violation."""

    t: float
    """Time of the reference that it didn't follow [s]."""
    joint: int | None
    """Index of the joint, the worst by its tolerance; None where only the tool's distance was too large."""
    error: float
    """Reference less measured [rad], or the tool's distance [m]; NaN where the sensor read no finite number."""
    tolerance: float
    """What was allowed [rad or m]."""
    q: Array
    """Measured [rad], (n,)."""
    q_ref: Array
    """Commanded [rad], (n,)."""

    def __str__(self) -> str:
        """Say it in a line."""
        if self.joint is None:
            return f"at {self.t:.3f} s the tool was {self.error:.4g} m away, over {self.tolerance:.4g} m"
        return (
            f"at {self.t:.3f} s joint {self.joint + 1} was {self.error:.4g} rad away, over {self.tolerance:.4g} rad"
        )


class FollowingMonitor:
    """Compares what was commanded with what was measured, tick by tick; it keeps no state."""

    __slots__ = ("_forward", "_tolerance")

    def __init__(self, tolerance: Tolerance, forward: Callable[[Array], Array] | None = None) -> None:
        """Take the tolerance, and for the tool's the forward kinematics, (k, n) [rad] to (k, 4, 4).

        Raises:
            InvalidValueError: If the tool has a tolerance and there are no kinematics.
        """
        if tolerance.tool is not None and forward is None:
            raise InvalidValueError("forward", forward, "the forward kinematics, where the tool has a tolerance")
        self._tolerance, self._forward = tolerance, forward

    def check(self, t: ArrayLike, q_ref: ArrayLike, q: ArrayLike) -> FollowingAbort | None:
        """Compare k ticks, row i of each for the same time.

        Args:
            t: Times of the references [s], (k,).
            q_ref: Commanded [rad], (k, n).
            q: Measured [rad], (k, n); a value that isn't finite is a violation, not an error.

        Returns:
            The first violation; None if there's none.

        Raises:
            InvalidValueError: If the shapes differ or a reference isn't finite.
        """
        n = len(self._tolerance.joints)
        times = finite_array("t", t, None, "finite seconds, shape (k,)")
        references = finite_array("q_ref", q_ref, (times.size, n), f"finite joint values [rad], shape (k, {n})")
        try:
            measured = np.asarray(q, dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidValueError("q", q, f"joint values [rad], shape (k, {n})") from None
        if times.ndim != 1 or measured.shape != references.shape:
            raise InvalidValueError("q", measured.shape, f"of shape ({times.size}, {n})")
        error = references - measured
        share = np.abs(error) / self._tolerance.joints
        kept = np.all(share <= 1, axis=1)
        distance = np.zeros(len(measured))
        if self._tolerance.tool is not None and self._forward is not None:
            # Kinematics needn't take what isn't finite.
            sound = np.all(np.isfinite(measured), axis=1)
            X_asked, X_measured = np.split(self._forward(np.concatenate([references[sound], measured[sound]])), 2)
            distance[sound] = np.linalg.norm(X_asked[:, :3, 3] - X_measured[:, :3, 3], axis=1)
            kept &= distance <= self._tolerance.tool
        if np.all(kept):
            return None
        i = int(np.argmin(kept))
        t_first, q_first, q_asked = float(times[i]), frozen_array(measured[i]), frozen_array(references[i])
        if self._tolerance.tool is not None and np.all(share[i] <= 1):
            return FollowingAbort(t_first, None, float(distance[i]), self._tolerance.tool, q_first, q_asked)
        # For argmax a NaN is the largest.
        j = int(np.argmax(share[i]))
        allowed = float(self._tolerance.joints[j])
        return FollowingAbort(t_first, j, float(error[i, j]), allowed, q_first, q_asked)
