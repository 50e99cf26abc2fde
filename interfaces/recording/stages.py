"""Recordings' robots on pages."""

from __future__ import annotations

from typing import Protocol

from typing_extensions import override

from interfaces.clients.appearance import link_shapes
from interfaces.recording.driving.stage import DriveStage
from interfaces.recording.engines import mobile_model
from interfaces.recording.kinds import ARM
from interfaces.recording.playback import PlaybackFrame
from interfaces.recording.recording import Recording
from interfaces.stream.meshcat import Committed, MeshcatScene
from interfaces.stream.meshcat.scene import TwinScene


class Stage(Protocol):
    """A recording's robots on a page."""

    @property
    def scene(self) -> TwinScene:
        """What pages look at."""

    def show(self, frame: PlaybackFrame, committed: Committed | None, *, now: float) -> None:
        """Show a frame whose virtual robot is known."""


class ArmStage(Stage):
    """Two arms."""

    def __init__(self, recording: Recording) -> None:
        self._model = recording.model
        self._scene = MeshcatScene(recording.model)

    @property
    @override
    def scene(self) -> MeshcatScene:
        return self._scene

    @override
    def show(self, frame: PlaybackFrame, committed: Committed | None, *, now: float) -> None:
        links = self._model.links
        assert frame.q_virtual is not None
        real = None if frame.q_real is None else links(frame.q_real)
        self._scene.show(virtual=links(frame.q_virtual), real=real, path=committed, now=now)


def stage_of(recording: Recording) -> Stage:
    """The robots of a recording for a page."""
    return ArmStage(recording) if recording.kind is ARM else DriveStage(recording, mobile_model(recording))


def prepare(recording: Recording) -> None:
    """Read and load what takes long before a recording can be shown; from any thread."""
    if recording.kind is ARM:
        recording.model.links(recording.virtual(recording.span[0]))
        return
    link_shapes(mobile_model(recording))
    recording.virtual(recording.span[0])
