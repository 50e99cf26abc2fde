"""A supervisor and three viewers, a quarter of a second from the robot: predicted, scrubbed back, late to come."""

from __future__ import annotations

import numpy as np

from interfaces import Supervisor, Viewer
from interfaces.clients.ports import MemoryTransport, RemotePort
from interfaces.engine_server.site import Site
from interfaces.link import Channel, Conditions, ConstantDelay
from interfaces.messages import FrameStatus, ViewForm
from interfaces.runtime.laboratory import run_parts
from robots import puma560
from vrs import Engine, JointTarget, ManualClock, MotionCommand

D_F, D_B = 0.15, 0.10
rng = np.random.default_rng(7)
model = puma560.model()
home = model.poses["nominal"]
site = Site(Engine(model, q=home, clock=ManualClock(-D_F)), D=-D_F)
site.broadcast(25, lead=D_F + D_B)
parts = [site]


def connect() -> RemotePort:
    """Join one more client to the site."""
    there, back = Conditions(delay=ConstantDelay("there", D_F)), Conditions(delay=ConstantDelay("back", D_B))
    transport = MemoryTransport(site, Channel(there, rng), Channel(back, rng))
    parts.append(transport)
    return transport.port


supervisor = Supervisor(connect())
live = Viewer(connect(), rate=25, form=ViewForm.FRAMES)
other = Viewer(connect(), rate=50)
parts += [supervisor, live, other]
now = 0.0
for k in range(12):
    target = JointTarget(home + rng.uniform(-0.4, 0.4, 6))
    supervisor.issue(MotionCommand(target, speed=0.3), now=now, execute_in=0.05)
    now = run_parts(parts, now=now, until=now + 0.5)
    if k == 7:
        other.seek(1.0, now=now)
        other.play(now=now, rate=0.5)

late = max(issued.late for issued in supervisor.designer.history)
shown = live.history[-1]
print(f"D = {-D_F} s: commands late by {late:.3f} s at most")
print(f"predicted frames: {shown.age:.3f} s old, {100 * (live.share_falsified or 0):.0f} % of them falsified")
false = [frame for frame in live.history if frame.status is FrameStatus.FALSIFIED]
print(f"the first: t = {false[0].t:.2f} s, falsified by command {false[0].falsified_by}")
print(f"who scrubbed back is {other.mode} at {other.history[-1].t:.2f} s, while the robot is at {now - D_F:.2f} s")

joiner = Viewer(connect(), rate=50)
parts.append(joiner)
now = run_parts(parts, now=now, until=now + 1.0)
print(f"a late joiner has {len(joiner.timeline or ())} of {len(site.engine.timeline)} segments")
begin, done = now, other.go_live(now=now)
now = run_parts(parts, now=now, until=done + 0.04)
print(f"live again after {done - begin:.2f} s: {other.mode}, {other.history[-1].age:.2f} s old")
