"""Two cores and a bad network, held against a model: nothing is done twice, out of order, or forgotten."""

from __future__ import annotations

import os
from random import Random

import pytest

from interfaces.rsp.model import Command, Effector, MemoryCommand, MemoryEvent, OnLoss, RobotModel, example
from interfaces.rsp.outbox import CommandOutbox, DeliveryOutcome, MemoryInbox, MemoryOutbox
from interfaces.rsp.outputs import Commanded, EndReason, RobotChange, SessionEnded, Settled
from tests.interfaces.rsp.joined import Judge, Network, Pair, talk, value

PACKETS = int(os.environ.get("VRS_SOAK_PACKETS", "3000"))
"""Packets of each run; `make soak` takes a million in all."""
BASE = example()
MODEL = RobotModel(
    "rover", 7, (*BASE.elements, Command("ir_fire2", type="u8"), MemoryCommand("program2"), MemoryEvent("log2"))
)
LINKS = {
    "good": {},
    "half is lost": {"loss": 0.5},
    "copies": {"loss": 0.1, "duplicate": 0.5},
    "out of order": {"loss": 0.2, "duplicate": 0.2, "jitter": 0.1},
    "all of it": {"loss": 0.4, "duplicate": 0.3, "jitter": 0.05, "delay": 0.15},
}


