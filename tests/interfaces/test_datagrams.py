"""Datagrams beside the stream between the sites: lost, doubled, late or forged, in virtual time and live."""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cryptography.hazmat.primitives.ciphers.aead import AESGCM
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from websockets.sync.client import connect

from interfaces.link import BernoulliLoss, Channel, Conditions, ConstantDelay, LinkConditions, Service
from interfaces.messages.control import Attached, Ping, Pong
from interfaces.messages.sites import Orders, Report
from interfaces.runtime.live import datagrams
from interfaces.runtime.live.datagrams import (
    ALONE,
    BURST,
    LONGEST,
    PARTIAL,
    PIECE,
    PIECES,
    ROOM,
    DatagramSocket,
    DatagramState,
    OperatorDatagrams,
    RobotDatagrams,
)
from interfaces.stream.certificates import Certificate, own_certificate
from interfaces.stream.codec import Encoding, decode, encode
from interfaces.teleop import OperatorSite, RobotHost, RobotHostConfig, RobotLine, RobotSiteConfig, VirtualArm
from interfaces.teleop.operator import Halt, HaltCause
from robots.onboard.watchdog import WatchdogConfig
from tests.interfaces import live_rig
from tests.interfaces.live_rig import MODEL, NOMINAL
from vrs import SteerCommand

SECRET = "as long as a secret of 32 bytes is, or longer"
HERE, ELSEWHERE = ("192.0.2.7", 40000), ("198.51.100.9", 40000)
STEP = 0.005
DELAY = 0.02
HALT = WatchdogConfig(max_uncertainty=1.0)


def lossy(loss: float, service: Service) -> Conditions:
    copies = 0.1 if service is Service.DATAGRAM else 0.0
    return Conditions(
        delay=ConstantDelay("constant", DELAY), loss=BernoulliLoss(loss), duplicate=copies, reorder=copies,
        service=service, retransmit_after=0.2,
    )  # fmt: skip


