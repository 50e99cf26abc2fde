"""Line segments with their doubt, and the map that they make: M = {P, L, R, Ξ}.

A line is told by the pose of its centre of gravity: where it is, and its direction, counted so that the free side
is on the left. That keeps the error small and local: how far the line is off along its normal at its centre, and by
what angle. Its ends aren't known well, so nothing is concluded from where they are along the line.

Source: Kim, Han, Kim, Kim 2002, section 3.1; eq. (3) and (7).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from vrs.checks import bounded_text
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile.model import placed
from vrs.model import Array, frozen_array

SCHEMA: Final[Literal["vrs-gsp-map/1"]] = "vrs-gsp-map/1"
MOST_LINES: Final = 2000
MOST_BYTES: Final = 64 * 1024 * 1024
_LARGEST: Final = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Segments, in any frame."""

    poses: Array
    """Centre of gravity [m] and direction [rad] of each, (m, 3); the free side is on the left."""
    spans: Array
    """Where each begins and ends, from its centre along its direction [m], (m, 2), not descending."""
    variances: Array
    """Of the error along the normal at the centre [m²] and of the direction [rad²], (m, 2)."""
    counts: NDArray[np.int64]
    """How many measured points each is made of, (m,)."""

    @classmethod
    def of(cls, poses: ArrayLike, spans: ArrayLike, variances: ArrayLike, counts: ArrayLike) -> Lines:
        """Copy values into lines.

        Raises:
            InvalidValueError: If shapes don't agree, a number isn't finite, or a variance is negative.
        """
        P, s, V = (np.asarray(a, dtype=np.float64) for a in (poses, spans, variances))
        n = np.asarray(counts, dtype=np.int64)
        m = len(n) if n.ndim == 1 else -1
        for name, value, shape in (("poses", P, (m, 3)), ("spans", s, (m, 2)), ("variances", V, (m, 2))):
            if value.shape != shape or not (np.abs(value) <= _LARGEST).all():
                raise InvalidValueError(name, value.shape, f"{shape} finite numbers")
        if (V < 0).any() or (n < 0).any():
            raise InvalidValueError("variances", V, "not negative, as the counts")
        if (s[:, 0] > s[:, 1]).any():
            raise InvalidValueError("spans", s, "ascending")
        n = n.copy()
        n.flags.writeable = False
        return cls(frozen_array(P), frozen_array(s), frozen_array(V), n)

    @classmethod
    def none(cls) -> Lines:
        """No line."""
        return cls.of(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))

    def __len__(self) -> int:
        return len(self.counts)

    def taken(self, which: NDArray[Any]) -> Lines:
        """Some of them, by index or mask."""
        return Lines.of(self.poses[which], self.spans[which], self.variances[which], self.counts[which])

    @property
    def directions(self) -> Array:
        """Unit vectors along, (m, 2)."""
        return np.column_stack([np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])])

    @property
    def normals(self) -> Array:
        """Unit vectors to the free side, (m, 2)."""
        return np.column_stack([-np.sin(self.poses[:, 2]), np.cos(self.poses[:, 2])])

    @property
    def lengths(self) -> Array:
        """[m], (m,)."""
        return np.asarray(self.spans[:, 1] - self.spans[:, 0])

    @property
    def ends(self) -> Array:
        """Where each begins and ends [m], (m, 2, 2)."""
        return np.asarray(self.poses[:, None, :2] + self.spans[:, :, None] * self.directions[:, None, :])

    def moved(self, posture: tuple[float, float, float]) -> Lines:
        """The same lines as told by somebody in whose frame a robot is at a posture, if they're in the robot's."""
        poses = np.column_stack([placed(self.poses[:, :2], posture), self.poses[:, 2] + posture[2]])
        return Lines.of(poses, self.spans, self.variances, self.counts)


def injection(theta: ArrayLike) -> Array:
    """R of lines at angles θ [rad], (m, 3, 3): what of a pose's error a line can tell.

    Source: eq. (7).
    """
    theta = np.atleast_1d(np.asarray(theta, dtype=np.float64))
    c, s = np.cos(theta), np.sin(theta)
    R = np.zeros((len(theta), 3, 3))
    R[:, 0, 0], R[:, 1, 1], R[:, 2, 2] = s * s, c * c, 1.0
    R[:, 0, 1] = R[:, 1, 0] = -s * c
    return R


def paper_covariance(counts: ArrayLike, delta_p: float, delta_theta: float) -> Array:
    """Ξ of lines of so many points, (m, 3, 3): diag(Δ_p/N, Δ_p/N, Δ_θ/N³).

    Args:
        counts: N of each line, at least 1.
        delta_p: Variance of one measured point [m²].
        delta_theta: The same of the direction; with even spacing a and variance σ² it's 12 σ²/a² [rad²].

    Source: eq. (3).
    """
    n = np.asarray(counts, dtype=np.float64)
    if (n < 1).any():
        raise InvalidValueError("counts", counts, "at least 1 point a line")
    Xi = np.zeros((len(n), 3, 3))
    Xi[:, 0, 0] = Xi[:, 1, 1] = delta_p / n
    Xi[:, 2, 2] = delta_theta / n**3
    return Xi


