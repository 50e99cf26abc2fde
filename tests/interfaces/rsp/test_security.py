"""Who gets in and who doesn't: spoofed, replayed, flipped, downgraded; sessions begin, are refused and taken
over."""

from __future__ import annotations

from random import Random

import pytest

from interfaces.rsp import handshake, header
from interfaces.rsp.handshake import Open, SessionRefusal
from interfaces.rsp.header import PacketType
from interfaces.rsp.local import LocalCore, LocalState
from interfaces.rsp.model import example
from interfaces.rsp.outputs import EndReason, Refused, SessionEnded
from interfaces.rsp.robot import RobotConfig, RobotCore
from interfaces.rsp.session import DropReason, Keyring, Rank
from tests.interfaces.rsp.joined import ADDRESS, KEYS, Network, Pair
from vrs.errors import InvalidValueError

MODEL = example()
WHEEL = MODEL.index("left_wheel")


def pair_of(*, sealed: bool) -> Pair:
    pair = Pair(MODEL, Network(Random(1)), sealed=sealed).opened()
    pair.local.write(WHEEL, b"\0\x64")
    pair.run(0.2)
    pair.robot.effectors(now=pair.now)
    assert pair.robot.motion.given(WHEEL) == (100.0,)
    return pair


def next_down(pair: Pair) -> bytes:
    pair.local.write(WHEEL, b"\0\x32")
    pair.now += 0.1
    return pair.local.to_send(now=pair.now)[0]


def state(pair: Pair) -> tuple:
    """What a datagram that doesn't count must leave as it was."""
    robot = pair.robot
    session = robot.claim.session
    return (
        robot.motion.given(WHEEL),
        session.newest,
        session.number,
        robot.session,
        robot.heard,
        robot.streams.free,
    )


@pytest.mark.parametrize("sealed", [False, True])
def test_t16_a_spoofed_session_is_dropped_and_counted(sealed: bool) -> None:
    pair = pair_of(sealed=sealed)
    data, before = next_down(pair), state(pair)
    other = data[:12] + bytes([data[12] ^ 1]) + data[13:]
    pair.robot.receive(other, ADDRESS, now=pair.now)
    pair.robot.receive(data, b"elsewhere", now=pair.now)
    assert pair.robot.dropped[DropReason.SESSION] == 2
    assert state(pair) == before


def test_t16_every_flipped_bit_of_a_sealed_packet_is_dropped_and_counted() -> None:
    pair = pair_of(sealed=True)
    data, before = next_down(pair), state(pair)
    assert len(data) == 20 + 24 + 2 + 2
    for bit in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        pair.robot.receive(bytes(flipped), ADDRESS, now=pair.now)
    assert state(pair) == before
    assert sum(pair.robot.dropped.values()) == 8 * len(data)
    assert pair.robot.dropped[DropReason.AUTHENTICATION] > 8 * 24
    pair.robot.receive(data, ADDRESS, now=pair.now)
    assert state(pair) != before


@pytest.mark.parametrize(("sealed", "reason"), [(False, DropReason.LATE), (True, DropReason.REPLAY)])
def test_t16_a_replayed_packet_is_dropped_and_counted(sealed: bool, reason: DropReason) -> None:
    pair = pair_of(sealed=sealed)
    data = next_down(pair)
    pair.robot.receive(data, ADDRESS, now=pair.now)
    before = state(pair)
    pair.robot.receive(data, ADDRESS, now=pair.now + 0.1)
    assert pair.robot.dropped[reason] == 1
    assert state(pair) == before


def test_a_packet_from_before_the_newest_is_late_though_it_never_came() -> None:
    pair = pair_of(sealed=True)
    early, late = next_down(pair), next_down(pair)
    pair.robot.receive(late, ADDRESS, now=pair.now)
    before = state(pair)
    pair.robot.receive(early, ADDRESS, now=pair.now + 0.1)
    assert pair.robot.dropped[DropReason.LATE] == 1
    assert state(pair) == before


