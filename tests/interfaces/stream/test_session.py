"""One connection as the server sees it: greeted, bounded, and no harm to others."""

import random

import msgspec
import numpy as np
import pytest

from interfaces.messages import Ask, Follow, Order, Pulse, Reply, ViewForm, Want, control
from interfaces.messages.compact import CompactDecoder
from interfaces.messages.control import Notice, Ping, Pong, ProblemCode, Role
from interfaces.stream.codec import LARGEST, Encoding, decode, encode
from interfaces.stream.limits import ClientLimits
from tests.interfaces.joined import to
from tests.interfaces.stream.served import ADMIN, HOME, make_hub
from vrs import Stop

COMING = Reply | Notice
BOTH = pytest.mark.parametrize("encoding", list(Encoding))


class Peer:
    """A client that speaks plain messages to a session."""

    def __init__(self, hub, *, encoding=Encoding.MSGPACK, role=Role.OPERATOR, now=0.0, greet=True, **hello):
        self.hub, self.encoding = hub, encoding
        self.session = hub.open(encoding, now=now)
        if greet:
            self.first = self.tell(control.Hello(control.PROTOCOL, role, "peer", **hello), now=now)
            self.welcome = self.first[0]

    def raw(self, data, *, now):
        self.session.receive(data, now=now)
        return self.got(now=now)

    def got(self, *, now):
        self.hub.advance(now=now)
        found = []
        while batch := self.session.advance(now=now):
            found += [decode(data, self.encoding, allowed=COMING, largest=4 * LARGEST) for data in batch]
        return found

    def tell(self, message, *, now):
        data = encode(message, self.encoding)
        return self.raw(data.decode() if self.encoding is Encoding.JSON else data, now=now)


def kinds(messages):
    return [message.kind for message in messages]


@BOTH
def test_it_is_greeted(encoding):
    hub = make_hub()
    peer = Peer(hub, encoding=encoding, now=1.5)
    welcome = peer.welcome
    assert isinstance(welcome, control.Welcome)
    assert (welcome.role, welcome.robot, welcome.now) == ("operator", "puma560", 1.5)
    assert (welcome.rates, welcome.instance, welcome.resumed) == ((60.0, 30.0, 10.0), "one", False)
    assert (welcome.limits.q_min == hub.site.engine.model.limits.q_min).all()
    assert welcome.poses["nominal"].tolist() == HOME.tolist()
    assert not welcome.lease.yours
    assert peer.tell(Ping(7, 3.25), now=2.0) == [Pong(7, 3.25, 2.0, 2.0)]


def closed(peer, code, problem, *, now):
    last = peer.got(now=now)[-1]
    assert (last.kind, last.code, last.fatal) == ("problem", problem, True)
    assert peer.session.closing[0] == code


def test_hello_must_come_in_time():
    peer = Peer(make_hub(), greet=False)
    assert not peer.session.is_due(1.999)
    assert peer.got(now=1.999) == []
    assert peer.session.is_due(2.0)
    closed(peer, 1008, ProblemCode.HELLO_LATE, now=2.0)


@pytest.mark.parametrize(
    ("message", "problem"),
    [
        (Ping(1, 0.0), ProblemCode.HELLO_EXPECTED),
        (Order(1, to(1)), ProblemCode.HELLO_EXPECTED),
        (control.Hello(control.PROTOCOL, Role.ADMIN, "x"), ProblemCode.REFUSED),
        (control.Hello(control.PROTOCOL, Role.ADMIN, "x", "b" * 43), ProblemCode.REFUSED),
        (control.Hello(control.PROTOCOL, Role.SITE, "x"), ProblemCode.REFUSED),
        (control.Hello(2, Role.VIEWER, "x"), ProblemCode.VERSION),
    ],
)
def test_who_is_not_let_in(message, problem):
    hub = make_hub()
    peer = Peer(hub, greet=False)
    peer.session.receive(encode(message, Encoding.MSGPACK), now=0.5)
    closed(peer, 1008, problem, now=0.5)
    peer.session.receive(encode(control.Hello(control.PROTOCOL, Role.VIEWER, "x"), Encoding.MSGPACK), now=0.6)
    assert peer.session.seat is None
    assert hub.seats == 0


def test_an_admin_shows_a_token():
    assert Peer(make_hub(), role=Role.ADMIN, token=ADMIN).welcome.role is Role.ADMIN


