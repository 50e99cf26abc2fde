"""Poses and links of the robots as Foxglove's messages, rounded: derived from the joints, for other readers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from interfaces.messages.recording import Site
from vrs.model import Array
from vrs.record import Record

BASE = "base"
"""Frame of both arms' bases."""
WORLD = "world"
"""Frame of the floor that mobile robots drive on."""
POSE_DIGITS = 9
"""Decimal places of a pose's numbers [m, quaternion]."""
LINK_DIGITS = 6
"""Decimal places of a link's numbers [m, quaternion]."""
POSE_RATE = 6.0
"""Poses of each robot a second, at most; one a second when it stands."""
LINK_RATE = 6.0
"""Messages with links a second, at most; one a second when both robots stand."""
_NANO = 10**9
_MOVED = 1e-6
"""A robot whose joints differ by more [rad] has moved."""
_SHOWN = 512
"""What was shown last is known so far back: later ones come between these, or aren't shown."""
_STILL = 1.0
"""How often a robot that stands is shown [s]."""


class Timestamp(Record, frozen=True, gc=False):
    """Foxglove's time; of the user's timeline, not negative."""

    sec: int
    nsec: int


class Vector3(Record, frozen=True, gc=False):
    """Foxglove's vector [m]."""

    x: float
    y: float
    z: float


class Quaternion(Record, frozen=True, gc=False):
    """Foxglove's quaternion."""

    x: float
    y: float
    z: float
    w: float


class Pose(Record, frozen=True, gc=False):
    """`foxglove.Pose`."""

    position: Vector3
    orientation: Quaternion


class PoseInFrame(Record, frozen=True, gc=False):
    """`foxglove.PoseInFrame`."""

    timestamp: Timestamp
    frame_id: str
    pose: Pose


class VirtualPose(PoseInFrame, frozen=True, gc=False):
    """The virtual robot's last link in `base`, or the mobile robot in `world`, to 1e-9; at most 6 a second."""


class RealPose(PoseInFrame, frozen=True, gc=False):
    """The same of the real robot."""


class FrameTransform(Record, frozen=True, gc=False):
    """`foxglove.FrameTransform`."""

    timestamp: Timestamp
    parent_frame_id: str
    child_frame_id: str
    translation: Vector3
    rotation: Quaternion


class FrameTransforms(Record, frozen=True, gc=False):
    """Links `virtual/1` … `real/6`, each in the one before, or robots in `world`, to 1e-6; at most 6 a second."""

    transforms: tuple[FrameTransform, ...]


def nanoseconds(t: float) -> int:
    """A time [s] as MCAP's: whole nanoseconds, from 0."""
    return max(0, round(t * 1e9))


def timestamp(t: float) -> Timestamp:
    """A time [s] as Foxglove's."""
    return Timestamp(*divmod(nanoseconds(t), _NANO))


def pose_of(site: Site, t: float, X: Array, frame: str = BASE) -> VirtualPose | RealPose:
    """The pose of a robot's last link, or of the mobile robot, X (4, 4), in a frame, at a time [s]."""
    (row,) = _rows(X[None], POSE_DIGITS)
    pose = Pose(Vector3(*row[:3]), Quaternion(*row[3:]))
    return (VirtualPose if site == "virtual" else RealPose)(timestamp(t), frame, pose)


def robot_frames(t: float, parent: str, names: Sequence[str], X: Array) -> FrameTransforms:
    """Frames at a time [s], by name, and their poses (m, 4, 4) in a parent's."""
    stamp, rows = timestamp(t), _rows(X, LINK_DIGITS)
    return FrameTransforms(tuple(_placed(stamp, parent, *one) for one in zip(names, rows, strict=True)))


def _placed(stamp: Timestamp, parent: str, name: str, row: list[float]) -> FrameTransform:
    return FrameTransform(stamp, parent, name, Vector3(*row[:3]), Quaternion(*row[3:]))


