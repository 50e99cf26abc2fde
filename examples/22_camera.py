"""The camera in the IPR's head follows somebody who walks by, as far as its axes can; pictures.png shows it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from PIL import Image

from robots import load
from robots.mobile.camera import PanTilt, Sight
from robots.robot import HeadCamera
from robots.rooms import read_room

room = read_room("""room 1
name A hall
size 8 6
start 1 3 0
wall 0 0  8 0
wall 8 0  8 6
wall 8 6  0 6
wall 0 6  0 0
box 6.5 3  0.6 1.6 height=0.9
person 0.25  0,3,0.5  6,3,5.5
""")
x, y, heading = room.start
camera = load("ipr").device(HeadCamera)
assert camera is not None
axes, sight = PanTilt(), Sight(room, camera)
pictures, errors = [], []
for k in range(60):
    t = 0.1 * k
    px, py = room.people[0].at(t)
    wanted = math.atan2(py - y, px - x - camera.neck[0]) - heading
    axes.aim(wanted, 0.0, now=t)
    errors.append(math.degrees(abs(wanted - axes.look(t).pan)))
    if k % 15 == 14:
        pictures.append(sight.draw(room.start, axes.look(t), t))

Image.fromarray(np.hstack(pictures)).save(Path("pictures.png"))
print(f"the camera began {max(errors):.0f} deg away, and was {np.median(errors):.1f} deg behind on the way")
cloth = [float((picture[..., 2] > 1.3 * picture[..., 0]).mean()) for picture in pictures]
print("share of each picture that is who walks by:", ", ".join(f"{100 * share:.1f} %" for share in cloth))
