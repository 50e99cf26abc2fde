from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from interfaces import Designer, Supervisor
from interfaces.clients.ports import RemotePort
from interfaces.engine_server.servlet import Servlet
from interfaces.link.delivery import OVERTAKEN
from interfaces.messages import Order, Outcome
from tests.interfaces.joined import MODEL, Joined, bad, constant, place, to
from vrs import (
    Cancel,
    Engine,
    Insertion,
    InsertVia,
    JointTarget,
    ManualClock,
    ParameterChange,
    PositionQuery,
    Resume,
    Retime,
    ScaleTime,
    Status,
    SteerCommand,
    Stop,
)
from vrs.errors import InvalidValueError, UnknownCommandError

PORTS = ["local", "instant", "delayed"]


def connect(joined: Joined, kind: str):
    if kind == "local":
        return joined.local()
    delay = 0.0 if kind == "instant" else 0.15
    return joined.remote(constant(delay), constant(delay))


def joined_by(kind: str) -> tuple[Joined, Designer]:
    joined = Joined(D=-0.15 if kind == "delayed" else 0.0)
    return joined, joined.add(Designer(connect(joined, kind)))


@pytest.mark.parametrize("kind", PORTS)
class TestEveryPort:
    def test_a_command_is_stamped_carried_out_and_answered(self, kind):
        joined, designer = joined_by(kind)
        joined.run(1.0)
        issued = designer.issue(to(1), now=joined.now, execute_in=0.5)
        assert issued.command.issued_at == 1.0
        assert issued.command.execute_at == 1.5
        joined.run(0.4)
        issued = designer.issued(issued.number)
        assert not issued.is_pending
        assert issued.receipt.status is Status.ACCEPTED
        assert issued.receipt.execute_at == 1.5
        assert issued.late == 0
        assert issued.answered_at == pytest.approx(1.3 if kind == "delayed" else 1.0)
        assert np.abs(joined.engine.joints(issued.receipt.end) - place(1)).max() < 1e-12

    def test_a_given_stamp_is_left_as_it_is(self, kind):
        joined, designer = joined_by(kind)
        joined.run(1.0)
        issued = designer.issue(to(1, issued_at=0.25, execute_at=2.0), now=joined.now)
        assert issued.command.issued_at == 0.25
        joined.run(0.4)
        assert designer.issued(issued.number).receipt.issued_at == 0.25

    def test_every_sort_of_command_comes_to_what_it_comes_to_here(self, kind):
        joined, designer = joined_by(kind)
        clock = ManualClock(0.0)
        engine = Engine(MODEL, q=joined.engine.joints(), clock=clock)
        commands = [
            to(1, execute_at=1.0),
            to(2, execute_at=4.0),
            to(3, insertion=Insertion.APPEND, execute_at=6.0),
            Retime(2, 3.5),
            InsertVia(3, JointTarget(place(4)), 0.02),
            ScaleTime(0.7, execute_at=2.5),
            Stop(execute_at=3.0),
            Resume(execute_at=3.3),
            Cancel(3, execute_at=3.4),
            None,
            SteerCommand(rates=[0.1] * 6, execute_at=60.0),
        ]
        for command in commands:
            if command is None:
                engine.undo()
                designer.undo(now=joined.now)
            else:
                designer.issue(command, now=joined.now)
                stamped = designer.history[-1].command
                engine.execute(stamped)
            joined.run(0.05)
            clock.advance(0.05)
        joined.run(1.0)
        t = np.linspace(0, 62, 2000)
        assert np.abs(joined.engine.joints(t) - engine.joints(t)).max() < 1e-9
        assert designer.pending == ()
        own = [issued.receipt.command_id for issued in designer.history if issued.receipt is not None]
        assert own == [1, 2, 3, 2, 3, 4, 5, 6, 3, 3, 7]

    def test_what_a_later_command_did_to_a_receipt_is_heard(self, kind):
        joined, designer = joined_by(kind)
        first = designer.issue(to(1), now=joined.now, execute_in=0.5)
        joined.run(0.4)
        designer.issue(to(2), now=joined.now, execute_in=0.3)
        joined.run(0.4)
        assert designer.issued(first.number).receipt.superseded_by == 2
        assert designer.issued(first.number).answered_at <= 0.31

    def test_what_cannot_be_taken_is_refused_as_a_value(self, kind):
        joined, designer = joined_by(kind)
        wrong = designer.issue(SteerCommand(rates=[0.1]), now=joined.now)
        unknown = designer.issue(Cancel(9), now=joined.now)
        beyond = designer.issue(to(1, execute_at=0.0, issued_at=1.0), now=joined.now)
        change = designer.issue(ParameterChange("qd_max", 0.5), now=joined.now)
        joined.run(0.5)
        assert "shape (6,)" in designer.issued(wrong.number).refusal
        assert "no command 9" in designer.issued(unknown.number).refusal
        assert designer.issued(beyond.number).receipt.status is Status.REJECTED
        assert designer.issued(change.number).answered_at is not None
        assert joined.engine.limits.qd_max[0] == 0.5

    def test_news_are_told_once(self, kind):
        joined, designer = joined_by(kind)
        joined.parts.remove(designer)
        designer.issue(to(1), now=joined.now)
        joined.run(0.4)
        assert [issued.number for issued in designer.advance(now=joined.now)] == [1]
        assert designer.advance(now=joined.now) == ()


