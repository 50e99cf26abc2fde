"""The hand of a described arm: two fingers behind its tip that move towards each other.

What moves behind the tip, by values of its own or as another joint does, is a finger's; which of both it belongs to
is seen from how it moves when all that drives it goes from one limit to the other. Whether fingers slide, turn or
hang on linkages, they count as parallel: their pads come together along the line on which they move most.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robots.description.description import Description, Joint, JointKind, corners_of
from robots.description.geometry import followed
from robots.description.rigid import at_rest, carried, motion
from robots.robot import Fingers
from robots.solids import LinkShape, together
from vrs.model import Array

_MOST_DRIVES: Final = 2
"""Joints of their own values that move a hand's fingers; with more it's no gripper."""
_LEAST: Final = 1e-3
"""By which fingers come closer at least [m]."""
_PADS: Final = 0.35
"""Share of the fingers' length, from their ends, in which they hold."""
_LITTLE: Final = 1e-4
"""Lengths below this say no direction [m]."""
_AS_WELL: Final = 0.95
_FORCE: Final = 40.0
"""With which fingers press whose effort isn't said [N]."""
_THICKNESS, _WIDTH, _LENGTH = 0.012, 0.02, 0.05
"""Of fingers without shapes [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class DescribedHand:
    """A hand of two fingers."""

    fingers: Fingers
    """How far, fast and strongly they close."""
    X_TH: Array
    """Pose of the hand in the tip's frame, (4, 4): fingers close along x and reach out along z."""
    links: frozenset[str]
    """Links that are parts of fingers."""
    shapes: tuple[LinkShape, ...]
    """What both fingers look like, that of positive x first, about their middles; empty where they have none."""
    notes: tuple[str, ...]
    """What was assumed of it."""


def hand_of(description: Description) -> DescribedHand | None:
    """Return the hand behind an arm's tip; None where nothing there is one.

    Args:
        description: Of an arm, nothing missing, its tip chosen.
    """
    chain = [joint.name for joint in description.chain(description.tip) if joint.moves]
    placed = carried(description, chain)
    last, X_tip = placed[description.tip]
    palm = {name: np.linalg.inv(X_tip) @ X for name, (owner, X) in placed.items() if owner == last}
    joints = _behind(description, palm)
    drives = sorted({followed(description, joint)[0] for joint in joints if joint.kind is not JointKind.FIXED})
    if not 1 <= len(drives) <= _MOST_DRIVES or any(name in chain for name in drives):
        return None
    known = {joint.name: joint for joint in description.joints}

    def closing(names: Sequence[str]) -> _Motion:
        """The motion that closes most: the first drive goes up, others go with it or against it."""
        ends = [(known[name].q_min or 0.0, known[name].q_max or 0.0) for name in names]
        ways = itertools.product(*[[(low, high), (high, low)][: 1 + bool(k)] for k, (low, high) in enumerate(ends)])
        moves = (_Motion(description, joints, palm, names, way) for way in ways)
        return max(moves, key=lambda move: move.closes)

    best = closing(drives)
    for name in drives:
        # What closes as well without one isn't closed by it.
        others = [other for other in drives if other != name]
        if others and (without := closing(others)).closes >= _AS_WELL * best.closes:
            drives, best = others, without
    return best.hand([known[name] for name in drives]) if best.closes >= _LEAST else None


def _behind(description: Description, palm: Mapping[str, Array]) -> list[Joint]:
    """Joints behind a tip, from the first ones that move down; those of an SRDF, where it says which."""
    named, moving, found = set(description.hand), set[str](), []
    arm = {joint.name for joint in description.chain(description.tip)}
    for joint in description.joints:
        if joint.child not in palm or joint.name in arm:
            continue
        if joint.parent in moving or (joint.kind is not JointKind.FIXED and (not named or joint.name in named)):
            moving.add(joint.child)
            found.append(joint)
    return found