def link_transforms(t: float, robots: Sequence[tuple[str, Array]]) -> FrameTransforms:
    """Each robot's links, each relative to the one before.

    Args:
        t: When [s].
        robots: Name of each robot and the poses of its links in the base frame, (m, 4, 4); its frames are called
            `NAME/1` to `NAME/m`, and the first one's parent is the base.
    """
    stamp, found = timestamp(t), []
    for name, X_BL in robots:
        X_PL = X_BL.copy()
        R = X_BL[:-1, :3, :3].transpose(0, 2, 1)
        X_PL[1:, :3, :3] = R @ X_BL[1:, :3, :3]
        X_PL[1:, :3, 3] = (R @ (X_BL[1:, :3, 3] - X_BL[:-1, :3, 3])[:, :, None])[:, :, 0]
        parent = BASE
        for number, row in enumerate(_rows(X_PL, LINK_DIGITS), 1):
            child = f"{name}/{number}"
            found.append(_placed(stamp, parent, child, row))
            parent = child
    return FrameTransforms(tuple(found))


def _rows(X: Array, digits: int) -> list[list[float]]:
    """Translations and quaternions (x, y, z, w) of poses, (m, 4, 4), rounded."""
    found = np.empty((len(X), 7))
    found[:, :3] = X[:, :3, 3]
    found[:, 3:] = quaternions(X[:, :3, :3])
    rows: list[list[float]] = (found.round(digits) + 0.0).tolist()
    return rows


def quaternions(R: Array) -> Array:
    """Unit quaternions (x, y, z, w), (m, 4), w ≥ 0, of rotation matrices, (m, 3, 3)."""
    # By the largest component, which keeps full precision at every angle.
    x, y, z = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    q = np.empty((len(R), 4, 4))
    q[:, 0, 0], q[:, 1, 1], q[:, 2, 2], q[:, 3, 3] = 1 + x - y - z, 1 - x + y - z, 1 - x - y + z, 1 + x + y + z
    q[:, 0, 1] = q[:, 1, 0] = R[:, 1, 0] + R[:, 0, 1]
    q[:, 0, 2] = q[:, 2, 0] = R[:, 0, 2] + R[:, 2, 0]
    q[:, 1, 2] = q[:, 2, 1] = R[:, 2, 1] + R[:, 1, 2]
    q[:, 0, 3] = q[:, 3, 0] = R[:, 2, 1] - R[:, 1, 2]
    q[:, 1, 3] = q[:, 3, 1] = R[:, 0, 2] - R[:, 2, 0]
    q[:, 2, 3] = q[:, 3, 2] = R[:, 1, 0] - R[:, 0, 1]
    largest = q[:, range(4), range(4)].argmax(1)
    best: Array = q[range(len(R)), largest]
    best /= np.sqrt((best * best).sum(1))[:, None]
    best[best[:, 3] < 0] *= -1.0
    return best


class Paced:
    """Chooses what is shown at a lower rate: not more often than that, and seldom while nothing moves."""

    def __init__(self, rate: float) -> None:
        """Show so often a second, at most."""
        self._period = 1.0 / rate
        self._shown: list[tuple[float, Array]] = []

    def chosen(self, t: Array, q: Array) -> list[int]:
        """Rows to show; what comes late is, where nothing beside it was.

        Args:
            t: Ascending times [s], (k,).
            q: Joints [rad], (k, n).
        """
        found, shown = [], self._shown
        for row, now in enumerate(t.tolist()):
            place = len(shown)
            while place and shown[place - 1][0] > now:
                place -= 1
            if place < len(shown) and shown[place][0] - now < self._period - 1e-9:
                continue
            if place:
                since = now - shown[place - 1][0]
                if since < self._period - 1e-9:
                    continue
                if since < _STILL - 1e-9 and np.abs(q[row] - shown[place - 1][1]).max() <= _MOVED:
                    continue
            elif len(shown) == _SHOWN:
                continue
            shown.insert(place, (now, q[row]))
            del shown[: len(shown) - _SHOWN]
            found.append(row)
        return found
