"""A mobile robot's hub: who may drive, what is carried out, and what clients are told."""

from __future__ import annotations

import json
from typing import Any

import pytest

from interfaces.engine_server.servlet import Servlet
from interfaces.engine_server.site import Site
from interfaces.messages import Order, Outcome, Refusal, RefusalCode
from interfaces.messages.control import MobileWelcome, Postures, Problem, Seen, Welcome
from interfaces.messages.jobs import RobotTask, Tasks
from interfaces.stream import Encoding
from interfaces.stream.access import OPEN, Access
from interfaces.stream.client import ClientCore, Phase
from interfaces.stream.hub import Hub, HubConfig, HubSession
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal
from robots.onboard.lease import Ended, Grant, Lease
from tests.interfaces.stream.served import make_hub
from tests.interfaces.teleop.rig import MODEL, Rig
from vrs import DriveCommand, Stop
from vrs.commands import PositionQuery


class Robot:
    """What a lease does to a robot: nothing."""

    met = True

    def began(self, grant: Grant, *, now: float) -> None: ...

    def ended(self, ended: Ended, *, now: float) -> None: ...

    def resume(self, epoch: int, *, now: float) -> str:
        return ""


def met() -> Rig:
    rig = Rig()
    rig.begin()
    return rig


def ordered(servlet: Servlet, number: int, command: Any, now: float) -> Outcome:
    servlet.receive(Order(number, command, 1), now=now)
    (outcome,) = servlet.advance(now=now)
    assert isinstance(outcome, Outcome)
    return outcome


def test_what_is_ordered_is_driven_and_nothing_else() -> None:
    rig = met()
    servlet = Site(rig.operator.robot).servlet(admit=lambda _: None)
    now = rig.now
    assert ordered(servlet, 1, DriveCommand(0.3, 0.0, 0.3), now).refusal == ""
    rig.run(0.2)
    assert rig.operator.robot.architecture.before.v > 0
    assert "leave out execute_at" in ordered(servlet, 2, DriveCommand(0.3, 0.0, 0.3, execute_at=5.0), now).refusal
    assert "drive and stop" in ordered(servlet, 3, PositionQuery(), now).refusal
    assert ordered(servlet, 4, None, now).refusal
    assert ordered(servlet, 6, Stop(), now).refusal == ""
    assert "before a stop" in ordered(servlet, 5, DriveCommand(0.3, 0.0, 0.3), now).refusal
    refused = ordered(servlet, 7, DriveCommand(0.3, 0.0, 0.3), now)
    assert "stopped" in refused.refusal
    assert refused.code is RefusalCode.NOT_FOLLOWING
    rig.run(1.0)
    assert rig.operator.robot.stands


def test_who_isnt_admitted_drives_nothing() -> None:
    rig = met()
    servlet = Site(rig.operator.robot).servlet(admit=lambda _: Refusal("no lease: acquire it first"))
    assert "no lease" in ordered(servlet, 1, DriveCommand(0.3, 0.0, 0.3), rig.now).refusal
    rig.run(0.5)
    assert rig.operator.robot.stands


@pytest.fixture
def hub() -> Hub:
    site = Site(met().operator.robot, room="Empty room")
    return Hub(site, Lease(), Access(free=OPEN), Robot(), config=HubConfig(rates=()))


def said(session: HubSession, *messages: dict[str, Any], now: float = 5.0) -> list[dict[str, Any]]:
    """What a client hears that says something."""
    for message in messages:
        session.receive(json.dumps(message), now=now)
    session.hub.advance(now=now)
    return [json.loads(data) for data in session.advance(now=now)]


HELLO = {"type": "hello", "protocol": 1, "role": "operator", "name": "Ada"}


def test_a_client_is_told_what_it_may_ask_for_and_where_both_robots_are(hub: Hub) -> None:
    session = hub.open(Encoding.JSON, now=5.0)
    (welcome,) = said(session, HELLO)
    assert welcome["type"] == "mobile-welcome"
    assert welcome["limits"]["v_max"] == MODEL.limits.v_max
    assert (welcome["period"], welcome["holds"], welcome["room"]) == (0.1, 0.3, "Empty room")
    here = Posture(1.0, 2.0, 0.5)
    hub.show(Postures(1, 5.0, here, Drive(0.0, 0.0), here))
    (told,) = said(session, now=5.1)
    assert (told["type"], told["virtual"]) == ("postures", [1.0, 2.0, 0.5])
    answers = said(session, {"type": "follow", "number": 1, "form": "segments"}, now=5.2)
    assert answers[0]["code"] == "not-allowed"
    command = {"type": "drive", "v": 0.1, "w": 0, "duration": 1}
    order = {"type": "order", "number": 1, "epoch": "1", "command": command}
    assert "no lease" in said(session, order, now=5.3)[0]["refusal"]
    lease = said(session, {"type": "acquire", "number": 1}, now=5.4)[0]
    order |= {"number": 2, "epoch": lease["epoch"]}
    assert "refusal" not in said(session, order, now=5.5)[0]