def full(peer):
    assert (peer.first[-1].code, peer.session.closing[0]) == (ProblemCode.FULL, 1013)
    peer.hub.leave(peer.session, done=True, now=0.0)


def test_too_many_clients():
    hub = make_hub(limits=ClientLimits(clients=2))
    peers = [Peer(hub) for _ in range(2)]
    full(Peer(hub))
    hub.leave(peers[0].session, done=True, now=0.1)
    assert Peer(hub).welcome.kind == "welcome"


def test_connections_without_a_hello_take_nobodys_place():
    hub = make_hub(limits=ClientLimits(clients=4))
    silent = [Peer(hub, greet=False) for _ in range(8)]
    assert all(peer.session.closing is None for peer in silent)
    assert Peer(hub).welcome.kind == "welcome"
    silent += [Peer(hub, greet=False) for _ in range(10)]
    closed(silent[-1], 1013, ProblemCode.FULL, now=0.0)


def test_who_had_control_has_a_place_when_all_are_taken():
    hub = make_hub(limits=ClientLimits(clients=32))
    operator = Peer(hub)
    operator.tell(control.Acquire(1), now=0.0)
    hub.leave(operator.session, done=False, now=0.1)
    for _ in range(30):
        assert Peer(hub, role=Role.VIEWER).welcome.kind == "welcome"
    full(Peer(hub, role=Role.VIEWER))
    assert [Peer(hub).welcome.kind for _ in range(2)] == ["welcome"] * 2
    full(Peer(hub))
    back = Peer(hub, session=operator.welcome.session, now=0.5).welcome
    assert (back.resumed, back.lease.yours) == (True, True)


@BOTH
def test_t09_rubbish_is_answered_executes_nothing_and_ends_by_closing(encoding):
    hub = make_hub()
    peer, other = Peer(hub, encoding=encoding), Peer(hub)
    before = hub.site.engine.timeline
    bad = [b"", b"\x00", b"{", b'{"type":"order"}', b'{"type":"nothing"}', b"[1]", b"\xc1" * 100, bytes(range(256))]
    count = 0
    while peer.session.closing is None:
        data = bad[count % len(bad)]
        found = peer.raw(data.decode("latin-1") if encoding is Encoding.JSON else data, now=0.1)
        assert kinds(found) == ["problem"]
        count += 1
    assert count == 21
    assert peer.session.closing[0] == 1008
    assert hub.site.engine.timeline is before
    assert other.session.closing is None
    assert other.tell(Ping(1, 0.0), now=0.1) == [Pong(1, 0.0, 0.1, 0.1)]


def test_a_little_rubbish_now_and_then_is_forgiven():
    peer = Peer(make_hub())
    for k in range(100):
        assert kinds(peer.raw(b"\xc1", now=1.0 * k)) == ["problem"]
    assert peer.session.closing is None


def test_text_and_bytes_are_not_mixed_up():
    hub = make_hub()
    ping = Ping(1, 0.0)
    found = Peer(hub).raw(encode(ping, Encoding.JSON).decode(), now=0.0)
    found += Peer(hub, encoding=Encoding.JSON).raw(encode(ping, Encoding.MSGPACK), now=0.0)
    assert [message.code for message in found] == [ProblemCode.MALFORMED] * 2


def test_the_largest_message():
    peer = Peer(make_hub())
    assert peer.raw(b"\xc1" * 65536, now=0.0)[0].code is ProblemCode.MALFORMED
    peer.session.receive(b"\xc1" * 65537, now=0.0)
    closed(peer, 1009, ProblemCode.TOO_LARGE, now=0.0)


def test_too_fast_is_passed_over_told_once_a_second_and_closed():
    hub = make_hub(limits=ClientLimits(rate=100, burst=50, excess=20))
    peer, ping = Peer(hub), encode(Ping(1, 0.0), Encoding.MSGPACK)
    for _ in range(49):
        peer.session.receive(ping, now=0.0)
    assert kinds(peer.got(now=0.0)) == ["pong"] * 49
    for _ in range(20):
        peer.session.receive(ping, now=0.0)
    assert [message.code for message in peer.got(now=0.0)] == [ProblemCode.TOO_FAST]
    assert peer.session.closing is None
    peer.session.receive(ping, now=0.0)
    closed(peer, 1008, ProblemCode.TOO_FAST, now=0.0)


