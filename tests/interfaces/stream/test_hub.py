"""The lease over the wire, and what all see."""

import numpy as np
import pytest

from interfaces.messages import Follow, Order, RefusalCode, ViewForm, control
from interfaces.messages.control import ProblemCode, Role
from interfaces.stream.codec import encode
from interfaces.stream.limits import ClientLimits
from tests.interfaces.joined import to
from tests.interfaces.stream.served import ADMIN, make_hub
from tests.interfaces.stream.test_session import Peer, holder, kinds
from vrs.commands import Stop


def leases(messages):
    return [message for message in messages if message.kind == "lease"]


def test_one_holder_and_its_epoch_is_its_own():
    hub = make_hub(epoch=41)
    one, two, viewer = Peer(hub), Peer(hub), Peer(hub, role=Role.VIEWER)
    mine = leases(one.tell(control.Acquire(5), now=0.1))
    assert [(m.state, m.epoch, m.holder, m.yours, m.answers) for m in mine] == [("held", 42, "peer", True, 5)]
    for other in (two, viewer):
        seen = leases(other.got(now=0.1))
        assert [(m.state, m.epoch, m.holder, m.yours, m.answers) for m in seen] == [
            ("held", None, "peer", False, None)
        ]
    problem = two.tell(control.Acquire(9), now=0.2)[0]
    assert (problem.code, problem.number, problem.fatal) == (ProblemCode.LEASE, 9, False)
    assert leases(one.tell(control.Acquire(6), now=0.2))[0].epoch == 42, "who has it is told so again"
    assert hub.robot.log == [("began", 42)]


def test_it_expires_without_beats_and_stops_the_robot():
    hub = make_hub(stops=False)
    peer, epoch = holder(hub)
    assert peer.tell(control.Beat(epoch), now=1.5) == []
    version = hub.leasing.version
    hub.stopped(now=3.0)
    assert hub.leasing.version == version, "no lease has ended"
    hub.advance(now=3.49)
    assert hub.robot.log == [("began", epoch)]
    assert hub.next_deadline() <= 3.51
    hub.advance(now=3.5)
    assert hub.robot.log[1:] == [("ended", epoch, "expired")]
    assert [(m.state, m.yours, m.ended) for m in leases(peer.got(now=3.5))] == [("ending", False, "expired")]
    assert "no lease" in peer.tell(Order(1, to(1), epoch), now=3.6)[0].refusal
    assert peer.tell(control.Beat(epoch), now=3.6)[0].code is ProblemCode.STALE_EPOCH
    assert peer.tell(control.Acquire(2), now=3.6)[0].code is ProblemCode.LEASE, "the robot isn't at rest yet"
    hub.stopped(now=3.7)
    hub.stopped(now=3.7)
    assert leases(peer.tell(control.Acquire(3), now=3.8))[-1].epoch == epoch + 1
    assert hub.robot.log[2:] == [("began", epoch + 1)]


def test_who_commands_is_known_by_the_session_and_its_epoch():
    hub = make_hub()
    (peer, epoch), viewer = holder(hub), Peer(hub, role=Role.VIEWER)
    mine, other = (one.session.seat.key for one in (peer, viewer))
    assert hub.commands(mine, epoch, now=0.5)
    assert not hub.commands(mine, epoch - 1, now=0.5)
    assert not hub.commands(other, epoch, now=0.5)
    assert not hub.commands("", epoch, now=0.5)
    assert not hub.commands(mine, epoch, now=60.0)


def test_orders_keep_it():
    hub = make_hub()
    peer, epoch = holder(hub)
    for k in range(1, 10):
        assert peer.tell(Order(k, to(k), epoch), now=1.5 * k)[0].refusal == ""
    assert hub.robot.log == [("began", epoch)]


