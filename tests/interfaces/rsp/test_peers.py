"""Ends and models of other people's: values at their limits, clocks that are set back, answers that get lost."""

from __future__ import annotations

import math
import struct
from random import Random

import pytest

from interfaces.rsp import handshake, header
from interfaces.rsp.devices import EffectorDevice
from interfaces.rsp.header import Header, PacketType
from interfaces.rsp.local import LocalCore, LocalState
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model import Command, Effector, Filling, MemoryCommand, MemoryEvent, OnLoss, RobotModel
from interfaces.rsp.outputs import Began, Commanded, SessionEnded, Stored
from interfaces.rsp.robot import RobotCore
from interfaces.rsp.session import DropReason, Rank
from tests.interfaces.rsp.joined import ADDRESS, KEYS, Network, Pair
from vrs.clock import ManualClock
from vrs.errors import InvalidValueError

ARM, WHEEL, TURN, LOG = 0, 1, 2, 3
MODEL = RobotModel(
    "strange",
    9,
    (
        Effector("arm", type="f32", low=-0.1, high=0.3),
        Effector("wheel", low=-400.0, high=400.0, on_loss=OnLoss.REST),
        Command("turn", type="f32"),
        MemoryEvent("log", size=5),
    ),
)


def joined(**network: float) -> Pair:
    return Pair(MODEL, Network(Random(1), **network)).opened()


@pytest.mark.parametrize("value", [-0.1, 0.3])
def test_an_f32_effector_takes_its_own_limits(value: float) -> None:
    pair = joined()
    EffectorDevice[float](Middleware(pair.local, ManualClock()), "arm").write(0, value)
    pair.run(0.3)
    pair.robot.effectors(now=pair.now)
    assert pair.robot.motion.given(ARM) == pytest.approx((value,))
    assert not any(pair.robot.dropped.values())


@pytest.mark.parametrize("beyond", [-0.10001, 0.30001, math.nan, math.inf])
def test_an_f32_effector_takes_nothing_beyond_them(beyond: float) -> None:
    pair = joined()
    pair.local.write(ARM, struct.pack("!f", beyond))
    pair.run(0.3)
    assert pair.robot.effectors(now=pair.now) == {}
    assert pair.robot.dropped[DropReason.MALFORMED] > 5


@pytest.mark.parametrize(("value", "done"), [(0.5, True), (math.nan, False), (-math.inf, False)])
def test_a_command_whose_values_arent_finite_isnt_carried_out(value: float, done: bool) -> None:
    pair = joined()
    pair.local.command(TURN, struct.pack("!f", value))
    pair.run(0.3)
    assert any(isinstance(output, Commanded) for output in pair.did) is done
    assert (pair.robot.dropped[DropReason.MALFORMED] == 0) is done


@pytest.mark.parametrize("filling", Filling)
def test_a_sender_whose_clock_is_set_back_is_followed_all_the_same(filling: Filling) -> None:
    from interfaces.rsp.motion_filter import MotionFilter

    played = MotionFilter(RobotModel("one", 1, (Effector("wheel", filling=filling),)))
    for k in range(3000):
        now = 0.02 * k
        played.receive(5000.0 + now - (3600.0 if k >= 100 else 0.0), {0: (1.0,)} if k == 0 else {}, now=now)
        played.play(now)
    # A single value, as it's sent when nothing else changes.
    played.receive(5000.0 - 3600.0 + 60.0, {0: (0.0,)}, now=60.0)
    played.play(60.1)
    assert played.given(0) == (0.0,)


def test_who_stopped_during_a_loss_isnt_driven_on_for_a_moment() -> None:
    pair = joined()
    pair.local.write(WHEEL, struct.pack("!h", 300))
    pair.run(0.3)
    assert pair.robot.effectors(now=pair.now)[WHEEL] == (300.0,)
    pair.network.closed = True
    pair.run(0.6)
    assert pair.robot.effectors(now=pair.now)[WHEEL] == (0.0,)
    pair.local.write(WHEEL, struct.pack("!h", 0))
    pair.network.closed = False
    for _ in range(40):
        pair.step()
        assert WHEEL not in pair.robot.effectors(now=pair.now)
    assert pair.robot.motion.given(WHEEL) == (0.0,)


def test_a_memory_event_goes_once_over_a_long_way_if_its_acknowledgement_comes() -> None:
    pair = joined(delay=0.4)
    pair.run(2.0)
    sizes = []
    usual = pair.network.send
    pair.network.send = lambda to, data, now: (sizes.append((to, len(data))), usual(to, data, now))[1]
    pair.robot.store(LOG, b"log", deadline=pair.now + 9.0)
    pair.run(3.0)
    assert sum(size > 21 for to, size in sizes if to == "local") == 1


@pytest.mark.parametrize("sealed", [False, True])
def test_an_end_whose_acknowledgement_was_lost_is_acknowledged_again(sealed: bool) -> None:
    pair = Pair(MODEL, Network(Random(1)), sealed=sealed).opened()
    pair.run(0.2)
    usual, lost = pair.network.send, []

    def send(to: str, data: bytes, now: float) -> None:
        if header.decode(data).type is PacketType.ENDED and len(lost) < 3:
            lost.append(now)
        else:
            usual(to, data, now)

    pair.network.send = send
    begin = pair.now
    pair.local.end(now=begin)
    pair.until(lambda: pair.local.state is LocalState.CLOSED, 3.0)
    assert [round(at - begin, 2) for at in lost] == [0.01, 0.26, 0.51]
    assert sum(isinstance(output, SessionEnded) for output in pair.did) == 1
    # Not what comes twice, and nothing else of that session.
    assert pair.robot.dropped == dict.fromkeys(DropReason, 0)
    pair.opened()


