"""Refusals: codes beside their texts, and what becomes of them on their way to a client."""

from __future__ import annotations

import pytest

from interfaces.clients.designer import Designer
from interfaces.engine_server.servlet import Servlet
from interfaces.messages import Order, Outcome, Refusal, RefusalCode
from interfaces.messages.fields import MOST_NAMES
from interfaces.stream import Encoding, decode, encode
from interfaces.teleop.operator import Halt, HaltCause, OperatorSite
from interfaces.teleop.virtual_arm import VirtualArm
from tests.interfaces.joined import MODEL, to
from vrs import Engine, Insertion, ManualClock, PositionQuery

READY = MODEL.poses["nominal"]


def outcome(servlet: Servlet, number: int, command: object) -> Outcome:
    servlet.receive(Order(number, command), now=0.0)  # type: ignore[arg-type]
    return next(
        reply for reply in servlet.advance(now=0.0) if isinstance(reply, Outcome) and reply.number == number
    )


def test_what_a_halted_robot_refuses_has_a_code_that_clients_are_told() -> None:
    site = OperatorSite(VirtualArm(MODEL, READY, now=0.0), halted=Halt(HaltCause.REPORTED, "nothing fresh came"))
    refused = outcome(Servlet(site.robot.engine), 1, to(1))
    assert refused.receipt is not None
    assert refused.receipt.reason == "the robot doesn't follow: nothing fresh came; resume first"
    assert refused.code is RefusalCode.NOT_FOLLOWING
    issued = Designer(site.robot.engine).issue(to(1), now=0.0)
    assert issued.code is RefusalCode.NOT_FOLLOWING
    assert site.robot.engine.refusal(refused.receipt.command_id) is RefusalCode.NOT_FOLLOWING


def test_what_the_engine_rejects_or_does_has_none() -> None:
    servlet = Servlet(OperatorSite(VirtualArm(MODEL, READY, now=0.0)).robot.engine)
    for number, command in enumerate(
        (to(1), to(1, execute_at=-1.0, issued_at=0.0), PositionQuery(), None), start=1
    ):
        assert outcome(servlet, number, command).code is RefusalCode.OTHER


def test_a_servlet_passes_on_why_an_order_is_not_admitted() -> None:
    engine = OperatorSite(VirtualArm(MODEL, READY, now=0.0)).robot.engine
    servlet = Servlet(engine, admit=lambda _: Refusal("not now", RefusalCode.OVERRULED))
    refused = outcome(servlet, 1, to(1))
    assert (refused.refusal, refused.code, engine.newest) == ("not now", RefusalCode.OVERRULED, 0)


def test_a_servlet_names_as_many_commands_as_may_cross() -> None:
    engine = Engine(MODEL, q=READY, clock=ManualClock(0.0))
    for k in range(MOST_NAMES + 10):
        engine.execute(to(k % 2, insertion=Insertion.APPEND))
    refused = outcome(Servlet(engine), 1, to(1, insertion=Insertion.REPLACE))
    assert refused.receipt is not None
    assert isinstance(refused.receipt.superseded_names, tuple)
    assert len(refused.receipt.superseded_names) == MOST_NAMES


@pytest.mark.parametrize("encoding", Encoding)
def test_codes_of_other_ages_are_other(encoding: Encoding) -> None:
    told = Outcome(1, 2.0, None, "no", code=RefusalCode.OVERRULED)
    data = encode(told, encoding)
    assert decode(data, encoding, allowed=Outcome).code is RefusalCode.OVERRULED
    later = data.replace(b"overruled", b"overcame!")
    assert later != data
    assert decode(later, encoding, allowed=Outcome).code is RefusalCode.OTHER
    assert b"code" not in encode(Outcome(1, 2.0, None, "no"), encoding)
    assert (
        decode(encode(Outcome(1, 2.0, None, "no"), encoding), encoding, allowed=Outcome).code is RefusalCode.OTHER
    )
