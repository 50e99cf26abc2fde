"""The lease of a connection as control: asked for without waiting, and given when the robot follows."""

from __future__ import annotations

from types import SimpleNamespace

from interfaces.messages.control import Lease, Problem, ProblemCode
from interfaces.val2.monitor.control import FOLLOW_TIMEOUT, LEASE_TIMEOUT, ControlState, LeaseControl
from robots.onboard.lease import LeaseState

FREE = Lease(LeaseState.FREE)
ENDING = Lease(LeaseState.ENDING)
MINE = Lease(LeaseState.HELD, 7, "me", yours=True)
THEIRS = Lease(LeaseState.HELD, None, "Ann")
SHARED = Lease(LeaseState.HELD, 7, "Ann", shared=True)


class Server:
    """A connection."""

    def __init__(self, lease, *, halted=""):
        self.lease, self.is_connected = lease, True
        self.state = SimpleNamespace(connected=True, halted=halted)
        self.asked = self.released = self.resumed = self.lapses = 0
        self.shown, self.answers = [], {}

    def acquire(self, *, wait):
        assert wait == 0.0
        self.asked += 1

    def ask_to_share(self, session):
        self.shown.append(session)
        return len(self.shown)

    def answer(self, number):
        return self.answers.get(number)

    def release(self, *, wait):
        assert wait == 0.0
        self.released += 1

    def resume(self, *, wait):
        assert wait == 0.0
        self.resumed += 1


class Ann:
    """A person with a session of her own."""

    session = "ann's"

    def __init__(self, *, holds=True):
        self.holds, self.taken = holds, 0

    def take(self):
        self.taken += 1


def test_a_free_lease_is_asked_for_and_waited_for():
    server = Server(FREE)
    control = LeaseControl(server)
    assert control.request(now=0.0) is ControlState.PENDING
    assert control.request(now=0.05) is ControlState.PENDING
    assert server.asked == 1
    server.lease = MINE
    assert control.request(now=0.1) is ControlState.HELD
    control.release(now=0.2)
    assert server.released == 1


def test_a_lease_that_somebody_has_is_said_at_once_and_asked_for_anew_later():
    server = Server(THEIRS)
    control = LeaseControl(server)
    assert "Ann" in control.request(now=0.0)
    server.lease = FREE
    assert control.request(now=5.0) is ControlState.PENDING
    assert server.asked == 1


def test_a_robot_that_never_rests_ends_the_wait():
    server = Server(ENDING)
    control = LeaseControl(server)
    times = [k * 0.02 for k in range(int(LEASE_TIMEOUT / 0.02))]
    assert all(control.request(now=t) is ControlState.PENDING for t in times)
    assert server.asked <= LEASE_TIMEOUT / 0.25 + 1
    assert "at rest" in control.request(now=LEASE_TIMEOUT)
    assert control.request(now=LEASE_TIMEOUT + 1.0) is ControlState.PENDING


def test_a_robot_that_does_not_follow_yet_is_waited_for():
    server = Server(MINE, halted="not met")
    control = LeaseControl(server)
    assert control.request(now=1.0) is ControlState.PENDING
    assert control.request(now=FOLLOW_TIMEOUT) is ControlState.PENDING
    server.state.halted = ""
    assert control.request(now=FOLLOW_TIMEOUT) is ControlState.HELD
    server.state.halted = "the link"
    assert control.request(now=1.0 + FOLLOW_TIMEOUT) is ControlState.HELD
    control.resume(now=20.0)
    assert server.resumed == 1


def test_a_lost_connection_is_said():
    server = Server(MINE)
    server.is_connected = False
    assert "no connection" in LeaseControl(server).request(now=0.0)


