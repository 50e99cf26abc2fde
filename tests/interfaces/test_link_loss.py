"""Who decides what a robot does when the link is lost, and that what halts says what mends it."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterator
from typing import Any

import pytest
from websockets.sync.client import connect

from interfaces.messages.control import PROTOCOL, Hello, Role
from interfaces.stream.codec import Encoding, decode, encode
from interfaces.teleop import RobotSiteConfig
from robots.onboard.watchdog import LossPolicy, WatchdogConfig
from tests.interfaces.live_rig import Child, child
from tests.interfaces.teleop.rig import Rig
from tests.interfaces.test_host import Ends

SOON = 40.0


class Client:
    """A program that knows docs/protocol.md and a WebSocket."""

    def __init__(self, socket: Any) -> None:
        self.socket, self.state, self.orders = socket, {}, 0
        self.send(type="hello", protocol=1, role="operator", name="Ada")
        self.until(lambda m: m["type"] in {"welcome", "mobile-welcome"})
        self.send(type="acquire", number=1)
        self.epoch = self.until(lambda m: m["type"] == "lease" and m.get("yours"))["epoch"]
        self.beaten = 0.0

    def send(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def order(self, **command: Any) -> None:
        self.orders += 1
        self.send(type="order", number=self.orders, epoch=self.epoch, command=command)

    def until(self, wanted: Any, each: Any = lambda: None) -> dict[str, Any]:
        """Beat until a message comes that's wanted."""
        end = time.monotonic() + SOON
        while time.monotonic() < end:
            with contextlib.suppress(TimeoutError):
                message: dict[str, Any] = json.loads(self.socket.recv(timeout=0.1))
                if message["type"] in {"state", "postures"}:
                    self.state = message
                if wanted(message):
                    return message
            each()
            if hasattr(self, "epoch") and time.monotonic() > self.beaten + 0.4:
                self.beaten = time.monotonic()
                self.send(type="beat", epoch=self.epoch)
        raise AssertionError(self.state)


@contextlib.contextmanager
def sites(robot: tuple[str, ...], serve: tuple[str, ...]) -> Iterator[tuple[Child, Client]]:
    """Two commands, as in two terminals, and a client of the second."""
    with child("robot", *robot, "--listen", "127.0.0.1:0") as first:
        address = first.url.removeprefix("ws://").removesuffix("/site")
        with child("serve", *serve, "--port", "0", "--robot-at", address) as second:
            url = second.url.replace("http", "ws").replace("/view", "/ws")
            with connect(url, subprotocols=["vrs.1.json"]) as socket:  # type: ignore[list-item]
                yield first, Client(socket)


def follows(client: Client) -> None:
    client.until(lambda m: m["type"] in {"state", "postures"} and m.get("connected", True) and not m.get("halted"))


@pytest.mark.slow
def test_two_terminals_work_by_default_over_a_slow_link():
    with sites((), ("--delay", "tue")) as (robot, client):
        assert robot.wait(lambda facts: facts["operator"])["link_loss"] == "hold"
        follows(client)
        before = client.state["q"]
        target = [before[0] + 0.3, *before[1:]]
        client.order(type="move", target={"type": "joints", "q": target})
        client.until(lambda m: m["type"] == "state" and abs(m["q"][0] - target[0]) < 0.02)
        assert not client.state.get("halted")


def test_a_mobile_robots_two_terminals_work_by_default_too(tmp_path):
    serve = "--robot", "ipr", "--delay", "tue", "--camera", "0", "--jobs", str(tmp_path / "jobs.json")
    with sites(("--robot", "ipr"), serve) as (robot, client):
        assert robot.wait(lambda facts: facts["operator"])["link_loss"] == "hold"
        follows(client)
        x, y, _ = client.state["real"]

        def drive() -> None:
            client.order(type="drive", v=0.3, w=0.0, duration=0.3)

        client.until(
            lambda m: m["type"] == "postures" and abs(m["real"][0] - x) + abs(m["real"][1] - y) > 0.05, drive
        )