@pytest.mark.parametrize("sealed", [False, True], ids=["open", "sealed"])
@pytest.mark.parametrize("link", LINKS)
def test_every_rule_holds(link: str, sealed: bool) -> None:
    pair = Pair(MODEL, Network(Random(1), **LINKS[link]), sealed=sealed, seed=3)
    pair.opened()
    pair.count_from(65_536 - PACKETS // 8)
    begin = pair.now
    pair.network.silences = ((begin + 4.0, begin + 14.0),)
    judge = Judge(pair)
    talk(pair, judge, Random(2), PACKETS)
    judge.conclude()
    assert pair.local.numbers.number > 65_536, "numbers must have gone round"
    assert judge.lost >= 1, "a silence of 10 s must have been noticed"
    assert len(judge.commands) > 50
    assert len(judge.stored) > 10
    assert judge.occurred > 0
    failed = sum(outcome is DeliveryOutcome.FAILED for outcome in judge.outcomes.values())
    assert 0 < failed < 0.95 * len(judge.outcomes)


@pytest.mark.parametrize("broken", ["twice", "forgotten", "early"])
def test_the_judge_sees_what_is_wrong(broken: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if broken == "twice":
        usual = MemoryInbox.receive

        def again(self: MemoryInbox, payloads: list) -> list:
            self._newest -= 1
            return usual(self, payloads)

        monkeypatch.setattr(MemoryInbox, "receive", again)
    elif broken == "forgotten":
        monkeypatch.setattr(CommandOutbox, "acknowledge", _forgetful)
    else:
        monkeypatch.setattr(MemoryOutbox, "expire", lambda self, now: _expire(self, now + 0.4))
    pair = Pair(MODEL, Network(Random(1), loss=0.7, duplicate=0.3), seed=3)
    pair.opened()
    with pytest.raises((AssertionError, KeyError)):
        _judged(pair)


def _judged(pair: Pair) -> None:
    judge = Judge(pair)
    talk(pair, judge, Random(2), 3000)
    judge.conclude()


_expire = MemoryOutbox.expire


def _forgetful(self: CommandOutbox, last: int) -> list[Settled]:
    """Takes a command for acknowledged one packet too soon."""
    return _acknowledge(self, last + 1)


_acknowledge = CommandOutbox.acknowledge


def test_commands_of_one_element_wait_for_each_other_and_keep_their_order() -> None:
    pair = Pair(MODEL, Network(Random(1), delay=0.1)).opened()
    fire, fire2 = MODEL.index("ir_fire"), MODEL.index("ir_fire2")
    given = [(fire, 1), (fire, 2), (fire2, 3), (fire, 4), (fire2, 5)]
    for index, number in given:
        pair.local.command(index, value(number))
    pair.run(3.0)
    assert [(o.index, o.payload[0]) for o in pair.did if isinstance(o, Commanded)] == given
    assert [o.id for o in pair.told if isinstance(o, Settled)] == [0, 1, 2, 3, 4]


def test_a_memory_command_goes_once_if_its_acknowledgement_comes() -> None:
    pair = Pair(MODEL, Network(Random(1), delay=0.02)).opened()
    index = MODEL.index("program")
    pair.run(1.0)
    sizes = []
    pair.local.store(index, b"x" * 100, deadline=pair.now + 5.0)
    usual = pair.network.send
    pair.network.send = lambda to, data, now: (sizes.append((to, len(data))), usual(to, data, now))[1]
    pair.run(1.0)
    assert sum(size > 100 for to, size in sizes if to == "robot") == 1


def test_effectors_go_until_the_robot_has_them_and_no_longer() -> None:
    pair = Pair(MODEL, Network(Random(1), delay=0.05)).opened()
    wheel = MODEL.index("left_wheel")
    sizes: list[int] = []
    usual = pair.network.send
    pair.network.send = lambda to, data, now: (
        sizes.append(len(data)) if to == "robot" else None,
        usual(to, data, now),
    )[1]
    pair.local.write(wheel, b"\0\x64")
    pair.run(1.0)
    # A round trip and a period: then the robot is known to have it.
    assert 4 <= sum(size == 24 for size in sizes) <= 9
    assert set(sizes) == {24, 22}
    assert pair.robot.effectors(now=pair.now)[wheel] == (100.0,)
    sizes.clear()
    pair.local.activate(wheel, True)
    pair.run(1.0)
    assert set(sizes) == {24}


def test_a_lost_link_rests_the_wheels_and_the_next_packet_lets_them_go_on() -> None:
    pair = Pair(MODEL, Network(Random(1))).opened()
    wheel = MODEL.index("left_wheel")
    pair.local.write(wheel, b"\0\x64")
    pair.run(0.3)
    assert pair.robot.effectors(now=pair.now)[wheel] == (100.0,)
    pair.network.closed = True
    heard = pair.robot.heard
    while RobotChange.LINK_LOST not in pair.did:
        pair.robot.effectors(now=pair.now)
        pair.step()
    assert 0.5 <= pair.now - heard <= 0.62
    assert pair.robot.effectors(now=pair.now).get(wheel, (0.0,)) == (0.0,)
    assert pair.robot.motion.given(wheel) == (0.0,)
    pair.network.closed = False
    pair.run(0.1)
    pair.robot.effectors(now=pair.now)
    assert RobotChange.LINK_RESTORED in pair.did
    # Nothing was written: what the simulacrum has holds again.
    assert pair.robot.motion.given(wheel) == (100.0,)


def test_the_end_is_acknowledged_and_what_waits_is_reported() -> None:
    pair = Pair(MODEL, Network(Random(1), loss=0.3)).opened()
    pair.network.loss = 1.0
    pair.local.store(MODEL.index("program"), b"x", deadline=pair.now + 60.0)
    pair.local.command(MODEL.index("ir_fire"), b"\1")
    pair.run(0.2)
    pair.network.loss = 0.3
    pair.local.end(now=pair.now)
    pair.run(3.0)
    outcomes = [output.outcome for output in pair.told if isinstance(output, Settled)]
    assert outcomes == [DeliveryOutcome.FAILED, DeliveryOutcome.FAILED]
    assert any(isinstance(o, SessionEnded) and o.reason is EndReason.CLOSED for o in pair.told)
    assert any(isinstance(o, SessionEnded) and o.reason is EndReason.CLOSED for o in pair.did)
    assert pair.robot.session is None
    pair.opened()


def test_each_event_is_told_in_three_packets() -> None:
    pair = Pair(MODEL, Network(Random(1))).opened()
    bumper = MODEL.index("bumper")
    pair.local.request(bumper, True)
    pair.run(0.2)
    told: list[bytes] = []
    usual = pair.network.send
    pair.network.send = lambda to, data, now: (
        told.append(data[22:]) if to == "local" else None,
        usual(to, data, now),
    )[1]
    for number in (1, 2):
        assert pair.robot.occur(bumper, bytes([number]))
    pair.run(0.5)
    assert [body for body in told if body] == [b"\0\0\1"] * 3 + [b"\0\1\2"] * 3


def test_events_that_nobody_asks_for_or_that_are_too_many_arent_told() -> None:
    pair = Pair(MODEL, Network(Random(1))).opened()
    bumper = MODEL.index("bumper")
    assert not pair.robot.occur(bumper, b"\1")
    pair.local.request(bumper, True)
    pair.run(0.2)
    pair.network.closed = True
    assert [pair.robot.occur(bumper, b"\1") for _ in range(300)].count(True) == 256


def test_the_end_of_a_session_rests_the_wheels_and_leaves_postures() -> None:
    model = RobotModel("two", 1, (Effector("wheel", on_loss=OnLoss.REST, initial=3.0), Effector("arm")))
    pair = Pair(model, Network(Random(1))).opened()
    for index in (0, 1):
        pair.local.write(index, b"\0\x64")
    pair.run(0.3)
    assert pair.robot.effectors(now=pair.now) == {0: (100.0,), 1: (100.0,)}
    pair.local.end(now=pair.now)
    pair.run(0.3)
    assert pair.robot.effectors(now=pair.now) == {0: (3.0,)}
    pair.opened()
    assert pair.robot.motion.given(1) == (100.0,)


def test_a_silence_of_a_minute_ends_the_session_on_both_sides() -> None:
    pair = Pair(MODEL, Network(Random(1))).opened()
    pair.network.closed = True
    pair.run(61.0)
    assert any(isinstance(o, SessionEnded) and o.reason is EndReason.LOST for o in pair.told)
    assert any(isinstance(o, SessionEnded) and o.reason is EndReason.LOST for o in pair.did)


def test_monitors_and_sensors_are_told_when_they_are_asked_for_and_changed() -> None:
    from interfaces.rsp.outputs import Told

    pair = Pair(MODEL, Network(Random(1), loss=0.3)).opened()
    position, state = MODEL.index("position"), MODEL.index("left_wheel_state")
    pair.robot.measure(position, b"123412341234")
    pair.run(1.0)
    assert not any(isinstance(output, Told) for output in pair.told)
    pair.local.request(MODEL.index("sensing"), True)
    pair.run(1.0)
    told = {output.index: output.payload for output in pair.told if isinstance(output, Told)}
    assert told == {position: b"123412341234", state: b"\0\0"}
    pair.told.clear()
    pair.run(1.0)
    assert not any(isinstance(output, Told) for output in pair.told), "nothing changed"
    for on in (False, True):
        pair.local.request(MODEL.index("sensing"), on)
        pair.run(1.0)
    told = {output.index: output.payload for output in pair.told if isinstance(output, Told)}
    assert told == {position: b"123412341234", state: b"\0\0"}, "who asks again may have forgotten"
    pair.told.clear()
    pair.local.write(MODEL.index("left_wheel"), b"\0\x0a")
    for _ in range(60):
        pair.step()
        pair.robot.effectors(now=pair.now)
    told = {output.index: output.payload for output in pair.told if isinstance(output, Told)}
    assert told == {state: b"\0\x0a"}


def test_what_is_acknowledged_isnt_acknowledged_for_ever() -> None:
    pair = Pair(MODEL, Network(Random(1), delay=0.02)).opened()
    pair.local.store(MODEL.index("program"), b"x", deadline=pair.now + 5.0)
    pair.robot.store(MODEL.index("log"), b"x", deadline=pair.now + 5.0)
    pair.run(1.0)
    sizes: list[int] = []
    usual = pair.network.send
    pair.network.send = lambda to, data, now: (sizes.append(len(data)), usual(to, data, now))[1]
    pair.run(0.5)
    assert set(sizes) == {22}


def test_an_event_that_was_told_before_a_newer_one_is_no_news() -> None:
    from interfaces.rsp.header import PacketType
    from interfaces.rsp.outputs import Occurred

    pair = Pair(MODEL, Network(Random(1))).opened()
    bumper, session = MODEL.index("bumper"), pair.robot.claim.session
    for number in (0, 1, 0, 65_535, 1, 2):
        body = pair.robot.layout.join({bumper: number.to_bytes(2, "big") + b"\1"})
        pair.local.receive(session.make(PacketType.UP, body, pair.now), now=pair.now)
    assert [output.id for output in pair.local.take() if isinstance(output, Occurred)] == [0, 1, 2]
