"""A robot without a brain: its model as a file, code generated from that, and a body that the code drives."""

from __future__ import annotations

import importlib
import secrets
import sys
import tempfile
from pathlib import Path

from interfaces.rsp.creator import write_package
from interfaces.rsp.host import RspHost
from interfaces.rsp.local import LocalCore
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model import example, parse_model, write_model
from interfaces.rsp.robot import RobotCore
from robots.cubo.body import MOVES, CuboBody
from vrs import ManualClock

model = parse_model(write_model(example("rover")))
with tempfile.TemporaryDirectory() as directory:
    write_package(model, Path(directory))
    sys.path.insert(0, directory)
    rover = importlib.import_module("rover")

clock = ManualClock()
core = LocalCore(rover.MODEL, secrets.token_bytes)
robot = rover.Rover(Middleware(core, clock))
core.open(now=0.0)
with CuboBody() as body:
    host = RspHost(RobotCore(rover.MODEL, secrets.token_bytes), body, frozenset(MOVES))
    robot.sensing.set_active(True)
    robot.left_wheel.write(0, 150)
    robot.right_wheel.write(0, 200)
    sent = received = 0
    answers: list[bytes] = []
    while clock.now() < 3.0:
        now = clock.advance(0.005)
        for data in robot.middleware.advance(answers, now=now):
            sent, received = sent + len(data), received + 1
            host.core.receive(data, b"local", now=now)
        host.advance(now=now)
        answers = [data for data, _ in host.core.to_send(now=now)]
    x, y, theta = (0.001 * value for value in robot.position.read_all())
    print(f"after {now:.0f} s the simulacrum has it at ({x:.2f}, {y:.2f}) m, {theta:.2f} rad")
    print(f"it is at ({body.truth[0]:.2f}, {body.truth[1]:.2f}) m, {body.truth[2]:.2f} rad")
    print(f"{received} packets of {sent / received:.0f} bytes on average drove it there")
