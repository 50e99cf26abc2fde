"""A body behind a core: what it's let do and when, what is measured, and what a late host leaves out."""

from __future__ import annotations

from collections import deque
from random import Random

import pytest

from interfaces.rsp.devices import SensorDevice
from interfaces.rsp.errors import DeadlineError
from interfaces.rsp.host import MOST_BEHIND, RspHost, packed
from interfaces.rsp.local import LocalCore, LocalState
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model import Effector, Event, MemoryEvent, OnLoss, RobotModel, Sensor
from interfaces.rsp.robot import RobotCore
from vrs.clock import ManualClock

WHEEL, LAMP, SPEAKER, RANGE, NONE, BUMPER, PICTURE = range(7)
MODEL = RobotModel(
    "stub",
    1,
    (
        Effector("wheel", scale=0.001, binding="wheel", on_loss=OnLoss.REST),
        Effector("lamp", binding="lamp"),
        Effector("speaker", stream=10),
        Sensor("range", type="u16", scale=0.01, binding="range"),
        Sensor("none", count=2),
        Event("bumper", scale=0.5, binding="bumper"),
        MemoryEvent("picture", size=20, binding="camera"),
    ),
)


class Stub:
    """Notes what it's let do."""

    step = 0.004

    def __init__(self) -> None:
        self.moved: list[tuple[str, tuple[float, ...]]] = []
        self.heard: list[bytes | None] = []
        self.happened: list[str] = []
        self.remembered: list[tuple[str, bytes]] = []
        self.resting, self.range, self.steps = True, 1.234, 0

    def move(self, binding: str, values: tuple[float, ...]) -> None:
        self.moved.append((binding, values))

    def carry_out(self, binding: str, values: tuple[float, ...]) -> None:
        raise AssertionError

    def sound(self, data: bytes | None) -> None:
        self.heard.append(data)

    def measure(self, binding: str) -> tuple[float, ...] | None:
        return (self.range,) if binding == "range" else None

    def events(self) -> list[str]:
        found, self.happened = self.happened, []
        return found

    def memories(self) -> list[tuple[str, bytes]]:
        found, self.remembered = self.remembered, []
        return found

    def go_on(self, steps: int = 1) -> None:
        self.steps += steps


class Site:
    """A host of the stub, and local systems at addresses, at which the robot's packets arrive 50 ms later."""

    def __init__(self) -> None:
        self.random, self.clock, self.body = Random(1), ManualClock(), Stub()
        self.host = RspHost(RobotCore(MODEL, self.random.randbytes), self.body, frozenset({"wheel"}))
        self.locals: dict[bytes, Middleware] = {}
        self.flight: deque[list[tuple[bytes, bytes]]] = deque([[]] * 5)

    def local(self, name: bytes, *, takeover: bool = False) -> Middleware:
        core = LocalCore(MODEL, self.random.randbytes)
        core.open(now=self.clock.now(), takeover=takeover)
        self.locals[name] = Middleware(core, self.clock)
        self.run(0.15)
        assert core.state is LocalState.OPEN
        return self.locals[name]

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            now = self.clock.advance(0.01)
            came = self.flight.popleft()
            for name, local in self.locals.items():
                mine = [data for data, to in came if to == name]
                for data in local.advance(mine, now=now):
                    self.host.core.receive(data, name, now=now)
            self.host.advance(now=now)
            self.flight.append(self.host.core.to_send(now=now))


@pytest.mark.parametrize(
    ("value", "raw"),
    [((1.234,), 123), ((1.236,), 124), ((-1.0,), 0), ((700.0,), 65_535), ((), 0), ((1.0, 2.0), 100)],
)
def test_a_sensors_value_is_rounded_and_kept_within_its_type(value: tuple[float, ...], raw: int) -> None:
    sensor = MODEL.elements[RANGE]
    assert isinstance(sensor, Sensor)
    assert packed(sensor, value) == raw.to_bytes(2, "big")


