"""Recordings: MCAP in and out, figures, play-back. `docs/recording.md` is the reference."""

from interfaces.recording.mcap_file import RecordingError
from interfaces.recording.mcap_reading import Damage
from interfaces.recording.recorder import Recorder
from interfaces.recording.recording import Recording, open_recording
from interfaces.recording.writer import RecordingWriter

__all__ = ["Damage", "Recorder", "Recording", "RecordingError", "RecordingWriter", "open_recording"]