def test_at_the_rate_nothing_is_passed_over():
    hub = make_hub(limits=ClientLimits(rate=100, burst=5, excess=20))
    peer = Peer(hub)
    for k in range(1, 1000):
        assert kinds(peer.tell(Ping(k, 0.0), now=0.01001 * k)) == ["pong"]


def test_a_viewer_commands_nothing():
    hub = make_hub()
    peer = Peer(hub, role=Role.VIEWER)
    before = hub.site.engine.timeline
    for message in (Order(1, to(1)), Order(2, Stop()), control.Acquire(3), control.TakeOver(4)):
        found = peer.tell(message, now=0.1)
        assert [(problem.code, problem.number) for problem in found] == [(ProblemCode.NOT_ALLOWED, message.number)]
    assert hub.site.engine.timeline is before
    assert hub.robot.log == []
    assert kinds(peer.tell(Ask(1, 0.5), now=0.1)) == ["answer"]


def test_a_server_s_messages_are_not_taken_from_a_client():
    peer = Peer(make_hub())
    for message in (control.Hello(control.PROTOCOL, Role.VIEWER, "again"), peer.welcome.lease, Pulse(1, 0.0, 0.0)):
        assert [problem.code for problem in peer.tell(message, now=0.1)] == [ProblemCode.NOT_ALLOWED]


def holder(hub, **options):
    peer = Peer(hub, **options)
    lease = peer.tell(control.Acquire(1), now=options.get("now", 0.0))[0]
    assert lease.yours
    return peer, lease.epoch


def test_an_order_is_carried_out_once_however_often_it_comes():
    hub = make_hub()
    peer, epoch = holder(hub)
    order = Order(1, to(1), epoch)
    found = [peer.tell(order, now=0.1 + 0.01 * k) for k in range(5)]
    assert [kinds(messages) for messages in found] == [["outcome"]] * 5
    assert len({messages[0].receipt.command_id for messages in found}) == 1
    assert hub.site.engine.newest == 1


def test_t08_a_replay_by_somebody_else_executes_nothing():
    hub = make_hub()
    peer, epoch = holder(hub)
    thief = Peer(hub)
    found = thief.tell(Order(1, to(1), epoch), now=0.1)
    assert "no lease" in found[0].refusal
    assert hub.site.engine.newest == 0
    assert peer.tell(Order(1, to(1), epoch), now=0.2)[0].refusal == ""


@pytest.mark.parametrize("wrong", [0, 2**63, -1])
def test_t07_only_the_epoch_in_force_counts(wrong):
    hub = make_hub(epoch=2**62)
    peer, epoch = holder(hub)
    outcome = peer.tell(Order(1, to(1), max(epoch + wrong, 0) if wrong < 0 else wrong), now=0.1)[0]
    assert "no lease" in outcome.refusal
    assert hub.site.engine.newest == 0
    assert peer.tell(Order(2, to(1), epoch), now=0.2)[0].receipt is not None, "a refused number doesn't block"


def test_an_early_order_is_judged_when_its_turn_comes():
    hub = make_hub()
    peer, epoch = holder(hub)
    assert peer.tell(Order(2, to(2), epoch), now=0.1) == []
    peer.tell(control.Release(2, epoch), now=0.2)
    found = peer.tell(Order(1, to(1), epoch), now=0.3)
    assert [message.refusal[:8] for message in found if message.kind == "outcome"] == ["no lease"] * 2
    assert hub.site.engine.newest == 0


def test_an_outcome_is_told_again_after_the_lease_has_ended():
    hub = make_hub()
    peer, epoch = holder(hub)
    first = peer.tell(Order(1, to(1), epoch), now=0.1)[0]
    peer.tell(control.Release(2, epoch), now=0.2)
    again = [message for message in peer.tell(Order(1, to(1), epoch), now=0.3) if message.kind == "outcome"]
    assert [message.receipt.command_id for message in again] == [first.receipt.command_id]
    assert hub.site.engine.newest == 1


def test_a_slow_reader_gets_the_newest_frame_and_no_more_waits_than_it_may():
    hub = make_hub(limits=ClientLimits(waiting=4096))
    peer = Peer(hub, role=Role.VIEWER)
    peer.tell(Follow(1, ViewForm.FRAMES, 60.0), now=0.0)
    for k in range(1, 600):
        hub.advance(now=k / 60)
    assert peer.session.outbox.waiting == 0
    found = [message for message in peer.got(now=10.0) if message.kind == "broadcast"]
    assert len(found) == 1
    assert found[0].frame.made_at == pytest.approx(10.0, abs=0.02)