def test_a_robot_that_halts_names_what_mends_it():
    with sites(("--body", "exact"), ("--delay", "constant:0.7", "--link-loss", "halt")) as (robot, client):
        client.until(lambda m: m["type"] == "state" and "link loss" in m.get("halted", ""))
        assert "--link-loss hold" in client.state["halted"]
        facts = robot.health()
        assert facts["link_loss"] == "halt"
        assert "--link-loss hold" in facts["halted"]


def test_who_connects_decides_and_the_next_one_anew():
    ends = Ends(site=RobotSiteConfig(watchdog=WatchdogConfig(max_uncertainty=1.0)))
    own = ends.config.site.watchdog
    assert ends.host.watchdog(own) is own, "an older peer says nothing: the robot's own counts"
    ends.run(3.0)
    ends.run(2.5, operator=False)
    assert ends.host.hello("second", now=ends.robots(), link_loss=LossPolicy.HOLD) == ""
    assert ends.host.watchdog(own) is None
    ends.run(2.5, operator=False)
    assert ends.host.hello("third", now=ends.robots()) == ""
    assert ends.host.watchdog(own) is own
    assert ends.host.watchdog(None) is None, "one that holds by itself"
    ends.run(2.5, operator=False)
    assert ends.host.hello("fourth", now=ends.robots(), link_loss=LossPolicy.HALT) == ""
    assert ends.host.watchdog(None) == ends.config.halting


@pytest.mark.parametrize(("asked", "halts"), [(None, True), (LossPolicy.HOLD, False), (LossPolicy.HALT, True)])
def test_what_the_operator_asks_for_is_done(asked, halts):
    """The first operator only makes room for the one that asks."""
    ends = Ends(site=RobotSiteConfig(watchdog=WatchdogConfig(max_uncertainty=1.0)))
    ends.run(2.5, operator=False)
    ends.new_operator("second", asked)
    ends.run(5.0)
    ends.operator.resume(now=ends.now)
    ends.run(1.0)
    assert ends.host.site is not None
    assert not ends.host.site.halted
    ends.run(2.0, operator=False)
    assert bool(ends.host.site.halted) is halts
    if halts:
        assert "--link-loss hold" in ends.host.site.halted


def test_a_mobile_robot_that_halts_names_what_mends_it():
    rig = Rig("constant:0.7")
    rig.run(6.0)
    rig.operator.resume(now=rig.now)
    rig.run(4.0)
    assert "link loss" in rig.robot.halted
    assert "--link-loss hold" in rig.robot.halted
    assert "--max-age" in rig.robot.halted


def test_the_wish_is_optional_on_the_wire():
    for loss in (None, "hold"):
        hello = Hello(PROTOCOL, Role.SITE, "vrs serve", None, "life", link_loss=loss)
        for encoding in Encoding:
            assert decode(encode(hello, encoding), encoding, allowed=Hello) == hello
    plain = json.loads(encode(Hello(PROTOCOL, Role.SITE, "vrs serve", None, "life"), Encoding.JSON))
    assert "link_loss" not in plain


def test_a_policy_that_isnt_one_is_refused_in_a_line():
    with child("robot", "--body", "exact", "--listen", "127.0.0.1:0") as robot:
        with connect(robot.url, subprotocols=["vrs.1.json"]) as socket:  # type: ignore[list-item]
            hello = {"type": "hello", "protocol": 1, "role": "site", "name": "x", "session": "s"}
            socket.send(json.dumps({**hello, "link_loss": "pray"}))
            answer = json.loads(socket.recv(timeout=5.0))
        assert (answer["type"], answer["code"]) == ("problem", "out-of-range")
        assert "halt, hold" in answer["text"] or "halt or hold" in answer["text"]
        with connect(robot.url, subprotocols=["vrs.1.json"]) as socket:  # type: ignore[list-item]
            socket.send(json.dumps({**hello, "link_loss": "hold"}))
            assert json.loads(socket.recv(timeout=5.0))["link_loss"] == "hold"
