"""A Dask scheduler and worker processes on loopback, for tests and benchmarks."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

HOUSE = Path(__file__).resolve().parents[3]
SECONDS = 60.0
"""Until all are there [s]."""


class Cluster:
    """Processes, ended by `end`."""

    def __init__(self, place: Path, workers: int, **environment: str) -> None:
        """Start them; files of theirs go to an empty directory."""
        self.place = place
        self.environment = os.environ | {"PYTHONPATH": str(HOUSE)} | environment
        file = place / "scheduler.json"
        options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
        self.scheduler = self._start("scheduler", *options)
        self._until(file.exists)
        self.address: str = json.loads(file.read_text())["address"]
        self.workers: list[subprocess.Popen[bytes]] = []
        for _ in range(workers):
            self.add_worker()
        self.wait()

    def add_worker(self) -> None:
        """Start another worker, of one thread."""
        options = ["--no-nanny", "--nthreads", "1", "--no-dashboard", "--local-directory", str(self.place)]
        self.workers.append(self._start("worker", self.address, *options))

    def wait(self) -> None:
        """Wait until the scheduler knows all workers."""
        log = self.place / "worker.log"
        self._until(lambda: not self.workers or log.read_text().count("Registered to") >= len(self.workers))

    def _until(self, there: Callable[[], bool]) -> None:
        deadline = time.monotonic() + SECONDS
        while not there():
            assert time.monotonic() < deadline
            assert self.scheduler.poll() is None
            time.sleep(0.05)

    def _start(self, what: str, *options: str) -> subprocess.Popen[bytes]:
        log = (self.place / f"{what}.log").open("ab")
        with log:
            return subprocess.Popen(
                [sys.executable, "-m", "distributed.cli.dask_" + what, *options],
                cwd=self.place, env=self.environment, stdout=log, stderr=log, stdin=subprocess.DEVNULL,
            )  # fmt: skip

    def end(self) -> None:
        """End all that still run."""
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait(30)


@contextmanager
def cluster(place: Path, workers: int = 2, **environment: str) -> Iterator[Cluster]:
    """A scheduler and some workers meanwhile, with a clean checkout of ours on their path."""
    made = Cluster(place, workers, **environment)
    try:
        yield made
    finally:
        made.end()