def test_expiry_is_seen_before_the_order_that_comes_with_it():
    """After the server was stopped for a while, what has piled up isn't carried out."""
    hub = make_hub()
    peer, epoch = holder(hub)
    for k in range(1, 20):
        peer.session.receive(
            encode(Order(k, to(k), epoch), peer.encoding),
            now=5.0,
        )
    found = peer.got(now=5.0)
    assert sum("no lease" in m.refusal for m in found if m.kind == "outcome") == 19
    assert hub.site.engine.newest == 0


def test_a_stale_release_clears_nothing():
    hub = make_hub()
    one, old = holder(hub)
    one.tell(control.Release(2, old), now=0.1)
    two = Peer(hub, now=0.2)
    new = two.tell(control.Acquire(1), now=0.2)[0].epoch
    one.got(now=0.2)
    for message in (control.Release(3, old), control.Release(4, new), control.Beat(new), control.Resume(5, new)):
        assert one.tell(message, now=0.3)[-1].code is ProblemCode.STALE_EPOCH
    assert two.tell(control.Release(6, old), now=0.3)[-1].code is ProblemCode.STALE_EPOCH
    assert hub.robot.log[-1] == ("began", new)
    assert two.tell(Order(1, to(1), new), now=0.4)[0].refusal == ""


def test_t07_take_over_needs_an_admin_and_passes_through_a_stop():
    hub = make_hub(stops=False)
    peer, epoch = holder(hub)
    other = Peer(hub, now=0.1)
    assert other.tell(control.TakeOver(1), now=0.1)[-1].code is ProblemCode.LEASE
    admin = Peer(hub, role=Role.ADMIN, token=ADMIN, now=0.2)
    found = leases(admin.tell(control.TakeOver(8), now=0.2))
    assert [(m.state, m.yours, m.answers, m.ended) for m in found] == [("ending", False, 8, "taken over")]
    assert hub.robot.log[1:] == [("ended", epoch, "taken over")]
    refused = next(m for m in peer.tell(Order(1, to(1), epoch), now=0.3) if m.kind == "outcome")
    assert "no lease" in refused.refusal
    hub.stopped(now=0.5)
    assert [(m.yours, m.epoch) for m in leases(admin.got(now=0.5))] == [(True, epoch + 1)]
    assert admin.tell(Order(1, to(1), epoch + 1), now=0.6)[0].refusal == ""
    assert not leases(peer.got(now=0.6))[-1].yours


def test_nobody_is_promoted_silently():
    hub = make_hub()
    peer, epoch = holder(hub)
    waiting = Peer(hub)
    waiting.tell(control.Acquire(1), now=0.1)
    peer.tell(control.Release(2, epoch), now=0.2)
    assert [m.state for m in leases(waiting.got(now=0.2))] == ["free"]


def test_resume_is_the_driver_s_to_grant():
    hub = make_hub()
    peer, epoch = holder(hub)
    hub.robot.refusal = "not at rest"
    problem = peer.tell(control.Resume(4, epoch), now=0.1)[0]
    assert (problem.code, problem.text, problem.number) == (ProblemCode.LEASE, "not at rest", 4)
    hub.robot.refusal = ""
    assert leases(peer.tell(control.Resume(5, epoch), now=0.2))[0].answers == 5
    assert hub.robot.log[1:] == [("resume", epoch)] * 2


def test_a_session_goes_on_after_its_connection_was_lost():
    hub = make_hub()
    peer, epoch = holder(hub)
    first = peer.tell(Order(1, to(1), epoch), now=0.1)[0]
    hub.leave(peer.session, done=False, now=0.2)
    again = Peer(hub, session=peer.welcome.session, now=0.5)
    assert (again.welcome.resumed, again.welcome.session) == (True, peer.welcome.session)
    assert (again.welcome.lease.yours, again.welcome.lease.epoch) == (True, epoch)
    assert again.tell(Order(1, to(1), epoch), now=0.6)[0].receipt.command_id == first.receipt.command_id
    assert again.tell(Order(2, to(2), epoch), now=0.6)[0].receipt is not None
    assert hub.site.engine.newest == 2