def greeted(core: ClientCore, hub: Hub) -> HubSession:
    """Let a client say hello to a hub, and hear what that says."""
    session = hub.open(Encoding.MSGPACK, now=5.0)
    core.connected(now=0.0)
    for data in core.advance(now=0.0):
        session.receive(data, now=5.0)
    for data in session.advance(now=5.0):
        core.receive(data, now=0.0)
    return session


def test_a_client_for_the_other_kind_of_robot_is_told_that_there_is_none(hub: Hub) -> None:
    said = "mobile robot ipr is driven here, not an arm", "arm puma560 is served here, not a mobile robot"
    for expects, met, text in ((Welcome, hub, said[0]), (MobileWelcome, make_hub(), said[1])):
        core = ClientCore(expects=expects)
        greeted(core, met)
        assert core.phase is Phase.CLOSED
        assert isinstance(core.problem, Problem)
        assert text in core.problem.text


def test_a_client_keeps_the_newest_of_each_kind(hub: Hub) -> None:
    core = ClientCore(expects=MobileWelcome)
    session = greeted(core, hub)
    assert core.newest == {}
    here = Posture(1.0, 2.0, 0.5)
    for number in (1, 2):
        hub.show(Postures(number, 5.0, here, Drive(0.0, 0.0), here))
        hub.tell(Tasks(reason=f"after {number}"))
        session.hub.advance(now=5.0 + number)
        for data in session.advance(now=5.0 + number):
            core.receive(data, now=float(number))
    assert core.newest[Postures].number == 2
    assert core.newest[Tasks].reason == "after 2"


class Workers:
    """Takes what is wanted, but no list."""

    def __init__(self) -> None:
        self.wanted: list[RobotTask] = []

    def order(self, task: RobotTask, *, now: float) -> str:
        self.wanted.append(task)
        return "no list is wanted here" if task.jobs is not None else ""

    def tasks(self, answers: int | None = None) -> Tasks:
        return Tasks(answers=answers)


def test_only_who_has_control_lets_the_robot_do_something_and_all_are_told() -> None:
    site, workers = Site(met().operator.robot), Workers()
    hub = Hub(site, Lease(), Access(free=OPEN), Robot(), config=HubConfig(rates=()), workers=workers)
    ada, bob = hub.open(Encoding.JSON, now=5.0), hub.open(Encoding.JSON, now=5.0)
    said(ada, HELLO)
    said(bob, HELLO | {"role": "viewer"})
    order: dict[str, Any] = {"type": "task", "number": 1, "task": {"go": {"x": 1, "y": 2}}}
    assert said(ada, order, now=5.1)[0]["code"] == "stale-epoch"
    lease = said(ada, {"type": "acquire", "number": 2}, now=5.2)[0]
    order |= {"epoch": lease["epoch"]}
    told = {message["type"]: message for message in said(bob, order, now=5.3)}
    assert told["problem"]["text"] == "a viewer commands nothing"
    assert not workers.wanted
    assert said(ada, order, now=5.4)[0]["answers"] == 1
    assert workers.wanted == [RobotTask(go=Goal(1.0, 2.0))]
    refused = said(ada, order | {"number": 3, "task": {"jobs": {}}}, now=5.5)[0]
    assert (refused["text"], refused["number"]) == ("no list is wanted here", 3)
    for wrong in ({}, {"go": {"x": 1, "y": 2}, "do": "run"}, {"do": "dance"}, {"halt": "so"}):
        assert said(ada, order | {"task": wrong}, now=5.6)[0]["code"] == "out-of-range"
    hub.tell(Seen(1.0, ((1.0, 2.0),)))
    hub.tell(Tasks(reason="old"))
    hub.tell(Tasks(reason="new"))
    for now, session in ((6.0, ada), (6.2, bob)):
        heard = {message["type"]: message for message in said(session, now=now)}
        assert heard["tasks"]["reason"] == "new"
        assert heard["seen"]["points"] == [[1.0, 2.0]]
        assert said(session, now=now + 0.1) == []


def test_a_hub_whose_robot_does_nothing_by_itself_says_so(hub: Hub) -> None:
    session = hub.open(Encoding.JSON, now=5.0)
    said(session, HELLO)
    assert "nothing by itself" in said(session, {"type": "task", "number": 1, "task": {"do": "run"}})[0]["text"]
