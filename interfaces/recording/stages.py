"""Recordings' robots on pages: both of them, and of mobile robots their room and what they drove there."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any

import numpy as np

from interfaces.messages.recording import grid_of, room_of
from interfaces.recording.kinds import ARM
from interfaces.recording.playback import PlaybackFrame
from interfaces.recording.recording import Recording
from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.stream.meshcat.meshes import bodies
from interfaces.teleop.predicted_grasp import Hands, PredictedGrasp
from robots.things import Scene
from vrs.model import Array

MARGIN = 3.0
"""So much floor is seen around the paths, in lengths of the robot."""
JUMP = 1.0
"""A play head that goes on by more at once [s] has been put elsewhere."""
THIN = 2
"""One of so many samples is a point of a path that is drawn."""


class Stage:
    """A recording's robots on a page."""

    def __init__(self, recording: Recording) -> None:
        """Make the scene.

        Raises:
            FormatError: If the room makes no sense.
        """
        self._recording = recording
        self._until = -np.inf
        self._t: Array = np.empty(0)
        self._paths: dict[str, Array] = {}
        """Where both drove by those times [m], (k, 2) each; none of arms."""
        self._learned = _learned(recording)
        around: dict[str, Any] = {}
        if recording.kind is not ARM:
            self._grown()
            entry, facts = recording.room, recording.session.drive
            around["start"] = recording.session.q
            around["room"] = None if entry is None else room_of(entry, str(recording.path))
            around["grid"] = None if facts is None or facts.grid is None else grid_of(facts.grid)
            around["extent"] = self._extent()
        self.scene = TwinScene(recording.robot, looks=bodies(recording.robot), **around)
        hand = recording.robot.hand
        self._grasp = None if hand is None else PredictedGrasp(hand)
        self._shown = -np.inf

    def show(self, frame: PlaybackFrame, committed: Committed | None, *, now: float) -> None:
        """Show a frame whose virtual robot is known."""
        assert frame.q_virtual is not None
        around: dict[str, Any] = {}
        if self._paths:
            self._grown()
            count, changes = bisect_right(self._t, frame.t), self._learned
            twins = (("virtual", frame.q_virtual), ("real", frame.q_real))
            around["driven"] = {
                twin: np.vstack([self._paths[twin][:count], q[None, :2]])
                for twin, q in twins
                if q is not None and count
            }
            around["learned"] = changes[bisect_right(changes, frame.t, key=lambda change: change[0]) - 1][1]
            around["t"] = frame.t
        if self._grasp is not None:
            around["hands"] = self._hands(frame, frame.q_virtual)
        self.scene.show(virtual=frame.q_virtual, real=frame.q_real, path=committed, now=now, **around)

    def _hands(self, frame: PlaybackFrame, q: Array) -> Hands:
        """Both hands, and the things where they were measured, or where the virtual hand has taken one."""
        assert self._grasp is not None
        recording, t, before = self._recording, frame.t, self._shown
        scene, goals, poses = recording.hands.scene, recording.grips, recording.hands.poses(t)
        self._shown = t
        if not before <= t < before + JUMP or scene != self._grasp.scene:
            # What it has closed on is seen from there on.
            self._grasp = PredictedGrasp(self._grasp.gripper, scene or Scene(0.0))
            if scene is not None:
                self.scene.furnish(scene)
        opening, predicted = self._grasp.advance(recording.model.forward(q), goals, poses, now=t)
        real = recording.hands.opening(t)
        if real is None and frame.play is not None:
            real = self._grasp.fingers.opening(goals, frame.play)
        return Hands(opening, real, poses, predicted)

    def _grown(self) -> None:
        """Take the paths as far as the file has come."""
        recording = self._recording
        until = recording.span[1]
        if until == self._until:
            return
        self._until = until
        track = recording.track(recording.kind.real)
        t = track.t[::THIN]
        virtual = recording.virtual(t)
        known = np.isfinite(virtual).all(axis=1)
        self._t = t[known]
        self._paths = {"virtual": virtual[known, :2], "real": track.q[::THIN][known, :2]}

    def _extent(self) -> Array:
        """What is to be seen at first: where both drove, and so much around it [m]."""
        margin = MARGIN * self._recording.robot.base.body.length
        points = np.vstack([np.array([self._recording.session.q[:2]]), *self._paths.values()])
        return np.array([points.min(axis=0) - margin, points.max(axis=0) + margin])


def _learned(recording: Recording) -> list[tuple[float, tuple[tuple[int, int], ...]]]:
    """When the cells of the virtual environment changed [s], and what they were from then on; none at first."""
    cells: set[tuple[int, int]] = set()
    found: list[tuple[float, tuple[tuple[int, int], ...]]] = [(-np.inf, ())]
    for entry in recording.learned:
        cells |= set(zip(entry.added[::2], entry.added[1::2], strict=False))
        cells -= set(zip(entry.gone[::2], entry.gone[1::2], strict=False))
        found.append((entry.t, tuple(sorted(cells))))
    return found


def prepare(recording: Recording) -> None:
    """Read and load what takes long before a recording can be shown; from any thread."""
    q = recording.virtual(recording.span[0])
    recording.model.links(q) if recording.kind is ARM else recording.robot.shapes()
