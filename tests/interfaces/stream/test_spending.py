"""What clients may spend: processor time and bytes, alone and together; what many ask for is made once."""

from __future__ import annotations

import asyncio
import random
import time

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from interfaces.link import LinkConditions
from interfaces.messages import Follow, Order, ViewForm, Want, control
from interfaces.messages.control import DirectionConditions, Impair, Network, Ping, ProblemCode, Role, Survey
from interfaces.messages.sites import Report
from interfaces.stream.codec import LARGEST, Encoding, decode, encode
from interfaces.stream.limits import Allowance, Allowances, ClientLimits
from interfaces.stream.server import Slices
from tests.interfaces.stream.served import HOME, make_hub, served
from tests.interfaces.stream.test_network import emulated
from tests.interfaces.stream.test_session import Peer, holder, to


def test_what_is_spent_at_once_is_waited_for_afterwards() -> None:
    allowance = Allowance(0.1, 1000.0, 5.0, burst=1.0)
    allowance.spend(0.1, 0.0, now=5.0)
    assert allowance.wait(now=5.0) == 0.0
    allowance.spend(0.05, 0.0, now=5.0)
    assert allowance.wait(now=5.0) == pytest.approx(0.5)
    assert allowance.wait(now=5.5) == pytest.approx(0.0)
    allowance.spend(0.0, 4000.0, now=5.5)
    assert allowance.wait(now=5.5) == pytest.approx(3.0)
    assert allowance.wait(now=1e6) == 0.0


def test_a_crowd_waits_together_and_who_commands_for_nobody() -> None:
    allowances = Allowances(ClientLimits(work=0.01, others=10.0, address=5.0), 0.0)
    crowd = [allowances.join("there", now=0.0) for _ in range(30)]
    other, commander = allowances.join("elsewhere", now=0.0), allowances.join("there", now=0.0)
    now, worked = 0.0, 0.0
    while now < 10.0:
        for one in crowd:
            if one[False].wait(now=now) == 0.0:
                one[False].spend(1e-3, 100.0, now=now)
                worked += 1e-3
        assert commander[True].wait(now=now) == 0.0
        assert other[False].wait(now=now) == 0.0, "another address isn't held up"
        now += 1e-2
    assert 0.4 < worked < 0.05 * 10.0 + 0.05 * 0.2 + 30e-3 + 0.1


def test_who_has_spent_too_much_is_told_that_its_messages_wait_once_a_second() -> None:
    hub = make_hub()
    peer, other = Peer(hub, now=5.0), Peer(hub, now=5.0)
    session = peer.session
    assert not session.say_waiting(session.wait(now=5.0), now=5.0)
    session.spend(10.0, now=5.0)
    said = [session.say_waiting(session.wait(now=now), now=now) for now in (5.0, 5.5, 5.9, 6.1)]
    assert said == [True, False, False, True]
    found = [(one.code, one.fatal, "its messages wait" in one.text) for one in peer.got(now=6.2)]
    assert found == [(ProblemCode.TOO_FAST, False, True)] * 2
    assert other.got(now=6.2) == []


def test_a_burst_is_worked_off_in_slices_and_who_commands_goes_first() -> None:
    done: list[tuple[int, str]] = []
    rounds = [0]

    async def work() -> None:
        slices, loop = Slices(2e-3), asyncio.get_running_loop()

        def count() -> None:
            rounds[0] += 1
            loop.call_soon(count)

        async def client(name: str, times: int) -> None:
            for _ in range(times):
                await slices.turn(first=name == "first")
                done.append((rounds[0], name))
                slices.spend(0.5e-3)

        count()
        await asyncio.gather(*(client(f"viewer {k}", 200) for k in range(5)), client("first", 50))

    asyncio.run(work())
    assert len(done) == 1050
    viewers = [at for at, name in done if name != "first"]
    assert max(viewers.count(at) for at in set(viewers)) <= 4 + 1, "no more than a slice in a round of the loop"
    assert max(at for at, name in done if name == "first") <= 2, "it never waited"
    last = {name: at for at, name in done if name != "first"}
    assert max(last.values()) - min(last.values()) < 10, "they take turns"


