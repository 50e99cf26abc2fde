"""What the robot's operator sees, hears and says through it: camera, voice and screen (docs/media.md)."""

from __future__ import annotations

from interfaces.media.camera import CameraConfig
from interfaces.media.door import MediaDoor
from interfaces.media.live import LiveMedia
from interfaces.media.presenter import Presenter
from interfaces.media.speech import Aloud, SpeechError

__all__ = [
    "Aloud",
    "CameraConfig",
    "LiveMedia",
    "MediaDoor",
    "Presenter",
    "SpeechError",
]
