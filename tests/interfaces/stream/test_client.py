"""A client core and a hub joined in memory, in virtual time, with connections that are lost."""

import numpy as np
import pytest

from interfaces.clients.designer import Designer
from interfaces.clients.observer import Observer
from interfaces.clients.viewer import Viewer
from interfaces.messages import Order, ViewForm, control
from interfaces.messages.control import Pong, ProblemCode, Role
from interfaces.stream.client import FIRST_PONGS, KEPT, UNKNOWN, ClientCore, Phase
from interfaces.stream.codec import Encoding, encode
from tests.interfaces.joined import to
from tests.interfaces.stream.joined import Joined
from tests.interfaces.stream.served import ADMIN
from tests.memory import values_held

BOTH = pytest.mark.parametrize("encoding", list(Encoding))


def operator(joined, **options):
    core = joined.client(**options)
    designer = Designer(core.port)
    joined.parts[core].append(designer)
    joined.run(0.5)
    assert core.phase is Phase.OPEN
    return core, designer


def lease(joined, core, kind=control.Acquire):
    return joined.wish(core, kind)


@BOTH
def test_the_four_interfaces_over_a_connection(encoding):
    joined = Joined()
    core, designer = operator(joined, encoding=encoding)
    assert lease(joined, core).yours
    issued = designer.issue(to(1), now=joined.time(core), execute_in=0.2)
    joined.run(0.1)
    assert designer.issued(issued.number).receipt.status == "accepted"
    observer = Observer(core.port)
    joined.parts[core].append(observer)
    viewers = {}
    for form in ViewForm:
        peer = joined.client(role=Role.VIEWER, encoding=encoding)
        joined.run(0.1)
        viewers[form] = Viewer(peer.port, rate=30.0, form=form)
        joined.parts[peer].append(viewers[form])
    number = observer.ask(1.0, now=joined.time(core))
    joined.run(1.0)
    engine = joined.hub.site.engine
    assert observer.observation(number).frame.q.tolist() == engine.joints(1.0).tolist()
    for form, viewer in viewers.items():
        shown, near = viewer.history, 1e-5 if form is ViewForm.COMPACT else 1e-9
        assert len(shown) > 25
        assert all(np.abs(frame.q - engine.joints(frame.t)).max() <= near for frame in shown)
    assert viewers[ViewForm.SEGMENTS].timeline.end == engine.timeline.end


@pytest.mark.parametrize("ahead", [0.0, 100.0, -3.0, 1e6])
def test_it_knows_session_time(ahead):
    joined = Joined()
    core, _ = operator(joined, ahead=ahead)
    joined.run(2.0)
    assert abs(joined.time(core) - joined.now) <= core.sync.uncertainty(joined.now + ahead)
    assert core.sync.uncertainty(joined.now + ahead) < 0.01


def test_of_the_first_round_trips_the_shortest_tells_session_time():
    joined = Joined()
    welcome = encode(operator(joined)[0].welcome, Encoding.MSGPACK)
    core = ClientCore()
    core.connected(now=0.0)
    core.receive(welcome, now=0.0)
    trips = [1.0] * FIRST_PONGS
    trips[1] = 0.5
    for number, trip in enumerate(trips):
        sent = 2.0 * number
        assert core.time(sent) is None
        # The way there takes all of it, but for the shortest.
        there = 100.0 + sent + (0.25 if trip == 0.5 else trip)
        core.receive(encode(Pong(1 + number, sent, there, there), Encoding.MSGPACK), now=sent + trip)
    assert core.phase is Phase.OPEN
    assert core.time(50.0) == pytest.approx(150.0, abs=1e-3)


def test_an_answer_to_what_has_not_been_asked_yet_tells_no_time():
    joined = Joined()
    core, _ = operator(joined)
    local = joined.now + joined.ahead[core]
    before = core.time(local)
    for pong in (Pong(9, local + 1.0, 3.0, 3.0), Pong(9, local - 0.01, 7.0, 6.0)):
        core.receive(encode(pong, Encoding.MSGPACK), now=local)
        assert core.time(local) == before