def test_a_sealed_packets_number_is_its_counters() -> None:
    pair = pair_of(sealed=True)
    session, before = pair.local.numbers, state(pair)
    number = session.number
    head = header.Header(MODEL.id, True, PacketType.DOWN, number, 0, session.id, 0, 0)
    data = session.cipher.seal(header.encode(head), b"\0\0", number + 1)
    pair.robot.receive(data, ADDRESS, now=pair.now)
    assert pair.robot.dropped[DropReason.MALFORMED] == 1
    assert state(pair) == before


def test_a_bit_of_the_header_downgrades_nobody() -> None:
    sealed, plain = pair_of(sealed=True), pair_of(sealed=False)
    head, body = next_down(plain), next_down(sealed)
    in_clear = header.encode(header.decode(body)._replace(encrypted=False)) + head[header.SIZE :]
    before = state(sealed)
    sealed.robot.receive(in_clear, ADDRESS, now=sealed.now)
    sealed.local.receive(in_clear, now=sealed.now)
    assert sealed.robot.dropped[DropReason.DOWNGRADE] == sealed.local.dropped[DropReason.DOWNGRADE] == 1
    plain.robot.receive(body, ADDRESS, now=plain.now)
    assert plain.robot.dropped[DropReason.DOWNGRADE] == 1
    assert state(sealed) == before


def test_a_replayed_opening_takes_nothing_over() -> None:
    pair = Pair(MODEL, Network(Random(1)), sealed=True)
    sent: list[bytes] = []
    usual = pair.network.send
    pair.network.send = lambda to, data, now: (sent.append(data) if to == "robot" else None, usual(to, data, now))[
        1
    ]
    pair.opened()
    pair.run(3.0)
    opening = [data for data in sent if header.decode(data).type is PacketType.OPEN]
    pair.network.closed = True
    pair.run(2.5)
    before = pair.robot.session
    for data in opening:
        pair.robot.receive(data, ADDRESS, now=pair.now)
    for data in sent:
        pair.robot.receive(data, ADDRESS, now=pair.now)
    assert pair.robot.session == before
    # The one whose session it is goes on.
    pair.network.closed = False
    pair.network.flight.clear()
    pair.local.write(WHEEL, b"\0\x0a")
    pair.run(0.3)
    pair.robot.effectors(now=pair.now)
    assert pair.robot.motion.given(WHEEL) == (10.0,)


@pytest.mark.parametrize("sealed", [False, True])
def test_t16_no_answer_is_longer_than_its_question_and_asking_leaves_nothing(sealed: bool) -> None:
    random, keys = Random(1), KEYS if sealed else None
    robot = RobotCore(MODEL, random.randbytes, keys=keys)
    for k in range(300):
        local = LocalCore(MODEL, random.randbytes, keys=keys)
        local.open(now=0.1 * k)
        (asked,) = local.to_send(now=0.1 * k)
        robot.receive(asked, k.to_bytes(2, "big"), now=0.1 * k)
        for answer, _ in robot.to_send(now=0.1 * k):
            assert len(answer) <= len(asked)
            assert header.decode(answer).type is PacketType.CHALLENGE
    assert robot.session is None
    assert robot.door.pending is None


def test_too_many_requests_are_dropped() -> None:
    random = Random(1)
    robot = RobotCore(MODEL, random.randbytes)
    local = LocalCore(MODEL, random.randbytes)
    local.open(now=0.0)
    (asked,) = local.to_send(now=0.0)
    for _ in range(1000):
        robot.receive(asked, ADDRESS, now=0.0)
    assert len(robot.to_send(now=0.0)) == 100


def second(pair: Pair, *, rank: Rank = Rank.OPERATOR, keys: Keyring | None = None, takeover: bool) -> LocalCore:
    """Another local system asks, from another address, for half a second."""
    other = LocalCore(MODEL, Random(99).randbytes, keys=keys, rank=rank)
    other.open(now=pair.now, takeover=takeover)
    for _ in range(50):
        for data in other.to_send(now=pair.now):
            pair.robot.receive(data, b"second", now=pair.now)
        for data in pair.local.to_send(now=pair.now):
            pair.robot.receive(data, ADDRESS, now=pair.now)
        for data, address in pair.robot.to_send(now=pair.now):
            if address == b"second":
                other.receive(data, now=pair.now)
            else:
                pair.local.receive(data, now=pair.now)
        pair.now += 0.01
    pair.told += pair.local.take()
    return other


