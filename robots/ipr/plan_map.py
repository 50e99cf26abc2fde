"""A floor plan's map: the faces of its walls and known things, as far as they can be seen."""

from __future__ import annotations

import math

import numpy as np

from robots.bullet.rooms import Block, Room
from robots.onboard.gsp_map import GspMap, Lines
from vrs.checks import number_in
from vrs.model import Array

_OUTSIDE = 1e-6
"""By how much a face is looked at before it [m]: whether that's inside of another thing."""


def plan_map(
    room: Room, height: float = 0.3, *, doubt: float = 0.0005, turn_doubt: float = 1.5e-4, shortest: float = 0.2
) -> GspMap:
    """Make the map of a floor plan.

    Columns have no straight face, and what comes or goes isn't relied on.

    Args:
        room: What stands there; only what is known counts.
        height: Of the scanner's plane [m]: lower things aren't seen.
        doubt: Standard deviation of a face along its normal [m], in [0, 1]: how well the plan was built.
        turn_doubt: And of its direction [rad], in [0, 1].
        shortest: Shorter faces are left out [m], in [0.01, 10].
    """
    number_in("doubt", doubt, 0.0, 1.0, unit=" m")
    number_in("turn_doubt", turn_doubt, 0.0, 1.0, unit=" rad")
    number_in("shortest", shortest, 0.01, 10.0, unit=" m")
    blocks = [b for b in room.known().blocks if b.height >= height and b.start == -math.inf and b.end == math.inf]
    rows: list[tuple[float, float, float, float]] = []
    for block in blocks:
        for face in _faces(block):
            others = [other for other in blocks if other is not block]
            rows += [row for row in _open(face, others, room) if row[3] >= shortest]
    found = np.array(rows).reshape(-1, 4)
    half = found[:, 3] / 2
    variances = np.tile([doubt**2, turn_doubt**2], (len(found), 1))
    lines = Lines.of(found[:, :3], np.column_stack([-half, half]), variances, np.zeros(len(found)))
    return GspMap.of(room.name, lines)


def _faces(block: Block) -> list[tuple[Array, Array, float]]:
    """The four faces of a block: begin, direction and length, the outside on the left."""
    made = []
    for quarter, (length, width) in enumerate([(block.length, block.width), (block.width, block.length)] * 2):
        # Facing away from the middle, the left of the direction is outside.
        angle = block.angle + quarter * math.pi / 2 + math.pi
        along = np.array([math.cos(angle), math.sin(angle)])
        out = np.array([-along[1], along[0]])
        middle = np.array([block.x, block.y]) + out * width / 2
        made.append((middle - along * length / 2, along, length))
    return made


def _open(
    face: tuple[Array, Array, float], others: list[Block], room: Room
) -> list[tuple[float, float, float, float]]:
    """The parts of a face that aren't covered: centre, direction and length."""
    begin, along, length = face
    out = np.array([-along[1], along[0]])
    before = begin + _OUTSIDE * out
    covered = [span for other in others if (span := _within(before, along, length, other)) is not None]
    covered.append((length, math.inf))
    angle = math.atan2(along[1], along[0])
    parts, at = [], 0.0
    for low, high in sorted(covered):
        if low > at:
            middle = begin + along * (at + low) / 2
            inside = 0 <= middle[0] + 0.01 * out[0] <= room.length and 0 <= middle[1] + 0.01 * out[1] <= room.width
            if inside:
                parts.append((float(middle[0]), float(middle[1]), angle, low - at))
        at = max(at, high)
    return parts


def _within(begin: Array, along: Array, length: float, block: Block) -> tuple[float, float] | None:
    """From where to where a segment is inside a block [m]; None if it isn't."""
    c, s = math.cos(block.angle), math.sin(block.angle)
    dx, dy = begin[0] - block.x, begin[1] - block.y
    low, high = 0.0, length
    for at, way, half in (
        (c * dx + s * dy, c * along[0] + s * along[1], block.length / 2),
        (c * dy - s * dx, c * along[1] - s * along[0], block.width / 2),
    ):
        if abs(way) < 1e-9:
            if abs(at) > half:
                return None
            continue
        ends = sorted(((-half - at) / way, (half - at) / way))
        low, high = max(low, ends[0]), min(high, ends[1])
    return (low, high) if high - low > 1e-9 else None