def test_orders_that_are_never_answered_are_kept_in_number():
    core = ClientCore()
    for number in range(1, 2 * KEPT):
        core.port.send(Order(number, to(1), 0), now=0.0)
        core.advance(now=0.0)
        if number == KEPT:
            full = values_held(core)
    assert values_held(core) <= 1.05 * full


def test_beats_keep_the_lease_and_silence_loses_it():
    joined = Joined()
    core, _ = operator(joined)
    epoch = lease(joined, core).epoch
    joined.run(10.0)
    assert core.epoch == epoch
    joined.clients[core] = None
    joined.run(2.1)
    assert joined.hub.robot.log[-1] == ("ended", epoch, "expired")


def test_who_has_no_lease_is_refused_and_goes_on_when_it_has():
    joined = Joined()
    core, designer = operator(joined)
    refused = designer.issue(to(1), now=joined.time(core))
    joined.run(0.1)
    assert "no lease" in designer.issued(refused.number).refusal
    lease(joined, core)
    accepted = designer.issue(to(1), now=joined.time(core))
    joined.run(0.1)
    assert designer.issued(accepted.number).receipt is not None
    assert joined.hub.site.engine.newest == 1


def test_take_over_and_release():
    joined = Joined()
    core, designer = operator(joined)
    admin, commands = operator(joined, role=Role.ADMIN, token=ADMIN)
    lease(joined, core)
    assert lease(joined, core, control.TakeOver).code is ProblemCode.LEASE
    lease(joined, admin, control.TakeOver)
    joined.run(0.1)
    assert (core.epoch, admin.epoch) == (0, 2)
    mine, theirs = (d.issue(to(1), now=joined.time(core)) for d in (designer, commands))
    joined.run(0.1)
    assert "no lease" in designer.issued(mine.number).refusal
    assert commands.issued(theirs.number).refusal == ""
    assert joined.wish(admin, control.Release).state == "free"


def test_a_share_commands_without_beats_and_counts_its_lapses():
    joined = Joined()
    core, designer = operator(joined)
    other, commands = operator(joined)
    epoch = lease(joined, core).epoch
    share = joined.wish(other, lambda number: control.Share(number, core.welcome.session))
    assert (share.shared, other.epoch, other.lapses) == (True, epoch, 0)
    joined.run(5.0)
    assert other.epoch == epoch
    mine = commands.issue(to(1), now=joined.time(other))
    joined.run(0.1)
    assert commands.issued(mine.number).receipt.status == "accepted"
    designer.issue(to(2), now=joined.time(core))
    joined.run(0.1)
    assert (other.epoch, other.lapses, core.lapses) == (0, 1, 0)
    joined.clients[core] = None
    assert joined.wish(other, lambda number: control.Share(number, core.welcome.session)).shared
    joined.run(2.1)
    assert joined.hub.robot.log[-1] == ("ended", epoch, "expired")
    assert (other.epoch, other.lapses) == (0, 2)


def test_a_wish_that_was_refused_leaves_nothing_to_do():
    joined = Joined()
    core, _ = operator(joined)
    other, _ = operator(joined)
    lease(joined, core)
    assert lease(joined, other).code is ProblemCode.LEASE
    assert other.next_deadline() > joined.now + joined.ahead[other]