@pytest.mark.parametrize("sealed", [False, True])
def test_of_two_who_open_at_once_one_has_the_robot_and_the_other_is_told(sealed: bool) -> None:
    random, keys = Random(1), KEYS if sealed else None
    robot = RobotCore(MODEL, random.randbytes, keys=keys)
    both = {name: LocalCore(MODEL, random.randbytes, keys=keys) for name in (b"one", b"other")}
    for local in both.values():
        local.open(now=0.0)
    came: list[tuple[bytes, bytes]] = []
    for step in range(100):
        now = 0.01 * step
        sent = [(data, name) for name, local in both.items() for data in local.to_send(now=now)]
        for data, name in came:
            both[name].receive(data, now=now)
        for data, name in sent:
            robot.receive(data, name, now=now)
        came = robot.to_send(now=now)
    assert both[b"one"].state is LocalState.CLOSED
    assert [type(output) for output in both[b"one"].take()] == [Began, SessionEnded]
    assert both[b"other"].state is LocalState.OPEN
    assert robot.session == both[b"other"].take()[0].session


def test_a_session_opens_on_the_way_to_the_moon() -> None:
    pair = Pair(MODEL, Network(Random(1), delay=1.28))
    pair.opened(within=8.0)
    assert 5.12 <= pair.now <= 7.0


def test_who_is_challenged_and_then_never_answered_gives_up() -> None:
    pair = Pair(MODEL, Network(Random(1)))
    pair.local.open(now=0.0)
    pair.until(lambda: pair.local.opening.cookie != bytes(16), 1.0)
    pair.network.closed = True
    pair.network.flight.clear()
    pair.until(lambda: pair.local.state is LocalState.CLOSED, 5.2)


@pytest.mark.parametrize("kind", [PacketType.CHALLENGE, PacketType.OPENED, PacketType.REFUSED])
def test_an_answer_to_another_question_is_dropped_and_counted(kind: PacketType) -> None:
    pair = Pair(MODEL, Network(Random(1)))
    pair.local.open(now=0.0)
    before = pair.local.to_send(now=0.0)
    if kind is PacketType.REFUSED:
        body = handshake.encode_refused(b"n" * 16, handshake.SessionRefusal.BUSY)
    else:
        body = handshake.encode_answer(b"n" * 16, b"c" * 16)
    head = Header(MODEL.id, False, kind, 0, 0, 5, 65_535, 0)
    pair.local.receive(handshake.sent(kind, body, head, None, Rank.OPERATOR), now=0.0)
    assert pair.local.state is LocalState.OPENING
    assert pair.local.dropped[DropReason.SESSION] == 1
    assert [data[20:] for data in pair.local.to_send(now=0.25)] == [data[20:] for data in before]


@pytest.mark.parametrize("sealed", [False, True])
def test_no_packet_is_longer_than_udp_carries_however_much_waits(sealed: bool) -> None:
    model = RobotModel(
        "hoarder",
        1,
        (
            *(Effector(f"speaker{k}", stream=16_384) for k in range(5)),
            *(MemoryCommand(f"album{k}", size=16_384) for k in range(6)),
            *(MemoryEvent(f"log{k}", size=16_384) for k in range(6)),
        ),
    )
    pair = Pair(model, Network(Random(1)), sealed=sealed).opened()
    sizes, usual = [], pair.network.send
    pair.network.send = lambda to, data, now: (sizes.append(len(data)), usual(to, data, now))[1]
    stored, told = [], []
    for k in range(6):
        stored.append(pair.local.store(5 + k, bytes(16_384), deadline=pair.now + 3.0))
        told.append(pair.robot.store(11 + k, bytes(16_384), deadline=pair.now + 3.0))
    for k in range(5):
        pair.local.play(k, bytes(16_384))
    pair.run(1.0)
    assert [output.id for output in pair.did if isinstance(output, Stored)] == stored
    assert [output.id for output in pair.told if isinstance(output, Stored)] == told
    assert all(pair.robot.streams.take(k) == bytes(16_384) for k in range(5))
    assert 3 * 16_384 < max(sizes) <= 65_507


def test_what_is_longer_than_its_element_is_refused_before_it_stops_all_packets() -> None:
    pair = joined()
    with pytest.raises(InvalidValueError, match="log must be 5 bytes at most"):
        pair.robot.store(LOG, b"longer", deadline=9.0)
    pair.robot.store(LOG, b"right", deadline=9.0)
    pair.run(0.2)
    assert [output.data for output in pair.told if isinstance(output, Stored)] == [b"right"]


def test_a_packet_of_another_model_is_dropped_on_both_sides() -> None:
    pair = joined()
    down, up = pair.local.numbers, pair.robot.claim.session
    for session in (down, up):
        session.model += 1
    empty = pair.local.layout.join({})
    pair.robot.receive(down.make(PacketType.DOWN, empty, pair.now), ADDRESS, now=pair.now)
    pair.local.receive(up.make(PacketType.UP, empty, pair.now), now=pair.now)
    assert pair.robot.dropped[DropReason.MODEL] == pair.local.dropped[DropReason.MODEL] == 1
