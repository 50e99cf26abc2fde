"""Hardware in three methods: six servos on a serial bus, which is simulated behind a pseudo-terminal.

Live: vrs serve --body examples.28_servo_bus:Bus. Whether it does what one must: vrs check --driver, and that name.
"""

from __future__ import annotations

import os
import random
import select
import struct
import threading
import time
from collections.abc import Sequence

from robots import puma560
from robots.driver import DriverDescriptor

HOME = puma560.model().poses["nominal"].tolist()
ANSWER = struct.Struct("<6fB")
"""Six angles [rad], and the sum of their bytes."""
ORDER = struct.Struct("<c6fB")
"""The same after `r` or `w`."""


def summed(data: bytes) -> bytes:
    """Bytes with their sum after them."""
    return data + bytes((sum(data) % 256,))


def servos(wire: int, late: float, lost: float, stuck: int | None) -> None:
    """Six servos that turn at 3 rad/s at most; they answer late, some answers are lost, one servo may be stuck."""
    rng, angles, targets, then = random.Random(0), list(HOME), list(HOME), time.monotonic()  # noqa: S311
    while data := os.read(wire, ORDER.size):
        step, then = 3.0 * (time.monotonic() - then), time.monotonic()
        for j, (at, to) in enumerate(zip(angles, targets, strict=True)):
            angles[j] = at if j == stuck else at + min(max(to - at, -step), step)
        kind, *values, _ = ORDER.unpack(data)
        targets = values if kind == b"w" else targets
        time.sleep(late * rng.random())
        if rng.random() >= lost:
            os.write(wire, summed(struct.pack("<6f", *angles)))


class Bus:
    """The driver: `read_joints` and `write_joints` send an order and wait for its answer."""

    def __init__(self, late: float = 0.004, lost: float = 0.02, stuck: int | None = None) -> None:
        import tty

        wire, self._port = os.openpty()
        tty.setraw(self._port)
        tty.setraw(wire)
        threading.Thread(target=servos, args=(wire, late, lost, stuck), daemon=True).start()

    def descriptor(self) -> DriverDescriptor:
        """Six joints, fifty times a second."""
        return DriverDescriptor(("waist", "shoulder", "elbow", "roll", "bend", "flange"), rate=50.0)

    def read_joints(self) -> Sequence[float]:
        """Ask where they are."""
        return self._ask(b"r", [0.0] * 6)

    def write_joints(self, q: Sequence[float]) -> None:
        """Tell them where to go."""
        self._ask(b"w", q)

    def _ask(self, kind: bytes, q: Sequence[float]) -> Sequence[float]:
        while select.select([self._port], [], [], 0.0)[0]:
            os.read(self._port, 4096)
        os.write(self._port, summed(kind + struct.pack("<6f", *q)))
        if not select.select([self._port], [], [], 0.02)[0]:
            raise TimeoutError("the bus doesn't answer")
        data = os.read(self._port, ANSWER.size)
        if len(data) < ANSWER.size or summed(data[:-1]) != data:
            raise OSError("an answer was damaged")
        return ANSWER.unpack(data)[:6]


if __name__ == "__main__":
    bus, goal = Bus(), [angle + 0.2 for angle in HOME]
    lost = 0
    for _ in range(100):
        try:
            bus.write_joints(goal)
            there = bus.read_joints()
        except OSError:
            lost += 1
    print(f"{lost} of 100 orders failed; the waist is at {there[0]:.3f} rad, and was to be at {goal[0]:.3f}")
    print("try: vrs serve --body examples.28_servo_bus:Bus")