class Sites:
    """Both sites in virtual time; between them a stream that sends again, and datagrams that don't."""

    def __init__(self, *, stream: float = 0.0, datagrams: float | None = 0.0, watchdog: Any = None) -> None:
        """Say which shares are lost; no datagrams where theirs is None."""
        self.t, self.ahead = 0.0, 1234.5
        site = RobotSiteConfig(beat=0.033, watchdog=watchdog)
        self.host = RobotHost(MODEL, NOMINAL, now=self.ahead, config=RobotHostConfig(site=site), seed=7)
        halted = Halt(HaltCause.NOT_MET, "no robot has come yet")
        self.operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0), halted=halted)
        self.line = RobotLine(self.operator, LinkConditions(), np.random.default_rng(3))
        self.line.connected = True
        self.mine, self.theirs = OperatorDatagrams(SECRET), RobotDatagrams(SECRET)
        rng = iter(np.random.default_rng(5).spawn(4))
        self.stream = [Channel[bytes](lossy(stream, Service.IN_ORDER), next(rng)) for _ in range(2)]
        self.beside = [Channel[bytes](lossy(datagrams or 0.0, Service.DATAGRAM), next(rng)) for _ in range(2)]
        self.datagrams = datagrams is not None
        self.came: list[tuple[Orders, float]] = []
        self.heard: list[Report] = []
        assert self.host.hello("me", now=self.ahead) == ""

    def run(self, seconds: float, each: Callable[[float], object] = lambda _: None) -> None:
        """Let so much time pass."""
        for _ in range(round(seconds / STEP)):
            self.t += STEP
            each(self.t)
            for message in self.line.advance(now=self.t):
                self.put(0, encode(message, Encoding.MSGPACK), self.mine.seal)
            for delivery in self.stream[0].receive(self.t):
                if not self.datagrams or self.theirs.streamed(delivery.payload):
                    self.at_robot(delivery.payload)
            for delivery in self.beside[0].receive(self.t):
                message, answer = self.theirs.take(delivery.payload, HERE)
                for datagram in answer:
                    self.beside[1].send(datagram, self.t)
                if message:
                    self.at_robot(message)
            for answer in self.host.advance(now=self.t + self.ahead):
                self.put(1, encode(answer, Encoding.MSGPACK), self.theirs.seal)
            for delivery in self.stream[1].receive(self.t):
                if not self.datagrams or self.mine.streamed(delivery.payload):
                    self.at_operator(delivery.payload)
            for delivery in self.beside[1].receive(self.t):
                if message := self.mine.take(delivery.payload):
                    self.at_operator(message)

    def put(self, way: int, data: bytes, seal: Callable[[bytes], list[bytes]]) -> None:
        self.stream[way].send(data, self.t)
        for datagram in seal(data) if self.datagrams else ():
            assert len(datagram) <= LONGEST
            self.beside[way].send(datagram, self.t)

    def at_robot(self, data: bytes) -> None:
        message = decode(data, Encoding.MSGPACK, allowed=Orders | Pong)
        if isinstance(message, Orders):
            self.came.append((message, self.t))
        self.host.receive(message, now=self.t + self.ahead)

    def at_operator(self, data: bytes) -> None:
        message = decode(data, Encoding.MSGPACK, allowed=Report | Ping)
        if isinstance(message, Report):
            self.heard.append(message)
        self.line.receive(message, now=self.t)

    def begin(self) -> None:
        while self.operator.resume(now=self.t):
            self.run(STEP)
            assert self.t < 30.0
        self.run(0.5)

    def steer(self, seconds: float) -> None:
        """Let a hand steer, twenty times a second, and everything that it said come."""
        last = -1.0

        def each(now: float) -> None:
            nonlocal last
            if now >= last + 0.05:
                last = now
                self.operator.robot.execute(SteerCommand(0.3 * np.sin(now + np.arange(6.0))), now=now)

        self.run(seconds, each)
        self.run(8.0)

    @property
    def ages(self) -> np.ndarray:
        """How old each command was when it and all before it had come."""
        known: dict[int, float] = {}
        ages: list[float] = []
        for orders, t in self.came:
            known.update({entry.number: entry.at for entry in orders.entries})
            while (at := known.get(len(ages) + 1)) is not None:
                ages.append(t - at)
        return np.array(ages)

    def check(self) -> None:
        """Each command was carried out once, in its order and time; each message was given to its site once."""
        site = self.host.site
        assert site is not None
        mine, theirs = self.operator.robot.engine, site.engine
        assert not site.parted
        assert [r.command_id for r in theirs.receipts] == [r.command_id for r in mine.receipts]
        t = np.linspace(0.0, self.t, 2000)
        assert np.array_equal(theirs.timeline.sample(t), mine.timeline.sample(t))
        for numbers in ([orders.number for orders, _ in self.came], [report.number for report in self.heard]):
            assert max(Counter(numbers).values()) == 1
            assert set(numbers) >= set(range(min(numbers), max(numbers) - 200))


@pytest.mark.parametrize("loss", [0.01, 0.1])
def test_no_command_is_lost_or_doubled_and_orders_arent_held_up(loss: float) -> None:
    beside, alone = Sites(stream=loss, datagrams=loss), Sites(stream=loss, datagrams=None)
    for sites in (beside, alone):
        sites.begin()
        sites.steer(10.0)
        sites.check()
    assert np.median(beside.ages) == pytest.approx(DELAY, abs=2 * STEP)
    assert np.quantile(beside.ages, 0.99) <= DELAY + 0.1 + 2 * STEP
    assert np.quantile(alone.ages, 0.99) > 0.2