def planned(**options):
    hub = make_hub(limits=ClientLimits(**options))
    for k in range(200):
        hub.site.time(0.01 * k)
        hub.site.engine.execute(to(k, execute_at=100.0 + 3 * k))
    return hub


def test_a_timeline_is_made_and_written_once_for_all_who_ask(monkeypatch: pytest.MonkeyPatch) -> None:
    hub = planned(waiting=1 << 20)
    viewers = [Peer(hub, role=Role.VIEWER) for _ in range(5)]
    scenes = [m for peer in viewers for m in peer.tell(Follow(1, ViewForm.SEGMENTS), now=3.0) if m.kind == "scene"]
    edit = scenes[0].edit
    made: list[int] = []
    from interfaces.engine_server import journal

    parts = journal.parts
    monkeypatch.setattr(journal, "parts", lambda *given: made.append(given[2]) or parts(*given))
    found = []
    for peer in viewers:
        for _ in range(450):
            peer.session.receive(encode(Want(edit, 0), Encoding.MSGPACK), now=3.5)
        found.append(peer.session.advance(now=3.5))
    assert made == [0]
    first = [data for data in found[0] if b"history" in data[:40]]
    assert 1 <= len(first) <= 4
    for data in found[1:]:
        assert [one for one in data if b"history" in one[:40]] == first
        assert all(any(one is other for other in first) for one in data if b"history" in one[:40])


def test_a_survey_is_worked_out_now_and_then_and_each_is_answered() -> None:
    hub, _, _ = emulated()
    asked = []
    network = hub.emulation.network
    hub.emulation.network = lambda **named: asked.append(0) or network(**named)
    peers = [Peer(hub, role=Role.VIEWER) for _ in range(4)]
    answers = [
        m.answers for k in range(100) for peer in peers for m in peer.tell(Survey(k + 1), now=1.0 + k / 1000)
    ]
    assert answers == [k + 1 for k in range(100) for _ in peers]
    assert len(asked) <= 3


def test_whatever_raises_at_a_message_ends_that_client_s_connection_alone() -> None:
    hub = make_hub()
    mine, epoch = holder(hub)
    other = Peer(hub)
    other.session.seat.servlet.receive = lambda *given, **named: 1 / 0
    found = other.tell(Follow(1, ViewForm.SEGMENTS), now=0.2)
    assert (found[-1].code, found[-1].fatal) == (ProblemCode.FAILED, True)
    assert other.session.closing[0] == 1011
    third = Peer(hub, now=0.3)
    third.session.seat.servlet.advance = lambda **named: 1 / 0
    assert third.got(now=0.3)[-1].code == ProblemCode.FAILED
    assert mine.tell(Order(1, to(1), epoch), now=0.4)[-1].receipt is not None


NUMBERS = [
    "5e-324",
    "1e-308",
    "1e308",
    "-1e308",
    "nan",
    "inf",
    "-inf",
    "0",
    "-0.0",
    "1e-6",
    "1e-9",
    "0.5",
    "1",
    "3600",
    "1e400",
    "x",
]