def test_an_order_is_carried_out_once_whenever_the_connection_is_lost():
    """The connection is cut at every moment between sending and the answer, and taken up again."""
    for moment in range(6):
        joined = Joined()
        core, designer = operator(joined)
        lease(joined, core)
        issued = [designer.issue(to(k), now=joined.time(core), execute_in=1.0 + k) for k in range(3)]
        local = joined.now + joined.ahead[core]
        session = joined.clients[core]
        sent = core.advance(now=local) if moment > 0 else ()
        for data in sent[: max(moment - 2, 0)]:
            session.receive(data, now=joined.now)
        if moment == 5:
            for data in session.advance(now=joined.now):
                core.receive(data, now=local)
        joined.cut(core)
        joined.run(0.5)
        joined.plug(core)
        joined.run(0.2)
        found = [designer.issued(one.number) for one in issued]
        assert [one.refusal for one in found] == ["", "", ""]
        assert [one.receipt.command_id for one in found] == [1, 2, 3]
        assert core.sessions == 1
        assert joined.hub.site.engine.newest == 3


def test_an_order_of_a_lost_session_is_unknown_and_later_ones_are_carried_out():
    joined = Joined()
    core, designer = operator(joined)
    lease(joined, core)
    before = designer.issue(to(1), now=joined.time(core))
    joined.run(0.1)
    lost = designer.issue(to(2), now=joined.time(core))
    for data in core.advance(now=joined.now + joined.ahead[core]):
        joined.clients[core].receive(data, now=joined.now)
    joined.cut(core)
    unsent = designer.issue(to(3), now=joined.time(core))
    joined.run(31.0)
    joined.plug(core)
    joined.run(0.5)
    assert core.sessions == 2
    assert designer.issued(before.number).receipt.command_id == 1
    assert designer.issued(lost.number).refusal == UNKNOWN
    assert "no lease" in designer.issued(unsent.number).refusal, "its epoch has ended"
    lease(joined, core)
    after = designer.issue(to(4), now=joined.time(core))
    joined.run(0.5)
    assert designer.issued(after.number).refusal == ""
    assert not designer.pending
    assert joined.hub.site.engine.newest == 3


def test_nothing_issued_before_a_long_outage_moves_the_robot_after_it():
    joined = Joined()
    core, designer = operator(joined)
    epoch = lease(joined, core).epoch
    joined.clients[core] = None
    issued = [designer.issue(to(k), now=joined.time(core) + k) for k in range(5)]
    joined.run(4.0)
    core.disconnected()
    joined.plug(core)
    joined.run(0.3)
    assert lease(joined, core).epoch == epoch + 1
    joined.run(6.0)
    assert all("no lease" in designer.issued(one.number).refusal for one in issued)
    assert joined.hub.site.engine.newest == 0


def test_another_server_is_another_timeline():
    joined = Joined()
    core, _ = operator(joined)
    assert (core.sessions, core.welcome.instance) == (1, "one")
    joined.cut(core)
    other = Joined()
    object.__setattr__(other.hub.config, "instance", "two")
    joined.hub, joined.now = other.hub, 0.0
    joined.ahead[core] += 50.0
    joined.plug(core)
    joined.run(0.5)
    assert (core.sessions, core.welcome.instance) == (2, "two")
    assert abs(joined.time(core) - joined.now) < 0.02


def test_wishes_are_answered_when_the_connection_is_lost():
    joined = Joined()
    core, _ = operator(joined)
    number = core.wish(control.Acquire, now=joined.now + 100.0)
    assert core.answer(number) is None
    joined.cut(core)
    assert core.answer(number).code is ProblemCode.STOPPING
    again = core.wish(control.Acquire, now=joined.now + 100.0)
    assert core.answer(again).code is ProblemCode.STOPPING


def test_a_refused_client_says_why_and_comes_no_more():
    joined = Joined()
    core = joined.client(role=Role.ADMIN, token="x" * 43)
    joined.run(0.1)
    assert core.phase is Phase.CLOSED
    assert core.problem.code is ProblemCode.REFUSED
    assert joined.closed[core][0] == 1008


def test_a_silent_server_is_given_up():
    joined = Joined()
    core, _ = operator(joined)
    joined.clients[core] = None
    local = joined.now + joined.ahead[core]
    assert not core.is_silent(local + 3.9)
    assert core.is_silent(local + 5.1)