def test_a_session_is_continued_by_its_name_and_role_only():
    hub = make_hub()
    peer, _ = holder(hub)
    hub.leave(peer.session, done=False, now=0.1)
    assert not Peer(hub, session="wrong").welcome.resumed
    assert not Peer(hub, role=Role.VIEWER, session=peer.welcome.session).welcome.resumed
    assert Peer(hub, session=peer.welcome.session).welcome.resumed


def test_a_half_dead_connection_is_replaced():
    hub = make_hub()
    peer, epoch = holder(hub)
    again = Peer(hub, session=peer.welcome.session, now=0.3)
    assert again.welcome.lease.yours
    assert peer.session.closing is not None
    assert kinds(peer.got(now=0.3))[-1] == "problem"
    hub.leave(peer.session, done=False, now=0.3)
    assert again.tell(Order(1, to(1), epoch), now=0.4)[0].refusal == ""


def test_what_was_left_is_forgotten_in_time_and_in_number():
    hub = make_hub(limits=ClientLimits(absence=10.0, absent=5))
    for k in range(20):
        peer = Peer(hub, now=0.1 * k)
        peer.tell(Follow(1, ViewForm.FRAMES, 60.0), now=0.1 * k)
        hub.leave(peer.session, done=False, now=0.1 * k)
        assert hub.seats <= 5
    hub.advance(now=20.0)
    assert hub.seats == 0
    assert all(broadcaster.viewers == 0 for broadcaster in hub.site.broadcasters)


def test_of_too_many_that_were_left_the_first_is_forgotten():
    hub = make_hub(limits=ClientLimits(absence=10.0, absent=2))
    peers = [Peer(hub, now=0.0) for _ in range(3)]
    for k in (1, 2, 0):
        hub.leave(peers[k].session, done=False, now=1.0 + 0.1 * (k == 2) + 0.2 * (k == 0))
    again = [Peer(hub, session=peer.welcome.session, now=2.0).welcome.resumed for peer in peers]
    assert again == [True, False, True]


def test_who_has_the_lease_is_kept_as_long_as_it_lasts():
    hub = make_hub(limits=ClientLimits(absence=0.0, absent=0))
    peer, epoch = holder(hub)
    hub.leave(peer.session, done=False, now=0.3)
    hub.advance(now=0.4)
    again = Peer(hub, session=peer.welcome.session, now=0.5)
    assert (again.welcome.resumed, again.welcome.lease.yours, again.welcome.lease.epoch) == (True, True, epoch)
    hub.leave(again.session, done=False, now=0.6)
    hub.advance(now=10.0)
    assert (hub.seats, hub.robot.log[-1]) == (0, ("ended", epoch, "expired"))


@pytest.mark.parametrize(("role", "done"), [(Role.VIEWER, False), (Role.VIEWER, True), (Role.OPERATOR, True)])
def test_hundreds_that_came_and_went_leave_nothing(role, done):
    hub = make_hub()
    for k in range(300):
        peer = Peer(hub, role=role, now=0.01 * k)
        peer.tell(Follow(1, ViewForm.FRAMES, 60.0), now=0.01 * k)
        hub.leave(peer.session, done=done, now=0.01 * k)
    assert (hub.seats, hub.sessions) == (0, ())
    assert all(broadcaster.viewers == 0 for broadcaster in hub.site.broadcasters)


def state(number, t):
    return control.State(number, t, np.zeros(6), t, 1.0, 0.0, 0.0)


def test_the_newest_state_is_told_and_not_too_often():
    hub = make_hub(state_rate=10.0)
    peer = Peer(hub, role=Role.VIEWER)
    found = []
    for k in range(1000):
        hub.show(state(k + 1, 0.001 * k))
        found += [m for m in peer.got(now=0.001 * k) if m.kind == "state"]
    assert 10 <= len(found) <= 11
    late = Peer(hub, role=Role.VIEWER, now=1.0)
    assert [m.number for m in late.first if m.kind == "state"] == [found[-1].number]


