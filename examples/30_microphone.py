"""A telephone rings in the kitchen: what the robot's microphone gets of it on the way there; heard.wav plays it."""

from __future__ import annotations

import math
import wave
from itertools import pairwise

import numpy as np

from robots.mobile.microphone import Microphone, samples_of
from robots.mobile.robot import place

RATE, PERIOD, SPEED = 16_000, 0.1, 0.5

room = place("home")
microphone, phone = Microphone(room, height=0.7), room.sounds[0]
way = [(1.2, 5.4), (1.5, 4.2), (1.5, 2.8), (4.5, 1.65), (5.9, 1.65), (6.6, 1.4)]
where = ["in the study", "in its door", "in the living room", "by the kitchen's door", "through it", "by the table"]
lengths = [math.dist(a, b) for a, b in pairwise(way)]
reached = np.cumsum([0.0, *lengths]) / SPEED
xs, ys = zip(*way, strict=True)


def at(t: float) -> tuple[float, float, float]:
    """Where it is at a time [s], and that time: the doors move meanwhile."""
    return float(np.interp(t, reached, xs)), float(np.interp(t, reached, ys)), t


for name, t in zip(where, reached, strict=True):
    x, y, _ = at(t)
    distance = math.dist((x, y), (phone.x, phone.y))
    print(f"{name}: {distance:.1f} m from it, {microphone.level(x, y, t):.0f} dB")

pieces = []
for k in range(int(reached[-1] / PERIOD)):
    begin, end = k * PERIOD, (k + 1) * PERIOD
    times = begin + np.arange(1, round(RATE * PERIOD) + 1) / RATE
    pieces.append(microphone.hear(at(begin), at(end), times))
with wave.open("heard.wav", "wb") as file:
    file.setnchannels(1)
    file.setsampwidth(2)
    file.setframerate(RATE)
    file.writeframes(samples_of(np.concatenate(pieces)).tobytes())
