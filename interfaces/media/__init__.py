"""What the robot's operator sees, hears and says through it: camera, voice and screen (docs/media.md)."""

from __future__ import annotations

from interfaces.media.camera import CameraConfig, CameraError, LiveCamera
from interfaces.media.door import MediaDoor
from interfaces.media.live import LiveMedia
from interfaces.media.presenter import Presenter
from interfaces.media.speech import Aloud, SpeechError

__all__ = [
    "Aloud",
    "CameraConfig",
    "CameraError",
    "LiveCamera",
    "LiveMedia",
    "MediaDoor",
    "Presenter",
    "SpeechError",
]
