"""Both twins live, each in processes of its own: command the virtual robot, watch the real one follow."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np

from interfaces import connect
from robots import puma560
from vrs import Insertion, JointTarget, MotionCommand

model = puma560.model()
# The same as `vrs serve` in a shell; the ideal body follows without physics, which starts quicker.
command = [sys.executable, "-m", "interfaces.cli", "serve", "--port", "0", "--delay", "constant:0.05"]
# On a busy machine messages may be late: the robot waits for them, instead of halting until it's told to go on.
command += ["--body", "ideal", "--link-loss", "hold"]
server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
assert server.stdout is not None
page = next(word for word in server.stdout.readline().split() if word.startswith("http"))
print("the page to look at:", "/view" in page)

try:
    with connect(page.removesuffix("/view")) as robot:
        robot.acquire()
        robot.wait(lambda r: r.state is not None and not r.state.halted and r.state.connected, 20.0)
        for name in ("ready", "nominal"):
            move = MotionCommand(JointTarget(model.poses[name]), insertion=Insertion.APPEND)
            receipt = robot.designer.issue(move, wait=5.0).receipt
            assert receipt is not None
            print(f"to {name}: {receipt.status}")
        assert receipt.end is not None
        end = receipt.end
        # The real robot plays behind: the delay, and what it keeps to stop in.
        robot.wait(lambda r: r.state is not None and r.state.play >= end, 20.0)
        state = robot.state
        assert state is not None
        print(f"it plays {-state.D:.1f} s behind", state.halted)
        away = np.abs(state.q - model.poses["nominal"]).max()
        print("it is where it should be:", bool(away < 1e-3))
        time.sleep(0.1)
finally:
    server.terminate()
    server.wait(20.0)
    server.stdout.close()
