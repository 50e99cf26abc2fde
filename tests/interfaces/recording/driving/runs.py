"""Short runs of the bare mobile robot, with their recordings."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from interfaces.lab.driving.run import run
from interfaces.recording.run_recorders import DriveRecorder
from interfaces.runs.drive_run import DriveCase, DriveRun
from interfaces.teleop.architectures import Transport

SLALOM = DriveCase("timeline", Transport.DATAGRAMS, "mon@3.3", "bare", "slalom", 3, 6.0)
WANDER = DriveCase("extended", Transport.STREAM, "constant:0.4", "bare", "wander", 1, 12.0)
_FOLDER = TemporaryDirectory(prefix="vrs-drives-")


@cache
def recorded(case: DriveCase) -> tuple[DriveRun, Path]:
    """A run, and where its recording stands; it isn't to be changed."""
    path = Path(_FOLDER.name) / f"{abs(hash(case))}.mcap"
    recorder = DriveRecorder(path)
    drive = run(case, witness=recorder)
    recorder.finish(drive)
    assert recorder.problem == ""
    return drive, path
