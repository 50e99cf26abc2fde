"""A client in the hub's process: its lease, its commands, and that of a session which it shares."""

from __future__ import annotations

from interfaces.messages import Refusal, RefusalCode, control
from interfaces.messages.control import Lease, Problem
from interfaces.stream.local import LocalClient
from tests.interfaces.joined import to
from tests.interfaces.stream.joined import Joined


class Clock:
    """Session time of what is joined."""

    def __init__(self, joined):
        self._joined = joined

    def now(self):
        return self._joined.now


def local(joined):
    return LocalClient(joined.hub, Clock(joined), "here", lambda: None)


def release(client):
    return client.ask(lambda number: control.Release(number, client.lease.epoch))


def test_its_commands_need_the_lease_which_it_keeps_without_beats():
    joined = Joined()
    client, other = local(joined), joined.client()
    joined.run(0.5)
    assert client.execute(to(3)) == Refusal("no lease: acquire it first")
    assert client.ask(control.Acquire).yours
    joined.run(10.0)
    assert (client.lease.yours, client.lapses) == (True, 0)
    assert joined.wish(other, control.Acquire).text == "somebody has the lease"
    receipt = client.execute(to(3))
    assert receipt.stands
    assert client.execute(None).undone
    assert isinstance(release(client), Lease)
    assert (client.lease.commands, client.lapses) == (False, 1)
    assert joined.wish(other, control.Acquire).yours
    assert joined.hub.seats == 1, "it takes no client's place"


def test_it_shares_the_lease_of_a_session_that_it_may_let_have_one():
    joined = Joined()
    client, page = local(joined), joined.client()
    joined.run(0.5)
    key = page.welcome.session
    assert isinstance(client.ask(lambda number: control.Share(number, key)), Problem)
    client.let_acquire("nobody's")
    assert not client.lease.holder
    client.let_acquire(key)
    joined.run(0.1)
    assert page.epoch
    assert client.ask(lambda number: control.Share(number, key)).shared
    assert client.execute(to(3)).stands
    assert isinstance(joined.wish(page, control.Release), Lease)
    assert (client.lease.commands, client.lapses) == (False, 1)
    assert client.execute(to(3)).code is RefusalCode.OTHER