@pytest.mark.parametrize("fault", ["copies", "order"])
def test_a_planted_fault_is_seen(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if fault == "copies":
        monkeypatch.setattr(datagrams.DatagramEnd, "is_new", lambda self, message: True)
    else:
        monkeypatch.setattr(
            "interfaces.teleop.following_arm.Incoming.take", lambda self, first, entries: [*entries]
        )
    sites = Sites(stream=0.05, datagrams=0.05)
    sites.begin()
    sites.steer(3.0)
    with pytest.raises(AssertionError):
        sites.check()


def held_up(sites: Sites, seconds: float) -> None:
    """Let nothing come by the stream for so long: a segment is lost, and lost again."""
    for channel in sites.stream:
        channel.change(replace(channel.conditions, loss=BernoulliLoss(1.0)), sites.t)
    sites.run(seconds)
    for channel in sites.stream:
        channel.change(replace(channel.conditions, loss=BernoulliLoss(0.0)), sites.t)


@pytest.mark.parametrize("with_datagrams", [False, True])
def test_a_stream_that_is_held_up_stops_only_a_robot_without_datagrams(with_datagrams: bool) -> None:
    sites = Sites(datagrams=0.0 if with_datagrams else None, watchdog=HALT)
    sites.begin()
    assert sites.host.site is not None
    assert not sites.host.site.halted
    held_up(sites, 1.5)
    assert ("link loss" in sites.host.site.halted) is not with_datagrams
    sites.run(2.0)
    if with_datagrams:
        assert not sites.host.site.halted
        sites.steer(1.0)
        sites.check()


def test_what_the_stream_brings_late_of_an_old_epoch_changes_nothing() -> None:
    sites = Sites(watchdog=HALT)
    sites.begin()
    sites.operator.robot.execute(SteerCommand(np.full(6, 0.2)), now=sites.t)
    for channel in sites.stream:
        channel.change(replace(channel.conditions, loss=BernoulliLoss(1.0)), sites.t)
    sites.run(0.2)
    site = sites.host.site
    assert site is not None
    sites.host.halt("planted", now=sites.t + sites.ahead)
    sites.run(1.0)
    assert sites.operator.resume(now=sites.t) == ""
    sites.run(0.3)
    epoch, before = site.epoch, site.engine.timeline.version
    assert epoch == sites.operator.epoch
    given = len(sites.came)
    for channel in sites.stream:
        channel.change(replace(channel.conditions, loss=BernoulliLoss(0.0)), sites.t)
    sites.run(6.0)
    assert (site.epoch, site.engine.timeline.version, site.halted) == (epoch, before, "")
    assert all(orders.epoch == epoch for orders, _ in sites.came[given:])
    sites.steer(1.0)
    assert [r.command_id for r in site.engine.receipts][-1] == sites.operator.robot.engine.receipts[-1].command_id


def test_where_none_gets_through_the_stream_does_it_all() -> None:
    sites = Sites(stream=0.01, datagrams=1.0)
    sites.begin()
    sites.steer(3.0)
    sites.check()
    assert sites.mine.state is sites.theirs.state is DatagramState.BLOCKED
    for channel in sites.beside:
        channel.change(replace(channel.conditions, loss=BernoulliLoss(0.0)), sites.t)
    sites.run(0.3)
    assert sites.mine.state is sites.theirs.state is DatagramState.THROUGH


def pair() -> tuple[OperatorDatagrams, RobotDatagrams]:
    return OperatorDatagrams(SECRET), RobotDatagrams(SECRET)


def seal(end: OperatorDatagrams | RobotDatagrams, message: bytes) -> bytes:
    (sealed,) = end.seal(message)
    return sealed


def test_a_datagram_counts_once_and_only_as_it_was_made() -> None:
    operator, robot = pair()
    good = seal(operator, b"orders")
    for k in range(len(good)):
        flipped = bytearray(good)
        flipped[k] ^= 1 << k % 8
        assert robot.take(bytes(flipped), HERE) == (b"", [])
    for other in (
        b"",
        good[:51],
        good[:-1],
        good + b"\0",
        bytes(LONGEST + 1),
        seal(OperatorDatagrams("x" * 43), b"orders"),
    ):
        assert robot.take(other, HERE) == (b"", [])
    assert operator.take(good) == b"", "sent back to where it came from"
    assert robot.address is None
    assert robot.take(good, HERE)[0] == b"orders"
    assert robot.take(good, HERE) == (b"", [])
    assert robot.take(seal(operator, b"orders"), HERE)[0] == b"", "a copy in a datagram of its own"
    assert robot.came == 2


def test_none_is_longer_than_1200_bytes() -> None:
    operator, robot = pair()
    prove(operator, robot)
    for end in (operator, robot):
        assert [len(datagram) for datagram in end.seal(bytes(ROOM))] == [LONGEST] * PIECES
        assert [len(datagram) for datagram in end.seal(bytes(PIECE))] == [LONGEST]
        assert end.seal(bytes(ROOM + 1)) == []


@pytest.mark.parametrize("lost", [None, 0, 2])
def test_pieces_make_a_message_in_whatever_order_they_come(lost: int | None) -> None:
    operator, robot = pair()
    message, other = bytes(range(256)) * 12, b"\1" * 2 * PIECE
    pieces = [*operator.seal(message), *operator.seal(other)]
    assert len(pieces) == 5
    if lost is not None:
        del pieces[lost]
    came = [robot.take(pieces[k], HERE)[0] for k in (*range(len(pieces))[::-1], *range(len(pieces)))]
    assert sorted(filter(None, came)) == sorted([other] if lost is not None else [message, other])
    assert robot.streamed(message) is (lost is not None)


def test_pieces_of_the_newest_messages_alone_are_kept() -> None:
    operator, robot = pair()
    first, last = operator.seal(bytes(2 * PIECE))
    robot.take(first, HERE)
    for k in range(PARTIAL):
        robot.take(operator.seal(b"%02d" % k + bytes(PIECE))[0], HERE)
    assert robot.take(last, HERE)[0] == b""


def prove(operator: OperatorDatagrams, robot: RobotDatagrams) -> None:
    for k in range(2):
        _, answer = robot.take(seal(operator, b"prove %d" % k), HERE)
        for datagram in answer:
            assert operator.take(datagram) == b""
    assert robot.address == HERE


def test_nothing_longer_than_what_came_goes_to_an_address_before_it_is_proven() -> None:
    operator, robot = pair()
    first = seal(operator, b"")
    message, (answer,) = robot.take(first, ELSEWHERE)
    assert message == b""
    assert len(answer) <= len(first)
    assert robot.address is None
    assert robot.seal(b"a report") == []
    # Whoever sends on what was caught has no cookie for where it sends it from.
    prove(operator, robot)
    caught = seal(operator, b"orders")
    message, (answer,) = robot.take(caught, ELSEWHERE)
    assert message == b"orders"
    assert len(answer) <= len(caught)
    assert robot.address == HERE
    # An operator whose address has changed, as by a NAT, is sent to again when it has brought the new cookie.
    assert operator.take(answer) == b""
    assert robot.take(seal(operator, b"from elsewhere"), ELSEWHERE) == (b"from elsewhere", [])
    assert robot.address == ELSEWHERE


def test_another_address_isnt_taken_for_proven_by_a_cookie_of_the_one_before() -> None:
    operator, robot = pair()
    prove(operator, robot)
    robot.take(seal(operator, b"from elsewhere"), ELSEWHERE)
    assert robot.address == HERE


@pytest.mark.parametrize("fault", ["replay", "cookie"])
def test_a_planted_hole_is_seen(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if fault == "replay":
        monkeypatch.setattr("robots.onboard.watchdog.SequenceWindow.refusal", lambda self, number: None)
        test = test_a_datagram_counts_once_and_only_as_it_was_made
    else:
        monkeypatch.setattr(RobotDatagrams, "cookie", lambda self, address: bytes(8))
        test = test_another_address_isnt_taken_for_proven_by_a_cookie_of_the_one_before
    with pytest.raises(AssertionError):
        test()


def test_it_knows_copies_of_the_newest_messages_alone() -> None:
    operator, _ = pair()
    messages = [b"%d" % k for k in range(datagrams.REMEMBERED + 1)]
    assert all(operator.streamed(message) for message in messages)
    assert not any(operator.streamed(message) for message in messages[1:])
    assert operator.streamed(messages[0])


def test_messages_that_have_no_room_in_one_say_nothing_of_datagrams() -> None:
    operator, _ = pair()
    for k in range(2 * ALONE):
        operator.streamed(b"%04d" % k + bytes(ROOM))
    assert operator.state is DatagramState.NONE_YET


def test_a_flood_is_left_to_the_system() -> None:
    async def main() -> int:
        sock = socket.socket(type=socket.SOCK_DGRAM)
        sock.bind(("127.0.0.1", 0))
        came = []
        reading = DatagramSocket(sock, lambda data, _: came.append(data))
        with socket.socket(type=socket.SOCK_DGRAM) as flooding:
            for _ in range(40):
                for _ in range(100):
                    flooding.sendto(b"x", sock.getsockname())
                await asyncio.sleep(0)
        await asyncio.sleep(0.1)
        reading.close()
        return len(came)

    began = time.monotonic()
    most = asyncio.run(main())
    assert BURST <= most <= BURST + datagrams.RATE * (time.monotonic() - began) < 4000


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Certificate, Certificate]:
    """What the robot's site and the operator's show."""
    directory = tmp_path_factory.mktemp("tls")
    names = ["127.0.0.1", "localhost"]
    return own_certificate(directory / "tls.pem", names), own_certificate(directory / "site.pem", (), client=True)


def test_both_sites_live_by_tls_and_what_is_said(shown: tuple[Certificate, Certificate]) -> None:
    robots, operators = shown
    said: list[str] = []

    async def main(beside: int) -> tuple[str, str, int]:
        context = robots.server_context(operators.chain)
        async with live_rig.robot_here(tls=context, datagrams=beside) as (robot, url):
            at = f"{url}#sha256={robots.fingerprint}"
            receive, numbers = robot.host.receive, []

            def heard(message: Any, *, now: float) -> None:
                numbers.append((type(message), message.number))
                receive(message, now=now)

            robot.host.receive = heard  # type: ignore[method-assign]
            here = live_rig.operator_here(at, certificate=operators, say=said.append, datagrams=True)
            async with here as (operator, _):
                client = operator.robot
                wanted = DatagramState.THROUGH if not beside else DatagramState.BLOCKED
                await live_rig.until(lambda: client.datagrams is wanted and operator.operator.report is not None)
                await live_rig.until(lambda: (not beside or said) and len(numbers) > ALONE)
                await asyncio.sleep(0.3)
                assert max(Counter(numbers).values()) == 1, "no copy is given to the robot's site"
                attached = client.attached
                assert attached is not None
                assert attached.datagrams == "", "nobody needs the secret any more"
                if not beside:
                    await live_rig.until(lambda: robot.health()["datagrams"] == "through")
                return operator.health()["datagrams"], robot.health()["datagrams"], client.connections

    assert asyncio.run(main(0)) == ("through", "through", 1)
    assert not said
    mine, theirs, connections = asyncio.run(main(1))
    assert (mine, connections) == ("blocked", 1)
    assert theirs in {"none yet", "blocked"}
    assert len(said) == 1
    assert "UDP" in said[0]
    assert "sha256" not in said[0]


class Stranger:
    """An operator's site by docs/protocol.md alone."""

    def __init__(self, stream: Any, port: int) -> None:
        self.stream, self.number = stream, 0
        stream.send(json.dumps({
            "type": "hello", "protocol": 1, "role": "site", "name": "x", "session": "s", "datagrams": True,
        }))  # fmt: skip
        self.attached = json.loads(stream.recv(timeout=5.0))
        if "datagrams" not in self.attached:
            return
        made = HKDF(SHA256(), 84, b"", b"vrs datagrams 1").derive(self.attached["datagrams"].encode())
        self.id, self.there, self.back = made[:20], AESGCM(made[20:52]), AESGCM(made[52:])
        self.cookie = bytes(8)
        self.pieces: dict[tuple[int, int], bytes] = {}
        self.udp = socket.socket(type=socket.SOCK_DGRAM)
        self.udp.connect(("127.0.0.1", port))
        self.udp.settimeout(0.2)

    def close(self) -> None:
        self.udp.close()

    def send(self, **message: Any) -> None:
        text = json.dumps(message)
        self.stream.send(text)
        self.number += 1
        count = self.number.to_bytes(8, "big")
        sealed = self.there.encrypt(bytes(4) + count, self.cookie + bytes((0, 1)) + text.encode(), self.id)
        self.udp.send(self.id + count + sealed)

    def datagrams(self) -> Iterator[dict[str, Any]]:
        while True:
            try:
                data = self.udp.recv(2048)
            except TimeoutError:
                return
            assert len(data) <= 1200
            body = self.back.decrypt(bytes(4) + data[20:28], data[28:], data[:20])
            self.cookie, (k, pieces) = body[:8], body[8:10]
            first = int.from_bytes(data[20:28], "big") - k
            self.pieces[first, k] = body[10:]
            message = [self.pieces.get((first, k), b"") for k in range(pieces)]
            if pieces and all(message):
                yield json.loads(b"".join(message))


def test_a_stranger_sends_and_takes_them_by_the_document() -> None:
    def stranger(url: str) -> tuple[set[str], int]:
        port = int(url.rsplit(":", 1)[1].split("/")[0])
        with connect(url, subprotocols=["vrs.1.json"]) as stream:  # type: ignore[list-item]
            one = Stranger(stream, port)
            kinds: set[str] = set()
            most = 0
            began = time.monotonic()
            while not {"ping", "report"} <= kinds and time.monotonic() < began + 10.0:
                now = time.monotonic() - began
                one.send(
                    type="orders", epoch="1", number=one.number + 1, sent_at=now, newest=0, complete_until=now,
                    epoch_began=0.0,
                )  # fmt: skip
                for message in one.datagrams():
                    kinds.add(message["type"])
                    if message["type"] == "ping":
                        t = time.monotonic() - began
                        one.send(type="pong", number=message["number"], t=message["t"], received=t, answered=t)
                    else:
                        most = max(most, message["echo"][0] if "echo" in message else 0)
                    if kinds >= {"ping", "report"}:
                        break
            one.close()
            return kinds, most

    async def main() -> set[str]:
        async with live_rig.robot_here(datagrams=0) as (_, url):
            kinds, _ = await asyncio.to_thread(stranger, url)
            return kinds

    assert asyncio.run(main()) >= {"ping", "report"}


@pytest.mark.parametrize(("newest", "given"), [(ssl.TLSVersion.TLSv1_2, False), (ssl.TLSVersion.TLSv1_3, True)])
def test_the_secret_is_told_by_tls_1_3_alone(
    newest: ssl.TLSVersion, given: bool, shown: tuple[Certificate, Certificate]
) -> None:
    robots, operators = shown

    def told(url: str) -> bool:
        context = ssl.create_default_context(cafile=str(robots.chain))
        context.load_cert_chain(operators.chain)
        context.maximum_version = newest
        port = int(url.rsplit(":", 1)[1].split("/")[0])
        with connect(url, ssl=context, subprotocols=["vrs.1.json"]) as stream:  # type: ignore[list-item]
            one = Stranger(stream, port)
            if "datagrams" in one.attached:
                one.close()
            return "datagrams" in one.attached

    async def main() -> bool:
        async with live_rig.robot_here(tls=robots.server_context(operators.chain), datagrams=0) as (_, url):
            return await asyncio.to_thread(told, url)

    assert asyncio.run(main()) is given


def test_no_secret_is_shown() -> None:
    attached = Attached(1, "puma560", NOMINAL, "halt", 0.5, datagrams=SECRET)
    assert SECRET not in repr(attached)
    assert decode(encode(attached, Encoding.JSON), Encoding.JSON, allowed=Attached).datagrams == SECRET
