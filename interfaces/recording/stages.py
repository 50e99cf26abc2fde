"""Recordings' robots on pages: two arms, or two mobile robots in their room."""

from __future__ import annotations

from bisect import bisect_right
from typing import TypeAlias

import numpy as np

from interfaces.messages.recording import grid_of, room_of
from interfaces.recording.kinds import ARM
from interfaces.recording.playback import PlaybackFrame
from interfaces.recording.recording import Recording
from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.stream.meshcat.meshes import bodies
from vrs.model import Array

MARGIN = 3.0
"""So much floor is seen around the paths, in lengths of the robot."""
THIN = 2
"""One of so many samples is a point of a path that is drawn."""


class DriveStage:
    """Two mobile robots, what they drove, the room, and what was learned of it."""

    def __init__(self, recording: Recording) -> None:
        """Take what was driven, and make the scene.

        Raises:
            FormatError: If the room makes no sense.
        """
        self._recording, facts, robot = recording, recording.session.drive, recording.robot
        self._until = -np.inf
        self._t: Array = np.empty(0)
        self._paths: dict[str, Array] = {}
        self._grown()
        entry = recording.room
        room = None if entry is None else room_of(entry, str(recording.path))
        grid = None if facts is None or facts.grid is None else grid_of(facts.grid)
        self._learned_at, self._learned = _learned(recording)
        extent = self._extent(recording.session.q, MARGIN * robot.base.body.length)
        start, looks = recording.session.q, bodies(robot)
        self.scene = TwinScene(robot, start, looks=looks, room=room, grid=grid, extent=extent)

    def show(self, frame: PlaybackFrame, committed: Committed | None, *, now: float) -> None:
        """Show a frame whose virtual robot is known."""
        assert frame.q_virtual is not None
        self._grown()
        count = bisect_right(self._t, frame.t)
        driven = {}
        for twin, q in (("virtual", frame.q_virtual), ("real", frame.q_real)):
            if q is not None and count:
                driven[twin] = np.vstack([self._paths[twin][:count], q[None, :2]])
        self.scene.show(
            virtual=frame.q_virtual,
            real=frame.q_real,
            path=committed,
            driven=driven,
            learned=self._learned[bisect_right(self._learned_at, frame.t)],
            t=frame.t,
            now=now,
        )

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

    def _extent(self, start: list[float], margin: float) -> Array:
        """What is to be seen at first: where both drove, and so much around it [m]."""
        points = np.vstack([np.array([start[:2]]), *self._paths.values()])
        return np.array([points.min(axis=0) - margin, points.max(axis=0) + margin])


def _learned(recording: Recording) -> tuple[list[float], list[tuple[tuple[int, int], ...]]]:
    """When the cells of the virtual environment changed [s], and what they were before the first and after each."""
    cells: set[tuple[int, int]] = set()
    times: list[float] = []
    found: list[tuple[tuple[int, int], ...]] = [()]
    for entry in recording.learned:
        cells |= set(zip(entry.added[::2], entry.added[1::2], strict=False))
        cells -= set(zip(entry.gone[::2], entry.gone[1::2], strict=False))
        times.append(entry.t)
        found.append(tuple(sorted(cells)))
    return times, found


class ArmStage:
    """Two arms."""

    def __init__(self, recording: Recording) -> None:
        self.scene = TwinScene(recording.robot, looks=bodies(recording.robot))

    def show(self, frame: PlaybackFrame, committed: Committed | None, *, now: float) -> None:
        """Show a frame whose virtual robot is known."""
        assert frame.q_virtual is not None
        self.scene.show(virtual=frame.q_virtual, real=frame.q_real, path=committed, now=now)


Stage: TypeAlias = ArmStage | DriveStage
"""A recording's robots on a page."""


def stage_of(recording: Recording) -> Stage:
    """The robots of a recording for a page."""
    return ArmStage(recording) if recording.kind is ARM else DriveStage(recording)


def prepare(recording: Recording) -> None:
    """Read and load what takes long before a recording can be shown; from any thread."""
    q = recording.virtual(recording.span[0])
    recording.model.links(q) if recording.kind is ARM else recording.robot.shapes()
