"""Record a drive, take its figures from the file alone, and look back at where the robots were."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from interfaces.lab.driving.run import run
from interfaces.recording import open_recording
from interfaces.recording.figures import summary
from interfaces.recording.playback import Playback
from interfaces.recording.rerun import rerun
from interfaces.recording.run_recorders import DriveRecorder
from interfaces.runs.drive_run import DriveCase
from interfaces.teleop.architectures import Transport

CASE = DriveCase("timeline", Transport.DATAGRAMS, "wed@3.3", robot="bare", operator="slalom", length=20.0)

with TemporaryDirectory() as folder:
    path = Path(folder) / "run.mcap"
    recorder = DriveRecorder(path)
    recorder.finish(run(CASE, witness=recorder))

    with open_recording(path) as recording:
        again = rerun(recording)
        print(f"{again.commands} commands run again: {'the same' if again.identical else 'another'} path")
        found = summary(recording)
        off, late = 100 * found["path_error_max"], found["time_difference_mean"]
        print(f"at most {off:.2f} cm off it, {late:.2f} s later on average")

        playback = Playback([recording])
        for t in (16.0, 12.0, 8.0, 4.0):
            (frame,) = playback.moment(t).frames
            assert frame.q_virtual is not None
            assert frame.behind is not None
            x, y, _ = frame.q_virtual
            print(
                f"{t:4.1f} s: the virtual robot at ({x:.2f}, {y:.2f}) m, the real one {frame.behind:.2f} s behind"
            )