def test_a_robot_that_stopped_by_itself_is_told_of_and_resumed_until_it_follows():
    server = Server(MINE, halted="nothing came")
    control = LeaseControl(server)
    assert str(control.fault(now=0.0)) == "*Robot halted* nothing came; ENABLE POWER lets it go on"
    assert server.resumed == 0
    control.resume(now=1.0)
    assert server.resumed == 1
    control.fault(now=1.1)
    assert server.resumed == 1
    control.fault(now=1.3)
    assert server.resumed == 2
    server.state = SimpleNamespace(connected=True, halted="")
    assert control.fault(now=1.6) is None
    server.state = SimpleNamespace(connected=True, halted="again")
    assert control.fault(now=2.0) is not None
    assert server.resumed == 2


def test_resuming_is_given_up_after_a_while():
    server = Server(MINE, halted="nothing came")
    control = LeaseControl(server)
    control.resume(now=0.0)
    for k in range(1, 200):
        control.fault(now=0.1 * k)
    assert 5 <= server.resumed <= LEASE_TIMEOUT / 0.25 + 1


def test_who_only_looks_is_told_no_way_to_go_on_and_asks_for_none():
    server = Server(THEIRS, halted="nothing came")
    control = LeaseControl(server)
    control.resume(now=0.0)
    assert str(control.fault(now=0.1)) == "*Robot halted* nothing came"
    assert server.resumed == 0


def test_a_server_that_is_gone_is_told_of():
    server = Server(MINE)
    server.is_connected = False
    assert LeaseControl(server).fault(now=0.0).what == "No connection"


def test_the_lease_of_a_person_is_shared_by_showing_her_session_once():
    server, ann = Server(THEIRS), Ann()
    control = LeaseControl(server)
    assert [control.request(ann, now=0.1 * k) for k in range(20)] == [ControlState.PENDING] * 20
    assert server.shown == ["ann's"]
    assert not control.held
    server.lease, server.answers = SHARED, {1: SHARED}
    assert control.request(ann, now=2.0) is ControlState.HELD
    assert control.held
    assert control.request(now=2.1) == "Ann has control"
    assert (server.asked, ann.taken) == (0, 0)
    control.release(now=3.0)
    assert (server.released, control.held) == (1, False)
    assert control.request(ann, now=3.0) is ControlState.PENDING, "what was given back isn't there any more"


def test_a_person_without_control_takes_it_herself_or_is_told_who_has_it():
    server, ann = Server(FREE), Ann(holds=False)
    control = LeaseControl(server)
    assert control.request(ann, now=0.0) is ControlState.PENDING
    assert (ann.taken, server.asked, server.shown) == (1, 0, [])
    server.lease = THEIRS
    assert control.request(ann, now=0.05) is ControlState.PENDING, "she hasn't said yet that it's hers"
    ann.holds = True
    assert control.request(ann, now=0.1) is ControlState.PENDING
    server.answers = {1: Problem(ProblemCode.LEASE, "that session doesn't have the lease")}
    assert control.request(ann, now=0.2) == "that session doesn't have the lease"
    ann.holds = False
    assert control.request(ann, now=0.3) == "Ann has control"
    server.lease = FREE
    assert control.request(ann, now=1.0) is ControlState.PENDING
    assert "wasn't given" in control.request(ann, now=1.0 + LEASE_TIMEOUT)
    assert server.asked == 0


def test_the_share_of_one_person_is_none_of_another():
    server, ann, bea = Server(SHARED), Ann(), Ann(holds=False)
    bea.session = "bea's"
    control = LeaseControl(server)
    control.request(ann, now=0.0)
    assert control.request(ann, now=0.1) is ControlState.HELD
    assert control.request(bea, now=0.2) == "Ann has control"
    bea.holds = True
    assert control.request(bea, now=0.3) is ControlState.PENDING
    assert server.shown == ["ann's", "bea's"]


def test_a_lapse_is_told_once_and_why():
    server = Server(SHARED)
    control = LeaseControl(server)
    assert control.pop_lapse() == ""
    server.lease, server.lapses = THEIRS, 1
    assert "another command" in control.pop_lapse()
    assert control.pop_lapse() == ""
    server.lease, server.lapses = ENDING, 2
    assert control.pop_lapse() == "control has ended"
