"""What RSP costs: packets of CUBO through the codec and through both cores, open and sealed; its body."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from interfaces.lab.kim2006.following import cubo_model
from interfaces.rsp import header
from interfaces.rsp.header import Header, PacketType
from interfaces.rsp.layout import Layout, PacketDirection
from interfaces.rsp.local import LocalConfig, LocalCore, LocalState, PeriodConfig
from interfaces.rsp.robot import RobotCore
from interfaces.rsp.session import Keyring, Rank
from robots.cubo.body import CuboBody

if TYPE_CHECKING:
    from benchmarks.results import Part

BLOCK = 5000
"""Packets a block."""
ROUNDS = 15


def coded() -> Callable[[], object]:
    """Encode and decode a packet with both arms and the lip, 34 bytes."""
    model = cubo_model()
    layout = Layout(model)
    payloads = {
        model.index("left_arm"): b"arms",
        model.index("right_arm"): b"arms",
        model.index("lip"): b"lip",
    }
    head = Header(model.id, False, PacketType.DOWN, 5, 1000, 1 << 40, 3, 0)

    def once() -> None:
        data = header.encode(head) + layout.join(payloads)
        header.decode(data)
        layout.split(data[header.SIZE :], PacketDirection.DOWN)

    return once


def exchanged(*, sealed: bool) -> Callable[[], object]:
    """A period of a session: a packet down, taken in and carried out, and one up; both cores in this process."""
    model, now = cubo_model(), [0.0]
    keys = Keyring({Rank.OPERATOR: b"k" * 32}) if sealed else None
    random = iter(range(1, 1 << 30))

    def random_bytes(count: int) -> bytes:
        return next(random).to_bytes(count, "big")

    config = LocalConfig(period=PeriodConfig(adaptive=False))
    local = LocalCore(model, random_bytes, config, keys=keys)
    robot = RobotCore(model, random_bytes, keys=keys)
    wheel, position = model.index("left_wheel"), model.index("position")

    def once() -> None:
        now[0] = t = now[0] + 0.02
        local.write(wheel, (int(t * 50) % 400).to_bytes(2, "big"))
        robot.measure(position, int(t * 50).to_bytes(12, "big"))
        for data in local.to_send(now=t):
            robot.receive(data, b"local", now=t)
        robot.effectors(now=t)
        for data, _ in robot.to_send(now=t):
            local.receive(data, now=t)
        local.take()
        robot.take()

    local.open(now=0.0)
    local.request(position, True)
    while local.state is not LocalState.OPEN:
        once()
    return once


def cost(action: Callable[[], object], block: int = BLOCK) -> list[float]:
    """Processor time of a call [µs], by blocks."""
    found = []
    for _ in range(ROUNDS):
        start = time.process_time()
        for _ in range(block):
            action()
        found.append(1e6 * (time.process_time() - start) / block)
    return found


def part() -> Part:
    """Measure."""
    from benchmarks.results import Bar, Cost, Part, Result

    codec = statistics.median(cost(coded()))
    results = [
        Result(
            "encode and decode a packet of 34 bytes",
            Cost(codec),
            bar=Bar(median=10.0),
            note=f"{1e6 / codec:,.0f} packets a second",
        )
    ]
    for name, sealed in (("open", False), ("sealed", True)):
        found = statistics.median(cost(exchanged(sealed=sealed), 1000))
        results.append(Result(f"a period of both cores, a packet each way, {name}", Cost(found)))
    with CuboBody(room="furnished") as body:
        body.move("wheels", (0.1, 0.12))
        found = statistics.median(cost(lambda: body.go_on(5), 100)) / (5 * body.step)
    results.append(
        Result("a second of CUBO in PyBullet, furnished room", Cost(found), note=f"{1e6 / found:.0f} × real time")
    )
    text = (
        f"Processor time on one core, medians of {ROUNDS} blocks. Encode and decode: header, device map, payloads."
    )
    return Part("RSP", text, tuple(results))