def test_effectors_move_in_their_unit_and_those_without_a_body_are_registers() -> None:
    site = Site()
    local = site.local(b"one")
    local.core.write(WHEEL, (250).to_bytes(2, "big"))
    local.core.write(LAMP, (7).to_bytes(2, "big"))
    site.run(0.2)
    assert site.body.moved == [("wheel", (0.25,))]
    assert site.host.core.motion.given(LAMP) == (7.0,)


def test_a_body_begins_with_the_effectors_initial_values() -> None:
    elements = (
        Effector("arm", count=2, scale=0.1, initial=5.0, binding="arm"),
        Effector("wheel", binding="wheel"),
        Effector("lamp", initial=1.0, binding="lamp"),
        Effector("speaker", initial=1.0, stream=9, binding="arm"),
    )
    body = Stub()
    RspHost(RobotCore(RobotModel("posed", 1, elements), bytes), body, frozenset({"arm", "wheel"}))
    assert body.moved == [("arm", (0.5, 0.5))]


def test_sensors_and_events_are_told_and_one_without_a_body_says_0() -> None:
    site = Site()
    local = site.local(b"one")
    for index in (RANGE, NONE, BUMPER):
        local.core.request(index, True)
    site.run(0.2)
    assert local.payload(RANGE) == (1, (123).to_bytes(2, "big"))
    assert local.payload(NONE) == (1, bytes(4))
    sensor = SensorDevice[int](local, "range")
    assert sensor.read_all() == (123,)
    with pytest.raises(DeadlineError):
        sensor.wait(0.01)
    # The robot repeats it until it's known to have come; what says the same is no news.
    site.body.range = 0.5
    site.body.happened.append("bumper")
    site.run(0.2)
    assert local.payload(RANGE) == (2, (50).to_bytes(2, "big"))
    assert local.came(BUMPER) == (2).to_bytes(2, "big")


def test_what_the_body_remembers_comes_once_and_what_has_no_place_or_receiver_is_left_out(
    caplog: pytest.LogCaptureFixture,
) -> None:
    site = Site()
    site.body.remembered.append(("camera", b"to nobody"))
    site.run(0.1)
    local = site.local(b"one")
    site.body.remembered += [("camera", b"one"), ("ear", b"unknown"), ("camera", b"x" * 21), ("camera", b"two")]
    site.run(1.0)
    assert [local.came(PICTURE) for _ in range(3)] == [b"one", b"two", None]
    assert "a memory event of picture is left out" in caplog.text


def test_the_body_keeps_to_the_time_and_plays_a_fragment_each_20_ms() -> None:
    site = Site()
    local = site.local(b"one")
    site.body.heard.clear()
    steps = site.body.steps
    local.core.play(SPEAKER, bytes(100))
    site.run(0.1)
    site.run(0.4)
    assert (site.body.steps - steps) * site.body.step == pytest.approx(0.5, abs=0.017)
    assert len(site.body.heard) == pytest.approx(25, abs=1)
    assert site.body.heard.count(bytes(10)) == 10


def test_a_late_host_makes_up_for_a_quarter_of_a_second_and_lets_the_rest_be() -> None:
    site = Site()
    site.local(b"one")
    site.body.heard.clear()
    steps = site.body.steps
    site.host.advance(now=site.clock.advance(60.0))
    assert (site.body.steps - steps) * site.body.step == pytest.approx(MOST_BEHIND, abs=0.017)
    assert len(site.body.heard) <= MOST_BEHIND / 0.02 + 2


def test_after_a_takeover_packets_count_once_the_body_rests() -> None:
    site = Site()
    first = site.local(b"one")
    first.core.write(WHEEL, (250).to_bytes(2, "big"))
    site.run(0.2)
    site.body.resting = False
    second = site.local(b"two", takeover=True)
    second.core.write(WHEEL, (100).to_bytes(2, "big"))
    site.run(0.3)
    assert site.body.moved == [("wheel", (0.25,)), ("wheel", (0.0,))]
    site.body.resting = True
    site.run(0.2)
    assert site.body.moved[2:] == [("wheel", (0.1,))]
