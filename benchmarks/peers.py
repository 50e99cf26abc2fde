"""The packages of the extra `[bench]`, each behind a function that gives None where it isn't installed."""

from __future__ import annotations

import importlib
import importlib.metadata
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from benchmarks.results import NOT_INSTALLED
from vrs.model import Array
from vrs.segment import PolynomialSegment

DISTRIBUTIONS = (
    "numpy",
    "scipy",
    "ruckig",
    "roboticstoolbox-python",
    "pybullet",
    "drake",
    "pin",
    "toppra",
    "matplotlib",
)
"""What is compared with, or computes for us."""

Value = Callable[[Any], Any]


def versions() -> dict[str, str]:
    """Version of each distribution, or that it isn't installed."""
    found = {}
    for name in DISTRIBUTIONS:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = NOT_INSTALLED
    return found


def installed(module: str) -> Any | None:
    """The module, None where it isn't installed."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        return None


def ppoly(segments: Iterable[PolynomialSegment], knots: Array) -> Value:
    """SciPy's piecewise polynomial, whose pieces share one degree: lower ones are padded with zeros."""
    from scipy.interpolate import PPoly

    listed = list(segments)
    order = max(len(segment.coefficients) for segment in listed)
    a = np.zeros((order, len(listed), listed[0].coefficients.shape[1]))
    for i, segment in enumerate(listed):
        a[order - len(segment.coefficients) :, i] = segment.coefficients[::-1]
    made: Value = PPoly(a, knots)
    return made


def drake(segments: Iterable[PolynomialSegment], knots: Array) -> Any | None:
    """Drake's `PiecewisePolynomial`, each piece of its own degree."""
    trajectories = installed("pydrake.trajectories")
    if trajectories is None:
        return None
    from pydrake.polynomial import Polynomial

    pieces = [np.array([[Polynomial(column)] for column in segment.coefficients.T]) for segment in segments]
    return trajectories.PiecewisePolynomial(pieces, knots)


def toolbox() -> Any:
    """The Robotics Toolbox's PUMA 560: as ours, but on a pedestal."""
    import roboticstoolbox

    return roboticstoolbox.models.DH.Puma560()


class Pinocchio:
    """Pinocchio's PUMA 560, made from the same Denavit-Hartenberg parameters."""

    def __init__(self, library: Any, lengths: Iterable[tuple[float, float, float]]) -> None:
        """Make it.

        Args:
            library: The module `pinocchio`.
            lengths: a [m], α [rad] and d [m] of each joint, standard form.
        """
        self._library = library
        self._model = library.Model()
        joint, place = 0, library.SE3.Identity()
        for i, (a, alpha, d) in enumerate(lengths):
            joint = self._model.addJoint(joint, library.JointModelRZ(), place, f"joint {i + 1}")
            c, s = math.cos(alpha), math.sin(alpha)
            R = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
            place = library.SE3(R, np.array([a, 0.0, d]))
        frame = library.Frame("tool", joint, 0, place, library.FrameType.OP_FRAME)
        self._tool = self._model.addFrame(frame)
        self._data = self._model.createData()

    def forward(self, q: Array) -> Array:
        """Pose of the last link, (4, 4)."""
        self._library.framesForwardKinematics(self._model, self._data, q)
        X: Array = self._data.oMf[self._tool].homogeneous
        return X

    def jacobian(self, q: Array) -> Array:
        """Geometric Jacobian of the last link in the base frame, (6, 6)."""
        axes = self._library.LOCAL_WORLD_ALIGNED
        J: Array = self._library.computeFrameJacobian(self._model, self._data, q, self._tool, axes)
        return J


def pinocchio() -> Pinocchio | None:
    """Pinocchio's arm, None where the package `pin` isn't installed."""
    from robots.puma560 import parameters

    library = installed("pinocchio")
    if library is None:
        return None
    return Pinocchio(library, zip(parameters.DH_A, parameters.DH_ALPHA, parameters.DH_D, strict=True))