def test_an_edit_reaches_followers_of_segments_at_once():
    hub = make_hub()
    peer, epoch = holder(hub)
    viewer = Peer(hub, role=Role.VIEWER)
    viewer.tell(Follow(1, ViewForm.SEGMENTS), now=0.1)
    peer.tell(Order(1, to(1), epoch), now=0.123)
    ready = hub.advance(now=0.123)
    assert viewer.session in ready
    assert "change" in kinds(viewer.got(now=0.123))


def test_the_end_is_told():
    hub = make_hub()
    peers = [Peer(hub), Peer(hub, greet=False)]
    assert set(hub.close()) == {peer.session for peer in peers}
    for peer in peers:
        last = peer.got(now=0.1)[-1]
        assert (last.code, last.fatal, peer.session.closing[0]) == (ProblemCode.STOPPING, True, 1012)


def refusal(peer, order, now):
    """Why an order wasn't carried out."""
    return next(m.refusal for m in peer.tell(order, now=now) if m.kind == "outcome")


def problem(peer, wish, now):
    """What couldn't be done of a wish."""
    return next(m for m in peer.tell(wish, now=now) if m.kind == "problem")


def sharing(hub, **options):
    """A holder, its epoch, and one who shares its lease."""
    owner, epoch = holder(hub)
    other = Peer(hub, **options)
    other.tell(control.Share(1, owner.welcome.session), now=0.0)
    owner.got(now=0.0)
    return owner, epoch, other


def test_who_shows_the_holder_s_session_commands_under_its_epoch():
    hub = make_hub()
    owner, epoch = holder(hub)
    other, third = Peer(hub), Peer(hub)
    (lease,) = leases(other.tell(control.Share(7, owner.welcome.session), now=0.1))
    assert (lease.state, lease.epoch, lease.holder, lease.yours, lease.shared, lease.answers) == (
        "held", epoch, "peer", False, True, 7,
    )  # fmt: skip
    assert [(m.epoch, m.shared) for m in leases(third.got(now=0.1))] == [(None, False)]
    assert refusal(other, Order(1, to(1), epoch), 0.2) == ""
    assert refusal(owner, Order(1, to(2), epoch), 0.2) == ""
    assert hub.robot.log == [("began", epoch)]
    resumed = leases(other.tell(control.Share(8, owner.welcome.session), now=0.3))[-1]
    assert resumed.shared, "it may be shared again"
    assert leases(other.tell(control.Resume(9, epoch), now=0.3))[-1].answers == 9
    assert refusal(other, Order(2, to(3), epoch - 1), 0.4).startswith("no lease: epoch")


@pytest.mark.parametrize("shown", ["", "wrong", "own", "of one who has no lease"])
def test_t07_only_the_holder_s_session_opens_its_lease(shown):
    hub = make_hub()
    owner, epoch = holder(hub)
    other, third, viewer = Peer(hub), Peer(hub), Peer(hub, role=Role.VIEWER)
    names = {"own": other.welcome.session, "of one who has no lease": third.welcome.session}
    found = problem(other, control.Share(2, names.get(shown, shown)), 0.1)
    assert (found.code, found.number, found.fatal) == (ProblemCode.LEASE, 2, False)
    assert refusal(other, Order(1, to(1), epoch), 0.1) == "no lease: acquire it first"
    found = problem(viewer, control.Share(3, owner.welcome.session), 0.1)
    assert found.code is ProblemCode.NOT_ALLOWED
    owner.tell(control.Release(2, epoch), now=0.2)
    assert problem(other, control.Share(4, owner.welcome.session), 0.3).code is ProblemCode.LEASE
    assert hub.site.engine.newest == 0


