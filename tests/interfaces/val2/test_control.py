"""The lease of a connection as control: asked for without waiting, and given when the robot follows."""

from __future__ import annotations

from types import SimpleNamespace

from interfaces.stream.control import Lease
from interfaces.val2.control import MEETING, PATIENCE, LeaseControl
from robots.onboard.lease import LeaseState

FREE = Lease(LeaseState.FREE)
ENDING = Lease(LeaseState.ENDING)
MINE = Lease(LeaseState.HELD, 7, "me", yours=True)
THEIRS = Lease(LeaseState.HELD, None, "Ann")


class Server:
    """A connection."""

    def __init__(self, lease, *, halted=""):
        self.lease, self.is_connected = lease, True
        self.state = SimpleNamespace(connected=True, halted=halted)
        self.asked = self.released = self.resumed = 0

    def acquire(self, *, wait):
        assert wait == 0.0
        self.asked += 1

    def release(self, *, wait):
        assert wait == 0.0
        self.released += 1

    def resume(self, *, wait):
        assert wait == 0.0
        self.resumed += 1


def test_a_free_lease_is_asked_for_and_waited_for():
    server = Server(FREE)
    control = LeaseControl(server)
    assert control.wanted(now=0.0) is None
    assert control.wanted(now=0.05) is None
    assert server.asked == 1
    server.lease = MINE
    assert control.wanted(now=0.1) == ""
    control.release(now=0.2)
    assert server.released == 1


def test_a_lease_that_somebody_has_is_said_at_once_and_asked_for_anew_later():
    server = Server(THEIRS)
    control = LeaseControl(server)
    assert "Ann" in control.wanted(now=0.0)
    server.lease = FREE
    assert control.wanted(now=5.0) is None
    assert server.asked == 1


def test_a_robot_that_never_rests_ends_the_wait():
    server = Server(ENDING)
    control = LeaseControl(server)
    times = [k * 0.02 for k in range(int(PATIENCE / 0.02))]
    assert all(control.wanted(now=t) is None for t in times)
    assert server.asked <= PATIENCE / 0.25 + 1
    assert "at rest" in control.wanted(now=PATIENCE)
    assert control.wanted(now=PATIENCE + 1.0) is None


def test_a_robot_that_does_not_follow_yet_is_waited_for():
    server = Server(MINE, halted="not met")
    control = LeaseControl(server)
    assert control.wanted(now=1.0) is None
    assert control.wanted(now=MEETING) is None
    server.state.halted = ""
    assert control.wanted(now=MEETING) == ""
    server.state.halted = "the link"
    assert control.wanted(now=1.0 + MEETING) == ""
    control.resume(now=20.0)
    assert server.resumed == 1


def test_a_lost_connection_is_said():
    server = Server(MINE)
    server.is_connected = False
    assert "no connection" in LeaseControl(server).wanted(now=0.0)


def test_a_robot_that_stopped_by_itself_is_told_of_and_resumed_until_it_follows():
    server = Server(MINE, halted="nothing came")
    control = LeaseControl(server)
    assert str(control.trouble(now=0.0)) == "*Robot halted* nothing came; ENABLE POWER lets it go on"
    assert server.resumed == 0
    control.resume(now=1.0)
    assert server.resumed == 1
    control.trouble(now=1.1)
    assert server.resumed == 1
    control.trouble(now=1.3)
    assert server.resumed == 2
    server.state = SimpleNamespace(connected=True, halted="")
    assert control.trouble(now=1.6) is None
    server.state = SimpleNamespace(connected=True, halted="again")
    assert control.trouble(now=2.0) is not None
    assert server.resumed == 2


def test_resuming_is_given_up_after_a_while():
    server = Server(MINE, halted="nothing came")
    control = LeaseControl(server)
    control.resume(now=0.0)
    for k in range(1, 200):
        control.trouble(now=0.1 * k)
    assert 5 <= server.resumed <= PATIENCE / 0.25 + 1


def test_who_only_looks_is_told_no_way_to_go_on_and_asks_for_none():
    server = Server(THEIRS, halted="nothing came")
    control = LeaseControl(server)
    control.resume(now=0.0)
    assert str(control.trouble(now=0.1)) == "*Robot halted* nothing came"
    assert server.resumed == 0


def test_a_server_that_is_gone_is_told_of():
    server = Server(MINE)
    server.is_connected = False
    assert LeaseControl(server).trouble(now=0.0).what == "No connection"
