"""A list of jobs for the mobile robot: tried on the virtual one, run, waiting for a key, done; live, in a home."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from interfaces import connect_mobile
from interfaces.messages.jobs import (
    JobList,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    VoiceJob,
    WaitJob,
)
from robots.onboard.journey import Goal

JOBS = JobList(
    (
        MoveJob(1, "door"),
        VoiceJob(2, "Hello!"),
        MessageJob(3, "Please put the book on my top side!"),
        WaitJob(4),  # for the key
        MoveJob(5, Goal(1.9, 5.4)),
    ),
    places={"door": Goal(1.6, 5.4)},
)

# The same as `vrs serve --robot ipr --room home` in a shell. The list is kept in a file.
kept = Path(tempfile.mkdtemp()) / "jobs.json"
command = [sys.executable, "-m", "interfaces.cli", "serve", "--robot", "ipr", "--room", "home", "--port", "0"]
server = subprocess.Popen([*command, "--link-loss", "hold", "--jobs", str(kept)], stdout=subprocess.PIPE, text=True)
assert server.stdout is not None
page = next(word for word in server.stdout.readline().split() if word.startswith("http"))
try:
    with connect_mobile(page.removesuffix("/view"), name="example") as robot:
        robot.wait(lambda it: it.postures is not None and it.postures.real is not None, 60.0)
        robot.acquire()
        robot.wait(lambda it: it.postures is not None and not it.postures.halted, 10.0)
        robot.load(JOBS)
        forecast = robot.dry_run()
        assert isinstance(forecast, tuple)
        for job, one in zip(JOBS.jobs, forecast, strict=True):
            print(job.word, "takes", "nobody knows how long" if one.lasts is None else f"{one.lasts:.1f} s")
        robot.do(ListCommand.RUN)
        waits = robot.wait(lambda it: bool(it.tasks and it.tasks.progress.jobs[3].stage is JobStage.RUNNING), 60.0)
        assert robot.tasks is not None
        print("waits for the key:", waits, "- its screen shows:", robot.tasks.shows)
        robot.do(ListCommand.KEY)
        print("comes to its end:", robot.finished(60.0))
        print("the list is", robot.tasks.progress.stage, "and kept:", '"stage": "done"' in kept.read_text())
finally:
    server.terminate()
    server.wait()