@pytest.mark.parametrize("delay", [0.0, 0.1])
@pytest.mark.parametrize("asks", [False, True])
def test_a_slow_reader_of_compact_frames_goes_on_from_a_key_frame(delay, asks):
    hub, reader = make_hub(limits=ClientLimits(waiting=1024)), CompactDecoder()
    peer = Peer(hub, role=Role.VIEWER)

    def read(now):
        for message in peer.got(now=now):
            if message.kind == "compact":
                for found in reader.receive(message):
                    assert np.abs(found.frame.q - hub.site.engine.joints(found.frame.t)).max() < 1e-5

    peer.session.receive(encode(Follow(1, ViewForm.COMPACT, 60.0, delay), Encoding.MSGPACK), now=0.0)
    for k in range(1, 60):
        hub.advance(now=k / 60)
        read(k / 60)
    assert reader.number >= 53
    hub.site.engine.execute(to(1))
    for k in range(60, 600):
        hub.advance(now=k / 60)
        if asks:
            # Each message of the client lets the session look for what it has for it.
            peer.session.receive(encode(Ask(k), Encoding.MSGPACK), now=k / 60)
        assert peer.session.outbox.waiting <= 1024
    for k in range(600, 640):
        hub.advance(now=k / 60)
        read(k / 60)
        if reader.lacking:
            peer.session.receive(encode(Follow(1, ViewForm.COMPACT, 60.0, delay), Encoding.MSGPACK), now=k / 60)
    assert not reader.lacking
    assert reader.number >= 630


def test_one_who_asks_and_never_reads_costs_little():
    hub = make_hub(limits=ClientLimits(rate=1e5, burst=1e5, waiting=32768))
    peer, epoch = holder(hub)
    for k in range(300):
        hub.site.time(0.01 * k)
        hub.site.engine.execute(to(k, execute_at=100.0 + 3 * k))
    peer.session.receive(encode(Follow(1, ViewForm.SEGMENTS), Encoding.MSGPACK), now=4.0)
    worst = 0
    for k in range(2, 700):
        for message in (Ask(k, 0.01 * k), Want(300, 0), Want(0, None), Order(1, to(1), epoch)):
            peer.session.receive(encode(message, Encoding.MSGPACK), now=4.0 + 0.0001 * k)
        worst = max(worst, peer.session.outbox.waiting)
    assert worst <= hub.limits.waiting
    assert peer.session.outbox.dropped > 0
    assert peer.session.closing is None
    found = peer.got(now=5.0)
    assert kinds(peer.tell(Ask(10_000, 0.5), now=5.0))[-1:] == ["answer"], "it's served again when it reads"
    assert "scene" in kinds(found)


def test_random_bytes_never_do_anything_else():
    rng = random.Random(5)
    hub = make_hub(limits=ClientLimits(bad=1000, rate=1e5, burst=1e5))
    other, epoch = holder(hub)
    valid = [encode(m, Encoding.MSGPACK) for m in (Order(1, to(1), epoch), Ask(1, 0.0), Ping(1, 0.0),
             control.Acquire(1), control.Beat(epoch), Follow(1, ViewForm.SEGMENTS), Want(1, 0))]  # fmt: skip
    peer = Peer(hub)
    for _ in range(900):
        data = bytearray(rng.choice(valid))
        for _ in range(rng.randrange(1, 4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        peer.session.receive(bytes(data[: rng.randrange(len(data) + 1)]), now=0.1)
        peer.got(now=0.1)
    assert peer.session.closing is None
    assert hub.site.engine.newest == 0
    assert hub.robot.log == [("began", epoch)]
    assert other.tell(Ping(1, 0.0), now=0.1)[-1].kind == "pong"


def test_what_many_get_is_written_once(monkeypatch):
    hub = make_hub(rates=(50.0,))
    peers = [Peer(hub, role=Role.VIEWER) for _ in range(20)]
    for peer in peers:
        peer.session.receive(encode(Follow(1, ViewForm.FRAMES, 50.0), Encoding.MSGPACK), now=0.0)
        peer.got(now=0.0)
    hub.advance(now=0.02)
    frames = [peer.session.advance(now=0.02) for peer in peers]
    assert len({id(batch[-1]) for batch in frames}) == 1
    assert msgspec.msgpack.decode(frames[0][-1])["type"] == "broadcast"
