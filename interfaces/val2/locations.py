"""Functions whose values are locations."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from interfaces.val2.arguments import arguments, reals
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions, Frame
from interfaces.val2.geometry import about_x, about_y, about_z, from_oat
from interfaces.val2.memory import where
from interfaces.val2.operations import Real, Slots, placed
from interfaces.val2.syntax import Apply
from interfaces.val2.values import NULL, PrecisionPoint, Transformation

_STRAIGHT: Final = 1e-6
"""Shortest distance of FRAME's points [mm], and of the third from the axis."""
_POSE: Final = (0.0, 0.0, 0.0, 90.0, -90.0, 0.0)
"""What TRANS takes for what is left out: no translation, no turn."""


def frame_function(x: Expressions, e: Apply) -> Frame:
    """A closure of a function whose value is a transformation.

    Raises:
        ValError: If its arguments aren't what it takes.
    """
    inner, at = FRAMES[e.function](x, e), e.at

    def function(s: Slots) -> Transformation:
        try:
            return inner(s)
        except ValError as error:
            raise placed(error, at) from None

    return function


def _trans(x: Expressions, e: Apply) -> Frame:
    given = zip(arguments(e, 0, 6), _POSE, strict=True)
    parts: list[Real] = [x.real(a) if a is not None else (lambda _, v=v: v) for a, v in given]  # type: ignore[misc]
    return lambda s: from_oat(*[p(s) for p in parts])


def _shift(x: Expressions, e: Apply) -> Frame:
    location, *by = arguments(e, 1, 4)
    assert location is not None
    frame = x.transformation(location)
    parts = [x.real(a) if a is not None else (lambda _: 0.0) for a in by]

    def shift(s: Slots) -> Transformation:
        X = np.array(frame(s).X)
        X[:3, 3] += [p(s) for p in parts]
        return Transformation(X)

    return shift


def _inverse(x: Expressions, e: Apply) -> Frame:
    (location,) = arguments(e, 1, 1)
    assert location is not None
    frame = x.transformation(location)
    return lambda s: frame(s).inverse()


def _frame(x: Expressions, e: Apply) -> Frame:
    frames = [x.transformation(a) for a in arguments(e, 4, 4) if a is not None]

    def frame(s: Slots) -> Transformation:
        a, b, c, d = (f(s).X[:3, 3] for f in frames)
        along, aside = b - a, c - a
        n = np.linalg.norm(along)
        if n < _STRAIGHT:
            raise ValError("Illegal value", "FRAME: the first two points are one")
        u = along / n
        aside = aside - (aside @ u) * u
        n = np.linalg.norm(aside)
        if n < _STRAIGHT:
            raise ValError("Illegal value", "FRAME: three points on a line")
        v = aside / n
        X = np.eye(4)
        X[:3, 0], X[:3, 1], X[:3, 2], X[:3, 3] = u, v, np.cross(u, v), d
        return Transformation(X)

    return frame


def _turn(about: Callable[[float], Transformation]) -> Callable[[Expressions, Apply], Frame]:
    def make(x: Expressions, e: Apply) -> Frame:
        (angle,) = reals(x, e, 1, 1)
        return lambda s: about(angle(s))

    return make


def _standing(pose: Callable[[Expressions], Transformation]) -> Callable[[Expressions, Apply], Frame]:
    def make(x: Expressions, e: Apply) -> Frame:
        arguments(e, 0, 0)
        return lambda _: pose(x)

    return make


FRAMES: Final[dict[str, Callable[[Expressions, Apply], Frame]]] = {
    "DEST": _standing(lambda x: x.context.arm.destination(now=x.context.now).tool),
    "FRAME": _frame,
    "HERE": _standing(lambda x: x.context.arm.here(now=x.context.now).tool),
    "INVERSE": _inverse,
    "NULL": _standing(lambda _: NULL),
    "RX": _turn(about_x),
    "RY": _turn(about_y),
    "RZ": _turn(about_z),
    "SHIFT": _shift,
    "TRANS": _trans,
}


def point_function(x: Expressions, e: Apply) -> Callable[[Slots], PrecisionPoint]:
    """A closure of a function whose value is a precision point: #PPOINT, or where the arm is or goes.

    Raises:
        ValError: If it's none, or its arguments aren't what it takes.
    """
    context = x.context
    match e.function.lstrip("#"):
        case "PPOINT":
            parts = reals(x, e, 0, 6)

            def point(s: Slots) -> PrecisionPoint:
                joints = tuple([p(s) for p in parts])
                if any(math.fabs(j) > 1e6 for j in joints):
                    raise ValError("Illegal value", "joints over 1000000 deg", place=where(e.at))
                return PrecisionPoint(joints)

            return point
        case "HERE":
            return lambda _: context.arm.here(now=context.now).joints
        case "DEST":
            return lambda _: context.arm.destination(now=context.now).joints
        case _:
            raise ValError("Invalid expression", "a precision point was expected", place=where(e.at))