class _Motion:
    """What moves behind a tip when drives go from one limit to the other."""

    def __init__(
        self,
        description: Description,
        joints: Sequence[Joint],
        palm: Mapping[str, Array],
        drives: Sequence[str],
        way: Sequence[tuple[float, float]],
    ) -> None:
        self.closes = 0.0
        """By how much fingers come closer [m]; 0 where there aren't two."""
        self._description, self._joints, self._palm = description, joints, palm
        self._travels = [abs(end - begin) for begin, end in way]
        poses = [
            self._at({name: a + share * (b - a) for name, (a, b) in zip(drives, way, strict=True)})
            for share in (0.0, 0.5, 1.0)
        ]
        links = description.links
        corners = {
            joint.child: corners_of(links[joint.child].collisions or links[joint.child].shapes) for joint in joints
        }
        self._solid = any(len(part) for part in corners.values())
        # Where nothing has a shape, links are points.
        if not self._solid:
            corners = dict.fromkeys(corners, np.zeros((1, 3)))
        placed = {
            name: np.stack([part @ X[name][:3, :3].T + X[name][:3, 3] for X in poses])
            for name, part in corners.items()
            if len(part)
        }
        placed = {name: P for name, P in placed.items() if np.abs(P[-1] - P[0]).max() > _LITTLE}
        if not placed:
            return
        P = np.concatenate(list(placed.values()), axis=1)
        axis = np.linalg.svd(P[-1] - P[0], full_matrices=False)[2][0]
        self._side = {
            name: 1 if ((part[-1] - part[0]) @ axis).mean() > 0.0 else -1 for name, part in placed.items()
        }
        plus = np.concatenate([np.full(part.shape[1], self._side[name] > 0) for name, part in placed.items()])
        if plus.all() or not plus.any():
            return
        # The last one is open: both sides have gone away from each other.
        if (P[1][plus] @ axis).mean() < (P[1][~plus] @ axis).mean():
            poses, P, plus = poses[::-1], P[::-1], ~plus
            self._side = {name: -side for name, side in self._side.items()}
        self._poses, self._points, self._axis, self._plus = poses, P, axis, plus
        self._frame()
        self._gaps = [self._gap(points) for points in P]
        self.closes = self._gaps[-1] - max(self._gaps[0], 0.0)

    def _at(self, values: Mapping[str, float]) -> dict[str, Array]:
        """Poses of links in the tip's frame, at values of drives."""
        poses = dict(self._palm)
        for joint in self._joints:
            source, gain, offset = followed(self._description, joint)
            value = gain * values[source] + offset if source in values else at_rest(joint)
            poses[joint.child] = poses[joint.parent] @ joint.X @ motion(joint, value)
        return poses

    def _frame(self) -> None:
        """Find along what fingers reach out, and how far: from where they hang, across the way that they close."""
        moving = {joint.child for joint in self._joints}
        first = [joint for joint in self._joints if joint.parent not in moving]
        hang = np.mean([(self._palm[joint.parent] @ joint.X)[:3, 3] for joint in first], axis=0)
        middle = np.mean([self._points[-1][self._plus == side].mean(axis=0) for side in (True, False)], axis=0)
        for out in (middle - hang, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])):
            across = out - (out @ self._axis) * self._axis
            if np.linalg.norm(across) > _LITTLE:
                break
        z = across / np.linalg.norm(across)
        self._R = np.stack([self._axis, np.cross(z, self._axis), z], axis=1)

    def _pads(self, points: Array) -> tuple[Array, Array]:
        """Corners of where both fingers hold, in the hand's axes, (k, 3) each, that of positive x first."""
        turned = points @ self._R
        sides = [turned[self._plus == side] for side in (True, False)]
        lows = [side[:, 2].max() - _PADS * np.ptp(side[:, 2]) for side in sides]
        plus, minus = (side[side[:, 2] >= low - 1e-9] for side, low in zip(sides, lows, strict=True))
        return plus, minus

    def _gap(self, points: Array) -> float:
        """How far fingers are apart [m]."""
        if not self._solid:
            # Points are apart by as much as they have gone from where they are nearest to each other.
            plus, minus = self._plus, ~self._plus
            return float(
                ((points - self._points[0])[plus] @ self._axis).mean()
                - ((points - self._points[0])[minus] @ self._axis).mean()
            )
        plus, minus = self._pads(points)
        return float(plus[:, 0].min() - minus[:, 0].max())

    def hand(self, drives: Sequence[Joint]) -> DescribedHand:
        """Return the hand that moves so."""
        opened, closed = self._gaps[-1], max(self._gaps[0], 0.0)
        plus, minus = self._pads(self._points[-1])
        both = np.concatenate([plus, minus])
        low = float((self._points[-1] @ self._R)[:, 2].min()) if self._solid else float(both[:, 2].mean())
        high = float(both[:, 2].max()) if self._solid else low + _LENGTH
        middle = 0.5 * (plus[:, 0].min() + minus[:, 0].max())
        origin = self._R @ np.array([middle, 0.5 * (both[:, 1].min() + both[:, 1].max()), low])
        thick, wide = (np.ptp(plus[:, k]) if self._solid else usual for k, usual in ((0, _THICKNESS), (1, _WIDTH)))
        notes = []
        time = max(travel / (joint.qd_max or 1.0) for travel, joint in zip(self._travels, drives, strict=True))
        effort, travel = drives[0].effort, self._travels[0]
        # What a drive's effort presses with: its way is to half of the opening as the force is to the effort.
        force = _FORCE if not effort else effort * travel / (0.5 * (self._gaps[-1] - self._gaps[0]))
        if not effort:
            notes.append(
                f"{drives[0].name}: no effort is said; assumed that each finger presses with {_FORCE:g} N."
            )
        if closed > _LEAST:
            notes.append(f"The fingers stay {1e3 * closed:.3g} mm apart, less than which they don't close.")
        fingers = Fingers(
            stroke=float(np.clip(opened, _LEAST, 1.0)),
            force=float(np.clip(force, 0.1, 10_000.0)),
            speed=float(np.clip((self._gaps[-1] - self._gaps[0]) / max(time, 1e-6), 1e-3, 10.0)),
            thickness=float(np.clip(thick, 1e-3, 0.2)),
            width=float(np.clip(wide, 1e-3, 0.2)),
            length=float(np.clip(high - low, 1e-3, 0.5)),
        )
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = self._R, origin
        return DescribedHand(fingers, X, frozenset(self._side), self._looks(fingers, X), tuple(notes))

    def _looks(self, fingers: Fingers, X_TH: Array) -> tuple[LinkShape, ...]:
        """Shapes of both fingers, each about its middle."""
        found = []
        for side in (1, -1):
            X = np.array(X_TH)
            X[:3, 3] += X_TH[:3, :3] @ (
                side * 0.5 * (fingers.stroke + fingers.thickness),
                0.0,
                0.5 * fingers.length,
            )
            back = np.linalg.inv(X)
            parts = [
                (shape, back @ self._poses[-1][name])
                for name, own in self._side.items()
                if own == side
                for shape in self._description.links[name].shapes
            ]
            if not parts:
                return ()
            found.append(together(parts))
        return tuple(found)
