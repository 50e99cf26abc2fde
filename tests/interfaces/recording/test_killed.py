"""A recording whose process is killed: what was acknowledged is there, and it says that it was cut."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Self

import pytest

from interfaces.recording import open_recording
from tests.interfaces.recording import recorded

KILLS = int(os.environ.get("VRS_KILLS", "6"))
"""How often; 100 for the whole measure."""
MISSING = 0.5
"""Of the end this may be missing [s]."""


class Keeper:
    """Records in processes of its own, one after the other, that are killed."""

    def __enter__(self) -> Self:
        command = [sys.executable, "-m", "tests.interfaces.recording.kept"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def killed(self, path: Path, wait: float) -> float:
        """Kill a recorder after a time [s]; how much of its recording's end is missing then [s].

        Raises:
            AssertionError: If anything acknowledged isn't there to the bit, or the file doesn't say that it's cut.
        """
        assert self._process.stdin is not None
        self._process.stdin.write(f"{path}\n".encode())
        (pid,) = self._line()
        time.sleep(wait)
        os.kill(int(pid), signal.SIGKILL)
        acknowledged, put, newest = 0, 0, 0.0
        while (said := self._line()) != ["dead"]:
            acknowledged, put, newest = int(said[0]), int(said[1]), float(said[2])
        with open_recording(path) as recording:
            assert recording.damage.cut
            assert not recording.damage.blocks
            assert str(recording.damage).startswith("cut: nothing is known after")
            assert recording.end is None
            t = recording.track("/real/joints").t.tolist()
            assert t == [k * recorded.STEP for k in range(len(t))]
            assert acknowledged <= len(t) <= put + 1
            if len(t):
                assert recording.real(t[-1]).tolist() == recorded.sample(len(t) - 1).q
            return newest - recording.span[1]

    def _line(self, seconds: float = 20.0) -> list[str]:
        """The next line that the process says."""
        assert self._process.stdout is not None
        end, data = time.monotonic() + seconds, b""
        while not data.endswith(b"\n"):
            left = max(0.0, end - time.monotonic())
            assert select.select([self._process.stdout], [], [], left)[0], "nothing was said"
            data += self._process.stdout.read(1)
        return data.decode().split()


@pytest.fixture(scope="module")
def keeper() -> Iterator[Keeper]:
    with Keeper() as keeper:
        yield keeper


@pytest.mark.parametrize("kill", range(KILLS))
def test_a_kill_at_any_moment(keeper: Keeper, tmp_path: Path, kill: int) -> None:
    assert keeper.killed(tmp_path / "run.mcap", Random(kill).uniform(0.0, 1.2)) <= MISSING