def test_only_its_holder_keeps_a_shared_lease():
    hub = make_hub(stops=False)
    owner, epoch, other = sharing(hub)
    for k in range(1, 10):
        assert refusal(other, Order(k, to(k), epoch), 0.2 * k) == ""
    assert problem(other, control.Beat(epoch), 1.9).code is ProblemCode.STALE_EPOCH
    hub.advance(now=2.0)
    assert hub.robot.log == [("began", epoch), ("ended", epoch, "expired")]
    assert "no lease" in refusal(other, Order(10, to(1), epoch), 2.1)
    assert problem(other, control.Share(2, owner.welcome.session), 2.1).code is ProblemCode.LEASE


@pytest.mark.parametrize("how", ["released", "taken over"])
def test_a_share_ends_with_its_lease_and_none_is_left_for_the_next(how):
    hub = make_hub()
    owner, epoch, other = sharing(hub)
    admin = Peer(hub, role=Role.ADMIN, token=ADMIN)
    if how == "released":
        owner.tell(control.Release(2, epoch), now=0.1)
    else:
        admin.tell(control.TakeOver(1), now=0.1)
    assert not leases(other.got(now=0.1))[-1].commands
    assert "no lease" in refusal(other, Order(1, to(1), epoch), 0.1)
    new = leases(admin.tell(control.Acquire(2), now=0.2))[-1].epoch
    assert new == epoch + 1
    assert "no lease" in refusal(other, Order(2, to(1), new), 0.2)
    assert hub.site.engine.newest == 0


def test_who_shares_a_lease_gives_its_share_back_alone():
    hub = make_hub()
    owner, epoch, other = sharing(hub)
    gone = leases(other.tell(control.Release(2, epoch), now=0.1))[-1]
    assert (gone.state, gone.epoch, gone.shared) == ("held", None, False)
    assert "no lease" in refusal(other, Order(1, to(1), epoch), 0.1)
    assert refusal(owner, Order(1, to(1), epoch), 0.1) == ""
    assert hub.robot.log == [("began", epoch)]


@pytest.mark.parametrize("command", [Stop(), to(2), None])
def test_an_order_of_one_ends_the_shares_of_the_others_until_they_share_anew(command):
    hub = make_hub()
    owner, epoch, other = sharing(hub)
    third = Peer(hub)
    third.tell(control.Share(1, owner.welcome.session), now=0.0)
    other.tell(Order(1, to(1), epoch), now=0.1)
    assert not leases(third.got(now=0.1))[-1].commands
    newest = hub.site.engine.newest
    owner.tell(Order(1, command, epoch), now=0.2)
    assert not leases(other.got(now=0.2))[-1].commands
    made = hub.site.engine.newest
    assert made >= newest
    [refused] = [m for m in other.tell(Order(2, to(3), epoch), now=0.3) if m.kind == "outcome"]
    assert (refused.refusal, refused.code) == (control.OVERRULED, RefusalCode.OVERRULED)
    assert hub.site.engine.newest == made
    assert leases(other.tell(control.Share(2, owner.welcome.session), now=0.4))[-1].commands
    assert refusal(other, Order(3, to(3), epoch), 0.5) == ""


def test_few_share_a_lease_and_who_was_forgotten_shares_none():
    hub = make_hub(limits=ClientLimits(sharers=2, absence=1.0))
    owner, epoch, other = sharing(hub)
    second, third = Peer(hub), Peer(hub)
    assert leases(second.tell(control.Share(1, owner.welcome.session), now=0.1))[-1].shared
    assert problem(third, control.Share(1, owner.welcome.session), 0.1).code is ProblemCode.LEASE
    hub.leave(other.session, done=False, now=0.2)
    for k in range(1, 5):
        owner.tell(control.Beat(epoch), now=0.5 * k)
        hub.advance(now=0.5 * k)
    assert leases(third.tell(control.Share(2, owner.welcome.session), now=2.1))[-1].shared