@pytest.mark.parametrize(
    ("sealed", "rank", "takeover", "refusal"),
    [
        (False, Rank.OPERATOR, False, SessionRefusal.BUSY),
        (True, Rank.OPERATOR, False, SessionRefusal.BUSY),
        (True, Rank.ADMIN, False, SessionRefusal.BUSY),
        (True, Rank.OPERATOR, True, SessionRefusal.FORBIDDEN),
    ],
)
def test_a_session_in_use_is_refused(sealed: bool, rank: Rank, takeover: bool, refusal: SessionRefusal) -> None:
    pair = pair_of(sealed=sealed)
    other = second(pair, rank=rank, keys=KEYS if sealed else None, takeover=takeover)
    assert other.take() == [Refused(refusal)]
    assert pair.local.state is LocalState.OPEN


@pytest.mark.parametrize("sealed", [False, True])
def test_a_takeover_passes_through_a_stop(sealed: bool) -> None:
    pair = pair_of(sealed=sealed)
    other = second(pair, rank=Rank.ADMIN if sealed else Rank.OPERATOR, keys=KEYS if sealed else None, takeover=True)
    assert other.state is LocalState.OPEN
    assert [o.reason for o in pair.told if isinstance(o, SessionEnded)] == [EndReason.TAKEN]
    assert pair.robot.session == other.numbers.id
    assert pair.robot.stopping
    assert pair.robot.effectors(now=pair.now)[WHEEL] == (0.0,)
    other.write(WHEEL, b"\0\x0a")

    def exchange() -> None:
        for _ in range(20):
            for data in other.to_send(now=pair.now):
                pair.robot.receive(data, b"second", now=pair.now)
            pair.now += 0.01
        pair.robot.effectors(now=pair.now)

    exchange()
    assert pair.robot.motion.given(WHEEL) == (0.0,)
    assert pair.robot.dropped[DropReason.STOPPING] > 0
    pair.robot.rested()
    exchange()
    assert pair.robot.motion.given(WHEEL) == (10.0,)


def test_where_nobody_may_nobody_takes_over_in_the_clear() -> None:
    pair = Pair(MODEL, Network(Random(1)), robot=RobotConfig(takeover=False)).opened()
    assert second(pair, takeover=True).take() == [Refused(SessionRefusal.FORBIDDEN)]


def test_an_idle_session_gives_way() -> None:
    pair = pair_of(sealed=True)
    pair.network.closed = True
    pair.run(2.1)
    pair.local.end(now=pair.now)
    pair.local.state = LocalState.CLOSED
    assert second(pair, keys=KEYS, takeover=False).state is LocalState.OPEN


def test_another_key_or_rank_opens_nothing() -> None:
    pair = pair_of(sealed=True)
    for keys, rank in (
        (Keyring({Rank.OPERATOR: b"x" * 32}), Rank.OPERATOR),
        (Keyring({Rank.ADMIN: b"o" * 32}), Rank.ADMIN),
    ):
        assert second(pair, keys=keys, rank=rank, takeover=True).take() == []
    assert pair.robot.dropped[DropReason.AUTHENTICATION] > 0
    assert pair.local.state is LocalState.OPEN


def test_keys_are_checked() -> None:
    for secrets in ({}, {Rank.OPERATOR: b"x" * 31}):
        with pytest.raises(InvalidValueError):
            Keyring(secrets)
    with pytest.raises(InvalidValueError, match="rank"):
        LocalCore(MODEL, bytes, keys=Keyring({Rank.OPERATOR: b"o" * 32}), rank=Rank.ADMIN)
    assert "oooo" not in repr(KEYS)


def test_keys_of_a_session_are_its_own() -> None:
    made = {KEYS.session(Rank.OPERATOR, nonces, session) for nonces in (b"a" * 32, b"b" * 32) for session in (1, 2)}
    assert len({key for pair in made for key in pair}) == 8