def test_misuse_raises():
    joined = Joined()
    designer = Designer(joined.engine)
    for command, options in (
        (PositionQuery(1.0), {}),
        (to(1, execute_at=1.0), {"execute_in": 1.0}),
        (ParameterChange("lateness", "reject"), {"execute_in": 1.0}),
    ):
        with pytest.raises(InvalidValueError):
            designer.issue(command, now=0.0, **options)
    with pytest.raises(InvalidValueError):
        designer.issue(to(1), now=np.nan)
    with pytest.raises(UnknownCommandError):
        designer.issued(1)
    assert designer.history == ()


def test_until_it_is_answered_a_command_is_pending_and_too_many_are_refused_but_for_a_stop():
    joined = Joined()
    designer = Designer(joined.remote(constant(50.0), constant(1.0)))
    joined.run(0.1)
    for k in range(200):
        designer.issue(to(k), now=joined.now)
    assert len(designer.pending) == 200
    with pytest.raises(InvalidValueError):
        designer.issue(to(1), now=joined.now)
    assert designer.issue(Stop(), now=joined.now).is_pending


def test_two_designers_of_one_port_share_its_order():
    joined = Joined()
    port = joined.local()
    one, two = Designer(port), Designer(port)
    assert [d.issue(to(k), now=0.0).number for k, d in enumerate((one, two, one))] == [1, 2, 3]
    assert len(one.history) == 2
    assert two.issued(2).receipt.command_id == 2


def test_steering_stays_fresh_where_packets_are_lost():
    stale = {}
    for repeat in (0, 2):
        joined = Joined(D=-0.1)
        link = bad(0.1, 0.0, 0.1, 0.001)
        designer = joined.add(Designer(joined.remote(link, link), repeat=repeat))
        for _ in range(300):
            designer.issue(SteerCommand(rates=[0.1] * 6), now=joined.now)
            joined.run(0.02)
        joined.run(3.0)
        receipts = [issued.receipt for issued in designer.history]
        stale[repeat] = np.mean([receipt.status is Status.REJECTED or receipt.reason != "" for receipt in receipts])
    assert stale[0] > 0.2
    assert stale[2] < 0.05


def test_old_news_that_come_late_are_passed_over():
    joined = Joined()
    designer = Designer(joined.engine)
    issued = designer.issue(to(1), now=0.0)
    newer = replace(issued.receipt, superseded_by=2)
    designer.receive(Outcome(1, 0.0, newer, "", 1), now=1.0)
    designer.receive(Outcome(1, 0.0, issued.receipt), now=2.0)
    designer.receive(Outcome(7, 0.0, issued.receipt), now=2.0)
    assert designer.issued(1).receipt.superseded_by == 2
    assert designer.issued(1).answered_at == 0.0
    assert len(designer.history) == 1


