"""The mobile robot live, driven by a program: a WebSocket, JSON, and docs/protocol.md are all that it takes."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

from websockets.sync.client import connect

# The same as `vrs serve --robot ipr` in a shell. On a busy machine messages may be late: the robot waits for them.
command = [sys.executable, "-m", "interfaces.cli", "serve", "--robot", "ipr", "--port", "0", "--link-loss", "hold"]
server = subprocess.Popen([*command, "--delay", "constant:0.1"], stdout=subprocess.PIPE, text=True)
assert server.stdout is not None
page = next(word for word in server.stdout.readline().split() if word.startswith("http"))
told: dict[str, Any] = {}
"""The newest message of each type."""


def listen(until: Callable[[], bool]) -> None:
    """Take what the server says until something holds."""
    end = time.monotonic() + 30.0
    while not until() and time.monotonic() < end:
        message = json.loads(socket.recv(timeout=10.0))
        told[message["type"]] = message


def robots() -> dict[str, Any]:
    """Where both robots are."""
    found: dict[str, Any] = told.get("postures", {})
    return found


address = page.replace("http", "ws", 1).replace("/view", "/ws")
try:
    with connect(address, subprotocols=["vrs.1.json"]) as socket:  # type: ignore[list-item]
        socket.send(json.dumps({"type": "hello", "protocol": 1, "role": "operator", "name": "example"}))
        listen(lambda: "real" in robots())
        print("at most", told["mobile-welcome"]["limits"]["v_max"], "m/s")
        socket.send(json.dumps({"type": "acquire", "number": 1}))
        listen(lambda: not robots().get("halted") and "epoch" in told.get("lease", {}))
        start = robots()["real"]
        for number in range(1, 41):
            wish = {"type": "drive", "v": 0.3, "w": 0.2, "duration": 0.3}
            order = {"type": "order", "number": number, "epoch": told["lease"]["epoch"], "command": wish}
            socket.send(json.dumps(order))
            newest = robots().get("number")
            listen(lambda newest=newest: robots().get("number") != newest)
        print(f"the real robot is {robots()['time_difference']:.1f} s behind")
        # Nobody wishes any more: both come to rest.
        listen(lambda: robots()["command"] == [0, 0] and robots()["time_difference"] == 0)
        apart = [a - b for a, b in zip(robots()["virtual"], robots()["real"], strict=True)]
        print("it went on:", robots()["real"][0] > start[0] + 0.1)
        print("twins apart by less than 5 cm:", max(map(abs, apart[:2])) < 0.05)
finally:
    server.terminate()
    server.wait()