def test_no_way_that_is_taken_ever_fails_and_others_say_what_is_allowed() -> None:
    rng = random.Random(7)
    hub, line, _ = emulated()
    mine, epoch = holder(hub)
    report = Report(1, 1, 0.0, 0, 0.0, 1.0, HOME, 0.0, 0.0)
    taken = refused = 0
    now = 0.2
    for k in range(700):
        one = [rng.choice(NUMBERS) for _ in range(5)]
        tau = rng.choice(("", "", "@" + rng.choice(NUMBERS)))
        delay = rng.choice((
            f"gamma:{one[0]},{one[1]}{tau}", f"gamma:{one[0]},{one[1]},{one[2]}{tau}", f"constant:{one[0]}",
            f"route:{one[0]},{rng.choice(('0', '3', '255', '-1', '1e9'))},{one[2]},{one[3]},{one[4]}{tau}",
            f"gamma:0.1,0.05{tau}", f"mon{tau}",
        ))  # fmt: skip
        loss = rng.choice(("0", one[3], f"burst:{one[3]},{one[4]}", "burst:0.2,4"))
        way = DirectionConditions(delay, loss, rng.choice(("datagram", "in-order")))
        now += 0.25
        found = mine.tell(Impair(k + 1, epoch, way, way), now=now)
        mine.tell(control.Beat(epoch), now=now)
        answer = next(m for m in found if isinstance(m, Network | control.Problem))
        if isinstance(answer, control.Problem):
            assert answer.code == ProblemCode.OUT_OF_RANGE, answer
            assert "must be" in answer.text
            refused += 1
            continue
        taken += 1
        for step in range(10):
            line.receive(report, now=now + 0.01 * step)
            line.advance(now=now + 0.01 * step)
        again = mine.tell(Survey(k + 1000), now=now + 0.2)
        assert any(isinstance(m, Network) for m in again), "its quantiles can be told"
    assert taken > 50
    assert refused > 200
    assert isinstance(line.link.conditions, LinkConditions)
    assert decode(encode(Survey(1), Encoding.JSON), Encoding.JSON, allowed=Survey, largest=LARGEST) == Survey(1)


def test_t11_viewers_at_all_they_may_spend_dont_hold_up_who_commands() -> None:
    """By sockets alone; the bar is wide, for other tests share the processor."""

    async def viewer(url: str, stop: asyncio.Event, edit: int) -> int:
        async with connect(url, subprotocols=[Subprotocol(Encoding.JSON)], max_size=None) as socket:
            reader = asyncio.create_task(_passed_over(socket))
            await socket.send(encode(control.Hello(1, Role.VIEWER, "viewer"), Encoding.JSON).decode())
            await socket.send(encode(Follow(1, ViewForm.SEGMENTS), Encoding.JSON).decode())
            sent = 0
            while not stop.is_set():
                for message in (Want(edit, 0), Want(0, None)):
                    await socket.send(encode(message, Encoding.JSON).decode())
                sent += 2
                await asyncio.sleep(1 / 220)
            reader.cancel()
            return sent

    async def session(url: str, edit: int) -> list[float]:
        trips: list[float] = []
        stop = asyncio.Event()
        async with connect(url, subprotocols=[Subprotocol(Encoding.JSON)], max_size=None) as socket:
            await socket.send(encode(control.Hello(1, Role.OPERATOR, "operator"), Encoding.JSON).decode())
            await socket.send(encode(control.Acquire(1), Encoding.JSON).decode())
            crowd = [asyncio.create_task(viewer(url, stop, edit)) for _ in range(5)]
            for number in range(1, 101):
                sent = time.perf_counter()
                await socket.send(encode(Ping(number, 0.0), Encoding.JSON).decode())
                while '"pong"' not in str(await socket.recv())[:20]:
                    pass
                trips.append(time.perf_counter() - sent)
                await asyncio.sleep(0.02)
            stop.set()
            await asyncio.gather(*crowd)
        return trips

    with served() as serving:
        for k in range(150):
            serving.call(serving.hub.site.engine.execute, to(k, execute_at=1000.0 + 3 * k))
        edit = serving.call(serving.hub.site.journal.look)
        trips = asyncio.run(session(f"ws://127.0.0.1:{serving.port}/ws", edit))
    assert sorted(trips)[len(trips) // 2] < 0.3
    assert max(trips) < 1.5


async def _passed_over(socket: ClientConnection) -> None:
    async for _ in socket:
        pass
