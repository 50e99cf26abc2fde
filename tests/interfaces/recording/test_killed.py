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

import pytest

from interfaces.recording import open_recording
from tests.interfaces.recording import recorded

KILLS = int(os.environ.get("VRS_KILLS", "6"))
"""How often; 100 for the whole measure."""
MISSING = 0.5
"""Of the end this may be missing [s]."""


@pytest.fixture(scope="module")
def keeper() -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "tests.interfaces.recording.kept"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0) as process:
        yield process
        process.kill()


def line(process: subprocess.Popen[bytes], seconds: float = 20.0) -> list[str]:
    """The next line that a process says."""
    assert process.stdout is not None
    end, data = time.monotonic() + seconds, b""
    while not data.endswith(b"\n"):
        assert select.select([process.stdout], [], [], max(0.0, end - time.monotonic()))[0], "nothing was said"
        data += process.stdout.read(1)
    return data.decode().split()


@pytest.mark.parametrize("kill", range(KILLS))
def test_a_kill_at_any_moment(keeper: subprocess.Popen[bytes], tmp_path: Path, kill: int) -> None:
    path, wait = tmp_path / "run.mcap", Random(kill).uniform(0.0, 1.2)
    assert keeper.stdin is not None
    keeper.stdin.write(f"{path}\n".encode())
    (pid,) = line(keeper)
    time.sleep(wait)
    os.kill(int(pid), signal.SIGKILL)
    acknowledged, put, newest = 0, 0, 0.0
    while (said := line(keeper)) != ["dead"]:
        acknowledged, put, newest = int(said[0]), int(said[1]), float(said[2])
    with open_recording(path) as recording:
        assert recording.damage.cut
        assert not recording.damage.blocks
        assert str(recording.damage).startswith("cut: nothing is known after")
        assert recording.end is None
        t = recording.track("/real/joints").t.tolist()
        assert t == [k * recorded.STEP for k in range(len(t))]
        assert acknowledged <= len(t) <= put + 1
        assert newest - recording.span[1] <= MISSING
        if len(t):
            assert recording.real(t[-1]).tolist() == recorded.sample(len(t) - 1).q
