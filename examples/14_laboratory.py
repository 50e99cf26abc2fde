"""The same drive over a bad network by two architectures: how far off the path, and how late?"""

from __future__ import annotations

from interfaces.lab.driving.run import run
from interfaces.runs.drive_run import DriveCase

for architecture, transport in (
    ("II", "stream"),
    ("III", "stream"),
    ("timeline", "stream"),
    ("timeline", "datagrams"),
):
    drive = run(DriveCase(architecture, transport, "thu@3.3", robot="bare", operator="slalom", seed=2, length=40.0))
    found = drive.compare()
    assert found.path_error_max is not None
    assert found.time_difference_mean is not None
    print(
        f"{architecture:9} {transport:10} at most {100 * found.path_error_max:6.1f} cm off the path, "
        f"{found.time_difference_mean:5.2f} s later on average"
    )
