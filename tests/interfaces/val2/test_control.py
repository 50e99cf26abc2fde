"""The lease of a client as control: asked for without waiting, and given when the robot follows."""

from __future__ import annotations

from types import SimpleNamespace

from interfaces.messages.control import Acquire, Lease, Problem, ProblemCode, Release, Resume, Share
from interfaces.val2.monitor.control import (
    FOLLOW_TIMEOUT,
    LEASE_TIMEOUT,
    ControlState,
    LeaseControl,
    ServedControl,
)
from robots.onboard.lease import LeaseState

FREE = Lease(LeaseState.FREE)
ENDING = Lease(LeaseState.ENDING)
MINE = Lease(LeaseState.HELD, 7, "me", yours=True)
THEIRS = Lease(LeaseState.HELD, None, "Ann")
SHARED = Lease(LeaseState.HELD, 7, "Ann", shared=True)


class Server:
    """A client, and what it asked."""

    def __init__(self, lease, *, halted="", lender=""):
        self.lease, self.is_connected = lease, True
        self.state = SimpleNamespace(connected=True, halted=halted)
        self.lapses = 0
        self.wishes, self.acquired_for, self.lender = [], [], lender

    def ask(self, make):
        wish = make(1)
        self.wishes.append(wish)
        if not isinstance(wish, Share):
            return None
        if wish.session != self.lender:
            return Problem(ProblemCode.LEASE, "that session doesn't have the lease")
        self.lease = SHARED
        return self.lease

    def let_acquire(self, session):
        self.acquired_for.append(session)

    def count(self, kind):
        return sum(isinstance(wish, kind) for wish in self.wishes)


def test_a_free_lease_is_asked_for_and_waited_for():
    server = Server(FREE)
    control = LeaseControl(server)
    assert control.request(now=0.0) is ControlState.PENDING
    assert control.request(now=0.05) is ControlState.PENDING
    assert server.wishes == [Acquire(1)]
    server.lease = MINE
    assert control.request(now=0.1) is ControlState.HELD
    control.release()
    assert server.wishes == [Acquire(1), Release(1, 7)]
    assert not control.held
    assert control.request(now=0.2) is ControlState.PENDING, "what was given back isn't there any more"


def test_a_lease_that_somebody_has_is_said_at_once_and_asked_for_anew_later():
    server = Server(THEIRS)
    control = LeaseControl(server)
    assert control.request(now=0.0) == "Ann has control"
    server.lease = FREE
    assert control.request(now=5.0) is ControlState.PENDING
    assert server.count(Acquire) == 1


def test_a_robot_that_never_rests_ends_the_wait():
    server = Server(ENDING)
    control = LeaseControl(server)
    times = [k * 0.02 for k in range(int(LEASE_TIMEOUT / 0.02))]
    assert all(control.request(now=t) is ControlState.PENDING for t in times)
    assert server.count(Acquire) <= LEASE_TIMEOUT / 0.25 + 1
    assert control.request(now=LEASE_TIMEOUT) == "the robot isn't at rest yet: try again"
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
    assert server.wishes == [Resume(1, 7)]


def test_a_lost_connection_is_said():
    server = Server(MINE)
    server.is_connected = False
    assert "no connection" in LeaseControl(server).request(now=0.0)


def test_a_robot_that_stopped_by_itself_is_told_of_and_resumed_until_it_follows():
    server = Server(MINE, halted="nothing came")
    control = LeaseControl(server)
    assert str(control.fault(now=0.0)) == "*Robot halted* nothing came; ENABLE POWER lets it go on"
    assert server.wishes == []
    control.resume(now=1.0)
    assert server.count(Resume) == 1
    control.fault(now=1.1)
    assert server.count(Resume) == 1
    control.fault(now=1.3)
    assert server.count(Resume) == 2
    server.state = SimpleNamespace(connected=True, halted="")
    assert control.fault(now=1.6) is None
    server.state = SimpleNamespace(connected=True, halted="again")
    assert control.fault(now=2.0) is not None
    assert server.count(Resume) == 2


def test_resuming_is_given_up_after_a_while():
    server = Server(MINE, halted="nothing came")
    control = LeaseControl(server)
    control.resume(now=0.0)
    for k in range(1, 200):
        control.fault(now=0.1 * k)
    assert 5 <= server.count(Resume) <= LEASE_TIMEOUT / 0.25 + 1


def test_who_only_looks_is_told_no_way_to_go_on_and_asks_for_none():
    server = Server(THEIRS, halted="nothing came")
    control = LeaseControl(server)
    control.resume(now=0.0)
    assert str(control.fault(now=0.1)) == "*Robot halted* nothing came"
    control.release()
    assert server.wishes == []


def test_a_server_that_is_gone_is_told_of():
    server = Server(MINE)
    server.is_connected = False
    assert LeaseControl(server).fault(now=0.0).what == "No connection"


def test_the_lease_of_a_person_is_shared_once_and_is_none_of_the_controllers_own():
    server = Server(THEIRS, lender="ann's")
    control = ServedControl(server)
    assert control.request("ann's", now=0.0) is ControlState.HELD
    assert control.request("ann's", now=0.1) is ControlState.HELD
    assert server.wishes == [Share(1, "ann's")]
    assert control.held
    assert control.request(now=0.2) == "Ann has control"
    control.release()
    assert (server.count(Release), control.held) == (1, False)


def test_a_person_without_control_gets_it_or_is_told_who_has_it():
    server = Server(FREE)
    control = ServedControl(server)
    assert control.request("ann's", now=0.0) is ControlState.PENDING
    assert (server.acquired_for, server.count(Acquire)) == (["ann's"], 0)
    server.lease, server.lender = THEIRS, "ann's"
    assert control.request("ann's", now=0.05) is ControlState.HELD
    server.lease, server.lender = THEIRS, ""
    assert control.request("ann's", now=0.3) == "Ann has control"
    server.lease = FREE
    assert control.request("ann's", now=1.0) is ControlState.PENDING
    assert control.request("ann's", now=1.0 + LEASE_TIMEOUT) == "control wasn't given: try again"
    assert server.count(Acquire) == 0


def test_the_share_of_one_person_is_none_of_another():
    server = Server(THEIRS, lender="ann's")
    control = ServedControl(server)
    assert control.request("ann's", now=0.0) is ControlState.HELD
    assert control.request("bea's", now=0.2) == "Ann has control"
    server.lender = "bea's"
    assert control.request("bea's", now=0.3) is ControlState.HELD
    assert [wish.session for wish in server.wishes] == ["ann's", "bea's", "bea's"]


def test_a_lapse_is_told_once_and_why():
    server = Server(SHARED)
    control = LeaseControl(server)
    assert control.pop_lapse() == ""
    server.lease, server.lapses = THEIRS, 1
    assert "another command" in control.pop_lapse()
    assert control.pop_lapse() == ""
    server.lease, server.lapses = ENDING, 2
    assert control.pop_lapse() == "control has ended"