def asked(robot: RobotCore, question: Open, address: bytes, now: float, keys: Keyring | None = None) -> list:
    """What a robot answers to an OPEN: type, address, session and body of each."""
    head = header.Header(MODEL.id, False, PacketType.OPEN, 0, 0, 0, 65_535, 0)
    rank = Rank.OPERATOR if keys is not None else question.rank
    robot.receive(
        handshake.sent(PacketType.OPEN, handshake.encode_open(question), head, keys, rank), address, now=now
    )
    found = []
    for data, to in robot.to_send(now=now):
        answer = header.decode(data)
        found.append((answer.type, to, answer.session, data[header.SIZE :]))
    return found


def challenged(robot: RobotCore, nonce: bytes, address: bytes, now: float) -> Open:
    """The question with the cookie that it's answered with."""
    question = Open(Rank.OPERATOR, False, nonce)
    ((kind, _, _, body),) = asked(robot, question, address, now)
    assert kind is PacketType.CHALLENGE
    return question._replace(cookie=handshake.decode_answer(body)[1])


@pytest.mark.parametrize(
    ("address", "later", "nonce", "given"),
    [
        (ADDRESS, 0.0, b"n" * 16, PacketType.OPENED),
        (ADDRESS, 10.0, b"n" * 16, PacketType.OPENED),
        (ADDRESS, 20.0, b"n" * 16, PacketType.CHALLENGE),
        (b"elsewhere", 0.0, b"n" * 16, PacketType.CHALLENGE),
        (ADDRESS, 0.0, b"m" * 16, PacketType.CHALLENGE),
    ],
)
def test_a_cookie_is_for_an_address_a_nonce_and_a_while(
    address: bytes, later: float, nonce: bytes, given: PacketType
) -> None:
    robot = RobotCore(MODEL, Random(1).randbytes)
    question = challenged(robot, b"n" * 16, ADDRESS, 5.0)._replace(nonce=nonce)
    ((kind, to, _, _),) = asked(robot, question, address, 5.0 + later)
    assert (kind, to) == (given, address)


def test_the_same_question_from_another_address_is_another_session() -> None:
    robot = RobotCore(MODEL, Random(1).randbytes)
    sessions = {}
    for address in (ADDRESS, b"elsewhere"):
        *_, (kind, to, session, _) = asked(robot, challenged(robot, b"n" * 16, address, 5.0), address, 5.0)
        assert (kind, to) == (PacketType.OPENED, address)
        sessions[session] = address
    assert len(sessions) == 2


def test_who_makes_addresses_up_locks_nobody_out_whose_address_is_proven() -> None:
    robot = RobotCore(MODEL, Random(1).randbytes)
    question = challenged(robot, b"n" * 16, ADDRESS, 5.0)
    for k in range(1000):
        asked(robot, Open(Rank.OPERATOR, False, k.to_bytes(16, "big")), k.to_bytes(6, "big"), 5.0)
    assert robot.dropped[DropReason.UNEXPECTED] > 800
    *_, (kind, to, _, _) = asked(robot, question, ADDRESS, 5.0)
    assert (kind, to) == (PacketType.OPENED, ADDRESS)


def test_an_operators_key_doesnt_make_an_admin() -> None:
    robot = RobotCore(MODEL, Random(1).randbytes, keys=KEYS)
    assert asked(robot, Open(Rank.OPERATOR, True, b"n" * 16), ADDRESS, 0.0, KEYS)[0][0] is PacketType.CHALLENGE
    assert asked(robot, Open(Rank.ADMIN, True, b"n" * 16), ADDRESS, 0.0, KEYS) == []
    assert robot.dropped[DropReason.AUTHENTICATION] == 1


def test_a_local_system_takes_nothing_of_another_session() -> None:
    pair = pair_of(sealed=False)
    pair.run(0.05)
    (data, _), *_ = pair.robot.to_send(now=pair.now + 1.0)
    before = pair.local.numbers.newest
    pair.local.receive(data[:12] + bytes([data[12] ^ 1]) + data[13:], now=pair.now)
    assert pair.local.dropped[DropReason.SESSION] == 1
    assert pair.local.numbers.newest == before
    pair.local.receive(data, now=pair.now)
    assert pair.local.numbers.newest > before
