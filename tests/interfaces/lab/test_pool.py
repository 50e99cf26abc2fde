"""Work in several processes: what one refuses is a refusal, and none outlives who began it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from interfaces.lab.runner import pooled
from vrs.errors import InvalidValueError


def _refuse(name: str) -> None:
    raise InvalidValueError(name, 3, "something else")


def test_a_workers_refusal_is_a_refusal():
    with pytest.raises(InvalidValueError, match="part must be something else; given: 3"):
        pooled([(_refuse, ("part",)), (_refuse, ("part",))], workers=2)


def _begun_by(pid: int) -> set[int]:
    found = set()
    for task in Path(f"/proc/{pid}/task").iterdir():
        found |= {int(child) for child in (task / "children").read_text().split()}
    return {child for child in found if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()}


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_workers_end_with_who_began_them():
    script = "import time\nfrom interfaces.lab.runner import pooled\npooled([(time.sleep, (120,))] * 2, workers=2)"
    process = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(workers := _begun_by(process.pid)) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.5)
    process.kill()
    process.wait(timeout=30)
    deadline = time.monotonic() + 20
    while any(map(_runs, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    left = [pid for pid in workers if _runs(pid)]
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    assert len(workers) == 2
    assert left == []
