"""How many modules of ours are entered on three ways through the house: `python -m benchmarks entered`.

A command typed at a remote console until it reaches PyBullet, a measured pose until it reaches the browser, a
recording that plays until it reaches its page. All processes of a way note the functions that they enter
(`tracing/sitecustomize.py`), run by run: what an event loop or a loop of ours calls until that returns. Runs that
do something which none does while nothing happens carry what is looked at; all modules that they enter are counted.
So the count has no list of modules in it, and takes in what such a run does beside.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import IO

from websockets.sync.client import connect

import interfaces as vrs
from interfaces.stream.connection import Connection
from interfaces.system import module_process
from vrs.model import Array

TRACING = Path(__file__).with_name("tracing")
IDLE, BUSY = 1, 2
"""Phases: nothing happens; what's looked at does."""
REST = 4.0
"""How long it's watched while nothing happens [s]."""
SETTLED = 2.0
"""A short move is over, of both robots, and of what tells of it [s]."""
MOVED = 1e-3
"""A joint that has gone so far moves [rad]."""
ASKED = {"command": 35, "pose": 18, "recording": 12}
"""At most so many modules, says the design."""


class Watch:
    """A folder in which processes note what they enter."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._phase = folder / "phase"
        self._phase.write_bytes(b"\0")

    @contextlib.contextmanager
    def phase(self, phase: int) -> Iterator[None]:
        """A span in which it's noted."""
        self._set(phase)
        yield
        self._set(0)

    def _set(self, phase: int) -> None:
        with self._phase.open("r+b") as file:
            file.write(bytes([phase]))

    def modules(self) -> dict[str, list[str]]:
        """Modules that the runs entered which did something that isn't done at rest, by process."""
        found = {}
        for file in sorted(self.folder.glob("*.jsonl")):
            runs = [(phase, set(names)) for phase, names in map(json.loads, file.read_text().splitlines())]
            known = set().union(*(names for phase, names in runs if phase == IDLE))
            carrying = set().union(*(names for phase, names in runs if phase == BUSY and names - known))
            if carrying:
                found[file.stem] = sorted({name.split(":")[0] for name in carrying})
        return found


@contextlib.contextmanager
def _vrs(watch: Watch, *words: str) -> Iterator[subprocess.Popen[str]]:
    command, environment = module_process("interfaces.cli", *words)
    environment["VRS_ENTERED"] = str(watch.folder)
    environment["PYTHONPATH"] = os.pathsep.join((str(TRACING), environment["PYTHONPATH"]))
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=watch.folder
    ) as process:
        try:
            yield process
        finally:
            process.terminate()


def _said(process: subprocess.Popen[str], word: str) -> str:
    """The first line with a word in it that a process prints."""
    assert process.stdout is not None
    return next(line for line in process.stdout if word in line)


@contextlib.contextmanager
def _looking(url: str) -> Iterator[None]:
    """A browser's socket that says hello, without a token, and reads all that comes."""
    with connect(url, max_size=None) as socket:
        socket.send("{}")
        reader = Thread(target=lambda: [None for _ in socket], daemon=True)
        reader.start()
        yield


def _type(console: IO[str] | None, line: str) -> None:
    assert console is not None
    console.write(f"{line}\n")
    console.flush()


def _moves(looking: Connection, rest: Array) -> None:
    """Wait until the real robot moves away from where it rests.

    Raises:
        TimeoutError: If it doesn't in 10 s.
    """
    until = time.monotonic() + 10.0
    while looking.state is None or abs(looking.state.q - rest).max() < MOVED:
        if time.monotonic() > until:
            raise TimeoutError("the real robot doesn't move")
        time.sleep(0.01)


def _starting(stack: contextlib.ExitStack, *options: str) -> tuple[Watch, str]:
    """Serve an arm whose robot is a site of its own, watched: where clients come."""
    watch = Watch(Path(stack.enter_context(tempfile.TemporaryDirectory())))
    robot = stack.enter_context(_vrs(watch, "robot", "--listen", "127.0.0.1:0"))
    at = re.search(r"127\.0\.0\.1:\d+", _said(robot, "127.0.0.1:"))
    assert at is not None
    served = ("serve", "--port", "0", "--robot-at", at[0], "--link-loss", "hold", *options)
    server = stack.enter_context(_vrs(watch, *served))
    address = re.search(r"http://(127\.0\.0\.1:\d+)", _said(server, "serving"))
    assert address is not None
    return watch, address[1]


def command() -> dict[str, list[str]]:
    """Modules of a command typed at a remote console until the real robot moves by it."""
    with contextlib.ExitStack() as stack:
        watch, address = _starting(stack)
        console = stack.enter_context(_vrs(watch, "console", "--connect", f"ws://{address}"))
        looking = stack.enter_context(vrs.connect(f"ws://{address}"))
        for angle in (3, -3):
            _type(console.stdin, f"DO DRIVE 1,{angle},100")
            time.sleep(SETTLED)
        with watch.phase(IDLE):
            time.sleep(REST)
        assert looking.state is not None
        rest = looking.state.q
        with watch.phase(BUSY):
            _type(console.stdin, "DO DRIVE 1,3,100")
            _moves(looking, rest)
        return watch.modules()


def pose(delay: float = 2.0) -> dict[str, list[str]]:
    """Modules of a measured pose until a browser's socket has it.

    The link's delay sets the twins apart: the virtual robot is at rest again when the real one begins to move.

    Args:
        delay: Of the link, each way [s].
    """
    with contextlib.ExitStack() as stack:
        watch, address = _starting(stack, "--delay", f"constant:{delay:g}")
        console = stack.enter_context(_vrs(watch, "console", "--connect", f"ws://{address}"))
        stack.enter_context(_looking(f"ws://{address}/meshcat"))
        looking = stack.enter_context(vrs.connect(f"ws://{address}"))
        time.sleep(2 * delay)
        for angle in (3, -3):
            _type(console.stdin, f"DO DRIVE 1,{angle},100")
            time.sleep(SETTLED + 2 * delay)
        with watch.phase(IDLE):
            time.sleep(REST)
        assert looking.state is not None
        rest = looking.state.q
        _type(console.stdin, "DO DRIVE 1,3,100")
        time.sleep(0.75 * delay)
        with watch.phase(BUSY):
            _moves(looking, rest)
            time.sleep(SETTLED)
        return watch.modules()


def recording() -> dict[str, list[str]]:
    """Modules of a recording that plays, from the file until the page's sockets have it."""
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        demo, environment = module_process("interfaces.cli", "demo", "--out", str(folder))
        subprocess.run(demo, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        watch = Watch(Path(stack.enter_context(tempfile.TemporaryDirectory())))
        player = stack.enter_context(_vrs(watch, "replay", str(folder / "run.mcap"), "--port", "0"))
        address = re.search(r"http://(127\.0\.0\.1:\d+)", _said(player, "http://"))
        assert address is not None
        with watch.phase(IDLE):
            time.sleep(REST)
        with watch.phase(BUSY):
            for socket in ("board", "scene/0"):
                stack.enter_context(_looking(f"ws://{address[1]}/replay/{socket}"))
            time.sleep(SETTLED)
        return watch.modules()


def main() -> None:
    """Print them."""
    for name, way in (("command", command), ("pose", pose), ("recording", recording)):
        found = way()
        entered = set().union(*map(set, found.values()))
        print(f"{name}: {len(entered)} modules, asked at most {ASKED[name]}")
        for process, modules in found.items():
            print(f"  {process}: {len(modules)}")
            for module in modules:
                print(f"    {module}")


if __name__ == "__main__":
    main()
