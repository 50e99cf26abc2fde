"""A built-in robot that dies is told on standard error, by `/health` and to every client; orders are refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect


def health(url: str) -> tuple[int, dict[str, Any]]:
    try:
        with urllib.request.urlopen(f"{url}/health", timeout=5) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as refused:
        with refused:
            return refused.code, json.load(refused)


def until(ready: Callable[[], Any], timeout: float = 40.0) -> Any:
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        if found := ready():
            return found
        time.sleep(0.05)
    raise TimeoutError


def children(pid: int) -> list[int]:
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(child) for child in found]


def last(pid: int) -> int:
    """The process at the end of a line of children that run our modules: the body's own."""
    while below := [one for one in children(pid) if b"interfaces" in Path(f"/proc/{one}/cmdline").read_bytes()]:
        pid = below[0]
    return pid


@contextmanager
def serving(*options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    command = [sys.executable, "-m", "interfaces.cli", "serve", "--port", "0", "--until-eof", *options]
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        yield process, next(word for word in line.split() if word.startswith("http://")).rsplit("/", 1)[0]
    finally:
        process.terminate()
        try:
            process.communicate(timeout=15)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@pytest.mark.parametrize("robot", ["puma560", "ipr"])
def test_t13_a_robot_that_dies_is_told_everywhere(robot: str) -> None:
    with serving("--robot", robot) as (process, url):
        until(lambda: health(url)[1]["connected"])
        assert health(url)[0] == 200
        with connect(url.replace("http", "ws") + "/ws", subprotocols=["vrs.1.json"]) as client:  # type: ignore[list-item]

            def tell(**message: Any) -> None:
                client.send(json.dumps(message))

            def hear(what: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
                return until(lambda: (m := json.loads(client.recv(20.0))) and what(m) and m)

            tell(type="hello", role="operator", name="Ada", protocol=1)
            tell(type="acquire", number=1)
            epoch = hear(lambda m: m.get("yours"))["epoch"]
            kind = "state" if robot == "puma560" else "postures"
            hear(lambda m: m["type"] == kind and not m.get("halted") and m.get("connected", True))
            os.kill(last(process.pid), signal.SIGKILL)
            told = hear(lambda m: m["type"] == kind and "robot's process has ended" in m.get("halted", ""))
            assert told["connected"] is False
            command = {"type": "move", "target": {"type": "joints", "q": [0.0, 0.8, -2.4, 0.0, 0.6, 0.0]}}
            if robot == "ipr":
                command = {"type": "drive", "v": 0.1, "w": 0.0, "duration": 0.3}
            tell(type="order", number=1, epoch=epoch, command=command)
            outcome = hear(lambda m: m["type"] == "outcome")
            assert "has ended" in outcome.get("refusal", "") + (outcome.get("receipt") or {}).get("reason", "")
            tell(type="resume", number=2, epoch=epoch)
            assert "has ended" in hear(lambda m: m.get("number") == 2)["text"]
        status, facts = health(url)
        assert (status, facts["ok"], facts["connected"]) == (503, False, False)
        assert "has ended" in facts["reason"]
        process.terminate()
        _, errors = process.communicate(timeout=15)
        assert len([line for line in errors.splitlines() if "robot's process has ended" in line]) == 1
