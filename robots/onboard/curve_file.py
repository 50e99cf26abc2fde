"""Path files: points and what becomes of them, a line each.

path 1                  the format's version, first
curve cubic             or quadratic, see `CurveKind`; cubic unless given
0 1                     a point: x and y [m], two or more in the order in which they're passed
1.5 1.8                 `#` begins a comment
"""

from __future__ import annotations

import math
from pathlib import Path

from robots.onboard.curve import LARGEST, MOST_POINTS, Curve, CurveKind
from robots.text_files import bounded_text
from vrs.errors import FormatError, InvalidValueError

VERSION = 1
MOST_BYTES = 256 * 1024


def load_curve(path: Path | str) -> Curve:
    """Read a path from a file.

    Raises:
        FormatError: If it can't be read, or isn't one; it names the file, and the line.
    """
    path = Path(path)
    try:
        text = bounded_text(path, MOST_BYTES, "utf-8-sig")
    except OSError as error:
        raise FormatError(path.name, f"can't be read: {error.strerror}") from None
    return read_curve(text, path.name)


def read_curve(text: str, where: str = "path") -> Curve:
    """Read a path.

    Args:
        text: As a path file has it.
        where: What it's called in errors.

    Raises:
        FormatError: If it isn't a path.
    """
    lines = ((number, line.partition("#")[0].split()) for number, line in enumerate(text.splitlines(), 1))
    rows = [(f"{where}, line {number}", words) for number, words in lines if words]
    if not rows or rows[0][1] != ["path", str(VERSION)]:
        raise FormatError(rows[0][0] if rows else where, f"a path begins with the line 'path {VERSION}'")
    kind = CurveKind.CUBIC
    points: list[tuple[float, float]] = []
    for place, words in rows[1:]:
        if words[0] == "curve":
            if points:
                raise FormatError(place, "'curve' stands before the points")
            kind = _kind(place, words)
        else:
            points.append(_point(place, words))
    if not 2 <= len(points) <= MOST_POINTS:
        raise FormatError(where, f"2 to {MOST_POINTS} points are allowed; given: {len(points)}")
    try:
        return Curve(points, kind)
    except InvalidValueError as error:
        raise FormatError(where, f"its points must be {error.allowed}") from None


def _kind(place: str, words: list[str]) -> CurveKind:
    try:
        return CurveKind(" ".join(words[1:]))
    except ValueError:
        allowed = " or ".join(f"'curve {kind}'" for kind in CurveKind)
        raise FormatError(place, f"{allowed} is allowed; given: {' '.join(words)!r}") from None


def _point(place: str, words: list[str]) -> tuple[float, float]:
    try:
        x, y = (float(word) for word in words)
    except ValueError:
        raise FormatError(place, f"a point is two numbers, x and y [m]; given: {' '.join(words)!r}") from None
    if not (math.hypot(x, y) < math.inf and max(abs(x), abs(y)) <= LARGEST):
        raise FormatError(place, f"x and y must be within ±{LARGEST:g} m; given: {' '.join(words)!r}")
    return x, y