@dataclass(frozen=True, slots=True, eq=False)
class GspMap:
    """Lines in the world frame, and how sure all of them are together."""

    name: str
    lines: Lines
    covariance: Array
    """Of the errors along the normal [m] and in direction [rad] of line after line, (2 m, 2 m)."""

    @classmethod
    def of(cls, name: str, lines: Lines, covariance: ArrayLike | None = None) -> GspMap:
        """Make a map; lines whose errors have nothing to do with each other unless their covariance is given.

        Raises:
            InvalidValueError: If the covariance isn't one of so many lines.
        """
        m = len(lines)
        if covariance is None:
            return cls(name, lines, frozen_array(np.diag(lines.variances.ravel())))
        C = np.asarray(covariance, dtype=np.float64)
        if C.shape != (2 * m, 2 * m) or not np.isfinite(C).all() or np.abs(C - C.T).max(initial=0.0) > 1e-9:
            raise InvalidValueError("covariance", C.shape, f"symmetric, of shape {(2 * m, 2 * m)}")
        if m and np.linalg.eigvalsh(C)[0] < -1e-9:
            raise InvalidValueError("covariance", C.shape, "without negative eigenvalues")
        return cls(name, lines, frozen_array(C))

    @property
    def P(self) -> Array:
        """Poses of the lines [m, m, rad], (m, 3)."""
        return self.lines.poses

    @property
    def L(self) -> Array:
        """Their lengths [m], (m,)."""
        return self.lines.lengths

    @property
    def R(self) -> Array:
        """Their injection matrices, (m, 3, 3)."""
        return injection(self.lines.poses[:, 2])

    def to_json(self) -> str:
        """The map as text; numbers read back exactly."""
        lines = self.lines
        arrays = (lines.poses, lines.spans, lines.variances, lines.counts, self.covariance)
        file = _MapFile(SCHEMA, self.name, *(array.tolist() for array in arrays))
        return msgspec.json.encode(file).decode() + "\n"


_Numbers = Annotated[list[list[float]], Meta(max_length=2 * MOST_LINES)]


class _MapFile(msgspec.Struct):
    """A map as it's written."""

    schema: Literal["vrs-gsp-map/1"]
    name: str
    poses: _Numbers
    spans: _Numbers
    variances: _Numbers
    counts: Annotated[list[Annotated[int, Meta(ge=0, le=1_000_000)]], Meta(max_length=MOST_LINES)]
    covariance: _Numbers


def read_map(text: str, where: str = "map") -> GspMap:
    """Read a map.

    Args:
        text: What `GspMap.to_json` made.
        where: What it's called in errors.

    Raises:
        FormatError: If it isn't one.
    """
    try:
        file = msgspec.json.decode(text, type=_MapFile)
        m = len(file.counts)
        poses, spans = np.array(file.poses).reshape(m, 3), np.array(file.spans).reshape(m, 2)
        lines = Lines.of(poses, spans, np.array(file.variances).reshape(m, 2), file.counts)
        return GspMap.of(file.name[:80], lines, np.array(file.covariance).reshape(2 * m, 2 * m))
    except (msgspec.MsgspecError, RecursionError, ValueError) as error:
        raise FormatError(where, str(error).splitlines()[0]) from None


def save_map(built: GspMap, path: Path | str) -> None:
    """Write a map into a file; raises OSError if that can't be done."""
    Path(path).write_text(built.to_json(), encoding="utf-8")


def load_map(path: Path | str) -> GspMap:
    """Read a map from a file; raises as `read_map`, and OSError if there's no such file."""
    path = Path(path)
    return read_map(bounded_text(path, MOST_BYTES), path.name)


def cast_lines(ends: Array, origins: Array, ways: Array) -> Array:
    """How far rays go until they meet a segment.

    Args:
        ends: Of the segments [m], (m, 2, 2).
        origins: Where rays begin [m], (k, 2).
        ways: Their directions, unit vectors, (k, 2).

    Returns:
        [m], (k,), inf where nothing is met.
    """
    if not len(ends):
        return np.full(len(origins), np.inf)
    a, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    # o + r w = a + u l: both unknowns by cross products.
    det = ways[:, :1] * along[:, 1] - ways[:, 1:] * along[:, 0]
    dx, dy = a[:, 0] - origins[:, :1], a[:, 1] - origins[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        r = (dx * along[:, 1] - dy * along[:, 0]) / det
        u = (dx * ways[:, 1:] - dy * ways[:, :1]) / det
    hit = (det != 0) & (r >= 0) & (u >= 0) & (u <= 1)
    return np.asarray(np.where(hit, r, np.inf).min(axis=1))
