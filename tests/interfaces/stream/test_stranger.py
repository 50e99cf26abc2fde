"""A client written from docs/protocol.md alone, with a WebSocket and a msgpack library."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from typing import Any

import pytest
import umsgpack
from websockets.sync.client import connect

from tests.interfaces.stream.served import served


class Stranger:
    """Commands, steers, views and rewinds."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.send(type="hello", protocol=1, role="operator", name="Ada")
        self.segments: list[list[Any]] = []
        self.edit = self.orders = self.asked = 0
        self.epoch: str | None = None
        self.seen: list[dict[str, Any]] = []
        self.welcome = self.until(lambda message: message["type"] == "welcome")
        self.dof = self.welcome["dof"]

    def send(self, **message: Any) -> None:
        self.socket.send(umsgpack.packb(message))

    def until(self, wanted: Callable[[dict[str, Any]], Any], seconds: float = 10.0) -> dict[str, Any]:
        end = time.monotonic() + seconds
        while True:
            message = umsgpack.unpackb(self.socket.recv(timeout=end - time.monotonic()))
            self.take(message)
            if wanted(message):
                return message

    def take(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind != "pulse":
            self.seen.append(message)
        if kind == "scene" and "rate" not in message:
            self.scene, self.segments, self.edit = message, [], message["edit"]
            self.send(type="want", edit=self.edit, index=0) if message["segments"] else None
        elif kind == "history" and message["index"] == len(self.segments):
            self.segments += self.read(message)
            if len(self.segments) == self.scene["segments"]:
                self.send(type="want", edit=self.edit)
            elif len(self.segments) % 256 == 0:
                self.send(type="want", edit=self.edit, index=len(self.segments))
        elif kind == "change" and message.get("base", message["edit"] - 1) == self.edit:
            self.change(message)

    def read(self, message: dict[str, Any]) -> list[list[Any]]:
        found, start = [], message.get("start", 0.0)
        for duration, _, packed, *own in message.get("segments", []):
            start = own[0] if own else start
            rows = [packed[i : i + 8 * self.dof] for i in range(0, len(packed), 8 * self.dof)]
            found.append([start, duration, [struct.unpack(f"<{self.dof}d", row) for row in rows]])
            start += duration
        return found

    def change(self, message: dict[str, Any]) -> None:
        old, tail = self.segments, message.get("tail")
        self.segments = old[: message["first"]] + self.read(message)
        if tail is not None:
            shift = message.get("tail_start", message["end"]) - old[tail][0]
            self.segments += [[start + shift, *rest] for start, *rest in old[tail:]]
        end = self.segments[-1][0] + self.segments[-1][1]
        assert end == pytest.approx(message["end"], abs=1e-9)
        self.edit = message["edit"]

    def joints(self, t: float) -> list[float]:
        held = [segment for segment in self.segments if segment[0] <= t]
        if not held:
            return list(self.scene["initial"])
        start, duration, rows = held[-1]
        u = min(t - start, duration)
        value = [0.0] * self.dof
        for row in reversed(rows):
            value = [v * u + a for v, a in zip(value, row, strict=True)]
        return value

    def acquire(self) -> None:
        self.send(type="acquire", number=1)
        lease = self.until(lambda message: message["type"] == "lease" and message.get("answers") == 1)
        assert lease["yours"]
        assert lease["state"] == "held"
        self.epoch = lease["epoch"]

    def order(self, **command: Any) -> dict[str, Any]:
        self.orders += 1
        number = self.orders
        self.send(type="order", number=number, epoch=self.epoch, command=command)
        return self.until(lambda message: message["type"] == "outcome" and message["number"] == number)

    def ask(self, t: float | None) -> dict[str, Any]:
        self.asked += 1
        self.send(type="ask", number=self.asked, t=t)
        return self.until(lambda message: message["type"] == "answer" and message["number"] == self.asked)

    def now(self) -> float:
        self.send(type="ping", number=1, t=time.monotonic())
        pong = self.until(lambda message: message["type"] == "pong")
        return pong["answered"]


@pytest.fixture
def stranger() -> Any:
    with (
        served() as serving,
        connect(f"ws://127.0.0.1:{serving.port}/ws", subprotocols=["vrs.1.msgpack"]) as socket,
    ):
        yield Stranger(socket)


def test_it_commands_steers_views_and_rewinds(stranger: Stranger) -> None:
    home = stranger.ask(None)["q"]
    refused = stranger.order(type="stop")
    assert refused["refusal"].startswith("no lease")
    stranger.acquire()

    stranger.send(type="follow", number=100, form="segments")
    stranger.until(lambda message: message["type"] == "scene")
    target = [q + 0.2 for q in home]
    receipt = stranger.order(type="move", target={"type": "joints", "q": target}, speed=1.0)["receipt"]
    assert receipt["status"] == "accepted"
    stranger.until(lambda message: message["type"] == "pulse" and message["edit"] == stranger.edit > 0)
    begin, end = receipt["execute_at"], receipt["end"]
    assert stranger.joints(end) == pytest.approx(target, abs=1e-9)
    times = [begin + (end - begin) * share for share in (0.1, 0.35, 0.6, 0.9)]
    foreseen = [stranger.joints(t) for t in times]

    stranger.until(lambda message: message["type"] == "pulse" and message.get("past", message["now"]) > end)
    for _ in range(5):
        outcome = stranger.order(type="steer", rates=[0.3] + [0.0] * 5, issued_at=stranger.now())
        assert outcome["receipt"]["status"] != "rejected"
    stranger.until(lambda message: message["type"] == "pulse" and message["now"] > stranger.segments[-1][0] + 1.0)
    assert stranger.joints(1e6)[0] > target[0] + 0.01

    for t, q in zip(times, foreseen, strict=True):
        answer = stranger.ask(t)
        assert answer["status"] == "confirmed"
        assert answer["q"] == pytest.approx(q, abs=1e-9)
        assert stranger.joints(t) == pytest.approx(q, abs=1e-12)

    rates = stranger.welcome["rates"]
    stranger.send(type="follow", number=101, form="frames", rate=rates[0])
    frames = [stranger.until(lambda message: message["type"] == "broadcast") for _ in range(10)]
    assert frames[-1]["number"] > frames[0]["number"]
    assert frames[-1]["q"] == pytest.approx(stranger.joints(1e6), abs=1e-9)

    stranger.send(type="release", number=2, epoch=stranger.epoch)
    stranger.until(lambda message: message["type"] == "lease" and message.get("answers") == 2)
    assert stranger.order(type="stop")["refusal"].startswith("no lease")


def test_what_it_does_wrong_it_is_told(stranger: Stranger) -> None:
    for message, code in (
        ({"type": "warp"}, "unknown-type"),
        ({"type": "welcome"}, "not-allowed"),
        ({"type": "ask", "number": 0}, "out-of-range"),
        ({"type": "take-over", "number": 5}, "lease"),
        ({"type": "release", "number": 6, "epoch": "1"}, "stale-epoch"),
    ):
        stranger.send(**message)
        problem = stranger.until(lambda message: message["type"] == "problem")
        assert (problem["code"], problem.get("fatal", False)) == (code, False)
    assert stranger.ask(None)["q"]


def test_an_edit_of_a_long_plan_comes_as_a_history(stranger: Stranger) -> None:
    home = stranger.ask(None)["q"]
    stranger.acquire()
    stranger.send(type="follow", number=100, form="segments")
    for k in range(80):
        q = [joint + 0.1 * (k % 2) for joint in home]
        receipt = stranger.order(type="move", target={"type": "joints", "q": q}, insertion="append")["receipt"]
        assert receipt["status"] != "rejected"
    stranger.seen.clear()
    assert stranger.order(type="scale", factor=0.5)["receipt"]["status"] != "rejected"
    stranger.until(
        lambda message: message["type"] == "pulse" and len(stranger.segments) == stranger.scene["segments"]
    )
    assert "scene" in {message["type"] for message in stranger.seen}
    assert all(len(message["segments"]) < 10 for message in stranger.seen if message["type"] == "change")
    assert len(stranger.segments) > 128
    t = stranger.now() + 2.0
    assert stranger.ask(t)["q"] == pytest.approx(stranger.joints(t), abs=1e-9)