class TestServlet:
    def orders(self, numbers, commands=None):
        engine = Engine(MODEL, q=MODEL.poses["nominal"], clock=ManualClock(0.0))
        servlet = Servlet(engine)
        outcomes = {}
        for number in numbers:
            command = (commands or {}).get(number, to(number, execute_at=1.0 + number))
            servlet.receive(Order(number, command), now=0.0)
            for outcome in servlet.advance(now=0.0):
                outcomes[outcome.number] = outcome
        return engine, outcomes

    def test_orders_come_once_and_in_order(self):
        engine, outcomes = self.orders([3, 1, 1, 3, 2, 2, 1])
        assert [r.command_id for r in engine.receipts] == [1, 2, 3]
        assert [outcomes[n].receipt.asked_at for n in (1, 2, 3)] == [2.0, 3.0, 4.0]

    def test_a_stop_does_not_wait_and_what_was_before_it_does_not_come_after(self):
        engine, outcomes = self.orders([1, 4, 3, 2, 5], {4: Stop(execute_at=0.5)})
        assert outcomes[4].receipt.status is Status.ACCEPTED
        assert outcomes[2].refusal == outcomes[3].refusal == OVERTAKEN
        assert outcomes[5].receipt.status is Status.ACCEPTED
        targets = [r.asked_at for r in engine.receipts]
        assert targets == [2.0, 0.5, 6.0]

    def test_orders_far_ahead_are_left_to_be_sent_again(self):
        engine, outcomes = self.orders([10_000, 1])
        assert list(outcomes) == [1]
        assert len(engine.receipts) == 1

    def test_no_request_no_service(self):
        with pytest.raises(InvalidValueError):
            Servlet(Engine(MODEL)).receive("MOVE", now=0.0)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    seed=st.integers(0, 2**31),
    loss=st.floats(0, 0.5),
    duplicate=st.floats(0, 1),
    mean=st.floats(0.02, 0.4),
    spread=st.floats(0.0, 1.0),
)
def test_over_any_link_every_command_is_carried_out_once_in_order(seed, loss, duplicate, mean, spread):
    joined = Joined()
    link = bad(loss, duplicate, mean, spread)
    supervisor = joined.add(Supervisor(joined.remote(link, link, seed=seed)))
    for k in range(6):
        supervisor.issue(to(k, insertion=Insertion.APPEND), now=joined.now)
        joined.run(0.1)
    for _ in range(200):
        if not supervisor.designer.pending:
            break
        joined.run(1.0)
    receipts = joined.engine.receipts
    assert [issued.receipt.command_id for issued in supervisor.designer.history] == [1, 2, 3, 4, 5, 6]
    assert len(receipts) == 6
    for k, receipt in enumerate(receipts):
        assert np.array_equal(receipt.q, place(k))


def test_an_answer_that_comes_twice_is_news_once():
    designer = Designer(RemotePort())
    issued = designer.issue(Stop(), now=1.0)
    for now in (2.0, 3.0):
        designer.receive(Outcome(issued.number, now, None, "no"), now=now)
        news = designer.advance(now=now)
        assert [one.answered_at for one in news] == ([2.0] if now == 2.0 else [])
    designer.receive(Outcome(issued.number, 4.0, None, "really", 1), now=4.0)
    assert [one.refusal for one in designer.advance(now=4.0)] == ["really"]


def test_through_a_long_silence_a_command_is_sent_again_and_again():
    """More and more seldom, but never less often than each five seconds."""
    port = RemotePort()
    designer = Designer(port, resend=0.3)
    designer.issue(Stop(), now=0.0)
    port.advance(now=0.0)
    sent, now = [0.0], 0.0
    while now < 600.0:
        now = designer.next_deadline()
        designer.advance(now=now)
        sent += [now] * len(port.advance(now=now))
    gaps = np.diff(sent)
    assert gaps[0] == pytest.approx(0.3)
    assert (np.diff(gaps) >= -1e-9).all()
    assert gaps.max() == pytest.approx(5.0)
